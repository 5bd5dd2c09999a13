"""Search for a proof of one statement: solve, round, refute by a point, restrict to a face."""

from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from math import comb
from typing import Any

from flint import fmpq, fmpq_mat

from quakedesign.errors import PolynomialError
from quakedesign.exact import fraction_of, nearest
from quakedesign.sos.exact.polynomial import Exponents, Polynomial, degree
from quakedesign.sos.exact.polynomial_statement import Statement, Structure
from quakedesign.sos.exact.proofs import (
    Functional,
    Proof,
    SumOfSquares,
    full_bases,
    holds,
    identity_holds,
    parity_classes,
    reduced_bases,
)
from quakedesign.sos.solve.facial_reduction import Block, at_kernels, at_real_zeros, at_zeros, modulo
from quakedesign.sos.solve.moment import MomentProgram, MomentSolution
from quakedesign.sos.solve.points import local_minima, negative_point, polished_zeros, rational_zeros
from quakedesign.sos.solve.rounding import Scaled, decimal_units, relations, rounded, scaled

_STRICT = 1e-7  # for a margin below -_STRICT a refutation is tried before the faces
_ROUNDS = 4
# largest number of entries of the triangular factor in the solver, dense for every block
_ENTRIES = 50_000_000
_ACCURACIES = (1e-9, 1e-12)
# Eigenvalue threshold and rounding tolerance of numerical kernels, tried in turn
KERNELS = ((1e-6, 1e-5), (1e-6, 1e-7), (1e-6, 1e-3), (1e-4, 1e-4), (1e-4, 1e-2), (1e-2, 1e-3), (1e-2, 3e-2))


@dataclass
class StatementSearch:
    """Search for a proof of one statement, in scaled variables."""

    original: Statement
    moved: Scaled = field(init=False)
    statement: Statement = field(init=False)
    units: tuple[Fraction, ...] = field(init=False)
    relations: list[Polynomial] = field(init=False)
    blocks: list[Block] = field(init=False)

    def __post_init__(self) -> None:
        self.moved = scaled(self.original)
        self.statement = self.moved.statement
        self.units = decimal_units(self.moved.scale)
        self.relations = [r for _, _, r in relations(self.statement)]
        self.blocks = modulo(initial_blocks(self.statement), self.relations)

    def run(self) -> Proof | None:
        """Proof of the statement; None if none is found."""
        solution, program = self._solve(self.blocks)
        if solution is not None and (solution.margin > 0 or self._determined()):
            proof = self._finish(rounded(self.statement, self.blocks, solution))
            if proof is not None:
                return proof
        candidates = list(local_minima(self.statement, self._hints(solution)))
        point = negative_point(self.statement, candidates, self.units)
        if point is not None:
            return self._finish(point)
        proof = self._outside(program)
        if proof is not None:
            return proof
        if solution is not None and solution.margin < -_STRICT and program is not None:
            proof = self._refute(program, solution)
            if proof is not None:
                return proof
        proof = self._on_faces(candidates, solution)
        if proof is None and solution is not None and solution.margin < 0 and program is not None:
            proof = self._refute(program, solution)
        return proof

    def _determined(self) -> bool:
        """Whether the target determines the Gram matrices, so that exact arithmetic alone decides."""
        keys = [
            tuple(a + b for a, b in zip(left, right, strict=True))
            for block in self.blocks
            for i, left in enumerate(block.monomials)
            for right in block.monomials[i:]
        ]
        plain = len(self.statement.products) == 1 and not self.relations
        return plain and len(set(keys)) == len(keys)

    def _solve(
        self, blocks: list[Block], accuracy: float = _ACCURACIES[0]
    ) -> tuple[MomentSolution | None, MomentProgram | None]:
        if not blocks:
            return None, None
        rows = [{e: float(c) for e, c in r.items()} for r in self.relations]
        program = MomentProgram([b.shape() for b in blocks], rows)
        if not program.covers(self.statement.target):
            return None, program
        target = {e: float(c) for e, c in self.statement.target.items()}
        return program.solve(target, accuracy), program

    def _hints(self, solution: MomentSolution | None) -> list[list[float]]:
        """Normalised first moments of the functional, if its mass is positive."""
        if solution is None:
            return []
        size = len(self.statement.variables)
        mass = solution.functional.get((0,) * size, 0.0)
        units = [tuple(int(i == j) for j in range(size)) for i in range(size)]
        if not mass > 1e-9 or not all(u in solution.functional for u in units):
            return []
        return [[solution.functional[u] / mass for u in units]]

    def _finish(self, proof: Proof | None) -> Proof | None:
        """Proof of the original statement from one in scaled variables; points and functionals are checked again."""
        if proof is None:
            return None
        restored = self.moved.restore(proof)
        if isinstance(restored, SumOfSquares):
            return restored
        return restored if holds(self.original, restored) else None

    def _outside(self, program: MomentProgram | None) -> Proof | None:
        """Refutation by a monomial of the target that no product and no multiple of an equality contains."""
        covered = set() if program is None else set(program.index)
        target = self.statement.target
        for e in target:
            if e not in covered:
                return self._finish(Functional(values={e: Fraction(-1 if target[e] > 0 else 1)}))
        return None

    def _refute(self, program: MomentProgram, solution: MomentSolution) -> Proof | None:
        target = {e: float(c) for e, c in self.statement.target.items()}
        interior = program.interior(target, solution.margin / 2)
        for values in (interior, solution.functional) if interior is not None else (solution.functional,):
            for bits in (6, 10, 14, 18, 22, 26, 32, 40):
                # Round the functional to multiples of 2^-bits of its largest value; make it zero on the equalities.
                size = max(abs(v) for v in values.values())
                exact = {e: nearest(v / size, 2**bits) for e, v in values.items()}
                if self.relations:
                    exact = _project(exact, self.relations)
                proof = Functional(values={e: v for e, v in exact.items() if v})
                if holds(self.statement, proof):
                    return self._finish(proof)
        return None

    def _on_faces(self, candidates: Any, solution: MomentSolution | None) -> Proof | None:
        zeros = rational_zeros(self.statement, candidates, self.units)
        blocks = at_zeros(self.blocks, zeros) if zeros else self.blocks
        for accuracy in _ACCURACIES:
            for threshold, tolerance in KERNELS:
                proof = self._descend(blocks, threshold, tolerance, accuracy)
                if proof is not None:
                    return proof
        smaller = at_real_zeros(blocks, polished_zeros(self.statement, candidates), self.units)
        return self._descend(smaller, *KERNELS[0], _ACCURACIES[0]) if smaller != blocks else None

    def _descend(self, blocks: list[Block], threshold: float, tolerance: float, accuracy: float) -> Proof | None:
        for _ in range(_ROUNDS):
            solution = (
                self._solve(blocks, accuracy)[0]
                if blocks
                else MomentSolution(
                    margin=1.0, grams=[], moments=[], functional={}, cofactors=[0.0] * len(self.relations)
                )
            )
            if solution is None:
                return None
            if solution.margin > 1e-9:
                proof = self._finish(rounded(self.statement, blocks, solution))
                if proof is not None:
                    return proof
            smaller = at_kernels(blocks, solution.grams, threshold, tolerance, self.units)
            if smaller is None:
                return None
            blocks = smaller
        return None


