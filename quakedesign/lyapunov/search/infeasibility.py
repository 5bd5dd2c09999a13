"""Exact proofs that a family contains no Lyapunov function, by weighted points (exact dual solutions)."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from flint import fmpq, fmpq_mat
from scipy.optimize import linprog

from quakedesign.errors import CertificateError
from quakedesign.exact import fraction_of
from quakedesign.lyapunov.exact.claim import Loop
from quakedesign.lyapunov.exact.obligations import Obligation, Obligations
from quakedesign.lyapunov.search.lyapunov_search import balance, exponents_of
from quakedesign.sos import Polynomial
from quakedesign.sos.exact.polynomial import monomial
from quakedesign.symbolic.term_expressions import signed_monomials
from quakedesign.symbolic.terms import Term

_GRID = 4096  # denominator of the points before scaling by powers of two
_ROUNDS, _FIRST, _MORE = 12, 40, 400
_SURE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Atom:
    """Weighted point at which the polynomial of one obligation is evaluated."""

    obligation: str  # Name as in a certificate
    point: tuple[Fraction, ...]  # Coordinates u_i ≥ 0 of the states, not all zero
    weight: Fraction  # Positive


@dataclass(frozen=True, slots=True, kw_only=True)
class Dual:
    """Proof by Σ weight·P_o(point) = 0 for every V of a family, so that no V has P_o > 0 at all these points.

    P_o are V and −V̇ on cells. The family contains all sums of even C¹ signed monomials of one degree
    (`signed_monomials`). The proof excludes positivity itself, not only sums of squares of some level.
    """

    loop: Loop
    degree: int  # Degree of V
    atoms: tuple[Atom, ...]

    @property
    def holds(self) -> bool:
        """Whether the proof is valid, re-checked in exact arithmetic."""
        if not _sharp(self.loop):
            return False
        monomials = signed_monomials(self.loop.states, self.degree, self.loop.domain)
        rows = {row[0].name: row for row in _rows(self.loop, monomials)}
        totals = [Fraction(0)] * len(monomials)
        for atom in self.atoms:
            row = rows.get(atom.obligation)
            inside = len(atom.point) == len(self.loop.states) and min(atom.point) >= 0 and any(atom.point)
            if row is None or not inside or atom.weight <= 0 or not _admits(row[0], atom.point):
                return False
            totals = [t + atom.weight * v for t, v in zip(totals, _values(row, atom.point), strict=True)]
        return bool(self.atoms and monomials) and not any(totals)


def dual(loop: Loop, degree: int) -> Dual | None:
    """Exact proof that no V of a degree proves the stability of a loop; None if no such proof is found.

    None does not imply that a V exists. None is also returned for nested powers with positive exponents, whose cells
    contain few rational points, and for irrational roots of gains, since the loop does not attain the ends of their
    enclosures.

    Parameters
    ----------
    loop : Loop
        Closed loop with the domain `cells`.
    degree : int
        Degree of V in the weights of the loop.
    """
    monomials = signed_monomials(loop.states, degree, loop.domain)
    try:
        rows = list(_rows(loop, monomials)) if monomials else []
    except CertificateError:
        return None
    if not rows or not _sharp(loop) or any(row[0].equalities for row in rows):
        return None
    return _PointSearch(loop, degree, monomials, rows).result()


def _sharp(loop: Loop) -> bool:
    """Whether every vertex of the ranges is attained by the loop."""
    return all(low == high for _, (low, high) in loop.roots.values())


def _rows(loop: Loop, monomials: Sequence[Term]) -> Iterator[tuple[Obligation, ...]]:
    """Rows of all V_j, then of all −V̇_j, on every distinct cell and vertex."""
    columns = [Obligations(loop, (term,)) for term in monomials]
    functions = zip(*([Obligation(n, p) for n, p in c.function()] for c in columns), strict=True)
    rates = zip(*([one for _, one in c.decrease("decrease")] for c in columns), strict=True)
    seen = set()
    for row in (*functions, *rates):
        key = tuple(one.key for one in row)
        if key not in seen:
            seen.add(key)
            yield row


def _values(row: Sequence[Obligation], point: Sequence[Fraction]) -> list[Fraction]:
    return [_value(one.polynomial, point) for one in row]


def _value(polynomial: Polynomial, point: Sequence[Fraction]) -> Fraction:
    return sum((c * monomial(point, e) for e, c in polynomial.items()), Fraction(0))


def _admits(one: Obligation, point: Sequence[Fraction]) -> bool:
    """Whether interior points of the cell exist near this point; where a condition is zero, they may not."""
    return not one.equalities and all(_value(g, point) > 0 for g in one.inequalities)


class _PointSearch:
    """Cutting-plane search: points are added to a linear programme over V until it has no solution."""

    def __init__(
        self, loop: Loop, degree: int, monomials: Sequence[Term], rows: Sequence[tuple[Obligation, ...]]
    ) -> None:
        self.loop, self.degree, self.rows = loop, degree, rows
        self.scale = balance(loop)
        self.sizes = [monomial(self.scale, exponents_of(t, loop.states)) for t in monomials]
        self.random = np.random.default_rng(0)
        self.places: list[tuple[int, tuple[Fraction, ...]]] = []
        self.lines: list[list[float]] = []

    def result(self) -> Dual | None:
        for row in range(len(self.rows)):
            for _ in range(_FIRST):
                self.add(row, self.draw())
        for _ in range(_ROUNDS):
            margin, decision = self.best()
            if margin <= _SURE:
                return self.exact()
            if not self.refine(decision):
                return None
        return None

    def add(self, row: int, point: tuple[Fraction, ...]) -> None:
        if _admits(self.rows[row][0], point):
            line = self.line(row, point)
            if any(line):
                self.places.append((row, point))
                self.lines.append(line)

    def draw(self) -> tuple[Fraction, ...]:
        """Random point in the scaled variables, in some draws on a face."""
        count = len(self.scale)
        parts = self.random.exponential(size=count) * 2.0 ** self.random.uniform(-5, 0, size=count)
        parts *= self.random.random(count) > 0.15
        if not parts.any():
            parts[int(self.random.integers(count))] = 1.0
        return self.rounded(parts)

    def near(self, point: Sequence[Fraction]) -> tuple[Fraction, ...]:
        """Random point near another one, on the same faces."""
        parts = np.array([float(p / s) for p, s in zip(point, self.scale, strict=True)])
        return self.rounded(parts * 2.0 ** self.random.normal(scale=0.2, size=len(parts)))

    def rounded(self, parts: np.ndarray) -> tuple[Fraction, ...]:
        whole = [round(_GRID * float(p / parts.max())) for p in parts]
        return tuple(s * Fraction(n, _GRID) for s, n in zip(self.scale, whole, strict=True))

    def line(self, row: int, point: Sequence[Fraction]) -> list[float]:
        """Values of all V_j or −V̇_j at a point, over the sizes of V_j, scaled to a largest value of one."""
        values = [v / s for v, s in zip(_values(self.rows[row], point), self.sizes, strict=True)]
        largest = max(map(abs, values)) or Fraction(1)
        return [float(v / largest) for v in values]

    def best(self) -> tuple[float, np.ndarray]:
        """Largest margin t with line·a ≥ t on all lines and |a_j| ≤ 1, and its a."""
        A = np.hstack([-np.array(self.lines), np.ones((len(self.lines), 1))])
        count = A.shape[1] - 1
        cost = [*[0.0] * count, -1.0]
        solution = linprog(cost, A_ub=A, b_ub=np.zeros(len(A)), bounds=[(-1, 1)] * count + [(0, 1)], method="highs")
        return (float(solution.x[-1]), solution.x[:-1]) if solution.status == 0 else (1.0, np.zeros(count))

    def refine(self, decision: np.ndarray) -> bool:
        """Add the most violated of many new points; False if none is violated."""
        count = len(self.lines)
        tight = np.argsort(np.array(self.lines) @ decision)[: 2 * len(decision)]
        for i in range(_MORE):
            if i % 2:
                self.add(int(self.random.integers(len(self.rows))), self.draw())
            else:
                row, point = self.places[int(self.random.choice(tight))]
                self.add(row, self.near(point))
        values = np.array(self.lines[count:]) @ decision
        violated = [count + int(i) for i in np.argsort(values)[: _MORE // 4] if values[i] < _SURE]
        self.places[count:] = [self.places[i] for i in violated]
        self.lines[count:] = [self.lines[i] for i in violated]
        return bool(violated)

    def exact(self) -> Dual | None:
        """Dual with exact weights of a basic solution; None if it is not valid."""
        A = np.vstack([np.array(self.lines).T, np.ones(len(self.lines))])
        b = np.array([*[0.0] * (len(A) - 1), 1.0])
        solution = linprog(np.zeros(A.shape[1]), A_eq=A, b_eq=b, bounds=(0, None), method="highs-ds")
        if solution.status != 0:
            return None
        chosen = [self.places[i] for i in np.flatnonzero(solution.x > _SURE)]
        weights = _null_vector([_values(self.rows[row], point) for row, point in chosen])
        if weights is None:
            return None
        atoms = tuple(
            Atom(obligation=self.rows[row][0].name, point=point, weight=w)
            for (row, point), w in zip(chosen, weights, strict=True)
        )
        answer = Dual(loop=self.loop, degree=self.degree, atoms=atoms)
        return answer if answer.holds else None


def _null_vector(rows: Sequence[Sequence[Fraction]]) -> list[Fraction] | None:
    """Positive w with Σ w_i row_i = 0, if it is unique up to a factor; else None."""
    entries = [[fmpq(v.numerator, v.denominator) for v in column] for column in zip(*rows, strict=True)]
    reduced, rank = fmpq_mat(entries).rref()
    if rank != len(rows) - 1:
        return None
    free = next(j for j in range(len(rows)) if j >= rank or reduced[j, j] != 1)
    vector = [-fraction_of(reduced[i, free]) for i in range(rank)]
    vector.insert(free, Fraction(1))
    return vector if min(vector) > 0 else None
