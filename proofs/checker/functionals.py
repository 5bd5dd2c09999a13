"""Refutations of sums of squares: a functional that is negative at the polynomial and at no sum of the statement."""

from collections import Counter, defaultdict
from collections.abc import Iterator
from itertools import product
from math import comb
from typing import Any

from .numbers import Polynomial, add_product, budget, need, read_object, read_polynomial, to_integers
from .polynomials import Product, Statement, product_expander, terms_text
from .squares import MAX_REDUCED, is_positive_definite

MAX_MONOMIALS = 2000  # of a basis before reduction
DIGIT = 12  # bits of an exponent in a coded monomial; the largest exponent, of multiplier * polynomial, is 1998

Coded = dict[int, int]  # integer coefficients by monomials, coded as integers, so that products of monomials are sums


def coded(polynomial: Polynomial, where: str) -> Coded:
    """Return a positive multiple with integer coefficients."""
    codes = (sum(exponent << DIGIT * i for i, exponent in enumerate(exponents)) for exponents in polynomial)
    return dict(zip(codes, to_integers(polynomial.values(), where)[0], strict=True))


def monomials(size: int, degree: int) -> list[int]:
    """Return all coded monomials up to a degree, none if it is negative."""
    partial = [(0, degree)] if degree >= 0 else []
    for i in range(size):
        partial = [(m + (a << DIGIT * i), left - a) for m, left in partial for a in range(left + 1)]
    return [m for m, _ in partial]


def apply(functional: Coded, monomial: int, polynomial: Coded) -> int:
    """Return L(monomial * polynomial)."""
    total = 0
    for m, number in polynomial.items():
        value = functional.get(monomial + m, 0)
        budget.spend(1, value.bit_length() + number.bit_length())
        total += number * value
    return total


def check_equalities(functional: Coded, statement: Statement) -> set[int]:
    """Check that L is zero on all multiples of equalities within the degree, and return their monomials."""
    covered, size = set[int](), len(statement.variables)
    for equality in statement.equalities:
        factor, room = coded(equality, "an equality"), statement.degree - max(map(sum, equality))
        budget.spend(comb(size + max(room, 0), size) * len(factor), 0)
        for m in monomials(size, room):
            zero = apply(functional, m, factor) == 0
            need(zero, "the functional", "zero on all multiples of the equalities", "a nonzero value")
            covered.update(m + t for t in factor)
    return covered


def reduce(bases: dict[Product, list[int]], factors: dict[Product, Coded], kept: set[int]) -> dict[Product, set[int]]:
    """Drop monomials whose diagonal Gram entries must be zero, as long as there are any.

    Where only positive diagonal entries contribute to a monomial that is not kept, they add up to zero: each is
    zero, and its row with it. The number of other contributions can only decrease, so the order does not matter.
    """
    hindering: Counter[int] = Counter()  # by monomial, the number of all other contributions
    diagonal: dict[int, list[tuple[Product, int]]] = defaultdict(list)
    for chosen, basis in bases.items():
        for (t, number), (i, b) in product(factors[chosen].items(), enumerate(basis)):
            hindering.update(map((t + b).__add__, basis[i + (number > 0) :]))
            if number > 0:
                diagonal[t + b + b].append((chosen, b))
    alive = {chosen: set(basis) for chosen, basis in bases.items()}
    droppable = [e for e in diagonal if not hindering[e] and e not in kept]
    while droppable:
        for chosen, b in diagonal[droppable.pop()]:
            if b not in alive[chosen]:
                continue
            for (t, number), other in product(factors[chosen].items(), alive[chosen]):
                if other != b or number < 0:
                    e = t + b + other
                    hindering[e] -= 1
                    if not hindering[e] and e in diagonal and e not in kept:
                        droppable.append(e)
            alive[chosen].remove(b)
    return alive


def survivors(statement: Statement, kept: set[int]) -> Iterator[tuple[Product, Coded, list[int]]]:
    """Yield the products within the degree, expanded, with the monomials of their squares after reduction."""
    size, degrees = len(statement.variables), [max(map(sum, entry)) for entry in statement.inequalities]
    rooms = {chosen: statement.degree - sum(degrees[i] for i in chosen) for chosen in statement.products}
    counts = {chosen: comb(size + room // 2, size) for chosen, room in rooms.items() if room >= 0}
    need(counts[()] <= MAX_MONOMIALS, "a basis before reduction", f"of at most {MAX_MONOMIALS} monomials", counts[()])
    expanded = product_expander(statement)
    factors = {chosen: coded(expanded(chosen), "a product") for chosen in counts}
    budget.spend(sum(comb(count + 1, 2) * len(factors[chosen]) for chosen, count in counts.items()), 0)
    bases = {chosen: monomials(size, rooms[chosen] // 2) for chosen in counts}
    for chosen, basis in reduce(bases, factors, kept).items():
        need(len(basis) <= MAX_REDUCED, "a reduced basis", f"of at most {MAX_REDUCED} monomials", len(basis))
        yield chosen, factors[chosen], sorted(basis)


def blocks(upper: list[list[int]]) -> Iterator[list[list[int]]]:
    """Split a symmetric matrix, given by its upper triangle, into connected blocks."""
    left = list(range(len(upper)))
    while left:
        block = [left.pop(0)]
        for i in block:  # grows while it is read
            linked = {j for j in left if upper[min(i, j)][max(i, j)]}
            block += linked
            left = [j for j in left if j not in linked]
        yield [[upper[min(i, j)][max(i, j)] for j in block] for i in block]


def refute_by_functional(value: Any, statement: Statement) -> list[str]:
    """Verify that L is negative at multiplier * polynomial and non-negative at all sums of the statement."""
    proof, size = read_object(value, "not-sos", ("functional",)), len(statement.variables)
    values = read_polynomial(proof["functional"], "functional", size)
    left = add_product({}, statement.multiplier, statement.polynomial)
    functional, target = coded(values, "functional"), coded(left, "multiplier times polynomial")
    negative = apply(functional, 0, target) < 0
    need(negative, "the functional", "negative at multiplier times polynomial", "a value that is not negative")
    kept = check_equalities(functional, statement) | set(target)
    for chosen, factor, basis in survivors(statement, kept):
        upper = [[0] * i + [apply(functional, b + c, factor) for c in basis[i:]] for i, b in enumerate(basis)]
        valid = all(is_positive_definite(block, or_singular=True) for block in blocks(upper))
        need(valid, f"the moment matrix of product {list(chosen)}", "non-negative definite", "another one")
    return [
        f"functional, zero on all other monomials: {terms_text(values, statement, 'L({1}) = {0}', ', ')}",
        "conclusion: multiplier times polynomial is not a sum, with terms up to the degree, of products times sums of "
        "squares and multiples of the equalities",
    ]
