"""Upper bounds of L1 norms and free responses of periodic and continuous linear loops.

All computation is in ball arithmetic, from rational matrices to rational upper bounds. Each chapter
states and proves its bound: continuous loops, one segment of a periodic loop, separation of the slowest
mode, free response, and periodic loops.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, lru_cache, reduce
from itertools import accumulate, chain, pairwise
from operator import add, mul
from typing import Any

from flint import arb, arb_mat, ctx, fmpq

from quakedesign.errors import ParameterError
from quakedesign.exact import end_of
from quakedesign.loop import Fading, PeriodicLoop, Pulse, Segment

# ----------------------------------------------------------------------
# Matrices of balls: rationals go in, upper bounds come out.


def ball(value: Fraction) -> Any:
    """A rational."""
    return arb(fmpq(value.numerator, value.denominator))


def matrix(rows: tuple[tuple[Fraction, ...], ...]) -> Any:
    """A matrix of rationals."""
    return arb_mat([[ball(v) for v in row] for row in rows])


def column(values: tuple[Fraction, ...]) -> Any:
    """One column of rationals."""
    return arb_mat([[ball(v)] for v in values])


def identity(size: int) -> Any:
    """The unit matrix."""
    return arb_mat(size, size, [int(i == j) for i in range(size) for j in range(size)])


def beside(parts: list[Any]) -> Any:
    """Matrices side by side."""
    return arb_mat([list(chain(*rows)) for rows in zip(*(part.tolist() for part in parts), strict=True)])


def majorant(flow: Any) -> Any:
    """M with |e^{Aδ}| ≤ e^{Mh} for 0 ≤ δ ≤ h: |A| off the diagonal, max(A, 0) on it."""
    table = [[v.abs_upper() for v in row] for row in flow.tolist()]
    for i in range(len(table)):
        table[i][i] = arb(0).max(flow[i, i]).abs_upper()
    return arb_mat(table)


def absolute(matrix: Any) -> Any:
    """Upper bounds of the absolute values, exact numbers."""
    return arb_mat([[v.abs_upper() for v in row] for row in matrix.tolist()])


def upper(value: Any) -> Fraction:
    """A rational that is not below a ball."""
    return end_of(value.upper())


# ----------------------------------------------------------------------
# L1 norms of a loop in continuous time: how large an output can get under an input that is bounded by 1.
#
# **Statement.** Let x′ = Ax + b·w, x(0) = 0, and w be measurable with |w| ≤ W on [0, t]. Then |cx(t)| ≤ g·W with the
# g
# that `flow_norms` returns.
#
# **Proof.** |cx(t)| ≤ W·∫₀^∞|ce^{Aσ}b|dσ. Time is cut into stretches of 64 equal pieces, those of every stretch twice
# as
# long as those of the one before, so that fast and slow modes cost the same.
#
# - *A piece of length h from α on.* y(σ) = ce^{Aσ}b is within (σ − α)(α + h − σ)/2·max|y″| of its chord, so its part
#   of
#   the integral is at most h(|y(α)| + |y(α + h)|)/2 + h³/12·max|y″|, and |y″| ≤ |c|·V·|A²e^{Aα}b| for every V ≥
#   |e^{Aδ}|,
#   0 ≤ δ ≤ h, entry by entry. V = e^{Mh} for the first pieces, M = |A| off the diagonal and max(A, 0) on it; if V
#   serves
#   h, then max(V, |e^{Ah}|V) serves 2h.
# - *The rest.* Let S be the sums up to T for c and every unit column e_j in place of b, and S|e^{AT}| ≤ q·S with q <
#   1.
#   Sums over later spans of T are at most q·S, q²·S …, so ∫₀^∞|ce^{Aσ}e_j|dσ ≤ S_j/(1 − q), and what is left out for
#   b
#   is at most S|e^{AT}b|/(1 − q). ∎

_BITS = 256
_HALVINGS = 6  # 2^6 pieces in a stretch
_SMALL = Fraction(1, 1 << 12)  # q
_MOST_STRETCHES = 128
_HUGE = 1 << _BITS  # that only an unstable loop grows to


def flow_norms(loop: PeriodicLoop) -> Mapping[tuple[str, str], tuple[Fraction, ...]]:
    """Gain of every (output, input) of a loop without jumps, rounded up, in a tuple of one: it has no parts.

    Raises
    ------
    ParameterError
        When the nominal loop is not found to be stable.
    """
    with ctx.workprec(_BITS):
        flow, rows = matrix(loop.flow), matrix(tuple(loop.outputs.values()))
        size = flow.nrows()
        state = beside([identity(size), *(column(entry) for entry in loop.inputs.values())])
        sums, state = _sums(flow, rows, state)
        late = absolute(_columns(state, size, state.ncols()))
        rest = _columns(sums, 0, size) * late / (1 - ball(_SMALL))
        return {
            (output, name): (upper(sums[i, size + j] + rest[i, j]),)
            for j, name in enumerate(loop.inputs)
            for i, output in enumerate(loop.outputs)
        }


def _sums(flow: Any, rows: Any, state: Any) -> tuple[Any, Any]:
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
        within = _larger(within, absolute(step) * within)
        step, piece = step * step, 2 * piece
    raise ParameterError(
        "the nominal loop must be stable. Received a loop whose stability is not proved. Change the gains."
    )


def _columns(whole: Any, first: int, end: int) -> Any:
    return arb_mat([row[first:end] for row in whole.tolist()])


def _larger(one: Any, other: Any) -> Any:
    pairs = zip(one.entries(), other.entries(), strict=True)
    return arb_mat(one.nrows(), one.ncols(), [a.max(b) for a, b in pairs])


# ----------------------------------------------------------------------
# What an input of size 1 does over one segment of a periodic loop, in balls; the arguments are those of `norms`.

Weights = tuple[tuple[Any, Any], ...]
_ZERO = Fraction(0)


@dataclass(frozen=True)
class SegmentFlow:
    """One segment: A, J, and h, e^{Ah} and an upper bound of |e^{Aσ}|, 0 ≤ σ ≤ h, for every piece."""

    flow: Any
    jump: Any
    lengths: tuple[Fraction, ...]
    pieces: tuple[Any, ...]
    steps: tuple[Any, ...]
    within: tuple[Any, ...]

    @classmethod
    def of(cls, flow: Any, segment: Segment, *, past: bool) -> "SegmentFlow":
        """Pieces for outputs, or for the past; the bound is e^{Mh} with M = |A|, but max(A, 0) on the diagonal."""
        lengths = segment.pieces(past=past)
        steps = {h: (flow * ball(h)).exp() for h in set(lengths)}
        within = {h: absolute((majorant(flow) * ball(h)).exp()) for h in set(lengths)}
        parts = ((ball(h), steps[h], within[h]) for h in lengths)
        return cls(flow, matrix(segment.jump), lengths, *zip(*parts, strict=True))

    @cached_property
    def whole(self) -> Any:
        """e^{Aτ}J."""
        return reduce(lambda now, step: step * now, self.steps, self.jump)

    @cached_property
    def square(self) -> Any:
        """A²."""
        return self.flow * self.flow

    def chord(self, number: int) -> Any:
        """h²/8 of a piece."""
        return self.pieces[number] ** 2 / 8


@dataclass(frozen=True)
class Response(ABC):
    """Of an input that enters with b over one segment."""

    of: SegmentFlow
    entry: Any

    @cached_property
    def ends(self) -> list[Any]:
        """e^{Aσ}b at the ends of the pieces."""
        return list(accumulate(self.of.steps, lambda now, step: step * now, initial=self.entry))

    def slope(self, start: Any, piece: int) -> Any:
        """Upper bound of |Ae^{Aσ}x| over a piece that starts with x."""
        return self.of.within[piece] * absolute(self.of.flow * start)

    def curvature(self, start: Any, piece: int) -> Any:
        """Upper bound of |A²e^{Aσ}x|."""
        return self.of.within[piece] * absolute(self.of.square * start)

    @abstractmethod
    def columns(self, later: Any) -> tuple[list[Any], Any]:
        """What is left at the end of the segment, mapped by what comes later: summed columns, remainders' entries."""

    @abstractmethod
    def since_jump(self, row: Any) -> Iterator[tuple[Any, Any, Any]]:
        """Of the output row in every piece: sums since the jump at both ends, and what is added to the larger one."""


