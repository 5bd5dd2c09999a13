"""Limits of the pressure of an e-LQR: back-calculation of its integrals, and what they leave alone."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import quakedesign as qd
from quakedesign.errors import ParameterError
from quakedesign.laws import Signals
from quakedesign.laws.elqr import PressureLimits
from quakedesign.linear.riccati import riccati_design
from quakedesign.lyapunov.exact.premises import linear_premises

REAL = qd.load_fault("real-fault")
DESIGN = riccati_design(REAL, bandwidth=3.0)
LIMITS = PressureLimits(lowest=F(-20_000_000), highest=F(49_500_000))
a, v, i1, i2 = sp.symbols("a v i1 i2", real=True)
SIGNALS = Signals(slip=a, slip_rate=v, slip_error=a, slip_rate_error=v, integrals=(i1, i2))


def limited(limits, recovery_time):
    return replace(DESIGN.controller, limits=replace(limits, recovery_time=F(recovery_time)))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: PressureLimits(lowest=F(1), highest=F(2)), "limits must be lowest < 0 < highest"),
        (
            lambda: replace(DESIGN.controller, gains={**DESIGN.controller.gains, "k4": 0}, limits=LIMITS),
            "k4 must not be 0 in a law with limits",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_is_one_clear_message(call, message):
    with pytest.raises(ParameterError, match=message):
        call()


def test_limits_cut_the_pressure_and_leave_the_loop_alone_inside():
    law = limited(LIMITS, 5)
    plain, cut = DESIGN.controller.pressure(SIGNALS), law.pressure(SIGNALS)
    small, large = {a: F(1, 10**6), v: 0, i1: 0, i2: 0}, {a: 10, v: 0, i1: 0, i2: 0}
    assert cut.subs(small) == plain.subs(small)
    assert cut.subs(large) == sp.Rational(str(LIMITS.lowest))
    assert cut.subs({a: -10, v: 0, i1: 0, i2: 0}) == sp.Rational(99, 100) * 50_000_000
    inside = [rate.subs(small) for rate in law.integral_rates(SIGNALS)]
    assert inside == [sp.Rational(1, 10**6), 0]


def test_at_a_limit_both_integrals_come_back_with_the_double_pole():
    law = limited(LIMITS, 5)
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

    assert overshoot(limited(LIMITS, F(1, 2))) < 0.7 * overshoot(DESIGN.controller)


def test_the_premises_say_whether_rest_is_inside_the_limits():
    def names(law):
        return {p.name: p for p in linear_premises(REAL, law, None)}

    assert "pressure_at_rest" not in names(DESIGN.controller)
    assert names(limited(LIMITS, 5))["pressure_at_rest"].holds
    tight = names(limited(replace(LIMITS, lowest=F(-5_000_000)), 5))["pressure_at_rest"]
    assert not tight.holds
    assert tight.ratio > 1


def test_a_law_with_limits_runs_in_the_simulation():
    law = limited(LIMITS, 5)
    run = qd.simulate(REAL, law, duration=200.0, samples=50)
    plain = qd.simulate(REAL, DESIGN.controller, duration=200.0, samples=50)
    assert run.metrics.max_slip_error == pytest.approx(plain.metrics.max_slip_error, rel=1e-9)
