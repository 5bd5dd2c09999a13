"""Search for a Lyapunov function of given gains, completed by an exact certificate.

One pipeline for every law: candidates, scaling by powers of two, conic programme, claims with a margin, and rounding to
exact witnesses. The module also contains quadratic functions in floating point, and the stored results of the presets;
a stored certificate is used only after its exact check.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from fractions import Fraction
from functools import wraps
from hashlib import sha256
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import eigh

from quakedesign.cache import in_use, search_once
from quakedesign.errors import CertificateError, WorkError
from quakedesign.exact import nearest
from quakedesign.files import write_whole
from quakedesign.laws import LoopField, Subject, law
from quakedesign.laws.loop_field import lowest_degree
from quakedesign.lyapunov.exact.certificate import Certificate, cached_verdict, parse_certificate
from quakedesign.lyapunov.exact.certificate_files import certificate_text
from quakedesign.lyapunov.exact.claim import Equilibrium, Loop, Verdict, Witness
from quakedesign.lyapunov.exact.obligations import (
    Obligation,
    Obligations,
    claimed,
    different,
    obligation_degree,
    power_sum,
    statement_of,
    width,
    with_decay,
)
from quakedesign.sos import Polynomial
from quakedesign.sos.exact.polynomial import constant, monomial, product
from quakedesign.sos.solve.conic import collecting
from quakedesign.sos.solve.decide import strict_proof
from quakedesign.sos.solve.joint import Demand, Proposal, joint_program
from quakedesign.symbolic.term_expressions import signed_monomials
from quakedesign.symbolic.terms import Factor, Term

# ----------------------------------------------------------------------
# From a Lyapunov function and its claims to a certificate: an exact witness for every obligation.

_LEVELS = (0, 1, 2)
DECAY_LEVEL = 2


def certificate_of(
    loop: Loop, lyapunov: tuple[Term, ...], claims: Mapping[str, Fraction], subject: Subject | None = None
) -> Certificate | None:
    """Certificate with exact witnesses for every obligation of a given V; None if one is not found."""
    witnesses: dict[str, Witness] = {}
    try:
        for one in different(claimed(loop, lyapunov, claims)):
            witness = witness_of(one, loop.domain)
            if witness is None:
                return None
            witnesses[one.name] = witness
        certificate = Certificate(loop=loop, lyapunov=lyapunov, claims=dict(claims), witnesses=witnesses)
        readable = parse_certificate(certificate_text(certificate)) == certificate
        return certificate if readable and cached_verdict(certificate, subject) is Verdict.PROVED else None
    except (CertificateError, WorkError):
        return None


def witness_of(one: Obligation, domain: str) -> Witness | None:
    """Exact witness of an obligation, with the lowest sufficient power of Σu_i as multiplier; None if none is found."""
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
                squares=tuple(sorted(proof.squares, key=lambda s: max((i - size + 1 for i in s.product), default=0))),
                cofactors=proof.cofactors,
                conditions=len(one.inequalities),
            )
    return None


def power_of_sum(size: int, power: int) -> dict[tuple[int, ...], Fraction]:
    """Polynomial (Σ u_i)^power."""
    total = {tuple(int(i == j) for j in range(size)): Fraction(1) for i in range(size)}
    return product(size, [total] * power)


# ----------------------------------------------------------------------
# Scaling by powers of two, after which the numbers of a loop are of order one for a solver.


def balance(loop: Loop) -> tuple[Fraction, ...]:
    """Scales 2^n_i of the variables, u_i = 2^n_i·ũ_i, for which the terms of every state's rate are similar in size.

    The scales solve a least-squares problem in the logarithms; the scale of the first state is 1. A nested power is
    replaced by the powers of the terms of its argument.
    """
    states = tuple(loop.states)
    rows, sides = [], []
    for terms in loop.field.values():
        plain = [one for term in terms for one in _without_lifts(term, loop)]
        entries = [_logarithm(term, loop, states) for term in plain if term.factors and _size(term, loop)]
        for (e, c), (f, d) in pairwise(entries):
            if max(e) and max(f):
                rows.append([a - b for a, b in zip(e, f, strict=True)])
                sides.append(d - c)
    if len(states) == 1 or not rows:
        return (Fraction(1),) * len(states)
    solution, *_ = np.linalg.lstsq(np.array(rows)[:, 1:], np.array(sides), rcond=None)
    return (Fraction(1), *(Fraction(2) ** round(float(n)) for n in solution))


def _without_lifts(term: Term, loop: Loop) -> Iterator[Term]:
    """Copies of a term in which a power of a lift is replaced by that power of one term of the lift's argument."""
    lift = next((f for f in term.factors if f[0] in loop.lifts), None)
    if lift is None:
        yield term
        return
    for inner in loop.lifts[lift[0]]:
        if inner.factors and _size(inner, loop):
            powers: dict[str, Fraction] = {}
            for name, exponent, _ in (*(f for f in term.factors if f != lift), *inner.factors):
                share = exponent * lift[1] if (name, exponent, _) in inner.factors else exponent
                powers[name] = powers.get(name, Fraction(0)) + share
            factors: tuple[Factor, ...] = tuple((name, e, "a") for name, e in powers.items() if e)
            yield from _without_lifts(Term(term.coefficient, term.parameters, factors), loop)


