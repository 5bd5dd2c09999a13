"""The Riccati design: weights, specifications, guarantee."""

from dataclasses import replace
from fractions import Fraction as F

import control
import numpy as np
import pytest

import quakedesign as qd
from quakedesign.errors import ParameterError
from quakedesign.fault import Disturbance
from quakedesign.synthesis.linear.analysis.printed_theorem import decreases
from quakedesign.synthesis.linear.design.nondimensional import sound_bound, vertex_poles
from quakedesign.synthesis.linear.design.riccati import riccati_design
from quakedesign.synthesis.linear.design.specifications import Specifications, Weights
from quakedesign.synthesis.linear.plant import rational_matrices as m
from quakedesign.synthesis.linear.plant.problem import LinearProblem

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


def test_given_weights_solve_the_riccati_equation_of_python_control():
    Q0, R = [1e-6, 1e-6, 1e-6, 1e-6], 1e-12
    design = riccati_design(REAL, weights=Weights(Q0=Q0, R=R))
    problem = LinearProblem.of(REAL)
    b, g1 = float(problem.sectors.authority) * 1e6, float(problem.bounds[0]) / 1e6  # p in MPa
    A = np.array(problem.nominal(), dtype=float)
    K = control.lqr(A, [[0], [b], [0], [0]], np.diag(Q0) + np.diag([g1**2, 0, 0, 0]), [[1.0]], method="scipy")[0]
    assert design.K == pytest.approx(K[0] * 1e6, rel=1e-6)
    matrix = [["1e-6", 0, 0, "5e-7"], [0, "1e-6", 0, 0], [0, 0, "1e-6", 0], ["5e-7", 0, 0, "1e-6"]]
    other = riccati_design(REAL, weights=Weights(Q0=matrix, R="1e-12"))
    assert decreases(problem, values(other), other.theta)
    assert other.K != pytest.approx(design.K, rel=1e-9)


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


@pytest.mark.parametrize("fault", [REAL, BOTH], ids=["paper box", "both bounds"])
def test_a_settling_time_is_guaranteed_over_the_box(fault):
    design = riccati_design(fault, specifications=Specifications(settling_time=30))
    rate = F(design.rate)
    assert float(rate) == pytest.approx(np.log(50) / 30)
    assert decreases(LinearProblem.of(fault), values(design), design.theta, rate=rate * F(9999, 10000))
    poles = vertex_poles(LinearProblem.of(fault).sectors, values(design))
    assert max(z.real for z in poles) <= -design.rate


@pytest.mark.parametrize("fault", [REAL, BOTH], ids=["paper box", "both bounds"])
def test_a_largest_gain_is_met_and_used(fault):
    design = riccati_design(fault, specifications=Specifications(largest_gain="2e8", settling_time=60))
    k1 = float(design.controller.gains["k1"])
    assert k1 <= 2e8
    assert k1 == pytest.approx(2e8, rel=1e-6)
    assert decreases(LinearProblem.of(fault), values(design), design.theta, rate=F(design.rate) * F(999, 1000))


def test_a_gain_that_cannot_be_met_is_refused_with_the_least_one():
    with pytest.raises(ParameterError, match=r"largest_gain must be at least .* Pa/m for the guarantee"):
        riccati_design(REAL, specifications=Specifications(largest_gain=1e6))


def test_a_faster_integral_settles_sooner():
    slow, fast = (riccati_design(REAL, specifications=Specifications(integral_speed=w)) for w in (0.02, 2.0))
    assert max(slow.E.real) == pytest.approx(-0.02, rel=0.5)
    assert max(fast.E.real) < 10 * max(slow.E.real)
    assert fast.controller.gains["k4"] > slow.controller.gains["k4"]


def test_the_bandwidth_is_met_at_the_worst_vertex():
    design = riccati_design(REAL, bandwidth=4.0)
    assert design.fastest_pole == pytest.approx(4.0, rel=1e-5)
    assert riccati_design(REAL, bandwidth=4.0, feedback="state").controller.feedback == "state"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Weights(Q0=[1, 1, 0, 1], R=1), "Q0 must be symmetric and positive definite"),
        (lambda: Weights(Q0=[1, 1, 1], R=1), "Q0 must be symmetric and positive definite"),
        (lambda: Weights(Q0=[[1, 2, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], R=1), "Q0 must be symmetric"),
        (lambda: Weights(Q0=[1, 1, 1, 1], R=0), "R must be positive"),
        (lambda: Specifications(settling_time=-1), "settling_time must be positive"),
        (lambda: Specifications(integral_speed="0"), "integral_speed must be positive"),
    ],
)
def test_wishes_that_make_no_sense_are_one_clear_message(make, message):
    with pytest.raises(ParameterError, match=message):
        make()


def test_a_fault_without_uncertainty_needs_no_bound():
    law = type(REAL.friction)
    fault = replace(REAL, friction=law(residual=0.3, drop=0.0, critical_slip=0.1)).with_disturbance(Disturbance())
    design = riccati_design(fault)
    assert np.diag(design.Q) == pytest.approx([1, 0.01, 1, 1])
    assert decreases(LinearProblem.of(fault), values(design), design.theta)
