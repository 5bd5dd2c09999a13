"""Laws of a few numbers without units for one model, T_s and delay, among which searches choose."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from math import log10
from typing import Any

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from quakedesign.certificates.guarantee import Task
from quakedesign.certificates.guarantee.held import Around
from quakedesign.errors import ParameterError
from quakedesign.loop import (
    SHORTEST,
    ErrorPrediction,
    LinearLaw,
    Prediction,
    disturbance_estimate,
    estimate_through_path,
    observer_through_path,
    slip_observer,
)
from quakedesign.loop.sensing.differences import ORDER, names_before, told_by_differences
from quakedesign.rationals import shortly
from quakedesign.synthesis.guaranteed.path_design import BEHIND_LAG, THROUGH_ROCK, PathFeedback, path_modes
from quakedesign.synthesis.guaranteed.rounding import rounded, short

MEASURED = ("slip-and-rate", "slip", "differentiator")
_STARTS = ((0.6, 1.0, 0.1), (0.55, 0.9, 0.6), (0.3, 0.8, 0.4))  # k1·β0b·T², k2·β0b·T, a: where good laws were seen
_NOT_BY_DIFFERENCES = ("diffusion", "lag", "initial_slip", "initial_slip_rate", "jitter", "averaging")
_GENTLE = ((0.15, 0.6, 0.1), (0.1, 0.4, 0.3))  # the same where the slip rate is told late
_OBSERVERS = ((0.5, 0.9, -0.4, -4.0), (0.3, 0.8, -0.4, -2.0))  # the same gains, and decades above what noise allows
_DECADES = 4.0  # of process noise over that of the measurement, at most, at the start
_FEWEST_MODES = 2  # of a layer, of a law that knows its path
_WIDEST = 12.0  # decades, or exponents of weights, at which Riccati equations are still solved well
_FAINT = 1e-12  # process noise of everything, so that the filter forgets its start


@dataclass(frozen=True, slots=True)
class Family:
    """Laws of numbers x, where to begin, which x make one, and what ``tracking`` may spend of the smallest peak.

    The slip error counts over `period` [s] beside the slip-rate error, so that a loop does not creep.
    """

    law: Callable[[np.ndarray], LinearLaw]
    starts: tuple[tuple[float, ...], ...]
    admits: Callable[[np.ndarray], bool]
    room: float
    period: Fraction


def measured_by(law: LinearLaw) -> str:
    """Which of `MEASURED` a law is for."""
    return MEASURED[2] if law.states[-ORDER:] == names_before() else MEASURED[law.of_slip_alone]


def require_surroundings(around: Around) -> None:
    """Refuse rock and noise below zero.

    Raises
    ------
    ParameterError
    """
    told: dict[str, Any] = {**around}
    for name, unit in (("diffusion", "s"), ("slip_noise", "m"), ("rate_noise", "m/s")):
        value = told.get(name, Fraction(0))
        if value < 0:
            what = name.replace("_", " ")
            raise ParameterError(f"{what} must be 0 or more. Received {shortly(value)} {unit}. Leave out the sign.")


def why_no_law(step: Fraction, measured: str, around: Around) -> str:
    """Why there are no laws for a loop; empty if there are."""
    if around.get("longest_step") and measured != MEASURED[0]:
        return "samples that follow no clock are designed for with slip and slip rate measured"
    if measured == MEASURED[2] and any(around.get(name) for name in _NOT_BY_DIFFERENCES):
        return "what a differentiator tells is known from rest, at the instants of a clock, without a lag or rock"
    if not around.get("diffusion"):
        return ""
    if SHORTEST * around["diffusion"] < step:
        return f"a layer of L^2/D = {float(around['diffusion']):.4g} s is faster than T_s/{SHORTEST}; leave it out"
    known = path_modes(step, around, observed=measured == "slip") >= _FEWEST_MODES
    return "" if known else "a law that knows delay and layer has too many states"


def family_of(task: Task, step: Fraction, measured: str, around: Around) -> Family:
    """Feedback with an estimate of the disturbance, from slip and slip rate, from the slip alone or a differentiator.

    Through a lag or a layer it is a feedback of the pressures on their way as well, which the law simulates.

    Parameters
    ----------
    task : Task
    step : Fraction
        T_s [s].
    measured : str
        One of `MEASURED`.
    around : Around
        Near the bound of whose noise of the slip an observer's search begins; `why_no_law` must have no reason.
    """
    if measured == MEASURED[2]:
        told = family_of(task, step, MEASURED[0], around)
        return replace(told, law=lambda x: told_by_differences(told.law(x), step), starts=(*_GENTLE, *told.starts))
    delay = around.get("delay", Fraction(0))
    observed, noise = measured == "slip", around.get("slip_noise", Fraction(0))
    if around.get("diffusion") or (around.get("lag") and path_modes(step, around, observed=observed) >= 0):
        return (_observers_through_path if observed else _through_path)(task, step, around)
    if observed:
        return _observers(task, step, delay, noise)
    scale, prediction = _Scale.of(task, step), _ahead(task, step, delay)
    expected = Prediction(
        of_slip=prediction.of_errors[1][0],
        of_rate=prediction.of_errors[1][1],
        of_pushes=tuple(v[1] for v in prediction.of_pushes),
        ahead=prediction.ahead,
        ahead_of_pushes=prediction.ahead_of_pushes,
    )

    def law(x: np.ndarray) -> LinearLaw:
        return disturbance_estimate(scale.gains(x), short(float(x[2])), expected, scale.gain)

    return Family(law, _STARTS, lambda x: bool(0 < x[2] < 1), room=1.6, period=step)


def _through_path(task: Task, step: Fraction, around: Around) -> Family:
    feedback = PathFeedback.of(task.model, step, around)

    def law(x: np.ndarray) -> LinearLaw:
        slip, pressure, weight = map(float, x)
        return estimate_through_path(feedback.gains(slip, pressure), short(weight), feedback.model, feedback.gain)

    def admits(x: np.ndarray) -> bool:
        return bool(0 < x[2] < 1 and np.abs(x[:2]).max() < _WIDEST)

    return Family(law, _path_starts(around), admits, room=1.6, period=step + around.get("diffusion", 0))


def _observers_through_path(task: Task, step: Fraction, around: Around) -> Family:
    feedback, kalman = PathFeedback.of(task.model, step, around, observed=True), _Kalman.of(task, step)
    decades = kalman.decades(task, around.get("slip_noise", Fraction(0)))

    def law(x: np.ndarray) -> LinearLaw:
        gains, corrections = feedback.gains(float(x[0]), float(x[1])), kalman.corrections(float(x[2]), float(x[3]))
        return observer_through_path(gains, corrections, feedback.model, feedback.gain)

    noisy = [(decades + acceleration, decades + level) for *_, acceleration, level in _OBSERVERS]
    starts = tuple((*path[:2], *above) for path, above in zip(_path_starts(around), noisy, strict=False))
    return Family(law, starts, _solvable, room=1.4, period=step + around.get("diffusion", 0))


def _path_starts(around: Around) -> tuple[tuple[float, float, float], ...]:
    return THROUGH_ROCK if around.get("diffusion") else BEHIND_LAG


def _solvable(x: np.ndarray) -> bool:
    return bool(np.abs(x).max() < _WIDEST)


def _observers(task: Task, step: Fraction, delay: Fraction, noise: Fraction) -> Family:
    """Steady-state Kalman observers: two gains, decades of the variances of accelerations and of the level's steps."""
    scale, prediction, kalman = _Scale.of(task, step), _ahead(task, step, delay), _Kalman.of(task, step)

    def law(x: np.ndarray) -> LinearLaw:
        return slip_observer(scale.gains(x), kalman.corrections(float(x[2]), float(x[3])), prediction, scale.gain)

    decades = kalman.decades(task, noise)
    starts = tuple((k1, k2, decades + a, decades + b) for k1, k2, a, b in _OBSERVERS)
    return Family(law, starts, lambda x: _solvable(x[2:]), room=1.4, period=step)


