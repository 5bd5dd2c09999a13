"""Search for a Lyapunov function of given gains, finished in exact arithmetic. One pipeline for every law."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import pairwise

from quakedesign.certificates import (
    Certificate,
    Equilibrium,
    Loop,
    Verdict,
    certificate_text,
    parse_certificate,
)
from quakedesign.certificates.obligations import Obligations, claimed
from quakedesign.controllers import Controller
from quakedesign.errors import CertificateError
from quakedesign.rationals import nearest
from quakedesign.sos import Polynomial, Witness
from quakedesign.sos.solve.cone import Cone
from quakedesign.sos.solve.rounding import find_witness, monomial, scaled
from quakedesign.sos.solve.search import Family, GramSearch, largest_multiple, propose
from quakedesign.symbolic.candidates import signed_monomials
from quakedesign.symbolic.terms import Term

_GIVE_AWAY = Fraction(1, 2)
_DIGITS = (1 << 14, 1 << 20, 1 << 30)


def balance(loop: Loop) -> tuple[Fraction, ...]:
    """Powers of two 2^n_i that make the terms of every state's rate about equally large, for u_i = 2^n_i·ũ_i.

    Least squares on the logarithms; the first state keeps its scale.
    """
    import numpy as np

    states = tuple(loop.states)
    rows, sides = [], []
    for terms in loop.field.values():
        entries = [_logarithm(term, loop, states) for term in terms if term.factors and _size(term, loop)]
        for (e, c), (f, d) in pairwise(entries):
            if max(e) and max(f):
                rows.append([a - b for a, b in zip(e, f, strict=True)])
                sides.append(d - c)
    if len(states) == 1 or not rows:
        return (Fraction(1),) * len(states)
    solution, *_ = np.linalg.lstsq(np.array(rows)[:, 1:], np.array(sides), rcond=None)
    return (Fraction(1), *(Fraction(2) ** round(float(n)) for n in solution))


def _logarithm(term: Term, loop: Loop, states: Sequence[str]) -> tuple[list[float], float]:
    exponents = [0.0] * len(states)
    for state, exponent, _ in term.factors:
        exponents[states.index(state)] = float(exponent * loop.states[state])
    return exponents, math.log2(_size(term, loop))


def _size(term: Term, loop: Loop) -> Fraction:
    size = Fraction(abs(term.coefficient))
    for name in term.parameters:
        ends = loop.uncertain.get(name) or (loop.parameters[name],) * 2
        size *= max(abs(ends[0]), abs(ends[1]))
    return size


@dataclass(frozen=True, slots=True)
class _Candidates:
    """Obligation polynomials of every candidate monomial."""

    monomials: tuple[Term, ...]
    function: list[list[Polynomial]]
    decrease: list[list[Polynomial]]


def _candidates(loop: Loop, degree: int) -> _Candidates:
    monomials = signed_monomials(loop.states, degree, loop.domain)
    function, decrease = [], []
    for term in monomials:
        obligations = Obligations(loop, (term,))
        function.append([p for _, p in obligations.function()])
        decrease.append([p for _, p in obligations.decrease("")])
    return _Candidates(monomials, _different(function), _different(decrease))


def _different(columns: list[list[Polynomial]]) -> list[list[Polynomial]]:
    """Obligations (rows) without repetitions, each as its parts for every candidate."""
    rows = {tuple(tuple(sorted(p.items())) for p in row): list(row) for row in zip(*columns, strict=True)}
    return list(rows.values())


def find_certificate(loop: Loop, degree: int) -> Certificate | None:
    """Lyapunov function of one degree with an exact proof, or None when the search finds none.

    Parameters
    ----------
    loop : Loop
    degree : int
        Of V in the weights of the loop.

    Returns
    -------
    Certificate or None
        Already checked in exact arithmetic. None says nothing about the loop.
    """
    found = _candidates(loop, degree)
    scale = balance(loop)
    n = max((sum(e) for row in found.decrease for p in row for e in p), default=0)
    if not n or not found.function:
        return None
    variables = len(loop.states)
    cones = cone_of(variables, degree, loop.domain), cone_of(variables, n, loop.domain)
    sizes = [monomial(scale, _exponents(term, loop)) for term in found.monomials]
    columns = [
        [[scaled(p, scale, 1 / size) for p, size in zip(row, sizes, strict=True)] for row in rows]
        for rows in (found.function, found.decrease)
    ]
    pace = max(abs(c) for row in columns[1] for p in row for c in p.values())
    columns[1] = [[{e: c / pace for e, c in p.items()} for p in row] for row in columns[1]]
    families = [Family(cone, row) for cone, rows in zip(cones, columns, strict=True) for row in rows]
    proposal = propose(families, len(found.monomials))
    if proposal is None:
        return None
    for digits in _DIGITS:
        chosen = [nearest(a, digits) for a in proposal.decision]
        lyapunov = tuple(
            Term(a / size, t.parameters, t.factors)
            for a, size, t in zip(chosen, sizes, found.monomials, strict=True)
            if a
        )
        margins = (
            below(proposal.margin * float(min(1 / r**degree for r in scale))),
            below(proposal.margin * float(pace * min(1 / r**n for r in scale))),
        )
        claims = claims_of(loop, lyapunov, margins) | bounds_of(loop, lyapunov, scale)
        certificate = finish(loop, lyapunov, claims, scale)
        if certificate is not None:
            return certificate
    return None


def finish(
    loop: Loop, lyapunov: tuple[Term, ...], claims: Mapping[str, Fraction], scale: Sequence[Fraction]
) -> Certificate | None:
    """Find exact witnesses for every obligation of a given V; None when one is missing."""
    witnesses: dict[str, Witness] = {}
    known = set()
    try:
        for name, polynomial in claimed(loop, lyapunov, claims):
            key = tuple(sorted(polynomial.items()))
            if key in known:
                continue
            known.add(key)
            degree = max((sum(e) for e in polynomial), default=0)
            witness = find_witness(polynomial, gram_search(len(loop.states), degree, loop.domain), scale)
            if witness is None:
                return None
            witnesses[name] = witness
        certificate = Certificate(loop=loop, lyapunov=lyapunov, claims=dict(claims), witnesses=witnesses)
        readable = parse_certificate(certificate_text(certificate)) == certificate
        return certificate if readable and certificate.check() is Verdict.PROVED else None
    except CertificateError:
        return None


def claims_of(loop: Loop, lyapunov: tuple[Term, ...], margins: tuple[Fraction, Fraction]) -> dict[str, Fraction]:
    """Claims with room to spare: half of the margins, and on the reals 99 % of the decay rate of V."""
    if loop.domain == "cells":
        return {"positive": margins[0] * _GIVE_AWAY, "decrease": margins[1] * _GIVE_AWAY}
    return {"positive": margins[0] * _GIVE_AWAY, "rate": below(0.99 * quadratic_rate(loop, lyapunov))}


def bounds_of(loop: Loop, lyapunov: tuple[Term, ...], scale: Sequence[Fraction]) -> dict[str, Fraction]:
    """Claims V ≥ γ u_x^m for every state, 10 % below the largest γ that the solver finds."""
    polynomials = {tuple(sorted(p.items())): p for _, p in Obligations(loop, lyapunov).function()}
    seen = [scaled(p, scale) for p in polynomials.values()]
    degree = sum(next(iter(seen[0])))
    cone = cone_of(len(loop.states), degree, loop.domain)
    size = max(abs(c) for p in seen for c in p.values())
    seen = [{e: c / size for e, c in p.items()} for p in seen]
    claims = {}
    for i, state in enumerate(loop.states):
        corner = {tuple(degree if j == i else 0 for j in range(len(loop.states))): Fraction(1)}
        gamma = below(0.9 * largest_multiple(cone, seen, corner)) * size / scale[i] ** degree
        if gamma > 0:
            claims[f"bound_{state}"] = gamma
    return claims


def quadratic_matrix(loop: Loop, lyapunov: tuple[Term, ...]):
    """Matrix of a quadratic V, as floats (n × n)."""
    return _matrix(next(iter(Obligations(loop, lyapunov).function()))[1], len(loop.states))


def _matrix(polynomial: Polynomial, size: int):
    import numpy as np

    full = np.zeros((size, size))
    for exponents, c in polynomial.items():
        i, *rest = [k for k, e in enumerate(exponents) for _ in range(e)]
        full[i, rest[0]] += float(c) / 2
        full[rest[0], i] += float(c) / 2
    return full


def quadratic_margin(loop: Loop, lyapunov: tuple[Term, ...]) -> Fraction:
    """Lower bound on the smallest eigenvalue of a quadratic V, 1/trace of the inverse; a proposal, not a proof."""
    import numpy as np

    V = quadratic_matrix(loop, lyapunov)
    scale = 1 / np.sqrt(np.abs(np.diag(V)))
    inverse = np.linalg.inv(scale[:, None] * V * scale[None, :]) * scale[:, None] * scale[None, :]
    return below(float(1 / np.trace(inverse)))


def quadratic_rate(loop: Loop, lyapunov: tuple[Term, ...]) -> float:
    """Largest a with V' ≤ −2aV at every vertex, for a quadratic V; floating point, may be negative."""
    import numpy as np
    from scipy.linalg import eigh

    obligations = Obligations(loop, lyapunov)
    size = len(loop.states)
    V = quadratic_matrix(loop, lyapunov)
    diagonal = np.diag(1 / np.sqrt(np.abs(np.diag(V))))
    try:
        return min(
            float(eigh(diagonal @ _matrix(p, size) @ diagonal, diagonal @ V @ diagonal, eigvals_only=True)[0]) / 2
            for _, p in obligations.decrease("rate")
        )
    except np.linalg.LinAlgError:
        return -1.0


