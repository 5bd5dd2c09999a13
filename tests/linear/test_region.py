"""The smallest guaranteed gain, against Riccati equations."""

from fractions import Fraction as F

import control
import numpy as np
import pytest
from own.printed_examples import printed_row_example

import quakedesign as qd
from quakedesign.linear.linear_problem import LinearProblem
from quakedesign.linear.riccati import limiting_gains, smallest_gain, sound_bound

PROBLEM = printed_row_example().problem
RNG = np.random.default_rng(12)


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
        # necessary whatever the method: b·k1 above the largest chord s
        assert float(problem.sectors.authority) * least.slip > float(problem.sectors.slip[1])