def _logarithm(term: Term, loop: Loop, states: Sequence[str]) -> tuple[list[float], float]:
    exponents = [0.0] * len(states)
    for state, exponent, _ in term.factors:
        exponents[states.index(state)] = float(exponent * loop.states[state])
    return exponents, math.log2(_size(term, loop))


def _size(term: Term, loop: Loop) -> Fraction:
    size = Fraction(abs(term.coefficient))
    for name in term.parameters:
        ends = loop.ranges.get(name) or (loop.parameters[name],) * 2
        size *= max(abs(ends[0]), abs(ends[1]))
    return size


def lifted_scale(equalities: Sequence[Polynomial], scale: Sequence[Fraction]) -> tuple[Fraction, ...]:
    """Scales of all variables from those of the states: each equality t·w^n = P determines the scale of its w."""
    scales = list(scale)
    for equality in equalities:
        position = len(scales)
        power = max(e[position] for e in equality)
        sizes = [abs(c) * monomial(scales, e[:position]) for e, c in equality.items() if not any(e[position:])]
        largest = max(sizes, default=Fraction(1))
        exponent = (math.log2(largest.numerator) - math.log2(largest.denominator)) / power
        scales.append(Fraction(2) ** round(exponent))
    return tuple(scales)


def below(number: float) -> Fraction:
    """Positive number rounded down to a rational of about three digits; 0 for a number ≤ 0 or not finite."""
    if not number > 0 or not math.isfinite(number):
        return Fraction(0)
    shift = Fraction(2) ** (9 - math.floor(math.log2(number)))
    return Fraction(math.floor(Fraction(number) * shift)) / shift


def scaled(polynomial: Polynomial, scale: Sequence[Fraction], factor: Fraction = Fraction(1)) -> Polynomial:
    """Polynomial factor · P(scale ∘ ũ)."""
    return {e: c * factor * monomial(scale, e) for e, c in polynomial.items()}


def normal(polynomial: Polynomial, scale: Sequence[Fraction]) -> Polynomial:
    """Polynomial P(scale ∘ ũ) divided by the largest magnitude of its coefficients."""
    moved = scaled(polynomial, scale)
    size = max(abs(c) for c in moved.values())
    return {e: c / size for e, c in moved.items()}


def exponents_of(term: Term, weights: Mapping[str, int]) -> tuple[int, ...]:
    """Exponents of a monomial of V in the cell variables of the states."""
    powers = {state: exponent * weights[state] for state, exponent, _ in term.factors}
    return tuple(int(powers.get(state, 0)) for state in weights)


# ----------------------------------------------------------------------
# Quadratic Lyapunov functions as matrices in floating point: proposals without proof.


