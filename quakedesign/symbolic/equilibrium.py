"""Where a fault can rest or slide steadily."""

from dataclasses import dataclass
from fractions import Fraction

import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.symbolic import plant, state_plant
from quakedesign.symbolic.state_plant import loading_rate


@dataclass(frozen=True, slots=True, kw_only=True)
class Equilibrium:
    """Steady sliding of a fault, in symbols.

    Attributes
    ----------
    rate : Expr
        Slip rate v_∞ [m/s]; zero at rest.
    state : dict of Symbol to Expr
    friction : Expr
        μ* [-].
    stretch : Expr
        Slip of the far end minus slip of the fault [m] that holds friction and damping at pressure p.
    """

    rate: sp.Expr
    state: dict[sp.Symbol, sp.Expr]
    friction: sp.Expr
    stretch: sp.Expr

    def _repr_latex_(self) -> str:
        pairs = {r"\dot\delta": self.rate, **self.state, r"\mu^*": self.friction, r"\delta_\infty-\delta": self.stretch}
        return r"$\displaystyle " + r",\; ".join(f"{n}={sp.latex(v)}" for n, v in pairs.items()) + "$"


def equilibrium(fault: Fault) -> Equilibrium:
    """Steady sliding at v_∞ with the fault's friction law, from its force balance, in symbols.

    Parameters
    ----------
    fault : Fault
    """
    law = fault.friction.symbolic()
    at = loading_rate if law.operating_rate != 0 else sp.Integer(0)
    friction = sp.sympify(law.steady_coefficient(at))
    far, z, v, acceleration = sp.symbols("delta_far z v a", real=True)
    balance = plant.force_balance().replace(plant.disturbance, lambda *_: sp.Integer(0))
    steady = balance.replace(plant.mu, lambda *_: plant.mu_star).subs({acceleration: 0, v: at})
    stretch = sp.collect(sp.expand(sp.solve(steady, far)[0] - z), [plant.A * plant.mu_star / plant.k])
    states = state_plant.state_symbols(law.state_names)
    return Equilibrium(
        rate=at,
        state=dict(zip(states, law.steady_state(at), strict=True)),
        friction=friction,
        stretch=stretch.subs(plant.mu_star, friction),
    )


def operating_rate(fault: Fault, rate: float | str | Fraction | None = None) -> Fraction:
    """Slip rate [m/s] of the equilibrium that is studied, checked against the law.

    Raises
    ------
    ParameterError
        When the rate is outside of the law's working range, or sliding at it is not steady.
    """
    law = fault.friction
    value = rational(law.operating_rate if rate is None else rate, "loading_rate")
    low, high = law.working_rates
    if value < 0 or not low <= value <= high:
        raise ParameterError(
            f"loading_rate must be zero or positive and in the working range {low!r} to {high!r} m/s of {law.name}. "
            f"Received {float(value)!r} m/s. Change it, or widen the range of the law."
        )
    if value > 0 and not state_plant.is_steady(law.symbolic()):
        raise ParameterError(
            f"loading_rate must be zero for {law.name}, whose friction changes with slip, so that sliding is never "
            f"steady. Received {float(value)!r} m/s."
        )
    return value
