"""Base classes of discretisation schemes, the sampled control step, and aperiodic sampling.

One step of a closed loop is a CasADi expression. A sampled scheme evaluates the law once per T_s with zero-order hold;
with aperiodic sampling, the interval is a random whole number of steps.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from typing import Any, ClassVar, Self

import casadi as ca
import sympy as sp

from quakedesign.errors import ParameterError, is_whole
from quakedesign.fault import Fault
from quakedesign.files import Json
from quakedesign.laws import Controller
from quakedesign.loop import discrete_law
from quakedesign.loop.actuators.base import FLOWS
from quakedesign.loop.actuators.chain import DIRECT, Actuator
from quakedesign.loop.discrete_law import DiscreteLaw, Lifted, Values
from quakedesign.loop.sensing.measurement import EXACT, Measurement, Sensor, generator, uniform

# ----------------------------------------------------------------------
# Interface of all schemes.

Motion = Callable[..., ca.SX]  # from numbers or symbols to a column vector: the rates of a state, or other signals


class Stepped(ABC):
    """Closed loop as input of a scheme; the functions work on CasADi SX.

    Attributes
    ----------
    sticks : bool
        Whether friction is set-valued.
    fault : Fault
    controller : Controller or None
    constant_pressure : float
        p [Pa] without a controller.
    """

    sticks: ClassVar[bool] = False

    fault: Fault
    controller: Controller | None
    constant_pressure: float

    @property
    @abstractmethod
    def integrals(self) -> tuple[sp.Symbol, ...]:
        """Symbols of the law's integral states."""

    @property
    @abstractmethod
    def plant(self) -> Motion:
        """Function (t [s], x [m, m/s], p [Pa]) → dx [m/s, m/s²]."""

    @property
    @abstractmethod
    def reference(self) -> ca.Function:
        """Function t [s] → reference [m, m/s, m/s²]."""

    @property
    @abstractmethod
    def law(self) -> ca.Function:
        """Function (x, xi, reference) → p [Pa], dxi."""

    @abstractmethod
    def advance(self, method: Any, motion: Motion, state: ca.SX, step: float) -> ca.SX:
        """State after one integrator step; a motion maps plant, elapsed share of the step [-] and state to rates."""

    @abstractmethod
    def advance_often(self, method: Any, motion: Motion, given: ca.SX, state: ca.SX, step: float, times: int) -> ca.SX:
        """State after several steps; the motion takes the number of elapsed steps, and last `given`."""


class Scheme(ABC):
    """One step of length T_s of a closed loop, written in CasADi SX.

    The state of a run is [x1, x2, ξ, memory]. The memory belongs to the scheme: values that a controller stores from
    one sample to the next, and parameters, stored there so that the same compiled code serves all their values.
    """

    name: ClassVar[str]

    def memory(self, loop: Stepped, step: float) -> dict[str, float]:
        """Entries of the memory with their initial values; none by default."""
        return {}

    @abstractmethod
    def pressure(self, loop: Stepped, counter: ca.SX, state: ca.SX, step: float) -> ca.SX:
        """Pressure [Pa] in the fault at the start of step number `counter`."""

    @abstractmethod
    def advance(self, loop: Stepped, method: Any, counter: ca.SX, state: ca.SX, step: float) -> ca.SX:
        """State at the end of step number `counter`, which starts at counter·step [s]."""

    def rates(self, loop: Stepped, counter: ca.SX, state: ca.SX, step: float) -> ca.SX | None:
        """Time derivative of the state at the start of a step; None where the scheme has none."""
        return None

    def outputs(self, loop: Stepped, counter: ca.SX, state: ca.SX, step: float) -> dict[str, ca.SX]:
        """Further signals (SX) at the start of a step, by the names of `described`; none by default."""
        return {}

    @property
    def described(self) -> dict[str, tuple[str, str]]:
        """Long name and SI unit of every further signal."""
        return {}

    @property
    def settings(self) -> Json:
        """Settings of the scheme, as numbers and texts, for the provenance of a run."""
        return {}


