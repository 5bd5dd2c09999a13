"""LQG designs of sampled laws, with or without a lag or a diffusion path.

Chapters: regulator by a discrete Riccati equation on fault and path; parametrised families of laws for searches; e-LQR
with Kalman observer for slow sliding, in scaled variables; linearised fault in slow sliding and its poles.
"""

from cmath import sqrt
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from math import exp, log10
from typing import Any

import numpy as np
import sympy as sp
from scipy.linalg import LinAlgError, expm, solve_discrete_are

from quakedesign.errors import ParameterError
from quakedesign.exact import fraction_of, rational, shortly, to_sympy
from quakedesign.fault import Fault
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search.float_bounds import rounded, short
from quakedesign.laws import ErrorModel, LinearLaw, NominalModel, compensator, disturbance_estimate, slip_observer
from quakedesign.laws.sampled_law import Matrix, Row, unit_row
from quakedesign.loop import SHORTEST, DiffusionPath, SlidingModel
from quakedesign.loop.diffusion_path import MODES
from quakedesign.loop.loop_setup import MEASURED
from quakedesign.loop.sensing.differentiator import ORDER, by_differences, names_before
from quakedesign.plant.fault_plant import FaultPlant
from quakedesign.symbolic.rate_and_state_plant import sliding_errors, sliding_rate

# ----------------------------------------------------------------------
# Laws for a fault with a lag or a diffusion path: gains of a discrete Riccati equation on fault and path.

THROUGH_PATH = ((-2.4, -9.3, 0.12), (-2.0, -8.0, 0.06), (-3.0, -9.5, 0.25))  # parameters of good laws
BEHIND_LAG = ((-2.4, -6.0, 0.3), (-1.0, -4.0, 0.5))
_MOST_STATES = 20  # of a loop
# number of states without path model: e1, e2, π2, d, valve pressure, and its last step or the well pressure
_WITHOUT_PATH = 6


