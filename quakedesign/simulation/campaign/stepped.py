"""Samples of a loop with a fixed step, many at once in compiled code."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from quakedesign.simulation.backend import STEP
from quakedesign.simulation.campaign.ledger import plain
from quakedesign.simulation.campaign.problem import NOT_COMPARED, Problem, SampleResult
from quakedesign.simulation.campaign.program import CompiledProgram
from quakedesign.simulation.campaign.reseeding import reseeded
from quakedesign.simulation.campaign.space import Sample
from quakedesign.simulation.integrators import Integrator
from quakedesign.simulation.loading import Load
from quakedesign.simulation.memoryless_earthquake import natural_peak
from quakedesign.simulation.metrics import events, metrics
from quakedesign.simulation.outcome import OutcomeCriterion
from quakedesign.simulation.recorder import Recorder
from quakedesign.simulation.run import loop_class, run
from quakedesign.simulation.trajectory import Trajectory
from quakedesign.simulation.variation import Variation, names

_SLICE = 4096


@dataclass(frozen=True, kw_only=True, repr=False)
class SteppedProblem(Problem):
    """Friction of slip and slip rate, with a fixed step; see `Problem`.

    Attributes
    ----------
    method : type of Integrator
    load : Load
    """

    method: type[Integrator]
    load: Load

    def recorder(self, sample: Sample) -> Recorder:
        """Loop of a sample with all that is watched."""
        numbers = dict(sample.numbers)
        varied = Variation(**{name: numbers.pop(name) for name in names()})
        initial = numbers["initial_slip"], numbers["initial_slip_rate"]
        loop: Any = loop_class(self.plant)(self.fault, self.controller, load=self.load, factors=varied.values)
        return Recorder(loop, reseeded(self.scheme, sample.noise_seed), self.setting.step, initial)

    def __post_init__(self) -> None:
        loop_class(self.plant)

    def start(self, sample: Sample) -> "np.ndarray":
        """See `Problem.start`."""
        return np.array(self.recorder(sample).start(self.setting.settled_from))

    def starts(self, samples: Sequence[Sample]) -> "np.ndarray":
        """See `Problem.starts`; without noise samples differ in their first state and their factors alone."""
        if not samples or self._noisy:
            return super().starts(samples)
        rows = np.tile(self.start(samples[0]), (len(samples), 1))
        for column, name in enumerate(("initial_slip", "initial_slip_rate"), start=2):
            rows[:, column] = [sample.numbers[name] for sample in samples]
        rows[:, -len(names()) :] = [[sample.numbers[name] for name in names()] for sample in samples]
        return rows

    @cached_property
    def _noisy(self) -> bool:
        """Whether the seed of a sample tells in its start; four seeds have one start where it does not."""
        one = self.sample(0)
        return len({self.start(replace(one, noise_seed=seed)).tobytes() for seed in range(4)}) > 1

    @cached_property
    def _watched(self) -> Recorder:
        """Recorder of any sample: what it computes from a vector is the same for all."""
        return self.recorder(self.sample(0))

    @cached_property
    def criterion(self) -> OutcomeCriterion:
        """With the natural earthquake of the nominal fault."""
        return OutcomeCriterion.of(self.fault, natural_peak(self.fault))

    @cached_property
    def program(self) -> CompiledProgram:
        """One step for all samples."""
        before = ca.SX.sym("z", self._watched.size)
        step = ca.Function(STEP, [before], [self._watched.advance(before, self.method)])
        return CompiledProgram.of(step, self._watched.index("diverged"))

    @property
    def own_inputs(self) -> dict[str, Any]:
        """See `Problem.own_inputs`."""
        return {"method": self.method.name, "load": plain(self.load)}

    def results(self, ends: "Sequence[np.ndarray]") -> list[SampleResult]:
        """See `Problem.results`."""
        vector = ca.SX.sym("z", self._watched.size)
        observe = ca.Function("observe", [vector], [self._watched.observe(vector)])
        slices = (ends[first : first + _SLICE] for first in range(0, len(ends), _SLICE))
        return [self._result(end) for each in slices for end in observe(np.transpose(each)).full().T]

    def _result(self, end: Any) -> SampleResult:
        watched = self._watched.watched(end)
        return SampleResult(figures=self._figures(watched), events=events(watched))

    @property
    def metrics(self) -> tuple[str, ...]:
        """See `Problem.metrics`."""
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
        return {name: value for name, value in measured.items() if value is not None and name not in NOT_COMPARED}

    def trajectory(self, sample: Sample, samples: int) -> Trajectory:
        """See `Problem.trajectory`."""
        return run(self.recorder(sample), replace(self.setting, samples=samples), self.method, self.criterion)
