"""Delay of the pressure by samples, and jitter of the delay, as an actuator stage."""

import math
from typing import Any, ClassVar, Self

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, is_whole
from quakedesign.loop.actuators.base import Option, SampledStage
from quakedesign.loop.sensing.measurement import Entries, Measurement, generator, uniform

MOST_SAMPLES = 100
_SAME = 1e-9  # tolerance, relative to a sampling period


@checked_dataclass(frozen=True, kw_only=True)
class Delay(SampledStage):
    """Delay of the pressure by a number of samples; 0 until the first pressure arrives.

    Attributes
    ----------
    samples : int
        0 … 100.
    jitter : int
        Largest additional delay in samples, drawn uniformly at every sample, 0 … 100. No older pressure acts after a
        newer one.
    seed : int
        Seed of the jitter, not negative.
    part : float
        Additional delay as a share of a sampling period, at least 0 and below 1.
    """

    name: ClassVar[str] = "delay"
    rank: ClassVar[int] = 1
    options: ClassVar[tuple[Option, ...]] = (
        Option(name="delay", unit="s", help="Delay of the computation, such as '2 ms'.", default=0.0),
        Option(
            name="jitter",
            unit="",
            help="Largest random addition to the delay, in sampling periods, drawn at every sample: with "
            "--delay '1 ms', T_s = 1 ms and --jitter 1, the delay is 1 or 2 ms.",
        ),
    )

    samples: int
    jitter: int = 0
    seed: int = 0
    part: float = 0.0

    def __post_init__(self) -> None:
        for name, value in (("samples of a delay", self.samples), ("jitter", self.jitter)):
            if not is_whole(value, 0, MOST_SAMPLES):
                raise ParameterError(f"{name} must be a whole number, 0 to {MOST_SAMPLES}. Received {value!r}.")
        if not 0 <= self.part < 1:
            raise ParameterError(f"part of a delay must be at least 0 and below 1. Received {self.part!r}.")
        Measurement(seed=self.seed)

    @classmethod
    def from_options(cls, step: float, *, delay: float, jitter: int | None = None) -> Self:  # type: ignore[override]
        """See `Stage.from_options`."""
        if not 0 <= delay <= MOST_SAMPLES * step:
            raise ParameterError(
                f"delay must be 0 to {MOST_SAMPLES} sampling periods of {step:g} s. Received {delay:g} s. "
                "Change the delay or the step."
            )
        part, whole = math.modf(delay / step + _SAME)
        return cls(samples=int(whole), jitter=jitter or 0, part=part - _SAME if part > 2 * _SAME else 0.0)

    @property
    def start(self) -> tuple[float, ...]:
        """Queue of zero pressures [Pa], oldest first; with jitter also age [samples] and generator."""
        queue = (0.0,) * (self.samples + self.jitter)
        return (*queue, float(self.samples), *generator(self.seed)) if self.jitter else queue

    def apply(self, numbers: Entries, memory: Entries, pressure: Any, step: float) -> tuple[Any, Entries]:
        """Queued pressure whose age is the delay; see `SampledStage.apply`."""
        import casadi as ca

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
