"""A fault with rate-and-state friction about slow sliding along its task, linearised, and its poles."""

from cmath import sqrt
from fractions import Fraction
from typing import Any

import sympy as sp

from quakedesign.fault import Fault
from quakedesign.loop import SlidingModel
from quakedesign.rationals import fraction_of, rational, to_sympy
from quakedesign.symbolic.slow_sliding import sliding_errors, sliding_rate

_ONE, _NEAR = Fraction(1), Fraction(1, 10)


def sliding_model(fault: Fault) -> SlidingModel:
    """A fault about sliding along its task at the mean rate V, linearised; η and k with it, at the pressure 0.

    Raises
    ------
    UnsupportedError
        For friction without a state.
    """
    law = fault.friction.exact()
    errors = sliding_errors(law)
    rate = mean_rate(fault)
    at = {sliding_rate: to_sympy(rate)}
    direct, evolution = (_number(slope.subs(at)) for slope in errors.slopes)
    normal = rational(fault.effective_normal_stress)
    return SlidingModel(
        rate=rate,
        state_rate=_number(errors.decays[1].subs(at)),
        slope=_ONE,
        state_slope=_ONE,
        strength=normal * direct + rational(fault.damping) / (fault.squares * rational(fault.side) ** 2) * rate,
        weakening=normal * evolution,
        direct=direct,
        evolution=evolution,
        stiffness=rational(fault.shear_modulus) / rational(fault.side),
        coefficient=_number(law.steady_coefficient(to_sympy(rate))),
    )


def mean_rate(fault: Fault) -> Fraction:
    """V [m/s]: the target slip over the operation time."""
    return rational(fault.reference.target_slip) / rational(fault.reference.operation_time)


def near_path(model: SlidingModel) -> Fraction:
    """L²/D [s] of rock that hardly delays the pressure: a tenth of the time in which the state ages, D_c/V."""
    return _NEAR / model.state_rate


def growth_rate(model: SlidingModel) -> float:
    """Real part of the fastest eigenvalue [1/s] about steady sliding, without control."""
    return max(pole.real for pole in sliding_poles(model))


def sliding_poles(model: SlidingModel) -> tuple[complex, complex]:
    """Both eigenvalues [1/s] about steady sliding, without control.

    With x in D they are those of ρ((−κ, −β), (κ, β − 1)), κ = KD/S, β = weakening/S, S = strength.
    """
    speed, length = float(model.state_rate), model.rate / model.state_rate
    kappa, beta = (float(v / model.strength) for v in (model.stiffness * length, model.weakening))
    trace = beta - 1 - kappa
    root = sqrt(trace**2 - 4 * kappa)
    return speed * (trace + root) / 2, speed * (trace - root) / 2


def _number(expression: Any) -> Fraction:
    """Rational near a SymPy number; itself if it is rational."""
    value = expression if expression.is_Rational else sp.N(expression, 30)
    return fraction_of(value) if value.is_Rational else rational(str(value))
