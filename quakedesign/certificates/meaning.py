"""What a row or a field is about, whatever a file calls it: only what is compared or derived counts."""

from fractions import Fraction
from functools import cache

import sympy as sp

from quakedesign.certificates.claim import Loop, require, sympy_field
from quakedesign.certificates.error_coordinates import STATES
from quakedesign.certificates.response import Response
from quakedesign.errors import CertificateError
from quakedesign.symbolic import plant
from quakedesign.symbolic.relative_degree import relative_degree
from quakedesign.symbolic.terms import Term, real_polynomial

SLIP_ERROR, SLIP_RATE_ERROR, PRESSURE_OFFSET = "slip_error", "slip_rate_error", "pressure_offset"
_CONTROL = "beta"


def rows(loop: Loop) -> dict[str, tuple[Term, ...]]:
    """Rows of e1 [m], e2 [m/s] and −Kx [Pa] in a loop in error coordinates; none for any other loop.

    −Kx is what β and the constants multiply in e2′, so that it is read off the field, not off the gains.
    """
    slip, rate, *_ = STATES
    if not {slip, rate} <= set(loop.states) <= set(STATES):
        return {}
    through = {_CONTROL, *loop.constants}
    pressure = tuple(
        Term(t.coefficient, tuple(p for p in t.parameters if p not in through), t.factors)
        for t in loop.field[rate]
        if through <= set(t.parameters)
    )
    return {SLIP_ERROR: _state(slip), SLIP_RATE_ERROR: _state(rate), PRESSURE_OFFSET: pressure}


def _state(name: str) -> tuple[Term, ...]:
    return (Term(Fraction(1), (), ((name, Fraction(1), "s"),)),)


def meaning(loop: Loop, row: tuple[Term, ...]) -> str | None:
    """Which of `rows` a row is, in numbers; None if it is another one."""
    states = tuple(loop.states)
    own = real_polynomial(row, states, loop.parameters)
    known = {name: real_polynomial(terms, states, loop.parameters) for name, terms in rows(loop).items()}
    return next((name for name, polynomial in known.items() if own == polynomial), None)


def require_true_names(loop: Loop, response: Response) -> None:
    """Refuse an output that bears the name of a slip error, a slip-rate error or a pressure, and is another row.

    Raises
    ------
    CertificateError
    """
    for name, row in response.outputs.items():
        known = (SLIP_ERROR, SLIP_RATE_ERROR, PRESSURE_OFFSET)
        require(
            name not in known or meaning(loop, row) == name, f"the output {name} is another row than its name says."
        )


@cache
def slip_degree() -> int | None:
    """Number of derivatives of the slip until the pressure appears, derived from the force balance."""
    return relative_degree(plant.x1, {plant.x1: plant.x2, plant.x2: plant.shifted_acceleration()}, plant.p)


def require_degree_of_slip(loop: Loop) -> None:
    """Refuse a loop whose control acts on another derivative of its first state than the pressure on that of the slip.

    Raises
    ------
    CertificateError
    """
    first, *_ = loop.states
    control = loop.symbols.get(_CONTROL, sp.Dummy())
    found = relative_degree(loop.symbols[first], sympy_field(loop), control)
    if found != slip_degree():
        raise CertificateError(
            f"{loop.law} acts on derivative {found} of its first state, the pressure on derivative {slip_degree()} of "
            "the slip: the certificate is about another plant than a fault"
        )