# ----------------------------------------------------------------------
# Computation of a sampled controller at one sample, as one CasADi Function.

SIGNALS = (
    discrete_law.slip,
    discrete_law.rate,
    discrete_law.slip_error,
    discrete_law.rate_error,
    discrete_law.acceleration,
    discrete_law.next_reference,
    discrete_law.next_reference_rate,
    discrete_law.step,
    discrete_law.authority,
    discrete_law.applied_pressure,
)


@dataclass(frozen=True)
class Decision:
    """Result of a controller at one sample.

    Attributes
    ----------
    pressure : SX
        Commanded pressure [Pa].
    integrals : list of SX
        ξ at the next sample.
    own : list of SX
        Memory of the scheme itself at the next sample.
    """

    pressure: ca.SX
    integrals: list[ca.SX]
    own: list[ca.SX]


class Decided(ABC):
    """Sampled part of a scheme: evaluation of a law at one sample.

    Attributes
    ----------
    own_size : int
        Number of entries of the scheme's own memory.
    """

    own_size: ClassVar[int] = 0

    @staticmethod
    @abstractmethod
    def derive(law: DiscreteLaw) -> tuple[sp.Expr, ...]:
        """Return the expressions that `decide` evaluates, with the numerical values of the law."""

    @classmethod
    @abstractmethod
    def decide(cls, expressions: tuple[sp.Expr, ...], law: DiscreteLaw, values: Values, own: list[ca.SX]) -> Decision:
        """Result of the controller from the expressions, the values of their symbols, and the scheme's own memory."""


@dataclass(frozen=True)
class ControlStep:
    """The sampled-step function of a controller, without plant and actuator.

    Attributes
    ----------
    function : casadi.Function
        (signals in the order of `SIGNALS`, integrals ξ, numbers of the law, memory of the scheme) → pressure [Pa] at
        this sample, integrals and memory at the next one, and the change of the pressure [Pa] due to the change of ξ.
    numbers : tuple of float
        Numbers of this law; another law of the same kind has the same function.
    """

    function: ca.Function
    numbers: tuple[float, ...]


@lru_cache(maxsize=64)
def control_step(kind: type[Decided], law: DiscreteLaw) -> ControlStep:
    """Sampled-step function of a law under a scheme."""
    slopes = tuple(slope_of(law.pressure, symbol) for symbol in law.integrals)
    lifted = Lifted.of((*kind.derive(law), *slopes))
    symbols = {"signals": SIGNALS, "integrals": law.integrals, "numbers": lifted.numbers}
    inputs = {name: ca.SX.sym(name, len(parts)) for name, parts in symbols.items()}
    own = ca.SX.sym("own", kind.own_size)
    values = {s: inputs[name][i] for name, parts in symbols.items() for i, s in enumerate(parts)}
    split = len(lifted.expressions) - len(slopes)
    decision = kind.decide(lifted.expressions[:split], law, values, ca.vertsplit(own) if kind.own_size else [])
    changes = (after - values[s] for s, after in zip(law.integrals, decision.integrals, strict=True))
    slope = discrete_law.values(lifted.expressions[split:], values)
    effect = sum((k * change for k, change in zip(slope, changes, strict=True)), start=ca.SX(0))
    results = [decision.pressure, _column(decision.integrals), _column(decision.own), effect]
    names = ["pressure", "integrals", "own", "push"]
    function = ca.Function("control", [*inputs.values(), own], results, [*inputs, "own"], [f"{n}_next" for n in names])
    return ControlStep(function, lifted.values)


def slope_of(pressure: sp.Expr, integral: sp.Symbol) -> sp.Expr:
    """Derivative of the pressure with respect to an integral state; 0 if the law has its own anti-windup."""
    limited = pressure.has(sp.Min, sp.Max, sp.Piecewise)
    return sp.Integer(0) if limited else sp.diff(pressure, integral)


def _column(entries: list[ca.SX]) -> ca.SX:
    return ca.vertcat(*entries) if entries else ca.SX(0, 1)


