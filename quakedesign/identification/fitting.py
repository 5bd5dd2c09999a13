"""Least-squares fit of a simulated experiment, with profile-likelihood intervals.

The fit uses several initial values, removes outliers, and estimates the noise from the residuals.
"""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy import ndarray
from scipy import stats
from scipy.optimize import least_squares
from scipy.signal import correlate

from quakedesign.errors import RecordError
from quakedesign.identification.correlated_noise import CorrelatedNoise
from quakedesign.identification.experiment import Experiment

CONFIDENCE = 0.95
_SHARE_OF_NOISE = 3e-3  # required accuracy of the simulated friction, relative to the noise of a sample
_NEIGHBOUR_SHARE = 0.4  # an outlier's neighbours are below this share of it; else it is an unexplained peak
_ROUNDING_SLOPE = 1e-7  # below this share of the largest slope, a slope is a rounding error
_SHARE_OF_EXCESS = 2e-3  # excess by which a search may still improve when it ends
_CANDIDATES = 64  # random initial values, each simulated once
_COARSE = 40  # steps of a search before it is compared with the others
_AGREEMENT = 1e-3  # largest relative difference of the sums of squares of agreeing searches
_ROUNDS = 6  # repetitions that remove outliers and refine steps
_LONGEST_OUTLIER = 2  # successive samples; a longer run is not due to chance, and is retained


