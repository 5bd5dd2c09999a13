"""Multipliers of a polynomial on ℝⁿ: powers of the sum of squares, and sums of squares that are searched for it.

A sum of squares σ of a degree with σ·P a sum of squares is a linear question. σ is found in floating point, in scaled
variables, then rounded, and proved to be a sum of squares; whether σ·P is one is decided exactly by who asks.
"""

from collections.abc import Sequence
from fractions import Fraction

from quakedesign.rationals import nearest
from quakedesign.sos.exact.polynomial import Exponents, Polynomial, monomials, product, rescaled
from quakedesign.sos.exact.reduction import invariant
from quakedesign.sos.exact.statement import statement
from quakedesign.sos.solve.decide import strict_proof
from quakedesign.sos.solve.joint import Demand, joint_program
from quakedesign.sos.solve.scaling import scaled

_TERMS = 40  # of σ, so that the programme is solved within seconds
_GRID = 2**8  # of its coefficients
_LEAST = 1e-5  # margin of σ, whose coefficients are at most one


def searched(variables: tuple[str, ...], polynomial: Polynomial, top: int) -> Polynomial | None:
    """Sum of squares σ of one degree, a form where P is one, for which σ·P may be one; None if none is found."""
    moved = scaled(statement(variables, polynomial))
    target = moved.statement.polynomial
    used = [i for i in range(len(variables)) if any(e[i] for e in target)]
    form = len({sum(e) for e in target}) == 1
    terms = [
        e
        for e in monomials(len(variables), top, top if form else 0)
        if not any(k for i, k in enumerate(e) if i not in used) and invariant(moved.statement, e)
    ]
    values = _centred(variables, target, terms) if 0 < len(terms) <= _TERMS else None
    if values is None:
        return None
    rounded = {e: nearest(v, _GRID) for e, v in zip(terms, values, strict=True)}
    multiplier = rescaled({e: c for e, c in rounded.items() if c}, tuple(1 / s for s in moved.scale))
    return multiplier if strict_proof(statement(variables, multiplier)) is not None else None


def _centred(variables: tuple[str, ...], target: Polynomial, terms: list[Exponents]) -> list[float] | None:
    """Coefficients of σ, at most one, with the largest t for which σ − t·Σ m² is a sum of squares."""
    squares = {e: Fraction(1) for e in terms if not any(k % 2 for k in e)}
    own: list[Polynomial] = [{e: Fraction(1)} for e in terms]
    multiplied = [product(len(variables), (target, p)) for p in own]
    demands = [_demand(variables, own, squares), _demand(variables, multiplied, {})]
    proposal = joint_program(demands).solve(demands)
    return proposal.decision if proposal is not None and proposal.margin > _LEAST else None


def _demand(variables: tuple[str, ...], parts: Sequence[Polynomial], margin: Polynomial) -> Demand:
    template = statement(variables, {e: Fraction(1) for p in (*parts, margin) for e in p})
    return Demand(template=template, parts=parts, margin=margin)
