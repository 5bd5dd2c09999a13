"""Equations of a fault and of its laws in LaTeX, as their expressions are."""

from typing import Any

import sympy as sp

from quakedesign.controllers import Controller, Signals
from quakedesign.fault import Fault
from quakedesign.simulation.state_plants import spring_acceleration, stretch
from quakedesign.symbolic import plant
from quakedesign.symbolic.state_plant import rate, state_symbols

_LONG = 100  # numerators and denominators of more are written as decimals


def coordinates(fault: Fault) -> str:
    """What the plant is written in, for a sentence that goes on with its equations."""
    if not fault.friction.state_names:
        return "Slip x₁ and slip rate x₂, measured from the equilibrium without pressure,"
    return "Slip x₁, slip rate v, the stretch s of the spring, whose far end rests, and the state of friction"


def plant_latex(fault: Fault) -> list[str]:
    """Plant of a fault, and its friction law."""
    if fault.friction.state_names:
        return _with_state(fault)
    friction = plant.mu(plant.x1, plant.x2)
    acceleration = plant.shifted_acceleration().subs(friction, sp.Symbol("mu"))
    law = sp.sympify(fault.friction.symbolic().coefficient(plant.x1, plant.x2))
    motion = rf"\dot x_1 = x_2, \qquad \dot x_2 = {sp.latex(acceleration)}"
    return [motion, rf"\mu = {sp.latex(law)}"]


def _with_state(fault: Fault) -> list[str]:
    states = state_symbols(fault.friction.state_names)
    law, mu, named = fault.friction.symbolic(), sp.Symbol("mu"), {stretch: sp.Symbol("s", real=True)}
    acceleration = spring_acceleration().replace(plant.mu, lambda *_: mu).subs(named)
    moved = zip(states, law.state_rates(plant.x1, rate, *states), strict=True)
    return [
        rf"\dot x_1 = v, \qquad \dot s = -v, \qquad \dot v = {sp.latex(acceleration)}",
        rf"\mu = {sp.latex(sp.sympify(law.coefficient(plant.x1, rate, *states)))}",
        *(rf"\dot {{{sp.latex(state)}}} = {sp.latex(sp.sympify(change))}" for state, change in moved),
    ]


def law_latex(law: Controller | None) -> list[str]:
    """Pressure that a law asks for while a fault moves and the rates of its states, in four digits; none of no law."""
    if law is None:
        return []
    law = law.while_moving
    states = sp.symbols([f"z_{i}" for i in range(1, len(law.integral_units) + 1)], real=True)
    signals = Signals(
        slip=plant.x1,
        slip_rate=plant.x2,
        slip_error=plant.e1,
        slip_rate_error=plant.e2,
        integrals=tuple(states),
        reference_acceleration=plant.reference(plant.t).diff(plant.t, 2),
    )
    rates = zip(states, law.integral_rates(signals), strict=True)
    named = [("p", law.pressure(signals)), *((rf"\dot {{{z}}}", rate) for z, rate in rates)]
    return [f"{name} = {_written(expression)}" for name, expression in named]


def _written(expression: Any) -> str:
    """LaTeX with numbers of many digits to four of them."""
    sums = sp.expand(sp.sympify(expression))
    numbers = {part for part in sums.atoms(sp.Pow) if part.is_number}
    numbers |= {n for n in sums.atoms(sp.Rational) if max(abs(n.p), n.q) > _LONG}
    short = sums.xreplace({number: number.evalf(4) for number in numbers})
    whole = sp.Add(
        *(sp.Mul(*(f.evalf(4) if f.is_Float else f for f in sp.Mul.make_args(t))) for t in sp.Add.make_args(short))
    )
    return str(sp.latex(whole))
