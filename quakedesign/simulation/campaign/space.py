"""Sample space of a campaign, and compass search for the worst sample.

Samples are points of a scrambled Sobol' sequence, a function of seed and index alone. The compass search (pattern
search without pattern moves) starts from given points and all corners of the box. The worst value found is a lower
bound.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from itertools import product
from types import MappingProxyType

import numpy as np

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.fault.model import require_nonnegative

# ----------------------------------------------------------------------
# Numbers that vary between samples; sample number i is a function of seed and i alone.

MOST_SAMPLES = 2**20
PERIODIC = frozenset({"phase"})
UNITS = {"phase": "rad", "initial_slip": "m", "initial_slip_rate": "m/s"}


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """One run of a campaign.

    Attributes
    ----------
    numbers : mapping of str to float
        Values of the varied parameters, by the names in `Space.ranges`; ``initial_slip`` [m] and ``initial_slip_rate``
        [m/s] are the initial x1 and x2.
    noise_seed : int
        Seed of the measurement noise.
    """

    numbers: Mapping[str, float]
    noise_seed: int


@checked_dataclass(frozen=True)
class Space:
    """Intervals of the parameters that vary between samples, each with a uniform distribution.

    Attributes
    ----------
    ranges : mapping of str to tuple of float
        Lowest and highest value by name: factors of nominal values [-], such as ``stiffness``, see `Variation` and
        `sliding_space`; ``phase`` [rad]; ``initial_slip`` [m] and ``initial_slip_rate`` [m/s].
    """

    ranges: Mapping[str, tuple[float, float]]

    @classmethod
    def of(cls, fault: Fault, *, initial_slip: float = 0.0, initial_slip_rate: float = 0.0) -> "Space":
        """Space of a fault's uncertainty box, its disturbance, and initial states between 0 and given bounds.

        Parameters
        ----------
        initial_slip, initial_slip_rate : float
            Largest initial x1 [m] and x2 [m/s], not negative.
        """
        require_nonnegative(initial_slip=initial_slip, initial_slip_rate=initial_slip_rate)
        widths = {name: getattr(fault.box, name) for name in ("stiffness", "damping", "authority")}
        ranges = {name: (float(1 - width), float(1 + width)) for name, width in widths.items()}
        ranges |= {"weakening": (0.0, 1.0), "amplitude": (0.0, 1.0), "phase": (0.0, 2 * math.pi)}
        ranges |= {"initial_slip": (0.0, float(initial_slip)), "initial_slip_rate": (0.0, float(initial_slip_rate))}
        return cls(MappingProxyType(ranges))

    @property
    def active(self) -> tuple[int, ...]:
        """Indices of the coordinates whose interval has positive length."""
        return tuple(i for i, (low, high) in enumerate(self.ranges.values()) if high > low)

    @property
    def periodic(self) -> tuple[int, ...]:
        """Indices of the periodic coordinates."""
        return tuple(i for i, name in enumerate(self.ranges) if name in PERIODIC)

    def sample(self, point: "Sequence[float] | np.ndarray", noise_seed: int) -> Sample:
        """Sample at a point of the unit cube.

        Raises
        ------
        ParameterError
            If the point has another dimension.
        """
        if len(point) != len(self.ranges):
            raise ParameterError(f"point must have {len(self.ranges)} numbers, one per range. Received {len(point)}.")
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


# ----------------------------------------------------------------------
# Search for the worst sample: the corners of the box, then a pattern search.

FIRST_SPAN = 0.25

Point = tuple[float, ...]
Evaluate = Callable[[Sequence[Sample]], "Sequence[float]"]


@checked_dataclass(frozen=True, kw_only=True)
class WorstSample:
    """Worst sample of a search; its value is a lower bound of the worst case.

    Attributes
    ----------
    metric : str
    value : float
        Value to be maximised: the metric, negated if smaller is worse; infinite for a run that diverges.
    sample : Sample
    index : int
        Index in `looked_at`, the samples of the search in order.
    looked_at : tuple of Sample
    """

    metric: str
    value: float
    sample: Sample
    index: int
    looked_at: tuple[Sample, ...]


def corners(space: Space) -> list[Point]:
    """Every combination of the ends of the intervals; a periodic coordinate stays at its lower end."""
    ends = [(0.0, 1.0) if i in space.active and i not in space.periodic else (0.0,) for i in range(len(space.ranges))]
    return list(product(*ends))


def neighbours(space: Space, centre: Point, span: float) -> list[Point]:
    """Points that differ from a centre by ±span in one coordinate, limited to the box."""
    points = []
    for i in space.active:
        for moved in (centre[i] - span, centre[i] + span):
            value = moved % 1.0 if i in space.periodic else min(1.0, max(0.0, moved))
            if value != centre[i]:
                points.append((*centre[:i], value, *centre[i + 1 :]))
    return points


def search(
    space: Space,
    metric: str,
    evaluate: Evaluate,
    starts: "Sequence[Sequence[float] | np.ndarray]",
    *,
    noise_seed: int,
    rounds: int,
) -> WorstSample:
    """Worst sample by compass search from given points and all corners, evaluated in batches.

    Every round evaluates all neighbours of the worst point so far; if none of these is worse, the span is halved. All
    samples have the same noise, so that they differ in their point alone.

    Parameters
    ----------
    metric : str
        Name of the metric, passed to the result.
    evaluate : callable
        Returns one value per sample; larger is worse, and an infinite value ends the search.
    starts : sequence of sequence of float
        Points of the unit cube.
    """
    looked_at: list[Sample] = []

    def look(points: list[Point]) -> tuple[float, Point, int]:
        samples = [space.sample(point, noise_seed) for point in points]
        values = list(evaluate(samples))
        place = max(range(len(values)), key=values.__getitem__)
        looked_at.extend(samples)
        return values[place], points[place], len(looked_at) - len(samples) + place

    value, centre, index = look([*(tuple(float(x) for x in start) for start in starts), *corners(space)])
    span = FIRST_SPAN
    for _ in range(rounds):
        beside = neighbours(space, centre, span)
        if not beside or math.isinf(value):
            break
        best = look(beside)
        if best[0] > value:
            value, centre, index = best
        else:
            span /= 2
    return WorstSample(metric=metric, value=value, sample=looked_at[index], index=index, looked_at=tuple(looked_at))
