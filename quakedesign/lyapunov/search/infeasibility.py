"""Exact proofs that a family contains no Lyapunov function, and falsification of a loop by simulation.

The proofs are exact dual solutions: points with positive weights.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations, product

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
_ROUNDS, _FIRST, _MORE = 12, 40, 400  # number of refinements; of first points per row; of new points per refinement
_SURE = 1e-9  # margins and weights up to this value count as zero


@dataclass(frozen=True, slots=True, kw_only=True)
class Atom:
    """Weighted point at which the polynomial of one obligation is evaluated."""

    obligation: str  # Name as in a certificate
    point: tuple[Fraction, ...]  # Coordinates u_i ≥ 0 of the states, not all zero
    weight: Fraction  # Positive


@dataclass(frozen=True, slots=True, kw_only=True)
class Dual:
    """Proof that no V of a family has P_o > 0 at all given points: Σ weight·P_o(point) = 0 for every V.

    P_o are V and −V̇ on cells. The family contains all sums of even C¹ signed monomials of one degree
    (`signed_monomials`). The proof excludes positivity itself, not only a sum of squares of some level.
    """

    loop: Loop
    degree: int  # Degree of V
    atoms: tuple[Atom, ...]

    @property
    def holds(self) -> bool:
        """Whether the proof is valid, re-checked in exact arithmetic."""
        if not _attains_vertices(self.loop):
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
    if not rows or not _attains_vertices(loop) or any(row[0].equalities for row in rows):
        return None
    return _PointSearch(loop, degree, monomials, rows).result()


def _attains_vertices(loop: Loop) -> bool:
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
        """Values of all V_j or −V̇_j at a point, divided by the sizes of the V_j, then by the largest magnitude."""
        values = [v / s for v, s in zip(_values(self.rows[row], point), self.sizes, strict=True)]
        largest = max(map(abs, values)) or Fraction(1)
        return [float(v / largest) for v in values]

    def best(self) -> tuple[float, np.ndarray]:
        """Largest margin t with line·a ≥ t for all lines and |a_j| ≤ 1, and the maximising a."""
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
        result = Dual(loop=self.loop, degree=self.degree, atoms=atoms)
        return result if result.holds else None


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


# ----------------------------------------------------------------------
# Falsification of a homogeneous loop by simulation: disturbances under which the state grows.

_STARTS = 6
_GROWTH = 1.0  # e-foldings from which a run is repeated with smaller steps
_AGAIN = 1.4  # least ratio of growth in twice the time with half the step; less is chatter or a transient
_UNCOUNTED = 0.25  # initial share of a run whose growth is not counted


@dataclass(frozen=True, slots=True, kw_only=True)
class Escape:
    """Simulation in floating point whose state grows; as the loop is homogeneous, the growth is unbounded."""

    growth: float  # e-foldings of Σ|x_i|^{1/r_i} over the run
    strategy: str  # Sign that determines the end of the range, for each uncertain parameter


def escape(loop: Loop, *, steps: int = 6000) -> Escape | None:
    """Simulation whose state grows at two step sizes, with parameters at the ends of their ranges; None if not found.

    A sign selects the end of the range of an uncertain parameter. If all its terms are odd in the states, this is the
    sign of a product of two states, or of a state and its rate; otherwise, of one state or rate.

    Parameters
    ----------
    steps : int
        Number of steps of the first runs; a step moves the state by at most 1/200 of its size.
    """
    field = _FloatField(loop)
    strategies = list(product(*(_choices(loop, name) for name in loop.uncertain)))
    coarse = field.growths(strategies, steps, 1 / 200)
    for i in sorted(range(len(strategies)), key=lambda i: -coarse[i])[:3]:
        if coarse[i] < _GROWTH:
            break
        fine = field.growths(strategies[i : i + 1], 4 * steps, 1 / 400)[0]
        if fine > _AGAIN * coarse[i]:
            followed = (f"{name} follows {one}" for name, one in zip(loop.uncertain, strategies[i], strict=True))
            return Escape(growth=float(fine), strategy=", ".join(followed))
    return None


@dataclass(frozen=True, slots=True)
class _Strategy:
    """Sign that a parameter follows: that of a product of states and rates, with rates at the middle of all ranges."""

    names: tuple[str, ...]
    sign: int

    def __str__(self) -> str:
        return ("" if self.sign > 0 else "-") + "·".join(self.names)


def _choices(loop: Loop, name: str) -> list[_Strategy]:
    low, high = loop.uncertain[name]
    rates = {state: f"{state}'" for state in loop.states}
    products: list[tuple[str, ...]]
    terms = (term for rates in loop.field.values() for term in rates if name in term.parameters)
    if all(sum(kind == "s" for _, _, kind in term.factors) % 2 == 1 for term in terms):  # odd in its states
        products = [*rates.items(), *combinations(loop.states, 2)]
    else:
        products = [(one,) for pair in rates.items() for one in pair]
    everything = [_Strategy(names, sign) for names in products for sign in (1, -1)]
    return everything if low < high else everything[:1]


class _FloatField:
    """Field of a loop in floating point, vectorised over columns of states and parameters."""

    def __init__(self, loop: Loop) -> None:
        self.loop, self.states = loop, list(loop.states)
        self.weights = np.array(list(loop.states.values()), dtype=float)[:, None]

    def rates(self, x: np.ndarray, parameters: Mapping[str, np.ndarray | float]) -> np.ndarray:
        """Rates x' for states of shape (n, columns)."""
        values = dict(zip(self.states, x, strict=True))
        for lift, terms in self.loop.lifts.items():
            values[lift] = self._sum(terms, values, parameters)
        columns = [self._sum(terms, values, parameters) + np.zeros(x.shape[1]) for terms in self.loop.field.values()]
        return np.array(columns)

    def _sum(
        self,
        terms: Sequence[Term],
        values: Mapping[str, np.ndarray | float],
        parameters: Mapping[str, np.ndarray | float],
    ) -> np.ndarray | float:
        total: np.ndarray | float = 0.0
        for term in terms:
            part: np.ndarray | float = float(term.coefficient)
            for name in term.parameters:
                part = part * parameters[name]
            for state, exponent, kind in term.factors:
                size = np.abs(values[state]) ** float(exponent) if exponent else 1.0
                part = part * size * (np.sign(values[state]) if kind == "s" else 1.0)
            total = total + part
        return total

    def growths(self, strategies: Sequence[tuple[_Strategy, ...]], steps: int, step: float) -> np.ndarray:
        """Largest growth of every strategy over all initial states [e-foldings], without the first quarter of a run."""
        x = np.tile(np.random.default_rng(0).normal(size=(len(self.states), _STARTS)), len(strategies))
        middle, ends = self._parameters()
        growth = np.zeros(x.shape[1])
        followed = {name: self._followed([one[i] for one in strategies]) for i, name in enumerate(self.loop.uncertain)}
        columns = np.arange(x.shape[1])
        for number in range(steps):
            size = (np.abs(x) ** (1 / self.weights)).sum(axis=0)
            x = x / size**self.weights
            growth += np.log(size) if number > steps * _UNCOUNTED else 0.0
            signs = np.sign(np.concatenate([x, self.rates(x, middle), np.ones((1, x.shape[1]))]))
            chosen: dict[str, np.ndarray | float] = dict(middle)
            for name, (low, high) in ends.items():
                first, second, sign = followed[name]
                chosen[name] = np.where(signs[first, columns] * signs[second, columns] * sign > 0, high, low)
            rates = self.rates(x, chosen)
            x = x + step * rates / np.abs(rates).max(axis=0)
        return np.asarray(growth.reshape(len(strategies), _STARTS).max(axis=1))

    def _followed(self, strategies: Sequence[_Strategy]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows (of states, rates and a one) of the two signs multiplied in a column, and the sign of its strategy."""
        rows = {name: i for i, name in enumerate((*self.states, *(f"{s}'" for s in self.states), ""))}
        pairs = np.array([[rows[name] for name in (*one.names, "")[:2]] for one in strategies])
        return (*np.repeat(pairs, _STARTS, axis=0).T, np.repeat([one.sign for one in strategies], _STARTS))

    def _parameters(self) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
        """All parameters, those with ranges at their middle, and the ends of the ranges."""
        ends = {name: (float(low), float(high)) for name, (low, high) in self.loop.uncertain.items()}
        middle = {name: float(v) for name, v in self.loop.parameters.items()}
        middle |= {name: middle[of] ** 0.5 for name, (of, _) in self.loop.roots.items()}
        return middle | {name: (low + high) / 2 for name, (low, high) in ends.items()}, ends
