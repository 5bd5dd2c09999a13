"""Spring-sliders with rate-and-state friction in logarithms of slip rate and state.

The second chapter defines the setup of a run in slow sliding: tide, ratios of true to nominal constants, pressure path,
and instruments with their memory.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import sympy as sp

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, SimulationError
from quakedesign.exact import rational
from quakedesign.fault import Fault, FrictionLaw
from quakedesign.fault.model import require_nonnegative, require_positive
from quakedesign.laws import Sampling
from quakedesign.loop import Actuator, Delay, Diffusion, DiffusionPath, Lag
from quakedesign.loop.actuators.base import SampledStage
from quakedesign.loop.sensing import Transducer
from quakedesign.symbolic import plant
from quakedesign.symbolic.casadi_printer import to_casadi
from quakedesign.symbolic.rate_and_state_plant import loading_rate, rate, state_symbols, without_overflow

# ----------------------------------------------------------------------
# Spring-sliders whose friction has a state, as differential equations in logarithms of rate and state.

slip, stretch, pressure_rate = sp.symbols("slip stretch pressure_rate", real=True)
_WIDEST = 1e3  # largest change of the logarithm of a rate in a step


@checked_dataclass(frozen=True, kw_only=True)
class SpringSlider:
    """A block per unit area: mass·v' = stiffness·stretch − (normal_stress − p)·μ(slip, v, state) − damping·v.

    The rate of the stretch is the loading rate minus the slip rate. Without mass the balance of forces is a constraint,
    whose time derivative gives v' (quasi-dynamic; needs (normal_stress − p)·∂μ/∂v + damping > 0). The pressure p also
    changes the state if the law has `FrictionLaw.stress_exponents`.

    Attributes
    ----------
    law : FrictionLaw
    stiffness : float
        [Pa/m], positive.
    normal_stress : float
        Effective normal stress [Pa] at p = 0, positive.
    damping : float
        [Pa·s/m], not negative.
    mass : float
        [kg/m²]; 0: quasi-dynamic.

    Raises
    ------
    ParameterError
        If a value is outside its range.
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

        For radiation damping replace the fault's damping by `quakedesign.fault.fault_toml.radiation_damping`.
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
        """Exact values of the symbols in the force balance of 1 m²; for a block without mass, the mass is set to 1."""
        fixed = {
            plant.m: self.mass or 1.0,
            plant.k: self.stiffness,
            plant.eta: self.damping,
            plant.sigma: self.normal_stress,
        }
        exact = {symbol: sp.Rational(str(rational(value))) for symbol, value in fixed.items()}
        return exact | {plant.A: sp.Integer(1)}

    @cached_property
    def derivation(self) -> tuple[sp.Expr, ...]:
        """Time derivatives of slip, stretch, v and states in these, p, `loading_rate` and `pressure_rate`."""
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
            rates = zip((slip, stretch, *states, plant.p), (*moving, *state_rates, pressure_rate), strict=True)
            change = sum((acceleration.diff(x) * dx for x, dx in rates), start=sp.Integer(0))
            acceleration = -change / acceleration.diff(rate)
        return (*moving, acceleration, *state_rates)

    @cached_property
    def rates(self) -> ca.Function:
        """CasADi Function (y as in `names`, (loading rate [m/s], p [Pa], dp/dt [Pa/s])) → dy/dt, Jacobian."""
        y, load, values = self._variables()
        inserted = values | {loading_rate: load[0], plant.p: load[1], pressure_rate: load[2]}
        _, _, *logged = to_casadi(self.derivation, inserted, [y[0], y[2]])
        logged = [change / values[x] for change, x in zip(logged, list(values)[2:], strict=True)]
        field = ca.cse([ca.vertcat(values[rate], load[0] - values[rate], *logged)])[0]
        return ca.Function("rates", [y, load], [field, ca.jacobian(field, y)])

    @cached_property
    def readings(self) -> ca.Function:
        """CasADi Function (y, p [Pa]) → friction coefficient [-], driving less resisting stress [Pa]."""
        y, load, values = self._variables()
        law, states = self.law.exact(), state_symbols(self.law.state_names)
        (friction,) = to_casadi([without_overflow(law.coefficient(slip, rate, *states))], values)
        driving = self.stiffness * y[1] - self.damping * values[rate]
        pressure = load[1]
        return ca.Function("readings", [y, pressure], [friction, driving - (self.normal_stress - pressure) * friction])

    def start(self, at_rate: float, states: tuple[float, ...] | None = None, pressure: float = 0.0) -> list[float]:
        """Vector y with the forces in balance at a rate [m/s] and a pressure [Pa]; in steady state by default.

        Raises
        ------
        ParameterError
            If the rate or a state is not positive, or the number of states is not that of the law.
        """
        require_positive("The simulation uses its logarithm.", start_rate=at_rate)
        initial = self.law.steady_state(at_rate) if states is None else states
        if len(initial) != len(self.law.state_names):
            raise ParameterError(f"start_state must have {len(self.law.state_names)} values. Received {len(initial)}.")
        require_positive(
            "The simulation uses the logarithm of the state.", **dict(zip(self.law.state_names, initial, strict=True))
        )
        logs = [float(sp.log(rational_number(value)).evalf(30)) for value in (at_rate, *initial)]
        friction = float(sp.N(self.law.exact().coefficient(0, *map(rational_number, (at_rate, *initial))), 30))
        resisting = (self.normal_stress - pressure) * friction + self.damping * at_rate
        return [0.0, resisting / self.stiffness, *logs]

    def stepped(self, y: "np.ndarray", before: float, after: float) -> "np.ndarray":
        """Vector y after a step of the pressure [Pa]: the slip is unchanged; the state changes as given by the law.

        Without mass the slip rate jumps to a value at which the forces balance.

        Raises
        ------
        SimulationError
            If the forces do not balance at any slip rate.
        """
        balanced = np.array(y)
        change = math.log((self.normal_stress - after) / (self.normal_stress - before))
        balanced[3:] += np.array(self.law.stress_exponents, dtype=float) * change
        if not self.mass:
            balanced[2] = self._balanced(balanced, after)
        return balanced

    def _balanced(self, y: "np.ndarray", pressure: float) -> float:
        """Logarithm of a rate at which the forces balance, from that of y in the direction of the force excess."""
        from scipy.optimize import brentq

        def excess(logarithm: float) -> float:
            return float(self.readings([*y[:2], logarithm, *y[3:]], pressure)[1])

        way = 1.0 if excess(y[2]) > 0 else -1.0
        width = way
        while excess(y[2] + width) * way > 0:
            width *= 2
            if abs(width) > _WIDEST:
                raise SimulationError(
                    f"after the pressure step to {pressure:.6g} Pa the forces do not balance at any slip rate within a "
                    f"factor e^{_WIDEST:g} of the previous one. Reduce the step, or use inertia."
                )
        return float(brentq(excess, *sorted((y[2], y[2] + width)), xtol=1e-14, rtol=1e-15))

    def _variables(self) -> tuple[ca.SX, ca.SX, dict[sp.Symbol, ca.SX]]:
        states = state_symbols(self.law.state_names)
        y, load = ca.SX.sym("y", 3 + len(states)), ca.SX.sym("load", 3)
        logged = {x: ca.exp(y[2 + i]) for i, x in enumerate((rate, *states))}
        return y, load, {slip: y[0], stretch: y[1]} | logged


