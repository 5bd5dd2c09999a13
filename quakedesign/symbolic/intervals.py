"""Rigorous enclosures of SymPy expressions over boxes that may be unbounded, with exact rational ends.

Rational operations are exact, so a bound that is attained is found as it is; the others are rounded outwards to
`_BITS` bits by python-flint. At a jump of `Heaviside` or `sign`, which derivatives of Max, Min and Abs bring, the
enclosure holds every value between both sides; where a box only touches the jump it holds the side of the box.
"""

from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from functools import reduce
from math import inf
from typing import Any, NoReturn

import flint
import sympy as sp
from flint import arb, fmpq

from quakedesign.errors import UnsupportedError
from quakedesign.rationals import end_of, fraction_of, fraction_of_float, rational
from quakedesign.symbolic.signed_power import AbsolutePower, SignedPower

End = Fraction | float  # the only floats are −inf and inf
Interval = tuple[End, End]
Box = Mapping[sp.Symbol, Interval]

EVERYTHING: Interval = (-inf, inf)
_ZERO, _ONE = Fraction(0), Fraction(1)
_BITS = 256
_LONGEST = 3 * _BITS  # bits of a numerator or denominator beyond which an end is rounded
_LARGEST = 16 * _BITS  # bits of size beyond which an end is rounded to infinity or zero, or away from them
_RISING: dict[Any, Interval] = {  # with their limits at −inf and inf
    sp.exp: (_ZERO, inf),
    sp.log: EVERYTHING,
    sp.asinh: EVERYTHING,
    sp.sinh: EVERYTHING,
    sp.cosh: (_ONE, inf),  # of a size
    sp.tanh: (-_ONE, _ONE),
}


def interval(expression: sp.Expr, box: Box) -> Interval:
    """Interval that contains every value of an expression over a box; the whole line where it may be undefined.

    Parameters
    ----------
    expression : Expr
        Built from numbers, real symbols, +, ·, powers, exp, log, sin, cos, asinh, sinh, tanh, Abs, Max, Min, signed
        powers, and what the derivatives of these bring.
    box : mapping of Symbol to (low, high)
        Fractions, or −inf and inf.

    Raises
    ------
    UnsupportedError
        For a function without an enclosure.
    """
    return _intervals(expression, box)[sp.sympify(expression)]


def regular(expression: sp.Expr, box: Box) -> bool:
    """Whether an expression has no pole, no end of its domain and no jump of a signed power on a box.

    Then its derivatives off the kinks tell how it runs; at other jumps derivatives have an impulse.
    """
    known = _intervals(expression, box)
    ends = [known[node.args[0]] for node in known if _singular_at_zero(node)]
    return all(low > 0 or high < 0 for low, high in ends)


def _singular_at_zero(node: Any) -> bool:
    if isinstance(node, sp.Pow | SignedPower | AbsolutePower):
        return not (node.args[1].is_Integer and node.args[1] > 0)
    return isinstance(node, sp.log)


def _intervals(expression: sp.Expr, box: Box) -> dict[sp.Basic, Interval]:
    """Intervals of an expression and of every part of it."""
    known: dict[sp.Basic, Interval] = dict(box)

    def walk(node: Any) -> Interval:
        if node not in known:
            known[node] = _rounded(_number(node) if node.is_Number or node.is_NumberSymbol else _operate(node, walk))
        return known[node]

    walk(sp.sympify(expression))
    return known


def _number(node: Any) -> Interval:
    if node.is_finite is not True:
        return EVERYTHING
    if node.is_NumberSymbol:
        near, error = rational(str(sp.N(node, 60))), Fraction(1, 10**50)
        return near - error, near + error
    exact = fraction_of(node) if node.is_Rational else fraction_of_float(node)
    return exact, exact


def _operate(node: Any, walk: Callable[[Any], Interval]) -> Interval:
    if node.is_Pow:
        return _power(walk(node.base), node.exp)
    if isinstance(node, SignedPower | AbsolutePower):
        return _signed_power(walk(node.args[0]), node.args[1], signed=isinstance(node, SignedPower))
    if node.func in _OPERATIONS:
        return _OPERATIONS[node.func]([walk(argument) for argument in node.args])
    if node.func in _RISING:
        return _rising(node.func, walk(node.args[0]))
    return _without(str(node) if node.is_Symbol else node.func.__name__)


def _without(what: str) -> NoReturn:
    raise UnsupportedError(
        f"no enclosure for {what}. Write it with powers, exp, log, sin, cos, asinh, sinh, tanh, Abs, Min or Max."
    )


def add(a: Interval, b: Interval) -> Interval:
    """Sums of two intervals."""
    return _sum(a[0], b[0]), _sum(a[1], b[1])


