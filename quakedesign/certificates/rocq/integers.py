"""The identity of a witness in integers, as the checker of ``proofs/rocq`` reads it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import lcm

from quakedesign.sos.exact.polynomial import Polynomial
from quakedesign.sos.exact.squares import Square, as_polynomial
from quakedesign.sos.exact.statement import Statement

Triangle = list[list[int]]
"""Upper triangle of a symmetric matrix, row by row."""


@dataclass(frozen=True, kw_only=True)
class IntegerSquare:
    """(Π g_i)·bᵀQb with integers.

    Attributes
    ----------
    product : tuple of int
    basis : tuple of Polynomial
    gram : list of list of int
    """

    product: tuple[int, ...]
    basis: tuple[Polynomial, ...]
    gram: Triangle


@dataclass(frozen=True, kw_only=True)
class IntegerWitness:
    """left · multiplier · P = right · (Σ (Π g_i)·bᵀQb + Σ q_k h_k), all in integers.

    P, g_i and h_k are those of the statement, each times `clearing`, their common denominator.
    """

    clearing: int
    left: int
    right: int
    multiplier: Polynomial
    squares: tuple[IntegerSquare, ...]
    cofactors: tuple[Polynomial, ...]


def denominator(polynomial: Polynomial) -> int:
    """Common denominator of the coefficients."""
    return lcm(1, *(c.denominator for c in polynomial.values()))


def clearing(asked: Statement) -> int:
    """Common denominator of the polynomial, the inequalities and the equalities."""
    return lcm(*map(denominator, (asked.polynomial, *asked.inequalities, *asked.equalities)))


def in_integers(
    asked: Statement, squares: Sequence[Square], cofactors: Sequence[Polynomial], constraints: int | None = None
) -> IntegerWitness:
    """Witness of the statement multiplier · polynomial = Σ squares + Σ cofactors · equalities, in integers.

    Parameters
    ----------
    asked : Statement
    squares : sequence of Square
    cofactors : sequence of Polynomial
    constraints : int, optional
        What the constraints are multiplied by; then the polynomial is taken as it is, with integers.
    """
    common = clearing(asked) if constraints is None else constraints
    grams = [_over_wholes(square, common) for square in squares]
    shares = [scaled(q, Fraction(1, common)) for q in cofactors]
    scale = lcm(1, *(v.denominator for rows in grams for row in rows for v in row), *map(denominator, shares))
    factor = denominator(asked.multiplier)
    ratio = Fraction(scale, factor * (common if constraints is None else 1))
    return IntegerWitness(
        clearing=common,
        left=ratio.numerator,
        right=ratio.denominator,
        multiplier=scaled(asked.multiplier, factor),
        squares=tuple(_square(square, rows, scale) for square, rows in zip(squares, grams, strict=True)),
        cofactors=tuple(scaled(q, scale) for q in shares),
    )


def scaled(polynomial: Polynomial, factor: int | Fraction) -> Polynomial:
    """Polynomial times a number."""
    return {e: c * factor for e, c in polynomial.items()}


def _over_wholes(square: Square, common: int) -> list[list[Fraction]]:
    """Gram matrix for constraints times a number and a basis times its denominators."""
    weight = common ** len(square.product)
    basis = [denominator(as_polynomial(b)) for b in square.basis]
    entries = iter(square.gram)
    return [[next(entries) / (weight * basis[i] * basis[j]) for j in range(i, len(basis))] for i in range(len(basis))]


def _square(square: Square, rows: Iterable[Iterable[Fraction]], common: int) -> IntegerSquare:
    gram = [[int(v * common) for v in row] for row in rows]
    basis = (as_polynomial(b) for b in square.basis)
    return IntegerSquare(
        product=square.product,
        basis=tuple(scaled(b, denominator(b)) for b in basis),
        gram=gram,
    )
