"""Time that the computation takes."""

from dataclasses import dataclass
from typing import Any, ClassVar

from quakedesign.errors import ParameterError
from quakedesign.loop.actuators.base import SampledStage

MOST_SAMPLES = 100


@dataclass(frozen=True, kw_only=True)
class Delay(SampledStage):
    """What is computed from one measurement acts a whole number of samples later; before that, nothing is injected.

    Attributes
    ----------
    samples : int
        0 … 100.

    Raises
    ------
    ParameterError
    """

    name: ClassVar[str] = "delay"

    samples: int

    def __post_init__(self) -> None:
        whole = isinstance(self.samples, int) and not isinstance(self.samples, bool)
        if not (whole and 0 <= self.samples <= MOST_SAMPLES):
            raise ParameterError(f"samples of a delay must be a whole number, 0 to 100. Received {self.samples!r}.")

    @property
    def start(self) -> tuple[float, ...]:
        """Nothing asked for yet [Pa], oldest first."""
        return (0.0,) * self.samples

    def apply(self, numbers: Any, memory: list[Any], pressure: Any, step: float) -> tuple[Any, list[Any]]:
        """Oldest pressure of the queue; see `SampledStage.apply`."""
        queue = [*memory, pressure]
        return queue[0], queue[1:]
