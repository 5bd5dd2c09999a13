"""Exact proofs about a polynomial: sum of squares, functional, and negative point.

Chapters: monomials that the squares may contain; squares bᵀQb with exact coefficients, their expansion and the
definiteness of Q; the three kinds of proof. No solver is used.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from fractions import Fraction
from functools import reduce
from math import comb, lcm
from typing import Any, NamedTuple

from flint import fmpq, fmpq_mat, fmpq_mpoly, fmpz_mat

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import PolynomialError
from quakedesign.exact import fraction_of, shortly
from quakedesign.sos.exact.polynomial import (
    Exponents,
    Polynomial,
    degree,
    element,
    evaluate,
    full_matrix,
    mapping,
    monomials,
    multiplied,
    nonnegative_definite,
    over_common_denominator,
    positive_definite_integers,
    ring,
    times,
)
from quakedesign.sos.exact.polynomial_statement import Statement, parity, residue
from quakedesign.sos.exact.work_budget import expanded, length, longest, spend

_MONOMIALS, _PAIRS = 2_000, 8_000_000

Bases = tuple[tuple[Exponents, ...], ...]


def full_bases(statement: Statement) -> Bases:
    """All monomials whose squares, times a product of inequalities, respect the degree bound, for every product.

    Raises
    ------
    PolynomialError
        When a basis has more than 2000 monomials, or all bases together have more than 8·10⁶ pairs of monomials.
    """
    size = len(statement.variables)
    halves = [(statement.degree - degree(w)) // 2 for w in statement.weights]
    counts = [comb(size + h, size) if h >= 0 else 0 for h in halves]
    if max(counts, default=0) > _MONOMIALS or sum(n * n for n in counts) > _PAIRS:
        raise PolynomialError(
            f"a basis must have at most {_MONOMIALS} monomials, and all bases together at most {_PAIRS} pairs. "
            f"Received {shortly(max(counts))} monomials in the largest of {len(counts)}. Lower the degree."
        )
    return tuple(tuple(monomials(size, h)) for h in halves)


def reduced_bases(statement: Statement) -> Bases:
    """Monomials that can occur in the squares of a proof, for every product of inequalities.

    Returns
    -------
    tuple of tuple of exponents
        A proof of the statement exists with the full bases if and only if one exists with these.
    """
    alive = [dict.fromkeys(basis) for basis in full_bases(statement)]
    others, diagonal = _contributions(statement, alive)
    open_to_equalities = equality_monomials(statement)
    target = statement.target
    waiting = list(diagonal)
    while waiting:
        e = waiting.pop()
        if e in target or e in open_to_equalities or others[e] or any(c <= 0 for _, _, c in diagonal[e]):
            continue
        for k, b, _ in list(diagonal[e]):
            if b in alive[k]:
                del alive[k][b]
                waiting += _removed(statement.weights[k], k, b, alive[k], others, diagonal)
    return tuple(tuple(basis) for basis in alive)


def _contributions(statement: Statement, alive: Any) -> Any:
    """Number of off-diagonal entries, and set of diagonal entries, that contribute to each monomial."""
    others: Counter[Exponents] = Counter()
    diagonal: dict[Exponents, set[tuple[int, Exponents, Fraction]]] = defaultdict(set)
    for k, (weight, basis) in enumerate(zip(statement.weights, alive, strict=True)):
        spend(comb(len(basis) + 1, 2) * len(weight))
        elements = list(basis)
        for i, left in enumerate(elements):
            for e, c in weight.items():
                shifted = times(left, e)
                diagonal[times(shifted, left)].add((k, left, c))
                others.update(times(shifted, right) for right in elements[i + 1 :])
    return others, diagonal


def _removed(weight: Polynomial, k: int, gone: Exponents, basis: Any, others: Any, diagonal: Any) -> list[Exponents]:
    """Remove the entries of one basis element; return the monomials to which they contributed."""
    touched = []
    for e, c in weight.items():
        shifted = times(gone, e)
        own = times(shifted, gone)
        diagonal[own].discard((k, gone, c))
        touched.append(own)
        for other in basis:
            shared = times(shifted, other)
            others[shared] -= 1
            touched.append(shared)
    return touched


def equality_monomials(statement: Statement) -> set[Exponents]:
    """Monomials to which a multiple of an equality may contribute."""
    size = len(statement.variables)
    reachable = set[Exponents]()
    for h in statement.equalities:
        spend(comb(size + max(statement.degree - degree(h), 0), size) * len(h))
        for m in monomials(size, statement.degree - degree(h)):
            reachable.update(times(m, e) for e in h)
    return reachable


def parity_classes(statement: Statement, basis: tuple[Exponents, ...]) -> list[tuple[int, ...]]:
    """Indices of basis elements, grouped by their signs under the sign symmetries of the statement.

    The Gram matrix may be chosen block diagonal in these classes (Löfberg 2009).
    """
    echelon = statement.parities
    classes: dict[int, list[int]] = defaultdict(list)
    for index, b in enumerate(basis):
        classes[residue(parity(b), echelon)].append(index)
    return [tuple(c) for c in classes.values()]


def invariant(statement: Statement, exponents: Exponents) -> bool:
    """Whether a monomial keeps its sign under every sign change that leaves the statement invariant."""
    return residue(parity(exponents), statement.parities) == 0


# ----------------------------------------------------------------------
# Squares bᵀQb with exact coefficients: their expansion, and definiteness of Q.

Element = Exponents | Polynomial
"""Basis element: a monomial by its exponents, or a polynomial."""


@checked_dataclass(frozen=True, kw_only=True)
class Square:
    """(Π_{i∈S} g_i) · bᵀQb with Q positive definite.

    Attributes
    ----------
    product : tuple of int
        Index set S.
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
        When the number of entries of Q does not match the basis.
    """
    upper, denominator = over_common_denominator(square.gram)
    return IntegerGram(full_matrix(upper, len(square.basis)), denominator)


def is_definite(gram: IntegerGram) -> bool:
    """Whether Q is positive definite and not empty."""
    return len(gram.rows) > 0 and positive_definite_integers(gram.rows)


def _bits(rows: Sequence[Sequence[int]]) -> int:
    """Bit length of the longest entry."""
    return max((abs(v).bit_length() for row in rows for v in row), default=0)


def has_own_monomials(basis: Sequence[Element]) -> bool:
    """Whether every element has a monomial with positive coefficient that no other has, so that all are independent."""
    if all(isinstance(b, tuple) for b in basis):
        return True
    polynomials = [as_polynomial(b) for b in basis]
    uses = Counter(e for p in polynomials for e in p)
    return all(any(uses[e] == 1 and c > 0 for e, c in p.items()) for p in polynomials)


def in_echelon_form(square: Square) -> Square:
    """Equal square with a basis in which every element has a monomial that no other has."""
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


def form(basis: Sequence[Element], gram: IntegerGram, size: int) -> fmpq_mpoly:
    """Form bᵀQb in the ring, summed in integers.

    Raises
    ------
    ValueError
        When the basis repeats a monomial, or has another number of variables.
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
    """Monomials m and matrix M with bᵀQb = mᵀMm."""
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
    """Polynomial as a basis element; a monomial with coefficient 1 is given by its exponents."""
    nonzero = {e: c for e, c in polynomial.items() if c}
    return next(iter(nonzero)) if list(nonzero.values()) == [1] else nonzero


