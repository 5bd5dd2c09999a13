"""Models and gains of LQG laws, against integrations of the plant and Riccati equations solved by iteration."""

from fractions import Fraction as F

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from quakedesign.fault import load_fault
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search.lqg import (
    FAVOURED,
    DelayFeedback,
    PathFeedback,
    _Kalman,
    family_of,
    sliding_law,
)
from quakedesign.laws import NominalModel
from quakedesign.loop import SlidingModel
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
    model = PathFeedback.of(MODEL, STEP, ExactSetup(delay=F(delay), lag=F(1, 10))).model
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
    feedback = PathFeedback.of(MODEL, STEP, ExactSetup(lag=F(1, 10)))
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
    setup = ExactSetup(**around)
    both, observed = (family_of(TASK, STEP, measured, setup) for measured in ("slip-and-rate", "slip"))
    law = both.law(np.array(both.starts[0]))
    assert law.states == ("predicted_rate", "disturbance", *names)
    law = observed.law(np.array(observed.starts[0]))
    kept = names[:-1] if "diffusion" in around else names  # a state more, a mode less
    assert law.states == ("predicted_slip", "predicted_rate", "disturbance", *kept)
    assert law.of_slip_alone
    assert (both.allowance, observed.allowance, both.period) == (1.6, 1.4, STEP + setup.diffusion)
    assert all(both.admits(np.array(x)) for x in both.starts)
    assert all(observed.admits(np.array(x)) for x in observed.starts)


@pytest.mark.parametrize("path", [False, True])
def test_a_family_admits_weights_from_0_to_1_and_exponents_below_12(path):
    """The first two numbers are exponents with a path only."""
    setup = ExactSetup(lag=F(1, 10) if path else F(0))
    both, observed = (family_of(TASK, STEP, measured, setup).admits for measured in ("slip-and-rate", "slip"))
    admitted = [bool(both(np.array([0.5, 0.5, weight]))) for weight in (-0.1, 0.0, 0.1, 0.9, 1.0, np.nan)]
    assert admitted == [False, False, True, True, False, False]
    for place in range(2):
        for size in (-12.0, 11.9, 12.0, np.nan):
            x = np.array([0.5] * 4)
            x[place] = size
            assert both(x[:3]) is observed(x) is (not path or size == 11.9)
            x = x[::-1]
            assert observed(x) is (size == 11.9)


SLIDING = SlidingModel(
    rate=F("1.2e-6"), state_rate=F("1.2e-3"), slope=F(1), state_slope=F(1), strength=F(500024), weakening=F(750000),
    direct=F("0.01"), evolution=F("0.015"), stiffness=F(6 * 10**6), coefficient=F("0.6"),
)  # fmt: skip


def sliding_plant(step, diffusion):
    """A and B of (x, z, four slow modes, a stress), and y of these; x in D_c, pressure and stress in N."""
    modes = 4 if diffusion else 0
    strength, weakening, stiffness = 500024.0, 750000.0, 6e6
    n = np.arange(modes)
    shares, rates = 4 / np.pi * (-1.0) ** n / (2 * n + 1), ((2 * n + 1) * np.pi / 2) ** 2 / max(diffusion, 1.0)
    y = np.array([-stiffness * 1e-3, -weakening, *0.6 * 50e6 * shares, 50e6, 0.6 * 50e6 * (1 - shares.sum())])
    y /= strength
    flow = np.zeros((4 + modes, 4 + modes))
    flow[0], flow[1] = 1.2e-3 * y, -1.2e-3 * y
    flow[1, 1] -= 1.2e-3
    flow[2 : 2 + modes, 2 : 2 + modes], flow[2 : 2 + modes, -1] = -np.diag(rates), rates
    moved = expm(flow * step)
    return moved[:-1, :-1], moved[:-1, -1], y[:-2]


@pytest.mark.parametrize("diffusion", [0, 833])
def test_the_law_of_slow_sliding_is_filter_and_regulator(diffusion):
    """K and L by iteration of the Riccati difference equations, and the recursion of the compensator."""
    a, b, y = sliding_plant(50.0, diffusion)
    size, w = len(a) - 1, FAVOURED
    k = regulator(
        a[:size, :size], b[:size], np.outer(y, y) + np.diag([w.slip, w.state, *[0.0] * (size - 2)]), w.pressure
    )
    followed = a[np.ix_([0, 1, size], [0, 1, size])]
    noise, covariance = np.diag([w.slip_noise, w.state_noise, w.level_noise]), np.eye(3)
    for _ in range(2000):
        correction = covariance[:, 0] / (covariance[0, 0] + 1)
        covariance = followed @ (covariance - np.outer(correction, covariance[0])) @ followed.T + noise
    gains = np.array([*k, (1 + k[2:].sum()) / 0.6])
    spread = np.zeros(size + 1)
    spread[[0, 1, size]] = correction
    law, z, predicted = sliding_law(SLIDING, F(50), diffusion=F(diffusion)), np.zeros(size + 1), np.zeros(size + 1)
    f, g, output, d = (np.array(m, float) for m in (law.update, law.measured, law.output, law.feedback))
    for error in np.random.default_rng(2).normal(size=25) * 1e-4:
        x = predicted + spread * (error / 1e-3 - predicted[0])
        assert output @ z + d[0] * error == pytest.approx(-50e6 * (gains @ x), rel=1e-5)
        predicted = a @ x - b * (gains @ x)
        z = f @ z + g[:, 0] * error
        assert z == pytest.approx(predicted, rel=1e-5, abs=1e-8)
    assert law.states == ("slip", "state", *(f"mode{i}" for i in range(size - 2)), "level")
    assert (law.applied, law.of_slip_alone) == ((), True)
