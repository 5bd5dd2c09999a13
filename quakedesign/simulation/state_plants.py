"""Spring-sliders whose friction has a state, as differential equations in logarithms of rate and state."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import sympy as sp

from quakedesign.errors import ParameterError, SimulationError
from quakedesign.fault import Fault, FrictionLaw
from quakedesign.fault.checks import require_nonnegative, require_positive
from quakedesign.rationals import rational
from quakedesign.symbolic import plant
from quakedesign.symbolic.casadi_printer import to_casadi
from quakedesign.symbolic.state_plant import loading_rate, rate, state_symbols, without_overflow

slip, stretch, pressure_rate = sp.symbols("slip stretch pressure_rate", real=True)
_WIDEST = 1e3  # change of the logarithm of a rate that is looked for


@dataclass(frozen=True, kw_only=True)
class SpringSlider:
    """A block per unit of area: mass·v' = stiffness·stretch − (normal_stress − p)·μ(slip, v, state) − damping·v.

    The stretch of the spring grows with the loading rate less the slip rate. Without mass the balance of forces is a
    constraint, which its time derivative turns into v' (quasi-dynamic; needs (normal_stress − p)·∂μ/∂v + damping > 0).
    The pressure p changes the state as well, if the law says so (`FrictionLaw.stress_exponents`).

    Attributes
    ----------
    law : FrictionLaw
    stiffness : float
        [Pa/m], positive.
    normal_stress : float
        Effective normal stress [Pa] where p = 0, positive.
    damping : float
        [Pa·s/m], not negative.
    mass : float
        [kg/m²]; 0: quasi-dynamic.

    Raises
    ------
    ParameterError
        When a value is outside its range.
    """

    law: FrictionLaw
    stiffness: float
    normal_stress: float
    damping: float = 0.0
    mass: float = 0.0

    def __post_init__(self) -> None:
        require_positive(stiffness=self.stiffness, normal_stress=self.normal_stress)
        require_nonnegative(damping=self.damping, mass=self.mass)

    @classmethod
    def of(cls, fault: Fault, *, inertia: bool = True) -> "SpringSlider":
        """Spring-slider of a fault, with its damping.

        For radiation damping replace the fault's damping by `quakedesign.fault.defaults.radiation_damping`.
        """
        return cls(
            law=fault.friction,
            stiffness=fault.stiffness / fault.area,
            normal_stress=fault.effective_normal_stress,
            damping=fault.damping / fault.area,
            mass=fault.mass / fault.area if inertia else 0.0,
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Variables of `rates`: slip [m], stretch [m], log of the rate [m/s], logs of the states (in SI units)."""
        return ("slip", "stretch", "log_slip_rate", *(f"log_{name}" for name in self.law.state_names))

    @property
    def numbers(self) -> dict[sp.Symbol, sp.Rational]:
        """Exact values for the symbols of the force balance, of an area of 1 m²; a massless block has any mass."""
        held = {
            plant.m: self.mass or 1.0,
            plant.k: self.stiffness,
            plant.eta: self.damping,
            plant.sigma: self.normal_stress,
        }
        exact = {symbol: sp.Rational(str(rational(value))) for symbol, value in held.items()}
        return exact | {plant.A: sp.Integer(1)}

    @cached_property
    def derivation(self) -> tuple[sp.Expr, ...]:
        """Rates of slip, stretch, v and the states, in these, the pressure, `loading_rate` and `pressure_rate`."""
        law, states = self.law.exact(), state_symbols(self.law.state_names)
        stressing = -pressure_rate / (self.numbers[plant.sigma] - plant.p)
        state_rates = tuple(
            change + exponent * x * stressing
            for change, exponent, x in zip(
                law.state_rates(slip, rate, *states), law.stress_exponents, states, strict=True
            )
        )
        friction = without_overflow(law.coefficient(slip, rate, *states))
        acceleration = spring_acceleration().replace(plant.mu, lambda *_: friction)
        acceleration = acceleration.subs(self.numbers)
        moving = (rate, loading_rate - rate)
        if not self.mass:
            carried = zip((slip, stretch, *states, plant.p), (*moving, *state_rates, pressure_rate), strict=True)
            change = sum((acceleration.diff(x) * dx for x, dx in carried), start=sp.Integer(0))
            acceleration = -change / acceleration.diff(rate)
        return (*moving, acceleration, *state_rates)

    @cached_property
    def rates(self) -> Any:
        """CasADi Function (y as in `names`, (loading rate [m/s], p [Pa], dp/dt [Pa/s])) → dy/dt, Jacobian."""
        y, load, values = self._variables()
        known = values | {loading_rate: load[0], plant.p: load[1], pressure_rate: load[2]}
        _, _, *logged = to_casadi(self.derivation, known, [y[0], y[2]])
        logged = [change / values[x] for change, x in zip(logged, list(values)[2:], strict=True)]
        field = ca.cse([ca.vertcat(values[rate], load[0] - values[rate], *logged)])[0]
        return ca.Function("rates", [y, load], [field, ca.jacobian(field, y)])

    @cached_property
    def readings(self) -> Any:
        """CasADi Function (y, p [Pa]) → friction coefficient [-], driving less resisting stress [Pa]."""
        y, load, values = self._variables()
        law, states = self.law.exact(), state_symbols(self.law.state_names)
        (friction,) = to_casadi([without_overflow(law.coefficient(slip, rate, *states))], values)
        driving = self.stiffness * y[1] - self.damping * values[rate]
        pressure = load[1]
        return ca.Function("readings", [y, pressure], [friction, driving - (self.normal_stress - pressure) * friction])

    def start(self, at_rate: float, states: tuple[float, ...] | None = None, pressure: float = 0.0) -> list[float]:
        """Vector y with the forces in balance at a rate [m/s] and a pressure [Pa], in its steady state unless told.

        Raises
        ------
        ParameterError
            When the rate or a state is not positive, or the number of states is not that of the law.
        """
        require_positive("Rate and state enter by their logarithms.", start_rate=at_rate)
        held = self.law.steady_state(at_rate) if states is None else states
        if len(held) != len(self.law.state_names):
            raise ParameterError(f"start_state must hold {len(self.law.state_names)} values. Received {len(held)}.")
        require_positive(
            "Rate and state enter by their logarithms.", **dict(zip(self.law.state_names, held, strict=True))
        )
        logs = [float(sp.log(rational_number(value)).evalf(30)) for value in (at_rate, *held)]
        friction = float(sp.N(self.law.exact().coefficient(0, *map(rational_number, (at_rate, *held))), 30))
        resisting = (self.normal_stress - pressure) * friction + self.damping * at_rate
        return [0.0, resisting / self.stiffness, *logs]

    def stepped(self, y: "np.ndarray", before: float, after: float) -> "np.ndarray":
        """Vector y after a step of the pressure [Pa]: no slip meanwhile, but of the state what the law says.

        Without mass the slip rate jumps to where the forces balance again.

        Raises
        ------
        SimulationError
            When they do at no rate.
        """
        found = np.array(y)
        change = math.log((self.normal_stress - after) / (self.normal_stress - before))
        found[3:] += np.array(self.law.stress_exponents, dtype=float) * change
        if not self.mass:
            found[2] = self._balanced(found, after)
        return found

    def _balanced(self, y: "np.ndarray", pressure: float) -> float:
        """Logarithm of the rate at which the forces balance, which they do from below; near that of y."""
        from scipy.optimize import brentq

        def excess(logarithm: float) -> float:
            return float(self.readings([*y[:2], logarithm, *y[3:]], pressure)[1])

        way = 1.0 if excess(y[2]) > 0 else -1.0
        width = way
        while excess(y[2] + width) * way > 0:
            width *= 2
            if abs(width) > _WIDEST:
                raise SimulationError(
                    f"the forces must balance after a step of the pressure to {pressure:.6g} Pa. Received a slip rate "
                    "that leaves all sizes. Give a smaller step, or inertia."
                )
        return float(brentq(excess, *sorted((y[2], y[2] + width)), xtol=1e-14, rtol=1e-15))

    def _variables(self) -> tuple[Any, Any, dict[sp.Symbol, Any]]:
        states = state_symbols(self.law.state_names)
        y, load = ca.SX.sym("y", 3 + len(states)), ca.SX.sym("load", 3)
        logged = {x: ca.exp(y[2 + i]) for i, x in enumerate((rate, *states))}
        return y, load, {slip: y[0], stretch: y[1]} | logged


def rational_number(value: Any) -> sp.Rational:
    """Exact SymPy number of a float."""
    return sp.Rational(str(rational(float(value))))


def spring_acceleration() -> sp.Expr:
    """v' [m/s²] of eq. springmodel in `stretch`, `rate` and μ, without disturbance."""
    z, v, acceleration, far = sp.symbols("z v a delta_far", real=True)
    balance = plant.force_balance().replace(plant.disturbance, lambda *_: sp.Integer(0))
    moving = sp.solve(balance.subs(far, z + stretch), acceleration)[0]
    return sp.expand(moving.subs({z: slip, v: rate}))
