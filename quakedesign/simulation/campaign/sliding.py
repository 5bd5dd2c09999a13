"""Samples of a fault with rate-and-state friction held in slow sliding, each a run of its own."""

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, Self

import numpy as np

from quakedesign.errors import ParameterError, UnknownNameError, require_known
from quakedesign.fault import Fault
from quakedesign.fault.checks import require_nonnegative, require_positive
from quakedesign.loop import LinearLaw
from quakedesign.loop.actuators import DIRECT
from quakedesign.loop.schemes import simulation_scheme
from quakedesign.rationals import shortly
from quakedesign.simulation.campaign.problem import NOT_COMPARED, Problem, SampleResult
from quakedesign.simulation.campaign.space import Sample, Space
from quakedesign.simulation.integrators import adaptive_integrators
from quakedesign.simulation.metrics import EVENTS, Metrics
from quakedesign.simulation.outcome import OutcomeCriterion
from quakedesign.simulation.sliding_conditions import FRICTION, PressurePath, SlidingVariation, Tide
from quakedesign.simulation.slow_sliding import PLANTS, SlidingRun, criterion_of, simulate_sliding

_FIGURES = tuple(part.name for part in fields(Metrics) if part.name not in (*NOT_COMPARED, "max_h_rate"))
_FACTORS = tuple(field.name for field in fields(SlidingVariation))


@dataclass(frozen=True, kw_only=True)
class SlidingProgram:
    """A run of `simulate_sliding` for every sample; vectors are its numbers, then its figures and times of its events.

    Attributes
    ----------
    fault : Fault
    law : LinearLaw
    step : Fraction
        T_s [s].
    path : PressurePath
    stress, period : float
        Amplitude [Pa] and period [s] of the stress of a sample whose share is 1.
    plant, method : str
    settled_from : float
        [s].
    """

    lanes: ClassVar[int] = 1
    batch_steps: ClassVar[int] = 10_000

    fault: Fault
    law: LinearLaw
    step: Fraction
    path: PressurePath
    stress: float
    period: float
    plant: str
    method: str
    settled_from: float

    @property
    def fingerprint(self) -> str:
        """Of the fields that are not named elsewhere; the solver is that of the versions of the libraries."""
        told = f"{self.path} {self.stress!r} {self.period!r} {self.method}"
        return hashlib.sha256(told.encode()).hexdigest()

    def compiled(self, folder: Path) -> Self:
        """Itself: nothing is compiled."""
        return self

    def run(self, numbers: Sequence[float], duration: float, samples: int | None = None) -> SlidingRun:
        """Run of a sample over a time [s]."""
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
        """Figures, then times of events, one sample a row; nan for what there is not."""
        duration = steps * float(self.step)
        return np.array([_told(self.run([float(v) for v in row], duration, 1)) for row in np.atleast_2d(starts)])


def _told(run: SlidingRun) -> list[float]:
    measured = run.metrics.to_dict()
    found = [measured[name] for name in _FIGURES] + [run.events.get(name) for name in EVENTS]
    return [math.nan if value is None else float(value) for value in found]


@dataclass(frozen=True, kw_only=True, repr=False)
class SlidingProblem(Problem):
    """Friction with a state, held in slow sliding; see `Problem`. The scheme holds what the pressure goes through.

    Attributes
    ----------
    method : str
    stress, stress_period : float
        Bound [Pa] and period [s] of the stress.
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
                "a campaign with friction that has a state needs a law of samples that is told the slip alone. "
                f"Received {self.controller}. Give an elqr that design found."
            )
        if self.scheme != simulation_scheme("explicit", actuator=getattr(self.scheme, "actuator", DIRECT)):
            raise ParameterError(
                "slow sliding is told the slip as it is and has a solver of its own. Received another scheme, noise, a "
                "sensor or substeps. Leave them out."
            )

    @cached_property
    def program(self) -> SlidingProgram:
        """See `Problem.program`."""
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
        """See `Problem.start`."""
        return np.array([sample.numbers[name] for name in (*_FACTORS, "amplitude", "phase")])

    def results(self, ends: "Sequence[np.ndarray]") -> list[SampleResult]:
        """See `Problem.results`."""
        return [self._result(end.tolist()) for end in ends]

    def _result(self, end: list[float]) -> SampleResult:
        known = {name: v for name, v in zip((*_FIGURES, *EVENTS), end, strict=True) if not math.isnan(v)}
        happened = {name: known.pop(name) for name in EVENTS if name in known}
        return SampleResult(figures=known, events=happened)

    @property
    def metrics(self) -> tuple[str, ...]:
        """See `Problem.metrics`."""
        return _FIGURES

    @cached_property
    def criterion(self) -> OutcomeCriterion:
        """With the speed at which inertia or damping carries the nominal fault."""
        return criterion_of(self.fault)

    @property
    def own_inputs(self) -> dict[str, Any]:
        """See `Problem.own_inputs`."""
        return {"method": self.method, "stress": self.stress, "stress_period": self.stress_period}

    def trajectory(self, sample: Sample, samples: int) -> SlidingRun:
        """See `Problem.trajectory`."""
        return self.program.run(self.start(sample).tolist(), self.setting.steps * self.setting.step, samples)


def sliding_space(fault: Fault, spread: Fraction) -> Space:
    """Space of a, b and D_c off by a share of their values [-], of the fault's box, and of a sine of stress.

    Raises
    ------
    ParameterError
        For a spread that is not from 0 to below 1.
    """
    if not 0 <= spread < 1:
        raise ParameterError(f"a spread must be from 0 to below 1. Received {shortly(spread)}. Change it.")
    box = fault.box
    widths = {**dict.fromkeys(FRICTION, spread), "normal_stress": box.authority}
    widths |= {"stiffness": box.stiffness, "damping": box.damping}
    ranges = {name: (float(1 - widths[name]), float(1 + widths[name])) for name in _FACTORS}
    return Space(MappingProxyType(ranges | {"amplitude": (0.0, 1.0), "phase": (0.0, 2 * math.pi)}))
