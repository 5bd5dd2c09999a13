"""What is watched at every step, inside the compiled loop."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from quakedesign.loop.schemes import Scheme
from quakedesign.simulation.closed_loop import ClosedLoop
from quakedesign.simulation.energy import WORKS, EnergyBudget
from quakedesign.simulation.integrators import Integrator

NEVER = -1.0
LARGEST_MOTION = 1e9
LARGEST_STATE = 1e100  # of ξ, p and h: their squares can be summed

START = {
    "max_slip_error": 0.0,
    "max_slip_rate_error": 0.0,
    "sum_square_slip_error": 0.0,
    "sum_square_slip_rate_error": 0.0,
    "sum_square_pressure": 0.0,
    "pressure_variation": 0.0,
    "reverse_count": 0.0,
    "settled_count": 0.0,
    "rest_count": 0.0,
    "peak_slip_rate": 0.0,
    "max_h_change": 0.0,
    "max_pressure": -math.inf,
    "min_pressure": math.inf,
    "previous_pressure": 0.0,
    "previous_h": 0.0,
    "diverged": NEVER,
    "opening": NEVER,
    "reverse_slip": NEVER,
    "stick": NEVER,
} | dict.fromkeys(WORKS, 0.0)


@dataclass(frozen=True)
class Recorder:
    """The vector [counter, settled_from, x1, x2, ξ, memory…, watched…, factors…] that one step maps onto itself.

    Attributes
    ----------
    loop : ClosedLoop
    scheme : Scheme
    step : float
        T_s [s].
    """

    loop: ClosedLoop
    scheme: Scheme
    step: float

    @cached_property
    def memory(self) -> dict[str, float]:
        """Memory of the scheme at the start, by name."""
        return self.scheme.memory(self.loop, self.step)

    @property
    def state_size(self) -> int:
        """Number of states of plant and law, and of entries of the scheme's memory."""
        return 2 + len(self.loop.integrals) + len(self.memory)

    @property
    def size(self) -> int:
        """Length of the vector."""
        return self._constants + len(self.loop.factors)

    @property
    def _constants(self) -> int:
        """Index of the first factor: numbers of the plant that a run carries along unchanged."""
        return 2 + self.state_size + len(self.watching)

    @cached_property
    def watching(self) -> dict[str, float]:
        """What is accumulated, by name, with its value at the start; with an actuator the extremes of its signals."""
        extremes = (("max", -math.inf), ("min", math.inf))
        return START | {f"{side}_{signal}": start for signal in self.scheme.described for side, start in extremes}

    def loop_of(self, vector: Any) -> ClosedLoop:
        """Loop whose plant has the factors that the vector carries."""
        return self.loop.with_factors(tuple(vector[i] for i in range(self._constants, self.size)))

    def start(self, settled_from: float) -> list[float]:
        """Vector at rest at time zero; `settled_from` is a time [s]."""
        state = [*[0.0] * (self.state_size - len(self.memory)), *self.memory.values()]
        return [0.0, settled_from, *state, *self.watching.values(), *self.loop.factors]

    def watched(self, vector: Any) -> dict[str, float]:
        """Accumulated values by name."""
        values = (float(v) for v in vector[2 + self.state_size : self._constants])
        return dict(zip(self.watching, values, strict=True))

    def observe(self, vector: Any) -> Any:
        """Vector (SX) after its own instant has been watched."""
        import casadi as ca

        parts = [vector[2 + self.state_size + i] for i in range(len(self.watching))]
        before = dict(zip(self.watching, parts, strict=True))
        after = self._after(before, vector)
        return ca.vertcat(
            vector[: 2 + self.state_size], *(after[name] for name in self.watching), vector[self._constants :]
        )

    def energy(self, end: Any) -> EnergyBudget:
        """Energy budget of a run from its last vector."""
        return self.loop.budget(self.watched(end), float(end[0]) * self.step, float(end[2]), float(end[3]))

    def advance(self, vector: Any, method: type[Integrator]) -> Any:
        """Vector (SX) after its own instant has been watched and one step has been taken."""
        import casadi as ca

        first = self.index(WORKS[0])
        meter = [vector[first : first + len(WORKS)]]
        loop = replace(self.loop_of(vector), meter=meter)
        moved = self.scheme.advance(loop, method, vector[0], vector[2 : 2 + self.state_size], self.step)
        return ca.cse([self.moved(vector, moved, meter[0])])[0]

    def moved(self, vector: Any, state: Any, done: Any) -> Any:
        """Vector (SX) after its own instant has been watched, with the state and works of the next instant."""
        import casadi as ca

        watched, first = self.observe(vector), self.index(WORKS[0])
        rest = watched[2 + self.state_size : first], done, watched[first + len(WORKS) :]
        return ca.vertcat(vector[0] + 1, vector[1], state, *rest)

    def index(self, name: str) -> int:
        """Place of a watched value in the vector."""
        return 2 + self.state_size + list(self.watching).index(name)

    def signals(self, vector: Any) -> dict[str, Any]:
        """Every signal of the loop (SX) at the instant of the vector."""
        loop = self.loop_of(vector)
        time, state = vector[0] * self.step, vector[2 : 2 + self.state_size]
        reference = loop.reference(time)
        h, mu = loop.perturbation(time, state[:2], reference)
        placed = loop, vector[0], state, self.step
        pressure = self.scheme.pressure(*placed)
        return self.scheme.outputs(*placed) | {
            "time": time,
            "slip": state[0],
            "slip_rate": state[1],
            "pressure": pressure,
            "reference": reference[0],
            "reference_rate": reference[1],
            "matched_perturbation": h,
            "friction": mu,
            "shear_stress": loop.shear_stress(time, state, pressure, mu),
        }

    def _after(self, before: dict[str, Any], vector: Any) -> dict[str, Any]:
        import casadi as ca

        now = self.signals(vector)
        settled = now["time"] > vector[1]
        later = vector[0] > 0
        return {
            **_errors(before, now, settled),
            "rest_count": before["rest_count"] + ca.logic_and(settled, self._rests(now)),
            **_pressures(before, now, settled, later),
            **_extremes(before, now, later),
            **_ranges(before, now, self.scheme.described),
            **{name: before[name] for name in WORKS},
            **self._events(before, now, vector),
        }

    def _events(self, before: dict[str, Any], now: dict[str, Any], vector: Any) -> dict[str, Any]:
        import casadi as ca

        fine = ca.logic_and(ca.fabs(now["slip"]) <= LARGEST_MOTION, ca.fabs(now["slip_rate"]) <= LARGEST_MOTION)
        bounded = [vector[index] for index in range(4, 2 + self.state_size)]
        further = (now[signal] for signal in self.scheme.described)
        for value in (*bounded, now["pressure"], now["matched_perturbation"], *further):
            fine = ca.logic_and(fine, ca.fabs(value) <= LARGEST_STATE)
        happening = {
            "diverged": ca.logic_not(fine),
            "opening": now["pressure"] >= self.loop.fault.effective_normal_stress,
            "reverse_slip": now["slip_rate"] < 0,
            "stick": ca.logic_and(vector[0] > 0, self._rests(now)),
        }
        return {
            name: ca.if_else(ca.logic_and(before[name] < 0, what), now["time"], before[name])
            for name, what in happening.items()
        }

    def _rests(self, now: dict[str, Any]) -> Any:
        """Whether friction holds the fault; a smooth plant is at rest only in passing."""
        return now["slip_rate"] == 0 if self.loop.sticks else 0


