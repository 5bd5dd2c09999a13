"""How far and how finely a run goes."""

import math
from dataclasses import dataclass
from fractions import Fraction

from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.rationals import rational

MOST_STEPS = 10**10
_ALMOST_A_STEP = Fraction(1, 10**6)


@dataclass(frozen=True, slots=True)
class Setting:
    """How far and how finely to go: times in s, checked."""

    step: float
    steps: int
    samples: int
    settled_from: float

    @classmethod
    def of(
        cls,
        fault: Fault,
        step: float | None,
        duration: float | None,
        samples: int,
        settled_from: float | None,
    ) -> "Setting":
        """Setting from what `simulate` was given; None stands for its defaults."""
        task = fault.reference.operation_time
        length = _positive("duration", task if duration is None else duration)
        pace = _positive("step", fault.sampling_time if step is None else step)
        steps = int(rational(length) / rational(pace) + _ALMOST_A_STEP)
        if not 1 <= steps <= MOST_STEPS:
            raise ParameterError(f"duration must hold 1 to {MOST_STEPS:.0e} steps. Received {steps}. Change the step.")
        if isinstance(samples, bool) or not isinstance(samples, int) or samples < 1:
            raise ParameterError(f"samples must be a whole number of at least 1. Received {samples!r}.")
        start = min(task, length) / 4 if settled_from is None else settled_from
        if not 0 <= start < length:
            raise ParameterError(
                f"settled_from must be from 0 to below the duration, {length!r} s. Received {start!r} s."
            )
        return cls(pace, steps, samples, float(start))


def _positive(name: str, value: float) -> float:
    if not (math.isfinite(value) and value > 0):
        raise ParameterError(f"{name} must be positive and finite. Received {value!r} s.")
    return float(value)
