"""Sampled verdicts against the eigenvalues of the sampled loop (ERRATA 22)."""

from dataclasses import replace
from fractions import Fraction as F

import control
import mpmath
import numpy as np
import pytest

import quakedesign as qd
from quakedesign.certificates import Verdict
from quakedesign.errors import ParameterError
from quakedesign.fault import Disturbance
from quakedesign.synthesis.linear.design.riccati import riccati_design
from quakedesign.synthesis.linear.plant.problem import LinearProblem
from quakedesign.synthesis.linear.sampled.stability import hold_verdict, largest_radius, largest_step

CASES = {"lab-fault": (("1e-3", False), ("0.5e-3", True)), "real-fault": (("0.184", False), ("0.092", True))}


def loop_of(name):
    return LinearProblem.of(qd.load_fault(name)), tuple(qd.published(name)["elqr"].gains.values())


def radius(problem, gains, step, beta, s, w):
    """Spectral radius through python-control."""
    A = np.array([[0, 1, 0, 0], [s, -w, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0]], dtype=float)
    b = float(problem.sectors.authority) * beta
    sampled = control.c2d(control.ss(A, [[0.0], [b], [0], [0]], np.eye(4), 0), step, method="zoh")
    return np.abs(np.linalg.eigvals(sampled.A - sampled.B @ np.array([[float(k) for k in gains]]))).max()


@pytest.mark.parametrize(("name", "step", "stable"), [(n, *case) for n, cases in CASES.items() for case in cases])
def test_the_published_gains_agree_with_the_eigenvalues_of_the_sampled_loop(name, step, stable):
    problem, gains = loop_of(name)
    found = hold_verdict(problem, gains, step)
    assert found.verdict is (Verdict.PROVED if stable else Verdict.REFUTED)
    corners = [tuple(float(v) for v in vertex) for vertex in problem.vertices()]
    largest = largest_radius(problem, gains, float(step))
    assert largest == pytest.approx(max(radius(problem, gains, float(step), *c) for c in corners), rel=1e-6)
    if stable:
        rng, sectors = np.random.default_rng(5), problem.sectors
        for _ in range(100):
            point = [rng.uniform(float(a), float(b)) for a, b in (sectors.beta, sectors.slip, sectors.rate)]
            assert radius(problem, gains, float(step), *point) < 1
    else:
        assert radius(problem, gains, float(step), *(float(v) for v in found.witness)) > 1


@pytest.mark.parametrize(("name", "limit"), [("lab-fault", 0.699e-3), ("real-fault", 0.128)])
def test_the_largest_period_is_just_below_the_limit_of_the_errata(name, limit):
    # the limit is that of static friction at zero pressure; the box admits a larger slope
    problem, gains = loop_of(name)
    found = largest_step(problem, gains)
    assert 0.95 * limit < float(found.proved) < float(found.refuted) < 1.005 * limit
    assert float(found.refuted / found.proved) < 1.02
    assert largest_radius(problem, gains, float(found.refuted)) > 1
    for step in np.linspace(0.02, 1, 25) * float(found.proved):
        assert largest_radius(problem, gains, step) < 1


def test_euler_integrals_and_ranges_of_periods():
    problem, gains = loop_of("lab-fault")
    assert hold_verdict(problem, gains, "0.5e-3", integration="euler").verdict is Verdict.PROVED
    assert hold_verdict(problem, gains, "1e-3", integration="euler").verdict is Verdict.REFUTED
    assert hold_verdict(problem, gains, (F(0), F("0.5e-3"))).verdict is Verdict.PROVED
    assert hold_verdict(problem, gains, (F(0), F("0.8e-3"))).verdict is Verdict.REFUTED


def test_a_small_budget_is_undecided_never_wrong():
    problem, gains = loop_of("lab-fault")
    close = largest_step(problem, gains).proved
    assert hold_verdict(problem, gains, (F(0), close), cells=3).verdict is Verdict.UNDECIDED


def test_a_loop_that_is_unstable_itself_has_no_period():
    problem, gains = loop_of("real-fault")
    assert largest_step(problem, tuple(-k for k in gains)) is None


@pytest.mark.parametrize("step", ["0", "-1e-3", (F(2), F(1))])
def test_a_period_that_is_not_positive_is_refused(step):
    problem, gains = loop_of("lab-fault")
    with pytest.raises(ParameterError, match="step must be positive"):
        hold_verdict(problem, gains, step)


def test_a_loop_without_a_longest_period_is_proved_as_far_as_it_was_tried():
    # overdamped a millionfold: no tried period is refuted, which must not read as "no period is proved"
    fault = qd.load_fault("real-fault")
    fault = replace(fault, damping=fault.damping * 1e6)
    problem, gains = LinearProblem.of(fault), tuple(riccati_design(fault).controller.gains.values())
    found = largest_step(problem, gains)
    assert found.refuted is None
    assert found.proved > 10 * F(fault.sampling_time)
    for step in np.geomspace(1e-3, 1, 12) * float(found.proved):
        assert largest_radius(problem, gains, step) < 1


def test_a_plant_that_grows_far_within_a_period_is_refuted_not_undecided():
    fault = qd.load_fault("real-fault")
    fault = fault.with_disturbance(Disturbance(rate_growth=1e3))
    problem, gains = LinearProblem.of(fault), tuple(riccati_design(fault).controller.gains.values())
    found = hold_verdict(problem, gains, "0.184")
    assert found.verdict is Verdict.REFUTED
    with mpmath.workdps(250):  # independent: det(zI − M) at z = 1 and its sign far out, or a pole beyond the circle
        M = held(found.witness, problem, gains, mpmath.mpf("0.184"))
        assert abs(mpmath.det(M)) > 1  # the product of the four poles


def held(vertex, problem, gains, step):
    """Matrix of a period from the exponential of plant and input, at the digits in force."""
    beta, s, w = (mpmath.mpf(v.numerator) / v.denominator for v in vertex)
    push = [mpmath.mpf(v.numerator) / v.denominator for v in (problem.sectors.authority * k for k in gains)]
    chain = mpmath.zeros(5)
    chain[0, 1], chain[1, 0], chain[1, 1], chain[1, 4], chain[2, 0], chain[3, 2] = 1, s, -w, beta, 1, 1
    whole = mpmath.expm(chain * step, method="taylor")
    return mpmath.matrix(4, 4) + mpmath.matrix(
        [[whole[i, j] - whole[i, 4] * push[j] for j in range(4)] for i in range(4)]
    )
