"""Linear slip weakening."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from quakedesign.fault.checks import require_nonnegative, require_positive
from quakedesign.fault.friction.base import FrictionLaw

if TYPE_CHECKING:
    import sympy as sp


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearSlipWeakening(FrictionLaw):
    """μ(slip) = residual + drop · max(0, 1 − slip/critical_slip).

    Friction has a kink at the critical slip, and would grow without bound for slip < 0; `extended` holds it there.

    Attributes
    ----------
    residual : float
        Kinetic friction coefficient [-], positive.
    drop : float
        Static minus kinetic friction coefficient [-], not negative.
    critical_slip : float
        Slip at which friction is kinetic d_c [m], positive.

    Raises
    ------
    ParameterError
        When a parameter is outside its range.
    """

    name: ClassVar[str] = "linear-slip-weakening"
    source: ClassVar[str] = "Ida (1972), J. Geophys. Res. 77(20), 3796; Andrews (1976), J. Geophys. Res. 81(20), 3575"
    domain: ClassVar[str] = "slip >= 0"

    residual: float = field(metadata={"unit": "", "symbol": r"\mu_{res}"})
    drop: float = field(metadata={"unit": "", "symbol": r"\Delta\mu"})
    critical_slip: float = field(metadata={"unit": "m", "symbol": "d_c"})

    def __post_init__(self) -> None:
        require_positive(residual=self.residual, critical_slip=self.critical_slip)
        require_nonnegative("It is the static minus the kinetic coefficient.", drop=self.drop)

    def coefficient(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] for slip ≥ 0."""
        import sympy as sp

        return self.residual + self.drop * sp.Max(0, 1 - slip / self.critical_slip)

    def extended(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-], held at its static value for slip < 0."""
        import sympy as sp

        return self.coefficient(sp.Max(slip, 0), rate)

    @property
    def bounds(self) -> tuple[float, float]:
        """Kinetic and static friction coefficient [-]."""
        return self.residual, self.residual + self.drop

    @property
    def slip_slope(self) -> float:
        """drop/d_c [1/m], between 0 and the critical slip."""
        return self.drop / self.critical_slip

    @property
    def rate_slope(self) -> float:
        """Zero: the law does not depend on the slip rate [s/m]."""
        return 0