# ----------------------------------------------------------------------
# Aperiodic sampling.

GRAINS = range(8, 101)  # steps of a simulation in the shortest interval
MOST_STEPS = 1000


@dataclass(frozen=True, kw_only=True)
class AperiodicClock:
    """Aperiodic sampling: intervals of `shortest` to `longest` steps, uniformly distributed.

    Attributes
    ----------
    shortest, longest : int
        Steps from one sample to the next, 1 ≤ shortest ≤ longest ≤ 1000.
    seed : int
        Seed of the intervals, not negative.
    """

    shortest: int
    longest: int
    seed: int = 0

    def __post_init__(self) -> None:
        if not (is_whole(self.shortest, 1) and is_whole(self.longest, self.shortest, MOST_STEPS)):
            raise ParameterError(
                f"shortest and longest interval of aperiodic sampling must be whole numbers of steps, 1 to "
                f"{MOST_STEPS}, with shortest <= longest. Received {self.shortest!r} and {self.longest!r}. "
                "Round both to whole numbers, and give the shorter one first."
            )
        Measurement(seed=self.seed)

    @classmethod
    def of(cls, shortest: Fraction, longest: Fraction) -> Self:
        """Aperiodic sampling with 8 to 100 steps in the shortest interval [s]; the longest is rounded down.

        The longest interval has at most 1000 steps.
        """
        ratio = longest / shortest
        grain = max(GRAINS, key=lambda count: (Fraction(int(count * ratio), count), -count))
        return cls(shortest=grain, longest=min(int(grain * ratio), MOST_STEPS))

    @property
    def start(self) -> tuple[float, ...]:
        """Steps until the first sample (0), and the state of the generator."""
        return (0.0, *generator(self.seed))

    def after(self, memory: list[ca.SX]) -> tuple[ca.SX, list[ca.SX]]:
        """Whether a sample is taken now, and the memory one step later."""
        wait, *state = memory
        now = wait < 1
        following, drawn = uniform(state)
        fresh = self.shortest + ca.floor((self.longest - self.shortest + 1) * drawn)
        states = [ca.if_else(now, new, old) for new, old in zip(following, state, strict=True)]
        return now, [ca.if_else(now, fresh, wait) - 1, *states]


# ----------------------------------------------------------------------
# Common part of the sampled schemes: the law once per T_s, with zero-order hold of its pressure.

MOST_SUBSTEPS = 100


@dataclass(frozen=True)
class ControlSample:
    """All values of one sample (SX): the pressures applied before and after it, and the memory afterwards."""

    before: ca.SX
    applied: ca.SX
    integrals: list[ca.SX]
    numbers: list[ca.SX]
    own: list[ca.SX]
    memories: list[ca.SX]
    noise: list[ca.SX]
    clock: list[ca.SX]
    flow: list[ca.SX]
    integral_effect: ca.SX


