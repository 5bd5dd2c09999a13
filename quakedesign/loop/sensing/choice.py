"""Accuracy of the differentiator, and joint choice of its bound λ_d and the sampling period.

The error constants are measured with adverse signals, not proved. The joint condition requires that λ_d [m/s²] exceeds
the slip acceleration, including the effect of the estimation errors through the control law.
"""

import math
from dataclasses import asdict, replace
from functools import lru_cache

import casadi as ca
import numpy as np

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.fault.model import require_nonnegative
from quakedesign.files import Json
from quakedesign.laws import Controller
from quakedesign.laws.sampled_controller import integral_symbols, law_expressions, r, r_acceleration, r_rate
from quakedesign.loop.sensing.differentiator import Differentiator
from quakedesign.symbolic import plant
from quakedesign.symbolic.casadi_printer import to_numpy

# ----------------------------------------------------------------------
# Errors of the estimates of a differentiator, measured with adverse signals.
#
# Proofs for the implicit differentiator and a fault initially at rest are in
# `quakedesign.loop.sensing.differentiator`.

SAMPLES = 1000
SETTLED = 400
STRETCH = 10.0  # δ/T in the runs with dominating noise
HALF_PERIODS = (1, 2, 3, 5, 8, 13, 30, 100, SAMPLES)


def error_scale(differentiator: Differentiator, noise: float) -> float:
    """δ = max(T, (ε/λ_d)^(1/(n_d+1))) [s], which sets the accuracy, for measurement errors of at most ε [m]."""
    return float(max(differentiator.step, (noise / differentiator.bound) ** (1 / (differentiator.order + 1))))


def worst_errors(differentiator: Differentiator, noise: float = 0.0) -> tuple[float, ...]:
    """Errors of the estimates of slip [m], slip rate [m/s] … of the settled differentiator, c_i·λ_d·δ^(n_d+1−i).

    The constants c_i are the largest normalised errors over a set of adverse signals with |x1^(n_d+1)| = λ_d, and so
    are lower bounds of the worst case.

    Parameters
    ----------
    noise : float
        ε, bound of the error of a reading [m].

    Returns
    -------
    tuple of float
        One entry for each derivative 0 … n_d.
    """
    unit = replace(differentiator, bound=1.0, step=1.0)
    factors = constants(unit, noisy=noise > 0)
    scale, order = error_scale(differentiator, noise), differentiator.order
    return tuple(c * differentiator.bound * scale ** (order + 1 - i) for i, c in enumerate(factors))


@lru_cache(maxsize=64)
def constants(unit: Differentiator, noisy: bool) -> tuple[float, ...]:
    """c_0 … c_nd for λ_d = T = 1: largest errors without noise and, if noisy, with dominating noise."""
    ratios = [
        _errors(unit, scale) / (scale ** np.arange(unit.order + 1, 0, -1.0))
        for scale in ((1.0, STRETCH) if noisy else (1.0,))
    ]
    return tuple(float(max(column)) for column in zip(*ratios, strict=True))


def _errors(unit: Differentiator, scale: float) -> "np.ndarray":
    """Largest errors after settling; a scale δ/T above 1 sets the noise."""
    random = np.random.default_rng(0)
    noise = scale ** (unit.order + 1) if scale > 1 else 0.0
    acceleration, sign = (part.ravel() for part in np.meshgrid(*[np.arange(_kinds(unit))] * 2))
    columns = len(acceleration) if noise else _kinds(unit)
    step = _function(unit).map(columns)
    memory = np.zeros((unit.size, columns))
    true, errors, worst = (np.zeros((unit.order + 1, columns)) for _ in range(3))
    for sample in range(SAMPLES):
        signs = _signs(sample, errors, random)
        highest = signs[acceleration[:columns], np.arange(columns)]
        reading_error = noise * signs[sign[:columns], np.arange(columns)]
        after, estimates = step(memory, true[:1] + reading_error)
        memory, errors = after.full(), estimates.full() - true
        if sample >= SETTLED:
            worst = np.maximum(worst, abs(errors))
        true = _moved(true, highest)
    return np.asarray(worst.max(axis=1))


def _kinds(unit: Differentiator) -> int:
    return len(HALF_PERIODS) + 2 * (unit.order + 1) + 1


