"""Sensors as the command line makes them, and the premise of their differentiator."""

from types import SimpleNamespace

import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.laws import published
from quakedesign.loop.sensing import Measurement, joint_condition
from quakedesign.loop.sensing.measurement import EXACT
from quakedesign.studies import single_runs as runs
from quakedesign.studies.single_runs import differentiator_premise, largest_acceleration, sensor

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


def test_hardware_comes_before_averaging():
    seen = sensor(1e-3, EXACT, 10.0, bandwidth=50.0, averaging=3)
    assert [type(stage).__name__ for stage in seen.stages] == ["Transducer", "Averaging"]
    assert (seen.stages[0].bandwidth, seen.stages[1].samples) == (50.0, 3)


@pytest.mark.parametrize("more", [{"bandwidth": 50.0}, {"averaging": 3}])
def test_what_belongs_to_a_differentiator_is_refused_without(more):
    with pytest.raises(ParameterError, match=f"the {next(iter(more))} needs a differentiator"):
        sensor(1e-3, EXACT, None, **more)


def test_where_the_loop_with_exact_states_diverges_nothing_is_certified():
    """The published e-LQR of the laboratory with zero-order hold over 2 ms (ERRATA 22)."""
    law = published("lab-fault")["elqr"]
    found = differentiator_premise(LAB, law, sensor(2e-3, EXACT, 1e6))
    assert (found.certified, found.ratio, found.holds) == (0, None, False)
    assert "diverges at" in found.note
    assert 0 < found.required < float("inf")


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
    reached, diverged = largest_acceleration(LAB, LAW, scheme="explicit", step=1e-4)
    assert reached == pytest.approx(3.0, rel=0.2)
    assert diverged is None


def test_the_acceleration_is_the_larger_of_both_plants_and_the_divergence_the_first(monkeypatch):
    rates = {"stick-slip": [0.0, 3.0, 1.0], "printed": [0.0, 1.0, -1.5]}
    ends = {"stick-slip": {"diverged": 7.0}, "printed": {"stick": 1.0}}

    def simulated(*_, plant, **__):
        return SimpleNamespace(slip_rate=np.array(rates[plant]), time=np.arange(3.0), events=ends[plant])

    monkeypatch.setattr(runs, "simulate", simulated)
    assert largest_acceleration(LAB, LAW, scheme="explicit", step=1e-4) == (3.0, 7.0)
    rates["printed"], ends["printed"] = [0.0, 1.0, -3.5], {"diverged": 2.0}
    assert largest_acceleration(LAB, LAW, scheme="explicit", step=1e-4) == (4.5, 2.0)


@pytest.mark.slow
def test_the_premise_is_the_joint_condition_with_that_acceleration():
    seen = sensor(1e-4, Measurement(slip_noise=1e-7), 100.0, 0)
    found = differentiator_premise(LAB, LAW, seen)
    reached, _ = largest_acceleration(LAB, LAW, scheme="explicit", step=1e-4)
    wanted = joint_condition(LAB, LAW, seen.differentiator, acceleration=reached, noise=4e-7)
    assert (found.required, found.certified, found.holds) == (wanted.required, 100.0, wanted.holds)
