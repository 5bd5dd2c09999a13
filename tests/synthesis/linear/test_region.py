"""For which Q and R the guarantee holds, against Riccati equations and against direct checks."""

from fractions import Fraction as F

import control
import cvxpy as cp
import numpy as np
import pytest

import quakedesign as qd
from quakedesign.errors import ParameterError
from quakedesign.synthesis.linear.analysis.printed_theorem import printed_row_example
from quakedesign.synthesis.linear.design.admissible_weights import (
    guaranteed,
    limiting_gains,
    riccati_bounds,
    riccati_inequality,
    smallest_gain,
)
from quakedesign.synthesis.linear.design.nondimensional import sound_bound
from quakedesign.synthesis.linear.plant import rational_matrices as m
from quakedesign.synthesis.linear.plant.problem import LinearProblem

PROBLEM = printed_row_example().problem
RNG = np.random.default_rng(12)


def test_a_diagonal_q_has_a_closed_form():
    # Q ≥ R·W for some split if and only if R(g1²/q1 + g2²/q2) ≤ 1
    Q = m.diagonal((F(1), F(2), F(3), F(4)))
    found = riccati_bounds(PROBLEM, Q)
    assert found.limit == pytest.approx(1 / (1 / 1 + 1 / 2), rel=1e-12)
    assert found.weight < F(2, 3) < found.weight * F(1_000_003, 1_000_000)
    assert guaranteed(PROBLEM, Q, found.weight, found.split)
    assert not any(guaranteed(PROBLEM, Q, F(2, 3), F(n, 100)) for n in range(1, 100))


def test_a_full_q_agrees_with_a_scan_over_the_split():
    for _ in range(10):
        root = tuple(tuple(F(int(v), 5) for v in row) for row in RNG.integers(-9, 9, (4, 4)))
        Q = m.total(m.product(m.transpose(root), root), m.diagonal((F(1, 10),) * 4))
        found = riccati_bounds(PROBLEM, Q)
        assert guaranteed(PROBLEM, Q, found.weight, found.split)
        floats = np.array(Q, dtype=float)

        def worst(w, floats=floats):
            W = np.array(sound_bound(PROBLEM.bounds, F(w)), dtype=float)
            return 1 / np.linalg.eigvals(np.linalg.solve(floats, W)).real.max()

        scanned = max(worst(w) for w in 1 / (1 + np.exp(-np.linspace(-8, 8, 801))))
        assert found.limit == pytest.approx(scanned, rel=2e-4)


def test_the_matrix_inequality_has_the_value_of_its_closed_form():
    fault = LinearProblem.of(qd.load_fault("real-fault", box="ten-percent"))
    for problem in (PROBLEM, fault.nondimensional(fault.scales())):
        for _ in range(3):
            root = tuple(tuple(F(int(v), 5) for v in row) for row in RNG.integers(-9, 9, (4, 4)))
            Q = m.total(m.product(m.transpose(root), root), m.diagonal((F(1, 10),) * 4))
            stated, closed = riccati_inequality(problem, Q), riccati_bounds(problem, Q)
            assert stated.solve(solver="CLARABEL") == pytest.approx(closed.limit, rel=1e-6)
            if all(problem.bounds):
                parts = stated.var_dict["parts"].value
                assert stated.value / parts[0] == pytest.approx(float(closed.split), rel=1e-4)


def test_the_matrix_inequality_takes_further_conditions():
    # a weight of at most 1/10, and a split of 1/2: Q ≥ 2R·diag(g1², g2², 0, 0)
    stated = riccati_inequality(PROBLEM, m.diagonal((F(1), F(2), F(3), F(4))))
    weight, parts = (stated.var_dict[name] for name in ("weight", "parts"))
    for more, value in ((weight <= 0.1, 0.1), (parts == 2 * weight, 0.5)):
        assert cp.Problem(stated.objective, [*stated.constraints, more]).solve(solver="CLARABEL") == pytest.approx(
            value
        )


def test_every_smaller_weight_gives_gains_that_hold():
    Q = m.diagonal((F(1), F(1, 2), F(1, 10), F(1, 100)))
    top = riccati_bounds(PROBLEM, Q).weight
    A = np.array(PROBLEM.nominal(), dtype=float)
    for share in (1.0, 0.3, 0.01):
        R = float(top) * share
        K, S, _ = control.lqr(A, [[0.0], [1], [0], [0]], np.array(Q, dtype=float), [[R]], method="scipy")
        for vertex in PROBLEM.vertices():
            loop = np.array(PROBLEM.loop(vertex, [F(float(k)) for k in K[0]]), dtype=float)
            assert np.linalg.eigvalsh(-(loop.T @ S + S @ loop)).min() > -1e-9 * np.abs(S).max()


def test_one_bound_alone_and_none():
    fault = LinearProblem.of(qd.load_fault("real-fault"))
    inside = fault.nondimensional(fault.scales())
    Q = m.diagonal((F(1),) * 4)
    assert riccati_bounds(inside, Q).limit == pytest.approx(1 / float(inside.bounds[0]) ** 2)
    with pytest.raises(ParameterError, match="Q must be positive definite"):
        riccati_bounds(inside, m.diagonal((F(1), F(1), F(0), F(1))))


@pytest.mark.parametrize("split", [0.2, 0.5, 0.9])
def test_the_limiting_gains_are_those_of_the_riccati_equation_without_integrals(split):
    k1, k2 = limiting_gains(PROBLEM, split)
    W = np.array(sound_bound(PROBLEM.bounds, F(split)), dtype=float)[:2, :2]
    K = control.lqr(np.array([[0, 1], [-1, -0.1]]), [[0.0], [1]], W, [[1.0]], method="scipy")[0]
    assert [k1, k2] == pytest.approx(K[0].tolist(), rel=1e-9)


def test_the_smallest_gain_is_approached_and_never_beaten():
    for box in ("paper", "ten-percent"):
        fault = qd.load_fault("real-fault", box=box)
        problem = LinearProblem.of(fault)
        least = smallest_gain(problem)
        inside = problem.nondimensional(problem.scales())
        size = np.hypot(
            *(float(v) for v in problem.scales().gains_inside((F(least.slip), F(least.rate), F(0), F(0)))[:2])
        )
        A, B = np.array(inside.nominal(), dtype=float), np.array([[0.0], [1], [0], [0]])
        near = []
        for split in (least.split, 0.3, 0.7):
            W = np.array(sound_bound(inside.bounds, F(split)), dtype=float)
            for share in (1e-6, 1e-2, 1.0):
                K = control.lqr(A, B, share * np.eye(4) + W, [[1.0]], method="scipy")[0][0]
                near.append(np.hypot(K[0], K[1]))
        assert min(near) >= size * (1 - 1e-6)
        assert min(near) == pytest.approx(size, rel=0.05)
        assert least.least_slip <= least.slip * (1 + 1e-12)
        assert least.least_rate <= least.rate * (1 + 1e-12)
        # necessary whatever the method: b·k1 above the largest chord s
        assert float(problem.sectors.authority) * least.least_slip > float(problem.sectors.slip[1])