class Flowing(Response):
    """Of an input that is bounded by 1 at every time."""

    def columns(self, later: Any) -> tuple[list[Any], Any]:
        """See `Response.columns`."""
        widths = [a + b for a, b in pairwise((arb(0), *self.of.pieces, arb(0)))]
        bends = (self.curvature(self.ends[i], i) * (h**3 / 12) for i, h in enumerate(self.of.pieces))
        rest = absolute(later) * reduce(add, bends)
        return [later * now * (width / 2) for now, width in zip(self.ends, widths, strict=True)], absolute(rest)

    def since_jump(self, row: Any) -> Iterator[tuple[Any, Any, Any]]:
        """See `Response.since_jump`."""
        heights, size, area = [abs((row * now)[0, 0]) for now in self.ends], absolute(row), arb(0)
        for i, (h, (a, b)) in enumerate(zip(self.of.pieces, pairwise(heights), strict=True)):
            bend = (size * self.curvature(self.ends[i], i))[0, 0]
            before, area = area, area + (a + b) * h / 2 + bend * h**3 / 12
            yield before, area, (size * self.slope(self.ends[i], i))[0, 0] * self.of.chord(i)


class Sudden(Response):
    """Of an input that enters with the jump alone."""

    def columns(self, later: Any) -> tuple[list[Any], Any]:
        """See `Response.columns`."""
        return [later * self.ends[-1]], column((_ZERO,) * later.nrows())

    def since_jump(self, row: Any) -> Iterator[tuple[Any, Any, Any]]:
        """See `Response.since_jump`."""
        for i, (a, b) in enumerate(pairwise(abs((row * now)[0, 0]) for now in self.ends)):
            yield a, b, (absolute(row) * self.curvature(self.ends[i], i))[0, 0] * self.of.chord(i)


