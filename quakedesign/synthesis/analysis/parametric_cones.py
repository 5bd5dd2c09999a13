"""The programme of a sweep in cvxpy: stated and compiled once, its numbers replaced between points."""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import factorial, prod
from typing import Any

import numpy as np
from scipy import sparse

from quakedesign.certificates import Loop
from quakedesign.certificates.obligations import Obligation
from quakedesign.certificates.witnesses import statement_of
from quakedesign.sos.exact.statement import Statement
from quakedesign.sos.solve.conic import Compiled, in_cones
from quakedesign.sos.solve.joint import shape_of
from quakedesign.symbolic.terms import Term
from quakedesign.synthesis.lyapunov.balancing import exponents_of, lifted_scale, normal
from quakedesign.synthesis.lyapunov.parametric_forms import Row


class Cones:
    """Minimise μ subject to Σ L(N) = 1, Σ L(P_j) = μ·mean(V_j) for every j, and L ≥ 0 on the cone of every row.

    The multipliers of the equations are the margin and a_j.

    Parameters
    ----------
    rows : sequence of Row
    loop : Loop
    monomials : sequence of Term
        V_j.
    scale : tuple of Fraction
        Of the states; the conditions of the rows are in these units.
    """

    def __init__(self, rows: Sequence[Row], loop: Loop, monomials: Sequence[Term], scale: Sequence[Fraction]) -> None:
        import cvxpy as cp

        shapes = self.shapes = [shape_of(_template(row, loop, scale)) for row in rows]
        starts = np.cumsum([0, *(len(s.keys) for s in shapes)])
        placed = list(zip(rows, shapes, starts, strict=False))
        self.columns = np.array([start + shape.index[e] for row, shape, start in placed for _, e, _, _ in row.parts])
        self.parts = np.array([j for row in rows for j, _, _, _ in row.parts])
        count, size = len(monomials), int(starts[-1])
        places, self.slots = np.unique(self.columns * count + self.parts, return_inverse=True)
        each, ones = np.arange(len(places)), np.ones(len(places))
        chosen = sparse.csr_array((ones, (each, places // count)), shape=(len(places), size))
        summed = sparse.csr_array((ones, (places % count, each)), shape=(count, len(places)))
        self._numbers = cp.Parameter(len(places), name="numbers")
        self._moments, level = cp.Variable(size, name="moments"), cp.Variable(name="level")
        self.margin = np.concatenate([shape.vector(row.margin) for row, shape, _ in placed])
        self.means = np.array(means(monomials, loop.states))
        self._unit = self.margin @ self._moments == 1
        sums = summed @ cp.multiply(self._numbers, chosen @ self._moments)
        self._link = sums - level * self.means == 0
        constraints = [self._unit, self._link, *in_cones(shapes, self._moments)]
        self.compiled = Compiled(cp.Problem(cp.Minimize(level), constraints))

    def table(self, parts: Any) -> Any:
        """What every moment (row) is multiplied by in ΣL(N) and in every ΣL(P_j) (columns)."""
        count = len(self.means)
        values = np.bincount(self.columns * count + self.parts, parts, minlength=len(self.margin) * count)
        return np.column_stack([self.margin, values.reshape(-1, count)])

    def solve(self, parts: Any, accuracy: float, *, anew: bool = False) -> tuple[float, Any, Any] | None:
        """Margin, a_j and L for the values of all parts, in the order of the rows; None if the solver fails twice."""
        self._numbers.value = np.bincount(self.slots, parts)
        if not self.compiled.solve(accuracy, anew=anew) and not self.compiled.solve(accuracy):
            return None
        return -float(self._unit.dual_value), self._link.dual_value, self._moments.value


def means(monomials: Sequence[Term], weights: Mapping[str, int]) -> list[float]:
    """Mean of every V_j over all cells and Σu_i = 1, that of u^m being one; zero where signs alternate."""
    means = []
    for term in monomials:
        even = all(kind == "a" for _, _, kind in term.factors)
        powers = exponents_of(term, weights)
        means.append(prod(map(factorial, powers)) / factorial(sum(powers)) if even else 0.0)
    return means


def _template(row: Row, loop: Loop, scale: Sequence[Fraction]) -> Statement:
    """Set and monomials of a row, in scaled variables."""
    whole = lifted_scale(row.equalities, scale)
    support = dict.fromkeys([*(e for _, e, _, _ in row.parts), *row.margin], Fraction(1))
    conditions = (tuple(normal(p, whole) for p in group) for group in (row.equalities, row.inequalities))
    return statement_of(Obligation("", support, *conditions), loop.domain)
