"""Largest values of linear functions on polytopes that lie in a box: multipliers from floats, decided in integers.

Numbers are integers in units of 2^-BITS, each with a bound of its error. A function c·u + k on the points u of a
polytope, |u_i| <= 1, is at most the sum of multipliers >= 0 times the ends of constraints, plus k and the rest of c.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite

from .matrices import BITS, LARGEST
from .reading import Row, need

ONE = 1 << BITS
GRAIN = 40  # binary places of a multiplier
TRIED = 8  # vertices, best ones first
NEAR = 1e-6  # by which a vertex may lie outside, against its constraint
FLAT = 1e-12  # pivots below which a basis counts as dependent

Constraint = tuple[Row, Fraction]


@dataclass(frozen=True, slots=True)
class Near:
    """A number within `off` of `at`, in units of 2^-BITS."""

    at: int
    off: int

    @classmethod
    def of(cls, value: Fraction) -> "Near":
        """A rational; one that is a multiple of the unit is itself."""
        at, more = divmod(value.numerator << BITS, value.denominator)
        need(abs(at) <= LARGEST, "numbers of a period must be below 2^192")
        return cls(at, int(more > 0))

    def __add__(self, other: "Near") -> "Near":
        return Near(self.at + other.at, self.off + other.off)

    def __mul__(self, other: "Near") -> "Near":
        if NOTHING in (self, other):
            return NOTHING
        off = abs(self.at) * other.off + abs(other.at) * self.off + self.off * other.off
        return Near(self.at * other.at >> BITS, (off >> BITS) + 2)

    def __abs__(self) -> "Near":
        return Near(abs(self.at), self.off)

    def times(self, factor: Fraction) -> "Near":
        """Times a rational."""
        if self == NOTHING or not factor:
            return NOTHING
        top, bottom = factor.numerator, factor.denominator
        return Near(self.at * top // bottom, self.off * abs(top) // bottom + 2)

    def above(self) -> "Near":
        """The number, or 0 where it is negative, from above."""
        return Near(max(self.at + self.off, 0), 0)


NOTHING = Near(0, 0)


def inverse(rows: list[list[float]]) -> list[list[float]] | None:
    """Inverse of a small matrix in floating point; None if a pivot is nearly 0."""
    many = len(rows)
    work = []
    for i, line in enumerate(rows):
        length = max(map(abs, line)) or 1.0
        work.append([v / length for v in line] + [(i == j) / length for j in range(many)])
    for i in range(many):
        best = max(range(i, many), key=lambda j: abs(work[j][i]))
        work[i], work[best] = work[best], work[i]
        pivot = work[i][i]
        if not abs(pivot) > FLAT:
            return None
        work[i] = [v / pivot for v in work[i]]
        for j in range(many):
            factor = work[j][i]
            if j != i and factor:
                work[j] = [a - factor * b for a, b in zip(work[j], work[i], strict=True)]
    return [line[many:] for line in work]


@dataclass(frozen=True, slots=True)
class Function:
    """(row + more)·z + constant + beside: rationals, and numbers with error bounds."""

    row: Row
    constant: Fraction
    more: Sequence[Near]
    beside: Near = NOTHING


class Polytope:
    """Points z with constraints row·z <= end, written as u = z/sizes, |u_i| <= 1; some u_i have a known sign.

    Where there is a fourth entry, the slip until a stop, the last constraint says that it is at most so many
    times the second.
    """

    def __init__(
        self, constraints: Sequence[Constraint], sizes: Row, signs: Sequence[int], bases: Sequence[Sequence[int]]
    ) -> None:
        self.lines, self.sizes, self.signs = constraints, sizes, signs
        self.rows = [[Near.of(v * size).at for v, size in zip(row, sizes, strict=True)] for row, _ in constraints]
        self.ends = [Near.of(end).at for _, end in constraints]
        floats = [[v / ONE for v in row] for row in self.rows]
        ends = [v / ONE for v in self.ends]
        lengths = [max(map(abs, row)) for row in floats]
        self.found = []
        for basis in bases:
            turned = inverse([floats[j] for j in basis])
            if turned is None:
                continue
            place = [sum(v * ends[j] for v, j in zip(line, basis, strict=True)) for line in turned]
            inside = (
                sum(a * b for a, b in zip(row, place, strict=True)) <= end + NEAR * length
                for row, end, length in zip(floats, ends, lengths, strict=True)
            )
            if all(map(isfinite, place)) and all(inside):
                self.found.append((place, basis, list(zip(*turned, strict=True))))
        need(bool(self.found), "the bases of each polytope must name vertices of it")
        self.places = [place for place, _, _ in self.found]

    def largest(self, function: Function, facet: int | None = None) -> int:
        """An upper bound of a function, in units; for the image of a `facet` the least one, or the first up to 1."""
        moved = [v.times(size) for v, size in zip(function.more, self.sizes, strict=True)]
        scaled = [Near.of(v * size) + m for v, size, m in zip(function.row, self.sizes, moved, strict=True)]
        constant = Near.of(function.constant) + function.beside
        above = constant.at + constant.off
        need(max(abs(f.at) for f in scaled) <= LARGEST, "numbers of a period must be below 2^192")
        floats = [f.at / ONE for f in scaled]
        values = [sum(map(float.__mul__, floats, place)) for place in self.places]
        best = max(values)
        near = [i for i, value in enumerate(values) if value >= best - NEAR * (abs(best) + NEAR)]
        near.sort(key=values.__getitem__, reverse=True)
        found = [] if facet is None else [self.second(function, moved, facet)]
        for i in near[:TRIED]:
            if facet is not None and found and min(found) <= ONE:
                break
            found.append(self.by_vertex(scaled, floats, i) + above)
        return min(found)

    def by_vertex(self, scaled: Sequence[Near], floats: list[float], number: int) -> int:
        """By multipliers of the constraints that meet at a vertex."""
        _, basis, columns = self.found[number]
        raw = [sum(map(float.__mul__, floats, column)) for column in columns]
        shares = [max(round(v * (1 << GRAIN)), 0) if isfinite(v) else 0 for v in raw]
        slack = (sum(shares) >> GRAIN) + 2  # rows and ends are one unit off at most
        total = (sum(share * self.ends[j] for share, j in zip(shares, basis, strict=True)) >> GRAIN) + slack
        left = []
        for i, factor in enumerate(scaled):
            taken = sum(share * self.rows[j][i] for share, j in zip(shares, basis, strict=True)) >> GRAIN
            left.append(Near(factor.at - taken, factor.off + slack))
        return total + self.rest(left, self.signs)

    def second(self, function: Function, moved: Sequence[Near], facet: int) -> int:
        """By the facet itself, which is at most 1, and the difference from it; exact where that is rational."""
        left = [v - n for v, n in zip(function.row, self.lines[facet][0], strict=True)]
        if len(left) == 4:  # the slip until a stop is at most so many times the second
            left[1], left[3] = left[1] - max(left[3], Fraction(0)) * self.lines[-1][0][1], Fraction(0)
        exact, total = function.constant, function.beside
        for v, size, sign, more in zip(left, self.sizes, self.signs, moved, strict=True):
            if more == NOTHING:
                exact += max(sign * v, Fraction(0)) * size if sign else abs(v) * size
            else:
                total += Near(self.rest([Near.of(v * size) + more], [sign]), 0)
        total += Near.of(exact)
        return ONE + total.at + total.off

    def rest(self, left: Sequence[Near], signs: Sequence[int]) -> int:
        """Bound of the remainder of the multipliers, by the known signs."""
        signed = (abs(v) if not sign else Near(sign * v.at, v.off) for v, sign in zip(left, signs, strict=True))
        return sum(v.above().at for v in signed)