@dataclass(frozen=True)
class Faded(Response):
    """Of an input that fades: `weights` are Ω and Ω′ of every piece."""

    weights: Weights

    def _from(self, start: int) -> list[Any]:
        """e^{Aσ}b from the start of a piece to the end of that piece and of all later ones, from b on."""
        return list(accumulate(self.of.steps[start:], lambda now, step: step * now, initial=self.entry))

    def columns(self, later: Any) -> tuple[list[Any], Any]:
        """See `Response.columns`."""
        ends, moved = [], later * self.entry * 0
        for i, (mass, moment) in enumerate(self.weights):
            # the slope at the end of the segment, of what entered within the piece
            rest = self._from(i + 1)[-1]
            moved += self.slope(rest, i) * moment
            ends.append(later * self._from(i)[-1] * mass)
        return ends, absolute(absolute(later) * moved)

    def since_jump(self, row: Any) -> Iterator[tuple[Any, Any, Any]]:
        """See `Response.since_jump`."""
        size = absolute(row)
        for i, (mass, _) in enumerate(self.weights):
            first, last = (abs((row * now)[0, 0]) for now in (self.entry, self.of.steps[i] * self.entry))
            start, end, more = arb(0), arb(0), mass * (first.max(last) + self._bend(size, self.entry, i))
            for p, (passed, moment) in enumerate(self.weights[:i]):
                now, since = self._from(p)[i - p], self._from(p + 1)[i - p - 1]
                start += passed * abs((row * now)[0, 0])
                end += passed * abs((row * self.of.steps[i] * now)[0, 0])
                slopes = self.of.within[p] * self.slope(since, i)
                more += passed * self._bend(size, now, i) + moment * (size * slopes)[0, 0]
            yield start, end, more

    def _bend(self, size: Any, start: Any, piece: int) -> Any:
        return (size * self.curvature(start, piece))[0, 0] * self.of.chord(piece)


