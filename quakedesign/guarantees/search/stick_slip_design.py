"""Designs with a proof on the stick–slip plant: gains, then an invariant polytope."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError, expm
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from quakedesign.cache import search_once
from quakedesign.errors import ParameterError
from quakedesign.guarantees.exact.proof import NoProof
from quakedesign.guarantees.exact.stick_slip_proof import StickSlipProof, stick_slip_guarantee
from quakedesign.guarantees.exact.stick_slip_set import (
    COMBINATIONS,
    SLICES,
    Constraint,
    Numbers,
    Period,
    Ranges,
    Rows,
    SampledStickSlip,
    StickSlipPolytope,
    Verifier,
    curvature,
    polytopes,
    ranges,
    resting_rows,
    sliding_rows,
    stop_bounds,
)
from quakedesign.guarantees.search.float_bounds import short
from quakedesign.guarantees.search.worst_case import WorstCase
from quakedesign.laws.stick_slip_law import StickSlipLaw
from quakedesign.plant.fault_plant import FaultPlant
from quakedesign.sos.exact.strict import read_as, written
from quakedesign.text import Progress, silent

TUNINGS = {
    "tracking": ((0.95, 0.85, 0.165, 1.27), (0.5, 0.5, 0.3, 1.3), (0.7, 0.5, 0.3, 1.3), (0.5, 0.5, 0.5, 1.3)),
    "peak": ((0.3, 0.5, 0.1, 1.3), (0.5, 0.5, 0.1, 1.3), (0.5, 0.5, 0.3, 1.3)),
}
"""Estimator gains of the slip-rate and of the slip innovation [-], fraction of the slip error corrected per period, and
ratio of the assumed input gain to its least value."""
DEADBEAT = tuple(
    (*shares, 1.0, gain) for *shares, gain in ((0.3, 0.5, 1.4), (0.4, 0.6, 1.4), (0.5, 0.7, 1.4), (0.3, 0.5, 1.3))
)
"""The same for a deadbeat implicit step, which corrects all of the slip error; for both objectives."""
_APERIODIC = (0.3, 0.3, 0.2, 1.2), (0.3, 0.4, 0.2, 1.2), (0.5, 0.5, 0.3, 1.3), (0.2, 0.2, 0.1, 1.6)
APERIODIC = {"tracking": _APERIODIC, "peak": ((0.3, 0.3, 0.1, 1.425), *_APERIODIC)}
"""The same for aperiodic sampling; the gain is larger still by the ratio of the longest interval to T_s."""
_VERTICES, _SETTLED = 250, 1e-4  # largest number of reached states; relative change of their extents at the end
_ROUNDS, _SUBSTEPS = 60, 12  # periods of the reached states; Euler steps of a period, for proposals only
_FACETS = 130  # facets of the first polytope
_TRIED_EACH = 3  # turns after which all multipliers are tried again
_PERIODS, _TURNS, _REFINED = 4, 80, (8, 15, 22, 29)  # periods per policy; turns; turns that add facets
_TINY = 1e-12  # rounding, relative to a height
_LITTLE = 1.01  # largest growth of a height in a step to the fixed point of a policy
# the coefficient of y in a normal is set to the neutral value (facet unchanged in slow sliding) above this share of it
_NEARLY = 0.93
_ADDED, _MOST = 35, 270  # facets added at once, and in all: a check takes 1.3 s for each hundred
# cosine above which two normals count as equal; relative margin of a facet that is unchanged at rest
_ALIKE, _WIDER = 1 - 1e-8, 1e-5
_RETAINED, _FOLLOWED = 0.6, 14  # share of growth kept when facets are added; turns after that until heights only grow
_MARGINS = 2e-6, 2e-5  # margins of a polytope over its images; the second if the first gives no proof
_FAR = 30  # a set larger than this factor times its first extents counts as unbounded
_RATE_SHARES, _NEAR = (0, 0.3, 0.6, 1, 1.6), (1, 0.8, 1.2)  # multipliers tried, relative to a size and to present ones
_NEGATIVE, _TIGHT = 1e-9, 40  # multipliers that count as negative; constraints that may meet at a vertex
_LOWER, _GUESSES = Fraction(1, 50), 3  # margin of a guessed least pressure, over σ'; number of guesses
# largest number of replacements of a set by its image; relative decrease of its extents below which they end
_SHRUNK, _LITTLE_LESS = 60, 2e-5
_SNAPPED = 1e-3  # largest factor of the slip that counts as 0, over that of e1
_INSIDE = 1e-4  # least distance of an interior point from all facets, over the size
_DIGITS = 7
_WIDTH = Fraction(3, 2)  # enlargement of extents for ranges of the plant before the polytope is known


def _float_exponential(rows: tuple[tuple[Fraction, ...], ...]) -> list[list[Any]]:
    exponential: list[list[Any]] = expm(np.array(rows, dtype=float)).tolist()
    return exponential


def _float_curvature(flow: tuple[tuple[Fraction, ...], ...], step: Fraction) -> tuple[tuple[Any, Any], ...]:
    return tuple((float(first), float(second)) for first, second in curvature(flow, step))


FLOATS = Numbers(
    float, _float_exponential, _float_curvature, lambda values: np.asarray(values, dtype=float), lambda values: values
)


def tuned(
    task: FaultPlant,
    step: Fraction,
    tuning: Sequence[float],
    slip_noise: Fraction = Fraction(0),
    *,
    implicit: bool = False,
) -> SampledStickSlip:
    """Feedback that is deadbeat in the slip rate, at the midpoint of the damping, with the gains of a tuning.

    Parameters
    ----------
    task : FaultPlant
    step : Fraction
        T_s [s].
    tuning : sequence of float
        As in `TUNINGS`.
    slip_noise : Fraction
        Bound of the measurement error of the slip [m].
    implicit : bool
        Whether the feedback is that of a deadbeat implicit step, which ignores damping and corrects all of the slip
        error.
    """
    level, slip, back, gain = tuning
    damping, period = 0.0 if implicit else float(sum(task.rate_chord)) / 2, float(step)
    decay = np.exp(-damping * period)
    duration = -np.expm1(-damping * period) / damping if damping else period
    per_rate = 1 / (gain * duration * float(task.authority))
    law = StickSlipLaw(
        rate_gain=short(decay * per_rate, _DIGITS),
        target_gain=short(per_rate, _DIGITS),
        return_rate=1 / step if implicit else short(back / period, _DIGITS),
        level_gain=short(level * per_rate, _DIGITS),
        slip_gain=short(slip * per_rate / period, _DIGITS),
        rest_slip=2 * slip_noise,
    )
    return SampledStickSlip(law=law, step=step, slip_noise=slip_noise)


# ----------------------------------------------------------------------
# Convex hull of the reachable states, grown from sample to sample.


def _noises(sampled_loop: SampledStickSlip) -> list[float]:
    """Extreme errors of the measured slip [m]."""
    size = float(sampled_loop.slip_noise)
    return [-size, size] if size else [0.0]


@dataclass(frozen=True)
class _Start:
    """States at a sample (rows), for choices of reference, input gain and slope (columns).

    The slip error of a state is e1 of `stick_slip_set`: slip minus reference plus the bound of the slip noise.
    """

    task: FaultPlant
    sampled_loop: SampledStickSlip
    noise: float
    slip: np.ndarray
    rate: np.ndarray
    level: np.ndarray
    reference: np.ndarray
    beta: np.ndarray
    slope: np.ndarray
    predicted: np.ndarray
    push: np.ndarray
    force: np.ndarray

    @classmethod
    def of(
        cls, task: FaultPlant, sampled_loop: SampledStickSlip, plant: Ranges, states: np.ndarray, noise: float
    ) -> "_Start":
        """States with the ends of all ranges; the input gain varies slowest."""
        law = sampled_loop.law
        slip, rate, level = (column[:, None] for column in states.T)
        kinds = product(task.beta, (Fraction(0), task.reference_rates[0]), plant.slope)
        beta, reference, slope = np.array(list(kinds), dtype=float).T
        target = reference - float(law.return_rate) * (slip + noise - float(sampled_loop.slip_noise))
        pressure = float(law.rate_gain) * rate - float(law.target_gain) * target + level + float(law.slip_gain) * noise
        force, scaled = (beta * float(task.authority) * pressure, float(task.authority * task.beta[0]) * pressure)
        predicted = np.maximum(target, 0)
        return cls(task, sampled_loop, noise, slip, rate, level, reference, beta, slope, predicted, scaled, force)

    def ended(
        self, moved: np.ndarray, end: np.ndarray, rests: np.ndarray, interval: float, later: float | None = None
    ) -> np.ndarray:
        """States after an interval, from its slip, its final slip rate and whether the fault then rests.

        By default the noise of the next sample has the opposite sign.
        """
        law, half, later = (
            self.sampled_loop.law,
            float(self.sampled_loop.step) / 2,
            -self.noise if later is None else later,
        )
        innovation = moved + later - self.noise - half * (self.rate + self.predicted)
        lowest = -half * self.predicted - float(law.rest_slip)
        innovation = np.where(rests, np.maximum(innovation, lowest), innovation) + self.noise - later
        lifted = -moved * self.slope / (self.beta * float(self.task.authority))
        level = self.level + float(law.level_gain) * (end - self.predicted) + float(law.slip_gain) * innovation + lifted
        return np.stack([self.slip + moved - interval * self.reference, end + 0 * level, level], axis=-1)


@dataclass(frozen=True)
class _ReachableStates:
    """Rest map and sliding map of the theorem, and simulation of the plant, for many states at once."""

    task: FaultPlant
    sampled_loop: SampledStickSlip
    plant: Ranges
    periods: list[Period]
    excess: float = 0.0  # excess of friction at rest over friction in slip, in simulations [m/s²]

    @classmethod
    def of(cls, task: FaultPlant, sampled_loop: SampledStickSlip) -> "_ReachableStates":
        none = Fraction(0), Fraction(0)
        plant = ranges(task, task.target_slip / 100, none, task.amplitude * sampled_loop.longest**2)
        return cls(task, sampled_loop, plant, Period.deciding(FLOATS, task, sampled_loop, plant, Fraction(0), none))

    def after(self, states: np.ndarray) -> np.ndarray:
        """States one period later: simulated ones, and extremes of both maps."""
        images = list[np.ndarray]()
        for noise in _noises(self.sampled_loop):
            start = _Start.of(self.task, self.sampled_loop, self.plant, states, noise)
            images += [self.simulated(states, noise).reshape(-1, 3), *self._resting(start)]
            images += [ends for period in self.periods for ends in self._sliding(start, period)]
        return np.vstack(images)

    def simulated(self, states: np.ndarray, noise: float, later: float | None = None) -> np.ndarray:
        """Simulated states after a period of the stick–slip plant, (states, choices, 3)."""
        start = _Start.of(self.task, self.sampled_loop, self.plant, states, noise)
        ends = sorted({float(self.sampled_loop.step), float(self.sampled_loop.longest)})
        runs = [
            start.ended(*self._run(start, sign, turn, end), end, later)
            for end in ends
            for sign in (1, -1)
            for turn in (0, 3, 6, 9)
        ]
        return np.stack(runs, axis=2).reshape(len(states), -1, 3)

    def _resting(self, start: "_Start") -> Iterator[np.ndarray]:
        """States after the rest map."""
        stop = np.min(
            [float(g) * start.rate + float(h) for g, h in stop_bounds(self.task, self.sampled_loop, self.plant)], axis=0
        )
        stop = stop + 0 * start.force
        most, amplitude = float(self.task.beta[1] / self.task.beta[0]), float(self.task.amplitude)
        for share in (0.0, 0.5, 1.0):
            possible = most * start.push >= amplitude + float(self.plant.slope[0]) * share * stop
            for interval in {float(self.sampled_loop.step), float(self.sampled_loop.longest)}:
                yield start.ended(share * stop, 0 * stop, np.full(stop.shape, True), interval)[possible]

    def _sliding(self, start: "_Start", period: Period) -> Iterator[np.ndarray]:
        """States after the sliding map; slip and slip rate are constrained to be at least 0 only at the end."""
        step, amplitude = float(period.interval), float(self.task.amplitude)
        of_slip, of_rate = period.impulses
        times = step - np.linspace(0, step, len(of_slip))
        largest = times * start.rate[..., None] + times**2 / 2 * (amplitude - start.force[..., None])
        width = float(self.plant.slope[1] - self.plant.slope[0]) / 2 / (1 - float(self.plant.slope[1]) * step**2 / 2)
        sizes, size = amplitude + width * np.maximum(largest, 0), step / (len(of_slip) - 1)
        of_state = zip(period.of_rate, period.of_force, strict=True)
        plain = [r * start.rate - f * start.force for r, f in of_state]
        for sign in (1, -1):
            for turn in (0, 4, 8, 12):
                pattern = np.where(np.arange(len(of_slip)) < turn, sign, -sign)
                more = [np.trapezoid(sizes * pattern * impulse, dx=size, axis=-1) for impulse in (of_slip, of_rate)]
                upward = more[1] > 0
                scaled = np.where(upward, -plain[1] / np.where(upward, more[1], 1), 2)  # so that y is 0 at the end
                for factor, rests in ((np.ones_like(scaled), False), (scaled, True)):
                    moved, end = plain[0] + factor * more[0], plain[1] + factor * more[1]
                    sound = (np.abs(factor) <= 1) & (moved >= 0) & (end >= -1e-12 * np.abs(start.rate).max())
                    yield start.ended(moved, np.maximum(end, 0), np.full(moved.shape, rests), step)[sound]

    def _run(self, start: "_Start", sign: int, turn: int, interval: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Slip and slip rate after an interval of the stick–slip plant, and whether it rests."""
        size, amplitude = interval / _SUBSTEPS, float(self.task.amplitude)
        damping = float(sum(self.plant.damping)) / 2
        moved, now = np.zeros_like(start.force), start.rate + np.zeros_like(start.force)
        for i in range(_SUBSTEPS):
            disturbance = (sign if i < turn else -sign) * amplitude
            acceleration = -damping * now + start.slope * moved - start.force + disturbance
            rests = (now <= 0) & (acceleration <= self.excess)
            acceleration = np.where(rests, np.minimum(acceleration, 0), acceleration)
            end = now + size * acceleration
            stops = end < 0
            braked = np.where(acceleration < 0, now**2 / (2 * np.maximum(-acceleration, 1e-300)), 0)
            moved = moved + np.where(stops, braked, size * (now + end) / 2)
            now = np.maximum(end, 0)
        return moved, now, now <= 0

    def hull(self, progress: Progress) -> np.ndarray | None:
        """Vertices of the hull of all states reachable from rest at t = 0; None if it grows without bound."""
        points = _at_first(self.sampled_loop)
        directions = np.random.default_rng(0).standard_normal((1500, 3))
        first, before = None, np.zeros(6)
        for turn in range(_ROUNDS):
            points = np.vstack([points, self.after(points)])
            size = np.abs(points).max(axis=0)
            if turn < 2 or size.min() == 0:
                points = points[:: max(1, len(points) // 200)]
                continue
            try:
                points = points[ConvexHull(points / size, qhull_options="QJ").vertices]
            except QhullError:
                return None
            first = size if first is None else first
            if (size > _FAR * first).any():
                return None
            if len(points) > _VERTICES:
                points = _extreme(points, directions, _VERTICES)
            extent = np.concatenate([points.max(axis=0), -points.min(axis=0)])
            if np.all(np.abs(extent - before) <= _SETTLED * np.tile(size, 2)):
                break
            before = extent
            progress("reachable states", turn / _ROUNDS)
        return points


def _at_first(sampled_loop: SampledStickSlip) -> np.ndarray:
    """Initial states at rest, for the two extreme measurement errors of the first sample."""
    noise = float(sampled_loop.slip_noise)
    return np.array([[noise, 0, 0], [noise, 0, noise * float(sampled_loop.law.slip_gain)]])


def _extreme(points: np.ndarray, directions: np.ndarray, most: int) -> np.ndarray:
    """The `most` points that are extreme in the most directions, including the extremes along the axes."""
    size = np.abs(points).max(axis=0)
    white = np.linalg.inv(np.linalg.cholesky(np.cov((points / size).T) + 1e-9 * np.eye(3)))
    farthest = ((directions @ white) / size @ points.T).argmax(axis=1)
    counts = np.bincount(farthest, minlength=len(points))
    counts[[*points.argmax(axis=0), *points.argmin(axis=0)]] += len(directions)
    return np.asarray(points[np.argsort(-counts, kind="stable")[:most]])


# ----------------------------------------------------------------------
# Invariant polytope that contains the reachable states.


def _rows(periods: list[Period], facets: np.ndarray, multipliers: np.ndarray) -> Iterator[Rows]:
    for period in periods:
        yield from sliding_rows(period, facets, multipliers)
    yield from resting_rows(FLOATS, period.task, period.sampled_loop, period.plant, facets, multipliers)


def _normals(points: np.ndarray, count: int) -> np.ndarray:
    """The axes except −y, and normals of the hull that differ as much as possible."""
    size = np.abs(points).max(axis=0)
    normals = ConvexHull(points / size, qhull_options="QJ").equations[:, :3]
    white = normals @ np.linalg.cholesky(np.cov((points / size).T) + 1e-12 * np.eye(3))
    white = white / np.linalg.norm(white, axis=1)[:, None]
    chosen = [int(i) for i in (*white.argmax(axis=0), *white.argmin(axis=0))]
    alike = (white @ white[chosen].T).max(axis=1)
    while len(chosen) < count and alike.min() < 1 - 1e-6:
        chosen.append(int(alike.argmin()))
        alike = np.maximum(alike, white @ white[chosen[-1]])
    axes = np.array([(1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, 0, -1)])
    selected = normals[chosen]
    selected = selected[~((selected[:, 1] < -0.999) | (np.abs(selected).max(axis=1) > 1 - 1e-9))]
    return np.asarray(np.vstack([axes, selected]) / size)


def _floats(constraints: list[Constraint]) -> tuple[np.ndarray, np.ndarray]:
    """Rows and right-hand sides of constraints."""
    rows, ends = zip(*constraints, strict=True)
    return np.array(rows, dtype=float), np.array(ends, dtype=float)


def _corners(
    plain: np.ndarray, ends: np.ndarray, size: np.ndarray, inside: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Vertices of a polytope, their constraints, and all rows; None for an empty one.

    A probable interior point saves a linear program.
    """
    rows = plain * size
    length = np.linalg.norm(rows, axis=1)
    rows, ends = rows / length[:, None], ends / length
    dimension = rows.shape[1]
    centre = None if inside is None else inside / size
    if centre is None or (ends - rows @ centre).min() < _INSIDE:
        optimum = linprog(
            [*np.zeros(dimension), -1.0],
            A_ub=np.column_stack([rows, np.ones(len(rows))]),
            b_ub=ends,
            bounds=[*[(None, None)] * dimension, (0, None)],
        )
        if optimum.status or optimum.x[-1] < 1e-9:
            return None
        centre = optimum.x[:dimension]
    try:
        meet = HalfspaceIntersection(np.column_stack([rows, -ends]), centre, qhull_options="QJ")
    except QhullError:
        return None
    finite = np.isfinite(meet.intersections).all(axis=1)
    facets = np.array([facet for facet, sound in zip(meet.dual_facets, finite, strict=True) if sound])
    return meet.intersections[finite] * size, facets, plain


def _basis(rows: np.ndarray, ends: np.ndarray, factors: np.ndarray) -> tuple[int, ...] | None:
    """Constraints at the maximum of a function on a polytope, largest multipliers first."""
    lengths = np.linalg.norm(rows, axis=1)
    rows, ends = rows / lengths[:, None], ends / lengths
    optimum = linprog(-factors, A_ub=rows, b_ub=ends, bounds=[(None, None)] * len(factors))
    if optimum.status:
        return None
    order = np.lexsort((optimum.slack, optimum.ineqlin.marginals))
    chosen = list[int]()
    for place in order[:_TIGHT]:
        if np.linalg.matrix_rank(rows[[*chosen, place]], tol=1e-9) > len(chosen):
            chosen.append(int(place))
        if len(chosen) == len(factors):
            return tuple(chosen)
    return None


def _dyadic(value: float) -> Fraction:
    """Number with 40 binary digits, which ball arithmetic represents with radius 0."""
    mantissa, exponent = np.frexp(value)
    return Fraction(int(np.round(mantissa * 2**40))) * Fraction(2) ** (int(exponent) - 40)


@lru_cache(maxsize=64)
def _wide_periods(task: FaultPlant, sampled_loop: SampledStickSlip, size: tuple[float, ...]) -> list[Period]:
    """Periods with widened ranges for states of a given size."""
    law, (slip, rate, level) = sampled_loop.law, (_WIDTH * short(v, 4) for v in size)
    most = law.target_gain * (law.return_rate * slip + _WIDTH * (task.reference_rates[0] + sampled_loop.target_noise))
    most = most + law.rate_gain * rate + level + sampled_loop.pressure_noise
    plant = ranges(task, slip, (-most, most), rate * sampled_loop.longest)
    return Period.deciding(FLOATS, task, sampled_loop, plant, rate / _WIDTH, (-most / _WIDTH, most / _WIDTH))


@lru_cache(maxsize=64)
def _wide_constraints(
    task: FaultPlant, sampled_loop: SampledStickSlip, size: tuple[float, ...]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Constraints of slices and combinations besides the facets, for the same ranges."""
    return list(map(_floats, polytopes(task, sampled_loop, (), _wide_periods(task, sampled_loop, size)[0].plant)))


@dataclass
class _Images:
    """Largest n·z of every normal n after a period: affine in the heights."""

    tops: np.ndarray
    moves: np.ndarray
    factors: np.ndarray
    growth: np.ndarray


@dataclass
class _Growing:
    """A polytope {n·z ≤ h} that grows until it contains its images."""

    task: FaultPlant
    sampled_loop: SampledStickSlip
    normals: np.ndarray
    heights: np.ndarray
    multipliers: np.ndarray
    least: np.ndarray
    points: np.ndarray
    margin: float = _MARGINS[0]
    turn: int = 0
    last: _Images | None = None
    centres: dict[int, np.ndarray] = field(default_factory=dict)
    touching: np.ndarray = field(default_factory=lambda: np.arange(5))

    @property
    def facets(self) -> np.ndarray:
        """n/h."""
        return np.asarray(self.normals / self.heights[:, None])

    @property
    def size(self) -> np.ndarray:
        """Largest |e1|, y and |d|."""
        box = 1 / np.abs(self.facets[:5].sum(axis=1))
        return np.array([max(box[0], box[3]), box[1], max(box[2], box[4])])

    @property
    def _rounded(self) -> tuple[float, ...]:
        """Sizes, rounded to two digits, as ranges are slow to compute."""
        return tuple(float(f"{float(v):.1e}") for v in self.size)

    def periods(self) -> list[Period]:
        """Periods with slightly widened ranges."""
        return _wide_periods(self.task, self.sampled_loop, self._rounded)

    def images(self) -> "_Images | None":
        """Largest n·z of every normal n after a period, with the best multipliers; None for an empty polytope."""
        periods, facets = self.periods(), self.facets
        sizes = np.append(self.size, self.size[1] * float(self.sampled_loop.longest))
        corners = []
        for place, (rows, ends) in enumerate(_wide_constraints(self.task, self.sampled_loop, self._rounded)):
            tall = rows.shape[1]
            rows = np.vstack([np.pad(facets, ((0, 0), (0, tall - 3))), rows])
            at = _corners(rows, np.append(np.ones(len(facets)), ends), sizes[:tall], self.centres.get(place))
            if at is None and tall == 3:
                return None
            if at is not None:
                self.centres[place] = at[0].mean(axis=0)
            corners.append(at)
        self.touching = np.unique(np.concatenate([np.arange(5), *(at[1].ravel() for at in corners if at is not None)]))
        self.touching = self.touching[self.touching < len(facets)]
        tried = self._tried(self.turn % _TRIED_EACH == 1)
        tops = self._tops(periods, corners, tried)
        best, row = tops.argmin(axis=0), np.arange(len(facets))
        self.multipliers = np.column_stack(
            [*tried[best[0], row, :2].T, *tried[best[1], row, 2:4].T, tried[best[2], row, 4]]
        )
        return self._images(periods, corners)

    def _tried(self, many: bool) -> np.ndarray:
        """Multipliers of every facet to try: present ones and neighbours; with `many` a grid."""
        law = self.sampled_loop.law
        n2, n3 = self.normals[:, 1:].T
        plain = n2 + n3 * float(law.level_gain)
        size = np.maximum(np.abs(plain), np.abs(n3) * float(law.target_gain))
        tried = [self.multipliers * np.array([rate, 1, rate, 1, 1]) for rate in _NEAR]
        for share in (0.0, 1.0) if many else ():
            fixed = np.full(len(n2), share)
            tried += [np.column_stack([rate * size, fixed, rate * size, fixed, fixed]) for rate in _RATE_SHARES]
            tried.append(np.column_stack([np.maximum(-plain, 0), fixed, -n2, fixed, fixed]))
        return np.array(tried)

    def _tops(self, periods: list[Period], corners: list[Any], tried: np.ndarray) -> np.ndarray:
        """Largest values of the facets for each choice of multipliers, by map: sliding, limited innovation, rest."""
        choices, count = tried.shape[:2]
        largest = np.full((3, choices * count), -np.inf)
        for rows in _rows(periods, np.tile(self.normals, (choices, 1)), tried.reshape(-1, 5)):
            kind = 2 if rows.place >= SLICES else int(rows.cut)
            at = corners[rows.place]
            if at is not None:
                tops = (rows.factors @ at[0].T).max(axis=1) + rows.constants
                largest[kind, rows.which] = np.maximum(largest[kind, rows.which], tops)
        return np.asarray(largest.reshape(3, choices, count).swapaxes(0, 1))

    def _images(self, periods: list[Period], corners: list[Any]) -> "_Images":
        """Largest values as functions of the heights, and the images of the facets as functions of the state."""
        sizes = np.append(self.size, self.size[1] * float(self.sampled_loop.longest))
        count, steps = (
            len(self.normals),
            np.array(stop_bounds(self.task, self.sampled_loop, periods[0].plant), dtype=float),
        )
        images = _Images(np.full(count, -np.inf), np.zeros((count, count)), np.zeros((count, 3)), np.zeros(count))
        for rows in _rows(periods, self.normals, self.multipliers):
            at = corners[rows.place]
            if at is None:
                continue
            values = rows.factors @ at[0].T
            vertex = values.argmax(axis=1)
            tops = values[np.arange(len(vertex)), vertex] + rows.constants
            larger = tops > images.tops[rows.which]
            if not larger.any():
                continue
            which, factors, bases, tops = rows.which[larger], rows.factors[larger], at[1][vertex[larger]], tops[larger]
            scale = sizes[: factors.shape[1]]
            shares = (np.linalg.pinv((at[2] * scale)[bases].swapaxes(-1, -2)) @ (factors * scale)[..., None])[..., 0]
            new = ~self._unchanged(rows, larger, steps, sizes)
            which, factors, bases, tops, shares = which[new], factors[new], bases[new], tops[new], shares[new]
            images.factors[which] = factors[:, :3]
            if factors.shape[1] > 3:  # δ is at most g·y + h
                images.factors[which, 1] += (
                    np.maximum(factors[:, 3], 0)
                    * steps[(steps[:, 0] * at[0][vertex[larger][new], 1][:, None] + steps[:, 1]).argmin(axis=1), 0]
                )
            images.tops[which], images.moves[which] = tops, 0
            for share, place in zip(shares.T, bases.T, strict=True):
                own = place < count
                images.moves[which[own], place[own]] += share[own] / self.heights[place[own]]
        return images

    def _unchanged(self, rows: Rows, chosen: np.ndarray, steps: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """Mask of functions that stay below their facets because of the signs of e1, y and δ alone."""
        left = rows.factors[chosen, :3] - self.normals[rows.which[chosen]]
        if rows.factors.shape[1] > 3:
            left[:, 1] += np.maximum(rows.factors[chosen, 3], 0) * steps[-1, 0]
        slice_number = rows.place if rows.place < SLICES else COMBINATIONS[rows.place - SLICES][0]
        fastest = self.task.reference_rates[0] + self.sampled_loop.target_noise
        end = float(fastest / self.sampled_loop.law.return_rate) if slice_number == 1 else np.inf
        constants = rows.constants[chosen] + (np.maximum(left[:, 0], 0) * end if slice_number == 1 else 0)
        small = _TINY * self.heights[rows.which[chosen]]
        of_error = (left[:, 0] * (-1 if slice_number == 0 else 1) * sizes[0] <= small) | (slice_number == 1)
        rest = (left[:, 1] <= 0) & (np.abs(left[:, 2]) * sizes[2] <= small) & (constants <= small)
        return np.asarray(of_error & rest)

    def grown(self, progress: Progress) -> bool:
        """Whether the polytope was enlarged until it contains its images."""
        first = self.size
        for turn in range(self.turn, _TURNS):
            self.turn = turn + 1
            if turn in _REFINED and self.last is not None:
                self.refine(self.last)
            self.normals = self._neutral(self.normals, self.periods()[0].plant.chord[1])
            after = self.images()
            if after is None or (self.size > _FAR * first).any():
                return False
            after.growth, self.last = after.tops - self.heights, after
            margin = self.margin * np.linalg.norm(self.normals * np.abs(self.size), axis=1)
            if np.all(after.tops <= self.heights - margin / 4):
                self._shrink(after, margin)
                return True
            own = after.tops - after.moves @ self.heights + margin
            late = turn > _REFINED[-1] + _FOLLOWED
            changed = after.tops > self.heights - margin / 4 if late else np.full(len(own), True)
            if late and (solved := self._settled(after.moves, own, changed)) is not None:
                self.heights = solved
                continue
            for _ in range(_PERIODS):  # periods with this policy
                least = self.heights if late else self.least
                self.heights = np.where(changed, np.maximum(least, after.moves @ self.heights + own), self.heights)
            progress("an invariant polytope", turn / _TURNS)
        return False

    def _shrink(self, after: _Images, margin: np.ndarray) -> None:
        """Replace the set by its image while the image is much smaller."""
        for _ in range(_SHRUNK):
            self.turn += 1  # determines which multipliers are tried
            before, self.heights = self.heights, np.minimum(self.heights, np.maximum(self.least, after.tops + margin))
            images = self.images()
            if images is None or not np.all(images.tops <= self.heights - margin / 4):  # rounding
                self.heights = before
                return
            if np.all(self.heights[:5] > (1 - _LITTLE_LESS) * before[:5]):
                return
            after = images

    def _settled(self, moves: np.ndarray, own: np.ndarray, changed: np.ndarray) -> np.ndarray | None:
        """Heights at the fixed point of this policy; None without one."""
        places = np.flatnonzero(changed)
        inner = moves[np.ix_(places, places)]
        if not len(places) or np.abs(np.linalg.eigvals(inner)).max() >= 1:
            return None
        fixed = own[places] + moves[places][:, ~changed] @ self.heights[~changed]
        solution = np.linalg.solve(np.eye(len(places)) - inner, fixed)
        if (solution < self.heights[places]).any() or (solution > _LITTLE * self.heights[places]).any():
            return None
        heights = self.heights.copy()
        heights[places] = solution
        return heights

    def _neutral(self, normals: np.ndarray, chord: Fraction) -> np.ndarray:
        """Normals for which a resting fault does not raise the height.

        Images tend to a normal whose largest factor of ξ is 0. Rounding or another range of slopes makes it positive.
        Then ψ of `stick_slip_set`, the bound of (chord of 1/β) − 1/β, enters, and the heights would grow without bound.
        """
        law, half = self.sampled_loop.law, float(self.sampled_loop.step) / 2
        slip, level = float(law.slip_gain), float(law.level_gain)
        n1, n2, n3 = normals.T
        most = float(chord / self.task.authority)
        largest = n1 + n3 * (slip - most)
        near = (n1 > 0) & (n3 < 0) & (largest > -_SNAPPED / 10 * n1) & (largest < 2 * _SNAPPED * n1)
        n3 = np.where(near, -n1 * (1 + _SNAPPED) / (slip - most), n3)
        needed = -n3 * slip * half * (1 + _WIDER)
        slow = (n3 < 0) & (n1 + n3 * (slip - most) < 0) & (needed + n3 * level < 0)
        slow &= n2 > _NEARLY * needed
        slow[:5] = False  # the axes
        return np.column_stack([n1, np.where(slow, np.maximum(n2, needed), n2), n3])

    def refine(self, last: _Images) -> None:
        """Add pull-backs of the fastest-growing facets as normals; heights keep a share of their growth."""
        growth, factors = last.growth[self.touching], last.factors[self.touching]
        for name in ("normals", "heights", "least", "multipliers"):
            setattr(self, name, getattr(self, name)[self.touching])
        size, chord = self.size, self.periods()[0].plant.chord[1]
        directions = self.normals * size
        widths = np.linalg.norm(directions, axis=1)
        directions, more = directions / widths[:, None], list[np.ndarray]()
        for place in (growth / widths).argsort()[::-1]:
            normal = factors[place] * size * (1, 1 + _WIDER * np.sign(factors[place][1]), 1)
            length = np.linalg.norm(normal)
            if length and (directions @ normal).max() < _ALIKE * length and len(self.normals) + len(more) < _MOST:
                directions = np.vstack([directions, normal / length])
                more.append(normal / length / size)
            if len(more) == _ADDED:
                break
        more.append(
            np.array([0, float(self.sampled_loop.law.slip_gain * self.sampled_loop.step) / 2 * (1 + _WIDER), -1])
            / size[2]
        )
        self.normals = np.vstack([self.normals, more])
        self.least = np.concatenate([self.least, (np.array(more) @ self.points.T).max(axis=1)])
        self.multipliers = np.vstack([self.multipliers, np.zeros((len(more), 5))])
        before = np.concatenate([self.heights, self.least[len(self.heights) :]])
        self.normals = self._neutral(self.normals, chord)
        self.least = np.maximum(self.least, (self.normals @ self.points.T).max(axis=1))
        self.heights = self.least + _RETAINED * (before - self.least)

    def _scaled(self) -> np.ndarray:
        """Multipliers of n/h instead of n."""
        factors = np.ones_like(self.multipliers)
        factors[:, [0, 2]] = 1 / self.heights[:, None]
        return np.asarray(self.multipliers * factors)

    def exact(self) -> StickSlipPolytope | None:
        """Polytope in exact numbers, with the constraints that meet at each vertex."""
        facets = tuple(tuple(_dyadic(float(v)) for v in row) for row in self.facets)
        periods, bases = self.periods(), list[list[tuple[int, ...]]]()
        sizes = np.append(self.size, self.size[1] * float(self.sampled_loop.longest))
        groups = polytopes(self.task, self.sampled_loop, facets, periods[0].plant)
        for constraints in groups:
            at = _corners(*_floats(constraints), sizes[: len(constraints[0][0])])
            if at is None:
                return None
            bases.append([tuple(int(v) for v in basis) for basis in at[1]])
        self._complete(periods, np.array(facets, dtype=float), groups, bases)
        return StickSlipPolytope(
            facets=facets,
            multipliers=tuple(tuple(short(float(v), _DIGITS) for v in row) for row in self._scaled()),
            sliding=tuple(tuple(line) for line in bases[:SLICES]),
            resting=tuple(tuple(line) for line in bases[SLICES:]),
        )

    def _complete(
        self,
        periods: list[Period],
        facets: np.ndarray,
        groups: list[list[Constraint]],
        bases: list[list[tuple[int, ...]]],
    ) -> None:
        """Add vertices lost by rounding, by linear programs."""
        sizes = [short(float(v), 6) for v in (*self.size, self.size[1] * float(self.sampled_loop.longest))]
        verifiers = [
            Verifier(constraints, vertices, sizes[: len(vertices[0])], place=place, facets=len(facets))
            for place, (constraints, vertices) in enumerate(zip(groups, bases, strict=True))
        ]
        for rows in _rows(periods, facets, self._scaled()):
            verifier = verifiers[rows.place]
            scaled = rows.factors * np.array(sizes[: rows.factors.shape[1]], dtype=float)
            shares = verifier.proposed(scaled)[1]
            for place in np.flatnonzero(shares.min(axis=1) < -_NEGATIVE * np.abs(shares).max(axis=1)):
                basis = _basis(verifier.floats, np.array([float(end) for _, end in groups[rows.place]]), scaled[place])
                if basis is not None and basis not in bases[rows.place]:
                    bases[rows.place].append(basis)


# ----------------------------------------------------------------------
# Gains with a proof for a fault.


def proved(task: FaultPlant, sampled_loop: SampledStickSlip, progress: Progress = silent) -> StickSlipProof | NoProof:
    """Guarantee of a law with a polytope from a search, or the reason why there is none."""
    fresh = list[StickSlipProof | NoProof]()

    def search() -> dict[str, Any]:
        with np.errstate(all="ignore"):  # overflow gives no proposal
            fresh.append(_searched(task, sampled_loop, progress))
        return {"set": written(fresh[0].invariant_set)} if fresh[0].available else {"reason": fresh[0].reason}

    stored = search_once(search, "polytope of a stick-slip law", task, sampled_loop)
    if fresh:
        return fresh[0]
    if "reason" in stored:
        return NoProof(reason=stored["reason"])
    return stick_slip_guarantee(task, sampled_loop, read_as(StickSlipPolytope, stored["set"]))


def _searched(task: FaultPlant, sampled_loop: SampledStickSlip, progress: Progress) -> StickSlipProof | NoProof:
    proof: StickSlipProof | NoProof
    proof = NoProof(reason="no invariant polytope was found")
    try:
        points = _ReachableStates.of(task, sampled_loop).hull(progress)
        if points is None:
            return NoProof(reason="the reachable states grow without bound")
        normals = _normals(points, _FACETS)
        heights = (normals @ points.T).max(axis=1)
        growing = _Growing(task, sampled_loop, normals, heights, np.zeros((len(normals), 5)), heights, points)
        for growing.margin in _MARGINS:
            if not growing.grown(progress) or (invariant_set := growing.exact()) is None:
                return proof
            proof = stick_slip_guarantee(task, sampled_loop, invariant_set)
            if proof.available:
                break
    except ParameterError as error:
        return NoProof(reason=str(error))
    except (ArithmeticError, ValueError, LinAlgError, QhullError):
        return NoProof(reason="the loop is too badly scaled for a search in floating point")
    return proof


def design_stick_slip(
    task: FaultPlant,
    step: Fraction,
    *,
    objective: str = "tracking",
    slip_noise: Fraction = Fraction(0),
    longest_step: Fraction = Fraction(0),
    healing: Fraction = Fraction(0),
    implicit: bool = False,
    progress: Progress = silent,
) -> StickSlipProof | NoProof:
    """Gains with a guarantee on the stick–slip plant, from the first tuning with a proof.

    Parameters
    ----------
    task : FaultPlant
    step : Fraction
        T_s [s].
    objective : str
        ``tracking``: small slip error; ``peak``: small slip rate.
    slip_noise : Fraction
        Bound of the measurement error of the slip [m].
    longest_step : Fraction
        Longest interval of aperiodic sampling, as in `SampledStickSlip` [s].
    healing : Fraction
        Healing Δμ_h [-], treated as an additional disturbance, see `StickSlipProof.covered_healing`.
    implicit : bool
        Whether the law is a deadbeat implicit step; it has the same tunings for both objectives.
    progress : callable
        Called with the name of the current step and the fraction done [-].
    """
    if not task.amplitude and not healing:
        reason = "the stick-slip theorem needs a disturbance above 0 m/s^2: give amplitude in [disturbance]"
        return NoProof(reason=reason)
    if longest_step and implicit:
        return NoProof(reason="a sliding mode on the stick-slip plant is proved for periodic sampling alone")
    none = list[StickSlipProof | NoProof]()
    longer = float(longest_step / step) if longest_step else 1.0
    for *shares, gain in DEADBEAT if implicit else (APERIODIC if longest_step else TUNINGS)[objective]:
        try:
            sampled_loop = tuned(task, step, (*shares, gain * longer), slip_noise, implicit=implicit)
            sampled_loop = replace(sampled_loop, longest_step=longest_step)
        except (ParameterError, ArithmeticError, ValueError):
            return NoProof(reason="the gains are outside the range of floats")
        proof = _healed(task, sampled_loop, healing, progress)
        if proof.available:
            return proof
        none.append(proof)
    return none[0]


def _healed(
    task: FaultPlant, sampled_loop: SampledStickSlip, healing: Fraction, progress: Progress
) -> StickSlipProof | NoProof:
    """Proof with a disturbance enlarged by the effect of healing at a guessed least pressure, which is then checked."""
    least = task.rest_pressure[0] - _LOWER * task.normal_stress
    for _ in range(_GUESSES):
        more = task.area_per_mass[1] * healing * (task.normal_stress - least)
        proof = proved(replace(task, amplitude=task.amplitude + more), sampled_loop, progress)
        if not proof.available or proof.covered_healing(task.amplitude) >= healing:
            return replace(proof, healing=healing) if proof.available else proof
        least = Fraction(proof.claims.least_pressure) - _LOWER * task.normal_stress
    return NoProof(reason="no consistent least pressure was found for this healing")


# ----------------------------------------------------------------------
# Falsification: worst case found (lower bound).


def worst_stick_slip(proof: StickSlipProof, *, periods: int = 60) -> WorstCase:
    """Worst case found from the initial condition at rest, continued from the extreme states of every period.

    For each facet of the invariant polytope the search continues from the farthest state in its direction. β is
    constant along a trajectory. In each period the slope of friction is at either end of its range, and the disturbance
    changes its sign at most once. Friction at rest equals that in slip, or exceeds it by `healing`, evaluated at the
    largest claimed pressure, where its effect is least.
    """
    task, claims = proof.task, proof.claims
    excess = proof.healing * task.area_per_mass[0] * (task.normal_stress - Fraction(claims.largest_pressure))
    plain = _ReachableStates.of(replace(task, amplitude=proof.disturbance), proof.sampled_loop)
    plants, noises = [replace(plain, excess=e) for e in sorted({0.0, float(excess)})], _noises(proof.sampled_loop)
    facets, extremes = np.array(proof.invariant_set.facets, dtype=float), np.zeros(3)
    for high in (False, True):  # which end of β
        first = _at_first(proof.sampled_loop)
        states = {noise: first[[int(noise < 0)]] for noise in noises}  # keys: measurement error of the sample
        for _ in range(periods):
            before = dict(states)
            for later in noises:
                ends = [states[later]]
                for plant, (noise, starts) in product(plants, before.items()):
                    after = plant.simulated(starts, noise, later)
                    half = after.shape[1] // 2  # the two halves of the choices differ in β
                    ends.append((after[:, half:] if high else after[:, :half]).reshape(-1, 3))
                points = np.vstack(ends)
                states[later] = points[np.unique((facets @ points.T).argmax(axis=1))]
        points = np.vstack(list(states.values()))
        points[:, 0] -= float(proof.sampled_loop.slip_noise)
        extremes = np.maximum(extremes, [-points[:, 0].min(), points[:, 0].max(), points[:, 1].max()])
    behind, ahead, rate = (float(v) for v in extremes)
    return WorstCase(slip_error=max(behind, ahead), slip_behind=behind, slip_ahead=ahead, peak_slip_rate=rate)
