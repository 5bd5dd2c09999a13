"""Quantities recorded at every step inside the compiled loop, and metrics of a run computed from these."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, cast

import casadi as ca
import numpy as np

from quakedesign.arguments import checked_dataclass
from quakedesign.files import Json
from quakedesign.loop import Scheme
from quakedesign.loop.schemes.base import Stepped
from quakedesign.simulation.closed_loop import WORKS, ClosedLoop, EnergyBudget, Meter, Number
from quakedesign.simulation.integrators import Integrator

# ----------------------------------------------------------------------
# Quantities recorded at every step, inside the compiled loop.

NEVER = -1.0
LARGEST_MOTION = 1e9
LARGEST_STATE = 1e100  # largest |ξ|, |p| and |h|; sums of their squares do not overflow

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
    "load_reversed": NEVER,
} | dict.fromkeys(WORKS, 0.0)


@dataclass(frozen=True, slots=True)
class Parts:
    """Parts of the vector of a run."""

    counter: Any  # SX or ndarray: Number of the step
    settled_from: Number  # Time from which errors count [s]
    state: Any  # SX or ndarray: x1 [m], x2 [m/s], ξ, memory of the scheme
    watched: dict[str, Any]
    factors: tuple[Number, ...]  # Factors of the plant, constant in a run

    def joined(self) -> ca.SX:
        """The vector (SX)."""
        return ca.vertcat(self.counter, self.settled_from, self.state, *self.watched.values(), *self.factors)


@dataclass(frozen=True)
class Recorder:
    """Step map of the vector [counter, settled_from, x1, x2, ξ, memory…, watched…, factors…] of a run."""

    loop: ClosedLoop
    scheme: Scheme
    step: float  # [s]
    initial: tuple[float, float] = (0.0, 0.0)  # Initial x1 [m] and x2 [m/s]; at rest unless given

    @cached_property
    def memory(self) -> dict[str, float]:
        """Initial memory of the scheme, by name."""
        return self.scheme.memory(self.loop, self.step)

    @cached_property
    def state_size(self) -> int:
        """Number of states of plant and law, and of entries of the scheme's memory."""
        return 2 + len(self.loop.integrals) + len(self.memory)

    @cached_property
    def size(self) -> int:
        """Length of the vector."""
        return 2 + self.state_size + len(self.watching) + len(self.loop.factors)

    def parts(self, vector: Any) -> "Parts":
        """Parts of a vector of numbers or symbols."""
        first = 2 + self.state_size
        entries = [vector[i] for i in range(first, self.size)]
        watched = dict(zip(self.watching, entries, strict=False))
        return Parts(vector[0], vector[1], vector[2:first], watched, tuple(entries[len(watched) :]))

    @cached_property
    def watching(self) -> dict[str, float]:
        """Initial values of the accumulated quantities, by name; with an actuator also the extremes of its signals."""
        extremes = (("max", -math.inf), ("min", math.inf))
        return START | {f"{side}_{signal}": start for signal in self.scheme.described for side, start in extremes}

    def loop_of(self, vector: ca.SX) -> ClosedLoop:
        """Loop whose plant has the factors contained in the vector."""
        return self.loop.with_factors(self.parts(vector).factors)

    def start(self, settled_from: float) -> list[float]:
        """Vector at time zero; `settled_from` is a time [s]."""
        state = [*self.initial, *[0.0] * len(self.loop.integrals), *self.memory.values()]
        return [0.0, settled_from, *state, *self.watching.values(), *map(float, self.loop.factors)]

    def watched(self, vector: ca.SX | np.ndarray) -> dict[str, float]:
        """Accumulated values by name."""
        return {name: float(value) for name, value in self.parts(vector).watched.items()}

    def observe(self, vector: ca.SX) -> ca.SX:
        """Vector (SX) with the signals at its instant added to the accumulated quantities."""
        now = self.parts(vector)
        after = self._after(now.watched, vector)
        return replace(now, watched={name: after[name] for name in self.watching}).joined()

    def energy(self, end: ca.SX | np.ndarray) -> EnergyBudget:
        """Energy budget of a run from its last vector: the budget from rest less that of the initial state."""
        last = self.parts(end)
        slip, rate = (float(v) for v in last.state[:2])
        whole = self.loop.budget(self.watched(end), float(last.counter) * self.step, slip, rate)
        now, before = whole.to_dict(), self.loop.budget(dict.fromkeys(WORKS, 0.0), 0.0, *self.initial).to_dict()
        return EnergyBudget(**{name: now[name] - before[name] for name in now if name != "residual"})

    def advance(self, vector: ca.SX, method: type[Integrator]) -> ca.SX:
        """Vector (SX) after the quantities at its instant are accumulated and one step is taken."""
        now, first = self.parts(vector), self.index(WORKS[0])
        meter = Meter(self.loop_of(vector), vector[first : first + len(WORKS)])
        moved = self.scheme.advance(cast(Stepped, meter), method, now.counter, now.state, self.step)
        return ca.cse([self.moved(vector, moved, meter.works)])[0]

    def moved(self, vector: ca.SX, state: ca.SX, done: ca.SX) -> ca.SX:
        """Vector (SX) at the next instant, given state and works there; it first accumulates the present quantities."""
        now = self.parts(self.observe(vector))
        watched = now.watched | dict(zip(WORKS, (done[i] for i in range(len(WORKS))), strict=True))
        return replace(now, counter=now.counter + 1, state=state, watched=watched).joined()

    def index(self, name: str) -> int:
        """Index of an accumulated value in the vector."""
        return 2 + self.state_size + list(self.watching).index(name)

    def signals(self, vector: ca.SX) -> dict[str, ca.SX]:
        """Every signal of the loop (SX) at the instant of the vector."""
        loop = self.loop_of(vector)
        parts = self.parts(vector)
        counter, state, time = parts.counter, parts.state, parts.counter * self.step
        reference = loop.reference(time)
        h, mu = loop.perturbation(time, state[:2], reference)
        placed = loop, counter, state, self.step
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

    def _after(self, before: dict[str, Number], vector: ca.SX) -> dict[str, Number]:
        now, parts, described = self.signals(vector), self.parts(vector), self.scheme.described
        settled, later = now["time"] > parts.settled_from, parts.counter > 0
        # The plant without stick does not stay at rest.
        rests: ca.SX | float = now["slip_rate"] == 0 if self.loop.sticks else 0
        slip_error = ca.if_else(settled, now["slip"] - now["reference"], 0)
        rate_error = ca.if_else(settled, now["slip_rate"] - now["reference_rate"], 0)
        pressure, h = now["pressure"], now["matched_perturbation"]
        turned = ca.fabs(pressure - before["previous_pressure"])
        changed = ca.if_else(later, ca.fabs(h - before["previous_h"]), 0)
        after = {
            "max_slip_error": ca.fmax(before["max_slip_error"], ca.fabs(slip_error)),
            "max_slip_rate_error": ca.fmax(before["max_slip_rate_error"], ca.fabs(rate_error)),
            "sum_square_slip_error": before["sum_square_slip_error"] + slip_error * slip_error,
            "sum_square_slip_rate_error": before["sum_square_slip_rate_error"] + rate_error * rate_error,
            "sum_square_pressure": before["sum_square_pressure"] + ca.if_else(settled, pressure * pressure, 0),
            "pressure_variation": before["pressure_variation"] + ca.if_else(ca.logic_and(settled, later), turned, 0),
            "reverse_count": before["reverse_count"] + ca.logic_and(settled, now["slip_rate"] < 0),
            "settled_count": before["settled_count"] + settled,
            "rest_count": before["rest_count"] + ca.logic_and(settled, rests),
            "peak_slip_rate": ca.fmax(before["peak_slip_rate"], ca.fabs(now["slip_rate"])),
            "max_h_change": ca.fmax(before["max_h_change"], changed),
            "previous_pressure": pressure,
            "previous_h": h,
            **{name: before[name] for name in WORKS},
        }
        for signal in ("pressure", *described):
            after[f"max_{signal}"] = ca.fmax(before[f"max_{signal}"], now[signal])
            after[f"min_{signal}"] = ca.fmin(before[f"min_{signal}"], now[signal])
        fine = ca.logic_and(ca.fabs(now["slip"]) <= LARGEST_MOTION, ca.fabs(now["slip_rate"]) <= LARGEST_MOTION)
        bounded = [parts.state[i] for i in range(2, self.state_size)]
        for value in (*bounded, pressure, h, *(now[signal] for signal in described)):
            fine = ca.logic_and(fine, ca.fabs(value) <= LARGEST_STATE)
        happening = {
            "diverged": ca.logic_not(fine),
            "opening": pressure >= self.loop.fault.effective_normal_stress,
            "reverse_slip": now["slip_rate"] < 0,
            "stick": ca.logic_and(later, rests),
            "load_reversed": self.loop_of(vector).reversing(now["time"], parts.state, pressure),
        }
        for name, what in happening.items():
            after[name] = ca.if_else(ca.logic_and(before[name] < 0, what), now["time"], before[name])
        return after


