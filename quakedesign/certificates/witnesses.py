"""What proves one obligation: an identity with sums of squares on a cell."""

from fractions import Fraction
from functools import cache
from itertools import combinations

from quakedesign.certificates.claim import Witness
from quakedesign.certificates.obligations import Obligation
from quakedesign.sos.exact.polynomial import Polynomial, constant, degree
from quakedesign.sos.exact.proofs import SumOfSquares, identity_holds
from quakedesign.sos.exact.statement import Statement


def statement_of(one: Obligation, domain: str, multiplier: Polynomial | None = None) -> Statement:
    """Statement that a witness of an obligation proves.

    On cells all variables are non-negative, squares may be multiplied by products of different ones and by one sign
    condition. The degree is that of the form multiplier · P.
    """
    size = width(one)
    factor = constant(size) if multiplier is None else multiplier
    plain = domain == "cells"
    variables = tuple({_unit(size, i): Fraction(1)} for i in range(size)) if plain else ()
    return Statement(
        variables=tuple(f"u{i}" for i in range(size)),
        polynomial=one.polynomial,
        inequalities=(*variables, *one.inequalities),
        equalities=one.equalities,
        products=_products(len(variables), len(one.inequalities)),
        degree=degree(one.polynomial) + degree(factor),
        multiplier=factor,
    )


def width(one: Obligation) -> int:
    """Number of variables of an obligation; one for the zero polynomial without conditions."""
    for p in (one.polynomial, *one.equalities, *one.inequalities):
        for e in p:
            return len(e)
    return 1


@cache
def _products(variables: int, conditions: int) -> tuple[tuple[int, ...], ...]:
    subsets = [s for size in range(variables + 1) for s in combinations(range(variables), size)]
    with_condition = [(*s, variables + k) for k in range(conditions) for s in subsets]
    return (*subsets, *with_condition)


def _unit(size: int, index: int) -> tuple[int, ...]:
    return tuple(int(i == index) for i in range(size))


def proves(one: Obligation, witness: Witness, domain: str) -> bool:
    """Whether a witness proves an obligation; exact, and False for anything malformed.

    The multiplier has positive coefficients, so it is positive wherever all variables are, and that is enough
    (FORMAT.md). On the reals, and for P = 0, it must be one, so that no number of a file is without effect.
    """
    factor = witness.multiplier
    if not factor or any(c <= 0 for c in factor.values()):
        return False
    size = len(next(iter(factor)))
    if witness.conditions != len(one.inequalities):
        return False
    if any(len(e) != size for e in factor):
        return False
    if not one.polynomial:
        unused = not witness.squares and not any(witness.cofactors)
        return unused and factor == constant(size) and len(witness.cofactors) == len(one.equalities)
    if size != width(one) or (domain != "cells" and factor != constant(size)):
        return False
    proof = SumOfSquares(squares=witness.squares, cofactors=witness.cofactors)
    return identity_holds(statement_of(one, domain, factor), proof)