def _errors(before: dict[str, Any], now: dict[str, Any], settled: Any) -> dict[str, Any]:
    import casadi as ca

    slip_error = ca.if_else(settled, now["slip"] - now["reference"], 0)
    rate_error = ca.if_else(settled, now["slip_rate"] - now["reference_rate"], 0)
    reverse = ca.logic_and(settled, now["slip_rate"] < 0)
    return {
        "max_slip_error": ca.fmax(before["max_slip_error"], ca.fabs(slip_error)),
        "max_slip_rate_error": ca.fmax(before["max_slip_rate_error"], ca.fabs(rate_error)),
        "sum_square_slip_error": before["sum_square_slip_error"] + slip_error * slip_error,
        "sum_square_slip_rate_error": before["sum_square_slip_rate_error"] + rate_error * rate_error,
        "reverse_count": before["reverse_count"] + reverse,
        "settled_count": before["settled_count"] + settled,
    }


def _pressures(before: dict[str, Any], now: dict[str, Any], settled: Any, later: Any) -> dict[str, Any]:
    import casadi as ca

    pressure = now["pressure"]
    change = ca.fabs(pressure - before["previous_pressure"])
    return {
        "sum_square_pressure": before["sum_square_pressure"] + ca.if_else(settled, pressure * pressure, 0),
        "pressure_variation": before["pressure_variation"] + ca.if_else(ca.logic_and(settled, later), change, 0),
        "previous_pressure": pressure,
        "max_pressure": ca.fmax(before["max_pressure"], pressure),
        "min_pressure": ca.fmin(before["min_pressure"], pressure),
    }


def _extremes(before: dict[str, Any], now: dict[str, Any], later: Any) -> dict[str, Any]:
    import casadi as ca

    h = now["matched_perturbation"]
    change = ca.if_else(later, ca.fabs(h - before["previous_h"]), 0)
    return {
        "peak_slip_rate": ca.fmax(before["peak_slip_rate"], ca.fabs(now["slip_rate"])),
        "max_h_change": ca.fmax(before["max_h_change"], change),
        "previous_h": h,
    }


def _ranges(before: dict[str, Any], now: dict[str, Any], signals: Iterable[str]) -> dict[str, Any]:
    import casadi as ca

    found = {}
    for signal in signals:
        found[f"max_{signal}"] = ca.fmax(before[f"max_{signal}"], now[signal])
        found[f"min_{signal}"] = ca.fmin(before[f"min_{signal}"], now[signal])
    return found