def strict_proof(statement: Statement) -> SumOfSquares | None:
    """Exactly checked sum-of-squares identity in monomials for a statement with a positive margin, or None.

    The caller must check that the multiplier is positive.
    """
    search = StatementSearch(statement)
    solution = search._solve(search.blocks)[0]
    if solution is None or not solution.margin > 0:
        return None

    def checked(proof: SumOfSquares) -> SumOfSquares | None:
        restored = search.moved.restored(proof)
        return restored if identity_holds(statement, restored) else None

    return rounded(search.statement, search.blocks, solution, checked)


def initial_blocks(statement: Statement) -> list[Block]:
    """Blocks after the exact reduction, split by sign symmetry; for forms, only squares of the target's degree.

    Raises
    ------
    PolynomialError
        When the blocks exceed the memory limit of the solver.
    """
    return list(_blocks_of(statement.structure))


@lru_cache(256)
def _blocks_of(structure: Structure) -> tuple[Block, ...]:
    statement = Statement.of(structure)
    blocks = []
    graded = statement.graded
    for chosen, weight, basis in zip(statement.products, statement.weights, reduced_bases(statement), strict=True):
        if graded:
            basis = tuple(b for b in basis if 2 * sum(b) + degree(weight) == statement.degree)
        for part in parity_classes(statement, basis):
            blocks.append(Block(product=chosen, weight=weight, monomials=tuple(basis[i] for i in part)))
    sizes = [len(b.monomials) for b in blocks]
    if sum(comb(comb(n + 1, 2) + 1, 2) for n in sizes) > _ENTRIES:
        raise PolynomialError(
            "Gram matrices must be small enough for a solver, for example one of at most 140 x 140. "
            f"Received {len(sizes)} of up to {max(sizes)} x {max(sizes)}. Lower the degree."
        )
    return tuple(blocks)


def block_sizes(statement: Statement) -> dict[str, list[int]]:
    """Sizes of the Gram matrices before and after the exact reduction, largest first."""
    before = sorted((len(b) for b in full_bases(statement)), reverse=True)
    after = sorted((len(b.monomials) for b in initial_blocks(statement)), reverse=True)
    return {"before": before, "after": after}


def _project(values: dict[Exponents, Fraction], rows: Any) -> dict[Exponents, Fraction]:
    """Values that satisfy every relation: those at the pivots are replaced, the others stay."""
    keys = sorted({e for r in rows for e in r} | set(values), key=lambda e: (sum(e), e), reverse=True)
    index = {e: i for i, e in enumerate(keys)}
    matrix = [[fmpq(0)] * len(keys) for _ in rows]
    for line, r in zip(matrix, rows, strict=True):
        for e, c in r.items():
            line[index[e]] = fmpq(c.numerator, c.denominator)
    reduced, rank = fmpq_mat(matrix).rref()
    table = reduced.tolist()[:rank]
    result = dict(values)
    for row in table:
        pivot = next(i for i, v in enumerate(row) if v != 0)
        total = Fraction(0)
        for i in range(pivot + 1, len(keys)):
            if row[i] != 0:
                total -= fraction_of(row[i]) * values.get(keys[i], Fraction(0))
        result[keys[pivot]] = total
    return result
