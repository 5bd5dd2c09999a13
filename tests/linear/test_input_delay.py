"""Wirtinger's constant in the proof of a held loop, against control coefficients that vary within a period."""

from fractions import Fraction as F

import pytest

import quakedesign as qd
from quakedesign.linear.linear_problem import LinearProblem
from quakedesign.linear.sampled_stability import FOUR_OVER_PI_SQUARED, decrease_form

PROBLEM = LinearProblem.of(qd.load_fault("real-fault"))
AUTHORITY = PROBLEM.sectors.authority
NOTHING = ((F(0),) * 4,) * 4
ALONE = ((F(0),) * 3, (F(0),) * 3, (F(0), F(0), F(1)))


def collected(step, course):
    """∫(δ² − c·T²·(Kẋ)²) over one period of the held loop x2' = −βb·x2(t_k), which the proof takes to be ≤ 0.

    K reads the slip rate alone, s = w = 0 and x2(t_k) = 1. β(t) is a polynomial of degree 1 in t/T, so that δ has
    degree 2 and Boole's rule is exact.
    """
    K, total = (F(0), F(1), F(0), F(0)), F(0)
    for j, weight in enumerate((7, 32, 12, 32, 7)):
        t = F(j, 4)
        beta, mean = course[0] + course[1] * t, course[0] * t + course[1] * t**2 / 2  # and ∫β/T up to t
        delta = AUTHORITY * step * mean
        x = (F(0), 1 - delta, F(0), F(0), F(0), F(0), delta)
        # minus the form of the proof, for P = 0 and W that weighs δu alone, at the vertex where β is now
        form = decrease_form(PROBLEM, K, step, (beta, F(0), F(0)), NOTHING, ALONE)
        total += F(weight, 90) * sum(a * form[i][k] * b for i, a in enumerate(x) for k, b in enumerate(x))
    return total


@pytest.mark.parametrize("step", [F(1, 10), F(1), F(7)])
def test_a_control_coefficient_that_fades_within_the_period_is_covered_and_nearly_sharp(step):
    # δ = bβT(2t/T − t²/T²) has ∫δ² = (2/5)T²∫δ'²: a constant below 2/5 would leave it out
    unit = (AUTHORITY * step) ** 2
    assert collected(step, (F(2), F(-2))) == unit * (F(8, 15) - FOUR_OVER_PI_SQUARED * F(4, 3)) < 0
    assert collected(step, (F(2), F(-2))) > -unit / 100


def test_no_other_linear_course_is_left_out():
    for first in range(-3, 4):
        for slope in range(-4, 5):
            assert collected(F(1), (F(first), F(slope))) <= 0


def test_the_constant_is_that_of_wirtinger_rounded_up():
    # δ = sin(πt/2T) attains (2/π)²; 103993/33102 is just below π
    assert F(103993, 33102) ** 2 * FOUR_OVER_PI_SQUARED >= 4
    assert F(104348, 33215) ** 2 * FOUR_OVER_PI_SQUARED < 4 * F(10001, 10000)
