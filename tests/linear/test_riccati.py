"""The Riccati design: bandwidth, bound on the uncertainty, guarantee."""

from dataclasses import replace
from fractions import Fraction as F

import control
import numpy as np
import pytest

import quakedesign as qd
from quakedesign.fault import Disturbance
from quakedesign.linear import linear_problem as m
from quakedesign.linear.linear_problem import LinearProblem, decreases
from quakedesign.linear.riccati import riccati_design, sound_bound, vertex_poles

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
