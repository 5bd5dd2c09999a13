"""Whether λ_d and the sampling period go together with a law.

A differentiator of order n_d = 1 needs |x1''| < λ_d, while the errors ε1, ε2 of its estimates, which grow with λ_d, act
through the law on x1'' itself. With A the largest |x1''| of the loop with exact states and B the largest input gain,

    A + B·max |p(e1 + ε1, e2 + ε2) − p(e1, e2)| < λ_d

is self-consistent. For signed powers up to 1 the difference is largest astride the origin, at e = −ε/2. The left-hand
side grows with λ_d as ε does for a linear law, so that the sampling period decides, and more slowly for a sliding mode,
so that a λ_d exists for every sampling period. For n_d ≥ 2 a bound on x1''' is needed, and there is none where the
pressure is held: x1'' jumps at every sample. The implicit discretisation needs none from rest, and what it then tells
a linear law is proved (`quakedesign.loop.sensing.differences`).

The condition is what the differentiator asks for: no proof that the loop with estimates is stable, and loops may do
without it. It leaves out what lies between slip and differentiator; a mean of N readings lags by (N − 1)T/2 more.
"""

import math
from dataclasses import asdict, dataclass, replace
from typing import Any

from quakedesign.controllers import Controller
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.fault.checks import require_nonnegative
from quakedesign.loop.law_expressions import integral_symbols, law_expressions, r, r_acceleration, r_rate
from quakedesign.loop.sensing.accuracy import worst_errors
from quakedesign.loop.sensing.differentiator import Differentiator
from quakedesign.symbolic import plant
from quakedesign.symbolic.casadi_printer import to_numpy

LARGEST_BOUND = 1e12
_HALVINGS = 60


@dataclass(frozen=True, kw_only=True)
class JointCondition:
    """Premise of a differentiator in a loop.

    Attributes
    ----------
    name : str
    required : float
        What λ_d must exceed [m/s²], λ_d being what is `certified`; infinite for n_d ≥ 2 [m/s^(n_d+1)].
    certified : float
        λ_d.
    ratio : float
        required/certified, violated from 1 on.
    holds : bool
    slip_error, rate_error : float
        Errors of the estimates [m], [m/s].
    """

    name: str = "differentiator"
    required: float
    certified: float
    ratio: float
    holds: bool
    slip_error: float
    rate_error: float

    def to_dict(self) -> dict[str, Any]:
        """JSON-able facts; null stands for infinite."""
        return {k: None if v == math.inf else v for k, v in asdict(self).items()}


def joint_condition(
    fault: Fault, controller: Controller, differentiator: Differentiator, *, acceleration: float, noise: float = 0.0
) -> JointCondition:
    """Premise of a differentiator in the loop of a fault and a law.

    Parameters
    ----------
    fault : Fault
    controller : Controller
    differentiator : Differentiator
    acceleration : float
        A, largest |x1''| of the loop with exact states [m/s²].
    noise : float
        ε, bound of the error of a reading [m]; for normal noise some four standard deviations.

    Returns
    -------
    JointCondition

    Raises
    ------
    ParameterError
        For a negative or infinite acceleration or noise.
    """
    require_nonnegative(acceleration=acceleration, noise=noise)
    slip_error, rate_error, *_ = worst_errors(differentiator, noise)
    required = math.inf
    if differentiator.order == 1:
        required = acceleration + fault.authority_range[1] * pressure_swing(controller, slip_error, rate_error)
    ratio = required / differentiator.bound
    return JointCondition(
        required=required,
        certified=differentiator.bound,
        ratio=ratio,
        holds=ratio < 1,
        slip_error=slip_error,
        rate_error=rate_error,
    )


def smallest_bound(
    fault: Fault, controller: Controller, differentiator: Differentiator, *, acceleration: float, noise: float = 0.0
) -> float | None:
    """Smallest λ_d [m/s²] with which the condition holds for a differentiator, whose own λ_d is ignored.

    None where there is none up to 1e12: the sampling period is too long for the law. For the parameters see
    `joint_condition`.

    Raises
    ------
    ParameterError
        For n_d ≥ 2.
    """
    if differentiator.order != 1:
        raise ParameterError(f"a bound exists for order 1 alone. Received {differentiator.order}. Take order=1.")

    def holds(exponent: float) -> bool:
        tried = replace(differentiator, bound=10.0**exponent)
        return joint_condition(fault, controller, tried, acceleration=acceleration, noise=noise).holds

    high = math.log10(LARGEST_BOUND)
    if not holds(high):
        return None
    low = -high
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return float(10.0**high)


def pressure_swing(controller: Controller, slip_error: float, rate_error: float) -> float:
    """Largest difference [Pa] of a law's pressures astride its origin, at ±(ε1, ε2)/2 and ±(ε1, −ε2)/2."""
    return max(
        abs(_pressure(controller, a / 2, b / 2) - _pressure(controller, -a / 2, -b / 2))
        for a, b in ((slip_error, rate_error), (slip_error, -rate_error))
    )


def _pressure(controller: Controller, slip: float, rate: float) -> float:
    rest = dict.fromkeys((*integral_symbols(controller), r, r_rate, r_acceleration), 0.0)
    return float(to_numpy([law_expressions(controller)[0]], {plant.x1: slip, plant.x2: rate, **rest})[0])
