"""The held loop's polynomial against matrix exponentials, mpmath and python-control."""

from fractions import Fraction as F

import control
import mpmath
import numpy as np
import pytest
from flint import arb

from quakedesign.errors import ParameterError
from quakedesign.synthesis.linear.sampled.zero_order_hold import (
    ball,
    coefficients,
    conditions,
    held_matrix,
    interval,
    require_integration,
    response,
)

RNG = np.random.default_rng(22)


def middle(value):
    return float(value.mid())


@pytest.mark.parametrize(("sigma", "omega"), [(0.3, 0.2), (-0.5, 0.7), (0, 0), (2.0, 0.0), (-3.0, 0.1)])
def test_the_impulse_response_and_its_integrals_by_quadrature(sigma, omega):
    mpmath.mp.dps = 30
    roots = mpmath.polyroots([1, omega, -sigma]) if sigma or omega else [mpmath.mpf(0), mpmath.mpf(0)]
    a, b = roots

    def g(t):
        return t * mpmath.exp(a * t) if abs(a - b) < 1e-12 else (mpmath.exp(a * t) - mpmath.exp(b * t)) / (a - b)

    expected = [g(1)] + [
        mpmath.quad(lambda t, n=n: g(t) * (1 - t) ** n / mpmath.factorial(n), [0, 1]) for n in range(3)
    ]
    found = response(arb(sigma), arb(omega))
    assert [middle(v) for v in found] == pytest.approx([float(mpmath.re(v)) for v in expected], rel=1e-12)


@pytest.mark.parametrize("integration", ["exact", "euler"])
def test_the_polynomial_is_that_of_the_sampled_loop(integration):
    for _ in range(20):
        T, beta, s, w = RNG.uniform(0.05, 1), RNG.uniform(1, 2), RNG.uniform(-2, 3), RNG.uniform(-0.5, 3)
        push = RNG.uniform(0.1, 3, 4)
        gamma = coefficients(*(arb(float(v)) for v in (T, beta, s, w)), [arb(float(k)) for k in push], integration)
        d = [1, *(middle(g) * T ** (n + 1) for n, g in enumerate(reversed(gamma)))]
        matrix = held_matrix(T, beta, s, w, push, integration)
        assert np.poly(matrix - np.eye(4)) == pytest.approx(d, rel=1e-8, abs=1e-10)


@pytest.mark.parametrize("integration", ["exact", "euler"])
def test_the_conditions_are_those_of_the_spectral_radius(integration):
    seen = set()
    for _ in range(300):
        T, beta, s, w = RNG.uniform(0.05, 1.5), RNG.uniform(1, 2), RNG.uniform(-2, 2), RNG.uniform(-0.5, 3)
        push = 10 ** RNG.uniform([0, 0, -2, -3], [1, 1, 0.5, 0])
        balls = [arb(float(v)) for v in (T, beta, s, w)]
        found = conditions(balls[0], coefficients(*balls, [arb(float(k)) for k in push], integration))
        radius = np.abs(np.linalg.eigvals(held_matrix(T, beta, s, w, push, integration))).max()
        if abs(radius - 1) > 1e-9:
            assert all(v > 0 for v in found) == (radius < 1)
            seen.add(bool(radius < 1))
    assert seen == {True, False}


def test_the_held_matrix_agrees_with_python_control():
    T, beta, s, w, push = 0.3, 1.4, 0.7, 1.1, np.array([2.0, 3.0, 0.4, 0.1])
    A = np.array([[0, 1, 0, 0], [s, -w, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0]])
    sampled = control.c2d(control.ss(A, [[0.0], [beta], [0], [0]], np.eye(4), 0), T, method="zoh")
    assert held_matrix(T, beta, s, w, push) == pytest.approx(sampled.A - sampled.B @ push[None, :], rel=1e-12)


def test_euler_integrals_are_sums_of_samples():
    matrix = held_matrix(0.3, 1.0, 0.7, 1.1, np.zeros(4), "euler")
    assert matrix[2:].tolist() == [[0.3, 0, 1, 0], [0, 0, 0.3, 1]]


def test_a_period_of_zero_is_the_continuous_loop():
    # λ⁴ + (w + βk2)λ³ + (βk1 − s)λ² + βk3λ + βk4
    gamma = coefficients(arb(0), arb(2), arb(0.5), arb(0.25), [arb(v) for v in (3, 4, 5, 6)])
    assert [middle(g) for g in gamma] == [12.0, 10.0, 5.5, 8.25]


def test_balls_hold_every_point_of_a_cell():
    cell = [(F(1, 10), F(11, 100)), (F(1), F(21, 20)), (F(1, 2), F(51, 100)), (F(1), F(101, 100))]
    push = [ball(F(v)) for v in (3, 4, 1, 1)]
    ends = [interval(*c) for c in cell]
    wide = conditions(ends[0], coefficients(*ends, push))
    for share in RNG.uniform(0, 1, (50, 4)):
        point = [ball(a + (b - a) * F(float(t))) for (a, b), t in zip(cell, share, strict=True)]
        sharp = conditions(point[0], coefficients(*point, push))
        assert all(w.overlaps(v) for w, v in zip(wide, sharp, strict=True))
        assert all(w.upper() >= v.mid() >= w.lower() for w, v in zip(wide, sharp, strict=True))


def test_another_integration_is_refused():
    with pytest.raises(ParameterError, match=r"integration must be one of exact, euler\. Received 'trapezoid'"):
        require_integration("trapezoid")
