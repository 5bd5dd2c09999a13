"""Confidence regions by the profile likelihood: how far one parameter goes when all others give way."""

import math
from dataclasses import dataclass, replace

import numpy as np

from quakedesign.identification.experiment import Experiment
from quakedesign.identification.fitting import Fit, minimised

_MOST_TRIALS = 30
_CLOSE = 0.01  # share of the wanted distance at which an end counts as found
_LIMIT = 0.98  # share of the way to the limit of a coordinate from which on an end counts as there
_PATIENCE = 3  # trials after which the limit of a coordinate is tried
_FIRST = 0.05  # step where the slopes say nothing
_BETTER = 0.1  # excess by which a profile has to improve on the fit to replace it
_FAR = 0.5  # move of a coordinate after which the experiment is resolved again


class BetterFit(Exception):
    """A profile has come upon coordinates that fit better."""

    def __init__(self, fitted: "np.ndarray") -> None:
        super().__init__("a better fit")
        self.fitted = fitted


@dataclass(frozen=True, kw_only=True)
class Interval:
    """Ends of a profile as they are fitted; infinite where the record sets none.

    Attributes
    ----------
    low, high : float
    """

    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class _Place:
    """Coordinates on a profile, and the experiment there with the coordinates that its steps are made for."""

    experiment: Experiment
    resolved_at: "np.ndarray"
    fitted: "np.ndarray"


def interval(fit: Fit, place: int, threshold: float, *, inside: Interval | None = None) -> Interval:
    """Where the profile of one coordinate passes a threshold of `Fit.excess` on either side.

    Parameters
    ----------
    fit : Fit
    place : int
        Of the coordinate.
    threshold : float
    inside : Interval, optional
        That of a lower threshold.

    Raises
    ------
    BetterFit
    """
    known = inside or Interval(low=math.nan, high=math.nan)
    return Interval(low=_end(fit, place, threshold, -1, known.low), high=_end(fit, place, threshold, 1, known.high))


def _end(fit: Fit, place: int, threshold: float, side: int, inside: float) -> float:
    """End on one side: the root of the distance from the fit, which grows about linearly (bracketed secant).

    Where the distance grows slowly, the limit of the coordinate is tried next, so that a flat profile costs little. An
    end is none that lies at that limit, or where the experiment cannot be followed.
    """
    if math.isinf(inside):
        return inside
    wanted = math.sqrt(threshold)
    furthest = abs(fit.experiment.bounds[(side + 1) // 2][place] - fit.fitted[place])
    deviation = fit.deviations[place]
    step = wanted * deviation if np.isfinite(deviation) else _FIRST
    step = min(step if math.isnan(inside) else 1.2 * abs(inside - fit.fitted[place]), furthest)
    below, above = (0.0, 0.0), (math.inf, math.inf)
    near = _Place(experiment=fit.experiment, resolved_at=fit.fitted, fitted=fit.fitted)
    for trial in range(_MOST_TRIALS):
        distance, there = _distance(fit, place, side * step, near)
        if wanted <= distance <= (1 + _CLOSE) * wanted:
            return float(fit.fitted[place] + side * step)
        if distance < wanted:
            below, near = (step, distance), there
            if step >= furthest:
                return side * math.inf
        else:
            above = (step, distance)
        if above[0] - below[0] <= _CLOSE * below[0]:
            break
        slow = math.isinf(above[0]) and trial >= _PATIENCE
        step = furthest if slow else min(_next(below, above, wanted), furthest)
    followed = math.isfinite(above[1]) and below[0] < _LIMIT * furthest
    return float(fit.fitted[place] + side * above[0]) if followed else side * math.inf


def _next(below: tuple[float, float], above: tuple[float, float], wanted: float) -> float:
    """Next step to try, a little beyond where the distance should be reached."""
    aim = wanted * (1 + _CLOSE / 2)
    if math.isinf(above[0]):
        return below[0] * min(max(aim / below[1], 1.01), 3.0) if below[1] > 0 else 3 * below[0]
    if math.isinf(above[1]):
        return (below[0] + above[0]) / 2
    straight = below[0] + (above[0] - below[0]) * (aim - below[1]) / (above[1] - below[1])
    tenth = 0.05 * (above[0] - below[0])
    return min(max(straight, below[0] + tenth), above[0] - tenth)


def _distance(fit: Fit, place: int, step: float, near: _Place) -> tuple[float, _Place]:
    """Root of the excess with one coordinate moved and all others at their best, and where that is."""
    start = near.fitted.copy()
    start[place] = fit.fitted[place] + step
    if np.max(np.abs(start - near.resolved_at)) > _FAR:
        near = replace(near, experiment=near.experiment.resolved(start, fit.accuracy), resolved_at=start)
    fixed = np.zeros(len(start), dtype=bool)
    fixed[place] = True
    others, squares = minimised(near.experiment, fit.measured, fit.weights, start, fixed=fixed, steps=30)
    if fit.excess(squares) < -_BETTER:
        raise BetterFit(others)
    distance = math.sqrt(max(fit.excess(squares), 0)) if np.isfinite(squares) else math.inf
    return distance, replace(near, fitted=others)