def rational_number(value: float | Fraction) -> sp.Rational:
    """Exact SymPy number of a float."""
    return sp.Rational(str(rational(float(value))))


def spring_acceleration() -> sp.Expr:
    """v' [m/s²] of eq. springmodel in `stretch`, `rate` and μ, without disturbance."""
    z, v, acceleration, far = sp.symbols("z v a delta_far", real=True)
    balance = plant.force_balance().replace(plant.disturbance, lambda *_: sp.Integer(0))
    moving = sp.solve(balance.subs(far, z + stretch), acceleration)[0]
    return sp.expand(moving.subs({z: slip, v: rate}))


# ----------------------------------------------------------------------
# Conditions of a fault in slow sliding: tide, true constants, pressure path and instruments.

TIDE = 12.42 * 3600.0  # s, period of the largest tide, M2
MODES = 24  # of the diffusion path; the law's model has fewer
FRICTION = ("direct_effect", "evolution_effect", "critical_slip")
"""Varied constants of friction: a, b and D_c."""


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Tide:
    """Shear stress S·sin(2πt/P + φ) on the fault, added to that of the spring; it starts with a step to S·sin φ.

    Attributes
    ----------
    amplitude : float
        S [Pa], not negative.
    period : float
        P [s], positive.
    phase : float
        φ [rad], not negative.
    """

    amplitude: float = 0.0
    period: float = 1.0
    phase: float = 0.0

    def __post_init__(self) -> None:
        require_nonnegative(stress=self.amplitude, stress_phase=self.phase)
        require_positive(stress_period=self.period)

    def at(self, time: "float | np.ndarray") -> Any:
        """Stress [Pa] at a time [s]."""
        return self.amplitude * np.sin(2 * math.pi / self.period * time + self.phase)


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class SlidingVariation:
    """Ratios of a fault's true constants to the nominal ones of controller and planned pressure [-], each positive.

    Attributes
    ----------
    direct_effect, evolution_effect, critical_slip : float
        Ratios of a, b and D_c.
    normal_stress, stiffness, damping : float
        Ratios of σ', k and η.
    """

    direct_effect: float = 1.0
    evolution_effect: float = 1.0
    critical_slip: float = 1.0
    normal_stress: float = 1.0
    stiffness: float = 1.0
    damping: float = 1.0

    def __post_init__(self) -> None:
        require_positive(**asdict(self))

    def slider(self, fault: Fault, *, inertia: bool) -> SpringSlider:
        """Spring-slider with the true constants."""
        nominal, factors = SpringSlider.of(fault, inertia=inertia), asdict(self)
        changed = {name: getattr(nominal.law, name) * factors[name] for name in FRICTION if factors[name] != 1}
        law = replace(nominal.law, **changed) if changed else nominal.law  # type: ignore[type-var]
        plant = {name: getattr(nominal, name) * factors[name] for name in ("normal_stress", "stiffness", "damping")}
        return replace(nominal, law=law, **plant)