@dataclass(frozen=True, kw_only=True)
class Fit:
    """The best fit of an experiment to measured friction."""

    experiment: Experiment
    fitted: ndarray  # fitted coordinates
    measured: ndarray  # friction [-]
    counts: ndarray  # number of measurements averaged in every sample
    used: ndarray  # whether each sample is in the fit
    agreeing: int  # number of searches that end in the best fit
    starts: int  # number of searches
    correlated: CorrelatedNoise | None = None  # noise correlated between neighbouring samples
    pieces: float = math.inf  # independent pieces of the noise, for whitened samples of several records

    @cached_property
    def residuals(self) -> ndarray:
        """Measured minus simulated friction [-] at every sample."""
        return np.asarray(self.measured - self.experiment.friction(self.fitted))

    @property
    def scaled(self) -> ndarray:
        """Residuals [-] times the root of `counts`; for correlated noise, those of `CorrelatedNoise.deletion`."""
        if self.correlated is not None:
            return self.correlated.deletion(self.residuals, self.used)
        return np.asarray(self.residuals * np.sqrt(self.counts))

    @cached_property
    def weights(self) -> ndarray:
        """Weights of all residuals, 0 for outliers; for correlated noise a matrix that makes residuals independent."""
        if self.correlated is not None:
            return self.correlated.whitener(self.used)
        return np.asarray(np.sqrt(self.counts) * self.used)

    @cached_property
    def whitened(self) -> ndarray:
        """Used residuals, made independent with the variance of one measurement."""
        return weighted(self.weights, self.residuals)

    @property
    def sum_of_squares(self) -> float:
        """Sum of squares of the used residuals."""
        return float(np.sum(self.whitened**2))

    @property
    def degrees_of_freedom(self) -> int:
        """Number of used samples minus number of coordinates."""
        return int(self.used.sum()) - len(self.fitted)

    @property
    def freedom_of_noise(self) -> float:
        """Degrees of freedom of the estimated noise, at most its number of independent pieces."""
        return min(
            self.degrees_of_freedom, self.pieces, self.correlated.pieces if self.correlated is not None else math.inf
        )

    @property
    def noise(self) -> float:
        """Standard deviation of one measurement [-]."""
        return float(np.sqrt(self.sum_of_squares / self.degrees_of_freedom))

    @property
    def accuracy(self) -> float:
        """Required accuracy of the simulated friction [-]: a small share of the noise of a sample."""
        return _SHARE_OF_NOISE * self.noise / float(np.sqrt(np.mean(self.counts)))

    @cached_property
    def correlation(self) -> float:
        """Number of samples per independent sample, at least 1: the integrated autocorrelation of the residuals.

        Summed over lags up to five times itself (Sokal 1997, in Functional Integration, NATO ASI B361, 131).
        """
        residuals = self.whitened
        covariance = correlate(residuals, residuals, method="fft")[len(residuals) - 1 :][: len(residuals) // 2]
        sums = 2 * np.cumsum(covariance / covariance[0]) - 1
        window = np.flatnonzero(np.arange(len(sums)) >= 5 * sums)
        return float(max(sums[window[0] if len(window) else -1], 1.0))

    def excess(self, squares: float) -> float:
        """Excess of a sum of squares over the smallest, divided by the noise variance of independent samples."""
        return (squares - self.sum_of_squares) / (self.noise**2 * self.correlation)

    def threshold(self, count: int, chance: float = 1 - CONFIDENCE) -> float:
        """`excess` that `count` parameters jointly exceed by noise alone with probability `chance` (Fisher's F)."""
        return float(count * stats.f.isf(chance, count, self.freedom_of_noise))

    def distance(self, fitted: ndarray) -> float:
        """`excess` of given coordinates; infinite if the experiment cannot be simulated."""
        squares = float(np.sum(weighted(self.weights, self.measured - self.experiment.friction(fitted)) ** 2))
        return self.excess(squares) if np.isfinite(squares) else np.inf

    def along(self, place: int) -> ndarray:
        """Changes of all coordinates, to first order, when one changes by 1 and the others stay optimal."""
        slopes, moves = self.slopes, np.zeros(len(self.fitted))
        scale = np.linalg.norm(slopes, axis=0)
        others = (scale > _ROUNDING_SLOPE * np.max(scale)) & (np.arange(len(scale)) != place)
        moves[others] = np.linalg.lstsq(slopes[:, others] / scale[others], -slopes[:, place], rcond=_ROUNDING_SLOPE)[0]
        moves[others] /= scale[others]
        moves[place] = 1
        return moves

    @cached_property
    def slopes(self) -> ndarray:
        """Derivatives of friction with respect to the fitted coordinates, whitened like `whitened`."""
        return weighted(self.weights, _finite(self.experiment.slopes(self.fitted)))

    @cached_property
    def standard_errors(self) -> ndarray:
        """Standard deviations of the fitted coordinates from the slopes; infinite where undetermined."""
        scale = np.linalg.norm(self.slopes, axis=0)
        scale[scale == 0] = 1
        values, turn = np.linalg.svd(self.slopes / scale, full_matrices=False)[1:]
        weights = np.where(np.abs(turn) > 1e-9, np.abs(turn), 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = np.where(values > 1e-12 * values[0], 1 / values, np.inf)
            spread = np.where(weights > 0, weights * inverse[:, None], 0)
        return np.asarray(np.sqrt(np.sum(spread**2, axis=0)) / scale * self.noise * np.sqrt(self.correlation))


def weighted(weights: ndarray, values: ndarray) -> ndarray:
    """Values of all samples, or columns of them, times the weights of `Fit`; samples of weight 0 are omitted."""
    if weights.ndim == 2:
        used = np.any(weights != 0, axis=0)
        with np.errstate(invalid="ignore", over="ignore"):
            return np.asarray(weights[:, used] @ values[used])
    used = weights > 0
    return np.asarray((values[used].T * weights[used]).T)


def fit(
    experiment: Experiment,
    measured: ndarray,
    *,
    seed: int,
    counts: ndarray | None = None,
    near: ndarray | None = None,
    least: int = 4,
    most: int = 16,
) -> Fit:
    """Best fit of several searches, without outliers, on an experiment simulated accurately enough for the noise.

    `measured` friction [-] is a mean of `counts` measurements, or of one; `seed` is for the random initial values, the
    first of which may be given (`near`). At most `most` of the best candidates are used. No search follows when at
    least `least` have run, two agree on the best fit, and this fit determines every coordinate. Raises `RecordError`
    when no candidate can be simulated, or there are too few samples.
    """
    if len(measured) < 3 * len(experiment.coordinates):
        raise RecordError(
            f"a record must have at least {3 * len(experiment.coordinates)} samples for the fitted parameters. "
            f"Received {len(measured)}. Give a longer record."
        )
    counts = np.ones(len(measured)) if counts is None else counts
    roots = np.sqrt(counts)
    experiment, starts = _starts(experiment, measured, roots, seed, most, near)
    minima: list[tuple[ndarray, float]] = []
    low, high = experiment.bounds
    every = np.ones(len(measured), dtype=bool)
    for number, start in enumerate(starts, start=1):
        minima.append(minimised(experiment, measured, roots, start, steps=_COARSE))
        fitted, best = min(minima, key=lambda pair: pair[1])
        agreeing = sum(squares <= best * (1 + _AGREEMENT) for _, squares in minima)
        entries: dict[str, Any] = {"measured": measured, "counts": counts, "used": every}
        fit = Fit(experiment=experiment, fitted=fitted, agreeing=agreeing, starts=number, **entries)
        if number >= least and agreeing > 1 and np.all(fit.standard_errors < high - low):
            break
    return settled(fit)


def _starts(
    experiment: Experiment, measured: ndarray, roots: ndarray, seed: int, most: int, near: ndarray | None = None
) -> tuple[Experiment, list[ndarray]]:
    """The experiment with steps for the first start; and the starts: the given one, then the best candidates."""
    draw = np.random.default_rng(seed)
    ends = np.array([[c.inward(end) for end in c.start] for c in experiment.coordinates])
    candidates = draw.uniform(ends[:, 0], ends[:, 1], (_CANDIDATES, len(ends)))
    scatter = max(float(np.std(np.diff(measured, 2))) / 6**0.5, 1e-9)
    if near is not None and not most:
        return experiment.resolved(near, scatter), [near]
    experiment = experiment.resolved(ends.mean(axis=1), scatter)
    costs = np.array([np.sum(roots * np.abs(measured - experiment.friction(q))) for q in candidates])
    costs[~np.isfinite(costs)] = np.inf
    order = np.argsort(costs, kind="stable")[:most]
    usable = [candidates[i] for i in order if np.isfinite(costs[i])]
    if not usable:
        raise RecordError(
            "at least one set of parameters must give sliding without a jump. Received a record for which all "
            f"{_CANDIDATES} tested sets jump. Check the stiffness, or give a record with measured slip."
        )
    starts = usable if near is None else [near, *usable]
    return experiment.resolved(starts[0], scatter), starts


def minimised(
    experiment: Experiment,
    measured: ndarray,
    weights: ndarray,
    start: ndarray,
    *,
    fixed: ndarray | None = None,
    steps: int = 100,
) -> tuple[ndarray, float]:
    """Coordinates with the least sum of squares near a start, and this sum; `fixed` ones do not change.

    Residuals have the weights of `weighted`.
    """
    free = np.ones(len(start), dtype=bool) if fixed is None else ~fixed
    low, high = experiment.bounds
    whole = np.clip(np.array(start, dtype=float), low, high)

    def at(part: ndarray) -> ndarray:
        full = whole.copy()
        full[free] = part
        return np.asarray(full)

    first = weighted(weights, experiment.friction(whole) - measured)
    if not np.all(np.isfinite(first)):
        return whole, np.inf
    size = max(float(np.sqrt(np.mean(first**2))), 1e-300)
    solution = least_squares(
        lambda part: weighted(weights, experiment.friction(at(part)) - measured) / size,
        np.clip(whole[free], np.nextafter(low, high)[free], np.nextafter(high, low)[free]),
        jac=lambda part: weighted(weights, _finite(experiment.slopes(at(part)))[:, free]) / size,
        bounds=(low[free], high[free]),
        x_scale="jac",
        ftol=_SHARE_OF_EXCESS / len(first),
        xtol=1e-7,
        gtol=1e-12,
        max_nfev=steps,
    )
    return at(solution.x), float(2 * solution.cost * size**2)


def _finite(slopes: ndarray) -> ndarray:
    """Slopes with 0 in place of non-finite ones, which transients between samples can cause."""
    return np.asarray(np.where(np.isfinite(slopes), slopes, 0.0))


def settled(fit: Fit) -> Fit:
    """A fit on a finer simulation and without outliers, repeated until neither changes, at most 6 times.

    Simulation steps are retained while every coordinate moves by at most one standard deviation.
    """
    made_for = np.full_like(fit.fitted, np.inf)
    for _ in range(_ROUNDS):
        used = ~outliers(fit.scaled)
        finer = fit.experiment
        if not np.all(np.abs(fit.fitted - made_for) <= fit.standard_errors):
            finer, made_for = finer.resolved(fit.fitted, fit.accuracy), fit.fitted
        fitted, _ = minimised(finer, fit.measured, replace(fit, used=used).weights, fit.fitted)
        unchanged = finer is fit.experiment and np.array_equal(used, fit.used)
        fit = replace(fit, experiment=finer, fitted=fitted, used=used)
        if unchanged:
            break
    return fit


def outliers(residuals: ndarray) -> ndarray:
    """Samples beyond a deviation that noise alone exceeds in 5 % of such records, in runs of at most two.

    The size of the noise follows from the median absolute deviation from the median residual. A peak whose neighbours
    deviate too is no outlier.
    """
    off = residuals - np.median(residuals)
    size = np.median(np.abs(off)) / stats.norm.ppf(0.75)
    far = np.abs(off) > size * stats.norm.isf((1 - CONFIDENCE) / 2 / len(residuals))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], far.astype(int), [0]])))
    outlying = np.zeros(len(residuals), dtype=bool)
    for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        beside = off[[i for i in (begin - 1, end) if 0 <= i < len(off)]]
        alone = np.max(beside * np.sign(off[begin])) < _NEIGHBOUR_SHARE * np.min(np.abs(off[begin:end]))
        outlying[begin:end] = alone and end - begin <= _LONGEST_OUTLIER
    return outlying


