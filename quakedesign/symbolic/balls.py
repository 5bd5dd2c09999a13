"""Rigorous enclosures of SymPy expressions over boxes, in ball arithmetic (python-flint)."""

import heapq
from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import lru_cache, reduce
from itertools import count
from typing import Any

import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.rationals import rational
from quakedesign.symbolic.signed_power import AbsolutePower, SignedPower

Box = Mapping[sp.Symbol, tuple[Fraction, Fraction]]


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
    NotImplementedError
        For a function without an enclosure.
    """
    return _compiled(sp.sympify(expression))({symbol: ball(*ends) for symbol, ends in box.items()})


@lru_cache(maxsize=64)
def _compiled(expression: sp.Expr) -> Callable[[Mapping[sp.Symbol, Any]], Any]:
    """Flatten an expression into a list of ball operations, each subexpression once."""
    places: dict[sp.Expr, int] = {}
    symbols: list[tuple[int, sp.Symbol]] = []
    steps: list[tuple[Callable[[list[Any]], Any], list[int]]] = []
    constants: dict[int, Any] = {}

    def place(e: sp.Expr) -> int:
        if e not in places:
            arguments = [] if e.is_number else [place(a) for a in _arguments(e)]
            places[e] = len(steps)
            steps.append((_operation(e), arguments))
            if e.is_Symbol:
                symbols.append((places[e], e))
            elif e.is_number:
                constants[places[e]] = _number(e)
        return places[e]

    last = place(expression)
    fixed = {**constants, **dict.fromkeys(i for i, _ in symbols)}

    def evaluate(values: Mapping[sp.Symbol, Any]) -> Any:
        results: list[Any] = [None] * len(steps)
        for i, symbol in symbols:
            results[i] = values[symbol]
        for i, number in constants.items():
            results[i] = number
        for i, (operation, arguments) in enumerate(steps):
            if i not in fixed:
                results[i] = operation([results[j] for j in arguments])
        return results[last]

    return evaluate


def _arguments(e: sp.Expr) -> tuple[sp.Expr, ...]:
    return e.args[:1] if e.is_Pow or isinstance(e, AbsolutePower | SignedPower) else e.args


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
    return _operation(e)([_number(a) for a in _arguments(e)])


def _operation(e: sp.Expr) -> Callable[[list[Any]], Any]:
    from flint import arb

    if e.is_Add:
        return lambda values: sum(values, start=arb(0))
    if e.is_Mul:
        return lambda values: reduce(lambda a, b: a * b, values)
    if e.is_Pow:
        return lambda values: _power(values[0], e.exp)
    return lambda values: _function(e, values)


def _power(base: Any, exponent: sp.Expr) -> Any:
    from flint import arb, fmpq

    if exponent.is_Integer:
        positive = _integer_power(base, abs(int(exponent)))
        return positive if exponent > 0 else 1 / positive
    if exponent.is_Rational:
        return base ** arb(fmpq(int(exponent.p), int(exponent.q)))
    raise NotImplementedError(f"no enclosure for the exponent {exponent}")


def _integer_power(base: Any, n: int) -> Any:
    """Tight enclosure of base^n, n ≥ 1, from its ends; arb's own power is not finite about a zero midpoint."""

    def at(end: Any) -> Any:
        return reduce(lambda a, b: a * b, [end] * n)

    if n % 2:
        return at(base.lower()).union(at(base.upper()))
    return at(base.abs_lower()).union(at(base.abs_upper()))


def _function(e: sp.Expr, values: list[Any]) -> Any:
    simple = {sp.exp: "exp", sp.sin: "sin", sp.cos: "cos", sp.log: "log", sp.asinh: "asinh"}
    for function, method in simple.items():
        if isinstance(e, function):
            return getattr(values[0], method)()
    if isinstance(e, sp.Abs):
        return abs(values[0])
    if isinstance(e, sp.Max):
        return reduce(lambda a, b: a.max(b), values)
    if isinstance(e, sp.Min):
        return reduce(lambda a, b: a.min(b), values)
    if isinstance(e, AbsolutePower | SignedPower):
        return _monotone(values[0], e.args[1], signed=isinstance(e, SignedPower))
    raise NotImplementedError(f"no enclosure for {type(e).__name__}")


def _monotone(x: Any, exponent: sp.Expr, *, signed: bool) -> Any:
    from flint import arb, fmpq

    if not exponent.is_Rational:
        raise NotImplementedError(f"no enclosure for the exponent {exponent}")
    power = arb(fmpq(int(exponent.p), int(exponent.q)))
    low, high = x.lower(), x.upper()
    straddles = not (low > 0 or high < 0)
    if not x.is_finite() or (straddles and exponent < 0):
        return arb("nan")

    def at(end: Any) -> Any:
        size = abs(end)
        value = arb(0) if size.is_zero() else size**power
        return -value if signed and end < 0 else value

    if signed:
        if exponent == 0:
            return arb(1) if low > 0 else (arb(-1) if high < 0 else arb(-1).union(arb(1)))
        return at(low).union(at(high))
    hull = at(low).union(at(high))
    return hull.union(arb(0)) if straddles else hull


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
    return Fraction(int(top.p), int(top.q))


def _lower(expression: sp.Expr, box: Box) -> Fraction:
    enclosure = abs(enclose(expression, box))
    if not enclosure.is_finite():
        return Fraction(0)
    bottom = enclosure.abs_lower().fmpq()
    return Fraction(int(bottom.p), int(bottom.q))
