"""Rigorous bounds on products of powers of forms over the simplex, by bisection (Bernstein coefficients).

A form of degree m on the simplex spanned by s_1 … s_n lies between its smallest and its largest Bernstein coefficient,
and equals the corner coefficients at the corners (Farin, *Curves and Surfaces for CAGD*, ch. 17). Bisection of an edge
by de Casteljau's algorithm needs only integers.
"""

import heapq
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, lru_cache
from itertools import accumulate, combinations, count, pairwise, product
from math import factorial, gcd, lcm, prod
from operator import add, itemgetter, lshift
from typing import NamedTuple

from flint import arb, fmpq

from quakedesign.exact import end_of, float_above

Polynomial = Mapping[tuple[int, ...], Fraction]
Edge = tuple[int, int]


@cache
def _exponents(variables: int, degree: int) -> tuple[tuple[int, ...], ...]:
    return tuple(e for e in product(range(degree + 1), repeat=variables) if sum(e) == degree)


@cache
def _lines(variables: int, degree: int, edge: Edge) -> tuple[tuple[int, ...], ...]:
    """Indices of coefficients that differ only along an edge, in order from its first to its second end."""
    order = {e: i for i, e in enumerate(_exponents(variables, degree))}
    groups: dict[tuple[int, ...], list[tuple[int, int]]] = {}
    for e, place in order.items():
        rest = tuple(v for k, v in enumerate(e) if k not in edge)
        groups.setdefault(rest, []).append((e[edge[1]], place))
    return tuple(tuple(place for _, place in sorted(line)) for line in groups.values())


Taken = Callable[[list[int]], tuple[int, ...]]


def _taking(places: Sequence[int]) -> Taken:
    """Function that extracts the entries at given indices from a list."""
    return itemgetter(*places) if len(places) > 1 else lambda values: tuple(values[i] for i in places)


@cache
def _triangle(
    variables: int, degree: int, edge: Edge
) -> tuple[tuple[tuple[Taken, Taken], ...], tuple[tuple[Taken, tuple[int, ...]], ...]]:
    """De Casteljau's triangles of all lines along an edge, as sums of neighbours appended to a list row by row.

    Then, for each half, the indices of its coefficients and the number of binary digits by which to shift them.
    """
    lines = _lines(variables, degree, edge)
    rows, size, sums = [list(line) for line in lines], len(_exponents(variables, degree)), []
    halves: tuple[dict[int, tuple[int, int]], ...] = ({}, {})
    for k in range(degree + 1):
        for line, row in zip(lines, rows, strict=True):
            if row:
                halves[0][line[k]], halves[1][line[-1 - k]] = (row[0], degree - k), (row[-1], degree - k)
        pairs = [pair for row in rows for pair in pairwise(row)]
        if pairs:
            before, after = zip(*pairs, strict=True)
            sums.append((_taking(before), _taking(after)))
        ends = list(accumulate((max(len(row) - 1, 0) for row in rows), initial=size))
        rows, size = [list(range(*part)) for part in pairwise(ends)], ends[-1]
    parts = [tuple(zip(*(half[place] for place in sorted(half)), strict=True)) for half in halves]
    return tuple(sums), tuple((_taking(places), shifts) for places, shifts in parts)