def advantage(one: Fit, other: Fit) -> tuple[float, float]:
    """Ratio of the sum of squares of another fit to that of this one, and the increase of its AIC.

    On the samples that both fits use, or for correlated noise on those that each uses. For equal numbers of parameters,
    the AIC increases by n·ln(ratio) with n independent samples.
    """
    both = one.used & other.used
    if one.correlated is not None or other.correlated is not None:
        ours, theirs = one.sum_of_squares, other.sum_of_squares
    else:
        ours, theirs = (float(np.sum(fit.scaled[both] ** 2)) for fit in (one, other))
    independent = float(both.sum()) / min(one.correlation, other.correlation)
    return theirs / ours, independent * float(np.log(theirs / ours))


_MOST_TRIALS = 14
_CLOSE = 0.01  # relative tolerance of the required distance at an end
_LIMIT = 0.98  # an end beyond this share of the distance to a coordinate's limit counts as the limit
_PATIENCE = 3  # trials after which the limit of a coordinate is tried
_FIRST = 0.05  # first step if the slopes do not give one
_BETTER = 0.1  # a profile replaces the fit if it reduces the excess by more than this
_FAR = 0.5  # change of a logarithmic coordinate after which the experiment is resolved again


class BetterFit(Exception):
    """Coordinates on a profile fit better than the best fit."""

    def __init__(self, fitted: ndarray) -> None:
        super().__init__("a better fit")
        self.fitted = fitted


