"""Sums of squares with monomial multipliers as exact witnesses of positivity."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from typing import Any

from quakedesign.sos.exact.definiteness import full_matrix, positive_definite

Exponents = tuple[int, ...]
Polynomial = Mapping[Exponents, Fraction]
"""Sparse polynomial: exponents to nonzero rational coefficient."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """u^times · bᵀQb with Q positive definite.

    Attributes
    ----------
    times : tuple of int
        Exponents of the monomial multiplier, each 0 or 1.
    basis : tuple of tuple of int
        Exponents of the monomials in b (length n).
    gram : tuple of Fraction
        Upper triangle of Q, row by row (length n(n+1)/2).
    """

    times: Exponents
    basis: tuple[Exponents, ...]
    gram: tuple[Fraction, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Witness:
    """multiplier · P = Σ u^times · bᵀQb.

    Attributes
    ----------
    multiplier : mapping of exponents to Fraction
        Positive coefficients.
    blocks : tuple of Block
    """

    multiplier: Polynomial
    blocks: tuple[Block, ...] = field(default=())


@cache
def _ring(variables: int) -> Any:
    from flint import fmpq_mpoly_ctx

    return fmpq_mpoly_ctx.get([f"u{i}" for i in range(variables)], "degrevlex")


def _element(polynomial: Polynomial, variables: int) -> Any:
    from flint import fmpq

    entries = {e: fmpq(c.numerator, c.denominator) for e, c in polynomial.items() if c}
    return _ring(variables).from_dict(entries)


def expand(block: Block) -> dict[Exponents, Fraction]:
    """Coefficients of u^times · bᵀQb."""
    rows = full_matrix(block.gram, len(block.basis))
    total: dict[Exponents, Fraction] = {}
    for left, row in zip(block.basis, rows, strict=True):
        for right, value in zip(block.basis, row, strict=True):
            key = tuple(a + b + c for a, b, c in zip(left, right, block.times, strict=True))
            total[key] = total.get(key, Fraction(0)) + value
    return total


def proves(polynomial: Polynomial, witness: Witness, *, orthant: bool) -> bool:
    """Whether the witness proves the polynomial non-negative.

    Parameters
    ----------
    polynomial : mapping of exponents to Fraction
    witness : Witness
    orthant : bool
        On the closed positive orthant if True, on all of ℝⁿ otherwise.

    Returns
    -------
    bool
        True only if the identity holds and all its parts are non-negative there; False proves nothing.
    """
    variables = len(next(iter(witness.multiplier), ()))
    one = (0,) * variables
    if not witness.multiplier or any(c <= 0 for c in witness.multiplier.values()):
        return False
    if (not polynomial or not orthant) and witness.multiplier != {one: Fraction(1)}:
        return False
    if not orthant and any(any(b.times) for b in witness.blocks):
        return False
    if not all(_well_formed(b, variables) for b in witness.blocks):
        return False
    left = _element(witness.multiplier, variables) * _element(polynomial, variables)
    right = sum((_element(expand(b), variables) for b in witness.blocks), start=_element({}, variables))
    return left == right and all(positive_definite(full_matrix(b.gram, len(b.basis))) for b in witness.blocks)


def _well_formed(block: Block, variables: int) -> bool:
    vectors = (block.times, *block.basis)
    return (
        all(len(v) == variables and all(isinstance(x, int) and x >= 0 for x in v) for v in vectors)
        and max(block.times, default=0) <= 1
        and len(set(block.basis)) == len(block.basis) > 0
        and len(block.gram) == len(block.basis) * (len(block.basis) + 1) // 2
    )