def times(a: Interval, b: Interval) -> Interval:
    """Products of two intervals."""
    ends = [_product(x, y) for x in a for y in b]
    return min(ends), max(ends)


def negative(a: Interval) -> Interval:
    """The interval mirrored at 0."""
    return -a[1], -a[0]


def _sum(a: End, b: End) -> End:
    return next((x for x in (a, b) if isinstance(x, float)), None) or a + b


def _product(a: End, b: End) -> End:
    if a == 0 or b == 0:
        return _ZERO
    if isinstance(a, float) or isinstance(b, float):
        return inf if (a > 0) == (b > 0) else -inf
    return a * b


def _size(a: Interval) -> Interval:
    return max(a[0], -a[1], _ZERO), max(-a[0], a[1])


def _reciprocal(a: Interval) -> Interval:
    if a[0] < 0 < a[1] or a == (0, 0):
        return EVERYTHING
    if a[1] <= 0:
        return negative(_reciprocal(negative(a)))
    return _ZERO if isinstance(a[1], float) else 1 / a[1], inf if a[0] == 0 else 1 / a[0]


def _power(base: Interval, exponent: sp.Expr) -> Interval:
    if not exponent.is_Rational:
        _without(f"the exponent {exponent}")
    if exponent < 0:
        return _reciprocal(_power(base, -exponent))
    if not exponent.is_Integer:
        return EVERYTHING if base[0] < 0 else (_root(base[0], exponent, up=False), _root(base[1], exponent, up=True))
    n, (low, high) = int(exponent), base if exponent % 2 else _size(base)
    return low**n, high**n


def _root(x: End, exponent: sp.Rational, *, up: bool) -> End:
    power = fmpq(int(exponent.p), int(exponent.q))
    return x if isinstance(x, float) else _end(lambda: arb(fmpq(x.numerator, x.denominator)) ** arb(power), up=up)


def _signed_power(x: Interval, exponent: sp.Expr, *, signed: bool) -> Interval:
    if exponent == 0:
        return _sign([x])
    if not signed or x[0] >= 0:
        return _power(_size(x), exponent)
    if x[1] <= 0:
        return negative(_power(negative(x), exponent))
    return negative(_power((_ZERO, -x[0]), exponent))[0], _power((_ZERO, x[1]), exponent)[1]


def _rising(function: Any, x: Interval) -> Interval:
    """Enclosure by a function that rises."""
    if function is sp.log and x[0] < 0:
        return EVERYTHING
    return _rise(function, x[0], up=False), _rise(function, x[1], up=True)


def _rise(function: Any, x: End, *, up: bool) -> End:
    if isinstance(x, float):
        return _RISING[function][x == inf]
    return _end(lambda: getattr(arb(fmpq(x.numerator, x.denominator)), function.__name__)(), up=up)


def _end(evaluate: Callable[[], Any], *, up: bool) -> End:
    """Upper or lower end of a ball that is evaluated with `_BITS` bits."""
    with flint.ctx.workprec(_BITS):
        return upper_end(evaluate()) if up else -upper_end(-evaluate())


def upper_end(ball: Any) -> End:
    """Rational at or above a ball of python-flint, of a size between 2 to ± `_LARGEST`; zero, or infinite.

    Numbers of any size have balls, but as rationals the largest and the smallest would fill the memory.
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

        def over() -> Any:
            ends = [arb(fmpq(x.numerator, x.denominator)) for x in (low, high)]
            return getattr(ends[0].union(ends[1]), name)()

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


_OPERATIONS: dict[Any, Callable[[list[Interval]], Interval]] = {
    sp.Add: lambda arguments: reduce(add, arguments),
    sp.Mul: lambda arguments: reduce(times, arguments),
    sp.Max: _extreme(max),
    sp.Min: _extreme(min),
    sp.Abs: lambda arguments: _size(arguments[0]),
    sp.sin: _wave("sin"),
    sp.cos: _wave("cos"),
    sp.cosh: lambda arguments: _rising(sp.cosh, _size(arguments[0])),
    sp.Heaviside: _step,
    sp.sign: _sign,
    sp.DiracDelta: _impulse,
}


def _rounded(a: Interval) -> Interval:
    """The interval, rounded outwards where its ends have grown long."""

    def end(x: End, *, up: bool) -> End:
        if isinstance(x, float) or max(x.numerator.bit_length(), x.denominator.bit_length()) <= _LONGEST:
            return x
        return _end(lambda: arb(fmpq(x.numerator, x.denominator)), up=up)

    return end(a[0], up=False), end(a[1], up=True)
