"""The three kinds of proof about a statement, each decided in rational arithmetic without a solver."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import lcm

from quakedesign.sos.exact.definiteness import full_matrix, nonnegative_definite, positive_definite
from quakedesign.sos.exact.polynomial import (
    Exponents,
    Polynomial,
    combination,
    constant,
    degree,
    element,
    evaluate,
    mapping,
    monomials,
    ring,
    times,
)
from quakedesign.sos.exact.reduction import reduced_bases
from quakedesign.sos.exact.statement import Statement

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


@dataclass(frozen=True, kw_only=True)
class SumOfSquares:
    """multiplier · polynomial = Σ squares + Σ_k cofactor_k h_k.

    Attributes
    ----------
    squares : tuple of Square
    cofactors : tuple of Polynomial
        q_k, one for every equality.
    multiplier : tuple of Square
        The multiplier as a sum of squares; empty where its coefficients show that it is positive.
    """

    squares: tuple[Square, ...]
    cofactors: tuple[Polynomial, ...] = ()
    multiplier: tuple[Square, ...] = field(default=())


@dataclass(frozen=True, kw_only=True)
class Functional:
    """Linear functional L, non-negative on the cone and negative on the target; zero on monomials without a value.

    Attributes
    ----------
    values : mapping of exponents to Fraction
        L of a monomial.
    """

    values: Mapping[Exponents, Fraction]


@dataclass(frozen=True, kw_only=True)
class Point:
    """A point of the set where the polynomial is negative.

    Attributes
    ----------
    coordinates : tuple of Fraction
    """

    coordinates: tuple[Fraction, ...]


Proof = SumOfSquares | Functional | Point


def holds(statement: Statement, proof: Proof) -> bool:
    """Whether a proof decides its statement; exact.

    Parameters
    ----------
    statement : Statement
    proof : SumOfSquares, Functional or Point

    Returns
    -------
    bool
        True only if it does: the polynomial is non-negative on the set; or the statement is false; or the polynomial
        is negative at a point of the set. False proves nothing.
    """
    try:
        if isinstance(proof, SumOfSquares):
            return _sum_of_squares_holds(statement, proof)
        if isinstance(proof, Functional):
            return _functional_holds(statement, proof)
        return _point_holds(statement, proof)
    except (ValueError, TypeError, AttributeError):
        return False


def identity_holds(statement: Statement, proof: SumOfSquares) -> bool:
    """Whether the identity is exact and every square one; whether the multiplier is positive is not asked."""
    try:
        return _identity_holds(statement, proof)
    except (ValueError, TypeError, AttributeError):
        return False


def _sum_of_squares_holds(statement: Statement, proof: SumOfSquares) -> bool:
    return multiplier_is_positive(statement, proof.multiplier) and _identity_holds(statement, proof)


def _identity_holds(statement: Statement, proof: SumOfSquares) -> bool:
    size = len(statement.variables)
    if len(proof.cofactors) != len(statement.equalities):
        return False
    total = ring(size).constant(0)
    for square in proof.squares:
        total += _expanded(statement, square)
    for q, h in zip(proof.cofactors, statement.equalities, strict=True):
        total += element(q, size) * element(h, size)
    return total == element(statement.target, size) and all(_definite(s) for s in proof.squares)


def multiplier_is_positive(statement: Statement, squares: tuple[Square, ...]) -> bool:
    """Positive on a dense part of the set; on all of it where the set may have no interior."""
    size = len(statement.variables)
    one = (0,) * size
    if not squares:
        free = [
            not any(g.keys() == {_unit(size, i)} for g in statement.inequalities if statement.is_variable(g))
            for i in range(size)
        ]
        even = all(not (x % 2 and f) for e in statement.multiplier for x, f in zip(e, free, strict=True))
        positive = even and all(c > 0 for c in statement.multiplier.values())
        return positive and (statement.dense or one in statement.multiplier)
    total = ring(size).constant(0)
    for square in squares:
        total += _expanded(statement, square)
    everywhere = any(not s.product and one in s.basis for s in squares)
    return (
        total == element(statement.multiplier, size)
        and all(_definite(s) for s in squares)
        and (statement.dense or everywhere)
    )


def _unit(size: int, index: int) -> Exponents:
    return tuple(int(i == index) for i in range(size))


def _definite(square: Square) -> bool:
    return len(square.basis) > 0 and positive_definite(full_matrix(square.gram, len(square.basis)))


def _expanded(statement: Statement, square: Square):
    """(Π g_i)·bᵀQb in the ring."""
    size = len(statement.variables)
    if square.product not in statement.products or not _has_own_monomials(square.basis):
        raise ValueError("the product of a square is not one of the statement, or its basis is not in echelon form.")
    weight = element(statement.weight(square.product), size)
    return weight * element(expand(square.basis, square.gram), size)


def _has_own_monomials(basis: Sequence[Element]) -> bool:
    """Whether every element has a monomial with positive coefficient that no other has, so that each number counts."""
    if all(isinstance(b, tuple) for b in basis):
        return True
    polynomials = [as_polynomial(b) for b in basis]
    uses = Counter(e for p in polynomials for e in p)
    return all(any(uses[e] == 1 and c > 0 for e, c in p.items()) for p in polynomials)


def in_echelon_form(square: Square) -> Square:
    """The same square with a basis in which every element has a monomial of its own."""
    if _has_own_monomials(square.basis):
        return square
    from flint import fmpq, fmpq_mat

    polynomials = [as_polynomial(b) for b in square.basis]
    support = sorted({e for p in polynomials for e in p})
    size = len(polynomials)
    rows = [
        [p.get(e, Fraction(0)) for e in support] + [Fraction(i == j) for j in range(size)]
        for i, p in enumerate(polynomials)
    ]
    reduced, _ = fmpq_mat([[fmpq(c.numerator, c.denominator) for c in row] for row in rows]).rref()
    table = [[Fraction(int(v.p), int(v.q)) for v in row] for row in reduced.tolist()]
    change = fmpq_mat([[fmpq(v.numerator, v.denominator) for v in row[len(support) :]] for row in table]).inv()
    gram = fmpq_mat([[fmpq(q.numerator, q.denominator) for q in row] for row in full_matrix(square.gram, size)])
    moved = (change.transpose() * gram * change).tolist()
    basis = tuple(as_element(dict(zip(support, row, strict=False))) for row in table)
    upper = tuple(Fraction(int(moved[i][j].p), int(moved[i][j].q)) for i in range(size) for j in range(i, size))
    return Square(product=square.product, basis=basis, gram=upper)


def expand(basis: Sequence[Element], gram: Sequence[Fraction]) -> dict[Exponents, Fraction]:
    """Coefficients of bᵀQb."""
    support, rows, denominator = _monomial_gram(basis, gram)
    total: dict[Exponents, int] = {}
    for i, left in enumerate(support):
        row = rows[i]
        for j in range(i, len(support)):
            if row[j]:
                key = times(left, support[j])
                total[key] = total.get(key, 0) + (row[j] if i == j else 2 * row[j])
    return {e: Fraction(c, denominator) for e, c in total.items() if c}


def _monomial_gram(basis: Sequence[Element], gram: Sequence[Fraction]):
    """Monomials m, integer matrix N and denominator d with bᵀQb = mᵀNm/d."""
    full = full_matrix(gram, len(basis))
    scale = lcm(1, *(q.denominator for q in gram))
    integers = [[q.numerator * (scale // q.denominator) for q in row] for row in full]
    if all(isinstance(b, tuple) for b in basis):
        if len(set(basis)) != len(basis):
            raise ValueError("a monomial occurs twice in a basis.")
        return list(basis), integers, scale
    from flint import fmpz_mat

    support = sorted({e for b in basis for e in as_polynomial(b)})
    common = lcm(1, *(c.denominator for b in basis for c in as_polynomial(b).values()))
    coefficients = fmpz_mat([[int(as_polynomial(b).get(e, Fraction(0)) * common) for e in support] for b in basis])
    whole = coefficients.transpose() * fmpz_mat(integers) * coefficients
    return support, [[int(x) for x in row] for row in whole.tolist()], scale * common * common


def as_element(polynomial: Polynomial) -> Element:
    """Polynomial as a basis element: by its exponents where it is a monomial with coefficient 1."""
    kept = {e: c for e, c in polynomial.items() if c}
    return next(iter(kept)) if list(kept.values()) == [1] else kept


def as_polynomial(basis_element: Element) -> Polynomial:
    """Basis element as a polynomial."""
    return {basis_element: Fraction(1)} if isinstance(basis_element, tuple) else basis_element


def _functional_holds(statement: Statement, proof: Functional) -> bool:
    value = proof.values
    if sum((c * value.get(e, 0) for e, c in statement.target.items()), start=Fraction(0)) >= 0:
        return False
    size = len(statement.variables)
    for h in statement.equalities:
        for m in monomials(size, statement.degree - degree(h)):
            if sum((c * value.get(times(m, e), 0) for e, c in h.items()), start=Fraction(0)):
                return False
    return all(
        nonnegative_definite(localizing_matrix(weight, basis, value))
        for weight, basis in zip(statement.weights, reduced_bases(statement), strict=True)
    )


def localizing_matrix(
    weight: Polynomial, basis: Sequence[Exponents], values: Mapping[Exponents, Fraction]
) -> list[list[Fraction]]:
    """L(g·b bᵀ) (n × n) for one product g and a basis of monomials."""
    rows = [[Fraction(0)] * len(basis) for _ in basis]
    for i, left in enumerate(basis):
        for j in range(i, len(basis)):
            pair = times(left, basis[j])
            total = sum((c * values.get(times(pair, e), 0) for e, c in weight.items()), start=Fraction(0))
            rows[i][j] = rows[j][i] = total
    return rows


def _point_holds(statement: Statement, proof: Point) -> bool:
    x = proof.coordinates
    return (
        len(x) == len(statement.variables)
        and all(evaluate(g, x) >= 0 for g in statement.inequalities)
        and all(evaluate(h, x) == 0 for h in statement.equalities)
        and evaluate(statement.polynomial, x) < 0
    )


def residual(statement: Statement, squares: Sequence[Square], cofactors: Sequence[Polynomial]):
    """Target minus the right-hand side of a proposed proof."""
    size = len(statement.variables)
    left = element(statement.target, size)
    for square in squares:
        left -= _expanded(statement, square)
    for q, h in zip(cofactors, statement.equalities, strict=True):
        left -= element(q, size) * element(h, size)
    return mapping(left)


__all__ = [
    "Element",
    "Functional",
    "Point",
    "Proof",
    "Square",
    "SumOfSquares",
    "combination",
    "constant",
    "expand",
    "holds",
    "localizing_matrix",
    "residual",
]
