"""A law with a disturbance estimate for the loop as it runs, chosen by what can be guaranteed."""

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from math import floor, log10

import numpy as np
from scipy.linalg import expm
from scipy.optimize import minimize

from quakedesign.certificates.guarantee import Bounds, Guarantee, Held, NoGuarantee, Task, guarantee
from quakedesign.errors import ParameterError
from quakedesign.loop import LinearLaw, Model, disturbance_estimate
from quakedesign.loop.laws import Prediction
from quakedesign.synthesis.guaranteed.estimate import Estimate, estimated

OBJECTIVES = ("tracking", "peak")
_STARTS = ((0.6, 1.0, 0.1), (0.55, 0.9, 0.6), (0.3, 0.8, 0.4))  # k1·β0b·T², k2·β0b·T, a: where good laws were seen
_EVALUATIONS = 150
_CREEPING = 0.1  # what the slip error over T_s counts beside the slip-rate error, so that the loop does not creep
_ROOM = 1.6  # share of the smallest peak that `tracking` may spend
_DIGITS = 4
_FAILED = 1e6


def design_held(
    task: Task,
    step: Fraction,
    *,
    objective: str = "tracking",
    delay: Fraction = Fraction(0),
    lag: Fraction = Fraction(0),
) -> Guarantee | NoGuarantee:
    """Feedback with a disturbance estimate, its two gains and its weight chosen over certified bounds.

    ``peak``: the smallest certified slip-rate error. ``tracking``: the smallest slip error under a disturbance that
    drifts, among laws whose certified slip-rate error is at most 1.6 times the smallest.

    Parameters
    ----------
    task : Task
    step : Fraction
        T_s [s].
    objective : str
    delay, lag : Fraction
        [s].

    Raises
    ------
    ParameterError
        For another objective.
    """
    if objective not in OBJECTIVES:
        raise ParameterError(f"objective must be one of {', '.join(OBJECTIVES)}. Received {objective!r}.")
    template = Held(law=_law(task, step, np.array(_STARTS[0])), step=step, delay=delay, lag=lag)
    worst = replace(task, change=None)  # gains are chosen for the larger class: they answer slow disturbances as well

    def seen(x: np.ndarray) -> Estimate | None:
        return estimated(worst, replace(template, law=_law(task, step, x)).loop(worst)) if 0 < x[2] < 1 else None

    best = min((_search(lambda x: _peak_cost(seen(x), step), start) for start in _STARTS), key=lambda f: f[0])
    found = seen(best[1])
    if objective == "tracking" and found is not None and isinstance(found.bounds, Bounds):
        limit = _ROOM * float(found.bounds.slip_rate_error)
        starts = (best[1], _STARTS[1])
        best = min((_search(lambda x: _drift_cost(seen(x), limit), start) for start in starts), key=lambda f: f[0])
    return guarantee(task, replace(template, law=_law(task, step, best[1])))


def _law(task: Task, step: Fraction, x: np.ndarray) -> LinearLaw:
    """Law of three numbers without units; its gains and its model of the plant have four digits."""
    model, seconds = task.model, float(step)
    gain = float(model.gain)
    return disturbance_estimate(
        (_short(float(x[0]) / gain / seconds**2), _short(float(x[1]) / gain / seconds)),
        _short(float(x[2])),
        _prediction(model, seconds),
        _short(gain),
    )


def _prediction(model: Model, seconds: float) -> Prediction:
    flow = np.array([[0, 1, 0], [float(model.slip), -float(model.rate), 1], [0, 0, 0]])
    of_slip, of_rate, of_push = (float(v) for v in expm(flow * seconds)[1])
    return Prediction(of_slip=_short(of_slip), of_rate=_short(of_rate), of_push=_short(of_push))


def _search(cost: Callable[[np.ndarray], float], start) -> tuple[float, np.ndarray]:
    options = {"maxfev": _EVALUATIONS, "xatol": 2e-3, "fatol": 1e-3}
    found = minimize(cost, np.array(start), method="Nelder-Mead", options=options)
    return float(found.fun), found.x


def _peak_cost(found: Estimate | None, step: Fraction) -> float:
    """Decibels of the slip-rate error; where there is no bound, how far from one."""
    if found is None:
        return 10 * _FAILED
    if isinstance(found.bounds, NoGuarantee):
        return _FAILED * min(float(found.bounds.small_gain or 9), 9.0)
    return 10 * log10(float(found.bounds.slip_rate_error) + _CREEPING * float(found.bounds.slip_error / step))


def _drift_cost(found: Estimate | None, limit: float) -> float:
    if found is None or isinstance(found.bounds, NoGuarantee):
        return 10 * _FAILED
    over = max(0.0, float(found.bounds.slip_rate_error) / limit - 1)
    return 10 * log10(found.drift_gain) + 1000 * over


def _short(value: float, digits: int = _DIGITS) -> Fraction:
    """Rational with few decimal digits near a float."""
    if not value:
        return Fraction(0)
    unit = Fraction(10) ** (floor(log10(abs(value))) + 1 - digits)
    return round(Fraction(value) / unit) * unit