def path_modes(step: Fraction, setup: ExactSetup, *, observed: bool = False) -> int:
    """Largest number of diffusion modes in a law for which the loop stays within the state limit of a file.

    Negative if the loop exceeds the limit without any mode. A law of the slip alone has one additional state.
    """
    ages = -int(-setup.delay // step)
    modes, behind = MODES if setup.diffusion else 0, bool(setup.lag)
    free = _MOST_STATES - _WITHOUT_PATH - modes - behind - 2 * ages - observed
    return free if modes else min(free, 0)


@dataclass(frozen=True, slots=True)
class PathFeedback:
    """Model of fault and path with LQR feedback on the sampled pair."""

    model: ErrorModel
    flow: np.ndarray
    first: np.ndarray
    unit: float
    acceleration: float

    @classmethod
    def of(cls, model: NominalModel, step: Fraction, setup: ExactSetup, *, observed: bool = False) -> "PathFeedback":
        """Model with as many diffusion modes as a law may contain; for the slip alone if `observed`."""
        gain, short_gain = float(model.gain), short(float(model.gain))
        flow, first = _sampled(model, step, setup, path_modes(step, setup, observed=observed))
        path, count = rounded(flow[2:, 2:]), len(flow) - 2  # states b·q of the pressures q of the path
        errors = np.hstack([flow[:2, :2], flow[:2, 2:] / gain])
        errors_model = ErrorModel(
            update=(*rounded(errors), *((Fraction(0), Fraction(0), *row) for row in path)),
            command=tuple(short_gain * v for v in (*rounded([first[:2] / gain])[0], *(1 - sum(row) for row in path))),
            gain=short_gain,
            pressures=tuple(f"path{i}" for i in range(count)),
            unit=short_gain,
        )
        unit = float(setup.diffusion or step + setup.delay + setup.lag)
        return cls(errors_model, flow, first, unit, unit * gain)

    def gains(self, slip: float, pressure: float) -> Row:
        """Gains for logarithms of the weights of slip error and pressure; the slip-rate error has the weight 1.

        The unit of time is L²/D or, without a diffusion path, T_s plus delay and lag.

        Raises
        ------
        LinAlgError
            Where the Riccati equation has no solution.
        """
        weights = np.zeros(self.flow.shape)
        weights[0, 0], weights[1, 1] = exp(slip) / self.unit**2, 1
        cost = exp(pressure) * self.acceleration**2
        of_slip, of_rate, *of_path = map(short, _regulator(self.flow, self.first, weights, cost))
        return of_slip, of_rate, *(v / self.model.gain for v in of_path)


def _regulator(update: np.ndarray, command: np.ndarray, weights: np.ndarray, of_command: float) -> np.ndarray:
    """K of p = −Kx that minimises Σ xᵀQx + R·p² of x⁺ = Ax + Bp."""
    value = solve_discrete_are(update, command[:, None], weights, np.array([[of_command]]))
    return np.array(command @ value @ update / (of_command + command @ value @ command))


def _filter(update: np.ndarray, process: np.ndarray) -> np.ndarray:
    """Steady-state Kalman gain for a measurement of the first state with noise variance 1."""
    covariance = solve_discrete_are(update.T, np.eye(len(update))[:, :1], process, np.eye(1))
    return np.array(covariance[:, 0] / (covariance[0, 0] + 1))


def _sampled(model: NominalModel, step: Fraction, setup: ExactSetup, modes: int) -> tuple[np.ndarray, np.ndarray]:
    """A and B over one period, for e1, e2, path pressures and delayed commands [Pa]."""
    delay, lag = setup.delay, setup.lag
    whole, late = int(delay // step), float(delay % step)
    ages = whole + (late > 0)
    lagging, path = int(lag > 0), DiffusionPath(time=setup.diffusion or lag)
    size = 2 + lagging + modes
    shares = np.array([float(path.share(i)) for i in range(modes)])
    rates = np.array([float(path.rate(i)) for i in range(modes)])
    flow = np.zeros((size + 1, size + 1))  # the last entry is the valve pressure
    well = 2 if lagging else size
    flow[0, 1] = 1
    flow[1, :2] = float(model.slip), -float(model.rate)
    flow[1, size - modes : size] = float(model.gain) * shares
    flow[1, well] += float(model.gain) * (1 - shares.sum())
    if lagging:
        flow[2, [2, size]] = -1 / float(lag), 1 / float(lag)
    for i, rate in enumerate(rates):
        mode = size - modes + i
        flow[mode, mode], flow[mode, well] = -rate, rate
    whole_size = size + ages + 1  # with p last
    period = np.eye(whole_size)
    for valve, duration in ((size + ages - 1, late), (size + whole - 1 if whole else size + ages, float(step) - late)):
        part = expm(flow * duration)
        turn = np.eye(whole_size)
        turn[:size, :size], turn[:size, valve] = part[:size, :size], part[:size, size]
        period = turn @ period if duration else period
    if ages:
        period[size:-1] = 0
        period[size, -1] = 1
        period[range(size + 1, size + ages), range(size, size + ages - 1)] = 1
    return period[:-1, :-1], period[:-1, -1]


# ----------------------------------------------------------------------
# Laws with a few dimensionless parameters for one model, T_s and delay, for searches.

_STARTS = ((0.6, 1.0, 0.1), (0.55, 0.9, 0.6), (0.3, 0.8, 0.4))  # k1·β0b·T², k2·β0b·T, a of good laws
_NOT_BY_DIFFERENCES = ("diffusion", "lag", "initial_slip", "initial_slip_rate", "jitter", "averaging")
_GENTLE = ((0.15, 0.6, 0.1), (0.1, 0.4, 0.3))  # the same for a delayed slip rate
_OBSERVERS = ((0.5, 0.9, -0.4, -4.0), (0.3, 0.8, -0.4, -2.0))  # gains as in _STARTS; offsets added to `_Kalman.decades`
_DECADES = 4.0  # largest initial ratio of process noise to measurement noise, in decades
_FEWEST_MODES = 2  # least number of diffusion modes in a law with a model of its path
_WIDEST = 12.0  # largest decades or exponents of weights for which Riccati solutions are accurate
_FAINT = 1e-12  # process noise of all states, so that the filter forgets its initial state


@dataclass(frozen=True, slots=True)
class LawFamily:
    """Laws with parameters x, with their initial values and admissible range.

    The objective ``tracking`` may have `allowance` times the least bound of the slip-rate error. To avoid slow
    convergence, the peak cost also includes a weighted slip error divided by `period` [s].
    """

    law: Callable[[np.ndarray], LinearLaw]
    starts: tuple[tuple[float, ...], ...]
    admits: Callable[[np.ndarray], bool]
    allowance: float
    period: Fraction


def measured_by(law: LinearLaw) -> str:
    """Entry of `MEASURED` for which a law is designed."""
    return MEASURED[2] if law.states[-ORDER:] == names_before() else MEASURED[law.of_slip_alone]


def require_setup(setup: ExactSetup) -> None:
    """Reject a diffusion time or noise below 0."""
    limits = (
        ("diffusion", setup.diffusion, "s"),
        ("slip noise", setup.slip_noise, "m"),
        ("rate noise", setup.rate_noise, "m/s"),
    )
    for what, value, unit in limits:
        if value < 0:
            raise ParameterError(
                f"{what} must be 0 or more. Received {shortly(value)} {unit}. Give its absolute value."
            )


def why_no_law(step: Fraction, measured: str, setup: ExactSetup) -> str:
    """Reason why there are no laws for a loop; empty if there are."""
    if setup.longest_step and measured != MEASURED[0]:
        return "aperiodic sampling needs slip and slip rate measured"
    if measured == MEASURED[2] and any(getattr(setup, name) for name in _NOT_BY_DIFFERENCES):
        return (
            "a law with a differentiator requires zero initial errors, and no jitter, averaging, lag or diffusion path"
        )
    if not setup.diffusion:
        return ""
    if SHORTEST * setup.diffusion < step:
        return f"L^2/D = {float(setup.diffusion):.4g} s is below T_s/{SHORTEST}; omit the diffusion path"
    observable = path_modes(step, setup, observed=measured == "slip") >= _FEWEST_MODES
    return "" if observable else "a law with models of the delay and of the diffusion path has too many states"


def family_of(task: FaultPlant, step: Fraction, measured: str, setup: ExactSetup) -> LawFamily:
    """Feedback with a disturbance estimate, for slip and rate, slip alone or differentiator.

    With a lag or a diffusion path the law also feeds back the pressures of its model of the path.

    Parameters
    ----------
    task : FaultPlant
    step : Fraction
        T_s [s].
    measured : str
        One of `MEASURED`.
    setup : ExactSetup
        Loop setup that passes `why_no_law`. Its slip noise sets the initial values of an observer.
    """
    if measured == MEASURED[2]:
        plain = family_of(task, step, MEASURED[0], setup)
        return replace(plain, law=lambda x: by_differences(plain.law(x), step), starts=(*_GENTLE, *plain.starts))
    observed, diffusing = measured == "slip", bool(setup.diffusion)
    path = diffusing or (bool(setup.lag) and path_modes(step, setup, observed=observed) >= 0)
    feedback: PathFeedback | DelayFeedback
    if path:
        feedback = PathFeedback.of(task.model, step, setup, observed=observed)
    else:
        feedback = DelayFeedback.of(task.model, step, setup.delay)
    kalman = _Kalman.of(task.model, step)

    def law(x: np.ndarray) -> LinearLaw:
        gains = feedback.gains(float(x[0]), float(x[1]))
        if observed:
            return slip_observer(gains, kalman.corrections(float(x[2]), float(x[3])), feedback.model)
        return disturbance_estimate(gains, short(float(x[2])), feedback.model)

    def admits(x: np.ndarray) -> bool:
        exponents = np.abs(x[0 if path else 2 : 4 if observed else 2])
        return bool((exponents < _WIDEST).all() and (observed or 0 < x[2] < 1))

    starts: tuple[tuple[float, ...], ...] = (THROUGH_PATH if diffusing else BEHIND_LAG) if path else _STARTS
    if observed:
        decades = kalman.decades(float(task.amplitude), setup.slip_noise)
        first = starts if path else _OBSERVERS
        starts = tuple((*k[:2], decades + a, decades + b) for k, (*_, a, b) in zip(first, _OBSERVERS, strict=False))
    period = step + setup.diffusion
    return LawFamily(law, starts, admits, allowance=1.4 if observed else 1.6, period=period)


@dataclass(frozen=True, slots=True)
class _Kalman:
    """Kalman filters for slip error, slip-rate error and disturbance acceleration, from the slip."""

    transition: np.ndarray
    units: np.ndarray
    step: float

    @classmethod
    def of(cls, model: NominalModel, step: Fraction) -> "_Kalman":
        period = float(step)
        units = np.diag([1, 1 / period, 1 / period**2])
        return cls(np.linalg.inv(units) @ expm(_flow(model) * period) @ units, units, period)

    def decades(self, amplitude: float, noise: Fraction) -> float:
        """Initial noise ratio in decades: 2·log10 of displacement per period by `amplitude` [m/s²] over `noise` [m]."""
        moved = amplitude * self.step**2
        return _DECADES if not noise or not moved else float(np.clip(2 * log10(moved / noise), 0, _DECADES))

    def corrections(self, acceleration: float, level: float) -> tuple[Fraction, Fraction, Fraction]:
        """Kalman gain for the slip, by the Riccati equation of the filter."""
        pushed = self.transition[:, 2] * [1, 1, 0]
        process = 10**acceleration * np.outer(pushed, pushed) + np.diag([0, 0, 10**level]) + _FAINT * np.eye(3)
        first, second, third = map(short, self.units @ _filter(self.transition, process))
        return first, second, third


def _flow(model: NominalModel) -> np.ndarray:
    """System matrix of e1, e2 and a constant acceleration."""
    return np.array([[0, 1, 0], [float(model.slip), -float(model.rate), 1], [0, 0, 0]])


@dataclass(frozen=True, slots=True)
class DelayFeedback:
    """Model of fault and delayed commands, with feedback of the errors at arrival.

    Attributes
    ----------
    model : ErrorModel
    arrival : tuple of rows
        Coefficients of e1, e2 and the delayed commands for both errors at the arrival of the present command.
    input_gain, step : float
        β·b [m²/kg] and T_s [s].
    """

    model: ErrorModel
    arrival: Matrix
    input_gain: float
    step: float

    @classmethod
    def of(cls, model: NominalModel, step: Fraction, delay: Fraction) -> "DelayFeedback":
        """Feedback with coefficients of four digits."""
        flow, period, late = _flow(model), float(step), float(delay)

        def pushed(duration: float) -> np.ndarray:
            """Errors after a unit acceleration for some time."""
            return np.array(expm(flow * duration))[:2, 2]

        moved, first = _sampled(model, step, ExactSetup(delay=delay), 0)
        ages = range(1, len(moved) - 1)
        arriving = [pushed(min(j * period, late)) - pushed((j - 1) * period) for j in ages]
        gain = float(model.gain)
        of_commands = rounded(v / gain for v in (first[:2], *moved[:2, 2:].T))
        errors_model = ErrorModel.delayed(rounded(moved[:2, :2]), of_commands, short(gain))
        free, forced = rounded(expm(flow * late)[:2, :2]), rounded(arriving)
        arrival = tuple((*row, *(errors_model.gain * v[i] for v in forced)) for i, row in enumerate(free))
        return cls(errors_model, arrival, gain, period)

    def gains(self, slip: float, rate: float) -> Row:
        """Gains from k1·β·b·T_s² and k2·β·b·T_s for the errors at the arrival."""
        k1, k2 = short(slip / self.input_gain / self.step**2), short(rate / self.input_gain / self.step)
        return tuple(k1 * e1 + k2 * e2 for e1, e2 in zip(*self.arrival, strict=True))


# ----------------------------------------------------------------------
# An e-LQR for slow sliding: LQ feedback of the sampled plant with its path, from a Kalman observer of the slip.
#
# The model is scaled: slip error in D_c, pressures and stresses in σ′, time in 1/ρ = D_c/V; the law contains the slow
# modes of the diffusion path and one level that represents all disturbances. The gain of the level and its effect on
# the slip are such that, for all parameters, zero errors under a constant pressure are a steady state of the law.

SLIDING_MODES = 4
_DIGITS = 9
_LEAST = 1e-12  # least cost of every state, so that the Riccati equation has one solution
_ZERO, _ONE = Fraction(0), Fraction(1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """Weights of regulator and filter in the scaled model.

    Attributes
    ----------
    slip, state, pressure : float
        LQ weights of x² (slip error), z² (log state) and u² (pressure); that of y², y = ln(v/V), is 1.
    slip_noise, state_noise, level_noise : float
        Variances of the process noise of x, z and the level per sample; that of the measured x is 1.
    """

    slip: float
    state: float
    pressure: float
    slip_noise: float
    state_noise: float
    level_noise: float


FAVOURED = Weights(slip=4.4e-3, state=5.5e-3, pressure=344.0, slip_noise=5.9e3, state_noise=1.4e-4, level_noise=162.0)
"""Minimisers of the worst-case peak of ln(v/V) under bounded stresses; a = 0.01, b = 0.015, ρL²/D = 1, ρT_s = 0.05."""


def sliding_law(
    model: SlidingModel, step: Fraction, *, diffusion: Fraction = _ZERO, weights: Weights = FAVOURED
) -> LinearLaw:
    """LQG compensator of the slip error with zero-order hold over `step` [s].

    It contains a model of a diffusion path of L²/D = `diffusion` [s], unless that is 0. The pressure is relative to the
    equilibrium pressure of the reference. States: predicted x, z, the modes of the path and the level, all scaled.

    Raises
    ------
    ParameterError
        When the Riccati equations have no solution: the step or the diffusion time is too long for the instability.
    """
    modes = DiffusionPath(time=diffusion * model.state_rate) if diffusion else None
    shares = [modes.share(i) for i in range(SLIDING_MODES)] if modes else []
    rates = [modes.rate(i) for i in range(SLIDING_MODES)] if modes else []
    scaled_step, size = step * model.state_rate, 2 + len(shares)
    stress, length = model.weakening / model.evolution, model.rate / model.state_rate
    # Flow of (x, z, modes, level, pressure), and their coefficients in y: x′ = y, z′ = −y − z.
    *by_mode, at_once = (model.coefficient * share for share in (*shares, 1 - sum(shares, _ZERO)))
    by_state = (-model.stiffness * length / stress, -model.evolution)
    log_rate = np.array([float(v * stress / model.strength) for v in (*by_state, *by_mode, _ONE, at_once)])
    flow = np.zeros((size + 2, size + 2))
    flow[0], flow[1] = log_rate, -log_rate
    flow[1, 1] -= 1
    for i, rate in enumerate(map(float, rates), start=2):
        flow[i, i], flow[i, -1] = -rate, rate
    errors = [[short(v, _DIGITS) for v in row] for row in expm(flow * float(scaled_step))[:2]]
    for row in errors:  # a level balanced by a constant pressure has no effect
        row[size] = (sum(row[2:size], _ZERO) + row[-1]) / model.coefficient
    fades = enumerate((short(exp(-float(rate * scaled_step)), _DIGITS) for rate in rates), start=2)
    path = (unit_row(size + 2, {i: fade, size + 1: 1 - fade}) for i, fade in fades)
    update = (*map(tuple, errors), *path, unit_row(size + 2, {size: _ONE}))

    plant = np.array(update, dtype=float)
    corrected = [0, 1, size]
    cost = np.outer(log_rate[:size], log_rate[:size]) + _LEAST * np.eye(size)
    cost[[0, 1], [0, 1]] += weights.slip, weights.state
    process = np.diag([weights.slip_noise, weights.state_noise, weights.level_noise])
    try:
        gains = _regulator(plant[:size, :size], plant[:size, -1], cost, weights.pressure)
        corrections = dict(zip(corrected, _filter(plant[np.ix_(corrected, corrected)], process), strict=True))
    except (LinAlgError, ValueError):
        raise ParameterError(
            "step, delay and diffusion time must be short compared with the growth time of the instability. "
            "Received values for which the Riccati equation has no solution. Shorten the step or the diffusion path."
        ) from None
    feedback = [short(v, _DIGITS) for v in gains]
    feedback.append((1 + sum(feedback[2:], _ZERO)) / model.coefficient)
    law = compensator(
        states=("slip", "state", *(f"mode{i}" for i in range(size - 2)), "level"),
        update=tuple(row[:-1] for row in update),
        command=tuple(row[-1] / stress for row in update),
        measured=(unit_row(size + 1, {0: length}), unit_row(size + 1, {})),
        estimator=tuple((short(corrections.get(i, 0.0), _DIGITS) / length, _ZERO) for i in range(size + 1)),
        feedback=tuple(stress * k for k in feedback),
    )
    return replace(law, applied=())  # without a pressure limit, hence without anti-windup


# ----------------------------------------------------------------------
# A fault with rate-and-state friction, linearised about slow sliding along its task, and its poles.

_SLIDING_MODEL_ONE, _NEAR = Fraction(1), Fraction(1, 10)


def sliding_model(fault: Fault) -> SlidingModel:
    """Fault linearised about sliding at the mean rate V of its task, at the pressure 0.

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
        slope=_SLIDING_MODEL_ONE,
        state_slope=_SLIDING_MODEL_ONE,
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
    """L²/D [s] of a diffusion path with little delay: a tenth of D_c/V."""
    return _NEAR / model.state_rate


def growth_rate(model: SlidingModel) -> float:
    """Largest real part of the eigenvalues [1/s] about steady sliding, without control."""
    return max(pole.real for pole in sliding_poles(model))


def sliding_poles(model: SlidingModel) -> tuple[complex, complex]:
    """Both eigenvalues [1/s] about steady sliding, without control.

    With x in D_c they are those of ρ((−κ, −β), (κ, β − 1)), κ = KD_c/S, β = weakening/S, S = strength.
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