def as_polynomial(basis_element: Element) -> Polynomial:
    """Basis element as a polynomial."""
    return {basis_element: Fraction(1)} if isinstance(basis_element, tuple) else basis_element


# ----------------------------------------------------------------------
# The three kinds of proof about a statement, each checked in rational arithmetic without a solver.


@checked_dataclass(frozen=True, kw_only=True)
class SumOfSquares:
    """multiplier · polynomial = Σ squares + Σ_k cofactor_k h_k.

    Attributes
    ----------
    squares : tuple of Square
    cofactors : tuple of Polynomial
        Cofactors q_k, one for every equality.
    multiplier : tuple of Square
        The multiplier as a sum of squares; empty if its coefficients show that it is positive.
    """

    squares: tuple[Square, ...]
    cofactors: tuple[Polynomial, ...] = ()
    multiplier: tuple[Square, ...] = field(default=())


@checked_dataclass(frozen=True, kw_only=True)
class Functional:
    """Linear functional L that is non-negative on the cone and negative on the target.

    Attributes
    ----------
    values : mapping of exponents to Fraction
        L of each listed monomial; L of every other monomial is zero.
    """

    values: Mapping[Exponents, Fraction]


@checked_dataclass(frozen=True, kw_only=True)
class Point:
    """A point of the set where the polynomial is negative."""

    coordinates: tuple[Fraction, ...]


Proof = SumOfSquares | Functional | Point


