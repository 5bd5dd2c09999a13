"""Samples that follow no clock."""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Self

import casadi as ca

from quakedesign.errors import ParameterError
from quakedesign.loop.sensing.measurement import Measurement, generator, uniform

GRAINS = range(8, 101)  # steps of a simulation in the shortest interval
MOST_STEPS = 1000


@dataclass(frozen=True, kw_only=True)
class NoClock:
    """The next sample comes any whole number of steps after the last, drawn anew each time, each equally likely.

    Attributes
    ----------
    shortest, longest : int
        Steps from one sample to the next, 1 … 1000.
    seed : int
        Of what is drawn, not negative.

    Raises
    ------
    ParameterError
    """

    shortest: int
    longest: int
    seed: int = 0

    def __post_init__(self) -> None:
        whole = all(isinstance(v, int) and not isinstance(v, bool) for v in (self.shortest, self.longest))
        if not (whole and 1 <= self.shortest <= self.longest <= MOST_STEPS):
            raise ParameterError(
                f"intervals by no clock must be whole numbers of steps, 1 to {MOST_STEPS}, the shortest first. "
                f"Received {self.shortest!r} and {self.longest!r}. Change them."
            )
        Measurement(seed=self.seed)

    @classmethod
    def of(cls, shortest: Fraction, longest: Fraction) -> Self:
        """In 8 to 100 steps of the shortest interval [s], so many that the longest is nearly reached, never passed."""
        ratio = longest / shortest
        grain = max(GRAINS, key=lambda count: (Fraction(int(count * ratio), count), -count))
        return cls(shortest=grain, longest=min(int(grain * ratio), MOST_STEPS))

    @property
    def start(self) -> tuple[float, ...]:
        """Steps to wait for the first sample, none, and the generator."""
        return (0.0, *generator(self.seed))

    def after(self, memory: list[Any]) -> tuple[Any, list[Any]]:
        """Whether there is a sample now, and the memory one step later."""
        wait, *state = memory
        now = wait < 1
        following, drawn = uniform(state)
        fresh = self.shortest + ca.floor((self.longest - self.shortest + 1) * drawn)
        kept = [ca.if_else(now, new, old) for new, old in zip(following, state, strict=True)]
        return now, [ca.if_else(now, fresh, wait) - 1, *kept]
