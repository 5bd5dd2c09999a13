"""Rate-and-state friction with Dieterich's evolution of the state."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from quakedesign.fault.friction.rate_and_state import RateAndState, aging_rate, aging_slope, logarithmic

if TYPE_CHECKING:
    import sympy as sp


@dataclass(frozen=True, slots=True, kw_only=True)
class RateAndStateAging(RateAndState):
    """μ = μ_0 + a log(v/v_0) + b log(v_0 θ/d_c), θ' = 1 − vθ/d_c: parameters and working range of `RateAndState`."""

    name: ClassVar[str] = "rate-and-state-aging"
    source: ClassVar[str] = (
        "Dieterich (1979), J. Geophys. Res. 84(B5), 2161; Ruina (1983), J. Geophys. Res. 88(B12), 10359"
    )

    def friction(self, rate: "sp.Expr", theta: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] (Dieterich 1979, in the notation of Ruina 1983)."""
        return logarithmic(self, rate, theta)

    def ageing(self, rate: "sp.Expr", theta: "sp.Expr") -> "sp.Expr":
        """θ' = 1 − vθ/d_c [-]."""
        return aging_rate(rate, theta, self.critical_slip)

    @property
    def _state_slope(self) -> "sp.Expr":
        return aging_slope(self.slowest_rate, self.fastest_rate)