def quadratic_terms(states: Sequence[str], coefficient: Callable[[int, int], Fraction]) -> tuple[Term, ...]:
    """Nonzero terms of Σ c_ij·x_i·x_j over i ≤ j."""
    squares = ((left, Fraction(2), "a") for left in states)
    return tuple(
        Term(value, (), (square,) if i == j else ((left, Fraction(1), "s"), (right, Fraction(1), "s")))
        for i, (left, square) in enumerate(zip(states, squares, strict=True))
        for j, right in enumerate(states)
        if i <= j and (value := coefficient(i, j))
    )


def quadratic_matrix(loop: Loop, lyapunov: tuple[Term, ...]) -> np.ndarray:
    """Matrix of a quadratic V in floating point (n × n)."""
    return _matrix(next(iter(Obligations(loop, lyapunov).function()))[1], len(loop.states))


def _matrix(polynomial: Polynomial, size: int) -> np.ndarray:
    full = np.zeros((size, size))
    for exponents, c in polynomial.items():
        i, *rest = [k for k, e in enumerate(exponents) for _ in range(e)]
        full[i, rest[0]] += float(c) / 2
        full[rest[0], i] += float(c) / 2
    return full


def quadratic_margin(loop: Loop, lyapunov: tuple[Term, ...]) -> Fraction:
    """Lower bound on the smallest eigenvalue of a quadratic V, 1/trace of the inverse; a proposal, not a proof."""
    V = quadratic_matrix(loop, lyapunov)
    scale = 1 / np.sqrt(np.abs(np.diag(V)))
    inverse = np.linalg.inv(scale[:, None] * V * scale[None, :]) * scale[:, None] * scale[None, :]
    return below(float(1 / np.trace(inverse)))


def quadratic_rate(loop: Loop, lyapunov: tuple[Term, ...]) -> float:
    """Largest a [1/s] with V' ≤ −2aV at every vertex for a quadratic V, in floating point; −1 if V is not definite."""
    obligations = Obligations(loop, lyapunov)
    size = len(loop.states)
    V = quadratic_matrix(loop, lyapunov)
    diagonal = np.diag(1 / np.sqrt(np.abs(np.diag(V))))
    try:
        return min(
            float(
                eigh(diagonal @ _matrix(one.polynomial, size) @ diagonal, diagonal @ V @ diagonal, eigvals_only=True)[0]
            )
            / 2
            for _, one in obligations.decrease("rate")
        )
    except np.linalg.LinAlgError:
        return -1.0


# ----------------------------------------------------------------------
# Claims of a Lyapunov function: margins, decay rate and bounds, reduced so that exact proofs succeed.

MARGIN_SHARE = Fraction(1, 2)
_DECAY_SHARE = 0.99


def claims_of(loop: Loop, lyapunov: tuple[Term, ...], margins: tuple[Fraction, Fraction]) -> dict[str, Fraction]:
    """Reduced claims: half of the margins, and on the reals 99 % of the decay rate of V."""
    if loop.domain == "cells":
        return {"positive": margins[0] * MARGIN_SHARE, "decrease": margins[1] * MARGIN_SHARE}
    return {"positive": margins[0] * MARGIN_SHARE, "rate": below(0.99 * quadratic_rate(loop, lyapunov))}


def bounds_of(loop: Loop, lyapunov: tuple[Term, ...], scale: Sequence[Fraction]) -> dict[str, Fraction]:
    """Claims V ≥ γ u_x^m for every state, 10 % below the largest γ that the solver finds."""
    function = [p for _, p in Obligations(loop, lyapunov).function()]
    m, size = obligation_degree(function, "V"), len(loop.states)
    different = list({tuple(sorted(p.items())): p for p in function}.values())
    claims = {}
    for i, state in enumerate(loop.states):
        corner = {tuple(m * (j == i) for j in range(size)): Fraction(1)}
        obligations = [Obligation(state, p) for p in different]
        gamma = below(0.9 * min(_largest(one, corner, loop.domain, scale, 0) for one in obligations))
        if gamma > 0:
            claims[f"bound_{state}"] = gamma
    return claims


