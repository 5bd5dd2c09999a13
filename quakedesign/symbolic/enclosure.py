"""Rigorous enclosures of SymPy expressions over boxes, and proofs of upper limits.

Interval arithmetic with rational ends over boxes that may be unbounded: rational operations are exact, all others are
rounded outwards. The module also contains ball arithmetic (python-flint), and proofs by subdivision of the box that an
expression stays below a limit.
"""

import heapq
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, lru_cache, partial, reduce
from itertools import count
from math import inf
from operator import mul
from typing import Any, NoReturn

import flint
import sympy as sp
from flint import arb, fmpq

from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.exact import end_of, fraction_of, fraction_of_float, rational
from quakedesign.symbolic.signed_power import AbsolutePower, SignedPower, slope_off_kinks

# ----------------------------------------------------------------------
# Rigorous enclosures of SymPy expressions over boxes that may be unbounded, with exact rational ends.
#
# Rational operations are exact, so that an attained bound has no rounding error; python-flint rounds the others
# outwards to `_BITS` bits. At a jump of `Heaviside` or `sign`, from derivatives of Max, Min and Abs, the enclosure
# contains every value between both sides; if the box only touches the jump, only the value on its own side.

End = Fraction | float  # the only floats are −inf and inf
Interval = tuple[End, End]
Box = Mapping[sp.Symbol, Interval]

EVERYTHING: Interval = (-inf, inf)
_ZERO, _ONE = Fraction(0), Fraction(1)
_BITS = 256
_LONGEST = 3 * _BITS  # bits of a numerator or denominator beyond which an end is rounded
_LARGEST = 16 * _BITS  # largest magnitude of a binary exponent of an end; see `upper_end`
_POWERS = sp.Pow, SignedPower, AbsolutePower
_RISING: dict[type[sp.Basic], Interval] = {  # increasing functions, with their limits at −inf and inf
    sp.exp: (_ZERO, inf),
    sp.log: EVERYTHING,
    sp.asinh: EVERYTHING,
    sp.sinh: EVERYTHING,
    sp.cosh: (_ONE, inf),  # for arguments ≥ 0
    sp.tanh: (-_ONE, _ONE),
}


def interval(expression: sp.Expr, box: Box) -> Interval:
    """Interval that contains every value of an expression on a box; (−∞, ∞) for an undefined power or logarithm.

    Parameters
    ----------
    expression : Expr
        Built from numbers, real symbols, +, ·, powers, exp, log, sin, cos, asinh, sinh, tanh, Abs, Max, Min, signed
        powers, and the functions in the derivatives of these.
    box : mapping of Symbol to (low, high)
        Range of every symbol; ends are Fractions, −inf or inf.

    Raises
    ------
    UnsupportedError
        For a function without an enclosure.
    """
    return _intervals(expression, box)[sp.sympify(expression)]


def regular(expression: sp.Expr, box: Box) -> bool:
    """Whether the arguments of logarithms, and of powers with exponents other than 1, 2, 3, …, do not vanish on a box.

    The expression then has no pole and no jump of a signed power on the box, and its derivatives off the kinks
    determine its monotonicity; jumps of `Heaviside` and `sign` appear in them as `DiracDelta`.
    """
    intervals = _intervals(expression, box)
    ends = [intervals[node.args[0]] for node in intervals if _singular_at_zero(node)]
    return all(low > 0 or high < 0 for low, high in ends)


def _singular_at_zero(node: sp.Basic) -> bool:
    whole = node.func in _POWERS and node.args[1].is_Integer and node.args[1] > 0
    return node.func is sp.log or (node.func in _POWERS and not whole)


def _intervals(expression: sp.Expr, box: Box) -> dict[sp.Basic, Interval]:
    """Intervals of an expression and of all its subexpressions."""
    bounds: dict[sp.Basic, Interval] = dict(box)

    def walk(node: sp.Basic) -> Interval:
        if node not in bounds:
            bounds[node] = _rounded(_number(node) if node.is_Number or node.is_NumberSymbol else _operate(node, walk))
        return bounds[node]

    walk(sp.sympify(expression))
    return bounds


def _number(node: sp.Basic) -> Interval:
    if node.is_finite is not True:
        return EVERYTHING
    if node.is_NumberSymbol:
        near, error = rational(str(sp.N(node, 60))), Fraction(1, 10**50)
        return near - error, near + error
    exact = fraction_of(node) if node.is_Rational else fraction_of_float(node)
    return exact, exact


