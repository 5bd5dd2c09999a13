"""One step of the differentiator against mpmath, against the paper's equations typed in, and under scaling."""

import math

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from thinned import few

from quakedesign.loop.sensing import Differentiator
from quakedesign.loop.sensing.differentiator import TABLES, lag_free

ORDERS = [(1, 0), (2, 0), (1, 2), (2, 2), (3, 1), (5, 2), (8, 4), (12, 0), (1, 11)]


def stepper(d):
    memory, slip = ca.SX.sym("memory", d.size), ca.SX.sym("slip")
    estimates, after = d.estimate([*map(ca.SX, d.numbers)], ca.vertsplit(memory), slip)
    function = ca.Function("d", [memory, slip], [ca.vertcat(*after), ca.vertcat(*estimates)])
    return lambda y, x: [part.full().ravel() for part in function(y, x)]


def backward_euler(d, y, x):
    """States after an implicit step, from the inclusion solved by bisection at 60 digits."""
    size, filters, step = d.size, d.filter_order, mp.mpf(d.step)
    gains = [mp.mpf(d.table[size - j]) * mp.mpf(d.bound) ** (mp.mpf(j) / size) for j in range(1, size + 1)]

    def ends(s, sign):
        found = [mp.mpf(0)] * (size + 1)
        for j in range(size, 0, -1):
            power = sign if j == size else mp.sign(s) * abs(s) ** (mp.mpf(size - j) / size)
            drift = found[j] - (x if j == filters else 0) - gains[j - 1] * power
            found[j - 1] = mp.mpf(y[j - 1]) + step * drift
        return found[:size]

    def residual(s, sign):
        return (ends(s, sign)[0] - (0 if filters else x)) - s

    top = residual(mp.mpf(0), mp.mpf(1)), residual(mp.mpf(0), mp.mpf(-1))
    if top[0] <= 0 <= top[1]:
        return ends(mp.mpf(0), 1 - 2 * top[0] / (top[0] - top[1]))
    sign = mp.sign(top[0] if top[0] > 0 else top[1])
    low, high = mp.mpf(0), abs(residual(mp.mpf(0), sign))
    for _ in range(250):
        middle = (low + high) / 2
        low, high = (middle, high) if residual(sign * middle, sign) * sign > 0 else (low, middle)
    return ends(sign * low, sign)


@pytest.mark.parametrize(("order", "filters"), ORDERS)
@few("size", [0.3, 3e6], every=2)
def test_the_implicit_step_solves_its_inclusion(order, filters, size):
    d = Differentiator(bound=3.0, step=0.25, order=order, filter_order=filters)
    random = np.random.default_rng(order + 20 * filters)
    with mp.workdps(60):
        for _ in range(2):
            y = random.normal(size=d.size) * size * d.step ** np.arange(d.size)[::-1]
            x = random.normal() * size
            after, _ = stepper(d)(y, x)
            wanted = backward_euler(d, y, mp.mpf(x))
            scale = size * max(d.table) * d.step ** -float(d.size)
            assert [float(w) for w in wanted] == pytest.approx(list(after), rel=1e-9, abs=1e-15 * scale)


def test_the_explicit_step_is_that_of_the_paper():
    d = Differentiator(bound=7.0, step=1e-3, order=2, filter_order=2, discretisation="euler")
    w1, w2, z1, z2, z3, x = -0.2, 0.3, 0.05, -1.1, 4.0, 0.07
    root = lambda a: math.copysign(abs(w1) ** a, w1)  # noqa: E731
    rates = [
        -5 * 7 ** (1 / 5) * root(4 / 5) + w2,
        -10.03 * 7 ** (2 / 5) * root(3 / 5) + z1 - x,
        -9.3 * 7 ** (3 / 5) * root(2 / 5) + z2,
        -4.57 * 7 ** (4 / 5) * root(1 / 5) + z3,
        -1.1 * 7 * math.copysign(1, w1),
    ]
    state = [w1, w2, z1, z2, z3]
    after, estimates = stepper(d)(state, x)
    assert list(after) == pytest.approx([s + 1e-3 * r for s, r in zip(state, rates, strict=True)], rel=1e-14)
    assert list(estimates) == [z1, z2, z3]
    homogeneous, _ = stepper(Differentiator(**{**settings(d), "discretisation": "homogeneous"}))(state, x)
    assert homogeneous - after == pytest.approx([0, 0, 1e-6 / 2 * z3, 0, 0], abs=1e-17)


def settings(d):
    names = ("bound", "step", "order", "filter_order", "discretisation")
    return {name: getattr(d, name) for name in names}


@pytest.mark.parametrize("discretisation", ["euler", "homogeneous", "implicit"])
@pytest.mark.parametrize(("order", "filters"), ORDERS)
def test_time_stretched_by_two_gives_the_same_digits_times_powers_of_two(order, filters, discretisation):
    """Weights N, N − 1 … 1 of the states and degree −1, exactly, since powers of two are exact."""
    slow = Differentiator(bound=1.0, step=2.0, order=order, filter_order=filters, discretisation=discretisation)
    fast = Differentiator(bound=1.0, step=1.0, order=order, filter_order=filters, discretisation=discretisation)
    weights = 2.0 ** np.arange(fast.size, 0, -1)
    y, x = np.random.default_rng(0).normal(size=fast.size), 0.3
    now, _ = stepper(fast)(y, x)
    then, _ = stepper(slow)(y * weights, x * weights[filters])
    tolerance = 0 if discretisation == "implicit" and fast.size < 3 else 1e-13
    assert then / weights == pytest.approx(now, rel=tolerance, abs=1e-13 * max(abs(now)))


@pytest.mark.parametrize("discretisation", ["euler", "homogeneous", "implicit"])
def test_the_sign_of_zero_is_zero(discretisation):
    d = Differentiator(bound=1e3, step=1e-3, order=2, filter_order=2, discretisation=discretisation)
    after, estimates = stepper(d)([0.0] * 5, 0.0)
    assert not after.any()
    assert not estimates.any()


@pytest.mark.parametrize("order", [1, 2, 6])
def test_the_lag_is_taken_out_by_powers_of_the_logarithm(order):
    x = sp.Symbol("x")
    for i, row in enumerate(lag_free(order)):
        powers = sp.series((-sp.log(1 - x)) ** i, x, 0, order + 1).removeO() if i else sp.Integer(1)
        wanted = sp.Poly(powers, x)
        assert [sp.Rational(v.numerator, v.denominator) for v in row] == [
            wanted.coeff_monomial(x**j) for j in range(i, order + 1)
        ]


@pytest.mark.parametrize("order", range(1, 13))
def test_every_row_of_the_table_converges_on_polynomials(order):
    """Exact to rounding after a finite time from wrong states, with as much filtering as differentiation."""
    d = Differentiator(bound=1.0, step=1.0, order=order - order // 2, filter_order=order // 2)
    assert d.table == TABLES[order]
    step, slope = stepper(d), 0.01
    y = np.zeros(d.size)
    y[d.filter_order :] = 0.5 / np.arange(1, d.order + 2)
    errors = []
    for sample in range(120):
        y, estimates = step(y, slope * sample)
        errors.append(max(abs(estimates[0] - slope * sample), abs(estimates[1] - slope)))
    assert errors[0] > 1e-2
    assert max(errors[-20:]) < 1e-13