def with_largest_decay(
    certificate: Certificate, scale: Sequence[Fraction], subject: Subject | None = None
) -> Certificate | None:
    """Certificate that also claims V̇ ≤ −κV^{n/m}, with κ 1 % below the solver's maximum; None without proof."""
    loop, lyapunov = certificate.loop, certificate.lyapunov
    obligations = Obligations(loop, lyapunov)
    m = obligation_degree([p for _, p in obligations.function()], "V")
    decrease = list(obligations.decrease("decrease"))
    n = obligation_degree([one.polynomial for _, one in decrease], "V̇")
    largest = float("inf")
    for bare in different(with_decay(obligations, cell, one, Fraction(0), m, n) for cell, one in decrease):
        power = {(*(0,) * (width(bare) - 1), n): Fraction(1)}
        largest = min(largest, _largest(bare, power, loop.domain, scale, DECAY_LEVEL))
    kappa = below(_DECAY_SHARE * largest)
    if kappa <= 0:
        return None
    return certificate_of(loop, lyapunov, {**certificate.claims, "decay": kappa}, subject)


def _largest(one: Obligation, direction: Polynomial, domain: str, scale: Sequence[Fraction], level: int) -> float:
    """Largest g for which the solver finds P − g·direction in the cone, without proof; 0 if it finds none."""
    whole = lifted_scale(one.equalities, scale)
    size = max(abs(c) for c in scaled(one.polynomial, whole).values())
    moved = Obligation(
        one.name,
        scaled(one.polynomial, whole, 1 / size),
        tuple(scaled(h, whole) for h in one.equalities),
        tuple(scaled(g, whole) for g in one.inequalities),
    )
    (corner,) = direction
    unit = whole[next(i for i, x in enumerate(corner) if x)] ** sum(corner) / size
    support = dict.fromkeys((*moved.polynomial, corner), Fraction(1))
    kind = Obligation(one.name, support, moved.equalities, moved.inequalities)
    template = statement_of(kind, domain, power_of_sum(len(whole), level))
    demand = Demand(template=template, parts=(moved.polynomial,), margin=direction)
    proposal = joint_program([demand]).solve([demand])
    return 0.0 if proposal is None else max(0.0, proposal.margin) / float(unit)


# ----------------------------------------------------------------------
# Stored results of the searches that every comparison of the presets needs; a stored result is re-checked when used.
#
# The folder `stored` has one file per search, named by a digest of the problem: a certificate, or ``null`` if none was
# found. The results of all other searches on this machine are in `quakedesign.cache`. A certificate is used only after
# its exact check, so a wrong file costs time but proves nothing.

FOLDER = Path(__file__).parent / "stored"
_NOTHING = "null\n"

Search = Callable[[Loop, int, Subject | None], Certificate | None]


def cached(search: Search) -> Search:
    """Search that reads stored results from the folder or the cache, and runs if no valid one exists."""

    @wraps(search)
    def stored(loop: Loop, degree: int, subject: Subject | None) -> Certificate | None:
        path, certificates = path_of(loop, degree), list[Certificate | None]()

        def searched() -> str:
            certificates.append(search(loop, degree, subject))
            return _NOTHING if certificates[0] is None else certificate_text(certificates[0])

        if path.exists():
            text = path.read_text(encoding="utf-8")
        elif collecting() or not in_use():
            return search(loop, degree, subject)
        else:
            text = search_once(searched, "lyapunov", loop, degree)
        if certificates or text == _NOTHING:
            return certificates[0] if certificates else None
        with suppress(CertificateError, WorkError):
            certificate = parse_certificate(text)
            if certificate.loop == loop and cached_verdict(certificate, subject) is Verdict.PROVED:
                return certificate
        return search(loop, degree, subject)

    return stored


def path_of(loop: Loop, degree: int) -> Path:
    """Path of the file with the stored result of the search for a loop and a degree of V."""
    key = repr([degree, *((field.name, getattr(loop, field.name)) for field in fields(loop))])
    return FOLDER / f"{loop.law}_{sha256(key.encode()).hexdigest()[:16]}.json"


