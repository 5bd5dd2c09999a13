"""Rigorous enclosures of SymPy expressions over boxes, in ball arithmetic (python-flint)."""

import heapq
from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import lru_cache, partial, reduce
from itertools import count
from operator import methodcaller, mul
from typing import Any

import sympy as sp

from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.rationals import fraction_of, rational
from quakedesign.symbolic.signed_power import AbsolutePower, SignedPower

Box = Mapping[sp.Symbol, tuple[Fraction, Fraction]]
Operation = Callable[[list[Any]], Any]


def ball(low: Fraction, high: Fraction) -> Any:
    """Ball that contains the interval [low, high]."""
    from flint import arb, fmpq

    ends = [arb(fmpq(v.numerator, v.denominator)) for v in (low, high)]
    return ends[0].union(ends[1])


def enclose(expression: sp.Expr, box: Box) -> Any:
    """Ball that contains every value of an expression over a box.

    Parameters
    ----------
    expression : Expr
        Built from rationals, symbols, +, ·, powers, exp, sin, cos, Abs, Max, Min and signed powers.
    box : mapping of Symbol to (Fraction, Fraction)

    Returns
    -------
    flint.arb
        Not finite where the expression is not defined on all of the box.

    Raises
    ------
    UnsupportedError
        For a function without an enclosure.
    """
    return _compiled(sp.sympify(expression))({symbol: ball(*ends) for symbol, ends in box.items()})


@lru_cache(maxsize=64)
def _compiled(expression: sp.Expr) -> Callable[[Mapping[sp.Symbol, Any]], Any]:
    """Flatten an expression into a list of ball operations, each subexpression once."""
    places: dict[sp.Expr, int] = {}
    symbols: list[tuple[int, sp.Symbol]] = []
    steps: list[tuple[Operation, list[int]]] = []
    constants: dict[int, Any] = {}

    def place(e: sp.Expr) -> int:
        if e not in places:
            arguments = [place(a) for a in e.args]
            places[e] = len(steps)
            steps.append((_operation(e), arguments))
            if e.is_Symbol:
                symbols.append((places[e], e))
            elif e.is_number:
                constants[places[e]] = _number(e)
        return places[e]

    last = place(expression)
    start = [constants.get(i) for i in range(len(steps))]
    known = {*constants, *(i for i, _ in symbols)}
    work = [(i, operation, arguments) for i, (operation, arguments) in enumerate(steps) if i not in known]

    def evaluate(values: Mapping[sp.Symbol, Any]) -> Any:
        results = start.copy()
        for i, symbol in symbols:
            results[i] = values[symbol]
        for i, operation, arguments in work:
            results[i] = operation([results[j] for j in arguments])
        return results[last]

    return evaluate


def _number(e: sp.Expr) -> Any:
    from flint import arb, fmpq

    if e.is_Rational:
        return arb(fmpq(int(e.p), int(e.q)))
    if e.is_Float:
        exact = rational(repr(float(e)))
        return arb(fmpq(exact.numerator, exact.denominator))
    if e is sp.pi:
        return arb.pi()
    if e is sp.E:
        return arb(1).exp()
    return _operation(e)([_number(a) for a in e.args])


def _operation(e: sp.Expr) -> Operation:
    """What a node does with the balls of its arguments; everything about its exponent is settled here."""
    if e.is_Add:
        return sum
    if e.is_Mul or isinstance(e, sp.Max | sp.Min):
        return partial(reduce, {sp.Max: _larger, sp.Min: _smaller}.get(type(e), mul))
    if e.is_Pow:
        return _power(e.exp)
    if isinstance(e, AbsolutePower | SignedPower):
        return _monotone(e.args[1], signed=isinstance(e, SignedPower))
    methods = {sp.exp: "exp", sp.sin: "sin", sp.cos: "cos", sp.log: "log", sp.asinh: "asinh", sp.Abs: "__abs__"}
    for function, method in methods.items():
        if isinstance(e, function):
            return partial(_of_one, methodcaller(method))
    return _without(type(e).__name__)


def _of_one(function: Callable[[Any], Any], values: list[Any]) -> Any:
    return function(values[0])


