"""Time that the computation takes."""

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import casadi as ca

from quakedesign.errors import ParameterError
from quakedesign.loop.actuators.base import Option, SampledStage
from quakedesign.loop.sensing.measurement import Measurement, generator, uniform

MOST_SAMPLES = 100
_SAME = 1e-9  # of a sampling period


@dataclass(frozen=True, kw_only=True)
class Delay(SampledStage):
    """What is computed from one measurement acts a whole number of samples later; before that, nothing is injected.

    Attributes
    ----------
    samples : int
        0 … 100.
    jitter : int
        Largest number of further samples, drawn anew at every sample, each equally likely, 0 … 100. What has acted
        once is not followed by anything older.
    seed : int
        Of the jitter, not negative.

    Raises
    ------
    ParameterError
    """

    name: ClassVar[str] = "delay"
    place: ClassVar[int] = 1
    options: ClassVar[tuple[Option, ...]] = (
        Option(
            name="delay",
            unit="s",
            help="Time that the computation takes, a whole number of steps, such as '2 ms'.",
            default=0.0,
        ),
        Option(
            name="jitter",
            unit="",
            help="Most further steps that a delay takes, drawn anew at every sample: 1 for 1 or 2 ms at --delay '1 ms' "
            "and steps of 1 ms.",
        ),
    )

    samples: int
    jitter: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        for name, value in (("samples of a delay", self.samples), ("jitter", self.jitter)):
            if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= MOST_SAMPLES:
                raise ParameterError(f"{name} must be a whole number, 0 to {MOST_SAMPLES}. Received {value!r}.")
        Measurement(seed=self.seed)

    @classmethod
    def asked(cls, step: float, *, delay: float, jitter: int | None = None) -> Self:  # type: ignore[override]
        """See `Stage.asked`.

        Raises
        ------
        ParameterError
            For a delay that is no whole number of periods.
        """
        count = round(delay / step) if step > 0 and 0 <= delay < 1e9 * step else -1
        if count < 0 or abs(delay - count * step) > _SAME * step:
            raise ParameterError(
                f"delay must be a whole number of sampling periods of {step:g} s, since p is held over each. "
                f"Received {delay:g} s. Change the delay or the step."
            )
        return cls(samples=count, jitter=jitter or 0)

    @property
    def start(self) -> tuple[float, ...]:
        """Nothing asked for yet [Pa], oldest first; with jitter the age of what acts [samples] and the generator."""
        queue = (0.0,) * (self.samples + self.jitter)
        return (*queue, float(self.samples), *generator(self.seed)) if self.jitter else queue

    def apply(self, numbers: Any, memory: list[Any], pressure: Any, step: float) -> tuple[Any, list[Any]]:
        """Pressure of the queue that is as old as the delay; see `SampledStage.apply`."""
        longest = self.samples + self.jitter
        queue = [*memory[:longest], pressure]
        if not self.jitter:
            return queue[0], queue[1:]
        age, *state = memory[longest:]
        state, drawn = uniform(state)
        age = ca.fmin(age + 1, self.samples + ca.floor((self.jitter + 1) * drawn))
        acting = queue[0]
        for samples in range(longest):
            acting = ca.if_else(age == samples, queue[longest - samples], acting)
        return acting, [*queue[1:], age, *state]