def _operate(node: sp.Basic, walk: Callable[[sp.Basic], Interval]) -> Interval:
    if node.is_Pow:
        return _power(walk(node.base), node.exp)
    if node.func in (SignedPower, AbsolutePower):
        return _signed_power(walk(node.args[0]), node.args[1], signed=node.func is SignedPower)
    if node.func in _OPERATIONS:
        return _OPERATIONS[node.func]([walk(argument) for argument in node.args])
    if node.func in _RISING:
        return _rising(node.func, walk(node.args[0]))
    return _unsupported(str(node) if node.is_Symbol else node.func.__name__)


def _unsupported(what: str) -> NoReturn:
    raise UnsupportedError(
        f"no enclosure for {what}: use rational powers, exp, log, sin, cos, asinh, sinh, tanh, Abs, Min and Max only."
    )


def add(a: Interval, b: Interval) -> Interval:
    """Interval of the sums of two intervals."""
    return _sum(a[0], b[0]), _sum(a[1], b[1])


def times(a: Interval, b: Interval) -> Interval:
    """Interval of the products of two intervals."""
    ends = [_product(x, y) for x in a for y in b]
    return min(ends), max(ends)


def negative(a: Interval) -> Interval:
    """Interval of the negated values."""
    return -a[1], -a[0]


def _sum(a: End, b: End) -> End:
    return next((x for x in (a, b) if isinstance(x, float)), None) or a + b


def _product(a: End, b: End) -> End:
    if a == 0 or b == 0:
        return _ZERO
    if isinstance(a, float) or isinstance(b, float):
        return inf if (a > 0) == (b > 0) else -inf
    return a * b


def _magnitude(a: Interval) -> Interval:
    return max(a[0], -a[1], _ZERO), max(-a[0], a[1])


def _reciprocal(a: Interval) -> Interval:
    if a[0] < 0 < a[1] or a == (0, 0):
        return EVERYTHING
    if a[1] <= 0:
        return negative(_reciprocal(negative(a)))
    return _ZERO if isinstance(a[1], float) else 1 / a[1], inf if a[0] == 0 else 1 / a[0]


def _power(base: Interval, exponent: sp.Expr) -> Interval:
    if not exponent.is_Rational:
        _unsupported(f"the exponent {exponent}")
    if exponent < 0:
        return _reciprocal(_power(base, -exponent))
    if not exponent.is_Integer:
        return EVERYTHING if base[0] < 0 else (_root(base[0], exponent, up=False), _root(base[1], exponent, up=True))
    n, (low, high) = int(exponent), base if exponent % 2 else _magnitude(base)
    return low**n, high**n


def _root(x: End, exponent: sp.Rational, *, up: bool) -> End:
    power = fmpq(int(exponent.p), int(exponent.q))
    return x if isinstance(x, float) else _end(lambda: arb(fmpq(x.numerator, x.denominator)) ** arb(power), up=up)


def _signed_power(x: Interval, exponent: sp.Expr, *, signed: bool) -> Interval:
    if exponent == 0:
        return _sign([x])
    if not signed or x[0] >= 0:
        return _power(_magnitude(x), exponent)
    if x[1] <= 0:
        return negative(_power(negative(x), exponent))
    return negative(_power((_ZERO, -x[0]), exponent))[0], _power((_ZERO, x[1]), exponent)[1]


def _rising(function: type[sp.Basic], x: Interval) -> Interval:
    """Enclosure of an increasing function."""
    if function is sp.log and x[0] < 0:
        return EVERYTHING
    return _rise(function, x[0], up=False), _rise(function, x[1], up=True)


def _rise(function: type[sp.Basic], x: End, *, up: bool) -> End:
    if isinstance(x, float):
        return _RISING[function][x == inf]
    return _end(lambda: getattr(arb(fmpq(x.numerator, x.denominator)), function.__name__)(), up=up)


def _end(evaluate: Callable[[], arb], *, up: bool) -> End:
    """Upper or lower end of a ball, evaluated with `_BITS` bits."""
    with flint.ctx.workprec(_BITS):
        return upper_end(evaluate()) if up else -upper_end(-evaluate())


