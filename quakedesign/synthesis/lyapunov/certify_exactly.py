"""From a Lyapunov function and its claims to a certificate: an exact witness for every obligation."""

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from quakedesign.certificates import (
    Certificate,
    Loop,
    Verdict,
    Witness,
    certificate_text,
    decided_once,
    parse_certificate,
)
from quakedesign.certificates.obligations import Obligation, claimed, different
from quakedesign.certificates.witnesses import statement_of, width
from quakedesign.controllers import Subject
from quakedesign.errors import CertificateError, WorkError
from quakedesign.sos.exact.polynomial import constant, product
from quakedesign.sos.exact.proofs import Square, SumOfSquares
from quakedesign.sos.solve.decide import strict_proof
from quakedesign.symbolic.terms import Term

_LEVELS = (0, 1, 2)
DECAY_LEVEL = 2


def finish(
    loop: Loop,
    lyapunov: tuple[Term, ...],
    claims: Mapping[str, Fraction],
    subject: Subject | None = None,
) -> Certificate | None:
    """Find exact witnesses for every obligation of a given V; None when one is missing."""
    witnesses: dict[str, Witness] = {}
    try:
        for one in different(claimed(loop, lyapunov, claims)):
            witness = witness_of(one, loop.domain)
            if witness is None:
                return None
            witnesses[one.name] = witness
        certificate = Certificate(loop=loop, lyapunov=lyapunov, claims=dict(claims), witnesses=witnesses)
        readable = parse_certificate(certificate_text(certificate)) == certificate
        return certificate if readable and decided_once(certificate, subject) is Verdict.PROVED else None
    except (CertificateError, WorkError):
        return None


def witness_of(one: Obligation, domain: str) -> Witness | None:
    """Exact witness of one obligation, with the lowest power of the sum of all variables that works as multiplier."""
    size = width(one)
    if not one.polynomial:
        empty: tuple[dict[Any, Any], ...] = tuple({} for _ in one.equalities)
        return Witness(multiplier=constant(size), cofactors=empty, conditions=len(one.inequalities))
    first = DECAY_LEVEL if one.name.startswith("decay") else 0
    for level in range(first, first + len(_LEVELS)) if domain == "cells" else (0,):
        multiplier = power_of_sum(size, level)
        proof = strict_proof(statement_of(one, domain, multiplier))
        if proof is not None:
            return Witness(
                multiplier=multiplier,
                squares=_ordered(proof, size),
                cofactors=proof.cofactors,
                conditions=len(one.inequalities),
            )
    return None


def power_of_sum(size: int, power: int) -> dict[tuple[int, ...], Fraction]:
    """(Σ u_i)^power."""
    total = {tuple(int(i == j) for j in range(size)): Fraction(1) for i in range(size)}
    return product(size, [total] * power)


def _ordered(proof: SumOfSquares, size: int) -> tuple[Square, ...]:
    """Squares without a condition first, then by condition, as in the file."""
    return tuple(sorted(proof.squares, key=lambda s: max((i - size + 1 for i in s.product), default=0)))
