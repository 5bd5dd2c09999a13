"""Sums of squares b'Qb: a basis b, a positive definite Q, and the polynomial identity that they are to prove."""

from collections import Counter
from fractions import Fraction
from itertools import chain
from math import comb
from typing import Any

from .numbers import (
    Polynomial,
    add,
    add_product,
    add_scaled,
    budget,
    need,
    read_exponents,
    read_list,
    read_object,
    read_polynomial,
    read_rational,
    to_integers,
)

MAX_BASIS, MAX_REDUCED = 200, 400


def is_positive_definite(upper: list[list[int]], *, or_singular: bool = False) -> bool:
    """Decide whether a symmetric matrix is positive (or non-negative) definite, by fraction-free elimination (Bareiss).

    Before step k every entry left is a minor of order k + 1, the pivot a leading one, so that `//` is exact. A
    singular matrix is non-negative definite only if every zero pivot has a zero row; omitting that row and its column
    changes no other minor.
    """
    size, divisor = len(upper), 1
    for k, row in enumerate(upper):
        if row[k] <= 0:
            if row[k] < 0 or not or_singular or any(row[k:]):
                return False
            continue
        budget.spend(comb(size - k, 2), 2 * max(entry.bit_length() for rest in upper[k:] for entry in rest[k:]))
        for i in range(k + 1, size):
            for j in range(i, size):
                upper[i][j] = (row[k] * upper[i][j] - row[i] * row[j]) // divisor
        divisor = row[k]
    return True


def read_element(value: Any, where: str, size: int, mixed: bool) -> Polynomial:
    """Read an element of a basis: a monomial or, in a mixed basis, any other polynomial."""
    if not mixed or type(value) is list:
        return {read_exponents(value, where, size, 999): 1}  # an integer, so that sums of monomials remain integers
    element = read_polynomial(value, where, size)
    need(list(element.values()) not in ([], [1]), where, "nonzero, and a list where it is a monomial", value)
    return element


def read_basis(value: Any, where: str, size: int, mixed: bool) -> list[Polynomial]:
    """Read a basis; every element has a term of its own, so that no entry of it can change without effect."""
    rows = read_list(value, where, 1, MAX_REDUCED if mixed else MAX_BASIS)
    basis = [read_element(row, where, size, mixed) for row in rows]
    uses = Counter(chain.from_iterable(basis))
    for element in basis:
        own = any(uses[exponents] == 1 and number > 0 for exponents, number in element.items())
        need(own, where, "without repetitions, every element with a positive term in no other", list(element))
    return basis


def read_square(
    value: Any, where: str, label: str, size: int, *, mixed: bool = False
) -> tuple[Any, list[Polynomial], Polynomial]:
    """Read the entry under the label, the basis b, and expand b'Qb after checking that Q is positive definite."""
    square = read_object(value, where, (label, "basis", "gram"))
    basis = read_basis(square["basis"], f"{where} basis", size, mixed)
    count = len(basis) * (len(basis) + 1) // 2
    entries = read_list(square["gram"], f"{where} gram", count, count)
    numbers, denominator = to_integers([read_rational(entry, f"{where} gram") for entry in entries], f"{where} gram")
    remaining = iter(numbers)
    upper = [[0] * i + [next(remaining) for _ in basis[i:]] for i in range(len(basis))]
    expanded: Polynomial = {key: Fraction(number) / denominator for key, number in expand(basis, upper).items()}
    need(is_positive_definite(upper), f"{where} gram", "positive definite", entries)
    return square[label], basis, expanded


def expand(basis: list[Polynomial], upper: list[list[int]]) -> Polynomial:
    """Return b'Qb as the sum over i of b_i * (Q_ii b_i + 2 sum over j > i of Q_ij b_j)."""
    total: Polynomial = {}
    for i, first in enumerate(basis):
        weighted: Polynomial = {}
        for j in range(i, len(basis)):
            for exponents, number in basis[j].items():
                add(weighted, exponents, (1 if i == j else 2) * upper[i][j] * number)
        add_product(total, first, weighted)
    return total


def check_identity(first: Polynomial, second: Polynomial, total: Polynomial, where: str) -> None:
    """Check that a product of two polynomials is a third."""
    difference = add_scaled(add_product({}, first, second), Fraction(-1), total)
    need(not difference, where, "exact in every monomial", min(difference, default=()))
