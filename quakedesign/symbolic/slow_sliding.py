"""Errors about slow sliding of a fault with rate-and-state friction: slip, and the logarithms of rate and state.

About sliding at V without inertia, with v = Ve^y, θ = θ_ss(V)e^z, the slip error x, the pressure error q = p − p* and a
shear stress s on the fault, all per unit of area. What is derived here from the law is the change of friction, so that

    N(μ(y, z) − μ*) + HV(e^y − 1) = −Kx + μ*q + s,    x′ = V(e^y − 1),    z′ = θ′/θ,

N = σ′ − p, K = k/A, H = η/A. The slip rate is algebraic: it follows from x, z, q and s at the same instant, so that the
pressure reaches y at once (relative degree 0) and x by one integration.
"""

from dataclasses import dataclass
from functools import cached_property

import sympy as sp

from quakedesign.errors import UnsupportedError
from quakedesign.fault import FrictionLaw

log_rate, log_state = sp.symbols("y z", real=True)
sliding_rate = sp.Symbol("V", positive=True)


@dataclass(frozen=True, kw_only=True)
class SlidingErrors:
    """Friction and state about sliding at `sliding_rate`, in `log_rate` y and `log_state` z.

    Attributes
    ----------
    friction_change : Expr
        μ(y, z) − μ* [-].
    state_change : Expr
        z′ [1/s].
    """

    friction_change: sp.Expr
    state_change: sp.Expr

    @cached_property
    def slopes(self) -> tuple[sp.Expr, sp.Expr]:
        """∂μ/∂y and ∂μ/∂z [-] in steady sliding: a and b of the logarithmic laws."""
        return self._at_rest(self.friction_change, log_rate), self._at_rest(self.friction_change, log_state)

    @cached_property
    def decays(self) -> tuple[sp.Expr, sp.Expr]:
        """−∂z′/∂y and −∂z′/∂z [1/s] in steady sliding."""
        return -self._at_rest(self.state_change, log_rate), -self._at_rest(self.state_change, log_state)

    @staticmethod
    def _at_rest(expression: sp.Expr, variable: sp.Symbol) -> sp.Expr:
        return sp.simplify(expression.diff(variable).subs({log_rate: 0, log_state: 0}))


def sliding_errors(law: FrictionLaw) -> SlidingErrors:
    """Error dynamics of a law with one state.

    Parameters
    ----------
    law : FrictionLaw
        `symbolic()` or `exact()`.

    Raises
    ------
    UnsupportedError
        For a law without a state or with several.
    """
    if len(law.state_names) != 1:
        raise UnsupportedError(f"slow sliding needs friction with one state. Received {law.name}. Use error_dynamics.")
    steady = law.steady_state(sliding_rate)[0]
    rate, state = sliding_rate * sp.exp(log_rate), steady * sp.exp(log_state)
    change = law.coefficient(0, rate, state) - law.steady_coefficient(sliding_rate)
    moved = law.state_rates(0, rate, state)[0] / state
    return SlidingErrors(
        friction_change=_tidy(change),
        state_change=sp.simplify(sp.expand_log(sp.simplify(moved), force=True)),
    )


def _tidy(change: sp.Expr) -> sp.Expr:
    """Differences of logarithms in one another; anything else as it is."""
    if change.has(sp.asinh):
        return change
    return sp.simplify(sp.expand(sp.expand_log(change, force=True)))