def upper_end(ball: arb) -> End:
    """Upper bound of a python-flint ball: a rational with magnitude from 2^−`_LARGEST` to 2^`_LARGEST`, zero, or inf.

    Balls may have any magnitude, but as rationals the largest and the smallest numbers would fill the memory.
    """
    end, large = ball.upper(), type(ball)(2) ** _LARGEST
    if not end < large:
        return inf
    if end < -large:
        return -(Fraction(2) ** _LARGEST)
    if abs(end) * large < 1:
        return Fraction(1 if end > 0 else 0, 2**_LARGEST)
    return end_of(end)


def _wave(name: str) -> Callable[[list[Interval]], Interval]:
    def operation(arguments: list[Interval]) -> Interval:
        low, high = arguments[0]
        if isinstance(low, float) or isinstance(high, float):
            return -_ONE, _ONE

        def over() -> arb:
            ends = [arb(fmpq(x.numerator, x.denominator)) for x in (low, high)]
            wave: arb = getattr(ends[0].union(ends[1]), name)()
            return wave

        return max(-_ONE, _end(over, up=False)), min(_ONE, _end(over, up=True))

    return operation


def _step(arguments: list[Interval]) -> Interval:
    low, high = arguments[0]
    if low == high == 0:
        return _ZERO, _ONE
    return _ONE if low >= 0 else _ZERO, _ZERO if high <= 0 else _ONE


def _sign(arguments: list[Interval]) -> Interval:
    low, high = _step(arguments)
    return 2 * low - 1, 2 * high - 1


def _impulse(arguments: list[Interval]) -> Interval:
    low, high = arguments[0]
    return EVERYTHING if low < 0 < high or low == high == 0 else (_ZERO, _ZERO)


def _extreme(choose: Callable[[Iterable[End]], End]) -> Callable[[list[Interval]], Interval]:
    def operation(arguments: list[Interval]) -> Interval:
        lows, highs = zip(*arguments, strict=True)
        return choose(lows), choose(highs)

    return operation


_OPERATIONS: dict[type[sp.Basic], Callable[[list[Interval]], Interval]] = {
    sp.Add: lambda arguments: reduce(add, arguments),
    sp.Mul: lambda arguments: reduce(times, arguments),
    sp.Max: _extreme(max),
    sp.Min: _extreme(min),
    sp.Abs: lambda arguments: _magnitude(arguments[0]),
    sp.sin: _wave("sin"),
    sp.cos: _wave("cos"),
    sp.cosh: lambda arguments: _rising(sp.cosh, _magnitude(arguments[0])),
    sp.Heaviside: _step,
    sp.sign: _sign,
    sp.DiracDelta: _impulse,
}


def _rounded(a: Interval) -> Interval:
    """Interval whose ends are rounded outwards if they have more than `_LONGEST` bits."""

    def end(x: End, *, up: bool) -> End:
        if isinstance(x, float) or max(x.numerator.bit_length(), x.denominator.bit_length()) <= _LONGEST:
            return x
        return _end(lambda: arb(fmpq(x.numerator, x.denominator)), up=up)

    return end(a[0], up=False), end(a[1], up=True)


# ----------------------------------------------------------------------
# Rigorous enclosures of SymPy expressions over boxes, in ball arithmetic (python-flint).

BallBox = Mapping[sp.Symbol, tuple[Fraction, Fraction]]
Operation = Callable[[list[arb]], Any]
Work = list[tuple[int, Operation, list[int]]]  # index of the result, operation, indices of its arguments


def ball(low: Fraction, high: Fraction) -> arb:
    """Ball that contains the interval [low, high]."""
    ends = [arb(fmpq(v.numerator, v.denominator)) for v in (low, high)]
    return ends[0].union(ends[1])


def enclose(expression: sp.Expr, box: BallBox) -> arb:
    """Ball that contains every value of an expression over a box.

    Parameters
    ----------
    expression : Expr
        Built from numbers, symbols, +, ·, powers, exp, log, sin, cos, asinh, Abs, Max, Min and signed powers.

    Returns
    -------
    flint.arb
        Enclosure; not finite if the expression may be undefined somewhere in the box.

    Raises
    ------
    UnsupportedError
        For a function without an enclosure.
    """
    return _compiled(sp.sympify(expression)).value(_balls(box))


