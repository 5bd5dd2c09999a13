"""Where a fault that starts to slip comes to rest."""

from collections.abc import Callable
from math import nan
from typing import Any

from quakedesign.fault.friction import FrictionLaw

_SCAN = 4096
_DIGITS = 40  # the slip of a fault that is only just unstable is a small difference


def rest_slip(friction: FrictionLaw, load: float, stiffness: float) -> float:
    """Smallest positive slip [m] where the excess of load over strength turns from driving to resisting.

    The excess is (μ(0) − μ(x))σ'_n A − kx at zero pressure (statics of eq. shift), for a load σ'_n A [N] and a
    stiffness k [N/m]. All roots lie below
    (μ_max − μ_min)σ'_n A/k. A fault whose origin is stable stays where it is; friction with a state has no strength
    of its own at rest, and nan is returned.
    """
    if friction.state_names:
        return nan
    import mpmath
    import sympy as sp

    x = sp.Symbol("x", nonnegative=True)
    law = friction.exact().coefficient
    excess = law(sp.Integer(0), 0) - law(x, 0) - stiffness / load * x
    drive, drive_in_floats = (sp.lambdify(x, excess, module) for module in ("mpmath", "math"))
    low, high = friction.bounds
    furthest = (high - low) * load / stiffness * 1.0001
    if furthest == 0:
        return 0.0
    try:
        ends = _turn(drive_in_floats, furthest)
    except (NameError, ArithmeticError, ValueError):  # a function that floats do not have, or beyond their range
        ends = _turn(drive, furthest)
    if ends is None:
        return 0.0
    with mpmath.workdps(_DIGITS):
        return float(mpmath.findroot(drive, ends, solver="anderson", tol=1e-60, maxsteps=100, verify=False))


def _turn(drive: Callable[[float], Any], furthest: float) -> tuple[float, float] | None:
    """Slips [m] between which an excess turns from driving to resisting; None where it does not drive at the start."""
    grid = [furthest * i / _SCAN for i in range(_SCAN + 1)]
    if drive(grid[1] / _SCAN) <= 0:
        return None
    after = next(i for i, slip in enumerate(grid) if i and drive(slip) <= 0)
    return grid[after - 1] if after > 1 else grid[1] / _SCAN, grid[after]
