"""Squares bᵀQb with exact numbers: what they expand to, and whether they are squares."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import lcm
from typing import Any, NamedTuple

from flint import fmpq, fmpq_mat, fmpz_mat

from quakedesign.rationals import fraction_of
from quakedesign.sos.exact.definiteness import full_matrix, over_common_denominator, positive_definite_integers
from quakedesign.sos.exact.polynomial import Exponents, Polynomial, ring, times
from quakedesign.sos.exact.work import longest, spend

Element = Exponents | Polynomial
"""Basis element: a monomial by its exponents, or a polynomial."""


@dataclass(frozen=True, kw_only=True)
class Square:
    """(Π_{i∈S} g_i) · bᵀQb with Q positive definite.

    Attributes
    ----------
    product : tuple of int
        S.
    basis : tuple of Element
        Entries of b (length n).
    gram : tuple of Fraction
        Upper triangle of Q, row by row (length n(n+1)/2).
    """

    product: tuple[int, ...] = ()
    basis: tuple[Element, ...]
    gram: tuple[Fraction, ...]


class IntegerGram(NamedTuple):
    """Symmetric integer matrix N (n × n) and denominator d > 0 with Q = N/d."""

    rows: list[list[int]]
    denominator: int


def integer_gram(square: Square) -> IntegerGram:
    """Gram matrix of a square over its common denominator.

    Raises
    ------
    ValueError
        When the number of entries of Q is not that of the basis.
    """
    upper, denominator = over_common_denominator(square.gram)
    return IntegerGram(full_matrix(upper, len(square.basis)), denominator)


def is_definite(gram: IntegerGram) -> bool:
    """Whether Q is positive definite and not empty."""
    return len(gram.rows) > 0 and positive_definite_integers(gram.rows)


def _bits(rows: Sequence[Sequence[int]]) -> int:
    """Bits of the longest entry."""
    return max((abs(v).bit_length() for row in rows for v in row), default=0)


def has_own_monomials(basis: Sequence[Element]) -> bool:
    """Whether every element has a monomial with positive coefficient that no other has, so that each number counts."""
    if all(isinstance(b, tuple) for b in basis):
        return True
    polynomials = [as_polynomial(b) for b in basis]
    uses = Counter(e for p in polynomials for e in p)
    return all(any(uses[e] == 1 and c > 0 for e, c in p.items()) for p in polynomials)


def in_echelon_form(square: Square) -> Square:
    """The same square with a basis in which every element has a monomial of its own."""
    if has_own_monomials(square.basis):
        return square
    polynomials = [as_polynomial(b) for b in square.basis]
    support = sorted({e for p in polynomials for e in p})
    size = len(polynomials)
    rows = [
        [p.get(e, Fraction(0)) for e in support] + [Fraction(i == j) for j in range(size)]
        for i, p in enumerate(polynomials)
    ]
    reduced, _ = fmpq_mat([[fmpq(c.numerator, c.denominator) for c in row] for row in rows]).rref()
    table = [[fraction_of(v) for v in row] for row in reduced.tolist()]
    change = fmpq_mat([[fmpq(v.numerator, v.denominator) for v in row[len(support) :]] for row in table]).inv()
    gram = fmpq_mat([[fmpq(q.numerator, q.denominator) for q in row] for row in full_matrix(square.gram, size)])
    moved = (change.transpose() * gram * change).tolist()
    basis = tuple(as_element(dict(zip(support, row, strict=False))) for row in table)
    upper = tuple(fraction_of(moved[i][j]) for i in range(size) for j in range(i, size))
    return Square(product=square.product, basis=basis, gram=upper)


def form(basis: Sequence[Element], gram: IntegerGram, size: int) -> Any:
    """Form bᵀQb in the ring, added up in integers.

    Raises
    ------
    ValueError
        When the basis repeats a monomial, or is not one of as many variables.
    """
    support, (rows, denominator) = _in_monomials(basis, gram)
    spend(len(support) * (len(support) + 1) // 2, _bits(rows))
    if any(len(e) != size for e in support):
        raise ValueError("an element of a basis has another number of variables.")
    total: dict[Exponents, int] = {}
    for i, (left, row) in enumerate(zip(support, rows, strict=True)):
        own = times(left, left)
        total[own] = total.get(own, 0) + row[i]
        for right, entry in zip(support[i + 1 :], row[i + 1 :], strict=True):
            key = times(left, right)
            total[key] = total.get(key, 0) + 2 * entry
    return ring(size).from_dict(total) / denominator


def _in_monomials(basis: Sequence[Element], gram: IntegerGram) -> tuple[list[Exponents], IntegerGram]:
    """Monomials m and the matrix M with bᵀQb = mᵀMm."""
    exponents = [b for b in basis if isinstance(b, tuple)]
    if len(exponents) == len(basis):
        if len(set(exponents)) != len(exponents):
            raise ValueError("a monomial occurs twice in a basis.")
        return exponents, gram
    support = sorted({e for b in basis for e in as_polynomial(b)})
    bits = longest(c for b in basis for c in as_polynomial(b).values())
    spend(len(support) * len(basis) * (len(support) + len(basis)), bits + _bits(gram.rows))
    common = lcm(1, *(c.denominator for b in basis for c in as_polynomial(b).values()))
    coefficients = fmpz_mat([[int(as_polynomial(b).get(e, Fraction(0)) * common) for e in support] for b in basis])
    whole = coefficients.transpose() * fmpz_mat(gram.rows) * coefficients
    return support, IntegerGram([[int(x) for x in row] for row in whole.tolist()], gram.denominator * common * common)


def as_element(polynomial: Polynomial) -> Element:
    """Polynomial as a basis element: by its exponents where it is a monomial with coefficient 1."""
    kept = {e: c for e, c in polynomial.items() if c}
    return next(iter(kept)) if list(kept.values()) == [1] else kept


def as_polynomial(basis_element: Element) -> Polynomial:
    """Basis element as a polynomial."""
    return {basis_element: Fraction(1)} if isinstance(basis_element, tuple) else basis_element
