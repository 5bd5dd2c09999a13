"""Models and gains of LQG laws, against integrations of the plant and Riccati equations solved by iteration."""

from fractions import Fraction as F

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from quakedesign.fault import load_fault
from quakedesign.guarantees.search.lqg import (
    DelayFeedback,
    PathFeedback,
    _Kalman,
    family_of,
)
from quakedesign.laws import NominalModel
from quakedesign.plant import uncertain_plant

MODEL = NominalModel(slip=F(1, 2), rate=F(3, 2), gain=F(12, 5))
STEP = F(1, 5)


def integrated(errors, well, commands, delay, duration, lag=0.0):
    """e1, e2 and the well's pressure [Pa] after a time; `commands` are p_0, p_1 …, p_j commanded j samples ago."""
    state, period, t = np.array([*errors, well]), float(STEP), 0.0
    while duration - t > 1e-12:
        late = int(np.ceil((delay - t) / period - 1e-9))  # the command that acts at t arrived at delay − late·T_s
        end = min(duration, delay - (late - 1) * period)
        valve = commands[late]

        def field(_, x, valve=valve):
            pressure = x[2] if lag else valve
            return x[1], 0.5 * x[0] - 1.5 * x[1] + 2.4 * pressure, (valve - x[2]) / lag if lag else 0.0

        state, t = solve_ivp(field, (t, end), state, rtol=1e-11, atol=1e-13).y[:, -1], end
    return state


@pytest.mark.parametrize("delay", ["0", "0.05", "0.2", "0.27"])
def test_the_model_of_a_delay_predicts_the_next_sample_and_the_arrival(delay):
    feedback = DelayFeedback.of(MODEL, STEP, F(delay))
    a, b, arrival = (np.array(m, float) for m in (feedback.model.update, feedback.model.command, feedback.arrival))
    commands = np.array([0.3, -0.2, 0.5])[: len(b) - 1]
    x = np.array([0.1, -0.2, *commands[1:]])
    seen = integrated(x[:2], 0.0, commands, float(F(delay)), float(STEP))
    assert np.allclose((a @ x + b * commands[0])[:2], seen[:2], atol=2e-4)
    assert np.allclose((a @ x + b * commands[0])[2:], commands[:-1])
    arrived = integrated(x[:2], 0.0, commands, float(F(delay)), float(F(delay))) if F(delay) else x
    assert np.allclose(arrival @ x, arrived[:2], atol=2e-4)
    k1, k2 = 0.6 / 2.4 / float(STEP) ** 2, 1 / 2.4 / float(STEP)
    assert np.allclose(np.array(feedback.gains(0.6, 1.0), float), [k1, k2] @ arrival, rtol=1e-3)


@pytest.mark.parametrize("delay", ["0", "0.05", "0.27"])
def test_the_model_of_a_lag_predicts_the_next_sample(delay):
    """Its states are 2.4 times the pressures: of the well, and of the commands that wait."""
    model = PathFeedback.of(MODEL, STEP, {"delay": F(delay), "lag": F(1, 10)}).model
    a, b = np.array(model.update, float), np.array(model.command, float)
    commands = np.array([0.3, -0.2, 0.5])[: len(b) - 2]
    x = np.array([0.1, -0.2, 2.4 * 0.4, *2.4 * commands[1:]])
    seen = integrated(x[:2], 0.4, commands, float(F(delay)), float(STEP), lag=0.1)
    assert np.allclose(a @ x + b * commands[0], [*seen[:2], 2.4 * seen[2], *2.4 * commands[:-1]], atol=5e-4)


def regulator(a, b, cost, weight):
    """K of the Riccati difference equation after many steps."""
    value = cost
    for _ in range(2000):
        k = b @ value @ a / (weight + b @ value @ b)
        value = cost + a.T @ value @ (a - np.outer(b, k))
    return k


