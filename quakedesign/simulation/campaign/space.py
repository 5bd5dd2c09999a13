"""What differs from sample to sample, and sample number i as a function of seed and i alone."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.fault.checks import require_nonnegative

MOST_SAMPLES = 2**20
PERIODIC = frozenset({"phase"})
UNITS = {"phase": "rad", "initial_slip": "m", "initial_slip_rate": "m/s"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """One run of a campaign.

    Attributes
    ----------
    numbers : mapping of str to float
        What differs from sample to sample but for the seed, by the names of the space; x1 [m] and x2 [m/s] at the
        start as ``initial_slip`` and ``initial_slip_rate``.
    noise_seed : int
        Of the noise in the measurements.
    """

    numbers: Mapping[str, float]
    noise_seed: int


@dataclass(frozen=True)
class Space:
    """Interval of every number that differs from sample to sample; within it all values are equally likely.

    Attributes
    ----------
    ranges : mapping of str to tuple of float
        Lowest and highest value by the names of `Sample.numbers`, SI units.
    """

    ranges: Mapping[str, tuple[float, float]]

    @classmethod
    def of(cls, fault: Fault, *, initial_slip: float = 0.0, initial_slip_rate: float = 0.0) -> "Space":
        """Space of a fault's uncertainty box and disturbance, and of initial states from rest up to given ones.

        Parameters
        ----------
        fault : Fault
        initial_slip, initial_slip_rate : float
            Largest x1 [m] and x2 [m/s] at the start, not negative.

        Raises
        ------
        ParameterError
        """
        require_nonnegative(initial_slip=initial_slip, initial_slip_rate=initial_slip_rate)
        widths = {name: getattr(fault.box, name) for name in ("stiffness", "damping", "authority")}
        ranges = {name: (float(1 - width), float(1 + width)) for name, width in widths.items()}
        ranges |= {"weakening": (0.0, 1.0), "amplitude": (0.0, 1.0), "phase": (0.0, 2 * math.pi)}
        ranges |= {"initial_slip": (0.0, float(initial_slip)), "initial_slip_rate": (0.0, float(initial_slip_rate))}
        return cls(MappingProxyType(ranges))

    @property
    def active(self) -> tuple[int, ...]:
        """Numbers of the coordinates whose interval is more than a point."""
        return tuple(i for i, (low, high) in enumerate(self.ranges.values()) if high > low)

    @property
    def periodic(self) -> tuple[int, ...]:
        """Numbers of the coordinates whose ends are one."""
        return tuple(i for i, name in enumerate(self.ranges) if name in PERIODIC)

    def sample(self, point: "Sequence[float] | np.ndarray", noise_seed: int) -> Sample:
        """Sample at a point of the unit cube.

        Raises
        ------
        ParameterError
            When the point has another dimension.
        """
        if len(point) != len(self.ranges):
            raise ParameterError(f"point must hold {len(self.ranges)} numbers, one a range. Received {len(point)}.")
        values = {
            name: min(high, low + float(share) * (high - low))
            for (name, (low, high)), share in zip(self.ranges.items(), point, strict=True)
        }
        return Sample(numbers=values, noise_seed=noise_seed)


def point(seed: int, index: int, dimension: int) -> "np.ndarray":
    """Point number `index` of a scrambled Sobol' sequence in the unit cube, shape (dimension,).

    Sobol' (1967) with the scrambling of Matoušek (1998), as in scipy.stats.qmc.
    """
    return np.asarray(_points(seed, dimension, max(6, index.bit_length()))[index])


@lru_cache(maxsize=8)
def _points(seed: int, dimension: int, exponent: int) -> "np.ndarray":
    from scipy.stats import qmc

    return np.asarray(qmc.Sobol(dimension, scramble=True, rng=np.random.default_rng(seed)).random_base2(exponent))


def noise_seed(seed: int, index: int) -> int:
    """Seed of the noise of sample number `index`."""
    return int(np.random.SeedSequence(seed, spawn_key=(index,)).generate_state(1)[0])


def require_count(samples: int) -> None:
    """Refuse a number of samples that is none.

    Raises
    ------
    ParameterError
    """
    if isinstance(samples, bool) or not isinstance(samples, int) or not 1 <= samples <= MOST_SAMPLES:
        raise ParameterError(f"samples must be a whole number, 1 to {MOST_SAMPLES}. Received {samples!r}.")
