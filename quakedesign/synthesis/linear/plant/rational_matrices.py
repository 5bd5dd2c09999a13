"""Small rational matrices: products, inverses, Lyapunov and Riccati residuals, Hurwitz, all exact."""

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from flint import arb, fmpq, fmpq_mat

from quakedesign.rationals import end_of, fraction_of
from quakedesign.sos.exact.definiteness import positive_definite

Rows = Sequence[Sequence[Fraction]]
Matrix = tuple[tuple[Fraction, ...], ...]


def floats(matrix: Any) -> Any:
    """Array of floats."""
    return np.array([[float(v) for v in row] for row in matrix])


def exact(matrix: Any) -> Matrix:
    """Rational matrix with the exact values of floats."""
    return tuple(tuple(Fraction(float(v)) for v in row) for row in matrix)


def rounded(matrix: Any, bits: int = 60) -> Matrix:
    """Symmetric rational matrix near a symmetric one: entry (i, j) to `bits` binary digits of √(m_ii m_jj)."""
    n = len(matrix)
    sizes = [max(abs(float(matrix[i][i])), 1e-300) for i in range(n)]
    rows = [[Fraction(0)] * n for _ in range(n)]
    for i in range(n):
        for j in range(i, n):
            unit = Fraction(2) ** (math.floor(math.log2(sizes[i] * sizes[j]) / 2) - bits)
            rows[i][j] = rows[j][i] = round((Fraction(matrix[i][j]) + Fraction(matrix[j][i])) / 2 / unit) * unit
    return tuple(tuple(row) for row in rows)


def transpose(a: Rows) -> Matrix:
    """Aᵀ."""
    return tuple(zip(*a, strict=True))


def product(*factors: Rows) -> Matrix:
    """Product of matrices of fitting shapes."""
    left: Rows = factors[0]
    for right in factors[1:]:
        columns = transpose(right)
        left = tuple(
            tuple(sum((x * y for x, y in zip(row, c, strict=True)), Fraction(0)) for c in columns) for row in left
        )
    return tuple(tuple(row) for row in left)


def total(*parts: Rows) -> Matrix:
    """Sum of matrices of one shape."""
    return tuple(
        tuple(sum(entries, Fraction(0)) for entries in zip(*rows, strict=True)) for rows in zip(*parts, strict=True)
    )


def times(factor: Fraction | int, a: Rows) -> Matrix:
    """factor·A."""
    return tuple(tuple(factor * v for v in row) for row in a)


def congruent(matrix: Sequence[Sequence[Fraction | float]], units: Sequence[Fraction]) -> Matrix:
    """DMD for the diagonal D of some units: a quadratic form in states that are so many times smaller."""
    return tuple(
        tuple(Fraction(v) * a * b for v, b in zip(row, units, strict=True))
        for a, row in zip(units, matrix, strict=True)
    )


def outer(a: Sequence[Fraction], b: Sequence[Fraction]) -> Matrix:
    """a bᵀ."""
    return tuple(tuple(x * y for y in b) for x in a)


def diagonal(values: Sequence[Fraction]) -> Matrix:
    """Diagonal matrix."""
    return tuple(tuple(v if i == j else Fraction(0) for j in range(len(values))) for i, v in enumerate(values))


def trace_of_product(a: Rows, b: Rows) -> Fraction:
    """Trace of AB for symmetric matrices."""
    return sum((x * y for p, q in zip(a, b, strict=True) for x, y in zip(p, q, strict=True)), Fraction(0))


def lyapunov(a: Rows, p: Rows) -> Matrix:
    """AᵀP + PA."""
    half = product(p, a)
    return total(half, transpose(half))


def riccati_residual(a: Rows, g: Rows, q: Rows, x: Rows) -> Matrix:
    """Q + AᵀX + XA − XGX."""
    return total(q, lyapunov(a, x), times(-1, product(x, g, x)))


def frobenius(a: Rows) -> Fraction:
    """Rigorous upper bound on the Frobenius norm, tight to about 1e-15."""
    square = sum((v * v for row in a for v in row), Fraction(0))
    return end_of(arb(fmpq(square.numerator, square.denominator)).sqrt().upper())


def definite(a: Rows) -> bool:
    """Whether a symmetric rational matrix is positive definite, exactly."""
    return positive_definite(a)


def characteristic(a: Rows) -> tuple[Fraction, ...]:
    """Coefficients of det(zI − A), highest power first."""
    polynomial = fmpq_mat([[fmpq(v.numerator, v.denominator) for v in row] for row in a]).charpoly()
    return tuple(fraction_of(c) for c in reversed(polynomial.coeffs()))


def hurwitz(polynomial: Sequence[Fraction]) -> bool:
    """Whether all roots of a polynomial (highest power first) have negative real parts, exactly (Routh)."""
    upper, lower = list(polynomial[::2]), list(polynomial[1::2])
    if polynomial[0] < 0:
        upper, lower = [-v for v in upper], [-v for v in lower]
    while lower:
        if lower[0] <= 0:
            return False
        ratio = upper[0] / lower[0]
        reduced = [u - ratio * v for u, v in zip(upper[1:], [*lower[1:], Fraction(0)], strict=False)]
        upper, lower = lower, reduced
    return upper[0] > 0
