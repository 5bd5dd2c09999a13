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