@lru_cache(maxsize=5000)
def _halved(
    variables: int, degree: int, coefficients: tuple[int, ...], edge: Edge
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Coefficients on both halves; cached, as the problems of many vertices share forms and bisections."""
    sums, halves = _triangle(variables, degree, edge)
    values = list(coefficients)
    for before, after in sums:
        values += map(add, before(values), after(values))
    first, second = (tuple(map(lshift, ends(values), shifts)) for ends, shifts in halves)
    return first, second


@dataclass(frozen=True, slots=True)
class Form:
    """A form on one simplex: integer Bernstein coefficients times a scale."""

    variables: int
    degree: int
    coefficients: tuple[int, ...]  # In the order of `_exponents`
    scale: fmpq

    @classmethod
    def of(cls, polynomial: Polynomial, variables: int, degree: int, sizes: Sequence[Fraction]) -> "Form":
        """Form p(s_1·size_1, …) on the standard simplex."""
        values = []
        for e in _exponents(variables, degree):
            ways = Fraction(prod(factorial(k) for k in e), factorial(degree))
            values.append(polynomial.get(e, Fraction(0)) * prod(s**k for s, k in zip(sizes, e, strict=True)) * ways)
        common = lcm(*(v.denominator for v in values))
        shared = gcd(*(v.numerator for v in values)) or 1
        whole = tuple(int(v * common) // shared for v in values)
        return cls(variables, degree, whole, fmpq(shared, common))

    def bisected(self, edge: Edge) -> "tuple[Form, Form]":
        """Forms on the two halves; the first half contains the first end of the edge."""
        scale = self.scale / (1 << self.degree)
        parts = _halved(self.variables, self.degree, self.coefficients, edge)
        first, second = (Form(self.variables, self.degree, c, scale) for c in parts)
        return first, second

    def least(self) -> fmpq:
        """Lower bound on the form."""
        return min(self.coefficients) * self.scale

    def largest(self) -> fmpq:
        """Upper bound on the absolute value."""
        return max(map(abs, self.coefficients)) * self.scale

    def at_corners(self) -> list[float]:
        """Values at the corners of the simplex, rounded to nearest."""
        p, q = int(self.scale.p), int(self.scale.q)
        return [self.coefficients[i] * p / q for i in _corners(self.variables, self.degree)]


Problem = tuple[tuple[Form, ...], tuple[Fraction, ...]]


@cache
def _corners(variables: int, degree: int) -> tuple[int, ...]:
    order = {e: i for i, e in enumerate(_exponents(variables, degree))}
    return tuple(order[tuple(degree if k == i else 0 for k in range(variables))] for i in range(variables))


def largest_ratio(
    problems: Iterable[tuple[Sequence[Form], Sequence[Fraction]]],
    *,
    tolerance: Fraction = Fraction(1, 20),
    pieces: int = 4000,
) -> Fraction | None:
    """Rigorous upper bound on Π|f_i|^{a_i} over the standard simplex and all problems.

    Parameters
    ----------
    problems : iterable of (forms, exponents)
        Forms on the standard simplex; a form with a negative exponent must be positive there.
    tolerance : Fraction
        Relative distance of the bound from an attained value at which the bisection stops.
    pieces : int
        Largest number of bisections; the bound is rigorous for any number.

    Returns
    -------
    Fraction or None
        None if a form with a negative exponent was not proved positive.
    """
    return _largest(tuple((tuple(forms), tuple(exponents)) for forms, exponents in problems), tolerance, pieces)


@lru_cache(maxsize=32)
def _largest(problems: tuple[Problem, ...], tolerance: Fraction, pieces: int) -> Fraction | None:
    order, heap, attained = count(), [], 0.0
    for forms, exponents in problems:
        size, powers = range(forms[0].variables), tuple(map(_FormPower.of, exponents))
        corners = tuple(tuple(float(i == j) for j in size) for i in size)
        heap.append((-_bound(forms, powers), next(order), forms, powers, corners))
    heapq.heapify(heap)
    for _ in range(pieces):
        top, _, forms, powers, corners = heap[0]
        # Largest value at the corners of a piece, used only as stopping criterion.
        values = [[abs(v) for v in f.at_corners()] for f in forms]
        attained = max(
            attained,
            max(
                prod(v[i] ** power.near if v[i] else 0.0 for v, power in zip(values, powers, strict=True))
                for i in range(forms[0].variables)
            ),
        )
        if -top <= attained * (1 + float(tolerance)):
            break
        heapq.heappop(heap)
        edge = _longest(corners)
        for side, part in enumerate(zip(*(f.bisected(edge) for f in forms), strict=True)):
            cut = _cut(corners, edge, side)
            heapq.heappush(heap, (-_bound(part, powers), next(order), part, powers, cut))
    result = -heap[0][0]
    return None if result == float("inf") else Fraction(result)


class _FormPower(NamedTuple):
    """An exponent in the representations that the bisection reuses."""

    ball: arb
    near: float
    divides: bool

    @classmethod
    def of(cls, exponent: Fraction) -> "_FormPower":
        return cls(arb(fmpq(exponent.numerator, exponent.denominator)), float(exponent), exponent < 0)


def _bound(forms: Sequence[Form], powers: Sequence[_FormPower]) -> float:
    """Upper bound on the ratio on a piece as a float; infinite if a divisor may vanish."""
    total = arb(1)
    for form, power in zip(forms, powers, strict=True):
        value = form.least() if power.divides else form.largest()
        if power.divides and value <= 0:
            return float("inf")
        total *= arb(value) ** power.ball
    upper = total.upper()
    near = float(upper)  # exact unless out of range of floats
    return near if upper <= near else float_above(end_of(upper))


def _longest(corners: Sequence[Sequence[float]]) -> Edge:
    def length(edge: Edge) -> float:
        return sum((a - b) ** 2 for a, b in zip(corners[edge[0]], corners[edge[1]], strict=True))

    return max(combinations(range(len(corners)), 2), key=length)


def _cut(corners: tuple[tuple[float, ...], ...], edge: Edge, side: int) -> tuple[tuple[float, ...], ...]:
    middle = tuple((a + b) / 2 for a, b in zip(corners[edge[0]], corners[edge[1]], strict=True))
    return tuple(middle if i == edge[1 - side] else c for i, c in enumerate(corners))
