"""Rounding of Gram matrices to an exact sum of squares, and exact scaling of variables."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import prod
from typing import Any

import numpy as np
from flint import fmpq, fmpq_mat
from scipy.linalg import qr

from quakedesign.exact import fraction_of, nearest
from quakedesign.sos.exact.polynomial import (
    Exponents,
    Polynomial,
    degree,
    monomial,
    monomials,
    product,
    rescaled,
    times,
)
from quakedesign.sos.exact.polynomial_statement import Statement
from quakedesign.sos.exact.proofs import (
    Element,
    Functional,
    Point,
    Proof,
    Square,
    SumOfSquares,
    as_polynomial,
    identity_holds,
    residual,
)
from quakedesign.sos.solve.facial_reduction import Block
from quakedesign.sos.solve.moment import MomentSolution

# ----------------------------------------------------------------------
# From floating-point Gram matrices to an exact sum of squares: round, then add back the exact residual.

_BITS = (4, 7, 10, 13, 16, 20, 24, 28, 33, 38, 44)


def rounded(
    statement: Statement,
    blocks: Sequence[Block],
    solution: MomentSolution,
    checked: Callable[[SumOfSquares], SumOfSquares | None] | None = None,
) -> SumOfSquares | None:
    """Exact proof near a floating-point solution, by the coarsest rounding that is valid; None if none is valid.

    Parameters
    ----------
    blocks : sequence of Block
        Blocks of the solution.
    checked : callable, optional
        Exact check that maps a rounded proof to the proof to return, or to None if it is invalid. By default the
        identity is checked and the proof returned unchanged.

    Returns
    -------
    SumOfSquares or None
        Checked proof.
    """
    check = checked or (lambda proof: proof if identity_holds(statement, proof) else None)
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
        valid = check(system.proof([a + correction[i] if i in correction else a for i, a in enumerate(values)]))
        if valid is not None:
            return valid
    return None


def relations(statement: Statement) -> Iterator[tuple[int, Exponents, dict[Exponents, Fraction]]]:
    """Index of an equality, monomial and their product, for all products up to (forms: of) the degree bound."""
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
        match left, right:
            case tuple(), tuple():
                shift = times(left, right)
                return {times(shift, e): factor * c for e, c in block.weight.items()}
        parts = as_polynomial(left), as_polynomial(right), block.weight
        return {e: factor * c for e, c in product(len(self.statement.variables), parts).items()}

    def flat(self, solution: MomentSolution) -> list[float]:
        """Gram entries and cofactor coefficients of a solution, in order."""
        grams = [float(solution.grams[k][i][j]) for k, i, j in self.entries]
        return [*grams, *(float(c) for c in solution.cofactors)]

    def proof(self, values: Sequence[Fraction]) -> SumOfSquares:
        """Unchecked proof with given values of the unknowns."""
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
        """Change of the unknowns that exactly produces a residual; None if there is none."""
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
        """Independent rows and columns, by pivoted QR, and the exact square matrix that they define."""
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


# ----------------------------------------------------------------------
# Exact scaling to coefficients of about one, so that the units do not affect the solver.


@dataclass(frozen=True, kw_only=True)
class Scaled:
    """Statement in ũ = u/scale; scales are powers of two; each polynomial is divided by its largest |coefficient|."""

    statement: Statement
    scale: tuple[Fraction, ...]
    target: Fraction  # Divisor of the target
    # inequalities, equalities: Divisors of the constraints
    inequalities: tuple[Fraction, ...]
    equalities: tuple[Fraction, ...]

    def restore(self, proof: Proof) -> Proof:
        """Proof of the statement in u from a proof in ũ."""
        match proof:
            case Point():
                return Point(coordinates=tuple(s * x for s, x in zip(self.scale, proof.coordinates, strict=True)))
            case Functional():
                return Functional(values={e: v * monomial(self.scale, e) for e, v in proof.values.items()})
        return self.restored(proof)

    def restored(self, proof: SumOfSquares) -> SumOfSquares:
        """Sum of squares in u from one in ũ."""
        inverse = tuple(1 / s for s in self.scale)
        squares = tuple(_transformed(s, inverse, self._factor(s)) for s in proof.squares)
        cofactors = tuple(
            {e: c * self.target / factor for e, c in rescaled(q, inverse).items()}
            for q, factor in zip(proof.cofactors, self.equalities, strict=True)
        )
        return SumOfSquares(squares=squares, cofactors=cofactors, multiplier=proof.multiplier)

    def square(self, square: Square) -> Square:
        """Square in ũ from one in u."""
        return _transformed(square, self.scale, 1 / self._factor(square))

    def _factor(self, square: Square) -> Fraction:
        """Factor from the Gram matrix in ũ to that in u."""
        return self.target / prod(self.inequalities[i] for i in square.product)


def _transformed(square: Square, scale: Sequence[Fraction], factor: Fraction) -> Square:
    elements = [_rescaled(b, scale) for b in square.basis]
    sizes = [size for _, size in elements]
    pairs = (left * right for i, left in enumerate(factor * size for size in sizes) for right in sizes[i:])
    gram = tuple(q * size for q, size in zip(square.gram, pairs, strict=True))
    return Square(product=square.product, basis=tuple(b for b, _ in elements), gram=gram)


def _rescaled(basis_element: Element, scale: Sequence[Fraction]) -> tuple[Element, Fraction]:
    """Basis element in the other variables, and the factor of its row of the Gram matrix."""
    match basis_element:
        case tuple():
            return basis_element, monomial(scale, basis_element)
    polynomial = rescaled(basis_element, scale)
    lead = abs(next(iter(polynomial.values())))
    return {e: c / lead for e, c in polynomial.items()}, lead


def scaled(statement: Statement) -> Scaled:
    """Scaled statement with coefficients of about one."""
    scale = _balance(statement)

    def normal(polynomial: Polynomial) -> tuple[dict[Exponents, Fraction], Fraction]:
        moved = rescaled(polynomial, scale)
        factor = max((abs(c) for c in moved.values()), default=Fraction(1))
        return {e: c / factor for e, c in moved.items()}, factor

    polynomial, multiplier = normal(statement.polynomial), normal(statement.multiplier)
    inequalities = [normal(g) for g in statement.inequalities]
    equalities = [normal(h) for h in statement.equalities]
    moved = replace(
        statement,
        polynomial=polynomial[0],
        multiplier=multiplier[0],
        inequalities=tuple(g for g, _ in inequalities),
        equalities=tuple(h for h, _ in equalities),
    )
    return Scaled(
        statement=moved,
        scale=scale,
        target=polynomial[1] * multiplier[1],
        inequalities=tuple(f for _, f in inequalities),
        equalities=tuple(f for _, f in equalities),
    )


def decimal_units(scale: Sequence[Fraction]) -> tuple[Fraction, ...]:
    """Scales divided by the nearest powers of ten: units in which points with few decimal digits are sought."""
    return tuple(s / Fraction(10) ** round(_log2(s) / math.log2(10)) for s in scale)


def _log2(value: Fraction) -> float:
    return math.log2(value.numerator) - math.log2(value.denominator)


def _balance(statement: Statement) -> tuple[Fraction, ...]:
    """Powers of two that make the coefficients of every polynomial as equal as possible, by least squares."""
    size = len(statement.variables)
    rows, sides = [], []
    polynomials = (statement.polynomial, *statement.inequalities, *statement.equalities)
    for k, p in enumerate(polynomials):
        for e, c in p.items() if len(p) > 1 else ():
            level = [0.0] * len(polynomials)
            level[k] = -1.0
            rows.append([*e, *level])
            sides.append(-_log2(abs(c)))
    if not rows:
        return (Fraction(1),) * size
    solution, *_ = np.linalg.lstsq(np.array(rows, dtype=float), np.array(sides), rcond=1e-9)
    return tuple(Fraction(2) ** round(float(n)) for n in solution[:size])
