"""Friction with two states: a second evolution effect with another critical slip."""

from dataclasses import dataclass, field
from typing import ClassVar

import sympy as sp

from quakedesign.fault import FrictionLaw, friction_law
from quakedesign.fault.friction.rate_and_state import RateAndState
from quakedesign.fault.model import require_all, require_positive

SECOND_EFFECT, SECOND_SLIP = "second_effect", "second_slip"


@dataclass(frozen=True, slots=True, kw_only=True)
class _TwoStates(RateAndState):
    """μ = μ_0 + a log(v/v_0) + b log(v_0 θ/d_c) + b_2 log(v_0 θ_2/d_2); both states evolve as in the law `one`.

    The second effect may be negative. This law only describes records; no fault file can contain it.
    """

    state_names: ClassVar[tuple[str, ...]] = ("theta", "theta_2")
    state_units: ClassVar[tuple[str, ...]] = ("s", "s")
    one: ClassVar[type[RateAndState]]

    second_effect: float = field(metadata={"unit": "", "symbol": "b_2"})
    second_slip: float = field(metadata={"unit": "m", "symbol": "d_2"})

    def __post_init__(self) -> None:
        signed = (SECOND_EFFECT, "stress_sensitivity")
        positive = {name: getattr(self, name) for name in self.quantities() if name not in signed}
        require_all(lambda: require_positive(**positive), self._require_working_range)

    def friction(self, rate: sp.Expr, theta: sp.Expr) -> sp.Expr:
        """Friction coefficient [-] of the first state alone."""
        return self.one.friction(self, rate, theta)

    def ageing(self, rate: sp.Expr, theta: sp.Expr) -> sp.Expr:
        """θ' [-] of the first state."""
        return self.one.ageing(self, rate, theta)

    @property
    def _state_slope(self) -> sp.Expr:
        raise NotImplementedError

    def coefficient(self, slip: sp.Expr, rate: sp.Expr, *state: sp.Expr) -> sp.Expr:
        """Friction coefficient [-] at a rate [m/s] and both states [s]."""
        first, second = state
        evolved = sp.log(self.reference_rate * second / self.second_slip)
        return self.friction(rate, first) + self.second_effect * evolved

    def state_rates(self, slip: sp.Expr, rate: sp.Expr, *state: sp.Expr) -> tuple[sp.Expr, ...]:
        """θ' and θ_2' [-]."""
        first, second = state
        other = self._with_values(
            {name: getattr(self, name) for name in self.quantities()} | {"critical_slip": self.second_slip}
        )
        return self.ageing(rate, first), other.ageing(rate, second)

    def steady_state(self, rate: sp.Expr) -> tuple[sp.Expr, ...]:
        """θ = d_c/rate and θ_2 = d_2/rate [s]."""
        return self.critical_slip / rate, self.second_slip / rate


def with_two_states(name: str) -> type[FrictionLaw]:
    """Two-state version of the ageing or the slip law, by its name."""
    one = friction_law(name)
    return type(
        "TwoStates", (_TwoStates,), {"one": one, "name": f"{name}, two states", "source": one.source, "__slots__": ()}
    )