def store(loop: Loop, degree: int, certificate: Certificate | None) -> None:
    """Store the result of a search in its file."""
    write_whole(path_of(loop, degree), _NOTHING if certificate is None else certificate_text(certificate))


# ----------------------------------------------------------------------
# Search for a Lyapunov function of given gains, completed in exact arithmetic. One pipeline for every law.

_WORTH_A_PROOF = 1e-9
"""Margins above this are tried in exact arithmetic, which decides."""
_DIGITS = (1 << 14, 1 << 20, 1 << 30)  # denominators of the rounded coefficients of V, coarsest first
_HIGHEST_DEGREE, _HIGHEST_IN_THE_PLANE = 8, 10  # higher degrees gain less than they cost in rounding or time


def candidate_degrees(loop: Loop) -> tuple[int, ...]:
    """Degrees of V to try: the lowest that couples the states of largest weight; on cells then even ones up to 8 or 10.

    The largest degree is 10 for at most two states, else 8.
    """
    lowest = lowest_degree(loop.states.values(), loop.domain)
    if loop.domain == "reals":
        return (lowest,)
    highest = _HIGHEST_IN_THE_PLANE if len(loop.states) <= 2 else _HIGHEST_DEGREE
    return (lowest, *(m for m in range(lowest + 1, highest + 1) if m % 2 == 0))


def find_certificate(
    loop: Loop, degrees: int | Iterable[int] | None = None, *, subject: Subject | None = None
) -> Certificate | None:
    """Certificate of a Lyapunov function with an exact proof; None if the search finds none.

    Parameters
    ----------
    loop : Loop
        Closed loop with its gains and ranges.
    degrees : int or iterable of int, optional
        Degrees of V in the weights of the loop, tried in order; by default `candidate_degrees`.
    subject : str, type of Law or LoopField, optional
        Law of the loop; required for a user-defined law.

    Returns
    -------
    Certificate or None
        Certificate that was checked in exact arithmetic. None does not imply that the loop is unstable.
    """
    if degrees is None:
        degrees = candidate_degrees(loop)
    chosen = (degrees,) if isinstance(degrees, int) else degrees
    return next(filter(None, (_of_degree(loop, degree, subject) for degree in chosen)), None)


@cached
def _of_degree(loop: Loop, degree: int, subject: Subject | None) -> Certificate | None:
    scale = balance(loop)
    family = family_of(loop, degree, scale)
    if family is None:
        return None
    proposal = joint_program(family.demands).solve(family.demands)
    if proposal is None or not proposal.margin > _WORTH_A_PROOF:
        return None
    return certificate_from_proposal(loop, family, proposal, scale, subject)


def certificate_from_proposal(
    loop: Loop, family: "Family", proposal: Proposal, scale: Sequence[Fraction], subject: Subject | None = None
) -> Certificate | None:
    """Certificate from a proposal of a family in scaled variables, with the coarsest rounding that has a proof.

    Roundings coarser than the margin are not tried.
    """
    degree = sum(exponents_of(family.monomials[0], loop.states))
    for digits in [d for d in _DIGITS if d * proposal.margin > 1] or _DIGITS[-1:]:
        lyapunov = family.function(proposal.decision, digits)
        margins = (
            below(proposal.margin * float(min(1 / r**degree for r in scale))),
            below(proposal.margin * float(family.rate_scale * min(1 / r**family.decrease_degree for r in scale))),
        )
        claims = claims_of(loop, lyapunov, margins) | bounds_of(loop, lyapunov, scale)
        certificate = certificate_of(loop, lyapunov, claims, subject)
        if certificate is not None:
            return certificate
    return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """Lyapunov functions Σ a_j V_j with the monomials V_j of one degree, as constraints on the a_j."""

    monomials: tuple[Term, ...]  # V_j·size_j
    sizes: tuple[Fraction, ...]  # Divisors after which the monomials are of order one in the scaled variables
    demands: tuple[Demand, ...]  # V and −V̇ on every distinct cell and vertex, scaled
    rate_scale: Fraction  # Divisor of −V̇
    decrease_degree: int  # Degree of V̇

    def function(self, decision: Sequence[float], digits: int) -> tuple[Term, ...]:
        """V with coefficients rounded to multiples of 1/digits in the scaled variables."""
        return sum_of(self.monomials, self.sizes, decision, digits)


