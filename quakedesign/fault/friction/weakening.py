"""What friction laws share that fall from a static to a residual coefficient."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from quakedesign.fault.checks import require_all, require_nonnegative, require_positive
from quakedesign.fault.friction.base import FrictionLaw

if TYPE_CHECKING:
    import sympy as sp


@dataclass(frozen=True, slots=True, kw_only=True)
class Weakening(FrictionLaw):
    """A law without state that falls from residual + drop to residual.

    Attributes
    ----------
    residual : float
        Kinetic friction coefficient μ_res [-], positive.
    drop : float
        Static minus kinetic friction coefficient Δμ [-], not negative; the paper's Δμ has the opposite sign.

    Raises
    ------
    ParameterError
        When a parameter is outside its range.
    """

    residual: float = field(metadata={"unit": "", "symbol": r"\mu_{res}"})
    drop: float = field(metadata={"unit": "", "symbol": r"\Delta\mu"})

    def __post_init__(self) -> None:
        remedy = "It is the static minus the kinetic coefficient; the paper's Δμ has the opposite sign."
        require_all(
            lambda: require_positive(residual=self.residual), lambda: require_nonnegative(remedy, drop=self.drop)
        )

    @property
    def bounds(self) -> tuple[float, float]:
        """Kinetic and static friction coefficient [-], μ_res and μ_max = μ_res + drop."""
        return self.residual, self.residual + self.drop

    @property
    def slip_slope(self) -> float:
        """Zero unless told: the law does not depend on the slip [1/m]."""
        return 0

    @property
    def rate_slope(self) -> float:
        """Zero unless told: the law does not depend on the slip rate [s/m]."""
        return 0


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipWeakening(Weakening):
    """A law of the slip alone, steepest where slip begins.

    Attributes
    ----------
    critical_slip : float
        Characteristic slip d_c [m], positive.
    """

    critical_slip: float = field(metadata={"unit": "m", "symbol": "d_c"})

    def __post_init__(self) -> None:
        require_all(lambda: Weakening.__post_init__(self), lambda: require_positive(critical_slip=self.critical_slip))

    def extended(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-], held at its static value for slip < 0 (ERRATA 12)."""
        import sympy as sp

        return self.coefficient(sp.Max(slip, 0), rate)

    @property
    def slip_slope(self) -> float:
        """drop/d_c [1/m], reached at slip 0."""
        return self.drop / self.critical_slip
