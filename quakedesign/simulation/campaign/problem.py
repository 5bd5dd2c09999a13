"""What a campaign is about: one closed loop, and how its samples differ."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from quakedesign.controllers import Controller
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.loop.schemes import Scheme
from quakedesign.simulation.backend import STEP
from quakedesign.simulation.campaign.ledger import plain
from quakedesign.simulation.campaign.program import Program
from quakedesign.simulation.campaign.reseeding import reseeded
from quakedesign.simulation.campaign.space import MOST_SAMPLES, Sample, Space, noise_seed, point
from quakedesign.simulation.earthquake import natural_peak
from quakedesign.simulation.integrators import Integrator
from quakedesign.simulation.loading import Load
from quakedesign.simulation.metrics import events, metrics
from quakedesign.simulation.outcome import Outcome, OutcomeCriterion
from quakedesign.simulation.recorder import Recorder
from quakedesign.simulation.run import library_versions, loop_class, run
from quakedesign.simulation.setting import Setting
from quakedesign.simulation.trajectory import Trajectory
from quakedesign.simulation.variation import Variation

_NOT_COMPARED = ("settled_from", "steps", "seconds")


@dataclass(frozen=True, kw_only=True)
class SampleResult:
    """What is known of a sample that has been run; a diverged one has events, but no figures.

    Attributes
    ----------
    figures : mapping of str to float
        Metrics of the run, those of its length excepted.
    events : mapping of str to float
        Time of first occurrence [s].
    """

    figures: Mapping[str, float]
    events: Mapping[str, float]

    @property
    def diverged(self) -> bool:
        """Whether the run has ended early."""
        return "diverged" in self.events


@dataclass(frozen=True, kw_only=True)
class Problem:
    """One closed loop, and how its samples differ.

    Attributes
    ----------
    fault : Fault
    controller : Controller or None
    scheme : Scheme
    setting : Setting
    method : type of Integrator
    plant : str
    load : Load
    space : Space
    seed : int
    """

    fault: Fault
    controller: Controller | None
    scheme: Scheme
    setting: Setting
    method: type[Integrator]
    plant: str
    load: Load
    space: Space
    seed: int

    def __post_init__(self) -> None:
        self.fault.require_memoryless("a campaign")

    def __repr__(self) -> str:
        return f"Problem({self.fault.name}, {self.controller}, {self.scheme.name}, {', '.join(self.space.ranges)})"

    def point(self, index: int) -> "np.ndarray":
        """Place of sample number `index` in the unit cube.

        Raises
        ------
        ParameterError
            When it is no whole number, or too large.
        """
        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < MOST_SAMPLES:
            raise ParameterError(f"index must be a whole number, 0 to {MOST_SAMPLES - 1}. Received {index!r}.")
        return point(self.seed, index, len(self.space.ranges))

    def sample(self, index: int) -> Sample:
        """Sample number `index`, a function of the seed and of `index` alone.

        Raises
        ------
        ParameterError
            When it is no whole number, or too large.
        """
        return self.space.sample(self.point(index), noise_seed(self.seed, index))

    def recorder(self, sample: Sample) -> Recorder:
        """Loop of a sample with all that is watched."""
        initial = sample.initial_slip, sample.initial_slip_rate
        scheme = reseeded(self.scheme, sample.noise_seed)
        return Recorder(self._loop(sample.variation), scheme, self.setting.step, initial)

    def start(self, sample: Sample) -> "np.ndarray":
        """Vector of a sample at time zero."""
        return np.array(self.recorder(sample).start(self.setting.settled_from))

    def _loop(self, variation: Variation) -> Any:
        kind = loop_class(self.plant)
        return kind(self.fault, self.controller, load=self.load, factors=variation.values)

    @cached_property
    def _watched(self) -> Recorder:
        """Recorder of any sample: what it computes from a vector is the same for all."""
        return self.recorder(self.sample(0))

    @cached_property
    def criterion(self) -> OutcomeCriterion:
        """What the outcome of every sample is decided by: the natural earthquake of the nominal fault."""
        return OutcomeCriterion.of(self.fault, natural_peak(self.fault))

    def outcome(self, result: SampleResult) -> Outcome:
        """What a sample comes to."""
        peak, error = (result.figures.get(name) for name in ("peak_slip_rate", "max_slip_error"))
        return self.criterion.outcome(peak, error, result.events, followed=self.controller is not None)

    @cached_property
    def program(self) -> Program:
        """One step for all samples."""
        before = ca.SX.sym("z", self._watched.size)
        step = ca.Function(STEP, [before], [self._watched.advance(before, self.method)])
        return Program.of(step, self._watched.index("diverged"))

    @cached_property
    def inputs(self) -> dict[str, Any]:
        """Everything that determines the digits of every sample, as JSON can hold it."""
        law = {"law": self.controller.name} | plain(self.controller) if self.controller else None
        named = {"name": self.scheme.name} | plain(self.scheme.settings)
        return {
            "fault": plain(self.fault) | {"friction": {"law": self.fault.friction.name} | plain(self.fault.friction)},
            "controller": law,
            "scheme": named | {"as_set": plain(self.scheme)},
            "setting": plain({name: value for name, value in asdict(self.setting).items() if name != "samples"}),
            "method": self.method.name,
            "plant": self.plant,
            "load": plain(self.load),
            "ranges": plain(self.space.ranges),
            "seed": self.seed,
            "arithmetic": self.program.fingerprint,
            "versions": library_versions("quakedesign", "casadi", "numpy", "scipy", "sympy"),
        }

    def results(self, ends: "Sequence[np.ndarray]") -> list[SampleResult]:
        """What the vectors at the end tell."""
        vector = ca.SX.sym("z", self._watched.size)
        observe = ca.Function("observe", [vector], [self._watched.observe(vector)])
        return [self._result(observe(end).full().ravel()) for end in ends]

    def _result(self, end: Any) -> SampleResult:
        watched = self._watched.watched(end)
        return SampleResult(figures=self._figures(watched), events=events(watched))

    @property
    def metrics(self) -> tuple[str, ...]:
        """Names of what every sample has that does not diverge."""
        return tuple(self._figures(defaultdict(lambda: 1.0, diverged=-1.0)))

    def _figures(self, watched: dict[str, float]) -> dict[str, Any]:
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
        return {name: value for name, value in measured.items() if value is not None and name not in _NOT_COMPARED}

    def trajectory(self, sample: Sample, samples: int) -> Trajectory:
        """Run of a sample with about that many instants, with the digits that it has in the campaign."""
        return run(self.recorder(sample), replace(self.setting, samples=samples), self.method, self.criterion)
