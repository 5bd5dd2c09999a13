"""Limits of the pressure: a region that never reaches them, back-calculation, a start without a jump."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import quakedesign as qd
from quakedesign.certificates.linear_premises import linear_premises, rest_pressure
from quakedesign.controllers import Signals
from quakedesign.controllers.elqr import PressureLimits
from quakedesign.errors import ParameterError
from quakedesign.synthesis.linear.analysis.saturation import (
    bumpless_start,
    pressure_limits,
    unsaturated_region,
    with_limits,
)
from quakedesign.synthesis.linear.design.riccati import riccati_design
from quakedesign.synthesis.linear.plant.problem import LinearProblem

REAL = qd.load_fault("real-fault")
DESIGN = riccati_design(REAL, bandwidth=3.0)
LAW, THETA = DESIGN.controller, DESIGN.theta
LIMITS = pressure_limits(REAL, 20e6)
a, v, i1, i2 = sp.symbols("a v i1 i2", real=True)
SIGNALS = Signals(slip=a, slip_rate=v, slip_error=a, slip_rate_error=v, integrals=(i1, i2))


def region():
    return unsaturated_region(REAL, DESIGN.controller, DESIGN.theta, LIMITS)


def test_on_the_region_the_pressure_reaches_its_limit_and_no_more():
    found = region()
    theta, K = np.array(found.theta, dtype=float), np.array([float(k) for k in DESIGN.controller.gains.values()])
    worst = np.linalg.solve(theta, K)
    worst *= np.sqrt(float(found.level) / (worst @ theta @ worst))
    assert K @ worst == pytest.approx(float(found.room), rel=1e-6)
    low, high = rest_pressure(REAL, (F(0), F("0.785")))
    assert found.room == min(low - LIMITS.lowest, LIMITS.highest - high)
    rng = np.random.default_rng(2)
    root = np.linalg.cholesky(theta)
    for _ in range(200):
        x = np.linalg.solve(root.T, rng.normal(size=4))
        x *= np.sqrt(float(found.level) / (x @ theta @ x))
        assert abs(K @ x) <= float(found.room) * (1 + 1e-9)
        assert all(abs(c) <= s * (1 + 1e-9) for c, s in zip(x, found.sizes, strict=True))


def test_membership_is_decided_exactly():
    found = region()
    assert found.holds((0, 0, 0, 0))
    assert found.holds((F(found.sizes[0]) * F(1, 10), 0, 0, 0))
    assert not found.holds((found.sizes[0] * 1.01, 0, 0, 0))


def test_runs_from_the_region_with_switched_plants_stay_inside_the_limits():
    found, problem = region(), LinearProblem.of(REAL)
    theta, K = np.array(found.theta, dtype=float), np.array([float(k) for k in DESIGN.controller.gains.values()])
    loops = [
        np.array(problem.loop(v, tuple(DESIGN.controller.gains.values())), dtype=float) for v in problem.vertices()
    ]
    rng, root = np.random.default_rng(4), np.linalg.cholesky(theta)
    for _ in range(5):
        x = np.linalg.solve(root.T, rng.normal(size=4))
        x *= np.sqrt(float(found.level) / (x @ theta @ x))
        for _ in range(30):
            A = loops[rng.integers(len(loops))]
            run = solve_ivp(lambda t, y, A=A: A @ y, (0, 0.3), x, rtol=1e-9, atol=1e-15)
            assert np.abs(K @ run.y).max() <= float(found.room) * (1 + 1e-6)
            x = run.y[:, -1]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: unsaturated_region(REAL, LAW, THETA), "limits of the pressure must be given"),
        (lambda: unsaturated_region(REAL, LAW, THETA, pressure_limits(REAL, 1e6)), "pressure at rest"),
        (
            lambda: unsaturated_region(REAL, LAW, tuple(tuple(-v for v in r) for r in THETA), LIMITS),
            "V must decrease",
        ),
        (lambda: pressure_limits(REAL, 0), "largest_withdrawal must be positive"),
        (lambda: pressure_limits(REAL, 1e6, margin=1), "margin between 0 and 1"),
        (lambda: PressureLimits(lowest=F(1), highest=F(2)), "limits must be lowest < 0 < highest"),
        (
            lambda: replace(DESIGN.controller, gains={**DESIGN.controller.gains, "k4": 0}, limits=LIMITS),
            "limits need k4 other than 0",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_is_one_clear_message(call, message):
    with pytest.raises(ParameterError, match=message):
        call()


def test_limits_cut_the_pressure_and_leave_the_loop_alone_inside():
    law = with_limits(DESIGN.controller, LIMITS, 5)
    plain, cut = DESIGN.controller.pressure(SIGNALS), law.pressure(SIGNALS)
    small, large = {a: F(1, 10**6), v: 0, i1: 0, i2: 0}, {a: 10, v: 0, i1: 0, i2: 0}
    assert cut.subs(small) == plain.subs(small)
    assert cut.subs(large) == sp.Rational(str(LIMITS.lowest))
    assert cut.subs({a: -10, v: 0, i1: 0, i2: 0}) == sp.Rational(99, 100) * 50_000_000
    inside = [rate.subs(small) for rate in law.integral_rates(SIGNALS)]
    assert inside == [sp.Rational(1, 10**6), 0]


def test_at_a_limit_both_integrals_come_back_with_the_double_pole():
    law = with_limits(DESIGN.controller, LIMITS, 5)
    rates = law.integral_rates(SIGNALS)
    held = [rate.replace(sp.Min, lambda *_: sp.Symbol("p")) for rate in rates]
    matrix = sp.Matrix([[rate.diff(x) for x in (i1, i2)] for rate in held])
    z = sp.Symbol("z")
    assert sp.expand(matrix.charpoly(z).as_expr() - (z + sp.Rational(1, 5)) ** 2) == 0


def test_back_calculation_shortens_the_recovery_from_a_large_step():
    # the linear plant at residual friction, started 40 mm off: 100 MPa are asked for
    def overshoot(law):
        run = sp.lambdify((a, v, i1, i2), [law.pressure(SIGNALS), *law.integral_rates(SIGNALS)])
        free = sp.lambdify((a, v, i1, i2), DESIGN.controller.pressure(SIGNALS))
        b = 0.2353 * 8e-8

        def motion(_, x):
            p = np.clip(free(*x), -20e6, 49.5e6)
            return [x[1], -0.48 * x[0] - 1.6 * x[1] + b * p, *run(*x)[1:]]

        found = solve_ivp(motion, (0, 60), [0.2, 0, 0, 0], max_step=0.05, rtol=1e-7, atol=1e-10)
        return -found.y[0].min()

    assert overshoot(with_limits(DESIGN.controller, LIMITS, "0.5")) < 0.7 * overshoot(DESIGN.controller)


def test_a_start_without_a_jump():
    law = bumpless_start(DESIGN.controller, "3e6", slip_error="1e-3", rate_error="1e-4")
    start = {a: sp.Rational(1, 1000), v: sp.Rational(1, 10**4), i1: 0, i2: 0}
    assert law.pressure(SIGNALS).subs(start) == 3_000_000
    assert law.integral_rates(SIGNALS) == DESIGN.controller.integral_rates(SIGNALS)


def test_the_premises_say_whether_rest_is_inside_the_limits():
    def names(law):
        return {p.name: p for p in linear_premises(REAL, law, None)}

    assert "pressure_at_rest" not in names(DESIGN.controller)
    assert names(with_limits(DESIGN.controller, LIMITS, 5))["pressure_at_rest"].holds
    tight = names(with_limits(DESIGN.controller, pressure_limits(REAL, 5e6), 5))["pressure_at_rest"]
    assert not tight.holds
    assert tight.ratio > 1


def test_a_law_with_limits_runs_in_the_simulation():
    law = with_limits(DESIGN.controller, pressure_limits(REAL, 20e6), 5)
    run = qd.simulate(REAL, law, duration=200.0, samples=50)
    plain = qd.simulate(REAL, DESIGN.controller, duration=200.0, samples=50)
    assert run.metrics.max_slip_error == pytest.approx(plain.metrics.max_slip_error, rel=1e-9)
