"""Certified margins of given gains: close to what is possible, never above it."""

import json
from dataclasses import replace
from fractions import Fraction as F

import pytest

import quakedesign as qd
from quakedesign.laws import published
from quakedesign.linear.frequency import slip_limit
from quakedesign.linear.linear_problem import FeedbackLoop
from quakedesign.linear.riccati import riccati_design
from quakedesign.linear.robust_stability import (
    analysis,
    decay_rate,
    friction_slope_margin,
    gain_range,
    nominal_slope,
    sector_loop,
)
from quakedesign.lyapunov import Verdict
from quakedesign.lyapunov.exact.perturbation_bounds import sectors


@pytest.fixture(scope="module", params=["real-fault", "lab-fault"])
def case(request):
    fault = qd.load_fault(request.param)
    return fault, published(request.param)["elqr"], riccati_design(fault).controller


def test_the_slope_margin_is_within_a_hundredth_of_its_limit_and_below_it(case):
    fault, *controllers = case
    for controller in controllers:
        margin = friction_slope_margin(fault, controller)
        assert 0.99 * margin.limit < margin.certified < margin.limit
        assert float(margin.certified) < margin.circle <= float(margin.limit) * (1 + 1e-9)
        assert margin.certificate.check() is Verdict.PROVED
        # what was proved is what is claimed: s from −k̂ to margin·s_max − k̂, β over the whole box
        loop = margin.certificate.loop
        spring = -loop.uncertain["s"][0]
        assert float(spring) == pytest.approx(fault.specific_stiffness, rel=1e-12)
        assert loop.uncertain["s"][1] == margin.certified * margin.slope - spring
        assert loop.uncertain["beta"] == sectors(fault).beta


def test_the_published_laboratory_gains_have_the_limit_of_an_independent_computation():
    # numpy: largest constant slope at which all roots at β = 1 are stable, by bisection on the roots themselves
    import numpy as np

    fault, controller = qd.load_fault("lab-fault"), published("lab-fault")["elqr"]
    b = 0.4 * fault.authority
    k1, k2, k3, k4 = (float(k) * b for k in controller.gains.values())
    slope = fault.authority * fault.effective_normal_stress * 0.17 / 0.0025
    low, high = 0.0, 1000.0
    for _ in range(60):
        middle = (low + high) / 2
        a2 = fault.specific_stiffness - middle * slope + k1
        roots = np.roots([1, fault.specific_damping + k2, a2, k3, k4])
        low, high = (middle, high) if roots.real.max() < 0 else (low, middle)
    margin = friction_slope_margin(fault, controller)
    assert float(margin.limit) == pytest.approx(low, rel=1e-6)
    assert float(margin.slope) == pytest.approx(slope, rel=1e-12)


def test_at_the_limit_the_constant_loop_is_not_stable(case):
    fault, controller, _ = case
    margin = friction_slope_margin(fault, controller)
    needed, spring = sectors(fault), F(str(fault.specific_stiffness))
    loop = FeedbackLoop(gains=tuple(controller.gains.values()), sectors=needed)

    at = margin.limit * margin.slope - spring
    assert not loop.stable((margin.limit_beta, at, needed.rate[0]))
    assert loop.stable((margin.limit_beta, at * F(999999, 1000000), needed.rate[0]))


def test_friction_without_slope_and_unstable_gains_have_no_margin():
    fault, controller = qd.load_fault("real-fault"), published("real-fault")["elqr"]
    flat = replace(fault, friction=replace(fault.friction, drop=0.0))
    assert nominal_slope(flat) == 0
    assert friction_slope_margin(flat, controller) is None
    bad = replace(controller, gains={n: -k for n, k in controller.gains.items()})
    assert friction_slope_margin(fault, bad) is None
    assert gain_range(fault, bad) is None
    assert decay_rate(sector_loop(bad, sectors(fault))) is None


def test_the_range_of_beta_holds_the_box_and_ends_above_its_limit():
    fault = qd.load_fault("lab-fault")
    designed = riccati_design(fault).controller
    found = gain_range(fault, designed)
    needed = sectors(fault)
    assert found.low_limit < found.low < needed.beta[0] < needed.beta[1] < found.high
    assert all(c.check() is Verdict.PROVED for c in found.certificates)
    assert found.certificates[0].loop.uncertain["beta"] == (found.low, needed.beta[1])
    assert found.certificates[1].loop.uncertain["beta"] == (needed.beta[0], found.high)
    gains = [k * found.low_limit for k in designed.gains.values()]
    limit, _ = slip_limit(FeedbackLoop(gains=gains, sectors=replace(needed, beta=(F(1), F(1)))), needed.rate[0])
    assert limit <= needed.slip[1]


def test_the_margin_over_uncertain_inertia_is_refused_for_nothing():
    # the margin is defined over the box of the paper, whatever box the fault has
    fault, controller = qd.load_fault("real-fault"), published("real-fault")["elqr"]
    assert friction_slope_margin(fault.with_box("ten-percent"), controller) == friction_slope_margin(fault, controller)
    assert decay_rate(sector_loop(controller, sectors(fault.with_box("ten-percent")))) is not None


def test_the_analysis_is_plain():
    fault = qd.load_fault("real-fault")
    designed = riccati_design(fault).controller
    facts = json.loads(json.dumps(analysis(fault, designed).to_dict()))
    assert facts["verdict"] == "proved"
    assert F(facts["friction_slope_margin"]) < F(facts["linear_limit"])
    assert 0 < F(facts["decay_rate"]) <= facts["decay_limit"]
    assert facts["working_margin"] < float(F(facts["friction_slope_margin"]))
    assert len(facts["frequency"]) == 4
