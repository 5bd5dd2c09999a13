"""Programmes with limits against optima known in closed form."""

import numpy as np
import pytest

from quakedesign.lyapunov.exact.obligations import Obligation, statement_of
from quakedesign.sos.solve.joint import DecisionBounds, Demand, JointProgram

SQUARE = {(2,): 1.0}
TEMPLATE = statement_of(Obligation("", {(2,): 1}), "reals")


def demand(*parts):
    """c·x² must be non-negative: a linear inequality in the decisions."""
    return Demand(template=TEMPLATE, parts=[{(2,): p} for p in parts], margin=SQUARE)


def largest(demands, fixed, limits):
    found = JointProgram(demands).solve(demands, [{(2,): c} for c in fixed], limits)
    return found.margin, found.decision


@pytest.mark.parametrize(("radius", "bound", "x"), [(2.0, 5.0, 2.0), (2.0, 0.7, 0.7), (0.5, -0.2, -0.2)])
def test_a_box_and_a_limit(radius, bound, x):
    margin, decision = largest([demand(1.0)], [-3.0], DecisionBounds(radii=[radius], rows=[[1.0]], bounds=[bound]))
    assert margin == pytest.approx(x - 3, abs=1e-6)
    assert decision == pytest.approx([x], abs=1e-5)


def test_shares_bound_the_sum_of_sizes():
    # max min(3x, 2y) with |x| + |y|/2 ≤ 1: 3x = 2y, x + 3x/4 = 1
    demands = [demand(3.0, 0.0), demand(0.0, 2.0)]
    margin, decision = largest(demands, [0.0, 0.0], DecisionBounds(radii=[1.0, 1.0], shares=[1.0, 0.5]))
    assert decision == pytest.approx([4 / 7, 6 / 7], abs=1e-6)
    assert margin == pytest.approx(12 / 7, abs=1e-6)


def test_random_linear_programmes_agree_with_another_solver():
    from scipy.optimize import linprog

    rng = np.random.default_rng(3)
    for _ in range(10):
        P, c, rows = rng.normal(size=(4, 3)), rng.normal(size=4), rng.normal(size=(2, 3))
        bounds, shares = rng.uniform(0.1, 1, 2), rng.uniform(0.5, 2, 2)
        demands = [demand(*p) for p in P]
        limits = DecisionBounds(
            radii=[9.0, 9.0, 0.8], rows=rows.tolist(), bounds=bounds.tolist(), shares=shares.tolist()
        )
        margin, _ = largest(demands, c, limits)
        # variables x⁺, x⁻ of three decisions and t
        split = np.hstack([-P, P, np.ones((4, 1))])
        more = np.hstack([rows, -rows, np.zeros((2, 1))])
        total = np.array([[*shares, 0, *shares, 0, 0]])
        found = linprog(
            [0] * 6 + [-1],
            A_ub=np.vstack([split, more, total]),
            b_ub=[*c, *bounds, 1.0],
            bounds=[(0, None), (0, None), (0, 0.8)] * 2 + [(None, None)],
        )
        assert margin == pytest.approx(-found.fun, abs=1e-6)
