"""What an input of size 1 does over one segment of a periodic loop, in balls; the arguments are those of `norms`."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, reduce
from itertools import accumulate, pairwise
from operator import add
from typing import Any

from flint import arb, arb_mat

from quakedesign.certificates.guarantee.ball_matrices import absolute, ball, column, majorant, matrix
from quakedesign.loop import Fading, PeriodicLoop, Pulse, Segment

Weights = tuple[tuple[Any, Any], ...]
_ZERO = Fraction(0)


@dataclass(frozen=True)
class Flow:
    """One segment: A, J, and h, e^{Ah} and an upper bound of |e^{Aσ}|, 0 ≤ σ ≤ h, for every piece."""

    flow: Any
    jump: Any
    lengths: tuple[Fraction, ...]
    pieces: tuple[Any, ...]
    steps: tuple[Any, ...]
    within: tuple[Any, ...]

    @classmethod
    def of(cls, flow: Any, segment: Segment, *, past: bool) -> "Flow":
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

    of: Flow
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
        rest = absolute(whole) * _larger(off, far)
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


def _larger(one: Any, other: Any) -> Any:
    """Entry by entry, of columns."""
    return arb_mat([[a.max(b)] for a, b in zip(one.entries(), other.entries(), strict=True)])


def responses(loop: PeriodicLoop, flows: list[Flow], name: str) -> list[Response]:
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


def _weights(flows: list[Flow], fading: Fading) -> list[Weights]:
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
