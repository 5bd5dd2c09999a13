"""Sensors as the command line makes them, and the premise of their differentiator."""

import pytest

from quakedesign.controllers import published
from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.report.estimation import differentiator_premise, largest_acceleration, sensor
from quakedesign.simulation import Measurement, joint_condition
from quakedesign.simulation.measurement import EXACT

LAB = load_fault("lab-fault")
LAW = published("lab-fault")["cta"]


def test_without_a_bound_the_states_are_measured():
    noise = Measurement(slip_noise=1e-6, rate_noise=1e-4)
    assert sensor(1e-3, noise, None, 0) is noise


def test_with_a_bound_the_slip_alone_is_measured_by_a_differentiator_of_order_one():
    seen = sensor(1e-3, Measurement(slip_noise=1e-6, seed=4), 10.0, 2)
    d = seen.differentiator
    assert (d.bound, d.step, d.order, d.filter_order) == (10.0, 1e-3, 1, 2)
    assert [(s.deviation, s.seed) for s in seen.stages] == [(1e-6, 4)]
    assert sensor(1e-3, EXACT, 10.0, 0).stages == ()


@pytest.mark.parametrize(
    ("noise", "bound", "order", "said"),
    [
        (EXACT, None, 1, "differentiator"),
        (Measurement(rate_noise=1.0), 1.0, 0, "slip alone"),
        (EXACT, -1.0, 0, "bound"),
    ],
)
def test_what_does_not_go_together_is_refused(noise, bound, order, said):
    with pytest.raises(ParameterError, match=said):
        sensor(1e-3, noise, bound, order)


def test_the_acceleration_is_that_of_the_chattering_loop():
    """The published 2-CTA sampled every 0.1 ms jumps by about 3 m/s², see the tests of `joint_condition`."""
    assert largest_acceleration(LAB, LAW, scheme="explicit", step=1e-4) == pytest.approx(3.0, rel=0.2)


def test_the_premise_is_the_joint_condition_with_that_acceleration():
    seen = sensor(1e-4, Measurement(slip_noise=1e-7), 100.0, 0)
    found = differentiator_premise(LAB, LAW, seen)
    reached = largest_acceleration(LAB, LAW, scheme="explicit", step=1e-4)
    wanted = joint_condition(LAB, LAW, seen.differentiator, acceleration=reached, noise=4e-7)
    assert (found.required, found.certified, found.holds) == (wanted.required, 100.0, wanted.holds)
