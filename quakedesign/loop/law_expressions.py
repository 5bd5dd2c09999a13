"""A law as expressions in the states of the fault and in the reference."""

import sympy as sp

from quakedesign.controllers import Controller, Signals
from quakedesign.symbolic import plant

r, r_rate, r_acceleration = sp.symbols("r r_rate r_acceleration", real=True)


def integral_symbols(controller: Controller | None) -> tuple[sp.Symbol, ...]:
    """Symbols ξ1, ξ2 … of the law's own states."""
    count = len(controller.integral_units) if controller else 0
    return tuple(sp.Symbol(f"xi_{i + 1}", real=True) for i in range(count))


def law_expressions(controller: Controller) -> tuple[sp.Expr, tuple[sp.Expr, ...]]:
    """Pressure [Pa] and ξ' of a law, in x1, x2, r, r', r'' and ξ."""
    signals = Signals(
        slip=plant.x1,
        slip_rate=plant.x2,
        slip_error=plant.x1 - r,
        slip_rate_error=plant.x2 - r_rate,
        integrals=integral_symbols(controller),
        reference_acceleration=r_acceleration,
    )
    return controller.pressure(signals), controller.integral_rates(signals)


def cut_off(
    asked: sp.Expr,
    states: tuple[sp.Expr, ...],
    slip: sp.Expr,
    reference: sp.Expr,
    width: sp.Expr,
    per_slip: sp.Expr,
    resolution: sp.Expr,
    *,
    within: tuple[sp.Expr, ...] | None = None,
) -> tuple[sp.Expr, ...]:
    """The pressure [Pa] that is applied at a sample in place of what is asked for, and `RestLimit.STATES` after it.

    Parameters
    ----------
    asked : Expr
        [Pa].
    states : tuple of Expr
        `RestLimit.STATES` before it.
    slip, reference : Expr
        [m].
    width, per_slip, resolution : Expr
        [Pa], [Pa/m], [m].
    within : tuple of Expr, optional
        Least and largest pressure [Pa], and the slip between two samples [m] up to which they are not passed.
    """
    highest, last = states
    moved = per_slip * reference
    short = sp.Max(highest - moved - width - asked, 0)
    applied = asked + sp.Piecewise((short, slip <= last + resolution), (0, True))
    if within is not None:
        least, largest, fastest = within
        inside = sp.Max(least, sp.Min(largest, applied)) - applied
        applied += sp.Piecewise((inside, slip <= last + fastest), (0, True))
    return applied, highest + sp.Max(applied + moved - highest, 0), slip
