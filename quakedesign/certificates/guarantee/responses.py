"""What an input of size 1 does over one segment of a periodic loop, in balls; the arguments are those of `norms`."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, reduce
from itertools import accumulate, pairwise
from operator import add
from typing import Any

from flint import arb

from quakedesign.certificates.guarantee.ball_matrices import absolute, ball, column, majorant, matrix
from quakedesign.loop import Fading, PeriodicLoop, Segment

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


def responses(loop: PeriodicLoop, flows: list[Flow], name: str) -> list[Response]:
    """Of an input, over all segments."""
    if name in loop.inputs:
        return [Flowing(flow, column(loop.inputs[name])) for flow in flows]
    if name in loop.sampled:
        entry = column(loop.sampled[name])
        return [Sudden(flow, entry * (not number)) for number, flow in enumerate(flows)]
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