# ----------------------------------------------------------------------
# Metrics for the comparison of controllers, computed from every step of a run.

_FASTEST = 1e6  # m/s: far above an earthquake, and below the slip rates of an overflow
EVENTS = ("diverged", "opening", "reverse_slip", "stick", "load_reversed")


def _figure(unit: str) -> Any:
    """Dataclass field with an SI unit and the default None."""
    return field(default=None, metadata={"unit": unit})


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Metrics:
    """Metrics of one run; None if not applicable. Of these, a diverged run has at most its peak slip rate.

    All except `peak_slip_rate`, `max_h_rate`, `max_pressure` and `min_pressure` are evaluated for t > settled_from.

    Attributes
    ----------
    max_slip_error, rms_slip_error : float or None
        Largest and root mean square of x1 − r [m].
    max_slip_rate_error, rms_slip_rate_error : float or None
        Largest and root mean square of x2 − r' [m/s].
    mise_slip, mise_slip_rate : float or None
        Mean of the squared error [m², m²/s²].
    rms_pressure : float or None
        Root mean square of the pressure [Pa].
    pressure_total_variation : float or None
        Sum of |Δp| between successive steps [Pa].
    reverse_slip_fraction : float or None
        Share of the steps with x2 < 0 [-].
    time_at_rest_fraction : float or None
        Fraction of the steps with x2 = 0 [-]; only for the stick–slip plant, with or without a controller.
    peak_slip_rate : float or None
        Largest |x2| of the whole run [m/s].
    max_h_rate : float or None
        Largest |Δh/Δt| between successive steps of the whole run [m/s³].
    max_pressure, min_pressure : float or None
        Largest and smallest pressure of the whole run [Pa].
    settled_from : float
        Time after which errors are evaluated [s].
    steps : int
        Number of steps until the end of the run or until divergence.
    seconds : float
        Computing time [s].
    """

    max_slip_error: float | None = _figure("m")
    max_slip_rate_error: float | None = _figure("m/s")
    rms_slip_error: float | None = _figure("m")
    rms_slip_rate_error: float | None = _figure("m/s")
    mise_slip: float | None = _figure("m^2")
    mise_slip_rate: float | None = _figure("m^2/s^2")
    rms_pressure: float | None = _figure("Pa")
    pressure_total_variation: float | None = _figure("Pa")
    reverse_slip_fraction: float | None = _figure("")
    time_at_rest_fraction: float | None = _figure("")
    peak_slip_rate: float | None = _figure("m/s")
    max_h_rate: float | None = _figure("m/s^3")
    max_pressure: float | None = _figure("Pa")
    min_pressure: float | None = _figure("Pa")
    settled_from: float = field(metadata={"unit": "s"})
    steps: int
    seconds: float = field(metadata={"unit": "s"})

    def to_dict(self) -> Json:
        """Return the metrics by name, in JSON types."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @staticmethod
    def unit(name: str) -> str:
        """SI unit of one metric; empty if dimensionless."""
        return _UNITS[name]


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class ActuatorMetrics(Metrics):
    """Metrics of one run with an actuator between law and fault; extremes are over the whole run.

    Attributes
    ----------
    max_well_pressure, min_well_pressure : float or None
        Pressure at the well, after delay, saturation and other sampled stages, before lag and diffusion path [Pa].
    max_injected_volume, min_injected_volume : float or None
        Fluid volume injected into the rock since t = 0 [m³]; None if no stage of the actuator stores fluid.
    max_flow_rate, min_flow_rate : float or None
        Flow rate into the well, negative for withdrawal [m³/s].
    """

    max_well_pressure: float | None = _figure("Pa")
    min_well_pressure: float | None = _figure("Pa")
    max_injected_volume: float | None = _figure("m^3")
    min_injected_volume: float | None = _figure("m^3")
    max_flow_rate: float | None = _figure("m^3/s")
    min_flow_rate: float | None = _figure("m^3/s")


_UNITS: dict[str, str] = {each.name: each.metadata.get("unit", "") for each in fields(ActuatorMetrics)}


def events(watched: dict[str, float]) -> dict[str, float]:
    """Time of the first occurrence [s] of each event, without events after divergence."""
    end = watched["diverged"] if watched["diverged"] >= 0 else math.inf
    return {name: watched[name] for name in EVENTS if 0 <= watched[name] <= end}


def metrics(
    watched: dict[str, float],
    *,
    controlled: bool,
    step: float,
    steps: int,
    settled_from: float,
    seconds: float,
    sticks: bool = False,
    further: Iterable[str] = (),
) -> Metrics:
    """Metrics from accumulated values; `step` is the length of a step [s], `further` names signals of an actuator."""
    signals = list(further)
    kind = ActuatorMetrics if signals else Metrics
    if watched["diverged"] >= 0:
        peak = watched["peak_slip_rate"]  # meaningful if ξ, p or h diverged, but slip and slip rate did not
        finite_peak = {"peak_slip_rate": peak} if peak <= _FASTEST else {}
        return kind(**finite_peak, settled_from=settled_from, steps=round(watched["diverged"] / step), seconds=seconds)
    figures = {"peak_slip_rate": watched["peak_slip_rate"]}
    if controlled:
        extremes = [f"{side}_{signal}" for signal in ("pressure", *signals) for side in ("max", "min")]
        figures |= _settled(watched) | {name: watched[name] for name in extremes}
        figures["max_h_rate"] = watched["max_h_change"] / step
    if sticks and watched["settled_count"]:
        figures["time_at_rest_fraction"] = watched["rest_count"] / watched["settled_count"]
    finite = {name: value for name, value in figures.items() if math.isfinite(value)}
    return kind(**finite, settled_from=settled_from, steps=steps, seconds=seconds)


def _settled(watched: dict[str, float]) -> dict[str, float]:
    count = watched["settled_count"]
    if not count:
        return {}
    means = {name: watched[f"sum_square_{name}"] / count for name in ("slip_error", "slip_rate_error", "pressure")}
    return {
        "max_slip_error": watched["max_slip_error"],
        "max_slip_rate_error": watched["max_slip_rate_error"],
        "rms_slip_error": math.sqrt(means["slip_error"]),
        "rms_slip_rate_error": math.sqrt(means["slip_rate_error"]),
        "mise_slip": means["slip_error"],
        "mise_slip_rate": means["slip_rate_error"],
        "rms_pressure": math.sqrt(means["pressure"]),
        "pressure_total_variation": watched["pressure_variation"],
        "reverse_slip_fraction": watched["reverse_count"] / count,
    }