@dataclass(frozen=True, kw_only=True)
class Sampled(Scheme, Decided):
    """A controller that measures every T_s and holds its pressure in between (zero-order hold).

    The entries of the memory are, in this order: the numbers of the law, B0, the numbers of actuator and measurement,
    the scheme's own memory, the last applied pressure, the memories of the sampled stages, the sensor and the aperiodic
    sampling, and the states of the dynamic stages.

    Attributes
    ----------
    substeps : int
        Steps of the integrator per sample, 1 … 100.
    measurement : Measurement or Sensor
        A sensor other than `Measurement` uses the slip alone, and requires the sampling period for which it was made.
    authority : float or None
        Nominal input gain B0 of e2' = B0·p [m²/kg] where the scheme needs one; None: from the fault, see `nominal`.
    clock : AperiodicClock or None
        Aperiodic sampling, with a delay of a whole number of steps; None: a sample at every step.
    """

    substeps: int = 1
    actuator: Actuator = DIRECT
    measurement: Sensor = EXACT
    authority: float | None = None
    clock: AperiodicClock | None = None

    def __post_init__(self) -> None:
        if not is_whole(self.substeps, 1, MOST_SUBSTEPS):
            raise ParameterError(f"substeps must be a whole number, 1 to {MOST_SUBSTEPS}. Received {self.substeps!r}.")
        if self.authority is not None and not 0 < self.authority < float("inf"):
            raise ParameterError(f"authority must be positive and finite. Received {self.authority!r} m²/kg.")
        if self.clock and self.actuator.part:
            raise ParameterError(
                "the delay must be a whole number of steps with aperiodic sampling. Received a delay with a fraction "
                f"of {self.actuator.part:.4g} of a step. Round the delay."
            )

    @property
    def initial_memory(self) -> tuple[float, ...]:
        """Initial values of the scheme's own memory, `own_size` entries."""
        return ()

    def nominal(self, loop: Stepped) -> float:
        """B0 [m²/kg] by default: the smallest μN̂ of the fault's uncertainty box."""
        return loop.fault.authority_range[0]

    def memory(self, loop: Stepped, step: float) -> dict[str, float]:
        """See `Scheme.memory`; rejects a sensor made for another step, and substeps too long for the actuator."""
        self.actuator.require_resolved(step / self.substeps)
        self.measurement.require_step(step)
        parts = self._parts(loop)
        return {f"{name}_{i}": float(v) for name, values in parts.items() for i, v in enumerate(values)}

    def pressure(self, loop: Stepped, counter: ca.SX, state: ca.SX, step: float) -> ca.SX:
        """See `Scheme.pressure`."""
        sample = self._sample(loop, counter, state, step)
        pressure: ca.SX = self.actuator.flow(sample.numbers, sample.flow, self._sections(sample)[0][0])[1]
        return pressure

    def integral_effect(self, loop: Stepped, counter: ca.SX, state: ca.SX, step: float) -> ca.SX:
        """Pressure change [Pa] (SX) due to the update of ξ at a sample, before anti-windup freezes ξ at a limit."""
        return self._sample(loop, counter, state, step).integral_effect

    def outputs(self, loop: Stepped, counter: ca.SX, state: ca.SX, step: float) -> dict[str, ca.SX]:
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
    def settings(self) -> Json:
        """See `Scheme.settings`."""
        entries: Json = {"substeps": self.substeps}
        entries |= {"actuator": ", ".join(map(repr, self.actuator.stages))} if self.actuator.stages else {}
        entries |= {"authority": self.authority} if self.authority else {}
        entries |= {"clock": repr(self.clock)} if self.clock else {}
        return entries | ({"measurement": repr(self.measurement)} if self.measurement.noisy else {})

    def advance(self, loop: Stepped, method: Any, counter: ca.SX, state: ca.SX, step: float) -> ca.SX:
        """See `Scheme.advance`."""
        sample = self._sample(loop, counter, state, step)
        moving = ca.vertcat(state[:2], *sample.flow)
        for applied, begin, share in self._sections(sample):
            # CasADi would merge the repeated functions of two sections if they had as many arguments, so that the
            # second has one more.
            given = ca.vertcat(counter, applied, *sample.numbers, *([begin] if begin else []))
            times = math.ceil(share * self.substeps)
            motion = self._motion(step, begin, share, times)
            moving = loop.advance_often(method, motion, given, moving, share * step / times, times)
        rest = ca.vertcat(*sample.own, sample.applied, *sample.memories, *sample.noise, *sample.clock)
        first = 2 + len(sample.integrals)
        count = state.shape[0] - first - rest.shape[0] - len(sample.flow)
        constants = state[first : first + count]
        return ca.vertcat(moving[:2], *sample.integrals, constants, rest, moving[2:])

    def _sections(self, sample: ControlSample) -> tuple[tuple[ca.SX, float, float], ...]:
        """Pressures applied between two samples, each with its beginning and duration as shares of the period."""
        late = self.actuator.part
        return ((sample.before, 0, late), (sample.applied, late, 1 - late)) if late else ((sample.applied, 0, 1),)

    def _motion(self, step: float, begin: float, share: float, times: int) -> Motion:
        """Rates of plant and actuator under a constant input pressure, for `Stepped.advance_often`."""

        def motion(plant: Motion, passed: ca.SX, now: ca.SX, given: ca.SX) -> ca.SX:
            counter, applied, *numbers = ca.vertsplit(given)
            time = (counter + (begin + passed * share / times)) * step
            rates, pressure, _ = self.actuator.flow(numbers, ca.vertsplit(now[2:]), applied)
            return ca.vertcat(plant(time, now[:2], pressure), *rates)

        return motion

    def _parts(self, loop: Stepped) -> dict[str, tuple[float, ...]]:
        """Initial values of the memory, by part."""
        sampled, flowing = self.actuator.sampled, self.actuator.flowing
        return {
            "law": self.control_step(loop).numbers,
            "authority": (self.authority or self.nominal(loop),),
            "sampled": tuple(v for stage in sampled for v in stage.numbers),
            "flowing": tuple(v for stage in flowing for v in stage.numbers),
            "deviation": self.measurement.numbers,
            "own": self.initial_memory,
            "held": (0.0,),
            "kept": tuple(v for stage in sampled for v in stage.start),
            "noise": self.measurement.start,
            "clock": self.clock.start if self.clock else (),
            "flow": self.actuator.flow_start,
        }

    def control_step(self, loop: Stepped) -> ControlStep:
        """Sampled-step function of the controller of a loop."""
        return control_step(type(self), DiscreteLaw.of(loop.controller, loop.constant_pressure))

    def _sample(self, loop: Stepped, counter: ca.SX, state: ca.SX, step: float) -> ControlSample:
        """Measure, evaluate the law, apply its pressure; ξ does not wind up where a stage limits the pressure."""
        count = len(loop.integrals)
        entries = iter(ca.vertsplit(state[2 + count :]))
        part = {name: [next(entries) for _ in values] for name, values in self._parts(loop).items()}
        seen, noise = self.measurement.measure(part["deviation"], part["noise"], state[:2])
        ahead = self.clock.shortest if self.clock else 1
        inputs = self._inputs(loop, counter, step, seen, ahead)
        inputs |= {discrete_law.authority: part["authority"][0], discrete_law.applied_pressure: part["held"][0]}
        signals = ca.vertcat(*(inputs[symbol] for symbol in SIGNALS))
        before = state[2 : 2 + count]
        given = signals, before, ca.vertcat(*part["law"]), ca.vertcat(*part["own"])
        pressure, after, own, effect = self.control_step(loop).function(*given)
        applied, excess, memories = self.actuator.hold(part["sampled"], part["kept"], pressure, ahead * step)
        winds = excess * effect > 0
        integrals = [ca.if_else(winds, before[i], after[i]) for i in range(count)]
        memory = [own[i] for i in range(self.own_size)]
        sample = ControlSample(
            part["held"][0], applied, integrals, part["flowing"], memory, memories, noise, [], part["flow"], effect
        )
        return self._if_now(sample, ca.vertsplit(before) if count else [], part) if self.clock else sample

    def _if_now(self, sample: ControlSample, integrals: list[ca.SX], part: dict[str, list[ca.SX]]) -> ControlSample:
        """The sample, or the previous values if none is taken now."""
        now, clock = self.clock.after(part["clock"]) if self.clock else (True, [])

        def chosen(new: list[ca.SX], old: list[ca.SX]) -> list[ca.SX]:
            return [ca.if_else(now, a, b) for a, b in zip(new, old, strict=True)]

        return replace(
            sample,
            applied=ca.if_else(now, sample.applied, sample.before),
            integrals=chosen(sample.integrals, integrals),
            own=chosen(sample.own, part["own"]),
            memories=chosen(sample.memories, part["kept"]),
            noise=chosen(sample.noise, part["noise"]),
            clock=clock,
        )

    @staticmethod
    def _inputs(loop: Stepped, counter: ca.SX, step: float, seen: ca.SX, ahead: int) -> Values:
        """Values of the signals of one sample; the next sample is expected after `ahead` steps."""
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