def test_the_gains_behind_a_lag_are_those_of_a_regulator():
    """Of e1, e2 and 2.4 times the well's pressure; time in T_s + lag = 0.3 s, pressure in 1/(0.3·2.4)."""
    feedback = PathFeedback.of(MODEL, STEP, {"lag": F(1, 10)})
    a, b = np.array(feedback.model.update, float), np.array(feedback.model.command, float)
    cost, weight = np.diag([np.exp(-2.4) / 0.3**2, 1, 0]), np.exp(-1.0) * (0.3 * 2.4) ** 2
    assert np.allclose(np.array(feedback.gains(-2.4, -1.0), float), regulator(a, b, cost, weight), rtol=2e-3)


def test_the_corrections_of_an_observer_are_those_of_a_kalman_filter():
    """Noise of the measured slip 1, of an acceleration 10 and of its level 1/100 in units of T_s."""
    a = np.diag([1, 0.2, 0.04]) @ expm(np.array([[0, 1, 0], [0.5, -1.5, 1], [0, 0, 0]]) * 0.2) @ np.diag([1, 5, 25])
    pushed, covariance = a[:, 2] * [1, 1, 0], np.eye(3)
    noise = 10 * np.outer(pushed, pushed) + np.diag([0, 0, 0.01])
    for _ in range(2000):
        correction = covariance[:, 0] / (covariance[0, 0] + 1)
        covariance = a @ (covariance - np.outer(correction, covariance[0])) @ a.T + noise
    corrections = _Kalman.of(MODEL, STEP).corrections(1.0, -2.0)
    assert np.array(corrections, float) == pytest.approx(correction * [1, 5, 25], rel=1e-3)


TASK = uncertain_plant(load_fault("real-fault"))


@pytest.mark.parametrize(
    ("around", "names"),
    [
        ({}, ()),
        ({"delay": F(3, 10)}, ("asked_1_ago", "asked_2_ago")),
        ({"lag": F(1, 10)}, ("path0",)),
        ({"delay": F(3, 10), "lag": F(1, 10)}, ("path0", "path1", "path2")),
        ({"delay": F(8, 5), "lag": F(1, 10)}, tuple(f"asked_{j}_ago" for j in range(1, 9))),  # too long for the lag
        ({"diffusion": F(1)}, tuple(f"path{i}" for i in range(6))),
    ],
)
def test_a_family_models_what_is_between_law_and_fault(around, names):
    both, observed = (family_of(TASK, STEP, measured, around) for measured in ("slip-and-rate", "slip"))
    law = both.law(np.array(both.starts[0]))
    assert law.states == ("predicted_rate", "disturbance", *names)
    law = observed.law(np.array(observed.starts[0]))
    kept = names[:-1] if "diffusion" in around else names  # a state more, a mode less
    assert law.states == ("predicted_slip", "predicted_rate", "disturbance", *kept)
    assert law.of_slip_alone
    assert (both.room, observed.room, both.period) == (1.6, 1.4, STEP + around.get("diffusion", 0))
    assert all(both.admits(np.array(x)) for x in both.starts)
    assert all(observed.admits(np.array(x)) for x in observed.starts)


@pytest.mark.parametrize("path", [False, True])
def test_a_family_admits_weights_from_0_to_1_and_exponents_below_12(path):
    """The first two numbers are exponents with a path only."""
    around = {"lag": F(1, 10)} if path else {}
    both, observed = (family_of(TASK, STEP, measured, around).admits for measured in ("slip-and-rate", "slip"))
    admitted = [bool(both(np.array([0.5, 0.5, weight]))) for weight in (-0.1, 0.0, 0.1, 0.9, 1.0, np.nan)]
    assert admitted == [False, False, True, True, False, False]
    for place in range(2):
        for size in (-12.0, 11.9, 12.0, np.nan):
            x = np.array([0.5] * 4)
            x[place] = size
            assert both(x[:3]) is observed(x) is (not path or size == 11.9)
            x = x[::-1]
            assert observed(x) is (size == 11.9)
