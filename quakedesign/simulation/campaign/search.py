"""The worst sample that a search finds: the corners of the box, then a pattern that closes in."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from quakedesign.simulation.campaign.space import Sample, Space

FIRST_SPAN = 0.25

Point = tuple[float, ...]
Evaluate = Callable[[Sequence[Sample]], "Sequence[float]"]


@dataclass(frozen=True, kw_only=True)
class Worst:
    """The worst sample that a search has found; that there is no worse one is not claimed.

    Attributes
    ----------
    metric : str
    value : float
        Infinite for a run that diverges.
    sample : Sample
    index : int
        Place in the row of samples that the search has looked at.
    looked_at : tuple of Sample
    """

    metric: str
    value: float
    sample: Sample
    index: int
    looked_at: tuple[Sample, ...]


def corners(space: Space) -> list[Point]:
    """Every combination of the ends of the intervals; a coordinate whose ends are one stays at its start."""
    ends = [(0.0, 1.0) if i in space.active and i not in space.periodic else (0.0,) for i in range(len(space.ranges))]
    return list(product(*ends))


def neighbours(space: Space, centre: Point, span: float) -> list[Point]:
    """Points beside a centre, one coordinate changed by a span, inside the box."""
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
) -> Worst:
    """Worst sample from given starts and all corners on, by pattern search (Hooke and Jeeves 1961) in whole batches.

    Every round looks at all neighbours of the worst point so far; where none is worse, the next round looks half as
    far. The noise is the same in all samples, so that they differ by their point alone.

    Parameters
    ----------
    space : Space
    metric : str
        Only handed on.
    evaluate : callable
        How bad samples are: larger is worse, infinite ends the search.
    starts : sequence of sequence of float
        Points of the unit cube.
    noise_seed : int
    rounds : int

    Returns
    -------
    Worst
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
        found = look(beside)
        if found[0] > value:
            value, centre, index = found
        else:
            span /= 2
    return Worst(metric=metric, value=value, sample=looked_at[index], index=index, looked_at=tuple(looked_at))
