"""Campaign problems: one closed loop, the variation of its samples, and the program that computes them.

Chapters: interface; rate-and-state faults in slow sliding; compiled steps of many samples; seeds of the noise; loops
with a fixed step.
"""

import ctypes
import hashlib
import math
import subprocess
from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from fractions import Fraction
from functools import cached_property, lru_cache
from pathlib import Path
from threading import Lock
from types import MappingProxyType
from typing import Any, ClassVar, Protocol, Self, TypeVar

import casadi as ca
import numpy as np

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, UnknownNameError, require_known
from quakedesign.exact import shortly
from quakedesign.fault import Fault
from quakedesign.fault.model import require_nonnegative, require_positive
from quakedesign.files import Json, temporary_folder
from quakedesign.laws import Controller, LinearLaw
from quakedesign.loop import Scheme, simulation_scheme
from quakedesign.loop.actuators.chain import DIRECT
from quakedesign.simulation.campaign.ledger import plain
from quakedesign.simulation.campaign.space import MOST_SAMPLES, Sample, Space, noise_seed, point
from quakedesign.simulation.closed_loop import Load, Variation, names
from quakedesign.simulation.compiled import (
    LANE_FLAGS,
    LANES,
    STEP,
    Backend,
    compiler,
    expanded,
    ladder,
    lanes_c,
    processor_flags,
    shared_library,
)
from quakedesign.simulation.earthquake import natural_peak
from quakedesign.simulation.integrators import Integrator, adaptive_integrators
from quakedesign.simulation.recorder import EVENTS, Metrics, Recorder, events, metrics
from quakedesign.simulation.run_settings import RunSetting, library_versions, loop_class, run
from quakedesign.simulation.slow_sliding import PLANTS, SlidingRun, criterion_of, simulate_sliding
from quakedesign.simulation.state_plant import FRICTION, PressurePath, SlidingVariation, Tide
from quakedesign.simulation.stepping import Advancer
from quakedesign.simulation.trajectory import Outcome, OutcomeCriterion, Trajectory

# ----------------------------------------------------------------------
# Interface of a campaign problem: one closed loop, and the variation of its samples.

NOT_COMPARED = ("settled_from", "steps", "seconds")


@checked_dataclass(frozen=True, kw_only=True)
class SampleResult:
    """Result of the run of one sample; for a diverged sample, the events and at most the peak slip rate.

    Attributes
    ----------
    figures : mapping of str to float
        Metrics of the run, without `settled_from`, `steps` and `seconds`.
    events : mapping of str to float
        Time of first occurrence [s].
    """

    figures: Mapping[str, float]
    events: Mapping[str, float]

    @property
    def diverged(self) -> bool:
        """Whether the run diverged."""
        return "diverged" in self.events


class CampaignProgram(Protocol):
    """Program that a worker runs; it can be pickled.

    Attributes
    ----------
    lanes : int
        Number of samples that are advanced simultaneously.
    batch_steps : int
        Largest total number of steps of a batch, about half a minute of work, which is lost if a worker dies.
    """

    lanes: ClassVar[int]
    batch_steps: ClassVar[int]

    @property
    def fingerprint(self) -> str:
        """Digest of everything in the program that determines the numerical results and is not in `inputs`."""

    def compiled(self, folder: Any) -> "CampaignProgram":
        """The same program, compiled for this machine if possible, with files in a private folder."""

    def ends(self, starts: "np.ndarray", steps: int) -> "np.ndarray":
        """Final vectors of samples from their initial vectors, one per row."""