class _Operations:
    """An expression as a list of ball operations; each subexpression occurs once."""

    def __init__(self, expression: sp.Expr) -> None:
        places: dict[sp.Expr, int] = {}
        self._places: dict[sp.Symbol, int] = {}
        self._start: list[Any] = []  # arb, or None for values that depend on symbols
        work: Work = []

        def place(e: sp.Expr) -> int:
            if e not in places:
                arguments = [place(a) for a in e.args]
                places[e] = len(self._start)
                self._start.append(_ball_number(e) if e.is_number else None)
                if e.is_Symbol:
                    self._places[e] = places[e]
                elif not e.is_number:
                    work.append((places[e], _operation(e), arguments))
            return places[e]

        place(expression)
        self._work = work
        self._after = {symbol: _depending(work, index) for symbol, index in self._places.items()}

    def value(self, balls: Mapping[sp.Symbol, arb]) -> arb:
        """Ball of the expression for balls of its symbols."""
        return self.values(balls)[-1]

    def values(self, balls: Mapping[sp.Symbol, arb]) -> list[arb]:
        """Balls of all subexpressions, the expression's own last."""
        results = self._start.copy()
        for symbol, index in self._places.items():
            results[index] = balls[symbol]
        return _evaluated(results, self._work)

    def moved(self, results: list[arb], symbol: sp.Symbol, changed: arb) -> list[arb]:
        """Results for another ball of one symbol: only subexpressions with this symbol are recomputed."""
        results = results.copy()
        results[self._places[symbol]] = changed
        return _evaluated(results, self._after[symbol])


_compiled = lru_cache(maxsize=64)(_Operations)


def _evaluated(results: list[arb], work: Work) -> list[arb]:
    for i, operation, arguments in work:
        results[i] = operation([results[j] for j in arguments])
    return results


def _depending(work: Work, index: int) -> Work:
    reached, depending = {index}, []
    for step in work:
        if not reached.isdisjoint(step[2]):
            reached.add(step[0])
            depending.append(step)
    return depending


def _ball_number(e: sp.Expr) -> arb:
    if e.is_Rational:
        return arb(fmpq(int(e.p), int(e.q)))
    if e.is_Float:
        exact = fraction_of_float(e)
        return arb(fmpq(exact.numerator, exact.denominator))
    if e is sp.pi:
        return arb.pi()
    if e is sp.E:
        return arb(1).exp()
    value: arb = _operation(e)([_ball_number(a) for a in e.args])
    return value


def _operation(e: sp.Expr) -> Operation:
    """Operation of a node on the balls of its arguments; its exponent is analysed once, here."""
    if e.is_Add:
        return sum
    if e.func in (folded := {sp.Mul: mul, sp.Max: arb.max, sp.Min: arb.min}):
        return partial(reduce, folded[e.func])
    if e.is_Pow:
        return _ball_power(e.exp)
    if e.func in (AbsolutePower, SignedPower):
        return _monotone(e.args[1], signed=e.func is SignedPower)
    methods = {sp.exp: "exp", sp.sin: "sin", sp.cos: "cos", sp.log: "log", sp.asinh: "asinh", sp.Abs: "__abs__"}
    if (method := methods.get(type(e))) is None:
        return _unsupported_ball(type(e).__name__)
    return lambda values: getattr(values[0], method)()


def _unsupported_ball(what: str) -> Operation:
    def reject(values: list[arb]) -> arb:
        raise UnsupportedError(f"no enclosure for {what}: use rational powers, exp, log, sin, cos, asinh, Min, Max.")

    return reject


def _ball_power(exponent: sp.Expr) -> Operation:
    if exponent.is_Integer:
        n = abs(int(exponent))
        if exponent.is_positive:
            return lambda values: _integer_power(values[0], n)
        return lambda values: 1 / _integer_power(values[0], n)
    if exponent.is_Rational:
        power = arb(fmpq(int(exponent.p), int(exponent.q)))
        return lambda values: values[0] ** power
    return _unsupported_ball(f"the exponent {exponent}")


def _integer_power(base: arb, n: int) -> arb:
    """Tight enclosure of base^n, n ≥ 1, from its ends; arb's own power is not finite at a zero midpoint."""
    if n == 1:
        return base

    def at(end: arb) -> arb:
        return reduce(mul, [end] * n)

    if n % 2:
        return at(base.lower()).union(at(base.upper()))
    return at(base.abs_lower()).union(at(base.abs_upper()))


