"""Falsification of guaranteed loops: worst case found (lower bound).

Chapters: sampled loop on a moving reference, with disturbance, friction slope, damping and input gain at their
extremes; slow sliding, with adverse shear stress at the corners of the box of a, b and D_c.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product
from math import exp
from typing import Any

import numpy as np
from scipy.linalg import expm

from quakedesign.arguments import checked_dataclass
from quakedesign.cache import search_once
from quakedesign.guarantees.exact.sampled_loop import SampledLoop
from quakedesign.guarantees.exact.sliding_proof import SlidingProof
from quakedesign.guarantees.exact.sliding_small_gain import loop_of, model_of
from quakedesign.guarantees.exact.tracking_proof import ContinuousProof, TrackingProof
from quakedesign.guarantees.search.float_bounds import PERIODS, moved, periods_to_forget
from quakedesign.laws import NOISES
from quakedesign.laws.implicit_root import step_solution
from quakedesign.loop import PeriodicLoop
from quakedesign.loop.periodic import Matrix, Row
from quakedesign.plant.fault_plant import FaultPlant
from quakedesign.plant.sliding_plant import SlidingPlant

# ----------------------------------------------------------------------
# Falsification of the loop of a guarantee: worst case found, a lower bound of the errors.

_PIECES = 6
_SWEEPS = 8
# trajectories with random switching times; sweeps of each (more do not help, as sweeps make no progress at rest)
_MANY, _FEW = 512, 2
_COURSES, _LEAST_COURSES = 24, 8  # trajectories for each of the two outputs; least number of long ones
_CLIMBING, _CLIMBS = 48, 8  # trajectories improved from the best of those, and number of improvements
_CHANGED = 0.15, 0.4, 1.0  # probabilities of replacing the inputs of a piece by those of the adjoint, used in turn
_BLOCK = 8  # pieces that change together, at most
_RESTING, _ROUNDS = 96, 9  # pairs of trajectories of 128 periods: accelerate, rest, accelerate; rounds
_LATEST_START, _LONGEST_DURATION = 20, 7  # latest start and longest duration of the first acceleration, in periods
_NEAR = np.array([[2], [2], [_PIECES]])  # changes per round, in pieces: start and length of acceleration, end of rest
_MOST_RESTED = 128  # periods
_SOON = 1, 2, 4, 8, 16  # periods after which errors are also evaluated for a loop with initial errors
_SLOW = 0.05  # rate of a slow reference as a fraction of its largest rate
_LEVELS = 400  # grid levels above 0 of a disturbance of bounded rate
_SEED = 7
_NEARLY = Fraction(31, 32)  # largest shift as a fraction of the time between two events, so that they never coincide


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class WorstCase:
    """Largest absolute values that a search reached: lower bounds of the worst case.

    Attributes
    ----------
    slip_error : float
        Largest |slip − reference| [m].
    slip_rate_error, peak_slip_rate : float or None
        [m/s]; the first from `worst_tracking`, the second from `worst_stick_slip` and `worst_sliding`.
    log_rate : float or None
        Largest |ln(v/V)| in slow sliding [-].
    slip_behind, slip_ahead : float or None
        Slip behind and ahead of the reference on the stick–slip plant [m].
    least_pressure, largest_pressure : float or None
        Pressure at the valve [Pa]; computed only for a law with an anti-windup limit at rest, on the stick–slip plant.
    """

    slip_error: float
    slip_rate_error: float | None = None
    peak_slip_rate: float | None = None
    log_rate: float | None = None
    slip_behind: float | None = None
    slip_ahead: float | None = None
    least_pressure: float | None = None
    largest_pressure: float | None = None

    @property
    def pressures(self) -> tuple[float, float] | None:
        """Least and largest pressure [Pa], if computed."""
        least, largest = self.least_pressure, self.largest_pressure
        return None if least is None or largest is None else (least, largest)


def worst_tracking(claim: TrackingProof | ContinuousProof, *, sticks: bool = False) -> WorstCase:
    """Worst case found with disturbance, slopes, damping and input gain at their extremes.

    The search makes forward and backward sweeps of the maximum principle, six steps per flow, from random costates. A
    trajectory lasts 64 to 512 periods, depending on the decay of the loop; with initial errors the search also uses 1
    to 16 periods, and after a rest up to 128 periods are added. It maximises the error at the end of the last period
    or, in a second search, at a time within the last period. In continuous time a period is 1/|λ| of the fastest pole.
    In the class `rate` the disturbance is the optimal one for a costate (`_steepest`). With `sticks` friction prevents
    backward slip, and the reference has its largest rate or 1/20 of it. Further trajectories switch the inputs at
    random times, or slip ahead of the reference by up to the proved slip error, rest until it catches up, then
    accelerate (`push_after_rest`). Noise and initial states are at their extremes. An implicit step has its exact
    solution, also outside its sector. With jitter each event is earliest or latest; with aperiodic sampling each
    interval is shortest or longest. Pressures change without a ramp, and an averaged measurement is replaced by the
    value at the midpoint of its interval.
    """
    slip, rate, *pressures = search_once(lambda: _searched(claim, sticks), "worst", claim, sticks)
    least, largest = pressures or (None, None)
    return WorstCase(slip_error=slip, slip_rate_error=rate, least_pressure=least, largest_pressure=largest)


def _searched(claim: TrackingProof | ContinuousProof, sticks: bool) -> list[float]:
    """Largest slip error [m] and slip-rate error [m/s]; the range of pressure [Pa] if computed."""
    searches = [_CourseSearch(claim, sticks, 2 * _COURSES)]
    searches[0].follow(searches[0].random(), _SWEEPS)
    if sticks:
        searches.append(_CourseSearch(claim, sticks, _MANY))
        switched = searches[1].follow(searches[1].switching(), _FEW)
        if searches[1].limit is None:
            best = searches[1].best(min(_CLIMBING, 2 * len(searches[0].aim)))
            searches.append(_CourseSearch(claim, sticks, len(best), numbers=best))
            searches[2].ascend(switched[:, best])
            if isinstance(claim, TrackingProof) and claim.task.reference_rates[0]:
                searches.append(_resting(claim, searches[0]))
                searches[3].push_after_rest(_ROUNDS)
    if claim.loop.segments and not sticks:
        searches.append(_CourseSearch(claim, sticks, 2 * _COURSES, searches[0].periods))
        searches[-1].end_between_samples()
        searches[-1].follow(searches[-1].random(), _SWEEPS)
    for periods in _SOON if claim.loop.start else ():
        searches.append(_CourseSearch(claim, sticks, 2 * _COURSES, periods))
        searches[-1].follow(searches[-1].random(), _SWEEPS)
    pressures = [search.rest_limit.seen for search in searches if search.rest_limit is not None]
    ends = [min(low for low, _ in pressures), max(high for _, high in pressures)] if pressures else []
    return [max(search.largest[k] for search in searches) for k in (0, 1)] + ends


def _resting(claim: TrackingProof, like: "_CourseSearch") -> "_CourseSearch":
    """Search for the slip-rate error after a rest ahead of the fastest reference."""
    way = claim.task.reference_rates[0] * claim.sampled_loop.step
    periods = like.periods + int(np.ceil(min(float(claim.claims.slip_error / way), _MOST_RESTED)))
    courses = max(_RESTING * 2 * PERIODS // (periods * len(like.parts)), _LEAST_COURSES)
    numbers = np.array([number for number in range(8 * courses) if number % 16 in (6, 7, 14, 15)])
    return _CourseSearch(claim, True, len(numbers), periods, numbers=numbers)


@dataclass(frozen=True, slots=True)
class _Event:
    """A jump and the time after it [s].

    `soon`: the jump may be postponed to the next event; `late`: it occurs here unless it occurred before.
    `samples`: the law measures at the jump. `free`: the duration is anything from 0 to `duration`.
    """

    jump: Matrix
    duration: Fraction
    samples: bool
    soon: bool = False
    late: bool = False
    free: bool = False


@dataclass(frozen=True, slots=True)
class _EventPieces:
    """Pieces of one event: its jump, e^{Ah} and responses to constant inputs at every vertex, and the length h [s]."""

    event: _Event
    jump: np.ndarray
    steps: np.ndarray
    added: np.ndarray
    length: float

    def moved_on(self, vertex: int = 0) -> np.ndarray:
        """Map over the time after the jump of the event."""
        return np.linalg.matrix_power(self.steps[vertex], _PIECES)


_ON_TIME: dict[str, Any] = dict.fromkeys(("jitter", "delay_jitter", "averaging", "ramp"), Fraction(0))


def _on_time(sampled_loop: SampledLoop) -> tuple[SampledLoop, Fraction, Fraction]:
    """Loop without jitter, largest shift [s] of its samples, largest lead [s] of its pressures.

    A pressure that arrives at a sample shifts with it. Events keep their order. A first sample without jitter counts as
    the earliest one.
    """
    off, late, delay = sampled_loop.jitter, sampled_loop.jitter + sampled_loop.delay_jitter, sampled_loop.delay
    if any(sampled_loop.initial_errors) or sampled_loop.law.first:
        off /= 2
    part = delay % sampled_loop.step
    alone = not off and not part
    if alone:
        delay, late = delay + late, late / 2 * _NEARLY  # at the due time or later
    elif part:
        off = min(off, part / 2, (sampled_loop.step - part) / 2)
        late = min(late, _NEARLY * (part - off), _NEARLY * (sampled_loop.step - part - off))
        delay += late
    plain = replace(sampled_loop, delay=delay, pump=None, longest_step=Fraction(0), **_ON_TIME)
    return plain, off, 2 * late if alone or part else Fraction(0)


def _events(loop: PeriodicLoop, off: Fraction, early: Fraction, later: Fraction = Fraction(0)) -> list[_Event]:
    """Events of one period from the earliest sample on, shifted by timing errors.

    Samples shift by up to `off` [s], pressures lead by `early` [s]; aperiodic sampling lengthens a period by up to
    `later` [s].
    """
    sample, *others = loop.segments
    waits = sample.duration - early - off if others else sample.duration - 2 * off
    events = [_Event(sample.jump, 2 * off, samples=True, soon=True)] if off else []
    events.append(_Event(sample.jump, waits, samples=True, late=bool(off)))
    for arrival in others:
        events += [_Event(arrival.jump, early, samples=False, soon=True)] if early else []
        events.append(_Event(arrival.jump, arrival.duration - off, samples=False, late=bool(early)))
    still = tuple(tuple(Fraction(i == j) for j in range(len(loop.flow))) for i in range(len(loop.flow)))
    return [*events, *([_Event(still, later, samples=False, free=True)] if later else [])]


@dataclass(slots=True)
class _Limit:
    """Limit at rest of the commanded pressure, as b·(p − p*) [m/s²]; b·p* is `rest`.

    A trajectory may start at any point of the reference: p* begins at its initial value or at an end of its range.

    `place` is the index of the commanded pressure in the state, `correction` the response of the state to a unit
    command. If the slip error [m] grows by at most `rests` between samples, the pressure is at most `width` below its
    `highest`; if by at most `faster`, it is `within` a range. `moved` is the largest change of b·p* in a period, `ends`
    the range of b·p*, and `last` the slip error [m] at the last sample.
    """

    place: int
    correction: np.ndarray
    width: float
    moved: float
    rests: np.ndarray
    highest: np.ndarray
    last: np.ndarray
    ends: tuple[float, float]
    within: tuple[float, float]
    faster: np.ndarray
    rest: np.ndarray
    authority: float
    seen: list[float]

    @classmethod
    def of(
        cls,
        claim: TrackingProof,
        sampled_loop: SampledLoop,
        size: int,
        back: np.ndarray,
        numbers: np.ndarray | None = None,
    ) -> "_Limit | None":
        """Limit at rest of a guarantee along references of given rates [m/s]; None if it has none."""
        limit, law, authority = claim.rest_limit, claim.sampled_loop.law, float(claim.task.authority)
        if limit is None:
            return None
        place, step = 2 + len(law.states), float(claim.sampled_loop.step)
        fed = np.zeros(size)
        commanded = _command_response(claim.task, sampled_loop)
        fed[: len(commanded)] = commanded
        fed[2:place] = [float(v) / authority for v in law.applied]
        rests = float(limit.resolution) - back * step  # largest change of the slip error between samples at rest
        moved, none = float(claim.task.drift) * step, np.zeros(len(back))
        ends: Any = tuple(float(p) * authority for p in claim.task.rest_pressure)
        least, largest, fastest = limit.range or (Fraction(-(10**30)), Fraction(10**30), Fraction(0))
        within = float(least) * authority, float(largest) * authority
        faster = float(fastest) - back * step
        rest = np.array((0.0, *ends))[(np.arange(len(back)) if numbers is None else numbers) // 2 % 3]
        return cls(
            *(place, fed, float(limit.width) * authority, moved, rests, none, none),
            *(ends, within, faster, rest, authority, [0.0, 0.0]),
        )

    def anew(self) -> "_Limit":
        """Copy at the start of a trajectory."""
        return replace(self, highest=np.zeros_like(self.highest), last=np.zeros_like(self.last))

    def cut(self, state: np.ndarray, sampled: np.ndarray) -> np.ndarray:
        """States after a sample of some trajectories; the law receives the applied pressure."""
        commanded, highest = state[:, self.place], self.highest - self.moved
        stuck = state[:, 0] - self.last <= self.rests
        applied = np.where(stuck, np.maximum(commanded, highest - self.width), commanded)
        inside = np.clip(applied, self.within[0] - self.rest, self.within[1] - self.rest)
        applied = np.where(state[:, 0] - self.last <= self.faster, inside, applied)
        if sampled.any():
            pressures = (applied + self.rest)[sampled] / self.authority
            self.seen[:] = [min(self.seen[0], float(pressures.min())), max(self.seen[1], float(pressures.max()))]
        self.highest = np.where(sampled, np.maximum(highest, applied), self.highest)
        self.last = np.where(sampled, state[:, 0], self.last)
        return np.asarray(state + np.outer((applied - commanded) * sampled, self.correction))

    def follow(self, before: np.ndarray, after: np.ndarray) -> None:
        """Subtract the drift of p* from all pressures, which are relative to it."""
        drifted = after[:, self.place] - before[:, self.place]
        self.highest = self.highest + drifted
        self.rest = np.clip(self.rest - drifted, *self.ends)


def _command_response(task: FaultPlant, sampled_loop: SampledLoop) -> list[float]:
    """Response of all states to a unit command, at the first jump of a period."""
    zero = Fraction(0)
    still = tuple((zero, zero) for _ in sampled_loop.law.states)
    law = replace(sampled_loop.law, measured=still, feedback=(1 / task.authority, zero), implicit_step=None, first=())
    jump = replace(sampled_loop, law=law, rate_noise=zero).loop(task).segments[0].jump
    return [float(row[0] - (i == 0)) for i, row in enumerate(jump)]


class _CourseSearch:
    """Many trajectories in one array; `largest` holds the largest |e1| [m] and |e2| [m/s] so far."""

    def __init__(
        self,
        claim: TrackingProof | ContinuousProof,
        sticks: bool,
        courses: int,
        periods: int | None = None,
        *,
        numbers: np.ndarray | None = None,
    ) -> None:
        task, loop = claim.task, claim.loop
        sampled_loop, off, early = (
            _on_time(claim.sampled_loop) if isinstance(claim, TrackingProof) else (None, Fraction(0), Fraction(0))
        )
        loop = sampled_loop.loop(task) if sampled_loop else loop
        implicit_step, noise = (sampled_loop.law.implicit_step, sampled_loop.noise) if sampled_loop else (None, {})
        self.limit = float(task.amplitude) if task.change is not None else None
        flow, inputs = _with_disturbance(task, loop)
        self.size, self.implicit_step, self.step = len(flow), implicit_step, float(loop.period)
        self.sudden = _filled(loop.sampled.get("root", ()), self.size)
        self.noise = np.array([float(noise.get(name, 0)) for name in NOISES])
        self.heard = np.array([_filled(loop.sampled.get(name, ()), self.size) for name in NOISES])
        self.start = np.array([_filled(column, self.size) for column in loop.start]).reshape(-1, self.size)
        beta = [float(b) for b in task.beta]
        input_column = np.zeros(self.size)
        input_column[: len(loop.states)] = [float(v) for v in loop.outputs["push"]]
        ends = product(*map(dict.fromkeys, (task.beta, task.slip_chord, task.rate_chord)))
        vertices = [_flow_at_vertex(task, flow, input_column, *map(float, v)) for v in ends]
        more = claim.sampled_loop.slack if isinstance(claim, TrackingProof) else Fraction(0)
        events = _events(loop, off, early, more) if loop.segments else [_flowing(flow)]
        self.parts = [_pieces(vertices, inputs, event, none=more > 0) for event in events]
        # the first sample has no jitter
        self.punctual = bool(sampled_loop and (sampled_loop.law.first or any(sampled_loop.initial_errors)))
        if periods is None:
            periods = _periods_to_forget(self.parts, len(loop.states))
            courses = 2 * max(courses // 2 * PERIODS // periods, _LEAST_COURSES) if numbers is None else courses
        numbers = np.arange(courses) if numbers is None else numbers  # trajectories; the number determines the kind
        paces = np.where(numbers // 2 % 2, 1, _SLOW)
        self.back = float(task.reference_rates[0]) * paces if sticks else None
        self.rest_limit = None
        if self.back is not None and isinstance(claim, TrackingProof):
            self.rest_limit = _Limit.of(claim, sampled_loop or claim.sampled_loop, self.size, self.back, numbers)
        self.allowed = np.ones((courses, len(self.parts[0].steps)), dtype=bool)
        slow = isinstance(claim, TrackingProof) and claim.varying_gain is not None
        if (slow or self.limit is not None) and beta[0] < beta[1]:  # β varies slowly: it remains at one end
            half = len(vertices) // 2
            self.allowed[numbers % 2 == 0, :half] = self.allowed[numbers % 2 == 1, half : len(vertices)] = False
        self.aim, self.kinds = np.zeros((courses, self.size)), numbers // 4 % 4
        if sticks:  # a fault at rest behind its reference differs from one ahead of it
            self.aim[self.kinds == 0, 0], self.aim[self.kinds % 2 == 1, 1], self.aim[self.kinds == 2, 0] = 1, 1, -1
        else:
            self.aim[: courses // 2, 0] = self.aim[courses // 2 :, 1] = 1
        self.marks = np.empty((0, courses))
        self.periods, self.steps = periods, periods * len(self.parts) * _PIECES
        self.ends = np.full(courses, self.steps - 1)
        self.largest = (0.0, 0.0)

    def follow(self, costates: np.ndarray, sweeps: int) -> np.ndarray:
        """Forward and backward sweeps of the maximum principle; returns the costates of the last forward sweep."""
        slopes = None
        last = costates
        for left in reversed(range(sweeps)):
            chosen, fixed, jumped = self._forward(last := costates, slopes)
            costates = self._backward(chosen, fixed, jumped)
            # in earlier sweeps the slopes follow the sign of the costate
            if self.limit is not None and left <= sweeps // 2:
                slopes = self._slopes(costates, chosen, self.limit)
        return last

    def end_between_samples(self) -> None:
        """Aim at the error in each piece of the last period in turn, not at its end."""
        turn = np.array([(self.aim[:i] == row).all(axis=1).sum() for i, row in enumerate(self.aim)])
        self.ends = self.steps - 1 - turn % (self.steps // self.periods)

    def best(self, count: int) -> np.ndarray:
        """Indices of the best trajectories of the last sweep, count/4 of each of the four kinds."""
        reached = self.marks.max(axis=0)
        kinds = [np.flatnonzero(self.kinds == kind) for kind in range(4)]
        return np.concatenate([kind[np.argsort(-reached[kind])[: count // 4]] for kind in kinds])

    def ascend(self, costates: np.ndarray) -> None:
        """Replace the inputs of some pieces by those of the adjoint; keep this in trajectories whose error grows.

        While the fault is at rest, the maximum principle for all pieces at once makes no progress. The adjoint is that
        of the largest error, at the time at which it occurs.
        """
        random = np.random.default_rng(_SEED)
        chosen, fixed, jumped = self._forward(costates, None)
        top, best = self.marks.max(axis=0), costates
        for turn in range(_CLIMBS):
            adjoint = self._backward(chosen, fixed, jumped, self.marks.argmax(axis=0))
            blocks = random.random((-(-self.steps // (1 + turn % _BLOCK)), len(top))) < _CHANGED[turn % len(_CHANGED)]
            changed = np.repeat(blocks, 1 + turn % _BLOCK, axis=0)[: self.steps]
            tried = np.where((changed & adjoint.any(axis=2))[:, :, None], adjoint, best)
            now = self._forward(tried, None)
            reached = self.marks.max(axis=0)
            better = reached > top
            best = np.where(better[None, :, None], tried, best)
            top = np.maximum(top, reached)
            chosen, fixed, jumped = now

    def push_after_rest(self, rounds: int) -> None:
        """Search over trajectories that accelerate, rest and accelerate again ahead of the reference.

        Each round varies start and length of the first acceleration and the end of the rest, from the best with the
        same input gain. The adjoint gives no direction here: it is 0 while the fault is at rest.
        """
        random, courses, period = np.random.default_rng(_SEED), len(self.aim), self.steps // self.periods
        limits = [[_LATEST_START * period], [_LONGEST_DURATION * period], [1]]
        tried: np.ndarray = np.array([[0], [1], [self.steps]]) + random.integers(0, limits, (3, courses))
        best, top, number = tried, np.zeros(courses), np.arange(self.steps)[:, None]
        for turn in range(rounds):
            begun, lasted, free = tried
            costates = np.zeros((self.steps, *self.aim.shape))
            costates[:, :, 1] = np.where(((number >= begun) & (number < begun + lasted)) | (number >= free), 1, -1)
            _, fixed, _ = self._forward(costates, None)
            if turn:
                reached = self.marks.max(axis=0)
                best, top = np.where(reached > top, tried, best), np.maximum(top, reached)
                ranked = np.argsort(-top.reshape(-1, 2), axis=0)  # even and odd trajectories have different input gains
                chosen = random.integers(max(len(ranked) // 4, 1), size=ranked.shape)
                parents = (2 * np.take_along_axis(ranked, chosen, axis=0) + [0, 1]).ravel()
                tried = best[:, parents] + random.integers(-_NEAR, _NEAR + 1, best.shape)
            else:
                best[2] = _end_of_rest(np.array([mask[:, 1] for mask in fixed]))
                tried = best + random.integers(-_NEAR, _NEAR + 1, best.shape) * [[0], [0], [1]]

    def _slopes(self, costates: np.ndarray, chosen: list[np.ndarray], limit: float) -> np.ndarray:
        """Slopes of a rate-limited disturbance, relative to the largest, that are optimal for the chosen vertices."""
        rates, moved = np.empty(costates.shape[:2]), np.empty(costates.shape[:2])
        for number, (costate, vertices) in enumerate(zip(costates[:, :, :-1], chosen, strict=True)):
            part = self.parts[number // _PIECES % len(self.parts)]
            rates[number] = (part.steps[vertices][:, :-1, -1] * costate).sum(axis=1)
            moved[number] = (part.added[vertices][:, :-1, -1] * costate).sum(axis=1)
        most = np.array([self.parts[n // _PIECES % len(self.parts)].added[0, -1, -1] for n in range(self.steps)])
        return _steepest(rates, moved, most, limit)

    def random(self) -> np.ndarray:
        """Costates that change at every step."""
        random = np.random.default_rng(_SEED)
        costates = random.standard_normal((self.steps, *self.aim.shape))
        return np.asarray(costates * random.choice([1.0, 1e3], (1, *self.aim.shape)))

    def switching(self) -> np.ndarray:
        """Costates of the slip-rate error that change sign after random times."""
        random, courses = np.random.default_rng(_SEED), len(self.aim)
        flips = np.cumsum(random.random((self.steps, courses)) < 10 ** random.uniform(-2.5, 0, courses), axis=0)
        costates = np.zeros((self.steps, *self.aim.shape))
        costates[:, :, 1] = 1 - 2 * ((flips + random.integers(2, size=courses)) % 2)
        return costates

    def _forward(
        self, costates: np.ndarray, slopes: np.ndarray | None
    ) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
        state, chosen, fixed, jumped = self._started(costates[0]), [], [], []
        marks = []
        limit = self.rest_limit and self.rest_limit.anew()
        self._seen(state)
        for number, costate in enumerate(costates):
            part = self.parts[number // _PIECES % len(self.parts)]
            if number % _PIECES == 0:
                if not part.event.late:
                    now = self._soon(part, state, costates, number)
                jumps = ~now if part.event.late else now
                after = self._sampled(part, state, costate)
                after = limit.cut(after, jumps) if limit and part.event.samples else after
                state = np.where(jumps[:, None], after, state)
                jumped.append(jumps)
            ahead = np.einsum("vij,cj->cvi", part.steps, state)
            products = _pushes(part.added, costate)
            ways = np.sign(products)
            if slopes is not None:
                ways[:, :, -1] = slopes[number][:, None]
            gain = np.einsum("cvi,ci->cv", ahead, costate) + (products * ways).sum(axis=2)
            best = np.where(self.allowed, gain, -np.inf).argmax(axis=1)
            row = np.arange(len(best))
            following = ahead[row, best] + np.einsum("cij,cj->ci", part.added[best], ways[row, best])
            chosen.append(best)
            fixed.append(self._projected(state, following, part.length))
            if limit:
                limit.follow(state, following)
            state = following
            self._seen(state)
            marks.append((state[:, : self.size] * self.aim).sum(axis=1))
        self.marks = np.array(marks)
        return chosen, fixed, jumped

    def _soon(self, part: _EventPieces, state: np.ndarray, costates: np.ndarray, number: int) -> np.ndarray:
        """Mask of trajectories that jump now, by costate if the jump may move to the next event."""
        if not part.event.soon or number + _PIECES >= len(costates) or (self.punctual and number == 0):
            return np.ones(len(state), dtype=bool)
        following = self.parts[(number // _PIECES + 1) % len(self.parts)]
        on = part.moved_on()
        difference = state @ (on @ part.jump - part.jump @ on).T
        return np.asarray(np.einsum("ci,ci->c", costates[number + _PIECES] @ following.steps[0], difference) >= 0)

    def _seen(self, state: np.ndarray) -> None:
        slip, rate = np.abs(state[:, :2]).max(axis=0)
        self.largest = max(self.largest[0], float(slip)), max(self.largest[1], float(rate))

    def _started(self, costate: np.ndarray) -> np.ndarray:
        """Initial states at corners of their box, by the costate after the first piece."""
        part = self.parts[0]
        state = np.sign(costate @ part.steps[0] @ part.jump @ self.start.T) @ self.start
        if self.back is not None:
            state[:, 1] = np.maximum(state[:, 1], -self.back)
        return np.asarray(state)

    def _sampled(self, part: _EventPieces, state: np.ndarray, costate: np.ndarray) -> np.ndarray:
        """States after a jump; a sample adds noise by the costate after the first piece."""
        after: np.ndarray = state @ part.jump.T
        if not part.event.samples:
            return after
        noise = self.noise * np.sign(costate @ part.steps[0] @ self.heard.T)
        return np.asarray(after + noise @ self.heard + self._beside_the_line(state[:, :2] + noise))

    def _beside_the_line(self, measured: np.ndarray) -> np.ndarray | float:
        """Solution of the implicit step minus its linear approximation in the nominal loop."""
        if self.implicit_step is None:
            return 0.0
        line = float(self.implicit_step.middle) / self.step * measured[:, 0]
        return np.outer(
            step_solution(self.implicit_step.pull, self.step, measured[:, 0], measured[:, 1]) + line, self.sudden
        )

    def _projected(self, before: np.ndarray, state: np.ndarray, length: float) -> np.ndarray:
        """Project states in place onto admissible slip rates and disturbances; return the mask of changed entries."""
        mask = np.zeros(state.shape, dtype=bool)
        if self.back is not None:
            mask[:, 1] = stuck = state[:, 1] < -self.back
            above = np.maximum(before[:, 1] + self.back, 0)  # slip rate before; it falls to zero, then rest
            moving = above / np.where(stuck, above - state[:, 1] - self.back, 1)
            state[stuck, 0] = (before[:, 0] - length * self.back + length * moving * above / 2)[stuck]
            state[stuck, 1] = -self.back[stuck]
        if self.limit is not None:
            mask[:, -1] = np.abs(state[:, -1]) > self.limit
            state[:, -1] = np.clip(state[:, -1], -self.limit, self.limit)
        return mask

    def _backward(
        self,
        chosen: list[np.ndarray],
        fixed: list[np.ndarray],
        jumped: list[np.ndarray],
        when: np.ndarray | None = None,
    ) -> np.ndarray:
        """Costates of the aim at the end, or after a given piece of every trajectory."""
        last = self.ends if when is None else when
        costate, costates = np.zeros(self.aim.shape), []
        for number in reversed(range(len(chosen))):
            costate = np.where((last == number)[:, None], self.aim, costate)
            part = self.parts[number // _PIECES % len(self.parts)]
            costate = np.where(fixed[number], 0, costate)
            costates.append(costate)
            costate = np.einsum("cij,ci->cj", part.steps[chosen[number]], costate)
            if number % _PIECES == 0:
                costate = np.where(jumped[number // _PIECES][:, None], costate @ part.jump, costate)
        return np.array(costates[::-1])


def _end_of_rest(stuck: np.ndarray) -> np.ndarray:
    """Piece in which the longest rest of every trajectory ends, or the last piece."""
    rested, longest = np.zeros(stuck.shape[1]), np.zeros(stuck.shape[1])
    last = np.full(stuck.shape[1], len(stuck) - 1)
    for number, rests in enumerate(stuck):
        ends = ~rests & (rested > longest)
        longest, last = np.where(ends, rested, longest), np.where(ends, number, last)
        rested = np.where(rests, rested + 1, 0)
    return last


def _steepest(rates: np.ndarray, moved: np.ndarray, most: np.ndarray, limit: float) -> np.ndarray:
    """Slopes in [-1, 1] that maximise the sum of `rates`·φ + `moved`·slope over the pieces.

    φ is initially 0, changes by slope·`most` over a piece and stays within the limit, on a grid of the smallest change.
    """
    if not limit or not most.min():
        return np.zeros(rates.shape)
    size = int(min(np.ceil(limit / most.min()), _LEVELS))
    grid = np.linspace(-limit, limit, 2 * size + 1)
    share = limit / size / most  # slope of a step to the next level; no step if it exceeds 1
    worth, ways = np.zeros((rates.shape[1], len(grid))), np.zeros((*rates.shape, len(grid)), dtype=np.int8)
    for number in reversed(range(len(rates))):
        rate = moved[number][:, None] * share[number]
        down, up = np.full_like(worth, -np.inf), np.full_like(worth, -np.inf)
        down[:, 1:], up[:, :-1] = worth[:, :-1] - rate, worth[:, 1:] + rate
        ahead = np.stack([down, worth, up]) if share[number] <= 1 else worth[None]
        best = ahead.argmax(axis=0)
        ways[number] = best - len(ahead) // 2
        worth = np.take_along_axis(ahead, best[None], axis=0)[0] + rates[number][:, None] * grid
    level, slopes = np.full(rates.shape[1], size), np.zeros(rates.shape)
    for number, way in enumerate(ways):
        taken = way[np.arange(len(level)), level]
        level, slopes[number] = level + taken, taken * share[number]
    return slopes


def _pushes(added: np.ndarray, costates: np.ndarray) -> np.ndarray:
    """Products of every constant input at a vertex with every costate."""
    vertices, size, inputs = added.shape
    rows = added.transpose(1, 0, 2).reshape(size, vertices * inputs)
    products = np.multiply.outer(costates[:, 0], rows[0])
    for i in range(1, size):
        products += np.multiply.outer(costates[:, i], rows[i])
    return np.reshape(products, (len(costates), vertices, inputs))


def _with_disturbance(task: FaultPlant, loop: PeriodicLoop) -> tuple[np.ndarray, np.ndarray]:
    """Flow, and columns of all inputs at their bounds; a rate-limited disturbance is a state."""
    flow = np.array(loop.flow, dtype=float)
    column, drift = (np.array(loop.inputs[name], dtype=float) for name in ("acceleration", "drift"))
    force, slow = float(task.reference_force), drift * float(task.drift)
    if task.change is None:
        return flow, np.array([column * (force + float(task.amplitude)), slow]).T
    size = len(flow)
    wide = np.zeros((size + 1, size + 1))
    wide[:size, :size], wide[1, size] = flow, 1
    columns = np.zeros((size + 1, 3))
    columns[:size, 0], columns[:size, 1], columns[size, 2] = column * force, slow, float(task.change)
    return wide, columns


def _flow_at_vertex(
    task: FaultPlant, flow: np.ndarray, column: np.ndarray, beta: float, slip: float, rate: float
) -> np.ndarray:
    """Flow at a vertex: slopes act on the errors, the input gain on the matched input."""
    matrix, model = flow.copy(), task.model
    matrix[1] += (beta - float(model.gain / task.authority)) * column
    matrix[1, :2] += slip - float(model.slip), float(model.rate) - rate
    return matrix


def _filled(column: Row, size: int) -> np.ndarray:
    """A column, with zeros below."""
    return np.array([*column, *[0] * (size - len(column))], dtype=float)


def _flowing(flow: np.ndarray) -> _Event:
    """A period of a loop without jumps."""
    still = tuple(tuple(Fraction(i == j) for j in range(len(flow))) for i in range(len(flow)))
    return _Event(still, Fraction(1 / max(abs(np.linalg.eigvals(flow)))), samples=True)


def _pieces(vertices: list[np.ndarray], inputs: np.ndarray, event: _Event, *, none: bool = False) -> _EventPieces:
    """Pieces of an event; `none` adds a vertex with duration 0 if the duration is free."""
    length, size = float(event.duration) / _PIECES, len(inputs)
    responses = [moved(flow, inputs, length) for flow in vertices]
    if none:
        responses.append((np.eye(size), np.zeros(inputs.shape)) if event.free else responses[0])
    steps, added = zip(*responses, strict=True)
    return _EventPieces(event, _widened(event.jump, size), np.array(steps), np.array(added), length)


def _periods_to_forget(parts: list[_EventPieces], size: int) -> int:
    """Periods until the state has decayed at the slowest vertex, within limits."""
    maps = np.eye(parts[0].jump.shape[0])[None]
    for part in parts:
        jump = np.eye(len(part.jump)) if part.event.late else part.jump
        maps = np.linalg.matrix_power(part.steps, _PIECES) @ jump @ maps
    return periods_to_forget(np.abs(np.linalg.eigvals(maps[:, :size, :size])).max())


def _widened(jump: Any, size: int) -> np.ndarray:
    wider = np.eye(size)
    wider[: len(jump), : len(jump)] = np.array(jump, dtype=float)
    return wider


# ----------------------------------------------------------------------
# Falsification of a guarantee of slow sliding: worst case found, a lower bound of the errors.

_SLIDING_PIECES, _FINE_PIECES = 4, 16  # pieces of a part of the period
_SLOPES = (1.0, 1.15)  # (e^y − 1)/y of the linear loop that gives a trajectory
_NEWTON = 4
_AXES = ("direct_effect", "evolution_effect", "critical_slip")


def worst_sliding(claim: SlidingProof) -> WorstCase:
    """Worst case found under adversarial stress at the corners of the box, without inertia.

    For every corner and every final piece, the stress and the reference rate take their extremes according to the sign
    of the impulse response of the linearised loop: the worst case of the linear loop. The errors are those of the
    nonlinear plant, with four Runge–Kutta steps in each part of the period. Inputs may jump between pieces. A last
    search has shorter pieces, at the corner and the normal stress with the largest rate. The normal stress is that at
    the start, or that at the end of the task, where the rate responds more to stress. Measurements are exact. Rates
    below V count like rates above it: |ln(v/V)|.
    """
    rate, slip = search_once(lambda: _searched_sliding(claim), "worst sliding", claim)
    return WorstCase(log_rate=rate, slip_error=slip, peak_slip_rate=float(claim.task.rate) * exp(rate))


def _searched_sliding(claim: SlidingProof) -> list[float]:
    gone = dict.fromkeys((Fraction(0), claim.task.distance))
    places = list(product(corners(claim.task), gone))
    errors = [_largest_sliding(claim, SlidingPieces(claim, *place)) for place in places]
    worst = max(range(len(places)), key=lambda number: errors[number][0])
    corner, slip = places[worst]
    errors.append(_largest_sliding(claim, SlidingPieces(claim, corner, slip, _FINE_PIECES), _SLOPES[:1]))
    return [max(values) for values in zip(*errors, strict=True)]


def _largest_sliding(claim: SlidingProof, plant: "SlidingPieces", slopes: tuple[float, ...] = _SLOPES) -> list[float]:
    reached = [plant.largest(*course).tolist() for course in courses(claim, plant, slopes)]
    return [max(values) for values in zip(*reached, strict=True)]


def corners(task: SlidingPlant) -> list[SlidingPlant]:
    """The task at every corner of the box of a, b and D_c."""
    ends = [dict.fromkeys(task.ranges[axis]) for axis in _AXES]
    points = [dict(zip(_AXES, ((v, v) for v in corner), strict=True)) for corner in product(*ends)]
    return [replace(task, ranges={**task.ranges, **point}) for point in points]


def courses(
    claim: SlidingProof, plant: "SlidingPieces", slopes: tuple[float, ...] = _SLOPES
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Stresses [Pa] and r′/V − 1 [-] for every piece, shape (pieces, courses): worst for the linear loop."""
    for slope in slopes:
        loop, maps = plant.linear(slope)
        aims = np.array([np.array(loop.outputs["log_rate"], dtype=float), np.eye(len(loop.states))[0]])
        count = len(maps)
        signs = np.ones((2, _periods_until_decay(maps) * count, 2 * count))
        for last in range(count):
            costates = aims
            for number in range(signs.shape[1] - count + last, -1, -1):
                step, pushes, jump = maps[number % count]
                signs[:, number, [2 * last, 2 * last + 1]] = np.sign(costates @ pushes).T
                costates = costates @ step @ jump
        yield float(claim.task.stress) * signs[0], float(claim.task.swing) * signs[1]


