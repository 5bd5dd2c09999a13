"""Exponential slip weakening."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from quakedesign.fault.checks import require_nonnegative, require_positive
from quakedesign.fault.friction.base import FrictionLaw

if TYPE_CHECKING:
    import sympy as sp


@dataclass(frozen=True, slots=True, kw_only=True)
class ExponentialSlipWeakening(FrictionLaw):
    """μ(slip) = residual + drop · exp(−slip/critical_slip), eq. mu with drop = −Δμ > 0.

    The law meets the bounds of eq. mug only for slip ≥ 0; `extended` holds μ at its static value for
    slip < 0 (ERRATA 12).

    Attributes
    ----------
    residual : float
        Kinetic friction coefficient μ_res [-], positive.
    drop : float
        Static minus kinetic friction coefficient −Δμ [-], not negative.
    critical_slip : float
        Characteristic slip d_c [m], positive.

    Raises
    ------
    ParameterError
        When a parameter is outside its range.
    """

    name: ClassVar[str] = "exponential-slip-weakening"
    source: ClassVar[str] = "Kanamori and Brodsky (2004), Rep. Prog. Phys. 67, 1429; eq. mu of the paper"
    domain: ClassVar[str] = "slip >= 0"

    residual: float = field(metadata={"unit": "", "symbol": r"\mu_{res}"})
    drop: float = field(metadata={"unit": "", "symbol": r"\Delta\mu"})
    critical_slip: float = field(metadata={"unit": "m", "symbol": "d_c"})

    def __post_init__(self) -> None:
        require_positive(residual=self.residual, critical_slip=self.critical_slip)
        require_nonnegative(
            "It is the static minus the kinetic coefficient; the paper's Δμ has the opposite sign.", drop=self.drop
        )

    def coefficient(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] for slip ≥ 0 (eq. mu)."""
        import sympy as sp

        return self.residual + self.drop * sp.exp(-slip / self.critical_slip)

    def extended(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-], held at its static value for slip < 0 (ERRATA 12)."""
        import sympy as sp

        return self.coefficient(sp.Max(slip, 0), rate)

    @property
    def bounds(self) -> tuple[float, float]:
        """μ_res and μ_max = μ_res − Δμ [-]."""
        return self.residual, self.residual + self.drop

    @property
    def slip_slope(self) -> float:
        """|Δμ|/d_c [1/m], reached at slip 0."""
        return self.drop / self.critical_slip

    @property
    def rate_slope(self) -> float:
        """Zero: the law does not depend on the slip rate [s/m]."""
        return 0
