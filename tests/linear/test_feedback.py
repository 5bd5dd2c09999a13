"""Feedback of the state against feedback of the error: numbers of ERRATA 29, and simulated loops."""

from fractions import Fraction as F

import control
import numpy as np
import pytest
from own.printed_theorem import compare_feedback, lag_coefficient, largest_reference_acceleration

import quakedesign as qd
from quakedesign.linear.linear_problem import LinearProblem

REAL = qd.load_fault("real-fault")
GAINS = tuple(qd.published("real-fault")["elqr"].gains.values())


def error_transfer(problem, gains, vertex, feedback):
    """Numerator and denominator of e1/r, highest power first."""
    beta, s, w = (float(v) for v in vertex)
    push = [beta * float(problem.sectors.authority) * float(k) for k in gains]
    denominator = [1.0, w + push[1], push[0] - s, push[2], push[3]]
    held = push[:2] if feedback == "state" else [0.0, 0.0]
    return [-1.0, -(w + held[1]), -(held[0] - s), 0.0, 0.0], denominator


def test_the_numbers_of_the_errata():
    error, state = compare_feedback(REAL, GAINS)
    assert (error.feedback, state.feedback) == ("error", "state")
    assert state.largest_term == pytest.approx(1.5e9, rel=0.05)
    assert state.lag == pytest.approx(1e-3, rel=0.1)
    # e1 ≈ −k1 r̈/k4
    assert state.lag == pytest.approx(float(GAINS[0] / GAINS[3]) * largest_reference_acceleration(REAL), rel=0.1)
    assert error.lag < state.lag / 20
    assert state.largest_term / state.pressure > 200 * error.largest_term / error.pressure


def test_the_largest_acceleration_of_the_reference():
    # 10/√3 · d/t², where s = (1 ± 1/√3)/2
    d, t = 0.785, 184.17 * 3600
    assert largest_reference_acceleration(REAL) == pytest.approx(10 / np.sqrt(3) * d / t**2, rel=1e-9)


@pytest.mark.parametrize("feedback", ["error", "state"])
def test_the_transfer_function_agrees_with_the_loop_in_state_space(feedback):
    problem = LinearProblem.of(REAL)
    vertex = (F(5, 4), F(1, 2), F("1.6"))
    beta, s, w = (float(v) for v in vertex)
    push = [beta * float(problem.sectors.authority) * float(k) for k in GAINS]
    # inputs r and r': ξ1' = x1 − r; p sees x or x − r
    A = np.array([[0, 1, 0, 0], [s - push[0], -w - push[1], -push[2], -push[3]], [1, 0, 0, 0], [0, 0, 1, 0]])
    B = np.array([[0, 0], [0, 0], [-1, 0], [0, 0]], dtype=float)
    if feedback == "error":
        B[1] = push[:2]
    loop = control.ss(A, B, [[1, 0, 0, 0]], [[0, 0]])
    for omega in (1e-3, 0.03, 0.7, 5.0):
        z = 1j * omega
        found = loop(z)[0]
        numerator, denominator = error_transfer(problem, GAINS, vertex, feedback)
        by_hand = np.polyval(numerator, z) / np.polyval(denominator, z)
        assert by_hand == pytest.approx(found[0] + z * found[1] - 1, rel=1e-8)


@pytest.mark.parametrize("feedback", ["error", "state"])
def test_the_lag_is_the_error_behind_a_parabola(feedback):
    problem = LinearProblem.of(REAL)
    vertex = (F(1), F(-48, 100), F("1.6"))
    numerator, denominator = error_transfer(problem, GAINS, vertex, feedback)
    at = 1j * 1e-7
    behind = np.polyval(numerator, at) / np.polyval(denominator, at) / at**2
    assert -behind.real == pytest.approx(lag_coefficient(problem, GAINS, vertex, feedback), rel=1e-3)
