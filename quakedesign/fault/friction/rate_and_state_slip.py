"""Rate-and-state friction with Ruina's evolution of the state."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from quakedesign.fault.friction.rate_and_state import RateAndState, logarithmic, slip_law_slope, slip_rate

if TYPE_CHECKING:
    import sympy as sp


@dataclass(frozen=True, slots=True, kw_only=True)
class RateAndStateSlip(RateAndState):
    """μ = μ_0 + a log(v/v_0) + b log(v_0 θ/d_c), θ' = −(vθ/d_c) log(vθ/d_c): parameters of `RateAndState`."""

    name: ClassVar[str] = "rate-and-state-slip"
    source: ClassVar[str] = "Ruina (1983), J. Geophys. Res. 88(B12), 10359"

    def friction(self, rate: "sp.Expr", theta: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] (Ruina 1983)."""
        return logarithmic(self, rate, theta)

    def ageing(self, rate: "sp.Expr", theta: "sp.Expr") -> "sp.Expr":
        """θ' = −(vθ/d_c) log(vθ/d_c) [-]."""
        return slip_rate(rate, theta, self.critical_slip)

    @property
    def _state_slope(self) -> "sp.Expr":
        return slip_law_slope(self.slowest_rate, self.fastest_rate)