@dataclass(frozen=True, slots=True)
class _Kalman:
    """Filters of slip error, slip-rate error and a level of all accelerations, from the slip: of one T_s [s]."""

    follows: np.ndarray
    units: np.ndarray
    step: float

    @classmethod
    def of(cls, task: Task, step: Fraction) -> "_Kalman":
        period = float(step)
        units = np.diag([1, 1 / period, 1 / period**2])
        return cls(np.linalg.inv(units) @ expm(_flow(task) * period) @ units, units, period)

    def decades(self, task: Task, noise: Fraction) -> float:
        """Where a search begins: of what the disturbance moves within T_s, over the noise [m]."""
        moved = float(task.amplitude) * self.step**2
        return _DECADES if not noise or not moved else float(np.clip(2 * log10(moved / noise), 0, _DECADES))

    def corrections(self, acceleration: float, level: float) -> tuple[Fraction, Fraction, Fraction]:
        """Per innovation of the slip, whose noise has the variance 1, by the Riccati equation of the filter."""
        pushed = self.follows[:, 2] * [1, 1, 0]
        process = 10**acceleration * np.outer(pushed, pushed) + np.diag([0, 0, 10**level]) + _FAINT * np.eye(3)
        covariance = solve_discrete_are(self.follows.T, np.eye(3)[:, :1], process, np.eye(1))
        first, second, third = self.units @ covariance[:, 0] / (covariance[0, 0] + 1)
        return short(float(first)), short(float(second)), short(float(third))


@dataclass(frozen=True, slots=True)
class _Scale:
    """β0·b of the model, in a few digits [m²/kg], and T_s [s]."""

    gain: Fraction
    model_gain: float
    step: float

    @classmethod
    def of(cls, task: Task, step: Fraction) -> "_Scale":
        gain = float(task.model.gain)
        return cls(short(gain), gain, float(step))

    def gains(self, x: np.ndarray) -> tuple[Fraction, Fraction]:
        """k1 [Pa/m] and k2 [Pa·s/m]."""
        return short(float(x[0]) / self.model_gain / self.step**2), short(float(x[1]) / self.model_gain / self.step)


def _flow(task: Task) -> np.ndarray:
    """Of e1, e2 and a constant push."""
    return np.array([[0, 1, 0], [float(task.model.slip), -float(task.model.rate), 1], [0, 0, 0]])


def _ahead(task: Task, step: Fraction, delay: Fraction) -> ErrorPrediction:
    """What the model says of the next sample, and of the time at which a pressure arrives; numbers of four digits."""
    flow, period, late = _flow(task), float(step), float(delay)

    def pushed(duration: float) -> np.ndarray:
        """Errors after a unit push for some time."""
        return np.array(expm(flow * duration))[:2, 2]

    whole, part = int(delay // step), float(delay % step)
    ages = whole + (1 if part else 0)
    pushes = [np.zeros(2)] * (ages + 1)
    pushes[whole] = pushed(period - part)
    if part:
        pushes[whole + 1] = pushed(period) - pushes[whole]
    arriving = [pushed(min(j * period, late)) - pushed((j - 1) * period) for j in range(1, ages + 1)]
    return ErrorPrediction(
        of_errors=rounded(expm(flow * period)[:2, :2]),
        of_pushes=rounded(pushes),
        ahead=rounded(expm(flow * late)[:2, :2]),
        ahead_of_pushes=rounded(arriving),
    )