@dataclass(frozen=True)
class Pulsed(Response):
    """Of an input that is there near a jump: `here` that of the segment itself, `ahead` that of the next one.

    e^{A(τ − σ)}b is within σ·|A·…| of e^{Aτ}b. Of what is before and after the jump one is larger, and max(|x|, |y|) =
    |x + y|/2 + |x − y|/2.
    """

    pulse: Pulse
    here: bool
    ahead: bool

    @cached_property
    def _sides(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        """After the jump, for what is before and after it: b with its share, and by how much it is off, at most."""
        pulse, flow = self.pulse, self.of.flow
        moved, early, late = flow * self.entry, self._within(pulse.early), self._within(pulse.late)
        before = self.of.jump * self.entry * ball(pulse.before)
        shifted = absolute(self.of.jump) * early * absolute(moved) * ball(pulse.before * pulse.early)
        back = absolute((flow * ball(-pulse.late)).exp() * moved)
        after = self.entry * ball(pulse.after)
        return (before, shifted), (after, late * back * ball(pulse.after * pulse.late))

    def _within(self, time: Fraction) -> Any:
        """Upper bound of |e^{Aσ}|, 0 ≤ σ ≤ time."""
        return absolute((majorant(self.of.flow) * ball(time)).exp())

    def columns(self, later: Any) -> tuple[list[Any], Any]:
        """See `Response.columns`."""
        none = self.entry * 0
        if not self.here:
            return [later * none], absolute(none)
        (before, off), (after, far) = self._sides
        whole = later * reduce(lambda now, step: step * now, self.of.steps)
        rest = absolute(whole) * _larger_response(off, far)
        return [whole * (before + after) / 2, whole * (before - after) / 2], absolute(rest)

    def since_jump(self, row: Any) -> Iterator[tuple[Any, Any, Any]]:
        """See `Response.since_jump`."""
        phases = list(accumulate(self.of.steps, lambda now, step: now * step, initial=row))
        soon = self._ahead(row)
        for i in range(len(self.of.lengths)):
            start, end, more = arb(0), arb(0), arb(0)
            if self.here:
                for side, off in self._sides:
                    ends = [abs((phase * side)[0, 0]) for phase in phases[i : i + 2]]
                    start, end = start.max(ends[0]), end.max(ends[1])
                    bent = (absolute(phases[i] * self.of.square) * self.of.within[i] * absolute(side))[0, 0]
                    # what it is off by, anywhere in the piece
                    far = (absolute(phases[i]) * self.of.within[i] * off)[0, 0]
                    more = more.max(bent * self.of.chord(i) + far)
            left = sum(self.of.lengths[i + 1 :], _ZERO)
            yield start, end, more + (soon if self.ahead and left < self.pulse.early else 0)

    def _ahead(self, row: Any) -> Any:
        """Of the pulse before the jump that ends the segment, as long as it is there."""
        moved = self._within(self.pulse.early) * absolute(self.of.flow * self.entry)
        height = abs((row * self.entry)[0, 0]) + (absolute(row) * moved)[0, 0] * ball(self.pulse.early)
        return height * ball(self.pulse.before)


def _larger_response(one: Any, other: Any) -> Any:
    """Entry by entry, of columns."""
    return arb_mat([[a.max(b)] for a, b in zip(one.entries(), other.entries(), strict=True)])


def responses(loop: PeriodicLoop, flows: list[SegmentFlow], name: str) -> list[Response]:
    """Of an input, over all segments."""
    if name in loop.inputs:
        return [Flowing(flow, column(loop.inputs[name])) for flow in flows]
    if name in loop.sampled:
        entry = column(loop.sampled[name])
        return [Sudden(flow, entry * (not number)) for number, flow in enumerate(flows)]
    if name in loop.pulses:
        pulse, count = loop.pulses[name], len(flows)
        return [
            Pulsed(flow, column(pulse.entry), pulse, number == pulse.first, (number + 1) % count == pulse.first)
            for number, flow in enumerate(flows)
        ]
    fading = loop.fading[name]
    entry = column(fading.entry)
    return [Faded(flow, entry, own) for flow, own in zip(flows, _weights(flows, fading), strict=True)]


def _weights(flows: list[SegmentFlow], fading: Fading) -> list[Weights]:
    """Ω and Ω′ of every piece of every segment."""
    count = len(flows)
    weights, start = [Weights()] * count, _ZERO
    for place in ((fading.first + turn) % count for turn in range(count)):
        for length in flows[place].lengths:
            weights[place] += (_weight(fading, start, length),)
            start += length
    return weights


def _weight(fading: Fading, start: Fraction, length: Fraction) -> tuple[Any, Any]:
    x = fading.rate * start
    height = fading.height / (1 + x + x**2 / 2 + x**3 / 6 + x**4 / 24)
    mass = height * min(1 / fading.rate, length) + fading.floor * length
    moment = height * min(1 / fading.rate**2, length**2 / 2) + fading.floor * length**2 / 2
    return ball(mass), ball(moment)


# ----------------------------------------------------------------------
# The slowest mode of a periodic loop, seen alone, so that nothing else has to be followed until it is gone.

MOST_DOUBLINGS = 12


def slowest(flows: list[SegmentFlow]) -> list[Any]:
    """What the slowest mode is seen along, if there is one: a row of what is left of all states after 2^12 periods.

    That with the largest entry on the diagonal, which is the same in all units of the states: whoever else takes it
    looks back as far, and finds the same bounds.

    Raises
    ------
    ParameterError
        When that is more than there was.
    """
    period = reduce(lambda now, flow: flow.whole * now, flows[1:], flows[0].whole)
    growth = before = 0.0
    for _ in range(MOST_DOUBLINGS):
        period = period * period
        largest = max(v.abs_upper() for v in period.entries())
        if not largest > 0:
            return [arb(0)] * period.nrows()
        before, growth = growth, 2 * growth + float(largest.log())
        period = arb_mat([[(v / largest).mid() for v in row] for row in period.tolist()])
    if not growth < before:
        raise unstable()
    return list(period.tolist()[max(range(period.nrows()), key=lambda i: abs(period[i, i]))])


def seen_alone(row: list[Any], sums: list[Any]) -> tuple[int, Any, Any]:
    """W of `norms`, its inverse, and which of its rows, that of the state that counts most, is the given one."""
    seen, back = identity(len(row)), identity(len(row))
    place = max(range(len(row)), key=lambda i: (abs(row[i]) * sums[i]).mid())
    for i, v in enumerate(row):
        if i != place and row[place] != 0:
            seen[place, i] = (v / row[place]).mid()
            back[place, i] = -seen[place, i]
    return place, seen, back


def unstable() -> ParameterError:
    """What is said of a loop that is not seen to be stable."""
    return ParameterError(
        f"the nominal loop must be stable. Received one that is not seen to be in {2**MOST_DOUBLINGS} periods. "
        "Change the gains, or shorten T_s."
    )


# ----------------------------------------------------------------------
# How far a start away from 0 takes a periodic loop without inputs: the sup of its free response, in ball arithmetic.
#
# **Statement.** Let x′ = Ax between jumps and x(0) = Σ θ_i·s_i with |θ_i| ≤ 1, just before the first jump. Then |cx(t)|
# ≤ g with the g that `free_peaks` returns for the part of the period in which t lies.
#
# **Proof.** Let X have the columns s_i and Ψ be the map of one period, so that |cx(t)| is at most the sum of the
# absolute
# values of the entries of cΦ(θ)ΨᵏX, θ after the beginning of period k.
#
# - *Between two phases α < β.* ce^{Aσ}y is within (β − α)²/8·max|cA²e^{Aσ}y| of the chord of its ends, for every
#   column
#   y, and the sum of the absolute values of chords is convex: at most the larger of both ends plus the remainders.
# - *Periods.* Those with k < K = 2^J are looked at one by one. Let W be any invertible matrix, m at least the sums of
#   the
#   absolute values of every row of WΨᵏX for all k < K, and D = |WΨᴷW⁻¹|. If Dm ≤ m, these sums are at most m for k <
#   2K,
#   3K and so on, that is, for all k, and those of cΦ(θ)ΨᵏX at most |cΦ(θ)ΨᴷW⁻¹|m for all k ≥ K. W is that of `norms`:
#   the slowest mode, seen alone, only has to fall. All of m is raised by 2⁻⁶⁰ of its largest entry, so that none is
#   0. ∎

Group = tuple[Any, list[Any]]

START = "start"
_FREE_BITS = 128
_FREE_SMALL = Fraction(1, 1 << 10)  # share of m that is left of it after K periods, but for the slowest mode
_FAINT = Fraction(1, 1 << 60)


@lru_cache(maxsize=128)
def free_peaks(loop: PeriodicLoop) -> Mapping[str, tuple[Fraction, ...]]:
    """Bound of every output from every start of a loop, rounded up, one for each part of the period, as in `norms`.

    Raises
    ------
    ParameterError
        When the loop is not found to be stable within 4096 periods.
    """
    with ctx.workprec(_FREE_BITS):
        generator, rows = matrix(loop.flow), matrix(tuple(loop.outputs.values()))
        flows = [SegmentFlow.of(generator, part, past=False) for part in loop.segments]
        groups = _followed(flows, beside([column(s) for s in loop.start]))
        largest: list[list[Any]] = [[] for _ in loop.outputs]
        for flow in flows:
            for parts in zip(*(_pieces(flow, rows, *group) for group in groups), strict=True):
                for peaks, bounds in zip(largest, zip(*parts, strict=True), strict=True):
                    peaks.append(reduce(arb.max, bounds))
            groups = [(flow.whole * columns, weights) for columns, weights in groups]
        return {output: tuple(map(upper, peaks)) for output, peaks in zip(loop.outputs, largest, strict=True)}


def _followed(flows: list[SegmentFlow], start: Any) -> list[Group]:
    """ΨᵏX for all k < K, and ΨᴷW⁻¹ with m; K is so large that little is left but the slowest mode."""
    even = [arb(1)] * start.ncols()
    columns, power = start, reduce(lambda now, flow: flow.whole * now, flows, identity(start.nrows()))
    slow = slowest(flows)
    for _ in range(MOST_DOUBLINGS):
        columns, power = beside([columns, power * columns]), power * power
        place, seen, back = seen_alone(slow, _peaks(absolute(columns), even))
        most = [v.abs_upper() for v in _peaks(absolute(seen * columns), even)]
        most = [(v + max(most) * ball(_FAINT)).abs_upper() for v in most]
        far = power * back
        left = absolute(seen * far)
        quick = [v * (i != place) for i, v in enumerate(most)]
        if _after(left, most, most, Fraction(1)) and _after(left, quick, most, _FREE_SMALL):
            return [(columns, even), (far, most)]
    raise unstable()


def _after(left: Any, now: list[Any], most: list[Any], share: Fraction) -> bool:
    """Whether what a map leaves is at most a share."""
    later = (left * arb_mat([[v] for v in now])).entries()
    return all(a <= b * ball(share) for a, b in zip(later, most, strict=True))


def _peaks(sizes: Any, weights: list[Any]) -> list[Any]:
    """Of every row, the largest weighted sum of a group of columns, as many as there are weights."""
    return [reduce(arb.max, _free_sums(row, weights)) for row in sizes.tolist()]


def _free_sums(row: list[Any], weights: list[Any]) -> list[Any]:
    groups = (row[i : i + len(weights)] for i in range(0, len(row), len(weights)))
    return [sum((v * w for v, w in zip(group, weights, strict=True)), arb(0)) for group in groups]


def _pieces(flow: SegmentFlow, rows: Any, columns: Any, weights: list[Any]) -> Iterator[list[Any]]:
    """Bound of every output in every piece, from groups of columns just before the jump."""
    phases, columns = list(accumulate(flow.steps, mul, initial=rows)), flow.jump * columns
    ends = [absolute(phase * columns) for phase in phases]
    for i, phase in enumerate(phases[:-1]):
        bends = absolute(phase * flow.square) * flow.within[i] * absolute(columns) * flow.chord(i)
        by_row = zip(ends[i].tolist(), ends[i + 1].tolist(), bends.tolist(), strict=True)
        yield [
            reduce(
                arb.max, (a.max(b) + more for a, b, more in zip(*(_free_sums(v, weights) for v in line), strict=True))
            )
            for line in by_row
        ]


# ----------------------------------------------------------------------
# L1 norms of a periodic loop: how large an output can get under an input that is bounded by 1, in ball arithmetic.
#
# **Statement.** Let x′ = Ax + b·w between jumps, x(0) = 0, and w be measurable with |w| ≤ W on [0, t]. Then |cx(t)| ≤
# g·W with the g that `norms` returns for the part of the period in which t lies.
#
# **Proof.** x(t) = ∫₀ᵗ Φ(t, τ)b·w(τ)dτ, so |cx(t)| ≤ W·∫|cΦ(t, τ)b|dτ over [0, t], which grows when the loop is
# continued periodically to the past and the integral taken over (−∞, t]. That integral is bounded from above in
# parts:
#
# - *A piece of length h of a flow.* y(σ) = row·e^{Aσ}b is within (σ − α)(β − σ)/2·max|y″| of its chord on [α, β], so
#   ∫|y| ≤ h(|y(α)| + |y(β)|)/2 + h³/12·max|y″|, and |y″| ≤ |row|·|A²e^{Aσ}b| with absolute values entry by entry.
# - *All periods before.* With Ψ the map of one period, N(c) = Σ_k ‖cΨᵏU‖₁; the columns U are the ends of the pieces
#   of
#   one period, weighted, and one column for every entry of the remainders. Terms up to k < K = 2^J are summed. Let W
#   be
#   any invertible matrix, y_j that sum for its row j, z_j the whole one and D = |WΨᴷW⁻¹|. Sums over one block of K
#   periods, two and so on are at most y, y + Dy, …, so if y + Dx ≤ x, then z ≤ x, and N(c) ≤ partial sum +
#   |cΨᴷW⁻¹|·x.
#   Rows of W are unit rows but for one, along which the slowest mode is seen alone: what is left of
#   that mode after K periods counts as it is, and K need not outlast it.
# - *Between two phases α < β of the output.* ce^{Aθ} is within (β − α)²/8·max|cA²e^{Aσ}| of the chord of its ends,
#   and N
#   is convex: at most the larger end and N of the remainder. The flow since the last jump adds ∫₀^θ|ce^{Aσ}b|dσ,
#   whose
#   derivative has the Lipschitz constant max|cAe^{Aσ}b|: it is within (β − α)²/8 times that of its chord. Both
#   together
#   are below a chord plus remainders, hence at most the larger of the two ends plus remainders. ∎
#
# **Sampled inputs.** Where Σ j·w_k enters with the jumps at kT and |w_k| ≤ W for every k up to t, |cx(t)| ≤ W·Σ|cΦ(t,
# kT)j|: the same with a sum in place of the integral. A period has the one column e^{Aτ}j without a remainder, the flow
# since the last jump adds |ce^{Aθ}j|, which is within (β − α)²/8·max|cA²e^{Aσ}j| of its chord.
#
# **Fading inputs.** Where |w(τ)| ≤ W·ω(τ) with a weight ω of the phase, let Ω ≥ ∫ω and Ω′ ≥ ∫(τ − α)ω over a piece that
# begins at α. There |cΦ(t, τ)b| ≤ |cΦ(t, α)b| + (τ − α)·max|cΦA·b|, so Ω|cΦ(t, α)b| + Ω′·max|…| stands in place of the
# trapezoidal sum. Of the flow since the last jump, a piece that has passed adds Ω|ce^{A(θ − α)}b|, which is within (β −
# α)²/8·Ω·max|cA²e^{Aσ}b| of its chord, and Ω′ times the largest slope; the piece in which θ lies adds at most
# Ω·max|ce^{Aσ}b|. Since e^{−x} ≤ 1/(1 + x + x²/2 + x³/6 + x⁴/24) = E(x), the weight he^{−λθ} + f has Ω =
# hE(λα)·min(1/λ, ℓ) + fℓ and Ω′ = hE(λα)·min(1/λ², ℓ²/2) + fℓ²/2 on a piece of length ℓ.
#
# **Pulses.** Where w is there from `early` before a jump J to `late` after it, an impulse of it at −σ or σ has become
# Je^{Aσ}b or e^{−Aσ}b, after the jump, within σ·max|JAe^{A·}b| of Jb or σ·max|Ae^{−A·}b| of b. As the area before the
# jump, over `before`, and that after it, over `after`, are W in all, what comes of both is at most the larger of what
# `before`·Jb and `after`·b become, and of these remainders. With x and y for the two that is |x + y|/2 + |x − y|/2: two
# columns that enter with the jump. Before the jump |c·b| + `early`·max|cAe^{A·}b|, times `before`, is added to the
# outputs of the pieces that `early` reaches.
#
# **At once.** What an input of size 1 adds to an output at the same instant is added to the gain, whatever its
# weight.

_MOST_SUMS = 5 * 10**7  # products for one input: half of what the standalone checker takes before it gives up
_ROOM = Fraction((1 << 32) + 1, 1 << 32)  # for sums that are solved for to bound themselves


def norms(loop: PeriodicLoop) -> dict[tuple[str, str], tuple[Fraction, ...]]:
    """Gains of every (output, input), rounded up, one for each part of the period; the same parts for all.

    A start that is not 0 is one input more, `free_response.START`, of size 1. Gains of loops that came before are
    remembered: a proof is found, checked, told and written of one loop.

    Raises
    ------
    ParameterError
        When the nominal loop is not found to be stable within 4096 periods.
    """
    gains = dict(_norms(replace(loop, start=())))
    return gains | {(output, START): peaks for output, peaks in free_peaks(loop).items()} if loop.start else gains


@lru_cache(maxsize=128)
def _norms(loop: PeriodicLoop) -> dict[tuple[str, str], tuple[Fraction, ...]]:
    with ctx.workprec(_FREE_BITS):
        flow = matrix(loop.flow)
        rows = matrix(tuple(loop.outputs.values()))
        bounds: dict[tuple[str, str], tuple[Fraction, ...]] = {}
        flows, earlier = ([SegmentFlow.of(flow, part, past=past) for part in loop.segments] for past in (False, True))
        slow = slowest(earlier)
        places = sum(rows.nrows() * (len(part.lengths) + 1) + rows.ncols() for part in flows)
        for name in (*loop.inputs, *loop.sampled, *loop.fading, *loop.pulses):
            gains = _gains(responses(loop, flows, name), _Past.of(responses(loop, earlier, name), slow, places), rows)
            bounds |= {
                (output, name): tuple(map(upper, worst)) for output, worst in zip(loop.outputs, gains, strict=True)
            }
        return bounds | {key: tuple(v + size for v in bounds[key]) for key, size in loop.at_once.items()}


@dataclass(frozen=True, slots=True)
class _Past:
    """Everything before the first jump of a period: columns of K periods, and what bounds the rest."""

    parts: list[Response]
    columns: Any
    far: Any
    bound: Any

    @classmethod
    def of(cls, parts: list[Response], slow: list[Any], rows: int) -> "_Past":
        size = parts[0].of.jump.nrows()
        later, ends, rest = identity(size), list[Any](), arb_mat(size, 1)
        for part in reversed(parts):
            own, remainder = part.columns(later)
            ends, rest, later = [*own, *ends], rest + remainder, later * part.of.whole
        return cls._summed(parts, later, beside([*ends, _diagonal(rest)]), slow, rows)

    @classmethod
    def _summed(cls, parts: list[Response], period: Any, columns: Any, slow: list[Any], rows: int) -> "_Past":
        size = period.nrows()
        place, seen, back = seen_alone(slow, _row_sums(columns))
        sums = _row_sums(seen * columns)
        for _ in range(MOST_DOUBLINGS):
            if 2 * columns.ncols() * size * (size + rows) > _MOST_SUMS:
                break
            following = period * columns
            sums = [a + b for a, b in zip(sums, _row_sums(seen * following), strict=True)]
            columns, period = beside([columns, following]), period * period
            far = period * back
            left = absolute(seen * far)
            quick = _as_column([v * (i != place) for i, v in enumerate(sums)])
            shares = zip((left * quick).entries(), sums, strict=True)
            if all(a == 0 or a / b < ball(_FREE_SMALL) for a, b in shares):
                return cls(parts, columns, far, _whole(left, sums))
        raise unstable()

    def of_rows(self, rows: Any, segment: int) -> list[Any]:
        """N of every row that acts just before a segment: those before it in this period, and all that is earlier."""
        if segment == 0:
            near, far = _row_sums(rows * self.columns), absolute(rows * self.far) * self.bound
            return [a + b for a, b in zip(near, far.entries(), strict=True)]
        before = self.parts[segment - 1]
        ends, rest = before.columns(identity(rows.ncols()))
        own = _row_sums(rows * beside([*ends, _diagonal(rest)]))
        return [a + b for a, b in zip(own, self.of_rows(rows * before.of.whole, segment - 1), strict=True)]


def _whole(left: Any, sums: list[Any]) -> Any:
    """Some x with y + Dx ≤ x.

    Raises
    ------
    ParameterError
        When the one that is tried is none.
    """
    own, size = _as_column(sums), len(sums)
    try:
        solution = absolute((identity(size) - left).solve(own) * ball(_ROOM))
    except ZeroDivisionError:
        raise unstable() from None
    bounded = zip(own.entries(), (left * solution).entries(), solution.entries(), strict=True)
    if not all(y + far <= x for y, far, x in bounded):
        raise unstable()
    return solution


def _gains(parts: list[Response], past: _Past, outputs: Any) -> list[list[Any]]:
    """Bounds for every output, on every piece of every segment."""
    size, count = outputs.ncols(), outputs.nrows()
    gains: list[list[Any]] = [[] for _ in range(count)]
    for number, part in enumerate(parts):
        flow = part.of
        phases = list(accumulate(flow.steps, mul, initial=outputs))
        rows = _above([*phases, identity(size)]) * flow.jump
        before = past.of_rows(rows, number)
        units = _as_column(before[-size:])
        for k in range(count):
            row = arb_mat([outputs.tolist()[k]])
            for i, (start, end, more) in enumerate(part.since_jump(row)):
                bent = (absolute(phases[i] * flow.square) * flow.within[i] * units)[k, 0]
                larger = (before[i * count + k] + start).max(before[(i + 1) * count + k] + end)
                gains[k].append(larger + more + bent * flow.chord(i))
    return gains


def _as_column(values: list[Any]) -> Any:
    return arb_mat([[v] for v in values])


def _diagonal(column: Any) -> Any:
    """One column for every entry that is not zero."""
    nonzero = [i for i, v in enumerate(column.entries()) if not v.is_zero()]
    return arb_mat([[column[i, 0] if i == j else arb(0) for j in nonzero] for i in range(column.nrows())])


def _above(parts: list[Any]) -> Any:
    return arb_mat([list(row) for part in parts for row in part.tolist()])


def _row_sums(matrix: Any) -> list[Any]:
    return [sum(map(abs, row), arb(0)) for row in matrix.tolist()]
