"""Guarantees with aperiodic sampling: search for the invariant set in floats."""

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError, expm
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from quakedesign.exact import UpperBound
from quakedesign.guarantees.exact.invariant_set import SOONEST, BetweenSamples, InvariantPolytope, reduced
from quakedesign.guarantees.exact.proof import NoProof
from quakedesign.guarantees.exact.sampled_loop import SampledLoop, channels_of
from quakedesign.guarantees.exact.small_gain import Bounds
from quakedesign.guarantees.exact.tracking_proof import TrackingProof, guarantee
from quakedesign.guarantees.search.float_bounds import FLOATS, BoundsEstimate, floats, gains_of, short
from quakedesign.plant.fault_plant import FaultPlant

MOST_SIZE = 3  # largest dimension of the state at a sample: larger hulls take too long
_SAMPLE_PIECES, _BETWEEN_PIECES = 6, 8
_FEW, _MANY = 60, 160  # numbers of facets
_DIRECTIONS = 3  # directions followed per facet
_TURNS, _TURN, _STILL, _FAR = 400, 8, 1e-3, 1e4
_ROUNDS, _ANEW, _POLICIES = 8, 2, 40
_LOOSE = 1.02  # largest excess of input bounds over the required ones
_TRACE = 1e-3  # relative size of the other inputs in the response to one input, so that every state is excited
_NONE = 9.0  # small gain reported without a set
_RAISED = (1.002, 1.01, 1.04)  # enlargements per sample, so that numbers can be rounded
_SEED = 5
_DIGITS = 7


def aperiodic_guarantee(task: FaultPlant, sampled_loop: SampledLoop) -> TrackingProof | NoProof:
    """Guarantee with an invariant set from a search, or the reason why there is none."""
    proof: TrackingProof | NoProof = NoProof(reason="no invariant set was found")
    for raised in _RAISED:
        invariant_set = _rounded_set(task, sampled_loop, raised)
        if not isinstance(invariant_set, InvariantPolytope):
            return invariant_set or proof
        proof = guarantee(task, sampled_loop, invariant_set=invariant_set)
        if proof.available:
            break
    return proof


def unclocked_estimate(task: FaultPlant, sampled_loop: SampledLoop) -> BoundsEstimate | None:
    """Estimated bounds from an invariant set with few facets; None without a set."""
    middle = replace(sampled_loop, step=(sampled_loop.step + sampled_loop.longest_step) / 2, longest_step=Fraction(0))
    gains, loop = gains_of(middle.loop(task)), _Floats.of(task, sampled_loop)
    sides = loop.sides(loop.own, _FEW) if gains is not None and loop.fits else None
    if gains is None or sides is None:
        return None
    largest, columns = sides.largest(loop, loop.own), loop.columns(sides, _FEW)
    share, bounds = loop.solved(loop.own, largest, columns)
    if bounds is None:
        return BoundsEstimate(NoProof(reason="", small_gain=UpperBound(Fraction(share))), 1.0)
    slip, rate, push = (Fraction(float(v)) for v in largest + (bounds - loop.own) @ columns)
    estimate = Bounds(slip_error=slip, slip_rate_error=rate, push=push, small_gain=Fraction(share))
    return BoundsEstimate(estimate, max(gains["slip_error", "drift"]))