def _monotone(exponent: sp.Expr, *, signed: bool) -> Operation:
    if not exponent.is_Rational:
        return _unsupported_ball(f"the exponent {exponent}")
    power = arb(fmpq(int(exponent.p), int(exponent.q)))
    negative, jumps = bool(exponent < 0), signed and bool(exponent == 0)

    def at(end: arb) -> arb:
        value = abs(end) ** power
        return value * end.sgn() if signed else value

    def operation(values: list[arb]) -> arb:
        x = values[0]
        low, high = x.lower(), x.upper()
        straddles = not (low > 0 or high < 0)
        if not x.is_finite() or (straddles and negative):
            return arb("nan")
        if straddles and jumps:
            return arb(-1).union(arb(1))
        hull = at(low).union(at(high))
        return hull.union(arb(0)) if straddles and not signed else hull

    return operation


def upper_bound(
    expression: sp.Expr,
    box: BallBox,
    *,
    tolerance: Fraction = Fraction(1, 100),
    pieces: int = 1500,
    limit: Fraction | None = None,
) -> Fraction:
    """Rigorous upper bound on |expression| over a box, by subdivision.

    Parameters
    ----------
    expression : Expr
        As in `enclose`.
    box : mapping of Symbol to (low, high)
        Range of every symbol.
    tolerance : Fraction
        Stop when the bound is within this relative distance of an attained value.
    pieces : int
        Largest number of subdivisions; the bound is rigorous even if this number is reached.
    limit : Fraction, optional
        Stop as soon as the bound is below the limit, or an attained value is not below it.

    Raises
    ------
    ParameterError
        If no finite bound is found.
    """
    order = count()
    operations = _compiled(sp.sympify(expression))
    free = expression.free_symbols
    start = {symbol: ends for symbol, ends in box.items() if symbol in free}
    values = operations.values(_balls(start))
    attained: End = Fraction(0)
    heap = [(-_upper(values[-1]), next(order), start, values)]
    for _ in range(pieces):
        bound, _, worst, values = heap[0]
        middle = {s: ((a + b) / 2,) * 2 for s, (a, b) in worst.items()}
        attained = max(attained, -upper_end(-abs(operations.value(_balls(middle)))))
        if -bound <= attained * (1 + tolerance):
            break
        if limit is not None and (-bound < limit or limit <= attained < -bound < float("inf")):
            break
        heapq.heappop(heap)
        for part, moved in _halves(operations, worst, values):
            heapq.heappush(heap, (-_upper(moved[-1]), next(order), part, moved))
    result = -heap[0][0]
    if result == float("inf"):
        raise ParameterError(
            f"no finite bound was found in {pieces} subdivisions of the box. The expression may be undefined there. "
            "Narrow the ranges."
        )
    return Fraction(result)


def _balls(box: BallBox) -> dict[sp.Symbol, arb]:
    return {symbol: ball(*ends) for symbol, ends in box.items()}


def _halves(
    operations: _Operations, box: dict[sp.Symbol, tuple[Fraction, Fraction]], values: list[arb]
) -> list[tuple[dict[sp.Symbol, tuple[Fraction, Fraction]], list[arb]]]:
    """Halves of the box along the side whose bisection lowers the bound most, with the balls of all subexpressions."""
    best: list[tuple[dict[sp.Symbol, tuple[Fraction, Fraction]], list[arb]]] = []
    least: End | None = None
    for symbol, (low, high) in box.items():
        if low == high:
            continue
        middle = (low + high) / 2
        parts, worst = [], None
        for part in ((low, middle), (middle, high)):
            moved = operations.moved(values, symbol, ball(*part))
            upper = _upper(moved[-1])
            if least is not None and upper >= least:  # the other half cannot lower the maximum
                break
            parts.append((box | {symbol: part}, moved))
            worst = upper if worst is None else max(worst, upper)
        else:
            best, least = parts, worst
    return best or [(box, values)]


def _upper(enclosure: arb) -> End:
    return upper_end(abs(enclosure))


# ----------------------------------------------------------------------
# Decision whether an expression stays below a limit on a box, by subdivision in interval arithmetic.

PIECES = 600  # largest number of subdivisions
FURTHEST = 10**60  # beyond this a half-line is not divided further


@dataclass(frozen=True)
class Excess:
    """A point at which a limit is exceeded."""

    at: dict[sp.Symbol, Fraction]
    value: Fraction  # A rigorous lower bound of the expression at this point