@dataclass(frozen=True, kw_only=True)
class ProfilePoint:
    """Coordinates on a profile, and the experiment there with the coordinates for which its steps were chosen."""

    experiment: Experiment
    resolved_at: ndarray
    fitted: ndarray
    step: float = 0.0  # change of the coordinate from the fit
    distance: float = 0.0  # square root of the excess


@dataclass(frozen=True)
class Profile:
    """The excess along one coordinate (index `place`), minimised over the others, at the points that were tried."""

    fit: Fit
    place: int
    points: list[ProfilePoint] = field(default_factory=list)

    def interval(self, threshold: float) -> tuple[float, float]:
        """Fitted coordinates at which `Fit.excess` passes a threshold on both sides; infinite without a bound.

        Raises `BetterFit` when a point of the profile fits better than the best fit.
        """
        return self._end(threshold, -1), self._end(threshold, 1)

    def _end(self, threshold: float, side: int) -> float:
        """End of the interval on one side, by bracketed secants: the root of the excess is about linear.

        If this root grows slowly, the limit of the coordinate is tried next, so that a flat profile costs little. An
        end at this limit, or where the experiment cannot be simulated, counts as infinite.
        """
        fit, place, wanted = self.fit, self.place, math.sqrt(threshold)
        furthest = abs(fit.experiment.bounds[(side + 1) // 2][place] - fit.fitted[place])
        start = ProfilePoint(experiment=fit.experiment, resolved_at=fit.fitted, fitted=fit.fitted)
        points = [each for each in self.points if each.step * side > 0]
        below = max((p for p in points if p.distance < wanted), key=lambda p: abs(p.step), default=start)
        far = replace(start, step=side * math.inf, distance=math.inf)
        above = min((p for p in points if p.distance >= wanted), key=lambda p: abs(p.step), default=far)
        deviation = fit.standard_errors[place]
        first = wanted * deviation if np.isfinite(deviation) else _FIRST
        for trial in range(_MOST_TRIALS):
            near, end = abs(below.step), abs(above.step)
            if near >= furthest or above.distance <= (1 + _CLOSE) * wanted or end - near <= _CLOSE * near:
                break
            slow = math.isinf(end) and trial >= _PATIENCE
            length = furthest if slow else _next(below, above, wanted) if near or np.isfinite(end) else first
            there = self._point(side * min(length, furthest), below)
            self.points.append(there)
            below, above = (there, above) if there.distance < wanted else (below, there)
        followed = math.isfinite(above.distance) and abs(below.step) < _LIMIT * furthest
        return float(fit.fitted[place] + above.step) if followed else side * math.inf

    def _point(self, step: float, near: ProfilePoint) -> ProfilePoint:
        """The optimum over all other coordinates with this one changed, and the square root of its excess."""
        fit, place = self.fit, self.place
        start = near.fitted + fit.along(place) * (step - near.step)
        logarithmic = [c.logarithmic for c in fit.experiment.coordinates]
        if np.max(np.abs(start - near.resolved_at)[logarithmic], initial=0) > _FAR:
            near = replace(near, experiment=near.experiment.resolved(start, fit.accuracy), resolved_at=start)
        fixed = np.arange(len(start)) == place
        others, squares = minimised(near.experiment, fit.measured, fit.weights, start, fixed=fixed, steps=15)
        if fit.excess(squares) < -_BETTER:
            raise BetterFit(others)
        distance = math.sqrt(max(fit.excess(squares), 0)) if np.isfinite(squares) else math.inf
        return replace(near, fitted=others, step=step, distance=distance)


def _next(below: ProfilePoint, above: ProfilePoint, wanted: float) -> float:
    """Length of the next step, slightly beyond the expected end."""
    aim, near, end = wanted * (1 + _CLOSE / 2), abs(below.step), abs(above.step)
    if math.isinf(end):
        return near * min(max(aim / below.distance, 1.01), 3.0) if below.distance > 0 else 3 * near
    if math.isinf(above.distance):
        return (near + end) / 2
    straight = near + (end - near) * (aim - below.distance) / (above.distance - below.distance)
    margin = 0.05 * (end - near)
    return min(max(straight, near + margin), end - margin)