@dataclass(frozen=True, slots=True, kw_only=True)
class PressurePath:
    """Pressure path between law and fault: a pump, then a lag of pump and pipe, then a diffusion path."""

    lag: Fraction = Fraction(0)  # Time constant [s], not negative; 0 for none
    diffusion: Fraction = Fraction(0)  # L²/D [s], not negative; 0 for none
    # Stages that act once per sample, before the zero-order hold. A delay acts on the feedback pressure alone, since
    # the planned pressure is known in advance; all other stages act on the sum of both.
    stages: tuple[SampledStage, ...] = ()

    @classmethod
    def of(cls, meant: Sampling, actuator: Actuator | None) -> "PressurePath":
        """Path of an actuator; lag and diffusion are those of a sampled law's design if the actuator has neither."""
        given = (
            Actuator.meant_for(replace(meant, lag=Fraction(0), diffusion=Fraction(0))) if actuator is None else actuator
        )
        stages, flowing = given.sampled, given.flowing
        if not flowing:
            return cls(lag=meant.lag, diffusion=meant.diffusion, stages=stages)
        if [type(stage) for stage in flowing] not in ([Lag], [Diffusion], [Lag, Diffusion]):
            raise ParameterError(
                "the pressure path of slow sliding is a lag, a diffusion path, or a lag and then a diffusion path. "
                f"Received {', '.join(stage.name for stage in flowing)}. Omit all other stages."
            )
        by_name = {stage.name: stage for stage in flowing}
        lag, path = by_name.get("lag"), by_name.get("diffusion")
        return cls(
            stages=stages,
            lag=rational(lag.time_constant) if isinstance(lag, Lag) else Fraction(0),
            diffusion=rational(path.time) if isinstance(path, Diffusion) else Fraction(0),
        )

    @property
    def modes(self) -> "tuple[np.ndarray, np.ndarray]":
        """Rates λ_i [1/s] and shares c_i [-] of parallel filters with the step response 1 − Σ c_i·e^{−λ_i·t}.

        Partial fractions of the diffusion path in series with the lag: exact but for the truncation error of 24 modes.
        If the rate of the lag equals that of a mode, it is reduced by a relative 1e-9.
        """
        path = DiffusionPath(time=self.diffusion or Fraction(1))
        modes = [(float(path.rate(i)), float(path.share(i))) for i in range(MODES if self.diffusion else 0)]
        rates, shares = np.array(modes).reshape(-1, 2).T
        if not self.lag:
            return rates, shares
        own = 1 / float(self.lag)
        own *= 1 - 1e-9 if np.any(np.abs(rates / own - 1) < 1e-9) else 1
        behind = shares * own / (own - rates)
        return np.append(rates, own), np.append(behind, 1 - sum(behind))