@dataclass(frozen=True)
class Undecided:
    """A box on which subdivision gave no decision."""

    where: Box  # The remaining box with the largest enclosure


def upper_limit(expression: sp.Expr, box: Box, limit: Fraction, slack: Fraction) -> Fraction | Excess | Undecided:
    """Prove an upper bound of an expression on a box, between a limit and limit + slack.

    Parameters
    ----------
    expression : Expr
        As in `interval`.
    box : mapping of Symbol to (low, high)
        May be unbounded.
    limit : Fraction
        Returned if the expression is proved not to exceed it.
    slack : Fraction
        Largest accepted excess of the enclosure over the limit.

    Returns
    -------
    Fraction, Excess or Undecided
        Proved bound; `Excess` with a point at which the expression exceeds limit + slack; `Undecided` if subdivision
        gave neither.

    Raises
    ------
    UnsupportedError
        For a function without an enclosure.
    """
    form, order, bound = _Form(sp.sympify(expression)), count(), limit
    heap: list[tuple[End, int, Box]] = []

    def push(part: Box) -> None:
        heapq.heappush(heap, (-form.highest(part), next(order), part))

    push({symbol: ends for symbol, ends in box.items() if symbol in form.expression.free_symbols})
    for _ in range(PIECES):
        top = -heap[0][0]
        if top <= limit + slack:
            return max(bound, Fraction(top))
        part = heapq.heappop(heap)[2]
        face = form.upper_face(part)
        for point in (_centre(face), _centre(part)):  # a face may lie on a kink, with a wider enclosure than nearby
            low, _ = interval(form.expression, {symbol: (x, x) for symbol, x in point.items()})
            if low > limit + slack:
                return Excess(at=point, value=Fraction(low))
        if any(abs(x) > FURTHEST for x in _centre(face).values()):
            return Undecided(face)
        for half in form.halves(face):
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
        """Upper bound: the smaller of the plain enclosure's and, on a bounded box, the mean-value form's upper end."""
        high = interval(self.expression, box)[1]
        if any(isinstance(end, float) for ends in box.values() for end in ends) or not regular(self.expression, box):
            return high
        point = {symbol: (x, x) for symbol, x in _centre(box).items()}
        mean = interval(self.expression, point)
        for symbol, ends in box.items():
            if ends[0] != ends[1]:
                mean = add(mean, times(self.slope(symbol, box), add(ends, negative(point[symbol]))))
        return min(high, mean[1])

    def upper_face(self, box: Box) -> Box:
        """Face of a box on which the expression is largest, by the signs of its derivatives if these are definite.

        If the expression may jump, it is the half of the box at this face, which lies on one side of a jump there.
        """
        if not regular(self.expression, box):
            return box
        face = dict(box)
        for symbol, (low, high) in box.items():
            falls, rises = self.slope(symbol, face)
            end = low if rises <= 0 else high if falls >= 0 else None
            if end is not None and not isinstance(end, float):
                inner = _middle((low, high)) if self.jumps else end
                face[symbol] = (min(inner, end), max(inner, end))
        return face

    def halves(self, box: Box) -> list[Box]:
        """Both halves of a box, divided along the side that gives the smallest maximum of both enclosures."""
        splits = [list(_halved_box(box, symbol)) for symbol, (low, high) in box.items() if low != high]
        return min(splits, key=lambda parts: max(map(self.highest, parts)), default=[box])


def _halved_box(box: Box, symbol: sp.Symbol) -> Iterator[Box]:
    low, high = box[symbol]
    middle = _middle((low, high))
    yield {**box, symbol: (low, middle)}
    yield {**box, symbol: (middle, high)}


def _centre(box: Box) -> dict[sp.Symbol, Fraction]:
    return {symbol: _middle(ends) for symbol, ends in box.items()}


def _middle(ends: Interval) -> Fraction:
    """A rational inside an interval: its middle; on a half-line 0 if inside, else ±1 or twice its end."""
    low, high = ends
    if isinstance(low, float):
        return Fraction(0) if isinstance(high, float) or high > 0 else min(Fraction(-1), Fraction(2 * high))
    if isinstance(high, float):
        return Fraction(0) if low < 0 else max(Fraction(1), Fraction(2 * low))
    return (low + high) / 2
