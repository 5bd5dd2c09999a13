"""Rigorous bounds on ratios of forms over the orthant, by bisection of the simplex (Bernstein coefficients).

A form of degree m on the simplex spanned by s_1 … s_n lies between its smallest and its largest Bernstein coefficient,
and takes the coefficients at the corners as values there (Farin, *Curves and Surfaces for CAGD*, ch. 17). Bisecting an
edge by de Casteljau's rule keeps everything in integers.
"""

import heapq
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, lru_cache
from itertools import combinations, count, pairwise, product
from math import factorial, lcm, prod

from flint import arb, fmpq

from quakedesign.rationals import float_above, fraction_of

Polynomial = Mapping[tuple[int, ...], Fraction]
Edge = tuple[int, int]


@cache
def _exponents(variables: int, degree: int) -> tuple[tuple[int, ...], ...]:
    return tuple(e for e in product(range(degree + 1), repeat=variables) if sum(e) == degree)


@cache
def _lines(variables: int, degree: int, edge: Edge) -> tuple[tuple[int, ...], ...]:
    """Places of coefficients that differ only along an edge, in order from its first end to its second."""
    order = {e: i for i, e in enumerate(_exponents(variables, degree))}
    groups: dict[tuple[int, ...], list[tuple[int, int]]] = {}
    for e, place in order.items():
        rest = tuple(v for k, v in enumerate(e) if k not in edge)
        groups.setdefault(rest, []).append((e[edge[1]], place))
    return tuple(tuple(place for _, place in sorted(line)) for line in groups.values())


@dataclass(frozen=True, slots=True)
class Form:
    """A form on one simplex: integer Bernstein coefficients times a scale.

    Attributes
    ----------
    variables, degree : int
    coefficients : tuple of int
        In the order of `_exponents`.
    scale : flint.fmpq
    """

    variables: int
    degree: int
    coefficients: tuple[int, ...]
    scale: fmpq

    @classmethod
    def of(cls, polynomial: Polynomial, variables: int, degree: int, sizes: Sequence[Fraction]) -> "Form":
        """Form p(s_1·size_1, …) on the standard simplex."""
        values = []
        for e in _exponents(variables, degree):
            ways = Fraction(prod(factorial(k) for k in e), factorial(degree))
            values.append(polynomial.get(e, Fraction(0)) * prod(s**k for s, k in zip(sizes, e, strict=True)) * ways)
        common = lcm(*(v.denominator for v in values))
        whole = tuple(int(v * common) for v in values)
        return cls(variables, degree, whole, fmpq(1, common))

    def bisected(self, edge: Edge) -> "tuple[Form, Form]":
        """Forms on the two halves; the first keeps the first end of the edge."""
        left, right = list(self.coefficients), list(self.coefficients)
        for line in _lines(self.variables, self.degree, edge):
            row, n = [self.coefficients[i] for i in line], self.degree
            for k, place in enumerate(line):
                left[place] = row[0] << (n - k)
                right[line[-1 - k]] = row[-1] << (n - k)
                row = [a + b for a, b in pairwise(row)]
        scale = self.scale / (1 << self.degree)
        halves = (tuple(left), tuple(right))
        first, second = (Form(self.variables, self.degree, c, scale) for c in halves)
        return first, second

    def least(self) -> fmpq:
        """Lower bound."""
        return min(self.coefficients) * self.scale

    def largest(self) -> fmpq:
        """Upper bound on the absolute value."""
        return max(abs(c) for c in self.coefficients) * self.scale

    def at_corners(self) -> list[float]:
        """Values at the corners of the simplex, rounded to nearest."""
        places = _corners(self.variables, self.degree)
        return [float(self.coefficients[i] * self.scale) for i in places]


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
    """Rigorous upper bound of Π|f_i|^{a_i} over the standard simplex, the largest over all problems.

    Parameters
    ----------
    problems : iterable of (forms, exponents)
        Forms on the standard simplex; one with a negative exponent must be positive there.
    tolerance : Fraction
        Stop when the bound is within this share of a value that is attained.
    pieces : int
        Largest number of bisections; the bound is rigorous whenever it stops.

    Returns
    -------
    Fraction or None
        None when some form with a negative exponent was not shown to be positive.
    """
    return _largest(tuple((tuple(forms), tuple(exponents)) for forms, exponents in problems), tolerance, pieces)


@lru_cache(maxsize=32)
def _largest(problems: tuple[Problem, ...], tolerance: Fraction, pieces: int) -> Fraction | None:
    order, heap, attained = count(), [], 0.0
    for forms, exponents in problems:
        corners = _identity(forms[0].variables)
        heap.append((-_bound(forms, exponents), next(order), forms, exponents, corners))
    heapq.heapify(heap)
    for _ in range(pieces):
        top, _, forms, exponents, corners = heap[0]
        attained = max(attained, _attained(forms, exponents))
        if -top <= attained * (1 + float(tolerance)):
            break
        heapq.heappop(heap)
        edge = _longest(corners)
        for side, part in enumerate(zip(*(f.bisected(edge) for f in forms), strict=True)):
            cut = _cut(corners, edge, side)
            heapq.heappush(heap, (-_bound(part, exponents), next(order), part, exponents, cut))
    result = -heap[0][0]
    return None if result == float("inf") else Fraction(result)


def _bound(forms: Sequence[Form], exponents: Sequence[Fraction]) -> float:
    """Float not below the largest ratio on a piece; infinite when a divisor may vanish."""
    total = arb(1)
    for form, a in zip(forms, exponents, strict=True):
        value = form.largest() if a > 0 else form.least()
        if a < 0 and value <= 0:
            return float("inf")
        total *= arb(value) ** _power(a)
    return float_above(fraction_of(total.upper().fmpq()))


@cache
def _power(value: Fraction) -> arb:
    return arb(fmpq(value.numerator, value.denominator))


def _attained(forms: Sequence[Form], exponents: Sequence[Fraction]) -> float:
    """Largest value at the corners of a piece; only decides when to stop."""
    values = [[abs(v) for v in f.at_corners()] for f in forms]
    return max(
        prod(v[i] ** float(a) if v[i] else 0.0 for v, a in zip(values, exponents, strict=True))
        for i in range(forms[0].variables)
    )


def _identity(size: int) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(i == j) for j in range(size)) for i in range(size))


def _longest(corners: Sequence[Sequence[float]]) -> Edge:
    def length(edge: Edge) -> float:
        return sum((a - b) ** 2 for a, b in zip(corners[edge[0]], corners[edge[1]], strict=True))

    return max(combinations(range(len(corners)), 2), key=length)


def _cut(corners: tuple[tuple[float, ...], ...], edge: Edge, side: int) -> tuple[tuple[float, ...], ...]:
    middle = tuple((a + b) / 2 for a, b in zip(corners[edge[0]], corners[edge[1]], strict=True))
    return tuple(middle if i == edge[1 - side] else c for i, c in enumerate(corners))