@dataclass(frozen=True)
class _Floats:
    """A loop from sample to sample, as in `quakedesign.guarantees.exact.invariant_set`.

    `inputs` are continuous-time inputs and `sampled` inputs at samples, both in the order of the channels, else zeros.
    `force` is the bound of a rate-limited disturbance [m/s²], which is not part of the input ``acceleration``; else 0.
    """

    flow: np.ndarray
    seen: np.ndarray
    lift: np.ndarray
    rows: np.ndarray
    inputs: np.ndarray
    sampled: np.ndarray
    own: np.ndarray
    shares: np.ndarray
    interval: tuple[float, float]
    force: float

    @classmethod
    def of(cls, task: FaultPlant, sampled_loop: SampledLoop) -> "_Floats":
        """Matrices of a loop with aperiodic sampling."""
        loop, channels = sampled_loop.loop(task), channels_of(task, None, sampled_loop.step, sampled_loop.noise)
        seen, lift = (
            np.array([[int(v.p) / int(v.q) for v in row] for row in part.tolist()])
            for part in reduced(loop.segments[0].jump)
        )
        none = (0,) * len(loop.states)
        return cls(
            flow=np.array(loop.flow, dtype=float),
            seen=seen,
            lift=lift,
            rows=np.array(list(loop.outputs.values()), dtype=float),
            inputs=np.array([loop.inputs.get(channel.name, none) for channel in channels], dtype=float),
            sampled=np.array([loop.sampled.get(channel.name, none) for channel in channels], dtype=float),
            own=np.array([float(channel.constant) for channel in channels]),
            shares=np.array([[float(channel.coefficients.get(y, 0)) for y in loop.outputs] for channel in channels]),
            interval=(float(sampled_loop.step), float(sampled_loop.longest_step)),
            force=0.0 if task.change is None else float(task.amplitude),
        )

    @cached_property
    def between(self) -> BetweenSamples:
        """Flow of rows and inputs between samples."""
        return BetweenSamples(FLOATS, floats(self.flow), floats(self.inputs.T))

    @property
    def fits(self) -> bool:
        """Whether the state at a sample has few enough entries."""
        return len(self.seen) <= MOST_SIZE

    @property
    def at_samples(self) -> list[float]:
        """Ends of pieces up to the longest interval, the first ones before the shortest."""
        soonest, latest = self.interval
        early = [soonest * i / SOONEST for i in range(SOONEST)]
        return [*early, *np.linspace(soonest, latest, _SAMPLE_PIECES + 1).tolist()]

    @property
    def until_next(self) -> list[float]:
        """Ends of pieces of the longest interval."""
        return [float(v) for v in np.linspace(0, self.interval[1], _BETWEEN_PIECES + 1)]

    def reached(self, bounds: np.ndarray, directions: int) -> np.ndarray | None:
        """Points reachable with bounded inputs, extreme in many directions; None if they grow without bound.

        The interval is the shortest, the middle or the longest one, whichever reaches farthest.
        """
        maps, pushes = zip(*(self._interval(time, bounds) for time in np.linspace(*self.interval, 3)), strict=True)
        scale = np.abs(np.vstack(pushes)).sum(axis=0)
        maps, pushes = [m * scale / scale[:, None] for m in maps], [push / scale for push in pushes]
        white, size = np.eye(len(scale)), np.ones(len(scale))
        points = np.zeros((directions, len(scale)))
        unit = np.random.default_rng(_SEED).standard_normal(points.shape)
        for turn in range(_TURNS):
            ahead = unit @ white
            points = _farthest(ahead, points, maps, pushes)
            if turn % _TURN == _TURN - 1:
                before, size = size, np.max(np.abs(points), axis=0)
                if np.max(size) > _FAR:
                    return None
                if np.max(np.abs(size / before - 1)) <= _STILL:
                    break
                white = np.linalg.inv(np.linalg.cholesky(points.T @ points / directions))
        return np.asarray(points * scale)

    def _interval(self, time: float, bounds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Map from sample to sample, and contributions of the inputs in quarters of the time."""
        step, quarter = expm(self.flow * time), time / SOONEST
        halves = [expm(self.flow * quarter * (i + 0.5)) for i in range(SOONEST)]
        added = [self.seen @ half @ (self.inputs * bounds[:, None]).T * quarter for half in halves]
        at_sample = self.seen @ step @ (self.sampled * bounds[:, None]).T
        pushes = np.hstack([*added, at_sample]).T
        return self.seen @ step @ self.lift, pushes[np.abs(pushes).any(axis=1)]

    def sides(self, bounds: np.ndarray, facets: int, raised: float = 1) -> "_Sides | None":
        """Invariant set with a number of facets for bounded inputs; None if the search fails."""
        points = self.reached(bounds, _DIRECTIONS * facets)
        try:
            return points if points is None else _Sides.invariant(self, _facets(points, facets), bounds, raised)
        except (LinAlgError, QhullError):
            return None

    def columns(self, sides: "_Sides", facets: int) -> np.ndarray:
        """Largest outputs per unit of each input; 0 for inputs without feedback.

        The acceleration of a rate-limited disturbance has a separate set.
        """
        fed, own = self.shares.any(axis=1), sides.largest(self, self.own)
        columns = np.where(fed, 1 / np.where(self.own > 0, self.own, np.inf), 0)[:, None] * own
        if self.force:
            alone = np.where(np.arange(len(self.own)) == 0, self.force, _TRACE * self.own)
            of_force = self.sides(alone, facets)
            columns[0] = np.inf if of_force is None else of_force.largest(self, alone) / self.force
        return np.asarray(columns)

    def solved(self, bounds: np.ndarray, largest: np.ndarray, columns: np.ndarray) -> tuple[float, np.ndarray | None]:
        """Small gain, and input bounds at the fixed point of the linearised feedback."""
        if not np.isfinite(columns).all():
            return _NONE, None
        feeds = self.shares @ columns.T
        share = float(np.abs(np.linalg.eigvals(feeds)).max())
        if share >= 1:
            return share, None
        return share, bounds + np.linalg.solve(np.eye(len(feeds)) - feeds, self.own + self.shares @ largest - bounds)

    def along(
        self, rows: np.ndarray, ends: list[float], first: int, frame: np.ndarray, bounds: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows at the ends from `first` on, contributions of inputs, excess within pieces.

        `frame` bounds the entries of the state at a sample.
        """
        largest = np.abs(self.lift) @ frame + bounds @ np.abs(self.sampled)
        between: Any = self.between  # typed for balls
        places = [
            (now @ self.lift, area[:, 0] + np.abs(now @ self.sampled.T) @ bounds, more[:, 0])
            for now, area, more in between.along(floats(rows), ends, first, floats(largest[:, None]), bounds)
        ]
        along, added, bends = (np.array(part).swapaxes(0, 1) for part in zip(*places, strict=True))
        return along, added, bends[:, :-1]


def _farthest(ahead: np.ndarray, points: np.ndarray, maps: list[np.ndarray], pushes: list[np.ndarray]) -> np.ndarray:
    """Farthest image of the points and their negatives in every direction."""
    row, images = np.arange(len(ahead)), list[tuple[np.ndarray, np.ndarray]]()
    for step, added in zip(maps, pushes, strict=True):
        heights = ahead @ step @ points.T
        best = np.abs(heights).argmax(axis=1)
        after = np.sign(heights[row, best])[:, None] * (points[best] @ step.T) + np.sign(ahead @ added.T) @ added
        images.append(((ahead * after).sum(axis=1), after))
    choice = np.array([height for height, _ in images]).argmax(axis=0)
    return np.asarray(np.array([after for _, after in images])[choice, row])


def _rounded_set(task: FaultPlant, sampled_loop: SampledLoop, raised: float) -> InvariantPolytope | NoProof | None:
    """Invariant set in rounded numbers, on which all inputs satisfy their bounds; None or `NoProof` if not found."""
    loop = _Floats.of(task, sampled_loop)
    if not loop.fits:
        return NoProof(reason="the law has too many states for an invariant-set search")
    bounds, sides, invariant_set = loop.own, loop.sides(loop.own, _MANY), None
    if sides is None:
        return None
    columns = loop.columns(sides, _MANY)
    for turn in range(_ROUNDS):
        largest = sides.largest(loop, bounds)
        input_bounds = loop.own + loop.shares @ largest
        if (input_bounds <= bounds).all():
            invariant_set = sides.exact(loop, bounds)
            if (input_bounds >= bounds / _LOOSE).all():
                break
        share, more = loop.solved(bounds, largest, columns)
        if more is None:
            gain = UpperBound(Fraction(share))
            reason = f"small gain {gain:.3g} for the given range of intervals, must be below 1"
            return NoProof(reason=reason, small_gain=gain)
        bounds = np.maximum(more, loop.own) * raised
        again = loop.force and turn < _ANEW  # new normals in the first turns, while ratios of bounds change
        following = loop.sides(bounds, _MANY, raised) if again else _Sides.invariant(loop, sides.facets, bounds, raised)
        if following is None:
            break
        sides = following
    return invariant_set


def _facets(points: np.ndarray, count: int) -> np.ndarray:
    """Normals of a hull, as different as possible, scaled to 1 on the set."""
    both = np.vstack([points, -points])
    white = np.linalg.inv(np.linalg.cholesky(both.T @ both / len(both)))
    normals = ConvexHull(both @ white.T, qhull_options="QJ").equations[:, :-1]
    chosen = [int(i) for i in np.abs(normals).argmax(axis=0)]
    alike = np.abs(normals @ normals[chosen].T).max(axis=1)
    while len(chosen) < min(count, len(normals)):
        chosen.append(int(alike.argmin()))
        alike = np.maximum(alike, np.abs(normals @ normals[chosen[-1]]))
    facets = normals[chosen] @ white
    return np.asarray(facets / np.abs(facets @ points.T).max(axis=1)[:, None])


@dataclass(frozen=True)
class _Sides:
    """The set of all states with |h·ξ| at most 1."""

    facets: np.ndarray

    @classmethod
    def invariant(cls, loop: _Floats, normals: np.ndarray, bounds: np.ndarray, raised: float) -> "_Sides | None":
        """Smallest invariant set with these normals; None if the iteration diverges or does not converge."""
        sides, before = cls(normals), np.inf
        for _ in range(_POLICIES):
            now = sides._grown(loop, bounds, raised)
            if now.max() > _FAR:
                return None
            sides = cls(sides.facets / now[:, None])
            if (change := float(np.abs(now - 1).max())) < 1e-6 or (change < 1e-3 and change >= before):
                return sides
            before = change
        return None

    def _grown(self, loop: _Floats, bounds: np.ndarray, raised: float) -> np.ndarray:
        """Factors of all sides after one step of policy iteration."""
        along, added, bends = loop.along(self.facets @ loop.seen, loop.at_samples, SOONEST, self._frame, bounds)
        above = np.maximum(np.pad(bends, ((0, 0), (1, 0))), np.pad(bends, ((0, 0), (0, 1))))
        added = (added + above) * raised
        bases = self._bases(along)
        shares = self._shares(bases, along)
        totals, count = shares.sum(axis=2) + added, len(self.facets)
        row, best = np.arange(count), totals.argmax(axis=1)
        moves, own = np.zeros((count, count)), added[row, best]
        np.add.at(moves, (row[:, None], bases[row, best]), shares[row, best])
        if np.abs(np.linalg.eigvals(moves)).max() >= 1:
            return np.asarray(totals.max(axis=1))
        return np.asarray(np.linalg.solve(np.eye(count) - moves, own))

    @property
    def _frame(self) -> np.ndarray:
        size = self.facets.shape[1]
        return np.asarray(np.abs(np.linalg.inv(self.facets[:size])).sum(axis=1))

    def _shares(self, bases: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Absolute coefficients of every row in the facets of its basis."""
        return np.asarray(np.abs(np.linalg.solve(self.facets[bases].swapaxes(-1, -2), along[..., None])[..., 0]))

    def _bases(self, along: np.ndarray) -> np.ndarray:
        """Facets that meet at the maximum of every row."""
        frame = self._frame
        scaled = self.facets * frame
        both = np.vstack([np.column_stack([sign * scaled, -np.ones(len(scaled))]) for sign in (1, -1)])
        corners = HalfspaceIntersection(both, np.zeros(len(frame)), qhull_options="QJ")
        meet = np.sort(np.array(corners.dual_facets) % len(scaled), axis=1)
        return np.asarray(meet[(along * frame @ corners.intersections.T).argmax(axis=2)])

    def largest(self, loop: _Floats, bounds: np.ndarray) -> np.ndarray:
        """Bound of every output."""
        along, added, bends = loop.along(loop.rows, loop.until_next, 0, self._frame, bounds)
        heights = self._shares(self._bases(along), along).sum(axis=2) + added
        return np.asarray((np.maximum(heights[:, 1:], heights[:, :-1]) + bends).max(axis=1))

    def exact(self, loop: _Floats, bounds: np.ndarray) -> InvariantPolytope:
        """Rounded set with its bases."""
        facets = tuple(tuple(short(float(v), _DIGITS) for v in row) for row in self.facets)
        rounded = _Sides(np.array(facets, dtype=float))
        after, frame = rounded.facets @ loop.seen, rounded._frame
        samples = loop.along(after, loop.at_samples, SOONEST, frame, bounds)[0]
        outputs = loop.along(loop.rows, loop.until_next, 0, frame, bounds)[0]
        at_samples, between = (_as_tuples(rounded._bases(rows)) for rows in (samples, outputs))
        inputs = tuple(short(float(v) * (1 + 10.0**-5), _DIGITS) for v in bounds)
        return InvariantPolytope(inputs=inputs, facets=facets, at_samples=at_samples, between=between)


def _as_tuples(bases: np.ndarray) -> tuple[tuple[tuple[int, ...], ...], ...]:
    return tuple(tuple(tuple(basis) for basis in line) for line in bases.tolist())