@checked_dataclass(frozen=True, kw_only=True)
class CampaignProblem(ABC):
    """One closed loop and the variation of its samples; a sample's initial vector determines its final vector."""

    fault: Fault
    controller: Controller | None
    scheme: Scheme
    setting: RunSetting
    plant: str
    space: Space
    seed: int

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.fault.name}, {self.controller}, {', '.join(self.space.ranges)})"

    def point(self, index: int) -> "np.ndarray":
        """Point of sample number `index` in the unit cube.

        Raises
        ------
        ParameterError
            If `index` is negative, or 2^20 or larger.
        """
        if not 0 <= index < MOST_SAMPLES:
            raise ParameterError(f"index must be a whole number, 0 to {MOST_SAMPLES - 1}. Received {index!r}.")
        return point(self.seed, index, len(self.space.ranges))

    def sample(self, index: int) -> Sample:
        """Sample number `index`, a function of the seed and of `index` alone.

        Raises
        ------
        ParameterError
            If `index` is negative, or 2^20 or larger.
        """
        return self.space.sample(self.point(index), noise_seed(self.seed, index))

    @abstractmethod
    def start(self, sample: Sample) -> "np.ndarray":
        """Initial vector of a sample."""

    def starts(self, samples: Sequence[Sample]) -> "np.ndarray":
        """Initial vectors of samples, one per row."""
        return np.array([self.start(sample) for sample in samples])

    @property
    @abstractmethod
    def program(self) -> CampaignProgram:
        """Program that computes the final vectors of samples from the initial vectors."""

    @abstractmethod
    def results(self, ends: "Sequence[np.ndarray]") -> list[SampleResult]:
        """Results of samples from their final vectors."""

    @property
    @abstractmethod
    def metrics(self) -> tuple[str, ...]:
        """Names of the metrics of every sample that does not diverge."""

    @property
    @abstractmethod
    def criterion(self) -> OutcomeCriterion:
        """Criterion for the outcome of every sample."""

    @abstractmethod
    def trajectory(self, sample: Sample, samples: int) -> Trajectory:
        """Run of a sample with about `samples` instants; the results equal those of the campaign bitwise."""

    @property
    @abstractmethod
    def own_inputs(self) -> Json:
        """Further entries of `inputs` for this kind of problem."""

    def outcome(self, result: SampleResult) -> Outcome:
        """Outcome of a sample."""
        peak, error = (result.figures.get(name) for name in ("peak_slip_rate", "max_slip_error"))
        return self.criterion.outcome(peak, error, result.events, followed=self.controller is not None)

    @property
    def inputs(self) -> Json:
        """Everything that determines the numerical results of the samples, in JSON types."""
        law = {"law": self.controller.name} | plain(self.controller) if self.controller else None
        named = {"name": self.scheme.name} | plain(self.scheme.settings)
        return {
            "fault": plain(self.fault) | {"friction": {"law": self.fault.friction.name} | plain(self.fault.friction)},
            "controller": law,
            "scheme": named | {"as_set": plain(self.scheme)},
            "setting": plain({name: value for name, value in asdict(self.setting).items() if name != "samples"}),
            "plant": self.plant,
            "ranges": plain(self.space.ranges),
            "seed": self.seed,
            "arithmetic": self.program.fingerprint,
            "versions": library_versions("quakedesign", "casadi", "numpy", "scipy", "sympy"),
            **self.own_inputs,
        }


# ----------------------------------------------------------------------
# Samples of a fault with rate-and-state friction in controlled slow sliding, each in a separate run.

_NOT_OF_SLIDING = (*NOT_COMPARED, "max_h_rate", "time_at_rest_fraction")
_FIGURES = tuple(part.name for part in fields(Metrics) if part.name not in _NOT_OF_SLIDING)
_FACTORS = tuple(field.name for field in fields(SlidingVariation))


