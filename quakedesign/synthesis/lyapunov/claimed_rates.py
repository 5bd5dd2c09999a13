"""How much is claimed of a Lyapunov function: margins, decay rate and bounds, with room to spare for exact proofs."""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

from quakedesign.certificates import Certificate, Loop
from quakedesign.certificates.obligations import Obligation, Obligations, degree, different, with_decay
from quakedesign.certificates.witnesses import statement_of, width
from quakedesign.controllers import Subject
from quakedesign.sos.solve.joint import Demand, joint_program
from quakedesign.symbolic.terms import Term
from quakedesign.synthesis.lyapunov.balancing import below, lifted_scale, scaled
from quakedesign.synthesis.lyapunov.certify_exactly import DECAY_LEVEL, finish, power_of_sum
from quakedesign.synthesis.lyapunov.quadratic import quadratic_rate

GIVE_AWAY = Fraction(1, 2)
_DECAY_SHARE = 0.99


def claims_of(loop: Loop, lyapunov: tuple[Term, ...], margins: tuple[Fraction, Fraction]) -> dict[str, Fraction]:
    """Claims with room to spare: half of the margins, and on the reals 99 % of the decay rate of V."""
    if loop.domain == "cells":
        return {"positive": margins[0] * GIVE_AWAY, "decrease": margins[1] * GIVE_AWAY}
    return {"positive": margins[0] * GIVE_AWAY, "rate": below(0.99 * quadratic_rate(loop, lyapunov))}


def bounds_of(loop: Loop, lyapunov: tuple[Term, ...], scale: Sequence[Fraction]) -> dict[str, Fraction]:
    """Claims V ≥ γ u_x^m for every state, 10 % below the largest γ that the solver finds."""
    function = [p for _, p in Obligations(loop, lyapunov).function()]
    m, size = degree(function, "V"), len(loop.states)
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
    """The same certificate with V̇ ≤ −κV^{n/m} claimed, κ 1 % below the largest that the solver finds; None if none."""
    loop, lyapunov = certificate.loop, certificate.lyapunov
    obligations = Obligations(loop, lyapunov)
    m = degree([p for _, p in obligations.function()], "V")
    decrease = list(obligations.decrease("decrease"))
    n = degree([one.polynomial for _, one in decrease], "V̇")
    largest = float("inf")
    for bare in different(with_decay(obligations, cell, one, Fraction(0), m, n) for cell, one in decrease):
        power = {(*(0,) * (width(bare) - 1), n): Fraction(1)}
        largest = min(largest, _largest(bare, power, loop.domain, scale, DECAY_LEVEL))
    kappa = below(_DECAY_SHARE * largest)
    if kappa <= 0:
        return None
    return finish(loop, lyapunov, {**certificate.claims, "decay": kappa}, subject)


def _largest(
    one: Obligation,
    direction: Mapping[Any, Any],
    domain: str,
    scale: Sequence[Fraction],
    level: int,
) -> float:
    """Largest g for which the solver finds P − g·direction in the cone, 0 if it finds none; proves nothing."""
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
