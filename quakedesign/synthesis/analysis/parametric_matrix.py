"""The sparse matrix of a sweep: built once, its numbers replaced in place between points."""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import factorial, prod
from typing import Any

from quakedesign.certificates import Loop
from quakedesign.certificates.obligations import Obligation
from quakedesign.certificates.witnesses import statement_of
from quakedesign.sos import Polynomial
from quakedesign.sos.exact.statement import Statement
from quakedesign.sos.solve.decide import initial_blocks
from quakedesign.sos.solve.faces import modulo
from quakedesign.sos.solve.moment import MomentProgram, settings, useful
from quakedesign.sos.solve.rounding import relations
from quakedesign.symbolic.terms import Term
from quakedesign.synthesis.lyapunov.balancing import exponents_of, lifted_scale, scaled
from quakedesign.synthesis.lyapunov.parametric_forms import Row


class Matrix:
    """Constraints A x + s = b on x = (moments of every row, μ), and the solver that holds them.

    Equation 0 is Σ L(N) = 1, equation 1 + j is Σ L(P_j) − μ·mean(V_j) = 0; then come relations and localizing matrices.

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
        import numpy as np

        self._solver: Any = None
        self._accuracy = 0.0
        shapes = [_shape(_template(row, loop, scale)) for row in rows]
        starts = np.concatenate([[0], np.cumsum([len(s.keys) for s in shapes])]).astype(int)
        self.part_rows = np.array([1 + j for row in rows for j, _, _, _ in row.parts])
        self.part_columns = np.array(
            [
                start + shape.index[e]
                for row, shape, start in zip(rows, shapes, starts, strict=False)
                for _, e, _, _ in row.parts
            ]
        )
        self._assemble(rows, shapes, starts, means(monomials, loop.states))

    def _assemble(
        self, rows: Sequence[Row], shapes: Sequence[MomentProgram], starts: Any, mean: Sequence[float]
    ) -> None:
        import clarabel
        import numpy as np
        from scipy import sparse

        count, total = len(mean), int(starts[-1])
        fixed: list[tuple[Any, Any, Any]] = [(1 + np.arange(count), np.full(count, total), -np.array(mean))]
        first = 1 + count
        for row, shape, start in zip(rows, shapes, starts, strict=False):
            margin = shape.vector(row.margin)
            fixed.append((np.zeros(len(margin), dtype=int), start + np.arange(len(margin)), margin))
            number, column, value = shape.relation_entries
            fixed.append((first + number, start + column, value))
            first += shape.relation_count
        cones = [clarabel.ZeroConeT(first)]
        for shape, start in zip(shapes, starts, strict=False):
            number, column, value, _ = shape.localizing
            fixed.append((first + number, start + column, -value))
            cones += [clarabel.PSDTriangleConeT(block.size) for block in shape.blocks]
            first += sum(block.size * (block.size + 1) // 2 for block in shape.blocks)
        line, column, value = (np.concatenate(part) for part in zip(*fixed, strict=True))
        kept = value != 0
        line, column, value = line[kept], column[kept], value[kept]
        place = np.concatenate([self.part_columns * first + self.part_rows, column * first + line])
        places, slots = np.unique(place, return_inverse=True)
        self.slots = slots[: len(self.part_rows)]
        self.fixed = np.bincount(slots[len(self.part_rows) :], value, minlength=len(places))
        pointers = np.searchsorted(places, np.arange(total + 2) * first)
        self.matrix = sparse.csc_matrix((self.fixed.copy(), places % first, pointers), shape=(first, total + 1))
        self.right, self.cost, self.cones = np.zeros(first), np.zeros(total + 1), cones
        self.right[0] = self.cost[-1] = 1.0

    def solve(self, parts: Any, accuracy: float) -> Any:
        """Answer of the solver for the values of all parts, in the order of the rows; None if it fails twice."""
        import numpy as np

        self.matrix.data = self.fixed + np.bincount(self.slots, parts, minlength=len(self.fixed))
        answer = self._solved(accuracy, renew=False)
        if answer is None:
            answer = self._solved(accuracy, renew=True)
        return answer

    def _solved(self, accuracy: float, *, renew: bool) -> Any:
        import clarabel
        from scipy import sparse

        if renew or self._solver is None or self._accuracy != accuracy:
            nothing = sparse.csc_matrix((len(self.cost),) * 2)
            data = (nothing, self.cost, self.matrix, self.right, self.cones)
            self._solver, self._accuracy = clarabel.DefaultSolver(*data, settings(accuracy)), accuracy
        else:
            self._solver.update(A=self.matrix)
        answer = self._solver.solve()
        return answer if useful(answer) else None


def means(monomials: Sequence[Term], weights: Mapping[str, int]) -> list[float]:
    """Mean of every V_j over all cells and Σu_i = 1, that of u^m being one; zero where signs alternate."""
    found = []
    for term in monomials:
        even = all(kind == "a" for _, _, kind in term.factors)
        powers = exponents_of(term, weights)
        found.append(prod(map(factorial, powers)) / factorial(sum(powers)) if even else 0.0)
    return found


def scales_of(row: Row, scale: Sequence[Fraction]) -> tuple[Fraction, ...]:
    """Scale of all variables of a row, given that of the states."""
    return lifted_scale(row.equalities, scale)


def _template(row: Row, loop: Loop, scale: Sequence[Fraction]) -> Statement:
    """Set and monomials of a row, in scaled variables."""
    whole = scales_of(row, scale)

    def normal(p: Polynomial) -> dict:
        found = scaled(p, whole)
        size = max(abs(c) for c in found.values())
        return {e: c / size for e, c in found.items()}

    support = dict.fromkeys([*(e for _, e, _, _ in row.parts), *row.margin], Fraction(1))
    conditions = tuple(map(normal, row.equalities)), tuple(map(normal, row.inequalities))
    return statement_of(Obligation("", support, *conditions), loop.domain)


def _shape(template: Statement) -> MomentProgram:
    multiples = [r for _, _, r in relations(template)]
    blocks = modulo(initial_blocks(template), multiples)
    lines = [{e: float(c) for e, c in r.items()} for r in multiples]
    return MomentProgram([b.shape() for b in blocks], lines)