class Instruments:
    """A transducer and a pump between samples of one run, with their memories.

    Attributes
    ----------
    step : float
        T_s [s].
    part : float
        Share of T_s after which the zero-order hold changes.
    """

    def __init__(self, step: float, part: float, *elements: Callable[[float], Any]) -> None:
        self.step, self.part = step, part
        self._reading, self._late, self._pumped = elements

    @classmethod
    def of(cls, path: PressurePath, transducer: Transducer | None, step: float) -> "Instruments":
        """Instruments before the first sample."""
        late = [stage for stage in path.stages if isinstance(stage, Delay)]
        others = [stage for stage in path.stages if not isinstance(stage, Delay)]
        stages = (_remembering(_actuator_function(s, step)) for s in (late, others))
        return cls(step, Actuator(stages=path.stages).part, _remembering(_read(transducer, step)), *stages)

    def read(self, slip: float) -> float:
        """Measured slip [m]."""
        return float(self._reading(slip))

    def pump(self, commanded: float, planned: float) -> float:
        """Feedback pressure of the hold [Pa], from the commanded feedback pressure and the planned pressure [Pa]."""
        return float(self._pumped(float(self._late(commanded)) + planned)) - planned

    def sections(self, now: float, before: float, after: float) -> list[tuple[float, float, float]]:
        """Starts and lengths [s] of the sections of constant pressure between two samples, with the pressures."""
        late = self.part * self.step
        return [(now, late, before)] * (late > 0) + [(now + late, self.step - late, after)]


def _read(transducer: Transducer | None, step: float) -> "tuple[ca.Function, tuple[float, ...]] | None":
    """CasADi Function (memory, slip) → reading, memory, and the initial memory; None without a transducer."""
    if transducer is None:
        return None
    memory, slip = ca.SX.sym("memory", len(transducer.start)), ca.SX.sym("slip")
    seen, after = transducer.pass_on([*map(ca.SX, transducer.numbers(step))], ca.vertsplit(memory), slip)
    return ca.Function("reading", [memory, slip], [seen, ca.vertcat(*after)]), transducer.start


def _actuator_function(stages: Sequence[SampledStage], step: float) -> "tuple[ca.Function, tuple[float, ...]] | None":
    """CasADi Function (memory, commanded pressure) → output pressure, memory; initial memory; None without stages."""
    if not stages:
        return None
    chain, start = Actuator(stages=tuple(stages)), tuple(v for stage in stages for v in stage.start)
    numbers = [ca.SX(v) for stage in stages for v in stage.numbers]
    memory, commanded = ca.SX.sym("memory", len(start)), ca.SX.sym("commanded")
    output, _, after = chain.hold(numbers, ca.vertsplit(memory), commanded, step)
    return ca.Function("held", [memory, commanded], [output, ca.vertcat(*after)]), start


def _remembering(element: tuple[ca.Function, tuple[float, ...]] | None) -> Callable[[float], Any]:
    """Callable on numbers that stores the memory of an element between calls; the identity if it is None."""
    if element is None:
        return float
    function, start = element
    memory = [ca.DM(start)]

    def passed_on(value: float) -> Any:
        output, memory[0] = function(memory[0], value)
        return output

    return passed_on
