"""What a controller sees of the fault."""

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from quakedesign.errors import ParameterError
from quakedesign.fault.checks import require_nonnegative
from quakedesign.loop.sensing.base import Sensor

# Multiplicative congruential generators of L'Ecuyer (1988), Commun. ACM 31, 742, combined as there: every product is a
# whole number below 2^53, so that floating point carries them out exactly, in machine code as elsewhere.
_FACTORS = (40014, 40692)
_MODULI = (2147483563, 2147483399)


@dataclass(frozen=True, kw_only=True)
class Measurement(Sensor):
    """Slip and slip rate with independent noise, once per sample.

    Attributes
    ----------
    slip_noise, rate_noise : float
        Standard deviations of normal noise, or bounds of noise that is anything within them [m], [m/s], not negative.
    seed : int
        Of the noise, not negative.
    bounded : bool
        Whether the noise is uniform within bounds, as a guarantee has them, instead of normal.

    Raises
    ------
    ParameterError
    """

    of_slip_alone: ClassVar[bool] = False

    slip_noise: float = 0.0
    rate_noise: float = 0.0
    seed: int = 0
    bounded: bool = False

    def __post_init__(self) -> None:
        require_nonnegative(slip_noise=self.slip_noise, rate_noise=self.rate_noise)
        if isinstance(self.seed, bool) or not isinstance(self.seed, int) or self.seed < 0:
            raise ParameterError(f"seed must be a whole number of at least 0. Received {self.seed!r}.")

    @property
    def noisy(self) -> bool:
        """Whether there is any noise."""
        return self.slip_noise > 0 or self.rate_noise > 0

    @property
    def step(self) -> None:
        """Any."""

    @property
    def software(self) -> "Measurement":
        """None: all of its noise is that of instruments."""
        return EXACT

    @property
    def numbers(self) -> tuple[float, ...]:
        """Standard deviations or bounds [m], [m/s]; none without noise."""
        return (float(self.slip_noise), float(self.rate_noise)) if self.noisy else ()

    @property
    def start(self) -> tuple[float, ...]:
        """State of the generator, from the seed; none without noise."""
        return generator(self.seed) if self.noisy else ()

    def measure(self, numbers: list[Any], memory: list[Any], x: Any) -> tuple[Any, list[Any]]:
        """Measured x1 [m] and x2 [m/s] (SX), and the generator afterwards."""
        if not self.noisy:
            return x, memory
        drawn = []
        for _ in numbers:
            memory, number = uniform(memory) if self.bounded else _normal(memory)
            drawn.append(2 * number - 1 if self.bounded else number)
        return x + ca.vertcat(*(size * each for size, each in zip(numbers, drawn, strict=True))), memory


EXACT = Measurement()


def generator(seed: int) -> tuple[float, ...]:
    """State of a generator of random numbers, from a seed."""
    words = np.random.SeedSequence(seed).generate_state(len(_MODULI))
    return tuple(float(int(word) % (m - 1) + 1) for word, m in zip(words, _MODULI, strict=True))


def _normal(memory: list[Any]) -> tuple[list[Any], Any]:
    """State of the generator after two steps, and a number of the standard normal distribution."""
    memory, radius = uniform(memory)
    memory, angle = uniform(memory)
    return memory, ca.sqrt(-2 * ca.log(radius)) * ca.cos(2 * ca.pi * angle)


def uniform(memory: list[Any]) -> tuple[list[Any], Any]:
    """Next state of the generator, and a number strictly between 0 and 1."""
    after = [ca.fmod(a * state, m) for a, state, m in zip(_FACTORS, memory, _MODULI, strict=True)]
    difference = after[0] - after[1]
    top = _MODULI[0] - 1
    return after, (difference + ca.if_else(difference < 1, top, 0)) / (top + 1)