def sum_of(
    monomials: Sequence[Term], sizes: Sequence[Fraction], decision: Sequence[float], digits: int
) -> tuple[Term, ...]:
    """Terms of Σ a_j·monomial_j/size_j with every a_j rounded to a multiple of 1/digits."""
    chosen = [nearest(a, digits) for a in decision]
    return tuple(
        Term(a / size, t.parameters, t.factors) for a, size, t in zip(chosen, sizes, monomials, strict=True) if a
    )


def family_of(loop: Loop, degree: int, scale: Sequence[Fraction]) -> Family | None:
    """Family of all Lyapunov functions of one degree; None without candidates."""
    monomials = signed_monomials(loop.states, degree, loop.domain)
    sizes = tuple(monomial(scale, exponents_of(term, loop.states)) for term in monomials)
    columns = [Obligations(loop, (term,)) for term in monomials]
    function = _rows([[Obligation(name, p) for name, p in c.function()] for c in columns])
    decrease = _rows([[one for _, one in c.decrease("")] for c in columns])
    power = max((sum(e) for row in decrease for one in row for e in one.polynomial), default=0)
    if not power or not function or not all(any(one.polynomial for one in row) for row in decrease):
        return None
    moved = [[_moved(one, scale, 1 / size) for one, size in zip(row, sizes, strict=True)] for row in decrease]
    largest = max(abs(c) for row in moved for one in row for c in one.polynomial.values())
    demands = [
        *(
            _demand([_moved(o, scale, 1 / s) for o, s in zip(row, sizes, strict=True)], loop, degree)
            for row in function
        ),
        *(_demand([_moved(o, (), 1 / largest) for o in row], loop, power) for row in moved),
    ]
    return Family(monomials=monomials, sizes=sizes, demands=tuple(demands), rate_scale=largest, decrease_degree=power)


def _rows(columns: list[list[Obligation]]) -> list[list[Obligation]]:
    """Distinct obligations (rows), each with one entry per candidate V_j."""
    rows = {tuple(one.key for one in row): list(row) for row in zip(*columns, strict=True)}
    return list(rows.values())


def _moved(one: Obligation, scale: Sequence[Fraction], factor: Fraction) -> Obligation:
    """Obligation in scaled variables with its polynomial times a factor; an empty scale means unscaled variables."""
    if not scale:
        return Obligation(
            one.name, {e: c * factor for e, c in one.polynomial.items()}, one.equalities, one.inequalities
        )
    whole = lifted_scale(one.equalities, scale)
    return Obligation(
        one.name,
        scaled(one.polynomial, whole, factor),
        tuple(normal(h, whole) for h in one.equalities),
        tuple(normal(g, whole) for g in one.inequalities),
    )


def _demand(row: Sequence[Obligation], loop: Loop, power: int) -> Demand:
    size = next(len(e) for one in row for p in (one.polynomial, *one.equalities) for e in p)
    margin = power_sum(len(loop.states), power, size)
    support = dict.fromkeys([*(e for one in row for e in one.polynomial), *margin], Fraction(1))
    template = statement_of(Obligation("", support, row[0].equalities, row[0].inequalities), loop.domain)
    return Demand(template=template, parts=[one.polynomial for one in row], margin=margin)


def refute(loop: Loop, subject: Subject) -> Certificate | None:
    """Refutation by an equilibrium that the law proposes, checked exactly; None without one, as for a `LoopField`."""
    if isinstance(subject, LoopField):
        return None
    chosen = law(subject) if isinstance(subject, str) else subject
    parts = chosen.counterexample(loop.gains, loop.uncertain)
    if parts is None:
        return None
    certificate = Certificate(loop=loop, refutation=Equilibrium(**parts))
    try:
        certificate.check(subject)
    except CertificateError:
        return None
    return certificate
