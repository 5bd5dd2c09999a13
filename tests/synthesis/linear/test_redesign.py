"""Designs for a given sampling period."""

import numpy as np
import pytest

import quakedesign as qd
from quakedesign.certificates import Verdict
from quakedesign.errors import ParameterError
from quakedesign.synthesis.linear.design.discrete_riccati import discrete_design, open_loop_growth, sampled_design
from quakedesign.synthesis.linear.plant.problem import LinearProblem
from quakedesign.synthesis.linear.sampled.stability import largest_radius

LAB = qd.load_fault("lab-fault")


def proved(design, *, varying=True):
    problem, gains = LinearProblem.of(LAB), tuple(design.controller.gains.values())
    proof = design.varying.proof
    return (
        design.constant.verdict is Verdict.PROVED
        and (proof is not None) == varying
        and (proof is None or (proof.covers(design.step) and proof.holds(problem, gains)))
        and largest_radius(problem, gains, float(design.step), "euler") < 1
    )


def test_a_short_period_keeps_the_continuous_design():
    design = sampled_design(LAB)
    assert design.method == "continuous"
    assert proved(design)
    assert float(design.step) == LAB.sampling_time


def test_a_long_period_is_designed_in_discrete_time():
    design = sampled_design(LAB, "7e-3", feedback="state")
    assert design.method == "discrete"
    assert design.controller.feedback == "state"
    assert proved(design)


def test_where_the_weights_alone_fail_a_direct_search_goes_on():
    # proved for constant parameters alone, which its verdict says
    assert proved(discrete_design(LAB, "9e-3"), varying=False)


def test_a_period_that_is_too_long_is_refused_with_its_reason():
    with pytest.raises(ParameterError, match=r"held for 0\.03 s: in that time the plant alone moves away 31\.\d+-fold"):
        sampled_design(LAB, 0.03)


def test_the_growth_of_the_plant_alone_is_that_of_its_unstable_pole():
    problem = LinearProblem.of(LAB)
    s, w = float(problem.sectors.slip[1]), float(problem.sectors.rate[0])
    pole = np.roots([1, w, -s]).max()
    assert open_loop_growth(problem, 0.01) == pytest.approx(np.exp(pole * 0.01), rel=1e-12)
