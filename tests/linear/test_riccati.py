"""The Riccati design: bandwidth, bound on the uncertainty, guarantee."""

import decimal
import math
from dataclasses import replace
from fractions import Fraction as F

import control
import numpy as np
import pytest

import quakedesign as qd
from quakedesign.fault import Disturbance
from quakedesign.linear import linear_problem as m
from quakedesign.linear import riccati
from quakedesign.linear.linear_problem import LinearProblem, decreases
from quakedesign.linear.riccati import limiting_gains, riccati_design, smallest_gain, sound_bound, vertex_poles

REAL = qd.load_fault("real-fault")
BOTH = qd.load_fault("real-fault", box="ten-percent").with_disturbance(Disturbance(slip_growth=1e-3, rate_growth=0.05))


def values(design):
    return tuple(design.controller.gains.values())


@pytest.mark.parametrize("fault", [REAL, BOTH, qd.load_fault("lab-fault")], ids=["paper box", "both bounds", "lab"])
def test_the_default_design_is_proved_exactly(fault):
    design = riccati_design(fault)
    assert design.residual < 1e-25
    assert decreases(LinearProblem.of(fault), values(design), design.theta)
    assert max(z.real for z in vertex_poles(LinearProblem.of(fault).sectors, values(design))) < 0


def test_the_bound_on_the_uncertainty_is_met_by_every_state():
    # ERRATA 7: h² ≤ xᵀWx must hold for |h| ≤ g1|x1| + g2|x2|, also where g1x1 + g2x2 = 0
    g1, g2 = F(3, 2), F(2, 5)
    W = np.array(sound_bound((g1, g2), F(37, 100)), dtype=float)
    for x1, x2 in [*np.random.default_rng(1).normal(size=(500, 2)), (1.0, -float(g1 / g2))]:
        x = np.array([x1, x2, 0, 0])
        assert (float(g1) * abs(x1) + float(g2) * abs(x2)) ** 2 <= x @ W @ x * (1 + 1e-12)
    assert sound_bound((g1, F(0)), F(1, 2)) == m.diagonal((g1**2, F(0), F(0), F(0)))


def test_the_design_solves_the_riccati_equation_of_python_control():
    design, problem = riccati_design(REAL), LinearProblem.of(REAL)
    inside = problem.nondimensional(problem.scales(REAL.reference.target_slip))
    bound = np.array(sound_bound(inside.bounds, F(design.split)), dtype=float)
    A, B, Q = np.array(inside.nominal(), dtype=float), [[0], [1], [0], [0]], np.diag([1, 0.01, 1, 1])
    K = control.lqr(A, B, Q + design.R * bound, [[design.R]], method="scipy")[0]
    assert design.K == pytest.approx(problem.scales(REAL.reference.target_slip).gains_outside(K[0]), rel=1e-6)


def test_the_split_is_the_one_of_the_smallest_cost():
    design = riccati_design(BOTH)
    problem = LinearProblem.of(BOTH)
    inside = problem.nondimensional(problem.scales(BOTH.reference.target_slip))
    A, B = np.array(inside.nominal(), dtype=float), np.array([[0.0], [1], [0], [0]])

    def cost(split):
        W = np.array(sound_bound(inside.bounds, F(split)), dtype=float)
        return control.lqr(A, B, np.diag([1, 0.01, 1, 1]) + design.R * W, [[design.R]], method="scipy")[1].trace()

    assert 0.01 < design.split < 0.99
    assert cost(design.split) <= min(cost(w) for w in np.linspace(0.02, 0.98, 49)) * (1 + 1e-6)


def test_the_bandwidth_is_met_at_the_worst_vertex():
    design = riccati_design(REAL, bandwidth=4.0)
    assert design.fastest_pole == pytest.approx(4.0, rel=1e-5)


def test_a_fault_without_uncertainty_needs_no_bound():
    law = type(REAL.friction)
    fault = replace(REAL, friction=law(residual=0.3, drop=0.0, critical_slip=0.1)).with_disturbance(Disturbance())
    design = riccati_design(fault)
    assert np.diag(design.Q) == pytest.approx([1, 0.01, 1, 1])
    assert decreases(LinearProblem.of(fault), values(design), design.theta)


def test_the_poles_of_a_design_are_those_of_its_nominal_loop():
    design, problem = riccati_design(REAL), LinearProblem.of(REAL)
    k, eta, b = map(float, (problem.stiffness, problem.damping, problem.sectors.authority))
    row = np.array([-k, -eta, 0, 0]) - b * np.array(values(design), dtype=float)
    loop = np.array([[0, 1, 0, 0], row, [1, 0, 0, 0], [0, 0, 1, 0]])
    assert np.sort_complex(design.E) == pytest.approx(np.sort_complex(np.linalg.eigvals(loop)), rel=1e-6)


@pytest.mark.parametrize(("bandwidth", "weight"), [(1e12, 1e-14), (1e-6, 1.0)])
def test_a_bandwidth_out_of_reach_gives_the_nearest_weight(bandwidth, weight):
    assert riccati_design(REAL, bandwidth=bandwidth).R == weight


def test_the_split_of_the_smallest_gain_is_the_best_of_a_grid():
    problem = LinearProblem.of(BOTH)
    least, pace = smallest_gain(problem), math.sqrt(problem.stiffness)

    def size(split):
        slip, rate = limiting_gains(problem, split)
        return math.hypot(slip, pace * rate)

    assert (least.slip, least.rate) == limiting_gains(problem, least.split)
    assert size(least.split) <= min(size(w) for w in np.linspace(0.01, 0.99, 99))
    assert smallest_gain(LinearProblem.of(REAL)).split == 0.5  # one of the bounds is 0: no split


@pytest.mark.parametrize(("proved", "digits"), [((10, 17), 10), ((17,), 17), ((), 10)])
def test_gains_have_ten_digits_unless_only_more_are_proved(monkeypatch, proved, digits):
    def rounded(value, count):  # by the context of the standard library
        context = decimal.Context(prec=count, rounding=decimal.ROUND_HALF_EVEN)
        return F(context.divide(decimal.Decimal(value.numerator), decimal.Decimal(value.denominator)))

    gains = (F(2, 3), F(-123456, 7), F(0), F(1, 10**12 + 7))
    by_count = {count: tuple(rounded(g, count) for g in gains) for count in (10, 17)}
    accepted = [by_count[count] for count in proved]
    monkeypatch.setattr(riccati, "decreases", lambda problem, decimals, theta: decimals in accepted)
    assert riccati._rounded_gains(None, gains, ()) == by_count[digits]