@dataclass(frozen=True, kw_only=True)
class SlidingProgram:
    """Run of `simulate_sliding` for each sample: maps the varied numbers to metrics and event times."""

    lanes: ClassVar[int] = 1
    batch_steps: ClassVar[int] = 10_000

    fault: Fault
    law: LinearLaw
    step: Fraction  # T_s [s]
    path: PressurePath
    stress: float  # Largest amplitude [Pa] of the sinusoidal stress; a sample scales it by `amplitude`
    period: float  # Period [s] of this stress
    plant: str
    method: str
    settled_from: float  # [s]

    @property
    def fingerprint(self) -> str:
        """Digest of pressure path, stress, period and method; the versions in `inputs` identify the solver."""
        text = f"{self.path} {self.stress!r} {self.period!r} {self.method}"
        return hashlib.sha256(text.encode()).hexdigest()

    def compiled(self, folder: Path) -> Self:
        """The program itself: nothing is compiled."""
        return self

    def run(self, numbers: Sequence[float], duration: float, samples: int | None = None) -> SlidingRun:
        """Run of a sample over a duration [s]."""
        share, phase = numbers[-2:]
        return simulate_sliding(
            self.fault,
            self.law,
            self.step,
            lag=self.path.lag,
            diffusion=self.path.diffusion,
            stages=self.path.stages,
            tide=Tide(amplitude=share * self.stress, period=self.period, phase=phase),
            variation=SlidingVariation(**dict(zip(_FACTORS, numbers, strict=False))),
            duration=duration,
            settled_from=self.settled_from,
            samples=samples,
            inertia=PLANTS[self.plant],
            method=self.method,
        )

    def ends(self, starts: "np.ndarray", steps: int) -> "np.ndarray":
        """Metrics and then event times, one sample per row; nan for missing values."""
        duration = steps * float(self.step)
        return np.array([_sample_row(self.run([float(v) for v in row], duration, 1)) for row in np.atleast_2d(starts)])


def _sample_row(run: SlidingRun) -> list[float]:
    measured = run.metrics.to_dict()
    values = [measured[name] for name in _FIGURES] + [run.events.get(name) for name in EVENTS]
    return [math.nan if value is None else float(value) for value in values]


@checked_dataclass(frozen=True, kw_only=True, repr=False)
class SlidingProblem(CampaignProblem):
    """Samples of a controlled fault in slow sliding; see `CampaignProblem`. The scheme contains the actuator.

    Attributes
    ----------
    method : str
    stress, stress_period : float
        Largest amplitude [Pa] and period [s] of the sinusoidal stress.
    """

    method: str
    stress: float
    stress_period: float

    def __post_init__(self) -> None:
        require_nonnegative(stress=self.stress)
        require_positive(stress_period=self.stress_period)
        require_known(self.method, adaptive_integrators(), "method")
        require_known(self.plant, PLANTS, "plant of a fault with a state", UnknownNameError)
        if self.controller is None or self.controller.of_slip is None or self.controller.sampling is None:
            raise ParameterError(
                "a campaign for friction with a state needs a sampled law that measures the slip alone. "
                f"Received {self.controller}. Give an elqr from design."
            )
        if self.scheme != simulation_scheme("explicit", actuator=getattr(self.scheme, "actuator", DIRECT)):
            entries = {"scheme": self.scheme.name} | {k: v for k, v in self.scheme.settings.items() if k != "actuator"}
            raise ParameterError(
                "a campaign of slow sliding needs the scheme explicit, exact measurement and one substep. Received "
                f"{', '.join(f'{k} {v}' for k, v in entries.items())}. Omit scheme, measurement and substeps."
            )

    @cached_property
    def program(self) -> SlidingProgram:
        """See `CampaignProblem.program`."""
        law: Any = self.controller
        return SlidingProgram(
            fault=self.fault,
            law=law.of_slip,
            step=law.sampling.step,
            path=PressurePath.of(law.sampling, getattr(self.scheme, "actuator", DIRECT)),
            stress=self.stress,
            period=self.stress_period,
            plant=self.plant,
            method=self.method,
            settled_from=self.setting.settled_from,
        )

    def start(self, sample: Sample) -> "np.ndarray":
        """See `CampaignProblem.start`."""
        return np.array([sample.numbers[name] for name in (*_FACTORS, "amplitude", "phase")])

    def results(self, ends: "Sequence[np.ndarray]") -> list[SampleResult]:
        """See `CampaignProblem.results`."""
        return [self._result(end.tolist()) for end in ends]

    def _result(self, end: list[float]) -> SampleResult:
        defined = {name: v for name, v in zip((*_FIGURES, *EVENTS), end, strict=True) if not math.isnan(v)}
        happened = {name: defined.pop(name) for name in EVENTS if name in defined}
        return SampleResult(figures=defined, events=happened)

    @property
    def metrics(self) -> tuple[str, ...]:
        """See `CampaignProblem.metrics`."""
        return _FIGURES

    @cached_property
    def criterion(self) -> OutcomeCriterion:
        """Criterion with the `dynamic_rate` of the nominal fault."""
        return criterion_of(self.fault)

    @property
    def own_inputs(self) -> Json:
        """See `CampaignProblem.own_inputs`."""
        return {"method": self.method, "stress": self.stress, "stress_period": self.stress_period}

    def trajectory(self, sample: Sample, samples: int) -> SlidingRun:
        """See `CampaignProblem.trajectory`."""
        return self.program.run(self.start(sample).tolist(), self.setting.steps * self.setting.step, samples)