def holds(statement: Statement, proof: Proof) -> bool:
    """Whether a proof is valid for its statement, in exact arithmetic.

    Parameters
    ----------
    statement : Statement
    proof : SumOfSquares, Functional or Point

    Returns
    -------
    bool
        True implies, for the three kinds in order: the polynomial is non-negative on the set; multiplier · polynomial
        is not in the cone; the polynomial is negative at a point of the set. False implies nothing.
    """
    try:
        match proof:
            case SumOfSquares():
                return multiplier_is_positive(statement, proof.multiplier) and _identity_holds(statement, proof)
            case Functional():
                return _functional_holds(statement, proof)
        return _point_holds(statement, proof)
    except (ValueError, TypeError, AttributeError):
        return False


def identity_holds(statement: Statement, proof: SumOfSquares) -> bool:
    """Whether the identity is exact and every Gram matrix positive definite; the multiplier is not checked."""
    try:
        return _identity_holds(statement, proof)
    except (ValueError, TypeError, AttributeError):
        return False


def _identity_holds(statement: Statement, proof: SumOfSquares) -> bool:
    if len(proof.cofactors) != len(statement.equalities):
        return False
    squares = _with_integers(proof.squares)
    proved = _right_side(statement, squares, proof.cofactors)
    return proved == _target(statement) and all(is_definite(gram) for _, gram in squares)


def multiplier_is_positive(statement: Statement, squares: tuple[Square, ...]) -> bool:
    """Whether the multiplier is proved positive on a dense subset, or on all of a set that may have no interior."""
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
    everywhere = any(not s.product and one in s.basis for s in squares)
    exact = _with_integers(squares)
    return (
        _sum(statement, exact) == element(statement.multiplier, size)
        and all(is_definite(gram) for _, gram in exact)
        and (statement.dense or everywhere)
    )


def _unit(size: int, index: int) -> Exponents:
    return tuple(int(i == index) for i in range(size))


def _with_integers(squares: Iterable[Square]) -> list[tuple[Square, IntegerGram]]:
    return [(square, integer_gram(square)) for square in squares]


def _target(statement: Statement) -> fmpq_mpoly:
    """multiplier · polynomial in the ring."""
    size = len(statement.variables)
    return multiplied(element(statement.multiplier, size), element(statement.polynomial, size))


def _right_side(
    statement: Statement, squares: Iterable[tuple[Square, IntegerGram]], cofactors: Iterable[Polynomial]
) -> fmpq_mpoly:
    """Σ (Π g_i)·bᵀQb + Σ q_k h_k in the ring."""
    size = len(statement.variables)
    total = _sum(statement, squares)
    for q, h in zip(cofactors, statement.equalities, strict=True):
        total += multiplied(element(q, size), element(h, size))
    return total


def _sum(statement: Statement, squares: Iterable[tuple[Square, IntegerGram]]) -> fmpq_mpoly:
    """Σ (Π g_i)·bᵀQb in the ring."""
    size = len(statement.variables)
    one = ring(size).constant(1)
    inequalities = [element(g, size) for g in statement.inequalities]
    total = 0 * one
    products = dict[tuple[int, ...], fmpq_mpoly]()
    for square, gram in squares:
        if square.product not in statement.products or not has_own_monomials(square.basis):
            raise ValueError(
                "the product of a square is not among those of the statement, or an element of its basis has no "
                "monomial of its own."
            )
        if square.product not in products:
            products[square.product] = reduce(multiplied, (inequalities[i] for i in square.product), one)
        total += multiplied(products[square.product], form(square.basis, gram, size))
        spend(len(total))
        expanded(len(total))
    return total


def _functional_holds(statement: Statement, proof: Functional) -> bool:
    value = proof.values
    if sum((c * value.get(e, 0) for e, c in statement.target.items()), start=Fraction(0)) >= 0:
        return False
    size = len(statement.variables)
    for p in (value, statement.target, *statement.equalities, *statement.weights):
        spend(len(p), longest(p.values()))
    for h in statement.equalities:
        spend(10 * comb(size + max(statement.degree - degree(h), 0), size) * len(h), longest(h.values()))
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
    """Matrix L(g·b bᵀ) (n × n) of a functional L, for one product g and the vector b of n monomials."""
    bits = max(map(length, (*weight.values(), *values.values())), default=0)
    spend(len(basis) ** 2 * len(weight), 2 * bits)
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


def residual(statement: Statement, squares: Sequence[Square], cofactors: Sequence[Polynomial]) -> Polynomial:
    """Target minus the right-hand side of a proposed identity."""
    return mapping(_target(statement) - _right_side(statement, _with_integers(squares), cofactors))


__all__ = ["Functional", "Point", "Proof", "Square", "SumOfSquares", "holds", "localizing_matrix", "residual"]
