"""What a field is about, whatever a file calls its states: only what is derived counts."""

from functools import cache

import sympy as sp

from quakedesign.certificates.claim import Loop
from quakedesign.certificates.loop_expressions import sympy_field
from quakedesign.errors import CertificateError
from quakedesign.symbolic import plant
from quakedesign.symbolic.relative_degree import relative_degree

_CONTROL = "beta"


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
    degree = relative_degree(loop.symbols[first], sympy_field(loop), control)
    if degree != slip_degree():
        raise CertificateError(
            f"{loop.law} acts on derivative {degree} of its first state, the pressure on derivative {slip_degree()} of "
            "the slip: the certificate is about another plant than a fault"
        )