def sliding_space(fault: Fault, spread: Fraction) -> Space:
    """Space of the factors of a, b, D_c, σ', k and η [-], and of amplitude [-] and phase [rad] of a sinusoidal stress.

    Raises
    ------
    ParameterError
        For a spread outside [0, 1).
    """
    if not 0 <= spread < 1:
        raise ParameterError(f"a spread must be from 0 to below 1. Received {shortly(spread)}. Change it.")
    box = fault.box
    widths = {**dict.fromkeys(FRICTION, spread), "normal_stress": box.authority}
    widths |= {"stiffness": box.stiffness, "damping": box.damping}
    ranges = {name: (float(1 - widths[name]), float(1 + widths[name])) for name in _FACTORS}
    return Space(MappingProxyType(ranges | {"amplitude": (0.0, 1.0), "phase": (0.0, 2 * math.pi)}))


# ----------------------------------------------------------------------
# One step of a loop as source text, and the compiled call that repeats it for many samples.

Mover = Callable[["np.ndarray", int], None]
SLICE = 200_000  # steps, summed over all samples, per call of compiled code, which cannot be interrupted: less than 1 s


@dataclass(frozen=True, kw_only=True)
class Library:
    """Compiled source and the digest of its content, which is compared before each load."""

    path: Path
    digest: str

    @classmethod
    def of(cls, path: Path) -> "Library":
        """Library that has just been built in a private folder."""
        return cls(path=path, digest=_digest(path.read_bytes()))

    def content(self) -> bytes:
        """Bytes of the library as built.

        Raises
        ------
        OSError
            If the file is missing or was changed.
        """
        content = self.path.read_bytes()
        if _digest(content) != self.digest:
            raise OSError(f"{self.path} differs from the library that was built")
        return content


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


