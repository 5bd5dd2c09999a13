"""What a campaign is about: one closed loop, and how its samples differ."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Protocol

import numpy as np

from quakedesign.controllers import Controller
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.loop.schemes import Scheme
from quakedesign.simulation.campaign.ledger import plain
from quakedesign.simulation.campaign.space import MOST_SAMPLES, Sample, Space, noise_seed, point
from quakedesign.simulation.outcome import Outcome, OutcomeCriterion
from quakedesign.simulation.run import library_versions
from quakedesign.simulation.setting import Setting
from quakedesign.simulation.trajectory import Trajectory

NOT_COMPARED = ("settled_from", "steps", "seconds")


@dataclass(frozen=True, kw_only=True)
class SampleResult:
    """What is known of a sample that has been run; a diverged one has events, and its peak slip rate at most.

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


class Program(Protocol):
    """What a worker needs; it can be sent anywhere.

    Attributes
    ----------
    lanes : int
        Samples that are stepped at once.
    batch_steps : int
        Of all samples of a batch together: what is lost when a worker dies, some half a minute.
    """

    lanes: ClassVar[int]
    batch_steps: ClassVar[int]

    @property
    def fingerprint(self) -> str:
        """Digest of the arithmetic."""

    def compiled(self, folder: Any) -> "Program":
        """The same, as fast as this machine can make it, with files in a private folder."""

    def ends(self, starts: "np.ndarray", steps: int) -> "np.ndarray":
        """Vectors at the end of samples by those at their start, one a row."""


@dataclass(frozen=True, kw_only=True)
class Problem(ABC):
    """One closed loop, and how its samples differ; a vector of numbers at the start of a sample tells the end of it.

    Attributes
    ----------
    fault : Fault
    controller : Controller or None
    scheme : Scheme
    setting : Setting
    plant : str
    space : Space
    seed : int
    """

    fault: Fault
    controller: Controller | None
    scheme: Scheme
    setting: Setting
    plant: str
    space: Space
    seed: int

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.fault.name}, {self.controller}, {', '.join(self.space.ranges)})"

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

    @abstractmethod
    def start(self, sample: Sample) -> "np.ndarray":
        """Vector of a sample at time zero."""

    def starts(self, samples: Sequence[Sample]) -> "np.ndarray":
        """Vectors of samples at time zero, one a row."""
        return np.array([self.start(sample) for sample in samples])

    @property
    @abstractmethod
    def program(self) -> Program:
        """From the start of samples to their end."""

    @abstractmethod
    def results(self, ends: "Sequence[np.ndarray]") -> list[SampleResult]:
        """What the vectors at the end tell."""

    @property
    @abstractmethod
    def metrics(self) -> tuple[str, ...]:
        """Names of what every sample has that does not diverge."""

    @property
    @abstractmethod
    def criterion(self) -> OutcomeCriterion:
        """What the outcome of every sample is decided by."""

    @abstractmethod
    def trajectory(self, sample: Sample, samples: int) -> Trajectory:
        """Run of a sample with about that many instants, with the digits that it has in the campaign."""

    @property
    @abstractmethod
    def own_inputs(self) -> dict[str, Any]:
        """What determines the digits beside `inputs` of every problem."""

    def outcome(self, result: SampleResult) -> Outcome:
        """What a sample comes to."""
        peak, error = (result.figures.get(name) for name in ("peak_slip_rate", "max_slip_error"))
        return self.criterion.outcome(peak, error, result.events, followed=self.controller is not None)

    @property
    def inputs(self) -> dict[str, Any]:
        """Everything that determines the digits of every sample, as JSON can hold it."""
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
