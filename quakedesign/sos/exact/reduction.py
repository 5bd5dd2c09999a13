"""Exact reduction of monomial bases before a problem is solved.

One rule replaces Newton polytope and diagonal inconsistency. Let e be a monomial to which no equality and only
diagonal Gram entries contribute, each with a positive factor. If the coefficient of e in the target is zero, all
these diagonal entries vanish, and so do their rows. The rule is repeated until nothing changes. On ℝⁿ, every
vertex v of the convex hull of the basis then has 2v in the support of the target, so the basis lies in ½·New,
where New is the Newton polytope of the target (Reznick 1978).
"""

from collections import Counter, defaultdict
from fractions import Fraction
from math import comb
from typing import Any

from quakedesign.errors import PolynomialError
from quakedesign.exact import shortly
from quakedesign.sos.exact.polynomial import Exponents, Polynomial, degree, monomials, times
from quakedesign.sos.exact.polynomial_statement import Statement, parity, residue
from quakedesign.sos.exact.work_budget import spend

_MONOMIALS, _PAIRS = 2_000, 8_000_000

Bases = tuple[tuple[Exponents, ...], ...]


def full_bases(statement: Statement) -> Bases:
    """For every product of inequalities, all monomials whose squares times the product respect the degree bound."""
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

    Raises
    ------
    PolynomialError
        When the full bases have too many monomials.

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
    """Indices of basis elements, grouped by their sign under the sign symmetries of the statement.

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