def _signs(sample: int, errors: "np.ndarray", random: np.random.Generator) -> "np.ndarray":
    """One row per adverse signal: square waves, signs of every error and their opposites, random; a column per run."""
    columns = errors.shape[1]
    waves = [np.full(columns, 1.0 if sample // half % 2 else -1.0) for half in HALF_PERIODS]
    chasing = [way * np.where(error > 0, 1.0, -1.0) for error in errors for way in (1, -1)]
    return np.array([*waves, *chasing, random.choice([-1.0, 1.0], columns)])


def _moved(derivatives: "np.ndarray", highest: "np.ndarray") -> "np.ndarray":
    """Derivatives one time unit later, with a constant next derivative."""
    whole = [*derivatives, highest]
    after = []
    for i in range(len(derivatives)):
        total = np.zeros_like(highest)
        for degree in range(len(whole) - 1 - i, 0, -1):
            total = (total + whole[i + degree]) / degree
        after.append(whole[i] + total)
    return np.array(after)


def _function(unit: Differentiator) -> ca.Function:
    """CasADi Function (memory, slip) → memory, estimates."""
    memory, slip = ca.SX.sym("memory", unit.size), ca.SX.sym("slip")
    estimates, after = unit.estimate([*map(ca.SX, unit.numbers)], ca.vertsplit(memory), slip)
    return ca.Function("differentiator", [memory, slip], [ca.vertcat(*after), ca.vertcat(*estimates)])


# ----------------------------------------------------------------------
# Joint condition on λ_d, the sampling period and a law.
#
# A differentiator of order n_d = 1 needs |x1''| < λ_d, while the errors ε1, ε2 of its estimates, which grow with λ_d,
# act through the law on x1'' itself. With A the largest |x1''| [m/s²] of the loop with exact states and B the largest
# input gain [m²/kg],
#
#     A + B·max |p(e1 + ε1, e2 + ε2) − p(e1, e2)| < λ_d
#
# is the self-consistent condition on λ_d. For signed powers with exponents up to 1 the difference is largest across the
# origin, at e = −ε/2. For a linear law the left-hand side grows with λ_d as ε does, so that the sampling period
# decides; for a sliding mode it grows more slowly, so that a λ_d exists for every sampling period. For n_d ≥ 2 a bound
# on x1''' is needed, and with zero-order hold none exists: x1'' jumps at every sample. The implicit discretisation
# needs no such bound for a fault initially at rest, and its estimates are then proved for a linear law
# (`quakedesign.loop.sensing.differentiator`).
#
# The condition is a premise of the differentiator. It does not prove that the loop with estimates is stable, and loops
# may work without it. It neglects the stages before the differentiator; a mean of N readings lags by (N − 1)T/2 more.

LARGEST_BOUND = 1e12
_HALVINGS = 60


@checked_dataclass(frozen=True, kw_only=True)
class JointCondition:
    """Premise of a differentiator in a loop.

    Attributes
    ----------
    name : str
    required : float
        Value that λ_d, the `certified` value, must exceed [m/s² for n_d = 1]; infinite for n_d ≥ 2.
    certified : float
        λ_d [m/s^(n_d+1)].
    ratio : float
        required/certified [-]; the premise is violated if it is 1 or more.
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

    def to_dict(self) -> Json:
        """JSON-able facts; null means infinite."""
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
        ε, bound of the error of a reading [m]; for normal noise about four standard deviations.

    Raises
    ------
    ParameterError
        For a negative or infinite acceleration or noise.
    """
    require_nonnegative(acceleration=acceleration, noise=noise)
    slip_error, rate_error, *_ = worst_errors(differentiator, noise)
    required = math.inf
    if differentiator.order == 1:
        required = acceleration + fault.authority_range[1] * pressure_difference(controller, slip_error, rate_error)
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
    """Smallest λ_d [m/s²] for which the condition holds; the differentiator's own λ_d is ignored.

    None if no λ_d up to 1e12 satisfies it: the sampling period is too long for the law. For the parameters see
    `joint_condition`.

    Raises
    ------
    ParameterError
        For n_d ≥ 2.
    """
    if differentiator.order != 1:
        raise ParameterError(
            f"order must be 1 for the smallest bound of a differentiator. Received {differentiator.order}. Use order=1."
        )

    def stable(exponent: float) -> bool:
        tried = replace(differentiator, bound=10.0**exponent)
        return joint_condition(fault, controller, tried, acceleration=acceleration, noise=noise).holds

    high = math.log10(LARGEST_BOUND)
    if not stable(high):
        return None
    low = -high
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if stable(middle) else (middle, high)
    return float(10.0**high)


def pressure_difference(controller: Controller, slip_error: float, rate_error: float) -> float:
    """Largest pressure difference [Pa] of a law across the origin, between ±(ε1, ε2)/2 and between ±(ε1, −ε2)/2."""
    return max(
        abs(_pressure(controller, a / 2, b / 2) - _pressure(controller, -a / 2, -b / 2))
        for a, b in ((slip_error, rate_error), (slip_error, -rate_error))
    )


def _pressure(controller: Controller, slip: float, rate: float) -> float:
    rest = dict.fromkeys((*integral_symbols(controller), r, r_rate, r_acceleration), 0.0)
    return float(to_numpy([law_expressions(controller)[0]], {plant.x1: slip, plant.x2: rate, **rest})[0])
