"""Whether an expression stays below a limit on a box, decided by subdivision in interval arithmetic."""

import heapq
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import count

import sympy as sp

from quakedesign.symbolic.intervals import Box, End, Interval, add, interval, negative, regular, times
from quakedesign.symbolic.signed_power import SignedPower, slope_off_kinks

PIECES = 600
FURTHEST = 10**60  # beyond it a half-line is not halved any more


@dataclass(frozen=True)
class Excess:
    """Where a limit is exceeded.

    Attributes
    ----------
    at : mapping of Symbol to Fraction
    value : Fraction
        A rigorous lower bound of the expression there.
    """

    at: dict[sp.Symbol, Fraction]
    value: Fraction


@dataclass(frozen=True)
class Undecided:
    """What subdivision did not decide.

    Attributes
    ----------
    where : Box
        The box with the largest enclosure that is left.
    """

    where: Box


def upper_limit(expression: sp.Expr, box: Box, limit: Fraction, slack: Fraction) -> Fraction | Excess | Undecided:
    """Smallest proved upper bound of an expression on a box that is not below a limit, if it is at most limit + slack.

    Parameters
    ----------
    expression : Expr
        As in `quakedesign.symbolic.intervals.interval`.
    box : mapping of Symbol to (low, high)
        May be unbounded.
    limit : Fraction
        Returned itself where the expression does not exceed it.
    slack : Fraction
        How far an enclosure may exceed the limit where it cannot be sharpened.

    Returns
    -------
    Fraction, Excess or Undecided
        `Excess` with a point at which the expression exceeds limit + slack.

    Raises
    ------
    UnsupportedError
        For a function without an enclosure.
    """
    form, order, found = _Form(sp.sympify(expression)), count(), limit
    heap: list[tuple[End, int, Box]] = []

    def push(part: Box) -> None:
        heapq.heappush(heap, (-form.highest(part), next(order), part))

    push({symbol: ends for symbol, ends in box.items() if symbol in form.expression.free_symbols})
    for _ in range(PIECES):
        top = -heap[0][0]
        if top <= limit + slack:
            return max(found, Fraction(top))
        part = heapq.heappop(heap)[2]
        risen = form.risen(part)
        for point in (_centre(risen), _centre(part)):  # a face may lie on a kink, where less is known than beside it
            low, _ = interval(form.expression, {symbol: (x, x) for symbol, x in point.items()})
            if low > limit + slack:
                return Excess(at=point, value=Fraction(low))
        if any(abs(x) > FURTHEST for x in _centre(risen).values()):
            return Undecided(risen)
        for half in form.halves(risen):
            push(half)
    return Undecided(heap[0][2])


@dataclass(frozen=True)
class _Form:
    """An expression with its derivatives."""

    expression: sp.Expr

    @cached_property
    def slopes(self) -> dict[sp.Symbol, sp.Expr]:
        return {
            x: sp.factor_terms(slope_off_kinks(self.expression, x))
            for x in sorted(self.expression.free_symbols, key=str)
        }

    @cached_property
    def jumps(self) -> bool:
        return bool(self.expression.has(sp.Heaviside, sp.sign, SignedPower))

    def slope(self, symbol: sp.Symbol, box: Box) -> Interval:
        return interval(self.slopes[symbol], box)

    def highest(self, box: Box) -> End:
        """The lower of the upper ends of the plain enclosure and, on a bounded box, of the mean-value form."""
        high = interval(self.expression, box)[1]
        if any(isinstance(end, float) for ends in box.values() for end in ends) or not regular(self.expression, box):
            return high
        point = {symbol: (x, x) for symbol, x in _centre(box).items()}
        mean = interval(self.expression, point)
        for symbol, ends in box.items():
            if ends[0] != ends[1]:
                mean = add(mean, times(self.slope(symbol, box), add(ends, negative(point[symbol]))))
        return min(high, mean[1])

    def risen(self, box: Box) -> Box:
        """The face of a box on which the expression is largest, as far as the signs of its derivatives tell.

        Where the expression has jumps, the half beside that face, so that the side of the jump stays known.
        """
        if not regular(self.expression, box):
            return box
        risen = dict(box)
        for symbol, (low, high) in box.items():
            falls, rises = self.slope(symbol, risen)
            end = low if rises <= 0 else high if falls >= 0 else None
            if end is not None and not isinstance(end, float):
                inner = _middle((low, high)) if self.jumps else end
                risen[symbol] = (min(inner, end), max(inner, end))
        return risen

    def halves(self, box: Box) -> list[Box]:
        """Both halves of a box, across the side whose halves have the smaller largest enclosure."""
        splits = [list(_halves(box, symbol)) for symbol, (low, high) in box.items() if low != high]
        return min(splits, key=lambda parts: max(map(self.highest, parts)), default=[box])


def _halves(box: Box, symbol: sp.Symbol) -> Iterator[Box]:
    low, high = box[symbol]
    middle = _middle((low, high))
    yield {**box, symbol: (low, middle)}
    yield {**box, symbol: (middle, high)}


def _centre(box: Box) -> dict[sp.Symbol, Fraction]:
    return {symbol: _middle(ends) for symbol, ends in box.items()}


def _middle(ends: Interval) -> Fraction:
    """A rational inside an interval: its middle, or twice as far out as its only end."""
    low, high = ends
    if isinstance(low, float):
        return Fraction(0) if isinstance(high, float) or high > 0 else min(Fraction(-1), Fraction(2 * high))
    if isinstance(high, float):
        return Fraction(0) if low < 0 else max(Fraction(1), Fraction(2 * low))
    return (low + high) / 2
