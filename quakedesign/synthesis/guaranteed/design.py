"""A law with a disturbance estimate for the loop as it runs, chosen by what can be guaranteed."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from math import floor, inf, log10

import numpy as np
from scipy.linalg import expm
from scipy.optimize import OptimizeResult, minimize

from quakedesign.certificates.guarantee import Bounds, Guarantee, Held, NoGuarantee, Task, guarantee
from quakedesign.errors import ParameterError
from quakedesign.loop import LinearLaw, Model, Prediction, disturbance_estimate
from quakedesign.synthesis.guaranteed.estimate import Estimate, estimated

OBJECTIVES = ("tracking", "peak")
_STARTS = ((0.6, 1.0, 0.1), (0.55, 0.9, 0.6), (0.3, 0.8, 0.4))  # k1·β0b·T², k2·β0b·T, a: where good laws were seen
_EVALUATIONS = 150
_FEW = 50  # evaluations near a law that has a guarantee at another time
_CREEPING = 0.1  # what the slip error over T_s counts beside the slip-rate error, so that the loop does not creep
_DIGITS = 4
MOST_DELAY = 7  # periods: law and loop then have 20 states, the most of a file
_FAILED = 1e6
_HOPELESS = 1.2  # small gain of a whole search after which `first_held` tries no other start


def first_held(
    task: Task,
    step: Fraction,
    *,
    delay: Fraction = Fraction(0),
    lag: Fraction = Fraction(0),
    near: np.ndarray | None = None,
) -> tuple[Guarantee | NoGuarantee, np.ndarray | None]:
    """The first law with a guarantee that a search finds, sooner than `design_held` does, and its numbers.

    The search is a short one near the numbers of another law, if there is one.
    """
    if delay > MOST_DELAY * step:
        return NoGuarantee(reason=f"the delay is longer than {MOST_DELAY} periods", small_gain=None), near
    law = _laws(task.model, step, delay)
    template = Held(law=law(np.array(_STARTS[0])), step=step, delay=delay, lag=lag)

    def cost(x: np.ndarray) -> float:
        found = estimated(task, replace(template, law=law(x))) if 0 < x[2] < 1 else None
        return _peak_cost(found, step)

    for start in _STARTS if near is None else (near,):
        reached, x = _search(cost, start, enough=_FAILED / 2, evaluations=_EVALUATIONS if near is None else _FEW)
        if reached < _FAILED / 2 or _HOPELESS * _FAILED < reached < 9 * _FAILED:
            break
    return guarantee(task, replace(template, law=law(x))), x


def design_held(
    task: Task,
    step: Fraction,
    *,
    objective: str = "tracking",
    delay: Fraction = Fraction(0),
    lag: Fraction = Fraction(0),
    room: float = 1.6,
) -> Guarantee | NoGuarantee:
    """Feedback with a disturbance estimate, its two gains and its weight chosen over certified bounds.

    ``peak``: the smallest certified slip-rate error. ``tracking``: the smallest slip error under a disturbance that
    drifts, among laws whose certified slip-rate error is at most `room` times the smallest.

    Parameters
    ----------
    task : Task
    step : Fraction
        T_s [s].
    objective : str
    delay, lag : Fraction
        [s].
    room : float
        What ``tracking`` may spend of the smallest certified slip-rate error [-].

    Raises
    ------
    ParameterError
        For another objective, or times that are negative or too long.
    """
    if objective not in OBJECTIVES:
        raise ParameterError(f"objective must be one of {', '.join(OBJECTIVES)}. Received {objective!r}.")
    if step <= 0 or not 0 <= delay <= MOST_DELAY * step or lag < 0:
        raise ParameterError(
            f"a design needs a positive step, a delay of 0 to {MOST_DELAY} steps and a lag of 0 or more. Received "
            f"{float(step):.4g} s, {float(delay):.4g} s, {float(lag):.4g} s. Shorten the delay."
        )
    law = _laws(task.model, step, delay)
    template = Held(law=law(np.array(_STARTS[0])), step=step, delay=delay, lag=lag)
    worst = replace(task, change=None)  # gains are chosen for the larger class: they answer slow disturbances as well

    def seen(x: np.ndarray) -> Estimate | None:
        return estimated(worst, replace(template, law=law(x))) if 0 < x[2] < 1 else None

    best = min((_search(lambda x: _peak_cost(seen(x), step), start) for start in _STARTS), key=lambda f: f[0])
    found = seen(best[1])
    if objective == "tracking" and found is not None and isinstance(found.bounds, Bounds):
        limit = room * float(found.bounds.slip_rate_error)
        starts = (best[1], _STARTS[1])
        best = min((_search(lambda x: _drift_cost(seen(x), limit), start) for start in starts), key=lambda f: f[0])
    return guarantee(task, replace(template, law=law(best[1])))


def _laws(model: Model, step: Fraction, delay: Fraction) -> Callable[[np.ndarray], LinearLaw]:
    """Law of three numbers without units; its gains and its model of the plant have four digits."""
    seconds, gain, prediction = float(step), float(model.gain), _prediction(model, step, delay)

    def law(x: np.ndarray) -> LinearLaw:
        gains = _short(float(x[0]) / gain / seconds**2), _short(float(x[1]) / gain / seconds)
        return disturbance_estimate(gains, _short(float(x[2])), prediction, _short(gain))

    return law


def _prediction(model: Model, step: Fraction, delay: Fraction) -> Prediction:
    """What the model says of the next sample, and of the time at which a pressure arrives."""
    flow = np.array([[0, 1, 0], [float(model.slip), -float(model.rate), 1], [0, 0, 0]])
    period, late = float(step), float(delay)

    def pushed(duration: float) -> np.ndarray:
        """Errors after a unit push for some time."""
        return np.array(expm(flow * duration))[:2, 2]

    whole, part = int(delay // step), float(delay % step)
    ages = whole + (1 if part else 0)
    pushes = [0.0] * (ages + 1)
    pushes[whole] = float(pushed(period - part)[1])
    if part:
        pushes[whole + 1] = float(pushed(period)[1]) - pushes[whole]
    ahead = [pushed(min(j * period, late)) - pushed((j - 1) * period) for j in range(1, ages + 1)]
    next_rate, arrival = np.array(expm(flow * period))[1], np.array(expm(flow * late))[:2, :2]
    return Prediction(
        of_slip=_short(float(next_rate[0])),
        of_rate=_short(float(next_rate[1])),
        of_pushes=tuple(_short(v) for v in pushes),
        ahead=tuple(tuple(_short(float(v)) for v in row) for row in arrival),
        ahead_of_pushes=tuple(tuple(_short(float(v)) for v in row) for row in ahead),
    )


def _search(
    cost: Callable[[np.ndarray], float],
    start: Sequence[float] | np.ndarray,
    *,
    enough: float = -inf,
    evaluations: int = _EVALUATIONS,
) -> tuple[float, np.ndarray]:
    """Smallest cost found and where; the search ends below `enough`."""

    def stop(intermediate_result: OptimizeResult) -> None:
        if intermediate_result.fun < enough:
            raise StopIteration

    options = {"maxfev": evaluations, "xatol": 2e-3, "fatol": 1e-3}
    found = minimize(cost, np.array(start), method="Nelder-Mead", options=options, callback=stop)
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
