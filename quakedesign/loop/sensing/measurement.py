"""Slip measurement: sensor base classes, LVDT transducer, noise, resolution, and averaging."""

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, is_whole, require_whole
from quakedesign.fault.model import require_nonnegative

if TYPE_CHECKING:
    import casadi as ca

Entries = list["ca.SX"]
"""Numbers or memory of an element of the loop: entries of the state vector of the compiled loop."""

# ----------------------------------------------------------------------
# Interface of sensors and of their elements.

_SAME = 1e-12  # largest relative difference of two sampling periods that count as equal


class Sensor(ABC):
    """Map from the true slip and slip rate to the measured ones, once per sample.

    Its numbers and its memory are entries of the state vector of the compiled loop; `measure` works on CasADi SX. By
    default a sensor estimates both from the slip.

    Attributes
    ----------
    of_slip_alone : bool
        Whether it needs no slip rate.
    """

    of_slip_alone: ClassVar[bool] = True

    @property
    def noisy(self) -> bool:
        """Whether the measured slip or slip rate differs from the true one."""
        return True

    @property
    @abstractmethod
    def step(self) -> float | None:
        """Sampling period [s] of the sensor; None for any."""

    @property
    @abstractmethod
    def numbers(self) -> tuple[float, ...]:
        """Parameters in SI units, as `measure` expects them."""

    @property
    @abstractmethod
    def start(self) -> tuple[float, ...]:
        """Memory before the first sample, for a fault at rest at slip 0."""

    @abstractmethod
    def measure(self, numbers: Entries, memory: Entries, x: "ca.SX") -> tuple["ca.SX", Entries]:
        """Measured slip [m] and slip rate [m/s] at the true state x, and the memory afterwards."""

    @property
    @abstractmethod
    def software(self) -> "Sensor":
        """The part that runs on the controller, without the stages in hardware."""

    @property
    def size(self) -> int:
        """Number of entries of the memory, including the state of the seeded noise generator."""
        return len(self.start)

    def require_step(self, step: float) -> None:
        """Reject a sampling period [s] other than the sensor's."""
        if self.step is not None and abs(step - self.step) > _SAME * self.step:
            raise ParameterError(
                f"the sampling period must be that of the sensor, {self.step:.6g} s. Received {step:.6g} s. "
                "Make the sensor for the period of the loop."
            )

    def function(self) -> "ca.Function":
        """CasADi Function (memory, slip [m]) → memory, slip estimate [m], slip-rate estimate [m/s]."""
        import casadi as ca

        memory, slip = ca.SX.sym("memory", self.size), ca.SX.sym("slip")
        seen, after = self.measure([*map(ca.SX, self.numbers)], ca.vertsplit(memory), ca.vertcat(slip, 0))
        outputs = [ca.vertcat(*after), seen[0], seen[1]]
        names = ["memory_after", "slip_estimate", "rate_estimate"]
        return ca.Function("sensor", [memory, slip], outputs, ["memory", "slip"], names)


class SlipStage(ABC):
    """One element of a chain that a measured slip [m] passes, once per sample.

    Attributes
    ----------
    hardware : bool
        Whether it is part of the instrument, not of the controller program.
    """

    hardware: ClassVar[bool]

    @property
    @abstractmethod
    def start(self) -> tuple[float, ...]:
        """Memory before the first sample."""

    @abstractmethod
    def numbers(self, step: float) -> tuple[float, ...]:
        """Parameters for a sampling period [s], as `pass_on` expects them."""

    @abstractmethod
    def pass_on(self, numbers: Entries, memory: Entries, slip: "ca.SX") -> tuple["ca.SX", Entries]:
        """Slip [m] (SX) at the output of the element, and the memory afterwards."""


# ----------------------------------------------------------------------
# Measured slip and slip rate.

# Multiplicative congruential generators of L'Ecuyer (1988), Commun. ACM 31, 742, combined as there: every product is a
# whole number below 2^53, so that floating-point arithmetic is exact, in machine code and in Python.
_FACTORS = (40014, 40692)
_MODULI = (2147483563, 2147483399)


