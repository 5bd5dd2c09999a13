"""Rigorous enclosures of SymPy expressions over boxes, in ball arithmetic (python-flint)."""

import heapq
from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import lru_cache, partial, reduce
from itertools import count
from operator import methodcaller, mul
from typing import Any

import sympy as sp
from flint import arb, fmpq

from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.rationals import fraction_of_float
from quakedesign.symbolic.intervals import upper_end
from quakedesign.symbolic.signed_power import AbsolutePower, SignedPower

Box = Mapping[sp.Symbol, tuple[Fraction, Fraction]]
Operation = Callable[[list[Any]], Any]
Work = list[tuple[int, Operation, list[int]]]


def ball(low: Fraction, high: Fraction) -> Any:
    """Ball that contains the interval [low, high]."""
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
    return _compiled(sp.sympify(expression)).value(_balls(box))


class _Operations:
    """An expression as a list of ball operations, each subexpression once."""

    def __init__(self, expression: sp.Expr) -> None:
        places: dict[sp.Expr, int] = {}
        self._places: dict[sp.Symbol, int] = {}
        self._start: list[Any] = []
        work: Work = []

        def place(e: sp.Expr) -> int:
            if e not in places:
                arguments = [place(a) for a in e.args]
                places[e] = len(self._start)
                self._start.append(_number(e) if e.is_number else None)
                if e.is_Symbol:
                    self._places[e] = places[e]
                elif not e.is_number:
                    work.append((places[e], _operation(e), arguments))
            return places[e]

        place(expression)
        self._work = work
        self._after = {symbol: _depending(work, index) for symbol, index in self._places.items()}

    def value(self, balls: Mapping[sp.Symbol, Any]) -> Any:
        """Ball of the expression for balls of its symbols."""
        return self.values(balls)[-1]

    def values(self, balls: Mapping[sp.Symbol, Any]) -> list[Any]:
        """Balls of all subexpressions, the expression's own last."""
        results = self._start.copy()
        for symbol, index in self._places.items():
            results[index] = balls[symbol]
        return _worked(results, self._work)

    def moved(self, results: list[Any], symbol: sp.Symbol, changed: Any) -> list[Any]:
        """The same for another ball of one symbol: what depends on it is computed again."""
        results = results.copy()
        results[self._places[symbol]] = changed
        return _worked(results, self._after[symbol])


_compiled = lru_cache(maxsize=64)(_Operations)


def _worked(results: list[Any], work: Work) -> list[Any]:
    for i, operation, arguments in work:
        results[i] = operation([results[j] for j in arguments])
    return results


def _depending(work: Work, index: int) -> Work:
    known, depending = {index}, []
    for step in work:
        if not known.isdisjoint(step[2]):
            known.add(step[0])
            depending.append(step)
    return depending


def _number(e: sp.Expr) -> Any:
    if e.is_Rational:
        return arb(fmpq(int(e.p), int(e.q)))
    if e.is_Float:
        exact = fraction_of_float(e)
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
    expression: sp.Expr,
    box: Box,
    *,
    tolerance: Fraction = Fraction(1, 100),
    pieces: int = 1500,
    limit: Fraction | None = None,
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
    limit : Fraction, optional
        Stop as soon as the bound is below that, or never will be, where nothing else is asked.

    Returns
    -------
    Fraction

    Raises
    ------
    ParameterError
        When no finite bound is found.
    """
    order = count()
    operations = _compiled(sp.sympify(expression))
    free = expression.free_symbols
    start = {symbol: ends for symbol, ends in box.items() if symbol in free}
    values = operations.values(_balls(start))
    attained = Fraction(0)
    heap = [(-_upper(values[-1]), next(order), start, values)]
    for _ in range(pieces):
        bound, _, worst, values = heap[0]
        middle = {s: ((a + b) / 2,) * 2 for s, (a, b) in worst.items()}
        attained = max(attained, _lower(operations.value(_balls(middle))))
        if -bound <= attained * (1 + tolerance):
            break
        if limit is not None and (-bound < limit or limit <= attained < -bound < float("inf")):
            break
        heapq.heappop(heap)
        for part, found in _halves(operations, worst, values):
            heapq.heappush(heap, (-_upper(found[-1]), next(order), part, found))
    result = -heap[0][0]
    if result == float("inf"):
        raise ParameterError(
            f"no finite bound was found in {pieces} subdivisions of the box. An expression that is defined all over it "
            "is expected. Narrow the ranges."
        )
    return Fraction(result)


def _balls(box: Box) -> dict[sp.Symbol, Any]:
    return {symbol: ball(*ends) for symbol, ends in box.items()}


def _halves(operations: _Operations, box: dict[Any, Any], values: list[Any]) -> list[tuple[dict[Any, Any], list[Any]]]:
    """Halve the box where that lowers the bound most: parts with the balls of all subexpressions."""
    best: list[tuple[dict[Any, Any], list[Any]]] = []
    least: Any = None
    for symbol, (low, high) in box.items():
        if low == high:
            continue
        middle = (low + high) / 2
        parts, worst = [], None
        for part in ((low, middle), (middle, high)):
            found = operations.moved(values, symbol, ball(*part))
            upper = _upper(found[-1])
            if least is not None and upper >= least:  # the other half cannot make it better
                break
            parts.append((box | {symbol: part}, found))
            worst = upper if worst is None else max(worst, upper)
        else:
            best, least = parts, worst
    return best or [(box, values)]


def _upper(enclosure: Any) -> Any:
    return upper_end(abs(enclosure))


def _lower(enclosure: Any) -> Any:
    return max(Fraction(0), -upper_end(-abs(enclosure)))
