"""Candidates for homogeneous Lyapunov functions, generated from weights and degree."""

from collections.abc import Iterator, Mapping
from fractions import Fraction
from itertools import product

from quakedesign.symbolic.terms import Factor, Term


def signed_monomials(weights: Mapping[str, int], degree: int, domain: str) -> tuple[Term, ...]:
    """Every C¹ product of signed powers of the degree that is even under x → −x.

    Parameters
    ----------
    weights : mapping of state to int
    degree : int
    domain : str
        ``"cells"``, or ``"reals"`` for polynomials only.

    Returns
    -------
    tuple of Term
        With coefficient 1.
    """
    terms = []
    for degrees in product(range(degree + 1), repeat=len(weights)):
        if sum(degrees) != degree:
            continue
        powers = [(s, Fraction(n, weights[s])) for s, n in zip(weights, degrees, strict=True) if n]
        for factors in _kinds(powers, domain):
            if sum(kind == "s" for _, _, kind in factors) % 2 == 0:
                terms.append(Term(Fraction(1), (), factors))
    return tuple(terms)


def _kinds(powers: list[tuple[str, Fraction]], domain: str) -> Iterator[tuple[Factor, ...]]:
    if any(a < 1 for _, a in powers):
        return
    for kinds in product("sa", repeat=len(powers)):
        factors = tuple((s, a, kind) for (s, a), kind in zip(powers, kinds, strict=True))
        smooth = all(kind == "s" or a > 1 for _, a, kind in factors)
        if smooth and (domain == "cells" or all((kind == "s") == (a % 2 == 1) for _, a, kind in factors)):
            yield factors
