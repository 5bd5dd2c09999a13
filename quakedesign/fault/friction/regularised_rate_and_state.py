"""Rate-and-state friction that stays finite at zero slip rate."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from quakedesign.errors import require_known
from quakedesign.fault.friction.rate_and_state import RateAndState, aging_rate, aging_slope, slip_law_slope, slip_rate

if TYPE_CHECKING:
    import sympy as sp

EVOLUTIONS = {"aging": (aging_rate, aging_slope), "slip": (slip_rate, slip_law_slope)}


@dataclass(frozen=True, slots=True, kw_only=True)
class RegularisedRateAndState(RateAndState):
    """μ = a arsinh(v/(2v_0) · exp((μ_0 + b log(v_0 θ/d_c))/a)): thermally activated contacts in both directions.

    Odd in v, so μ(0) = 0 and no positive lower bound of friction exists but on a working range (ERRATA 13). The
    slope ∂μ/∂v is below that of the logarithmic law everywhere, as is ∂μ/∂θ.

    Attributes
    ----------
    reference_coefficient, direct_effect, evolution_effect, critical_slip, reference_rate, slowest_rate, fastest_rate
        As in `RateAndState`.
    evolution : str
        ``"aging"`` (Dieterich) or ``"slip"`` (Ruina).

    Raises
    ------
    ParameterError
        As `RateAndState`, and for another evolution.
    """

    name: ClassVar[str] = "regularised-rate-and-state"
    source: ClassVar[str] = (
        "Rice and Ben-Zion (1996), Proc. Natl. Acad. Sci. 93, 3811; Lapusta, Rice, Ben-Zion and Zheng (2000), "
        "J. Geophys. Res. 105(B10), 23765; Rice, Lapusta and Ranjith (2001), J. Mech. Phys. Solids 49, 1865"
    )

    evolution: str = field(default="aging", metadata={"choices": tuple(EVOLUTIONS)})

    def __post_init__(self) -> None:
        RateAndState.__post_init__(self)
        require_known(self.evolution, EVOLUTIONS, "evolution")

    def friction(self, rate: "sp.Expr", theta: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] (Rice and Ben-Zion 1996)."""
        import sympy as sp

        ratio = self.evolution_effect / self.direct_effect
        strength = sp.exp(self.reference_coefficient / self.direct_effect)
        strength *= sp.exp(ratio * sp.log(self.reference_rate * theta / self.critical_slip))
        return self.direct_effect * sp.asinh(rate / (2 * self.reference_rate) * strength)

    def ageing(self, rate: "sp.Expr", theta: "sp.Expr") -> "sp.Expr":
        """θ' [-] of the chosen evolution."""
        return EVOLUTIONS[self.evolution][0](rate, theta, self.critical_slip)

    @property
    def _state_slope(self) -> "sp.Expr":
        return EVOLUTIONS[self.evolution][1](self.slowest_rate, self.fastest_rate)
