"""Sampled verdicts against the eigenvalues of the sampled loop (ERRATA 22)."""

from dataclasses import replace
from fractions import Fraction as F

import control
import mpmath
import numpy as np
import pytest

import quakedesign as qd
from quakedesign.fault import Disturbance
from quakedesign.linear.linear_problem import LinearProblem
from quakedesign.linear.riccati import riccati_design
from quakedesign.linear.sampled_stability import HeldPoles, poles

CASES = {"lab-fault": (("1e-3", False), ("0.5e-3", True)), "real-fault": (("0.184", False), ("0.092", True))}


def loop_of(name):
    return HeldPoles(LinearProblem.of(qd.load_fault(name)), tuple(qd.published(name)["elqr"].gains.values()))


def radius(loop, step, beta, s, w):
    """Spectral radius through python-control, the integrals summed over the samples."""
    b, row = float(loop.problem.sectors.authority), np.array([[float(k) for k in loop.gains]])
    plant = control.ss([[0, 1], [s, -w]], [[0.0], [b * beta]], np.eye(2), 0)
    sampled = control.c2d(plant, step, method="zoh")
    sums = [[step, 0, 1, 0], [0, 0, step, 1]]
    period = np.vstack([np.hstack([sampled.A, np.zeros((2, 2))]) - sampled.B @ row, sums])
    return np.abs(np.linalg.eigvals(period)).max()


@pytest.mark.parametrize(("name", "step", "stable"), [(n, *case) for n, cases in CASES.items() for case in cases])
def test_the_published_gains_agree_with_the_eigenvalues_of_the_sampled_loop(name, step, stable):
    loop = loop_of(name)
    corners = [tuple(float(v) for v in vertex) for vertex in loop.problem.vertices()]
    largest = max(radius(loop, float(step), *corner) for corner in corners)
    assert loop.radius(F(step)) == pytest.approx(largest, rel=1e-6)
    witness = loop.unstable(F(step))
    assert (witness is None) == stable
    assert stable or radius(loop, float(step), *(float(v) for v in witness)) > 1


@pytest.mark.parametrize(("name", "limit"), [("lab-fault", 0.699e-3), ("real-fault", 0.128)])
def test_the_largest_period_is_just_below_the_limit_of_the_errata(name, limit):
    # the limit is that of static friction at zero pressure; the box admits a larger slope
    loop = loop_of(name)
    longest, refuted = loop.limit()
    assert 0.95 * limit < float(longest) < float(refuted) < 1.005 * limit
    assert float(refuted / longest) < 1.02
    assert loop.radius(refuted) > 1
    assert loop.unstable(refuted) is not None
    for step in np.linspace(0.02, 1, 25) * float(longest):
        assert loop.radius(F(step)) < 1


def test_a_loop_that_is_unstable_itself_has_no_period():
    loop = loop_of("real-fault")
    assert replace(loop, gains=tuple(-k for k in loop.gains)).limit() is None


def test_a_loop_that_integrates_only_once_keeps_a_pole_at_one():
    loop = loop_of("real-fault")
    assert replace(loop, gains=(*loop.gains[:3], F(0))).unstable(F("0.01")) is not None


def test_a_loop_without_a_longest_period_is_followed_as_far_as_it_was_tried():
    # overdamped a millionfold: no tried period is refuted, which must not read as "no period is stable"
    fault = qd.load_fault("real-fault")
    fault = replace(fault, damping=fault.damping * 1e6)
    loop = HeldPoles(LinearProblem.of(fault), tuple(riccati_design(fault).controller.gains.values()))
    longest, refuted = loop.limit()
    assert refuted is None
    assert longest > 10 * F(fault.sampling_time)
    assert all(loop.radius(F(step)) < 1 for step in np.geomspace(1e-3, 1, 12) * float(longest))


def test_a_plant_that_grows_far_within_a_period_is_refuted():
    fault = qd.load_fault("real-fault").with_disturbance(Disturbance(rate_growth=1e3))
    loop = HeldPoles(LinearProblem.of(fault), tuple(riccati_design(fault).controller.gains.values()))
    witness = loop.unstable(F("0.184"))
    with mpmath.workdps(250):  # independent: the product of the four poles
        assert abs(mpmath.det(held(witness, loop, mpmath.mpf("0.184")))) > 1


def test_the_poles_are_those_of_a_period_in_mpmath():
    loop = loop_of("lab-fault")
    corner = loop.problem.vertices()[-1]
    with mpmath.workdps(60):
        expected = mpmath.eig(held(corner, loop, mpmath.mpf("0.0007")), left=False, right=False)
        found = loop.at(F("0.0007"))[corner]
        assert sorted(float(abs(z).mid()) for z in found) == pytest.approx(
            sorted(float(abs(z)) for z in expected), rel=1e-12
        )


def test_a_period_of_almost_nothing_leaves_all_poles_at_one():
    loop = loop_of("lab-fault")
    found = poles(loop.problem, loop.gains, F(1, 10**30), loop.problem.vertices()[0])
    assert all(abs(float(abs(z).mid()) - 1) < 1e-15 for z in found)


def held(vertex, loop, step):
    """Matrix of a period from the exponential of plant and input, at the digits in force."""
    beta, s, w = (mpmath.mpf(v.numerator) / v.denominator for v in vertex)
    push = [mpmath.mpf(v.numerator) / v.denominator for v in (loop.problem.sectors.authority * k for k in loop.gains)]
    whole = mpmath.expm(mpmath.matrix([[0, 1, 0], [s, -w, beta], [0, 0, 0]]) * step, method="taylor")
    rows = [[whole[i, j] - whole[i, 2] * push[j] if j < 2 else -whole[i, 2] * push[j] for j in range(4)]
            for i in range(2)]  # fmt: skip
    return mpmath.matrix([*rows, [step, 0, 1, 0], [0, 0, step, 1]])
