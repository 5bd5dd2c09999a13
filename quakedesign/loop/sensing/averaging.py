"""Mean of the last readings."""

from dataclasses import dataclass
from typing import Any, ClassVar

from quakedesign.errors import ParameterError
from quakedesign.loop.sensing.base import SlipStage

MOST_SAMPLES = 1000


@dataclass(frozen=True, kw_only=True)
class Averaging(SlipStage):
    """Mean of the last N readings: noise falls by √N, and the slip lags by (N − 1)T_s/2.

    Attributes
    ----------
    samples : int
        N, 1 … 1000.

    Raises
    ------
    ParameterError
    """

    hardware: ClassVar[bool] = False

    samples: int

    def __post_init__(self) -> None:
        whole = isinstance(self.samples, int) and not isinstance(self.samples, bool)
        if not (whole and 1 <= self.samples <= MOST_SAMPLES):
            raise ParameterError(
                f"samples of a mean must be a whole number, 1 to {MOST_SAMPLES}. Received {self.samples!r}."
            )

    @property
    def start(self) -> tuple[float, ...]:
        """The last N − 1 readings [m], oldest first."""
        return (0.0,) * (self.samples - 1)

    def numbers(self, step: float) -> tuple[float, ...]:
        """None."""
        return ()

    def pass_on(self, numbers: list[Any], memory: list[Any], slip: Any) -> tuple[Any, list[Any]]:
        """See `SlipStage.pass_on`. A running sum would be cheaper, and would gather rounding errors for hours."""
        readings = [*memory, slip]
        return sum(readings[1:], start=readings[0]) / self.samples, readings[1:]