@dataclass(frozen=True, kw_only=True)
class CompiledProgram:
    """Program with which a worker advances samples; it can be pickled."""

    lanes: ClassVar[int] = LANES
    batch_steps: ClassVar[int] = 80_000_000

    source: str  # C source with ``advance_samples``, which advances several samples simultaneously
    # The step with all elementary functions expanded, serialised by CasADi, for workers without a C compiler
    function: str
    size: int  # Length of the vector of one sample
    diverged: int  # Index of the time of divergence in this vector
    library: Library | None = None  # None before the source is compiled

    @classmethod
    def of(cls, step: Any, diverged: int) -> "CompiledProgram":
        """Program of a CasADi Function that advances the vector by one step."""
        source, function = lanes_c(step, diverged), expanded(step).serialize()
        return cls(source=source, function=function, size=step.size1_in(0), diverged=diverged)

    @property
    def fingerprint(self) -> str:
        """Digest of the arithmetic of one step."""
        return hashlib.sha256(self.function.encode()).hexdigest()

    def compiled(self, folder: Path) -> "CompiledProgram":
        """Program with a library compiled into a private folder; the program itself if no compiler works."""
        try:
            command = compiler()
            built = shared_library(self.source, folder, command, (*LANE_FLAGS, *processor_flags(command)))
            return replace(self, library=Library.of(built))
        except (OSError, subprocess.SubprocessError):
            return self

    def ends(self, starts: "np.ndarray", steps: int) -> "np.ndarray":
        """Vectors after a number of steps, one per row, computed in interruptible slices; a diverged sample stops.

        Parameters
        ----------
        starts : ndarray
            Shape (samples, size).
        """
        move = mover(self)
        vectors = np.array(starts, dtype=np.float64, order="C", ndmin=2)
        slice_ = -(-SLICE // len(vectors))
        for taken in range(0, steps, slice_):
            move(vectors, min(slice_, steps - taken))
        return vectors


@lru_cache(maxsize=8)
def mover(program: CompiledProgram) -> Mover:
    """Callable (vectors, steps) that advances vectors in place, one per row; in machine code if available.

    A library that is missing or was changed, as on another machine, is built again.
    """
    with temporary_folder() as folder:
        for given in (program, replace(program, library=None)):
            with suppress(OSError, AttributeError):
                if library := (given if given.library else given.compiled(folder)).library:
                    return _machine_code(library.content(), folder, program.size)
    return _virtual_machine(program)


def _machine_code(content: bytes, folder: Path, size: int) -> Mover:
    library = folder / f"{_digest(content)}.so"  # a name that differs from a rejected library that is already loaded
    library.write_bytes(content)
    loaded = ctypes.CDLL(str(library))
    if not loaded.made_for_this_processor():
        raise OSError("the library was built for another processor")
    advance = loaded.advance_samples
    rows = np.ctypeslib.ndpointer(dtype=np.float64, ndim=2, flags="C_CONTIGUOUS")
    advance.argtypes, advance.restype = [rows, ctypes.c_longlong, ctypes.c_longlong], ctypes.c_int

    def move(vectors: "np.ndarray", steps: int) -> None:
        assert vectors.shape[1] == size
        if advance(vectors, len(vectors), steps):
            raise ArithmeticError("the compiled step failed")

    return move


def _virtual_machine(program: CompiledProgram) -> Mover:
    rungs = ladder(ca.Function.deserialize(program.function))
    advancer = Advancer.of(Backend(rungs, "virtual-machine", ""), [math.nan] * program.size)
    lock = Lock()  # threads share the advancer

    def move(vectors: "np.ndarray", steps: int) -> None:
        with lock:
            for row in vectors:
                row[:] = _moved(advancer, row, steps, program.diverged)

    return move


def _moved(advancer: Advancer, start: "np.ndarray", steps: int, diverged: int) -> "np.ndarray":
    """Vector after a number of steps, or after the step that detects divergence, as in machine code."""
    advancer.vector[:] = start
    advancer.advance(steps)
    if advancer.vector[diverged] >= 0:
        advancer.vector[:] = start
        while not advancer.vector[diverged] >= 0:
            advancer.advance(1)
    return advancer.vector


# ----------------------------------------------------------------------
# New seeds for the noise of a scheme.

Value = TypeVar("Value")


def reseeded(value: Value, seed: int) -> Value:
    """Copy of a frozen dataclass or tuple in which every field ``seed`` is derived from a given seed.

    Nested fields are included. All derived seeds differ, so that the noise signals are independent.
    """
    walked: Value = _walk(value, seed, [0])
    return walked


def _walk(value: Any, seed: int, count: list[int]) -> Any:
    if type(value) is tuple:
        walked = tuple(_walk(entry, seed, count) for entry in value)
        return walked if any(new is not old for new, old in zip(walked, value, strict=True)) else value
    if not is_dataclass(value) or isinstance(value, type):
        return value
    changed = {}
    for field in fields(value):
        before = getattr(value, field.name)
        after = _derived(seed, count) if field.name == "seed" else _walk(before, seed, count)
        if after is not before:
            changed[field.name] = after
    return replace(value, **changed) if changed else value


def _derived(seed: int, count: list[int]) -> int:
    count[0] += 1
    return int(np.random.SeedSequence(seed, spawn_key=(count[0],)).generate_state(1)[0])


# ----------------------------------------------------------------------
# Samples of a loop with a fixed step, many at once in compiled code.

_SLICE = 4096


@checked_dataclass(frozen=True, kw_only=True, repr=False)
class SteppedProblem(CampaignProblem):
    """Samples of a fault whose friction depends on slip and slip rate, with a fixed step; see `CampaignProblem`.

    Attributes
    ----------
    method : type of Integrator
    load : Load
    """

    method: type[Integrator]
    load: Load

    def recorder(self, sample: Sample) -> Recorder:
        """Recorder of the loop of a sample."""
        numbers = dict(sample.numbers)
        varied = Variation(**{name: numbers.pop(name) for name in names()})
        initial = numbers["initial_slip"], numbers["initial_slip_rate"]
        loop: Any = loop_class(self.plant)(self.fault, self.controller, load=self.load, factors=varied.values)
        return Recorder(loop, reseeded(self.scheme, sample.noise_seed), self.setting.step, initial)

    def __post_init__(self) -> None:
        loop_class(self.plant)

    def start(self, sample: Sample) -> "np.ndarray":
        """See `CampaignProblem.start`."""
        return np.array(self.recorder(sample).start(self.setting.settled_from))

    def starts(self, samples: Sequence[Sample]) -> "np.ndarray":
        """See `CampaignProblem.starts`; without noise, the samples differ only in initial state and factors."""
        if not samples or self._noisy:
            return super().starts(samples)
        rows = np.tile(self.start(samples[0]), (len(samples), 1))
        for column, name in enumerate(("initial_slip", "initial_slip_rate"), start=2):
            rows[:, column] = [sample.numbers[name] for sample in samples]
        rows[:, -len(names()) :] = [[sample.numbers[name] for name in names()] for sample in samples]
        return rows

    @cached_property
    def _noisy(self) -> bool:
        """Whether the initial vector of a sample depends on its seed, tested with four seeds."""
        one = self.sample(0)
        return len({self.start(replace(one, noise_seed=seed)).tobytes() for seed in range(4)}) > 1

    @cached_property
    def _watched(self) -> Recorder:
        """Recorder of sample 0; all samples have the same functions of the vector."""
        return self.recorder(self.sample(0))

    @cached_property
    def criterion(self) -> OutcomeCriterion:
        """Criterion with the natural earthquake of the nominal fault."""
        return OutcomeCriterion.of(self.fault, natural_peak(self.fault))

    @cached_property
    def program(self) -> CompiledProgram:
        """One step for all samples."""
        before = ca.SX.sym("z", self._watched.size)
        step = ca.Function(STEP, [before], [self._watched.advance(before, self.method)])
        return CompiledProgram.of(step, self._watched.index("diverged"))

    @property
    def own_inputs(self) -> Json:
        """See `CampaignProblem.own_inputs`."""
        return {"method": self.method.name, "load": plain(self.load)}

    def results(self, ends: "Sequence[np.ndarray]") -> list[SampleResult]:
        """See `CampaignProblem.results`."""
        vector = ca.SX.sym("z", self._watched.size)
        observe = ca.Function("observe", [vector], [self._watched.observe(vector)])
        slices = (ends[first : first + _SLICE] for first in range(0, len(ends), _SLICE))
        return [self._result(end) for each in slices for end in observe(np.transpose(each)).full().T]

    def _result(self, end: Any) -> SampleResult:
        watched = self._watched.watched(end)
        return SampleResult(figures=self._figures(watched), events=events(watched))

    @property
    def metrics(self) -> tuple[str, ...]:
        """See `CampaignProblem.metrics`."""
        return tuple(self._figures(defaultdict(lambda: 1.0, diverged=-1.0)))

    def _figures(self, watched: dict[str, float]) -> Json:
        measured = metrics(
            watched,
            controlled=self.controller is not None,
            step=self.setting.step,
            steps=self.setting.steps,
            settled_from=self.setting.settled_from,
            seconds=0.0,
            sticks=self._watched.loop.sticks,
            further=self._watched.scheme.described,
        ).to_dict()
        return {name: value for name, value in measured.items() if value is not None and name not in NOT_COMPARED}

    def trajectory(self, sample: Sample, samples: int) -> Trajectory:
        """See `CampaignProblem.trajectory`."""
        return run(self.recorder(sample), replace(self.setting, samples=samples), self.method, self.criterion)