@checked_dataclass(frozen=True, kw_only=True)
class Measurement(Sensor):
    """Slip and slip rate with independent noise, once per sample.

    Attributes
    ----------
    slip_noise, rate_noise : float
        Standard deviations of normal noise, or bounds of uniform noise [m], [m/s], not negative.
    seed : int
        Seed of the noise, not negative.
    bounded : bool
        Whether the noise is uniform within bounds, such as those of a guarantee, instead of normal.
    """

    of_slip_alone: ClassVar[bool] = False

    slip_noise: float = 0.0
    rate_noise: float = 0.0
    seed: int = 0
    bounded: bool = False

    def __post_init__(self) -> None:
        require_nonnegative(slip_noise=self.slip_noise, rate_noise=self.rate_noise)
        require_whole(0, seed=self.seed)

    @property
    def noisy(self) -> bool:
        """Whether there is any noise."""
        return self.slip_noise > 0 or self.rate_noise > 0

    @property
    def step(self) -> None:
        """None: any sampling period."""

    @property
    def software(self) -> "Measurement":
        """Exact measurement: all noise is that of the instruments."""
        return EXACT

    @property
    def numbers(self) -> tuple[float, ...]:
        """Standard deviations or bounds [m], [m/s]; none without noise."""
        return (float(self.slip_noise), float(self.rate_noise)) if self.noisy else ()

    @property
    def start(self) -> tuple[float, ...]:
        """State of the generator, from the seed; none without noise."""
        return generator(self.seed) if self.noisy else ()

    def measure(self, numbers: Entries, memory: Entries, x: "ca.SX") -> tuple["ca.SX", Entries]:
        """Measured x1 [m] and x2 [m/s] (SX), and the generator afterwards."""
        import casadi as ca

        if not self.noisy:
            return x, memory
        drawn = []
        for _ in numbers:
            memory, number = uniform(memory) if self.bounded else _normal(memory)
            drawn.append(2 * number - 1 if self.bounded else number)
        return x + ca.vertcat(*(size * each for size, each in zip(numbers, drawn, strict=True))), memory


EXACT = Measurement()


def generator(seed: int) -> tuple[float, ...]:
    """State of a random-number generator from a seed."""
    import numpy as np

    words = np.random.SeedSequence(seed).generate_state(len(_MODULI))
    return tuple(float(int(word) % (m - 1) + 1) for word, m in zip(words, _MODULI, strict=True))


def _normal(memory: Entries) -> tuple[Entries, "ca.SX"]:
    """State of the generator after two steps, and a standard normal number."""
    import casadi as ca

    memory, radius = uniform(memory)
    memory, angle = uniform(memory)
    return memory, ca.sqrt(-2 * ca.log(radius)) * ca.cos(2 * ca.pi * angle)


def uniform(memory: Entries) -> tuple[Entries, "ca.SX"]:
    """Next state of the generator, and a number strictly between 0 and 1."""
    import casadi as ca

    after = [ca.fmod(a * state, m) for a, state, m in zip(_FACTORS, memory, _MODULI, strict=True)]
    difference = after[0] - after[1]
    top = _MODULI[0] - 1
    return after, (difference + ca.if_else(difference < 1, top, 0)) / (top + 1)


@checked_dataclass(frozen=True, kw_only=True)
class Transducer(SlipStage):
    """Slip after a first-order low-pass filter, plus independent normal noise at every sample, then rounded.

    The filter is exact for a slip that is constant over each sampling interval, y ← y + (1 − e^(−2πf_bT_s))(x − y).

    Attributes
    ----------
    deviation : float
        Standard deviation of the noise [m]; 0 for none.
    bandwidth : float
        f_b, at which the amplitude falls to 1/√2 [Hz]; infinite for a transducer without lag.
    quantum : float
        Resolution q [m]: a reading is rounded to the nearest multiple of it, halves upward; 0 for no rounding.
    seed : int
        Seed of the noise, not negative.
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
        """Filtered slip [m], if filtered, and the state of the noise generator, if noisy."""
        return ((0.0,) if self._filtered else ()) + self._noise.start

    def numbers(self, step: float) -> tuple[float, ...]:
        """Filter factor 1 − e^(−2πf_bT_s) [-]; standard deviation and quantum [m]."""
        share = (-math.expm1(-2 * math.pi * self.bandwidth * step),) if self._filtered else ()
        return (*share, *self._noise.numbers, *((float(self.quantum),) if self.quantum else ()))

    def pass_on(self, numbers: Entries, memory: Entries, slip: "ca.SX") -> tuple["ca.SX", Entries]:
        """See `SlipStage.pass_on`."""
        import casadi as ca

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


# ----------------------------------------------------------------------
# Mean of the latest readings.

MOST_SAMPLES = 1000


@checked_dataclass(frozen=True, kw_only=True)
class Averaging(SlipStage):
    """Mean of the last N readings: noise falls by a factor of √N, and the slip lags by (N − 1)T_s/2.

    Attributes
    ----------
    samples : int
        N, 1 … 1000.
    """

    hardware: ClassVar[bool] = False

    samples: int

    def __post_init__(self) -> None:
        if not is_whole(self.samples, 1, MOST_SAMPLES):
            raise ParameterError(
                f"samples of a mean must be a whole number, 1 to {MOST_SAMPLES}. Received {self.samples!r}."
            )

    @property
    def start(self) -> tuple[float, ...]:
        """The last N − 1 readings [m], oldest first."""
        return (0.0,) * (self.samples - 1)

    def numbers(self, step: float) -> tuple[float, ...]:
        """No parameters."""
        return ()

    def pass_on(self, numbers: Entries, memory: Entries, slip: "ca.SX") -> tuple["ca.SX", Entries]:
        """See `SlipStage.pass_on`. A running sum would be cheaper, but would accumulate rounding errors over hours."""
        readings = [*memory, slip]
        return sum(readings[1:], start=readings[0]) / self.samples, readings[1:]
