"""Gram matrices that somebody else's solver has found: rounded and put right exactly, or answered otherwise."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from time import perf_counter
from typing import Any

import numpy as np

from quakedesign.bounds import UpperBound
from quakedesign.errors import PolynomialError
from quakedesign.sos.exact.answer import Answer
from quakedesign.sos.exact.definiteness import full_matrix
from quakedesign.sos.exact.polynomial import Exponents, degree
from quakedesign.sos.exact.proofs import SumOfSquares, residual
from quakedesign.sos.exact.reading import read, read_element
from quakedesign.sos.exact.squares import Element, Square, as_polynomial, in_echelon_form
from quakedesign.sos.exact.statement import Statement, statement
from quakedesign.sos.solve.decide import KERNELS
from quakedesign.sos.solve.engine import decide, versions
from quakedesign.sos.solve.faces import Block, at_kernels
from quakedesign.sos.solve.moment import Solution
from quakedesign.sos.solve.rounding import rounded
from quakedesign.sos.solve.scaling import Scaled, decimal_units, scaled
from quakedesign.text import shown

_NEAR = Fraction(1, 100)  # of the largest coefficient: a matrix with a larger error is about another polynomial


def verify(
    polynomial: Any, gram: Any, basis: Any, *, on: Sequence[Any] = (), variables: Sequence[Any] | None = None
) -> Answer:
    """Exact proof from a Gram matrix in floating point, or what is true instead.

    The matrix is rounded and moved exactly onto polynomial = bᵀQb; where it is singular, its kernel is made rational
    first. A matrix from which no proof comes is left, and the polynomial is decided as `quakedesign.sos.prove` does.

    Parameters
    ----------
    polynomial : str, SymPy expression or mapping of exponents to Fraction
    gram : array of float (n × n)
        Only its symmetric part counts. Under constraints a list of such arrays: of σ_0, then of σ_i for every g_i ≥ 0
        in polynomial = σ_0 + Σ g_i·σ_i.
    basis : sequence of n str, SymPy expressions or tuples of exponents
        Monomials, or any polynomials; under constraints a list of such sequences.
    on : sequence of str or SymPy relation, optional
        Inequalities of the set; ℝⁿ unless given.
    variables : sequence of str or Symbol, optional
        Their order, for exponents; in order of appearance in the polynomial unless given.

    Returns
    -------
    Answer
        Its ``remark`` says what became of the matrix.

    Raises
    ------
    PolynomialError
        When something cannot be read, or matrix and basis do not fit.
    """
    start = perf_counter()
    names, exact, inequalities, equalities, _ = read(polynomial, on, None, variables)
    if equalities:
        raise PolynomialError("constraints of a given proof must be inequalities. Received an equality. Use prove.")
    if len({frozenset(g.items()) for g in inequalities}) < len(inequalities):
        raise PolynomialError("constraints of a given proof must differ. Received one twice. Add up their matrices.")
    grams, bases = (_listed(gram), _listed(basis)) if inequalities else ([gram], [basis])
    if not len(grams) == len(bases) == 1 + len(inequalities):
        raise PolynomialError(
            f"1 + {len(inequalities)} Gram matrices and bases are needed, for 1 and for every inequality. "
            f"Received {len(grams)} and {len(bases)}."
        )
    products = [(), *((i,) for i in range(len(inequalities)))]
    squares = [_square(s, q, b, names) for s, q, b in zip(products, grams, bases, strict=True)]
    degrees = [0, *map(degree, inequalities)]
    reached = [d + 2 * max(map(_degree, s.basis)) for d, s in zip(degrees, squares, strict=True)]
    asked = statement(
        names, exact, inequalities=inequalities, products=False, degree_bound=max(degree(exact), *reached)
    )
    return replace(_verified(asked, squares), seconds=perf_counter() - start)


def _listed(given: Any) -> list[Any]:
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise PolynomialError(f"matrices and bases must be sequences. Received {shown(given)}.")
    return list(given)


def _degree(element: Element) -> int:
    return degree(as_polynomial(element))


def _square(product: tuple[int, ...], gram: Any, basis: Any, names: tuple[str, ...]) -> Square:
    """Given matrix, as exact as its floats, with a basis in which every element has a monomial of its own."""
    elements = tuple(read_element(b, names) for b in _listed(basis))
    matrix = _matrix(gram, len(elements))
    upper = tuple(Fraction(float(matrix[i, j])) for i in range(len(elements)) for j in range(i, len(elements)))
    distinct = {tuple(sorted(as_polynomial(b).items())) for b in elements}
    if not elements or () in distinct or len(distinct) < len(elements):
        raise PolynomialError("a basis must have different elements other than zero. Received another one.")
    square = in_echelon_form(Square(product=product, basis=elements, gram=upper))
    if {} in square.basis:
        raise PolynomialError("elements of a basis must be linearly independent. Received others. Drop one.")
    return square


def _matrix(gram: Any, size: int) -> Any:
    """Symmetric part of a matrix."""
    try:
        matrix = np.asarray(gram, dtype=object).astype(float)  # one by one, so that no imaginary part is dropped
    except (TypeError, ValueError, OverflowError):
        raise PolynomialError("a Gram matrix must be an array of real numbers. Received something else.") from None
    if matrix.shape != (size, size) or not np.all(np.isfinite(matrix)):
        raise PolynomialError(
            f"a Gram matrix must be {size} x {size}, as its basis has {size} elements, and finite. "
            f"Received shape {matrix.shape}, {np.count_nonzero(~np.isfinite(matrix))} entries not finite."
        )
    return matrix / 2 + matrix.T / 2


def _verified(asked: Statement, squares: Sequence[Square]) -> Answer:
    error = max(map(abs, residual(asked, squares, ()).values()), default=Fraction(0))
    moved = scaled(asked)
    blocks, grams = zip(*(_block(moved.statement, moved.square(s)) for s in squares), strict=True)
    least = min(float(np.linalg.eigvalsh(g)[0]) for g in grams)
    sizes = f"largest error in a coefficient {UpperBound(error):.2g}, least eigenvalue {least:.2g} scaled"
    matrix = f"the given matrix ({sizes})"
    near = error <= _NEAR * max(map(abs, asked.polynomial.values()), default=Fraction(1))
    for how, proof in _proposed(moved, blocks, grams) if near else ():
        found = Answer(statement=asked, proof=proof, remark=f"proved by {matrix}, {how}", versions=versions())
        if proof is not None and found.check():
            return found
    found = decide(asked)
    why = "neither a proof nor a counterexample was found" if found.proof is None else "decided"
    return replace(found, remark=f"no proof comes from {matrix}; {why} without it")


def _block(moved: Statement, square: Square) -> tuple[Block, Any]:
    """Block and matrix of a square."""
    support = sorted({e for b in square.basis for e in as_polynomial(b)})
    monomials = tuple(b for b in square.basis if isinstance(b, tuple))
    rows = tuple(tuple(as_polynomial(b).get(e, Fraction(0)) for e in support) for b in square.basis)
    plain = len(monomials) == len(square.basis)
    block = Block(
        product=square.product,
        weight=moved.weight(square.product),
        monomials=monomials if plain else tuple(support),
        face=None if plain else rows,
    )
    return block, np.array([[float(v) for v in row] for row in full_matrix(square.gram, len(square.basis))])


def _proposed(moved: Scaled, blocks: Sequence[Block], grams: Sequence[Any]) -> Iterator[tuple[str, Any]]:
    """Proofs from the matrices as they are, then from what is left of them beside their kernels."""
    yield "rounded", _rounded(moved, blocks, grams)
    for threshold, tolerance in KERNELS:
        smaller = [_beside(b, g, threshold, tolerance, moved) for b, g in zip(blocks, grams, strict=True)]
        left = [pair for pair in smaller if pair is not None]
        yield "rounded beside its kernel", _rounded(moved, *zip(*left, strict=True)) if left else None


def _beside(block: Block, gram: Any, threshold: float, tolerance: float, moved: Scaled) -> tuple[Block, Any] | None:
    """Block without the numerical kernel of its matrix, and the matrix there; None if nothing is left."""
    smaller = at_kernels([block], [gram], threshold, tolerance, decimal_units(moved.scale))
    if smaller is None:
        return block, gram
    if not smaller:
        return None
    inverse = np.linalg.pinv(_rows(smaller[0], block.monomials))
    full = _rows(block, block.monomials)
    return smaller[0], inverse.T @ full.T @ gram @ full @ inverse


def _rows(block: Block, monomials: Sequence[Exponents]) -> Any:
    """Basis of a block in monomials, one element a row."""
    polynomials = [as_polynomial(b) for b in block.basis]
    return np.array([[float(p.get(e, 0)) for e in monomials] for p in polynomials])


def _rounded(moved: Scaled, blocks: Sequence[Block], grams: Sequence[Any]) -> SumOfSquares | None:
    least = min(float(np.linalg.eigvalsh(g)[0]) for g in grams)
    if not least > 0:
        return None
    solution = Solution(margin=least, grams=list(grams), moments=[], functional={}, cofactors=[])
    proof = rounded(moved.statement, blocks, solution)
    return None if proof is None else moved.restored(proof)
