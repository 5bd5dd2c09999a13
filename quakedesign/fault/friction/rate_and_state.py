"""Rate-and-state friction: ageing law, slip law, and the regularised form.

The base class has the parameters, the working range, and the bounds of friction on this range. The state evolves by
Dieterich's ageing law or Ruina's slip law; the regularised form is finite at zero slip rate.
"""

from abc import abstractmethod
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, ClassVar

from quakedesign.errors import ParameterError, require_known
from quakedesign.exact import float_above, float_below, fraction_of, rational
from quakedesign.fault.friction.base import FrictionLaw
from quakedesign.fault.model import require_all, require_nonnegative, require_positive

if TYPE_CHECKING:
    import sympy as sp

_DIGITS = 40  # of irrational bounds before rounding
_ROUNDING = Fraction(1, 10**30)  # relative margin that covers the rounding to `_DIGITS`


@dataclass(frozen=True, slots=True, kw_only=True)
class RateAndState(FrictionLaw):
    """μ depends on the slip rate v and on one state θ [s], the age of the contacts.

    Friction increases with v and θ, so on the working range v_s ≤ v ≤ v_f, d_c/v_f ≤ θ ≤ d_c/v_s its extremes are at
    two corners. As long as v stays between v_s and v_f, θ cannot leave its interval: both evolution laws point inward
    at its ends. Outside the range the bounds do not apply to `coefficient` (ERRATA 13).

    Attributes
    ----------
    reference_coefficient : float
        Friction coefficient μ_0 [-] of steady sliding at the reference rate, positive.
    direct_effect : float
        Direct effect a [-], positive.
    evolution_effect : float
        Evolution effect b [-], positive; for b > a, steady-state friction weakens with rate.
    critical_slip : float
        Slip d_c [m] over which the state evolves, positive.
    reference_rate : float
        Rate v_0 [m/s], positive: loading rate of the natural cycle.
    slowest_rate : float
        Lower end v_s [m/s] of the working range, positive, at most v_0.
    fastest_rate : float
        Upper end v_f [m/s] of the working range, at least v_0.
    stress_sensitivity : float
        α [-], not negative: the effective normal stress σ adds −(αθ/(bσ))·dσ/dt to dθ/dt (Linker and Dieterich 1992, J.
        Geophys. Res. 97(B4), 4923); 0 by default. The bounds of friction are for a constant σ.

    Raises
    ------
    ParameterError
        When a parameter is outside its range, or the law is evaluated without a state.
    """

    domain: ClassVar[str] = "slowest_rate <= rate <= fastest_rate, theta between the steady states at these two rates"
    state_names: ClassVar[tuple[str, ...]] = ("theta",)
    state_units: ClassVar[tuple[str, ...]] = ("s",)

    reference_coefficient: float = field(metadata={"unit": "", "symbol": r"\mu_0", "example": 0.6})
    direct_effect: float = field(metadata={"unit": "", "symbol": "a", "example": 0.01})
    evolution_effect: float = field(metadata={"unit": "", "symbol": "b", "example": 0.015})
    critical_slip: float = field(metadata={"unit": "m", "symbol": "d_c", "example": "2 cm"})
    reference_rate: float = field(metadata={"unit": "m/s", "symbol": "v_0", "example": "1 um/s"})
    slowest_rate: float = field(metadata={"unit": "m/s", "symbol": "v_s", "example": "1e-12 m/s"})
    fastest_rate: float = field(metadata={"unit": "m/s", "symbol": "v_f", "example": "1 m/s"})
    stress_sensitivity: float = field(default=0.0, metadata={"unit": "", "symbol": r"\alpha"})

    def __post_init__(self) -> None:
        positive = {name: getattr(self, name) for name in self.quantities() if name != "stress_sensitivity"}
        require_all(
            lambda: require_positive(**positive),
            lambda: require_nonnegative(stress_sensitivity=self.stress_sensitivity),
            self._require_working_range,
        )

    def _require_working_range(self) -> None:
        if not self.slowest_rate <= self.reference_rate <= self.fastest_rate:
            raise ParameterError(
                f"reference_rate must lie between slowest_rate, {self.slowest_rate!r} m/s, and fastest_rate, "
                f"{self.fastest_rate!r} m/s. Received {self.reference_rate!r} m/s. Widen the working range."
            )

    @abstractmethod
    def friction(self, rate: "sp.Expr", theta: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] at a rate [m/s] and a state [s]; increases with both."""

    @abstractmethod
    def ageing(self, rate: "sp.Expr", theta: "sp.Expr") -> "sp.Expr":
        """θ' [-]; zero where rate · θ = d_c."""

    @property
    @abstractmethod
    def _state_slope(self) -> "sp.Expr":
        """Largest |θ'/(θ · rate)| · d_c [-] on the working range, in exact numbers."""

    def coefficient(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] at a rate [m/s] > 0 and a state [s] > 0, at any slip."""
        return self.friction(rate, self._theta(state))

    def extended(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] with rate and state clipped to the working range."""
        import sympy as sp

        def clip(value: "sp.Expr", low: "sp.Expr", high: "sp.Expr") -> "sp.Expr":
            return sp.Min(sp.Max(value, low), high)

        theta = clip(self._theta(state), self.critical_slip / self.fastest_rate, self.critical_slip / self.slowest_rate)
        return self.friction(clip(rate, self.slowest_rate, self.fastest_rate), theta)

    def state_rates(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "tuple[sp.Expr, ...]":
        """θ' [-]."""
        return (self.ageing(rate, self._theta(state)),)

    @property
    def stress_exponents(self) -> tuple[float, ...]:
        """−α/b [-]."""
        return (-self.stress_sensitivity / self.evolution_effect,)

    def steady_state(self, rate: "sp.Expr") -> "tuple[sp.Expr, ...]":
        """θ = d_c/rate [s]."""
        return (self.critical_slip / rate,)

    def _theta(self, state: "tuple[sp.Expr, ...]") -> "sp.Expr":
        if len(state) != 1:
            raise ParameterError(
                f"{self.name} needs one state, theta [s]. Received {len(state)}. "
                "Pass it after the slip rate, or call steady_coefficient(rate)."
            )
        return state[0]

    @property
    def operating_rate(self) -> float:
        """Reference rate [m/s], at which the fault slides steadily; there is no equilibrium at rest."""
        return self.reference_rate

    @property
    def working_rates(self) -> tuple[float, float]:
        """Slip rates [m/s] between which the bounds hold."""
        return self.slowest_rate, self.fastest_rate

    @property
    def bounds(self) -> tuple[float, float]:
        """μ(v_s, d_c/v_f) and μ(v_f, d_c/v_s) [-], rounded outward."""
        law = self.exact()
        lowest = law.friction(law.slowest_rate, law.critical_slip / law.fastest_rate)
        highest = law.friction(law.fastest_rate, law.critical_slip / law.slowest_rate)
        return outward(lowest, up=False), outward(highest, up=True)

    @property
    def slip_slope(self) -> float:
        """Bound [1/m] on the change of friction per slip due to the state, |∂μ/∂θ · θ'|/v ≤ (b/θ)|θ'|/v, rounded up."""
        law = self.exact()
        return outward(law.evolution_effect / law.critical_slip * law._state_slope, up=True)

    @property
    def rate_slope(self) -> float:
        """Bound a/v_s [s/m] of ∂μ/∂v, reached by the logarithmic law at the slowest rate, rounded up."""
        law = self.exact()
        return outward(law.direct_effect / law.slowest_rate, up=True)


def outward(value: "sp.Expr", *, up: bool) -> float:
    """Float not below (with `up`) or not above an exact SymPy number."""
    import sympy as sp

    if value.is_Rational:
        exact = fraction_of(value)
    else:
        near = rational(str(sp.N(value, _DIGITS)))
        exact = near + abs(near) * (_ROUNDING if up else -_ROUNDING)
    return float_above(exact) if up else float_below(exact)


def aging_law_rate(rate: "sp.Expr", theta: "sp.Expr", critical_slip: "sp.Expr") -> "sp.Expr":
    """θ' = 1 − vθ/d_c [-] (Dieterich 1979; Ruina 1983): contacts age at rest too."""
    return 1 - rate * theta / critical_slip


def slip_rate(rate: "sp.Expr", theta: "sp.Expr", critical_slip: "sp.Expr") -> "sp.Expr":
    """θ' = −(vθ/d_c) log(vθ/d_c) [-] (Ruina 1983): the state changes only with slip."""
    import sympy as sp

    share = rate * theta / critical_slip
    return -share * sp.log(share)


def aging_law_slope(slowest: "sp.Expr", fastest: "sp.Expr") -> "sp.Expr":
    """Largest |1/u − 1| [-] for u = vθ/d_c between v_s/v_f and v_f/v_s: v_f/v_s − 1."""
    return fastest / slowest - 1


def slip_law_slope(slowest: "sp.Expr", fastest: "sp.Expr") -> "sp.Expr":
    """Largest |log u| [-] for u = vθ/d_c between v_s/v_f and v_f/v_s: log(v_f/v_s)."""
    import sympy as sp

    return sp.log(fastest / slowest)


def logarithmic(law: "RateAndState", rate: "sp.Expr", theta: "sp.Expr") -> "sp.Expr":
    """μ_0 + a log(v/v_0) + b log(v_0 θ/d_c) [-] (Dieterich 1979; Ruina 1983)."""
    import sympy as sp

    return (
        law.reference_coefficient
        + law.direct_effect * sp.log(rate / law.reference_rate)
        + law.evolution_effect * sp.log(law.reference_rate * theta / law.critical_slip)
    )


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
        return aging_law_rate(rate, theta, self.critical_slip)

    @property
    def _state_slope(self) -> "sp.Expr":
        return aging_law_slope(self.slowest_rate, self.fastest_rate)


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


# ----------------------------------------------------------------------
# Regularised rate-and-state friction, finite at zero slip rate.

EVOLUTIONS = {"aging": (aging_law_rate, aging_law_slope), "slip": (slip_rate, slip_law_slope)}


@dataclass(frozen=True, slots=True, kw_only=True)
class RegularisedRateAndState(RateAndState):
    """μ = a arsinh(v/(2v_0) · exp((μ_0 + b log(v_0 θ/d_c))/a)): thermally activated contacts in both directions.

    Odd in v, so μ(0) = 0, and a positive lower bound of friction exists only on a working range (ERRATA 13). The slopes
    ∂μ/∂v and ∂μ/∂θ are everywhere below those of the logarithmic law.

    Attributes
    ----------
    evolution : str
        ``"aging"`` (Dieterich) or ``"slip"`` (Ruina).

    Raises
    ------
    ParameterError
        As `RateAndState`, and for an unknown evolution.
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
