"""Upper bounds of L1 norms and free responses of periodic and continuous linear loops.

A bound is computed in ball arithmetic, from rational matrices to rational numbers. Chapters: continuous
loops, one segment of a periodic loop, separation of the slowest mode, free response, and periodic loops; the first and
the last two state and prove their bounds.
The algorithms for periodic loops also give estimates for a search, with other number types (`Arithmetic`).
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, lru_cache, reduce
from itertools import accumulate, chain, pairwise
from operator import add, mul

from flint import arb, arb_mat, ctx, fmpq

from quakedesign.errors import ParameterError
from quakedesign.exact import end_of
from quakedesign.loop import Fading, PeriodicLoop, Pulse, Segment

# ----------------------------------------------------------------------
# Matrices of balls: rationals go in, upper bounds come out.


def ball(value: Fraction) -> arb:
    """Ball of a rational."""
    return arb(fmpq(value.numerator, value.denominator))


def matrix(rows: tuple[tuple[Fraction, ...], ...]) -> arb_mat:
    """Ball matrix of rational rows."""
    return arb_mat([[ball(v) for v in row] for row in rows])


def column(values: tuple[Fraction, ...]) -> arb_mat:
    """Ball matrix of one rational column."""
    return arb_mat([[ball(v)] for v in values])


def identity(size: int) -> arb_mat:
    """Identity matrix."""
    return arb_mat(size, size, [int(i == j) for i in range(size) for j in range(size)])


def hstack(parts: list[arb_mat]) -> arb_mat:
    """Matrices side by side."""
    return arb_mat([list(chain(*rows)) for rows in zip(*(part.tolist() for part in parts), strict=True)])


def majorant(flow: arb_mat) -> arb_mat:
    """M with |e^{Aδ}| ≤ e^{Mh} for 0 ≤ δ ≤ h: |A| off the diagonal, max(A, 0) on it."""
    table = [[v.abs_upper() for v in row] for row in flow.tolist()]
    for i in range(len(table)):
        table[i][i] = arb(0).max(flow[i, i]).abs_upper()
    return arb_mat(table)


def absolute(matrix: arb_mat) -> arb_mat:
    """Upper bounds of the absolute values of all entries, as balls of radius 0."""
    return arb_mat([[v.abs_upper() for v in row] for row in matrix.tolist()])


def upper(value: arb) -> Fraction:
    """A rational that is not below a ball."""
    return end_of(value.upper())


def vstack(parts: list[arb_mat]) -> arb_mat:
    """Matrices stacked vertically."""
    return arb_mat([row for part in parts for row in part.tolist()])


def modulus(matrix: arb_mat) -> arb_mat:
    """Absolute values, as balls."""
    return arb_mat([[abs(v) for v in row] for row in matrix.tolist()])


def larger(one: arb_mat, other: arb_mat) -> arb_mat:
    """Entrywise maximum of two matrices."""
    return arb_mat(one.nrows(), one.ncols(), [*map(arb.max, one.entries(), other.entries())])


def row_sums(matrix: arb_mat) -> arb_mat:
    """Sums of the absolute values of every row, in a column."""
    return arb_mat([[sum(map(abs, row), arb(0))] for row in matrix.tolist()])


def scaled(matrix: arb_mat, weights: Iterable[arb]) -> arb_mat:
    """Matrix with its columns scaled by numbers."""
    return arb_mat([[*map(mul, row, weights)] for row in matrix.tolist()])


def grouped(matrix: arb_mat, weights: list[arb]) -> arb_mat:
    """Weighted sums of groups of consecutive columns, each with one column per weight."""
    rows, count = matrix.tolist(), len(weights)
    groups = [[row[i : i + count] for i in range(0, len(row), count)] for row in rows]
    return arb_mat([[sum(map(mul, group, weights), arb(0)) for group in line] for line in groups])


def not_above(one: arb_mat, other: arb_mat) -> bool:
    """Whether no entry of `one` exceeds that of `other`, whose entries are bounds ≥ 0."""
    return all(a == 0 or a <= b for a, b in zip(one.entries(), other.entries(), strict=True))


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowestMode:
    """Estimated slowest mode of a loop: both eigenvectors, and its remainder.

    With K = 2^doublings and the eigenvalue λ of the mode, the remainder is Σ_{k ≥ K} |λ|^k.
    """

    doublings: int
    left_eigenvector: arb_mat
    right_eigenvector: arb_mat
    remainder: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Arithmetic:
    """Number and matrix types of an algorithm: by default balls, for proofs; others for estimates.

    In both, `*` is the product of matrices, and matrices have the methods `exp`, `nrows` and `ncols` of `arb_mat`. The
    declared types are those of balls. An estimate omits remainders and uses a given slowest mode of the map Ψ of one
    period.
    """

    slowest: Callable[[arb_mat], SlowestMode] | None = None
    number: Callable[[Fraction], arb] = ball
    matrix: Callable[[tuple[tuple[Fraction, ...], ...]], arb_mat] = matrix
    column: Callable[[tuple[Fraction, ...]], arb_mat] = column
    identity: Callable[[int], arb_mat] = identity
    pieces: Callable[[Segment, bool], tuple[Fraction, ...]] = lambda segment, past: segment.pieces(past=past)
    hstack: Callable[[list[arb_mat]], arb_mat] = hstack
    vstack: Callable[[list[arb_mat]], arb_mat] = vstack
    part: Callable[[arb_mat, int, int], arb_mat] = lambda whole, first, end: arb_mat(whole.tolist()[first:end])  # rows
    majorant: Callable[[arb_mat], arb_mat] = majorant
    absolute: Callable[[arb_mat], arb_mat] = absolute
    modulus: Callable[[arb_mat], arb_mat] = modulus
    larger: Callable[[arb_mat, arb_mat], arb_mat] = larger
    scaled: Callable[[arb_mat, Iterable[arb]], arb_mat] = scaled
    sums: Callable[[arb_mat], arb_mat] = row_sums
    grouped: Callable[[arb_mat, list[arb]], arb_mat] = grouped
    highest: Callable[[arb_mat], arb_mat] = lambda whole: arb_mat([[reduce(arb.max, row)] for row in whole.tolist()])

    @property
    def proves(self) -> bool:
        """Whether remainders are counted."""
        return self.slowest is None


BALLS = Arithmetic()


# ----------------------------------------------------------------------
# L1 norms of a loop in continuous time: bounds of every output for an input bounded by 1.
#
# **Statement.** Let x′ = Ax + b·w, x(0) = 0, and w be measurable with |w| ≤ W on [0, t]. Then |cx(t)| ≤ g·W with the g
# that `flow_norms` returns.
#
# **Proof.** |cx(t)| ≤ W·∫₀^∞|ce^{Aσ}b|dσ. Time is divided into stretches of 64 equal pieces, each piece twice as long
# as in the stretch before, so that fast and slow modes cost the same.
#
# - *A piece of length h from α on.* y(σ) = ce^{Aσ}b is within (σ − α)(α + h − σ)/2·max|y″| of its chord, so its part of
#   the integral is at most h(|y(α)| + |y(α + h)|)/2 + h³/12·max|y″|, and |y″| ≤ |c|·V·|A²e^{Aα}b| for every V ≥
#   |e^{Aδ}|, 0 ≤ δ ≤ h, entry by entry. V = e^{Mh} for the first pieces, M = |A| off the diagonal and max(A, 0) on it;
#   if V is valid for h, then max(V, |e^{Ah}|V) is valid for 2h.
# - *The rest.* Let S be the sums up to T for c and every unit column e_j in place of b, and S|e^{AT}| ≤ q·S with q < 1.
#   Sums over later intervals of length T are at most q·S, q²·S …, so ∫₀^∞|ce^{Aσ}e_j|dσ ≤ S_j/(1 − q), and the
#   remainder for b is at most S|e^{AT}b|/(1 − q). ∎

_BITS = 256
_HALVINGS = 6  # 2^6 pieces in a stretch
_SMALL = Fraction(1, 1 << 12)  # q
_MOST_STRETCHES = 128
_HUGE = 1 << _BITS  # size that only an unstable loop reaches


def flow_norms(loop: PeriodicLoop) -> Mapping[tuple[str, str], tuple[Fraction, ...]]:
    """Gain of every (output, input) of a loop without jumps, rounded up, as a tuple of one entry.

    Raises
    ------
    ParameterError
        When the nominal loop is not proved to be stable.
    """
    with ctx.workprec(_BITS):
        flow, rows = matrix(loop.flow), matrix(tuple(loop.outputs.values()))
        size = flow.nrows()
        state = hstack([identity(size), *(column(entry) for entry in loop.inputs.values())])
        sums, state = _sums(flow, rows, state)
        late = absolute(_columns(state, size, state.ncols()))
        rest = _columns(sums, 0, size) * late / (1 - ball(_SMALL))
        return {
            (output, name): (upper(sums[i, size + j] + rest[i, j]),)
            for j, name in enumerate(loop.inputs)
            for i, output in enumerate(loop.outputs)
        }


def _sums(flow: arb_mat, rows: arb_mat, state: arb_mat) -> tuple[arb_mat, arb_mat]:
    """Bounds of the integrals up to T for every column of `state`, which begins with the unit columns; e^{AT}·state."""
    size, square, sums = flow.nrows(), flow * flow, arb_mat(rows.nrows(), state.ncols())
    largest = max(sum(row, arb(0)).abs_upper() for row in absolute(flow).tolist())
    piece = arb(1)
    while not piece * largest < ball(_SMALL):
        piece /= 2
    step, within = (flow * piece).exp(), absolute((majorant(flow) * piece).exp())
    for _ in range(_MOST_STRETCHES):
        starts, power = [state], step
        for _ in range(_HALVINGS):
            starts, power = [*starts, *(power * now for now in starts)], power * power
        for now, following in zip(starts, [*starts[1:], power * state], strict=True):
            sums += (absolute(rows * now) + absolute(rows * following)) * (piece / 2)
            sums += absolute(rows) * within * absolute(square * now) * (piece**3 / 12)
        state = power * state
        units = _columns(sums, 0, size)
        far = units * absolute(_columns(state, 0, size))
        if all(a <= b * ball(_SMALL) for a, b in zip(far.entries(), units.entries(), strict=True)):
            return sums, state
        if not all(v < _HUGE for v in absolute(state).entries()):
            break
        within = larger(within, absolute(step) * within)
        step, piece = step * step, 2 * piece
    raise ParameterError(
        "the nominal loop must be stable. Received a loop whose stability is not proved. Change the gains."
    )


def _columns(whole: arb_mat, first: int, end: int) -> arb_mat:
    return arb_mat([row[first:end] for row in whole.tolist()])


# ----------------------------------------------------------------------
# Responses to an input bounded by 1 over one segment of a periodic loop; for the proof see `norms`.

Weights = tuple[tuple[arb, arb], ...]
_ZERO = Fraction(0)


@dataclass(frozen=True)
class _SegmentFlow:
    """One segment: A, J, and h and e^{Ah} for every piece."""

    by: Arithmetic
    flow: arb_mat
    jump: arb_mat
    lengths: tuple[Fraction, ...]
    pieces: tuple[arb, ...]
    steps: tuple[arb_mat, ...]

    @classmethod
    def of(cls, by: Arithmetic, flow: arb_mat, segment: Segment, *, past: bool) -> "_SegmentFlow":
        """Segment with its pieces for outputs or for past inputs."""
        lengths = by.pieces(segment, past)
        parts = {h: (by.number(h), (flow * by.number(h)).exp()) for h in set(lengths)}
        return cls(by, flow, by.matrix(segment.jump), lengths, *zip(*(parts[h] for h in lengths), strict=True))

    @cached_property
    def within(self) -> list[arb_mat]:
        """Upper bound of |e^{Aσ}|, 0 ≤ σ ≤ h, of every piece: e^{Mh} with M = |A|, but max(A, 0) on the diagonal."""
        bounds = {h: absolute((majorant(self.flow) * ball(h)).exp()) for h in set(self.lengths)}
        return [bounds[h] for h in self.lengths]

    @cached_property
    def whole(self) -> arb_mat:
        """e^{Aτ}J."""
        return reduce(lambda now, step: step * now, self.steps, self.jump)

    @cached_property
    def square(self) -> arb_mat:
        """A²."""
        return self.flow * self.flow

    @cached_property
    def widths(self) -> list[arb]:
        """Weights of a trapezoidal sum."""
        none = self.by.number(_ZERO)
        return [(a + b) / 2 for a, b in pairwise((none, *self.pieces, none))]

    def chord(self, number: int) -> arb:
        """h²/8 of a piece."""
        return self.pieces[number] ** 2 / 8

    def phases(self, rows: arb_mat) -> list[arb_mat]:
        """Rows times e^{Aσ} at the ends of the pieces."""
        return list(accumulate(self.steps, mul, initial=rows))


@dataclass(frozen=True)
class _Response(ABC):
    """Response to an input that enters with b over one segment."""

    segment: _SegmentFlow
    entry: arb_mat

    @cached_property
    def ends(self) -> list[arb_mat]:
        """e^{Aσ}b at the ends of the pieces."""
        return list(accumulate(self.segment.steps, lambda now, step: step * now, initial=self.entry))

    def slope(self, start: arb_mat, piece: int) -> arb_mat:
        """Upper bound of |Ae^{Aσ}x| over a piece that starts with x."""
        return self.segment.within[piece] * absolute(self.segment.flow * start)

    def curvature(self, start: arb_mat, piece: int) -> arb_mat:
        """Upper bound of |A²e^{Aσ}x|."""
        return self.segment.within[piece] * absolute(self.segment.square * start)

    @abstractmethod
    def columns(self, later: arb_mat) -> arb_mat:
        """Response at the end of the segment, mapped by `later`: columns whose absolute values are added.

        The remainder is in `rest`.
        """

    @abstractmethod
    def rest(self, later: arb_mat) -> arb_mat:
        """Bounds of the entries of the remainder."""

    @abstractmethod
    def since_jump(self, rows: arb_mat) -> Iterator[tuple[arb_mat, arb_mat, arb_mat]]:
        """Sums of output rows since the jump at both ends of every piece, and the remainder to add to the larger."""


class _Flowing(_Response):
    """Response to an input that is bounded by 1 at every time."""

    def columns(self, later: arb_mat) -> arb_mat:
        return self.segment.by.scaled(later * self.segment.by.hstack(self.ends), self.segment.widths)

    def rest(self, later: arb_mat) -> arb_mat:
        bends = (self.curvature(self.ends[i], i) * (h**3 / 12) for i, h in enumerate(self.segment.pieces))
        return absolute(absolute(later) * reduce(add, bends))

    def since_jump(self, rows: arb_mat) -> Iterator[tuple[arb_mat, arb_mat, arb_mat]]:
        by = self.segment.by
        area = more = rows * (self.entry * 0)
        heights = [by.modulus(rows * now) for now in self.ends]
        for i, (h, (a, b)) in enumerate(zip(self.segment.pieces, pairwise(heights), strict=True)):
            before, area = area, area + (a + b) * (h / 2)
            if by.proves:
                area = area + absolute(rows) * self.curvature(self.ends[i], i) * h**3 / 12
                more = absolute(rows) * self.slope(self.ends[i], i) * self.segment.chord(i)
            yield before, area, more


class _Sudden(_Response):
    """Response to an input that enters with the jump alone."""

    def columns(self, later: arb_mat) -> arb_mat:
        return later * self.ends[-1]

    def rest(self, later: arb_mat) -> arb_mat:
        return later * self.entry * 0

    def since_jump(self, rows: arb_mat) -> Iterator[tuple[arb_mat, arb_mat, arb_mat]]:
        by = self.segment.by
        for i, (a, b) in enumerate(pairwise(by.modulus(rows * now) for now in self.ends)):
            more = absolute(rows) * self.curvature(self.ends[i], i) * self.segment.chord(i) if by.proves else a
            yield a, b, more


@dataclass(frozen=True)
class _Faded(_Response):
    """Response to a decaying input: `weights` are Ω and Ω′ of every piece."""

    weights: Weights

    def _from(self, start: int) -> list[arb_mat]:
        """b at the start of a piece, then e^{Aσ}b at the ends of that piece and of all later ones."""
        return list(accumulate(self.segment.steps[start:], lambda now, step: step * now, initial=self.entry))

    def columns(self, later: arb_mat) -> arb_mat:
        return hstack([later * self._from(i)[-1] * mass for i, (mass, _) in enumerate(self.weights)])

    def rest(self, later: arb_mat) -> arb_mat:
        """Bounds by slopes, at the end of the segment, of responses to inputs within a piece."""
        moved = (self.slope(self._from(i + 1)[-1], i) * moment for i, (_, moment) in enumerate(self.weights))
        return absolute(absolute(later) * reduce(add, moved))

    def since_jump(self, rows: arb_mat) -> Iterator[tuple[arb_mat, arb_mat, arb_mat]]:
        size = absolute(rows)
        for i, (mass, _) in enumerate(self.weights):
            first, last = (modulus(rows * now) for now in (self.entry, self.segment.steps[i] * self.entry))
            more = (larger(first, last) + self._bend(size, self.entry, i)) * mass
            start = end = rows * (self.entry * 0)
            for p, (passed, moment) in enumerate(self.weights[:i]):
                now, since = self._from(p)[i - p], self._from(p + 1)[i - p - 1]
                start = start + modulus(rows * now) * passed
                end = end + modulus(rows * self.segment.steps[i] * now) * passed
                slopes = self.segment.within[p] * self.slope(since, i)
                more = more + (self._bend(size, now, i) * passed + size * slopes * moment)
            yield start, end, more

    def _bend(self, size: arb_mat, start: arb_mat, piece: int) -> arb_mat:
        return size * self.curvature(start, piece) * self.segment.chord(piece)


@dataclass(frozen=True)
class _Pulsed(_Response):
    """Response to a pulse near a jump, which begins this segment (`here`) or the next one (`ahead`).

    For the proof see `norms`, "Pulses". The larger of the responses to the parts of the pulse before and after the jump
    counts: max(|x|, |y|) = |x + y|/2 + |x − y|/2.
    """

    pulse: Pulse
    here: bool
    ahead: bool

    @cached_property
    def _sides(self) -> tuple[arb_mat, arb_mat]:
        """States after the jump for the parts of the pulse before and after it."""
        number = self.segment.by.number
        return self.segment.jump * self.entry * number(self.pulse.before), self.entry * number(self.pulse.after)

    @cached_property
    def _side_errors(self) -> tuple[arb_mat, arb_mat]:
        """Bounds of the errors of these states."""
        pulse, flow = self.pulse, self.segment.flow
        moved, early, late = flow * self.entry, self._within(pulse.early), self._within(pulse.late)
        shifted = absolute(self.segment.jump) * early * absolute(moved) * ball(pulse.before * pulse.early)
        back = absolute((flow * ball(-pulse.late)).exp() * moved)
        return shifted, late * back * ball(pulse.after * pulse.late)

    def _within(self, time: Fraction) -> arb_mat:
        """Upper bound of |e^{Aσ}|, 0 ≤ σ ≤ time."""
        return absolute((majorant(self.segment.flow) * ball(time)).exp())

    def columns(self, later: arb_mat) -> arb_mat:
        if not self.here:
            return later * (self.entry * 0)
        (before, after), whole = self._sides, self._whole(later)
        return self.segment.by.hstack([whole * (before + after) / 2, whole * (before - after) / 2])

    def _whole(self, later: arb_mat) -> arb_mat:
        return later * reduce(lambda now, step: step * now, self.segment.steps)

    def rest(self, later: arb_mat) -> arb_mat:
        return absolute(absolute(self._whole(later)) * larger(*self._side_errors) if self.here else self.entry * 0)

    def since_jump(self, rows: arb_mat) -> Iterator[tuple[arb_mat, arb_mat, arb_mat]]:
        by, phases, none = self.segment.by, self.segment.phases(rows), rows * (self.entry * 0)
        soon = self._ahead(rows) if by.proves and self.ahead else none
        for i in range(len(self.segment.lengths)):
            start, end, more = none, none, none
            for side in self._sides if self.here else ():
                start, end = (by.larger(v, by.modulus(phases[j] * side)) for v, j in ((start, i), (end, i + 1)))
            for side, off in zip(self._sides, self._side_errors, strict=True) if self.here and by.proves else ():
                bent = absolute(phases[i] * self.segment.square) * self.segment.within[i] * absolute(side)
                far = absolute(phases[i]) * self.segment.within[i] * off  # error anywhere in the piece
                more = larger(more, bent * self.segment.chord(i) + far)
            left = sum(self.segment.lengths[i + 1 :], _ZERO)
            yield start, end, more + soon if left < self.pulse.early else more

    def _ahead(self, rows: arb_mat) -> arb_mat:
        """Outputs for the part of the pulse before the jump that ends the segment, while it lasts."""
        moved = self._within(self.pulse.early) * absolute(self.segment.flow * self.entry)
        height = modulus(rows * self.entry) + absolute(rows) * moved * ball(self.pulse.early)
        return height * ball(self.pulse.before)


def responses(loop: PeriodicLoop, flows: list[_SegmentFlow], name: str) -> list[_Response]:
    """Responses to an input over all segments; an estimate replaces a decaying input by an impulse of its area."""
    by = flows[0].by
    if name in loop.inputs:
        return [_Flowing(flow, by.column(loop.inputs[name])) for flow in flows]
    if name in loop.sampled:
        return _sudden(flows, loop.sampled[name], 0)
    if name in loop.pulses:
        pulse, count = loop.pulses[name], len(flows)
        return [
            _Pulsed(flow, by.column(pulse.entry), pulse, number == pulse.first, (number + 1) % count == pulse.first)
            for number, flow in enumerate(flows)
        ]
    fading = loop.fading[name]
    if not by.proves:
        area = fading.height / fading.rate + fading.floor * loop.period
        return _sudden(flows, tuple(v * area for v in fading.entry), fading.first)
    return [_Faded(flow, column(fading.entry), own) for flow, own in zip(flows, _weights(flows, fading), strict=True)]


def _sudden(flows: list[_SegmentFlow], entry: tuple[Fraction, ...], first: int) -> list[_Response]:
    return [_Sudden(flow, flow.by.column(entry) * int(number == first)) for number, flow in enumerate(flows)]


def _weights(flows: list[_SegmentFlow], fading: Fading) -> list[Weights]:
    """Ω and Ω′ of every piece of every segment."""
    count = len(flows)
    weights, start = [Weights()] * count, _ZERO
    for place in ((fading.first + turn) % count for turn in range(count)):
        for length in flows[place].lengths:
            weights[place] += (_weight(fading, start, length),)
            start += length
    return weights


def _weight(fading: Fading, start: Fraction, length: Fraction) -> tuple[arb, arb]:
    x = fading.rate * start
    height = fading.height / (1 + x + x**2 / 2 + x**3 / 6 + x**4 / 24)
    mass = height * min(1 / fading.rate, length) + fading.floor * length
    moment = height * min(1 / fading.rate**2, length**2 / 2) + fading.floor * length**2 / 2
    return ball(mass), ball(moment)


# ----------------------------------------------------------------------
# The slowest mode of a periodic loop, isolated so that sums need not continue until it has decayed.

MOST_DOUBLINGS = 12


def slowest(flows: list[_SegmentFlow]) -> list[arb]:
    """Row that isolates the slowest mode, if there is one: a row of the map of 2^12 periods.

    It is the row with the largest diagonal entry. These entries do not depend on the units of the states, so a checker
    that takes the same row needs the same number of periods and obtains the same bounds.

    Raises
    ------
    ParameterError
        When the powers of the period map grow.
    """
    period = reduce(lambda now, flow: flow.whole * now, flows[1:], flows[0].whole)
    growth = before = 0.0
    for _ in range(MOST_DOUBLINGS):
        period = period * period
        largest = max(v.abs_upper() for v in period.entries())
        if not largest > 0:
            return [arb(0)] * period.nrows()
        before, growth = growth, 2 * growth + float(largest.log())
        period = (period / largest).mid()
    if not growth < before:
        raise unstable()
    return list(period.tolist()[max(range(period.nrows()), key=lambda i: abs(period[i, i]))])


class _Periods:
    """Ψ of a loop, its powers, and bounds of the states after 2^j periods; each is computed once."""

    def __init__(self, flows: list[_SegmentFlow]) -> None:
        self.by, self.size = flows[0].by, flows[0].jump.nrows()
        self.later = list(accumulate((flow.whole for flow in flows[:0:-1]), mul, initial=self.by.identity(self.size)))
        self.powers = [self.later[-1] * flows[0].whole]
        self.mode = self.by.slowest(self.powers[0]) if self.by.slowest else None
        self.slow = slowest(flows) if self.by.proves else []
        self._seen: dict[int, tuple[arb_mat, arb_mat]] = {}
        self._left: dict[tuple[int, int], tuple[arb_mat, arb_mat]] = {}

    def power(self, number: int) -> arb_mat:
        """Ψ^{2^number}."""
        while len(self.powers) <= number:
            self.powers.append(self.powers[-1] * self.powers[-1])
        return self.powers[number]

    def followed(self, columns: arb_mat, doublings: int) -> arb_mat:
        """Ψᵏ times the columns, for all k < 2^doublings."""
        for number in range(doublings):
            columns = self.by.hstack([columns, self.power(number) * columns])
        return columns

    def seen_alone(self, sums: arb_mat) -> tuple[int, arb_mat]:
        """Index of the dominant state, whose row of W isolates the slowest mode, and W of `norms`."""
        sizes = [(abs(v) * size).mid() for v, size in zip(self.slow, sums.entries(), strict=True)]
        place = sizes.index(max(sizes))
        if place not in self._seen:
            seen, back = identity(self.size), identity(self.size)
            for i, v in enumerate(self.slow):
                if i != place and self.slow[place] != 0:
                    seen[place, i] = (v / self.slow[place]).mid()
                    back[place, i] = -seen[place, i]
            self._seen[place] = seen, back
        return place, self._seen[place][0]

    def left(self, number: int, place: int) -> tuple[arb_mat, arb_mat]:
        """Ψ^KW⁻¹ and D, K = 2^number."""
        if (number, place) not in self._left:
            seen, back = self._seen[place]
            far = self.power(number) * back
            self._left[number, place] = far, absolute(seen * far)
        return self._left[number, place]


def unstable() -> ParameterError:
    """Error for a loop that is not proved to be stable."""
    return ParameterError(
        "the nominal loop must be stable. Received a loop that is not shown to be stable in "
        f"{2**MOST_DOUBLINGS} periods. Change the gains, or shorten T_s."
    )


# ----------------------------------------------------------------------
# Supremum of the free response of a periodic loop from a box of initial states, in ball arithmetic.
#
# **Statement.** Let x′ = Ax between jumps and x(0) = Σ θ_i·s_i with |θ_i| ≤ 1, just before the first jump. Then |cx(t)|
# ≤ g with the g that `free_peaks` returns for the part of the period in which t lies.
#
# **Proof.** Let X have the columns s_i and Ψ be the map of one period, so that |cx(t)| is at most the sum of the
# absolute values of the entries of cΦ(θ)ΨᵏX, at the time θ after the beginning of period k.
#
# - *Between two phases α < β.* ce^{Aσ}y is within (β − α)²/8·max|cA²e^{Aσ}y| of the chord of its ends, for every column
#   y, and the sum of the absolute values of chords is convex. The sum is at most the larger end plus the remainders.
# - *Periods.* Those with k < K = 2^J are computed one by one. Let W be any invertible matrix, m at least the sums of
#   the absolute values of every row of WΨᵏX for all k < K, and D = |WΨᴷW⁻¹|. If Dm ≤ m, these sums are at most m for k
#   < 2K, 3K and so on, that is, for all k, and those of cΦ(θ)ΨᵏX at most |cΦ(θ)ΨᴷW⁻¹|m for all k ≥ K. W is that of
#   `norms`: the isolated slowest mode only has to decrease. All entries of m are raised by 2⁻⁶⁰ of its largest entry,
#   so that none is 0. ∎

Group = tuple[arb_mat, list[arb]]

START = "start"
_FREE_BITS = 128
_FREE_SMALL = Fraction(1, 1 << 10)  # largest share of m left after K periods, without the slowest mode
_FAINT = Fraction(1, 1 << 60)


@lru_cache(maxsize=128)
def free_peaks(loop: PeriodicLoop) -> Mapping[str, tuple[Fraction, ...]]:
    """Bound of every output from all initial states of a loop, rounded up, for each part of the period as in `norms`.

    Raises
    ------
    ParameterError
        When the loop is not proved to be stable within 4096 periods.
    """
    with ctx.workprec(_FREE_BITS):
        return dict(zip(loop.outputs, _upper_rows(LoopResponses(BALLS, loop).free()), strict=True))


def _upper_rows(columns: list[arb_mat]) -> list[tuple[Fraction, ...]]:
    """Rational bounds of the rows of columns side by side."""
    return [tuple(map(upper, row)) for row in hstack(columns).tolist()]


def _followed(periods: _Periods, start: arb_mat) -> list[Group]:
    """ΨᵏX for all k < K, and ΨᴷW⁻¹ with m; K is so large that almost only the slowest mode is left."""
    columns, even = start, [periods.by.number(Fraction(1))] * start.ncols()
    if periods.mode:
        return [(periods.followed(start, periods.mode.doublings), even)]
    for number in range(MOST_DOUBLINGS):
        columns = hstack([columns, periods.power(number) * columns])
        place, seen = periods.seen_alone(_peaks(columns, even))
        peaks = _peaks(seen * columns, even)
        faint = reduce(arb.max, peaks.entries()) * ball(_FAINT)
        most = arb_mat([[(v + faint).abs_upper()] for v in peaks.entries()])
        far, left = periods.left(number + 1, place)
        if not_above(left * most, most) and not_above(left * _but(most, place), most * ball(_FREE_SMALL)):
            return [(columns, even), (far, most.entries())]
    raise unstable()


def _peaks(columns: arb_mat, weights: list[arb]) -> arb_mat:
    return absolute(BALLS.highest(grouped(absolute(columns), weights)))


def _but(column: arb_mat, place: int) -> arb_mat:
    """A column with 0 in one place."""
    copied = arb_mat(column)
    copied[place, 0] = 0
    return copied


# ----------------------------------------------------------------------
# L1 norms of a periodic loop: bounds of every output for an input bounded by 1, in ball arithmetic.
#
# **Statement.** Let x′ = Ax + b·w between jumps, x(0) = 0, and w be measurable with |w| ≤ ŵ on [0, t]. Then |cx(t)| ≤
# g·ŵ with the g that `norms` returns for the part of the period in which t lies.
#
# **Proof.** x(t) = ∫₀ᵗ Φ(t, τ)b·w(τ)dτ, so |cx(t)| ≤ ŵ·∫|cΦ(t, τ)b|dτ over [0, t], which grows when the loop is
# continued periodically to the past and the integral taken over (−∞, t]. That integral is bounded from above in parts:
#
# - *A piece of length h of a flow.* y(σ) = row·e^{Aσ}b is within (σ − α)(β − σ)/2·max|y″| of its chord on [α, β], so
#   ∫|y| ≤ h(|y(α)| + |y(β)|)/2 + h³/12·max|y″|, and |y″| ≤ |row|·|A²e^{Aσ}b| with absolute values entry by entry.
# - *All periods before.* With Ψ the map of one period, N(c) = Σ_k ‖cΨᵏU‖₁; the columns of U are the weighted ends of
#   the pieces of one period, and one column for every entry of the remainders. Terms with k < K = 2^J are summed. Let W
#   be any invertible matrix, y_j that partial sum for its row j, z_j the whole sum and D = |WΨᴷW⁻¹|. Sums over one,
#   two, … blocks of K periods are at most y, y + Dy, …, so y + Dx ≤ x gives z ≤ x and N(c) ≤ partial sum + |cΨᴷW⁻¹|·x.
#   All rows of W but one are unit rows; that one isolates the slowest mode. The remainder of this mode after K periods
#   is counted, so that K need not be large enough for its decay.
# - *Between two phases α < β of the output.* ce^{Aθ} is within (β − α)²/8·max|cA²e^{Aσ}| of the chord of its ends, and
#   N is convex: the sum is at most the larger end plus N of the remainder. The flow since the last jump adds
#   ∫₀^θ|ce^{Aσ}b|dσ, whose derivative has the Lipschitz constant max|cAe^{Aσ}b|: it is within (β − α)²/8 times this
#   constant of its chord. The total is below a chord plus remainders, hence at most the larger of the two ends plus
#   remainders. ∎
#
# **Sampled inputs.** Where Σ j·w_k enters with the jumps at kT and |w_k| ≤ ŵ for every k up to t, |cx(t)| ≤ ŵ·Σ|cΦ(t,
# kT)j|, as above with a sum in place of the integral. A period has one column, e^{Aτ}j, without a remainder. The flow
# since the last jump adds |ce^{Aθ}j|, which is within (β − α)²/8·max|cA²e^{Aσ}j| of its chord.
#
# **Decaying inputs.** Where |w(τ)| ≤ ŵ·ω(τ) with a weight ω of the phase, let Ω ≥ ∫ω and Ω′ ≥ ∫(τ − α)ω over a piece
# that begins at α. There |cΦ(t, τ)b| ≤ |cΦ(t, α)b| + (τ − α)·max|cΦA·b|, so Ω|cΦ(t, α)b| + Ω′·max|…| replaces the
# trapezoidal sum. In the flow since the last jump, a past piece adds Ω|ce^{A(θ − α)}b|, which is within (β −
# α)²/8·Ω·max|cA²e^{Aσ}b| of its chord, and Ω′ times the largest slope; the piece that contains θ adds at most
# Ω·max|ce^{Aσ}b|. Since e^{−x} ≤ 1/(1 + x + x²/2 + x³/6 + x⁴/24) = E(x), the weight he^{−λθ} + f has Ω =
# hE(λα)·min(1/λ, ℓ) + fℓ and Ω′ = hE(λα)·min(1/λ², ℓ²/2) + fℓ²/2 on a piece of length ℓ.
#
# **Pulses.** Let w vanish except from `early` before a jump J to `late` after it. After the jump, an impulse of w at −σ
# or σ has become Je^{Aσ}b or e^{−Aσ}b, within σ·max|JAe^{A·}b| of Jb or σ·max|Ae^{−A·}b| of b. The area of |w|
# before the jump, divided by `before`, plus that after it, divided by `after`, is at most ŵ.
# So both together give at most the larger of the
# responses to `before`·Jb and `after`·b, and of these remainders. With x and y for the two that is |x + y|/2 + |x −
# y|/2: two columns that enter with the jump. Before the jump |c·b| + `early`·max|cAe^{A·}b|, times `before`, is added
# to the outputs of the pieces within `early`.
#
# **Direct feedthrough.** The direct effect of an input of size 1 on an output is added to its gain in every part of the
# period.

_MOST_SUMS = 5 * 10**7  # products for one input: half the limit of the standalone checker
_ROOM = Fraction((1 << 32) + 1, 1 << 32)  # enlargement of a solution of y + Dx = x


def norms(loop: PeriodicLoop) -> dict[tuple[str, str], tuple[Fraction, ...]]:
    """Gains of every (output, input), rounded up, one for each part of the period; the same parts for all.

    A nonzero initial state is one more input, `START`, of size 1. Gains of earlier loops are cached: search, check,
    statement and file of a proof use the same loop.

    Raises
    ------
    ParameterError
        When the nominal loop is not proved to be stable within 4096 periods.
    """
    gains = dict(_norms(replace(loop, start=())))
    return gains | {(output, START): peaks for output, peaks in free_peaks(loop).items()} if loop.start else gains


@lru_cache(maxsize=128)
def _norms(loop: PeriodicLoop) -> dict[tuple[str, str], tuple[Fraction, ...]]:
    with ctx.workprec(_FREE_BITS):
        responses_of, bounds = LoopResponses(BALLS, loop), dict[tuple[str, str], tuple[Fraction, ...]]()
        for name in (*loop.inputs, *loop.sampled, *loop.fading, *loop.pulses):
            peaks = [reduce(add, rest, larger(*ends)) for part in responses_of.sums(name) for *ends, rest in part]
            bounds |= {(y, name): line for y, line in zip(loop.outputs, _upper_rows(peaks), strict=True)}
        return bounds | {key: tuple(v + size for v in bounds[key]) for key, size in loop.feedthrough.items()}


class LoopResponses:
    """Sums of absolute values of the responses of a loop, and its free response, for all outputs at once."""

    def __init__(self, by: Arithmetic, loop: PeriodicLoop) -> None:
        self.by, self.loop, flow = by, loop, by.matrix(loop.flow)
        self.rows = by.matrix(tuple(loop.outputs.values()))
        self.flows = [_SegmentFlow.of(by, flow, part, past=False) for part in loop.segments]
        same = all(by.pieces(part, True) == own.lengths for part, own in zip(loop.segments, self.flows, strict=True))
        self.earlier = self.flows if same else [_SegmentFlow.of(by, flow, part, past=True) for part in loop.segments]
        self.periods = _Periods(self.earlier)
        count, size = self.rows.nrows(), self.rows.ncols()
        self.places = sum(count * (len(part.lengths) + 1) + size for part in self.flows)

    @cached_property
    def _seen(self) -> list[tuple[list[arb_mat], list[arb_mat]]]:
        """Output rows mapped back to the start of each segment and of all earlier ones.

        In a proof, also bounds of their second derivatives.
        """
        by, all_rows = self.by, []
        for number, flow in enumerate(self.flows):
            phases, bends = flow.phases(self.rows), list[arb_mat]()
            rows = by.vstack([*phases, by.identity(self.periods.size)] if by.proves else phases) * flow.jump
            if by.proves:
                pieces = zip(phases, flow.within, strict=False)
                bends = [absolute(phase * flow.square) * within for phase, within in pieces]
            before = (part.whole for part in self.earlier[number - 1 :: -1]) if number else ()
            all_rows.append((list(accumulate(before, mul, initial=rows)), bends))
        return all_rows

    def sums(self, name: str) -> Iterator[list[tuple[arb_mat, arb_mat, tuple[arb_mat, ...]]]]:
        """Sums of an input for every output at both ends of every piece of every segment, and remainders."""
        by, count, size = self.by, self.rows.nrows(), self.periods.size
        parts = responses(self.loop, self.flows, name)
        earlier = parts if self.earlier is self.flows else responses(self.loop, self.earlier, name)
        past = _Past.of(earlier, self.periods, self.places)
        for number, (part, (rows, bends)) in enumerate(zip(parts, self._seen, strict=True)):
            before, result = past.of_rows(rows, number), list[tuple[arb_mat, arb_mat, tuple[arb_mat, ...]]]()
            pieces = len(part.segment.lengths)
            ends = [by.part(before, i * count, (i + 1) * count) for i in range(pieces + 1)]
            units = by.part(before, before.nrows() - size, before.nrows())
            for i, (start, end, more) in enumerate(part.since_jump(self.rows)):
                rest = (more, bends[i] * units * part.segment.chord(i)) if by.proves else ()
                result.append((ends[i] + start, ends[i + 1] + end, rest))
            yield result

    def free(self) -> list[arb_mat]:
        """Largest outputs of the free response from the box: in a proof on every piece, else at all ends of pieces."""
        by, peaks = self.by, []
        groups = _followed(self.periods, by.hstack([by.column(s) for s in self.loop.start]))
        for flow in self.flows:
            phases, parts = flow.phases(self.rows), []
            for columns, weights in groups:
                after = flow.jump * columns
                ends = [by.grouped(by.absolute(phase * after), weights) for phase in phases]
                if by.proves:
                    near = zip(phases[:-1], flow.within, strict=True)
                    bends = (absolute(phase * flow.square) * within * absolute(after) for phase, within in near)
                    rest = (by.grouped(bend * flow.chord(i), weights) for i, bend in enumerate(bends))
                    ends = [larger(*both) + more for both, more in zip(pairwise(ends), rest, strict=True)]
                parts.append([by.highest(end) for end in ends])
            peaks += [reduce(by.larger, both) for both in zip(*parts, strict=True)]
            groups = [(flow.whole * columns, weights) for columns, weights in groups]
        return peaks


@dataclass(frozen=True, slots=True)
class _Past:
    """Inputs before the first jump of a period: columns of K periods, and bounds of all earlier ones."""

    parts: list[_Response]
    columns: arb_mat
    far: arb_mat
    bound: arb_mat

    @classmethod
    def of(cls, parts: list[_Response], periods: _Periods, rows: int) -> "_Past":
        by, size, later = periods.by, periods.size, periods.later[::-1]
        ends = [part.columns(map_) for part, map_ in zip(parts, later, strict=True)]
        if by.proves:
            rests = [part.rest(map_) for part, map_ in zip(parts, later, strict=True)]
            ends.append(_diagonal(reduce(add, rests)))
        columns = by.hstack(ends)
        if mode := periods.mode:
            return cls(
                parts,
                periods.followed(columns, mode.doublings),
                mode.right_eigenvector,
                by.sums(mode.left_eigenvector * columns) * mode.remainder,
            )
        place, seen = periods.seen_alone(row_sums(columns))
        sums = row_sums(seen * columns)
        for number in range(MOST_DOUBLINGS):
            if 2 * columns.ncols() * size * (size + rows) > _MOST_SUMS:
                break
            following = periods.power(number) * columns
            sums = sums + row_sums(seen * following)
            columns = hstack([columns, following])
            far, left = periods.left(number + 1, place)
            if not_above(left * _but(sums, place), sums * ball(_FREE_SMALL)):
                return cls(parts, columns, far, _whole(left, sums))
        raise unstable()

    def of_rows(self, rows: list[arb_mat], segment: int) -> arb_mat:
        """N of rows just before a segment: inputs earlier in this period, and those of all earlier periods.

        `rows` are these rows, mapped back to the start of this segment, then of each earlier one in turn.
        """
        by = self.parts[0].segment.by
        sums = by.sums(rows[-1] * self.columns) + by.absolute(rows[-1] * self.far) * self.bound
        for part, line in zip(self.parts[:segment], rows[-2::-1], strict=True):
            unit = by.identity(line.ncols())
            ends = [part.columns(unit), *([_diagonal(part.rest(unit))] if by.proves else [])]
            sums = by.sums(line * by.hstack(ends)) + sums
        return sums


def _whole(left: arb_mat, sums: arb_mat) -> arb_mat:
    """Some x with y + Dx ≤ x.

    Raises
    ------
    ParameterError
        When the computed x does not satisfy this.
    """
    try:
        solution = absolute((identity(left.nrows()) - left).solve(sums) * ball(_ROOM))
    except ZeroDivisionError:
        raise unstable() from None
    if not not_above(sums + left * solution, solution):
        raise unstable()
    return solution


def _diagonal(column: arb_mat) -> arb_mat:
    """One column for every nonzero entry."""
    nonzero = [i for i, v in enumerate(column.entries()) if not v.is_zero()]
    return arb_mat([[column[i, 0] if i == j else arb(0) for j in nonzero] for i in range(column.nrows())])