def _periods_until_decay(maps: list[tuple[Any, Any, Any]]) -> int:
    """Periods until the state of a linear loop has decayed, within limits."""
    whole = np.eye(len(maps[0][0]))
    for step, _, jump in maps:
        whole = step @ jump @ whole
    return periods_to_forget(np.abs(np.linalg.eigvals(whole)).max())


class SlidingPieces:
    """Plant at a corner in pieces of its periods: exact pressures, Runge–Kutta steps.

    The effective normal stress is lower by the equilibrium pressure p* after a given slip of the reference [m].
    """

    def __init__(
        self, claim: SlidingProof, corner: SlidingPlant, slip: Fraction = Fraction(0), pieces: int = _SLIDING_PIECES
    ) -> None:
        self._claim, self._corner, self._pieces = claim, corner, pieces
        model: Any = model_of(claim.task, claim.claims)
        self._loop = loop_of(claim.sampled_loop, model, claim.task)
        normal = float(corner.ranges["normal_stress"][0] - corner.pressure_per_slip * slip)
        self._strength, self._weakening = (normal * float(corner.ranges[a][0]) for a in _AXES[:2])
        self._rate, self._stiffness = float(corner.rate), float(corner.stiffness)
        self._radiation, self._coefficient = float(corner.radiation), float(corner.ranges["coefficient"][0])
        self._ageing = self._rate / float(corner.ranges["critical_slip"][0])
        self._friction = float(corner.ranges["direct_effect"][0]), float(corner.ranges["evolution_effect"][0])

    def linear(self, slope: float) -> tuple[PeriodicLoop, list[tuple[Any, Any, Any]]]:
        """Linear loop and its pieces: e^{Ah}, responses to 1 Pa of stress and to r′ = 2V, and the preceding jump."""
        model: Any = model_of(self._corner, self._claim.claims)
        steep = Fraction(slope).limit_denominator(1000)
        strength = Fraction(self._strength) + self._corner.radiation * self._corner.rate * steep
        plain = replace(
            model,
            slope=steep,
            state_slope=Fraction(1),
            strength=strength.limit_denominator(10**9),
            weakening=Fraction(self._weakening).limit_denominator(10**9),
        )
        loop = loop_of(self._claim.sampled_loop, plain, self._corner)
        flow, pushes = np.array(loop.flow, dtype=float), np.zeros((len(loop.states), 2))
        pushes[:, 0], pushes[0, 1] = np.array(loop.inputs["stress"], dtype=float), -self._rate
        return loop, [(*moved(flow, pushes, length), jump) for length, jump in _parts(loop, self._pieces)]

    def largest(self, stress: np.ndarray, ahead: np.ndarray) -> np.ndarray:
        """Largest |ln(v/V)| and slip error [m] under stress [Pa] and r′/V − 1."""
        parts, size = _parts(self._loop, self._pieces), len(self._loop.states)
        flow, row = np.array(self._loop.flow, dtype=float)[2:, 2:], np.array(self._loop.outputs["push"], float)[2:]
        halves = [expm(flow * length / 2) for length, _ in parts]
        state, largest = np.zeros((size, stress.shape[1])), np.zeros(2)
        for number, (pushed, faster) in enumerate(zip(stress, ahead, strict=True)):
            length, jump = parts[number % len(parts)]
            state = jump @ state
            half = halves[number % len(parts)]
            middle = half @ state[2:]
            after = half @ middle
            pressures = [row @ v for v in (state[2:], middle, after)]
            moved = self._step(state[:2], pressures, pushed, faster, length)
            state = np.vstack([moved, after])
            reached = [self.log_rate(moved, pressures[2], end) for end in (pushed, -pushed)]
            largest = np.maximum(largest, [np.max(np.abs(reached)), np.max(np.abs(moved[0]))])
        return largest

    def _step(self, now: Any, pressures: list[Any], stress: Any, ahead: Any, length: float) -> Any:
        """Slip error and log state after a piece."""
        first = self._rates(now, pressures[0], stress, ahead)
        second = self._rates(now + length / 2 * first, pressures[1], stress, ahead)
        third = self._rates(now + length / 2 * second, pressures[1], stress, ahead)
        fourth = self._rates(now + length * third, pressures[2], stress, ahead)
        return now + length / 6 * (first + 2 * second + 2 * third + fourth)

    def _rates(self, now: Any, pressure: Any, stress: Any, ahead: Any) -> Any:
        y = self.log_rate(now, pressure, stress)
        slips = self._corner.state_law == "slip"
        aged = self._ageing * (-np.exp(y) * (y + now[1]) if slips else np.expm1(-now[1]) - np.expm1(y))
        return np.array([self._rate * (np.expm1(y) - ahead), aged])

    def log_rate(self, now: Any, pressure: Any, stress: Any) -> Any:
        """ln(v/V) from slip error [m], log state, pressure error and stress [Pa], by Newton."""
        a, b = self._friction
        normal = self._strength / a - pressure
        driving = stress - self._stiffness * now[0] + self._coefficient * pressure - normal * b * now[1]
        y = driving / (normal * a + self._radiation * self._rate)
        for _ in range(_NEWTON):
            excess = normal * a * y + self._radiation * self._rate * np.expm1(y) - driving
            y = y - excess / (normal * a + self._radiation * self._rate * np.exp(y))
        return y


def _parts(loop: PeriodicLoop, pieces: int) -> list[tuple[float, np.ndarray]]:
    """Length [s] of every piece of a period, and the jump before it."""
    still, parts = np.eye(len(loop.states)), []
    for segment in loop.segments:
        jumps = [np.array(segment.jump, dtype=float), *[still] * (pieces - 1)]
        parts += [(float(segment.duration) / pieces, jump) for jump in jumps]
    return parts
