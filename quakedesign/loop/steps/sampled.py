"""What the sampled schemes share: the law once per T_s, its pressure held while the plant moves on."""

import math
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca

from quakedesign.errors import ParameterError
from quakedesign.loop.actuators import DIRECT, Actuator
from quakedesign.loop.actuators.base import FLOWS
from quakedesign.loop.schemes.base import Scheme, Stepped
from quakedesign.loop.sensing.base import Sensor
from quakedesign.loop.sensing.measurement import EXACT
from quakedesign.loop.steps import discrete_law
from quakedesign.loop.steps.control_step import SIGNALS, ControlStep, Decided, control_step
from quakedesign.loop.steps.discrete_law import Law, Values
from quakedesign.loop.steps.no_clock import NoClock

MOST_SUBSTEPS = 100


@dataclass(frozen=True)
class Sample:
    """Everything known at one sample (SX): the pressures held before and from it, and the memory afterwards."""

    before: Any
    held: Any
    integrals: list[Any]
    numbers: list[Any]
    own: list[Any]
    kept: list[Any]
    noise: list[Any]
    clock: list[Any]
    flow: list[Any]
    push: Any


@dataclass(frozen=True, kw_only=True)
class Sampled(Scheme, Decided):
    """A controller that measures every T_s and holds its pressure in between (zero-order hold).

    The entries of the memory are: the law's numbers, those of actuator and measurement, the scheme's own memory, the
    pressure that was held last, and the memories of the actuator, of the noise generator and of what no clock tells.

    Attributes
    ----------
    substeps : int
        Steps of the integrator per sample, 1 … 100.
    actuator : Actuator
    measurement : Measurement or Sensor
        A sensor is told the true slip alone, once per sample of its own period.
    authority : float or None
        Nominal input gain B0 of e2' = B0·p [m²/kg] where the scheme needs one; None: from the fault, see `nominal`.
    clock : NoClock or None
        When samples are taken, in steps; None: at every step, by a clock.

    Raises
    ------
    ParameterError
    """

    substeps: int = 1
    actuator: Actuator = DIRECT
    measurement: Sensor = EXACT
    authority: float | None = None
    clock: NoClock | None = None

    def __post_init__(self) -> None:
        whole = isinstance(self.substeps, int) and not isinstance(self.substeps, bool)
        if not (whole and 1 <= self.substeps <= MOST_SUBSTEPS):
            raise ParameterError(f"substeps must be a whole number, 1 to {MOST_SUBSTEPS}. Received {self.substeps!r}.")
        if self.authority is not None and not 0 < self.authority < float("inf"):
            raise ParameterError(f"authority must be positive and finite. Received {self.authority!r} m²/kg.")
        if self.clock and self.actuator.part:
            raise ParameterError(
                "by no clock a pressure acts at a sample. Received a delay that is no whole number of steps. Change it."
            )

    @property
    def starts(self) -> tuple[float, ...]:
        """The scheme's own memory at the start, `own_size` entries."""
        return ()

    def nominal(self, loop: Stepped) -> float:
        """B0 [m²/kg] unless told: the smallest μN̂ of the fault's uncertainty box."""
        return loop.fault.authority_range[0]

    def memory(self, loop: Stepped, step: float) -> dict[str, float]:
        """See `Scheme.memory`; refuses a sensor that was made for another step."""
        self.actuator.require_resolved(step / self.substeps)
        self.measurement.require_step(step)
        parts = self._parts(loop)
        return {f"{name}_{i}": float(v) for name, values in parts.items() for i, v in enumerate(values)}

    def pressure(self, loop: Stepped, counter: Any, state: Any, step: float) -> Any:
        """See `Scheme.pressure`."""
        sample = self._sample(loop, counter, state, step)
        return self.actuator.flow(sample.numbers, sample.flow, self._sections(sample)[0][0])[1]

    def push(self, loop: Stepped, counter: Any, state: Any, step: float) -> Any:
        """Which way ξ moves the pressure at a sample (SX): ξ stays where a limit keeps the pressure from that."""
        return self._sample(loop, counter, state, step).push

    def outputs(self, loop: Stepped, counter: Any, state: Any, step: float) -> dict[str, Any]:
        """See `Scheme.outputs`."""
        if not self.actuator.stages:
            return {}
        sample = self._sample(loop, counter, state, step)
        well = self._sections(sample)[0][0]
        return {"well_pressure": well} | self.actuator.flow(sample.numbers, sample.flow, well)[2]

    @property
    def described(self) -> dict[str, tuple[str, str]]:
        """See `Scheme.described`."""
        well = {"well_pressure": ("pressure at the well", "Pa")}
        return (well | (FLOWS if self.actuator.stores else {})) if self.actuator.stages else {}

    @property
    def settings(self) -> dict[str, Any]:
        """See `Scheme.settings`."""
        said: dict[str, Any] = {"substeps": self.substeps}
        said |= {"actuator": ", ".join(map(repr, self.actuator.stages))} if self.actuator.stages else {}
        said |= {"authority": self.authority} if self.authority else {}
        said |= {"clock": repr(self.clock)} if self.clock else {}
        return said | ({"measurement": repr(self.measurement)} if self.measurement.noisy else {})

    def advance(self, loop: Stepped, method: Any, counter: Any, state: Any, step: float) -> Any:
        """See `Scheme.advance`."""
        sample = self._sample(loop, counter, state, step)
        moving = ca.vertcat(state[:2], *sample.flow)
        for held, begin, share in self._sections(sample):
            # With one entry more than the section before: repetitions are told apart by their numbers of arguments.
            given = ca.vertcat(counter, held, *sample.numbers, *([begin] if begin else []))
            times = math.ceil(share * self.substeps)
            motion = self._motion(step, begin, share, times)
            moving = loop.advance_often(method, motion, given, moving, share * step / times, times)
        rest = ca.vertcat(*sample.own, sample.held, *sample.kept, *sample.noise, *sample.clock)
        first = 2 + len(sample.integrals)
        count = state.shape[0] - first - rest.shape[0] - len(sample.flow)
        constants = state[first : first + count]
        return ca.vertcat(moving[:2], *sample.integrals, constants, rest, moving[2:])

    def _sections(self, sample: Sample) -> tuple[tuple[Any, float, float], ...]:
        """Pressures that are held between two samples, from which share of the period, and for which."""
        late = self.actuator.part
        return ((sample.before, 0, late), (sample.held, late, 1 - late)) if late else ((sample.held, 0, 1),)

    def _motion(self, step: float, begin: float, share: float, times: int) -> Any:
        """Rates of plant and actuator under a pressure held, as `Stepped.advance_often` takes them."""

        def motion(plant: Any, passed: Any, now: Any, given: Any) -> Any:
            counter, held, *numbers = ca.vertsplit(given)
            time = (counter + (begin + passed * share / times)) * step
            rates, pressure, _ = self.actuator.flow(numbers, ca.vertsplit(now[2:]), held)
            return ca.vertcat(plant(time, now[:2], pressure), *rates)

        return motion

    def _parts(self, loop: Stepped) -> dict[str, tuple[float, ...]]:
        """Values of the memory at the start."""
        sampled, flowing = self.actuator.sampled, self.actuator.flowing
        return {
            "law": self.control_step(loop).numbers,
            "authority": (self.authority or self.nominal(loop),),
            "sampled": tuple(v for stage in sampled for v in stage.numbers),
            "flowing": tuple(v for stage in flowing for v in stage.numbers),
            "deviation": self.measurement.numbers,
            "own": self.starts,
            "held": (0.0,),
            "kept": tuple(v for stage in sampled for v in stage.start),
            "noise": self.measurement.start,
            "clock": self.clock.start if self.clock else (),
            "flow": self.actuator.flow_start,
        }

    def control_step(self, loop: Stepped) -> ControlStep:
        """What the controller of a loop computes at one sample."""
        return control_step(type(self), Law.of(loop.controller, loop.constant_pressure))

    def _sample(self, loop: Stepped, counter: Any, state: Any, step: float) -> Sample:
        """Measure, decide, and pass the decision on to the actuator; ξ does not wind up where a stage limits."""
        count = len(loop.integrals)
        entries = iter(ca.vertsplit(state[2 + count :]))
        part = {name: [next(entries) for _ in values] for name, values in self._parts(loop).items()}
        seen, noise = self.measurement.measure(part["deviation"], part["noise"], state[:2])
        ahead = self.clock.shortest if self.clock else 1
        known = self._known(loop, counter, step, seen, ahead)
        known |= {discrete_law.authority: part["authority"][0], discrete_law.held: part["held"][0]}
        signals = ca.vertcat(*(known[symbol] for symbol in SIGNALS))
        before = state[2 : 2 + count]
        given = signals, before, ca.vertcat(*part["law"]), ca.vertcat(*part["own"])
        pressure, after, own, push = self.control_step(loop).function(*given)
        held, excess, kept = self.actuator.hold(part["sampled"], part["kept"], pressure, ahead * step)
        winds = excess * push > 0
        integrals = [ca.if_else(winds, before[i], after[i]) for i in range(count)]
        memory = [own[i] for i in range(self.own_size)]
        found = Sample(part["held"][0], held, integrals, part["flowing"], memory, kept, noise, [], part["flow"], push)
        return self._if_now(found, ca.vertsplit(before) if count else [], part) if self.clock else found

    def _if_now(self, sample: Sample, integrals: list[Any], part: dict[str, list[Any]]) -> Sample:
        """The sample, or what there was before where none is taken now."""
        now, clock = self.clock.after(part["clock"]) if self.clock else (True, [])

        def chosen(new: list[Any], old: list[Any]) -> list[Any]:
            return [ca.if_else(now, a, b) for a, b in zip(new, old, strict=True)]

        return replace(
            sample,
            held=ca.if_else(now, sample.held, sample.before),
            integrals=chosen(sample.integrals, integrals),
            own=chosen(sample.own, part["own"]),
            kept=chosen(sample.kept, part["kept"]),
            noise=chosen(sample.noise, part["noise"]),
            clock=clock,
        )

    @staticmethod
    def _known(loop: Stepped, counter: Any, step: float, seen: Any, ahead: int) -> Values:
        """Values of the signals of one sample, the next expected so many steps ahead."""
        now, later = loop.reference(counter * step), loop.reference((counter + ahead) * step)
        return {
            discrete_law.slip: seen[0],
            discrete_law.rate: seen[1],
            discrete_law.slip_error: seen[0] - now[0],
            discrete_law.rate_error: seen[1] - now[1],
            discrete_law.acceleration: now[2],
            discrete_law.next_reference: later[0],
            discrete_law.next_reference_rate: later[1],
            discrete_law.step: ca.SX(ahead * step),
        }
