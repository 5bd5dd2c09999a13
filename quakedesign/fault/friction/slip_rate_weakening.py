"""Slip-rate weakening."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from quakedesign.fault.checks import require_all, require_positive
from quakedesign.fault.friction.weakening import Weakening

if TYPE_CHECKING:
    import sympy as sp


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipRateWeakening(Weakening):
    """μ(rate) = residual + drop/(1 + rate/critical_rate) for rate ≥ 0, even in the rate when extended.

    The coefficient is that of motion forward; whether friction opposes motion is the plant's matter (ERRATA 14).

    Attributes
    ----------
    critical_rate : float
        Rate v_c [m/s] at which half of the drop has happened, positive.
    """

    name: ClassVar[str] = "slip-rate-weakening"
    source: ClassVar[str] = (
        "Carlson and Langer (1989), Phys. Rev. A 40, 6470; Huang and Turcotte (1992), Pure Appl. Geophys. 138, 569; "
        "with a residual as in Cochard and Madariaga (1994), Pure Appl. Geophys. 142, 419"
    )
    domain: ClassVar[str] = "rate >= 0"

    critical_rate: float = field(metadata={"unit": "m/s", "symbol": "v_c"})

    def __post_init__(self) -> None:
        require_all(lambda: Weakening.__post_init__(self), lambda: require_positive(critical_rate=self.critical_rate))

    def coefficient(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] for rate ≥ 0."""
        return self.residual + self.drop / (1 + rate / self.critical_rate)

    def extended(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] of the size of the rate."""
        import sympy as sp

        return self.coefficient(slip, sp.Abs(rate))

    @property
    def rate_slope(self) -> float:
        """drop/v_c [s/m], reached at rest."""
        return self.drop / self.critical_rate
