"""The fault whose friction opposes motion in either direction and holds it at rest (ERRATA 14)."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import casadi as ca
import sympy as sp

from quakedesign.simulation.closed_loop import ClosedLoop, Motion, acceleration_expression, friction_expression
from quakedesign.simulation.integrators import Integrator
from quakedesign.symbolic import plant

_BISECTIONS = 10
_NEWTON_STEPS = 3


@dataclass(frozen=True)
class CoulombLoop(ClosedLoop):
    """A closed loop with set-valued friction: x2' = load − F, F ∈ μ(x1, |x2|) N̂ max(σ' − p, 0) Sgn(x2).

    Sgn(0) is the interval [−1, 1]. The inclusion has one solution forward in time: the fault slips forward or
    backward, or it rests as long as friction can carry the load. One step follows the smooth field of that direction,
    finds the instant at which it ends, and goes on in the next one; at rest the slip rate is exactly zero. As long as
    the fault slips forward and p < σ', the digits are those of `ClosedLoop`.

    Attributes
    ----------
    fault, controller, constant_pressure
        As in `ClosedLoop`.
    """

    plant_name: ClassVar[str] = "coulomb"
    plant_title: ClassVar[str] = ", Coulomb friction"
    sticks: ClassVar[bool] = True

    @cached_property
    def directed(self) -> Any:
        """CasADi Function (t [s], x [m, m/s], p [Pa], direction 1, 0 or −1) → dx [m/s, m/s²]."""
        varied, numbers = bool(self.factors), plant.plant_values(self.fault)
        law = friction_expression(self.fault, varied)
        authority = float(numbers[plant.N_hat]) * (self.factors[2] if varied else 1)
        parts = self.function(
            "parts",
            {"t": [plant.t], "x": [plant.x1, plant.x2], "p": [plant.p]},
            {
                "smooth": [acceleration_expression(self.fault, varied)],
                "mu": [law, law.subs(plant.x2, sp.Abs(plant.x2))],
            },
        )

        def rates(time: Any, x: Any, pressure: Any, direction: Any) -> Any:
            smooth, mu = parts(time, x, pressure)
            stress = float(numbers[plant.sigma]) - pressure
            correction = stress * mu[0] - direction * ca.fmax(stress, 0) * mu[1]
            return ca.fabs(direction) * ca.vertcat(x[1], smooth + authority * correction)

        if varied:
            return rates
        inputs = [ca.SX.sym("t"), ca.SX.sym("x", 2), ca.SX.sym("p"), ca.SX.sym("direction")]
        return ca.Function("directed", inputs, [rates(*inputs)], ["t", "x", "p", "direction"], ["dx"])

    def shear_stress(self, time: Any, state: Any, pressure: Any, friction: Any) -> Any:
        """Shear stress [Pa]: μ max(σ' − p, 0) against slip, or what carries the load at rest (SX)."""
        strength = friction * ca.fmax(self.fault.effective_normal_stress - pressure, 0)
        numbers = plant.plant_values(self.fault)
        authority = float(numbers[plant.N_hat]) * (self.factors[2] if self.factors else 1)
        load = self.directed(time, state[:2], pressure, 1)[1] / authority + strength
        carried = ca.fmin(ca.fmax(load, -strength), strength)
        return ca.if_else(state[1] == 0, carried, ca.sign(state[1]) * strength)

    def advance(self, method: type[Integrator], motion: Motion, state: Any, step: float) -> Any:
        """State after one step, with at most one change between slip forward, slip backward and rest."""
        course = _StepMotion(self.directed, method, motion, step)
        direction = ca.if_else(state[1] == 0, course.start(0.0, state), ca.sign(state[1]))
        ahead = course.move(direction, 0.0, 1.0, state)
        rests, leaving = direction == 0, course.start(1.0, ahead)
        changes = ca.if_else(rests, leaving != 0, direction * ahead[1] < 0)
        onset = _onset(course.push(leaving, 0.0, state), course.push(leaving, 1.0, ahead))
        share, turning = course.stop(direction, state, ahead, ca.if_else(rests, onset, -1))
        onward = ca.if_else(rests, leaving, course.start(share, turning))
        end = course.move(onward, share, 1 - share, turning)
        recoils = onward * end[1] < 0
        for index in (0, *range(2 + len(self.integrals), state.shape[0])):  # slip, and works where they are metered
            end[index] = ca.if_else(recoils, turning[index], end[index])
        end[1] = ca.if_else(recoils, 0, end[1])
        return ca.if_else(changes, end, ahead)


@dataclass(frozen=True)
class _DirectedPlant:
    """The plant while it keeps a direction."""

    directed: Any
    direction: Any

    def __call__(self, time: Any, x: Any, pressure: Any) -> Any:
        return self.directed(time, x, pressure, self.direction)


@dataclass(frozen=True)
class _StepMotion:
    """The motion within one step, split at shares [-] of its length."""

    directed: Any
    method: type[Integrator]
    motion: Motion
    step: float

    def rates(self, direction: Any, passed: Any, state: Any) -> Any:
        """Time derivative of the state while it keeps a direction."""
        return self.motion(_DirectedPlant(self.directed, direction), passed, state)

    def move(self, direction: Any, passed: Any, share: Any, state: Any) -> Any:
        """State after a share of the step in one direction."""

        def field(part: float, now: Any) -> Any:
            return self.rates(direction, passed + share * part, now)

        return self.method.advance(field, state, share * self.step)

    def push(self, direction: Any, passed: Any, state: Any) -> Any:
        """Acceleration [m/s²] out of rest in a direction; positive where friction cannot hold the fault."""
        at_rest = _with_rate(state, 0)
        return direction * self.rates(direction, passed, at_rest)[1]

    def start(self, passed: Any, state: Any) -> Any:
        """Direction in which a fault at rest sets off; 0 if it stays."""
        forward, backward = self.push(1, passed, state), self.push(-1, passed, state)
        return ca.if_else(forward > 0, 1, ca.if_else(backward > 0, -1, 0))

    def stop(self, direction: Any, state: Any, ahead: Any, onset: Any) -> tuple[Any, Any]:
        """Share of the step at which the direction ends, and the state there, at rest.

        The cubic through the slip rates and accelerations of both ends of the step gives the share; a linear step
        with the state there removes its error. `onset` is the share known beforehand, or −1.
        """
        slopes = [self.rates(direction, passed, now)[1] * self.step for passed, now in ((0.0, state), (1.0, ahead))]
        cubic = _stop(*(direction * value for value in (state[1], ahead[1], *slopes)))
        share = ca.if_else(onset < 0, cubic, onset)
        reached = self.move(direction, 0.0, share, state)
        rates = self.rates(direction, share, reached)
        braking = direction * rates[1] < 0
        rest = ca.if_else(braking, -reached[1] / ca.if_else(braking, rates[1], 1), 0)
        rest = ca.fmin(ca.fmax(rest, -share * self.step), (1 - share) * self.step)
        return share + rest / self.step, _with_rate(reached + rest * rates, 0)


def _with_rate(state: Any, rate: Any) -> Any:
    return ca.vertcat(state[0], rate, state[2:])


def _onset(before: Any, after: Any) -> Any:
    """Share of a step at which a quantity that ends positive has left zero, by its secant."""
    crosses = ca.logic_and(before < 0, after > 0)
    return ca.if_else(crosses, before / ca.if_else(crosses, before - after, 1), 0)


def _stop(start: Any, end: Any, start_slope: Any, end_slope: Any) -> Any:
    """Share at which the cubic with these ends and slopes falls through zero, from start ≥ 0 to end < 0."""
    third = 2 * (start - end) + start_slope + end_slope
    second = end_slope - start_slope - 3 * third
    second = second / 2
    low, high = 0.0, 1.0
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        value = start + middle * (start_slope + middle * (second + middle * third))
        low, high = ca.if_else(value > 0, middle, low), ca.if_else(value > 0, high, middle)
    share = (low + high) / 2
    for _ in range(_NEWTON_STEPS):
        value = start + share * (start_slope + share * (second + share * third))
        slope = start_slope + share * (2 * second + share * 3 * third)
        better = share - value / ca.if_else(slope == 0, 1, slope)
        share = ca.fmin(ca.fmax(better, low), high)
    return share