def refute(loop: Loop, law: type[Controller]) -> Certificate | None:
    """Counterexample suggested by the law, checked in exact arithmetic, or None."""
    parts = law.counterexample(loop.gains, loop.uncertain)
    if parts is None:
        return None
    certificate = Certificate(loop=loop, refutation=Equilibrium(**parts))
    try:
        certificate.check()
    except CertificateError:
        return None
    return certificate


@cache
def cone_of(variables: int, degree: int, domain: str) -> Cone:
    """Cone of a domain."""
    return Cone(variables, degree, domain == "cells")


@cache
def gram_search(variables: int, degree: int, domain: str) -> GramSearch:
    """Compiled search for Gram matrices, one for every shape."""
    return GramSearch(cone_of(variables, degree, domain))


def _exponents(term: Term, loop: Loop) -> list[int]:
    powers = {state: exponent * loop.states[state] for state, exponent, _ in term.factors}
    return [int(powers.get(state, 0)) for state in loop.states]


def below(number: float) -> Fraction:
    """Positive number rounded down to about three digits, as a short rational; zero stays zero."""
    if not number > 0 or not math.isfinite(number):
        return Fraction(0)
    shift = Fraction(2) ** (9 - math.floor(math.log2(number)))
    return Fraction(math.floor(Fraction(number) * shift)) / shift
