"""Searched Lyapunov functions: the largest part of a shape in a region of attraction, by alternation.

For V < 1 on the region, fixed multipliers s and t with

    −V̇ − s·(1 − V),  1 − V − t·(β − shape)  and  V  sums of squares

are found by `strict_proof` for the V at hand, and then V and β, the larger the better, by a programme that is linear in
them (W. Tan and A. Packard, IEEE Trans. Automat. Contr. 53, 2008). Every V is proved anew by who asks.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from math import inf

from quakedesign.rationals import nearest
from quakedesign.sos.exact.answer import Answer
from quakedesign.sos.exact.attraction import Attraction, Region, along
from quakedesign.sos.exact.polynomial import (
    Exponents,
    Polynomial,
    combination,
    constant,
    degree,
    mapping,
    monomials,
    product,
)
from quakedesign.sos.exact.squares import form, integer_gram
from quakedesign.sos.exact.statement import Statement, statement
from quakedesign.sos.solve.decide import strict_proof
from quakedesign.sos.solve.faces import just_below
from quakedesign.sos.solve.level_crossing import lowest_value_on
from quakedesign.sos.solve.program import Program

_ROUNDS = 30
_GROWTH = Fraction(1002, 1000)  # of β in a round: less is no progress
_INSIDE = Fraction(999999, 1000000)  # of the level, that V does not exceed on the part of the shape
_SHARES = tuple(Fraction(s) for s in ("99999/100000", "999/1000", "99/100", "9/10"))  # of β where shape and level touch
_SLACK = (Fraction(99, 100), Fraction(9, 10))  # of level and β, where multipliers are taken: at both, V can only stay
_MORE = (0, 2)
_ROOM = 1e-3  # of β, given up for a V inside of what is possible
_GRID = 2**20  # of the coefficients of V


def with_shape(found: Region, shape: Polynomial) -> Region:
    """Region with the largest β found for which {shape ≤ β} is proved to lie in it."""
    claim = found.proved
    if claim is None or claim.level is None:
        return found
    size = len(claim.variables)
    touching = lowest_value_on(shape, combination([(Fraction(1), claim.lyapunov), (-claim.level, constant(size))]))
    if not 0 < touching < inf:
        return found
    for beta in (just_below(Fraction(touching) * share) for share in _SHARES):
        asked = _inclusion(claim, _INSIDE * claim.level, shape, beta, degree(claim.lyapunov))
        proof = strict_proof(asked)
        if proof is not None:
            return replace(found, inclusion=Answer(statement=asked, proof=proof))
    return found


def expanded(found: Region, shape: Polynomial, top: int, certify: Callable[[Attraction], Region]) -> Region:
    """Region of a V of degree at most `top` with a larger part of the shape, from one that is proved.

    Parameters
    ----------
    found : Region
    shape : Polynomial
    top : int
    certify : callable
        Region that is proved for a V.
    """
    best = with_shape(found, shape)
    for degree_now in range(2, top + 1, 2):
        for _ in range(_ROUNDS):
            candidates = (with_shape(certify(claim), shape) for claim in _improved(best, shape, degree_now))
            better = next((region for region in candidates if _grows(best, region)), None)
            if better is None:
                break
            best = better
    return best


def _grows(old: Region, new: Region) -> bool:
    return new.shape_level is not None and old.shape_level is not None and new.shape_level > _GROWTH * old.shape_level


def _improved(found: Region, shape: Polynomial, top: int) -> Iterator[Attraction]:
    """Claims, not yet proved, with another V, from multipliers that leave less and more slack."""
    claim, beta = found.proved, found.shape_level
    if claim is None or claim.level is None or beta is None:
        return
    own = combination([(1 / claim.level, claim.lyapunov)])
    top = max(top, degree(own))
    for slack in _SLACK:
        held = replace(claim, lyapunov=own, level=slack, proof=None)
        falling = _multiplier(held.decrease, top - 1 + max(map(degree, claim.field)))
        inner = _multiplier(_inclusion(held, Fraction(1), shape, slack * beta, top), top)
        if falling is not None and inner is not None:
            lyapunov = _larger(claim, shape, top, falling, inner)
            if lyapunov is not None:
                yield replace(claim, lyapunov=lyapunov, level=None, proof=None)


def _inclusion(claim: Attraction, level: Fraction, shape: Polynomial, beta: Fraction, top: int) -> Statement:
    """That V ≤ level where shape ≤ β."""
    one = constant(len(claim.variables))
    return statement(
        claim.variables,
        combination([(level, one), (Fraction(-1), claim.lyapunov)]),
        inequalities=(combination([(beta, one), (Fraction(-1), shape)]),),
        products=False,
        degree_bound=_even(max(top, degree(claim.lyapunov), degree(shape))),
    )


def _even(number: int) -> int:
    return number + number % 2


def _multiplier(asked: Statement, least: int) -> Polynomial | None:
    """Squares that multiply the inequality in a proof of at least some degree; None without a proof."""
    for more in _MORE:
        proof = strict_proof(replace(asked, degree=max(asked.degree, _even(least)) + more))
        if proof is not None:
            size = len(asked.variables)
            parts = (mapping(form(s.basis, integer_gram(s), size)) for s in proof.squares if s.product)
            return combination((Fraction(1), part) for part in parts)
    return None


def _larger(
    claim: Attraction, shape: Polynomial, top: int, falling: Polynomial, inner: Polynomial
) -> Polynomial | None:
    """V of degree `top` with the largest β for two multipliers; None if none is found."""
    size = len(claim.variables)
    terms = list(monomials(size, top, 2))
    program = Program(claim.variables, decision_names(claim.variables, len(terms) + 1))
    powers: list[Polynomial] = [{e: Fraction(1)} for e in terms]
    minus = [combination([(Fraction(-1), p)]) for p in powers]
    slopes = [
        combination([(Fraction(-1), along(claim.field, p)), (Fraction(1), product(size, (falling, p)))]) for p in powers
    ]
    program.require(affine({}, [*powers, {}]))
    one = combination([(Fraction(1), constant(size)), (Fraction(1), product(size, (inner, shape)))])
    program.require(affine(one, [*minus, combination([(Fraction(-1), inner)])]))
    program.require(affine(combination([(Fraction(-1), falling)]), [*slopes, {}]))
    program.maximize({tuple(int(i == len(terms)) for i in range(len(terms) + 1)): Fraction(1)})
    values = program.proposal(_ROOM)
    if values is None:
        return None
    found = {e: nearest(v, _GRID) for e, v in zip(terms, values, strict=False)}
    return {e: c for e, c in found.items() if c}


def affine(fixed: Polynomial, parts: list[Polynomial]) -> dict[Exponents, Fraction]:
    """Polynomial fixed + Σ_j decision_j·part_j in variables and decisions, as `Program.require` takes it."""
    whole = {(*e, *(0,) * len(parts)): c for e, c in fixed.items()}
    for j, part in enumerate(parts):
        whole |= {(*e, *(int(i == j) for i in range(len(parts)))): c for e, c in part.items()}
    return whole


def decision_names(variables: tuple[str, ...], count: int) -> list[str]:
    """Names that no variable has."""
    prefix = "c" * (1 + max(map(len, variables)))
    return [f"{prefix}{i}" for i in range(count)]
