"""A linear loop about a moving reference, derived from the law: what the integrals contribute becomes the states."""

from collections.abc import Sequence
from dataclasses import replace

import sympy as sp

from quakedesign.certificates.claim import Loop
from quakedesign.controllers import LoopField
from quakedesign.errors import CertificateError

STATES = ("e1", "e2", "zeta", "chi")


def without_inputs(loop: Loop) -> Loop:
    """Return the loop with all its inputs at zero."""
    field = {
        state: tuple(t for t in terms if not set(t.parameters) & set(loop.inputs))
        for state, terms in loop.field.items()
    }
    return replace(loop, field=field, inputs={})


def in_error_coordinates(model: LoopField) -> LoopField:
    """Return the loop of a law with integrals in e1, e2, ζ and χ.

    −ζ is what the integrals ξ add to the control, χ what they add to ζ′. About a moving reference the same equations
    hold for ζ and χ counted from their values at rest at r(t), which then only drift (ERRATA 8, 29).

    Raises
    ------
    CertificateError
        When the loop has not the form x1′ = x2, x2′ = s·x1 − w·x2 + β·b·p with at most two integrals in a chain.
    """
    slip, rate, *integrals = model.states
    error, error_rate, *pushes = (sp.Symbol(name, real=True) for name in STATES)
    renamed = {slip: error, rate: error_rate}
    if sp.expand(model.field[slip] - rate) != 0 or model.domain != "reals":
        raise CertificateError("error coordinates need a linear loop with the slip rate as its second state.")
    factor = _control_factor(model, integrals)
    own, pushed = _split(model.field[rate], integrals)
    field = {error: error_rate, error_rate: own.subs(renamed) + (factor * pushes[0] if pushed != 0 else 0)}
    part = sp.expand(pushed / factor) if pushed != 0 else pushed
    for n, state in enumerate(pushes):
        if part == 0:
            break
        own, part = _split(sum(part.diff(xi) * model.field[xi] for xi in integrals), integrals)
        if part != 0 and n + 1 == len(pushes):
            raise CertificateError("error coordinates know at most two integrals in a chain.")
        field[state] = own.subs(renamed) + (pushes[n + 1] if part != 0 else 0)
    return replace(model, states=dict.fromkeys(field, 1), field=field)


def _control_factor(model: LoopField, integrals: Sequence[sp.Symbol]) -> sp.Expr:
    """What multiplies k·ξ in x2′, the same for every integral; zero where none acts."""
    rate = list(model.states)[1]
    found = {sp.expand(model.field[rate]).coeff(xi).subs(dict.fromkeys(model.gains, 1)) for xi in integrals} - {0}
    if len(found) > 1:
        raise CertificateError("error coordinates need integrals that act through one control.")
    return sum(found, sp.Integer(0))


def _split(expression: sp.Expr, integrals: Sequence[sp.Symbol]) -> tuple[sp.Expr, sp.Expr]:
    """Parts without and with the integrals."""
    expanded = sp.expand(expression)
    own = expanded.subs(dict.fromkeys(integrals, 0))
    return own, sp.expand(expanded - own)
