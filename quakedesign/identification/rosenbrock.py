"""A linearly implicit step for stiff equations, as an expression that can be differentiated exactly."""

from collections.abc import Callable
from typing import Any

import casadi as ca

ORDER = 3
SOURCE = "RODAS3 of Sandu, Verwer, Blom, Spee, Carmichael and Potra (1997), Atmos. Environ. 31(20), 3459"
_DIAGONAL = 0.5


def step(field: Callable[[Any], Any], y: Any, length: Any) -> tuple[Any, Any]:
    """State after one L-stable step of order 3, and the estimate of its error (that of an embedded order 2).

    Parameters
    ----------
    field : callable
        dy/dt of y, both CasADi SX columns; time must not enter.
    y : casadi.SX
        State before.
    length : casadi.SX
        Of the step [s]; nothing changes when it is 0.

    Returns
    -------
    tuple of casadi.SX
    """
    rates = field(y)
    inverse = ca.inv(ca.SX.eye(y.numel()) - _DIAGONAL * length * ca.jacobian(rates, y))

    def stage(at: Any, memory: Any) -> Any:
        return _DIAGONAL * (inverse @ (length * at + memory))

    first = stage(rates, 0)
    second = stage(rates, 4 * first)
    third = stage(field(y + 2 * first), first - second)
    fourth = stage(field(y + 2 * first + third), first - second - 8 * third / 3)
    return y + 2 * first + third + fourth, fourth
