"""From floating-point Gram matrices to an exact sum of squares: round, then put the exact residual back."""

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from flint import fmpq, fmpq_mat
from scipy.linalg import qr

from quakedesign.rationals import fraction_of, nearest
from quakedesign.sos.exact.polynomial import Exponents, Polynomial, degree, monomials, product, times
from quakedesign.sos.exact.proofs import Square, SumOfSquares, identity_holds, residual
from quakedesign.sos.exact.statement import Statement
from quakedesign.sos.solve.faces import Block
from quakedesign.sos.solve.moment import Solution

_BITS = (4, 7, 10, 13, 16, 20, 24, 28, 33, 38, 44)


def rounded(
    statement: Statement,
    blocks: Sequence[Block],
    solution: Solution,
    checked: Callable[[SumOfSquares], SumOfSquares | None] | None = None,
) -> SumOfSquares | None:
    """Exact proof near a floating-point one, with the coarsest rounding that works; None if none does.

    Parameters
    ----------
    statement : Statement
    blocks : sequence of Block
        As solved.
    solution : Solution
    checked : callable, optional
        The exact decision: the proof that is returned for a rounded one, or None where that one does not hold. Unless
        given, the identity is checked and the proof is returned as it is.

    Returns
    -------
    SumOfSquares or None
        Checked.
    """
    decision = checked or (lambda proof: proof if identity_holds(statement, proof) else None)
    system = System(statement, blocks)
    floats = system.flat(solution)
    largest = max((len(b.basis) for b in blocks), default=1)
    enough = largest / max(solution.margin, 2.0**-36)
    for bits in _BITS:
        if 2.0 ** (bits + 3) < enough:
            continue
        values = [nearest(float(v), 2**bits) for v in floats]
        proof = system.proof(values)
        correction = system.correction(residual(statement, proof.squares, proof.cofactors))
        if correction is None:
            return None
        found = decision(system.proof([a + correction[i] if i in correction else a for i, a in enumerate(values)]))
        if found is not None:
            return found
    return None


def relations(statement: Statement) -> Iterator[tuple[int, Exponents, dict[Exponents, Fraction]]]:
    """Equality, monomial and their product, for all products within the degree; among forms of just that degree."""
    size = len(statement.variables)
    for k, h in enumerate(statement.equalities):
        most = statement.degree - degree(h)
        for m in monomials(size, most, max(most, 0) if statement.graded else 0):
            yield k, m, {times(m, e): c for e, c in h.items()}


class System:
    """The linear system from Gram entries and cofactor coefficients to coefficients of the target."""

    def __init__(self, statement: Statement, blocks: Sequence[Block]) -> None:
        self.statement, self.blocks = statement, blocks
        self.entries = [
            (k, i, j) for k, b in enumerate(blocks) for i in range(len(b.basis)) for j in range(i, len(b.basis))
        ]
        self.relations = list(relations(statement))
        self.columns = [self._column(*entry) for entry in self.entries] + [r for _, _, r in self.relations]
        self.single = all(len(c) == 1 for c in self.columns)
        self.pivots: Any = None

    def _column(self, k: int, i: int, j: int) -> dict[Exponents, Fraction]:
        block = self.blocks[k]
        left, right = block.basis[i], block.basis[j]
        factor = Fraction(1 if i == j else 2)
        if isinstance(left, tuple) and isinstance(right, tuple):
            shift = times(left, right)
            return {times(shift, e): factor * c for e, c in block.weight.items()}
        parts: list[Polynomial] = [{b: Fraction(1)} if isinstance(b, tuple) else b for b in (left, right)]
        return {e: factor * c for e, c in product(len(self.statement.variables), (*parts, block.weight)).items()}

    def flat(self, solution: Solution) -> list[float]:
        """All unknowns of a solution in order."""
        grams = [float(solution.grams[k][i][j]) for k, i, j in self.entries]
        return [*grams, *(float(c) for c in solution.cofactors)]

    def proof(self, values: Sequence[Fraction]) -> SumOfSquares:
        """Unknowns as a proof, unchecked."""
        squares, start = [], 0
        for block in self.blocks:
            count = len(block.basis) * (len(block.basis) + 1) // 2
            gram = tuple(values[start : start + count])
            squares.append(Square(product=block.product, basis=block.basis, gram=gram))
            start += count
        cofactors: list[dict[Exponents, Fraction]] = [{} for _ in self.statement.equalities]
        for (k, m, _), value in zip(self.relations, values[start:], strict=True):
            if value:
                cofactors[k][m] = value
        return SumOfSquares(squares=tuple(squares), cofactors=tuple(cofactors))

    def correction(self, missing: Polynomial) -> dict[int, Fraction] | None:
        """Change of the unknowns that produces the residual exactly; None if there is none."""
        return self._spread(missing) if self.single else self._solve(missing)

    def _spread(self, missing: Polynomial) -> dict[int, Fraction] | None:
        feeding: dict[Exponents, list[int]] = {}
        for i, column in enumerate(self.columns):
            feeding.setdefault(next(iter(column)), []).append(i)
        change: dict[int, Fraction] = {}
        for e, c in missing.items():
            if e not in feeding:
                return None
            total = sum((next(iter(self.columns[i].values())) for i in feeding[e]), start=Fraction(0))
            for i in feeding[e] if total else ():
                change[i] = c / total
        return change

    def _solve(self, missing: Polynomial) -> dict[int, Fraction] | None:
        if self.pivots is None:
            self.pivots = self._choose()
        rows, chosen, matrix = self.pivots
        if any(e not in self.rows for e in missing):
            return None
        side = [missing.get(e, Fraction(0)) for e in rows]
        if not rows:
            return {} if not missing else None
        answer = matrix.solve(fmpq_mat([[fmpq(v.numerator, v.denominator)] for v in side]))
        values = [fraction_of(v[0]) for v in answer.tolist()]
        return dict(zip(chosen, values, strict=True))

    def _choose(self) -> Any:
        """Independent rows and columns, by pivoted QR, with the exact square matrix between them."""
        keys = sorted({e for c in self.columns for e in c})
        self.rows = {e: i for i, e in enumerate(keys)}
        dense = np.zeros((len(keys), len(self.columns)))
        for j, column in enumerate(self.columns):
            for e, c in column.items():
                dense[self.rows[e], j] = float(c)
        _, triangle, order = qr(dense, mode="economic", pivoting=True)
        sizes = np.abs(np.diag(triangle))
        rank = int((sizes > 1e-9 * max(sizes.max(initial=0), 1e-300)).sum())
        chosen = [int(j) for j in order[:rank]]
        _, _, order = qr(dense[:, chosen].T, mode="economic", pivoting=True)
        rows = [keys[i] for i in order[:rank]]
        exact = [[self.columns[j].get(e, Fraction(0)) for j in chosen] for e in rows]
        return (
            rows,
            chosen,
            fmpq_mat([[fmpq(v.numerator, v.denominator) for v in row] for row in exact]) if rank else None,
        )
