"""Linear variable differential transformer (LVDT) and its converter: bandwidth, noise, resolution."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca

from quakedesign.errors import ParameterError
from quakedesign.fault.checks import require_nonnegative
from quakedesign.loop.sensing.base import SlipStage
from quakedesign.loop.sensing.measurement import Measurement


@dataclass(frozen=True, kw_only=True)
class Transducer(SlipStage):
    """Slip behind a low-pass filter of first order, plus independent normal noise at every sample, then rounded.

    The filter is followed exactly for a slip that is held over the sample, y ← y + (1 − e^(−2πf_bT_s))(x − y).

    Attributes
    ----------
    deviation : float
        Standard deviation of the noise [m]; 0 for none.
    bandwidth : float
        f_b, at which the amplitude falls to 1/√2 [Hz]; infinite for a transducer that follows at once.
    quantum : float
        q, of which a reading is the nearest multiple, halves upward [m]; 0 for a reading as it is.
    seed : int
        Of the noise, not negative.

    Raises
    ------
    ParameterError
    """

    hardware: ClassVar[bool] = True

    deviation: float = 0.0
    bandwidth: float = math.inf
    quantum: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        require_nonnegative(deviation=self.deviation, quantum=self.quantum)
        if not self.bandwidth > 0:
            raise ParameterError(f"bandwidth must be positive, or infinite. Received {self.bandwidth!r} Hz.")
        Measurement(seed=self.seed)

    @property
    def start(self) -> tuple[float, ...]:
        """Filtered slip [m], if filtered, and the generator of the noise, if there is any."""
        return ((0.0,) if self._filtered else ()) + self._noise.start

    def numbers(self, step: float) -> tuple[float, ...]:
        """Share of the difference that the filter closes in one sample [-]; deviations and quantum [m]."""
        share = (-math.expm1(-2 * math.pi * self.bandwidth * step),) if self._filtered else ()
        return (*share, *self._noise.numbers, *((float(self.quantum),) if self.quantum else ()))

    def pass_on(self, numbers: list[Any], memory: list[Any], slip: Any) -> tuple[Any, list[Any]]:
        """See `SlipStage.pass_on`."""
        numbers, memory, own = list(numbers), list(memory), []
        quantum = numbers.pop() if self.quantum else None
        if self._filtered:
            before = memory.pop(0)
            slip = before + numbers.pop(0) * (slip - before)
            own = [slip]
        seen, noise = self._noise.measure(numbers, memory, ca.vertcat(slip, 0))
        reading = seen[0] if quantum is None else quantum * ca.floor(seen[0] / quantum + 0.5)
        return reading, [*own, *noise]

    @property
    def _filtered(self) -> bool:
        return math.isfinite(self.bandwidth)

    @property
    def _noise(self) -> Measurement:
        return Measurement(slip_noise=self.deviation, seed=self.seed)