def _without(what: str) -> Operation:
    def refuse(values: list[Any]) -> Any:
        raise UnsupportedError(f"no enclosure for {what}. Write it with powers, exp, log, sin, cos, asinh, Min or Max.")

    return refuse


def _larger(a: Any, b: Any) -> Any:
    return a.max(b)


def _smaller(a: Any, b: Any) -> Any:
    return a.min(b)


def _power(exponent: sp.Expr) -> Operation:
    from flint import arb, fmpq

    if exponent.is_Integer:
        n = abs(int(exponent))
        if exponent.is_positive:
            return lambda values: _integer_power(values[0], n)
        return lambda values: 1 / _integer_power(values[0], n)
    if exponent.is_Rational:
        power = arb(fmpq(int(exponent.p), int(exponent.q)))
        return lambda values: values[0] ** power
    return _without(f"the exponent {exponent}")


def _integer_power(base: Any, n: int) -> Any:
    """Tight enclosure of base^n, n ≥ 1, from its ends; arb's own power is not finite about a zero midpoint."""
    if n == 1:
        return base

    def at(end: Any) -> Any:
        return reduce(mul, [end] * n)

    if n % 2:
        return at(base.lower()).union(at(base.upper()))
    return at(base.abs_lower()).union(at(base.abs_upper()))


def _monotone(exponent: sp.Expr, *, signed: bool) -> Operation:
    from flint import arb, fmpq

    if not exponent.is_Rational:
        return _without(f"the exponent {exponent}")
    power = arb(fmpq(int(exponent.p), int(exponent.q)))
    negative, jumps = bool(exponent < 0), signed and bool(exponent == 0)

    def at(end: Any) -> Any:
        value = abs(end) ** power
        return value * end.sgn() if signed else value

    def operation(values: list[Any]) -> Any:
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
    expression: sp.Expr, box: Box, *, tolerance: Fraction = Fraction(1, 100), pieces: int = 1500
) -> Fraction:
    """Rigorous upper bound of |expression| over a box, by subdivision.

    Parameters
    ----------
    expression : Expr
    box : mapping of Symbol to (Fraction, Fraction)
    tolerance : Fraction
        Stop when the bound is within this share of a value that is attained.
    pieces : int
        Largest number of subdivisions; the bound is rigorous whenever it stops.

    Returns
    -------
    Fraction

    Raises
    ------
    ParameterError
        When no finite bound is found.
    """
    order = count()
    symbols = [s for s in box if s in expression.free_symbols]
    start = {s: box[s] for s in symbols}
    attained = Fraction(0)
    heap = [(-_upper(expression, start), next(order), start)]
    for _ in range(pieces):
        bound, _, worst = heap[0]
        middle = {s: ((a + b) / 2,) * 2 for s, (a, b) in worst.items()}
        attained = max(attained, _lower(expression, middle))
        if -bound <= attained * (1 + tolerance):
            break
        heapq.heappop(heap)
        for part in _halves(expression, worst):
            heapq.heappush(heap, (-_upper(expression, part), next(order), part))
    result = -heap[0][0]
    if result == float("inf"):
        raise ParameterError(
            f"no finite bound was found in {pieces} subdivisions of the box. An expression that is defined all over it "
            "is expected. Narrow the ranges."
        )
    return Fraction(result)


def _halves(expression: sp.Expr, box: dict) -> list[dict]:
    """Halve the box where that lowers the bound most."""
    best: list[dict] = []
    least: Any = None
    for symbol, (low, high) in box.items():
        if low == high:
            continue
        middle = (low + high) / 2
        parts = [box | {symbol: (low, middle)}, box | {symbol: (middle, high)}]
        worst = max(_upper(expression, p) for p in parts)
        if least is None or worst < least:
            best, least = parts, worst
    return best or [box]


def _upper(expression: sp.Expr, box: Box) -> Any:
    enclosure = abs(enclose(expression, box))
    if not enclosure.is_finite():
        return float("inf")
    top = enclosure.upper().fmpq()
    return fraction_of(top)


def _lower(expression: sp.Expr, box: Box) -> Fraction:
    enclosure = abs(enclose(expression, box))
    if not enclosure.is_finite():
        return Fraction(0)
    bottom = enclosure.abs_lower().fmpq()
    return fraction_of(bottom)
