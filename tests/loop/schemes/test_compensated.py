"""The compensated scheme: no bias, no chatter, on the real fault and away from it."""

import dataclasses
import math

import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault import Disturbance, load_fault
from quakedesign.laws import control_law
from quakedesign.loop import simulation_scheme
from quakedesign.simulation import simulate

REAL = load_fault("real-fault")
LAW = control_law("cta").from_values(("7", "5", "2.3", "1.1"), scale="1/4000", divisor="2353/125000000000")


@pytest.mark.parametrize("duration", [40000.0, pytest.param(None, marks=pytest.mark.slow)])
def test_both_errors_of_the_task_are_reached_at_once(duration):
    """1e-5 m and 6e-6 m/s at once, with |Δh/Δt| inside the certified bound λ·L̄ = λ."""
    run = simulate(REAL, LAW, scheme="compensated", samples=10, duration=duration, plant="printed")
    assert run.metrics.max_slip_error < 1e-5
    assert run.metrics.max_slip_rate_error < 6e-6
    assert run.metrics.max_h_rate < float(LAW.scale)


@pytest.mark.slow
def test_a_constant_disturbance_leaves_no_error_where_the_implicit_scheme_keeps_one():
    still = dataclasses.replace(REAL, reference=dataclasses.replace(REAL.reference, target_slip=1e-12))
    pushed = still.with_disturbance(Disturbance(constant=1e-4))
    runs = {
        name: simulate(pushed, LAW, scheme=name, duration=400.0, settled_from=300.0, compiled=False, plant="printed")
        for name in ("implicit", "compensated")
    }
    errors = {name: run.metrics.max_slip_error for name, run in runs.items()}
    assert errors["implicit"] == pytest.approx(0.184**2 * runs["implicit"].matched_perturbation[-1], rel=1e-9)
    assert errors["compensated"] < 1e-9 * errors["implicit"]


def test_without_disturbance_the_fault_never_slips_backward():
    run = simulate(REAL.with_disturbance(Disturbance()), LAW, scheme="compensated", duration=4000.0, compiled=False)
    assert run.metrics.reverse_slip_fraction == 0


def test_the_estimate_is_the_filtered_difference():
    scheme = dataclasses.replace(simulation_scheme("compensated"), weight=0.25)
    run = simulate(REAL, LAW, scheme=scheme, duration=150 * 0.184, samples=150, compiled=False)
    low, high = REAL.friction.bounds
    gain = math.sqrt(low * high) * REAL.authority * 0.184
    estimate, previous = 0.0, run.slip_rate_error
    found = -run.integrals[0] / float(LAW.divisor)  # ξ1 stands for −d
    for k in range(1, 150):
        seen = (previous[k] - previous[k - 1]) / gain - run.pressure[k - 1]
        estimate += 0.25 * (seen - estimate)
        assert found[k + 1] == pytest.approx(estimate, rel=1e-7, abs=1e-6)


@pytest.mark.slow
def test_weight_one_chatters_where_the_theory_says_so():
    """At the start β/β0 = 1.425 with the smallest β0 of the box: above 4/3, below 8/5."""
    least = REAL.friction.residual * REAL.authority
    errors = {}
    for weight in (0.5, 1.0):
        scheme = dataclasses.replace(simulation_scheme("compensated"), weight=weight, authority=least)
        run = simulate(REAL, LAW, scheme=scheme, duration=1000.0, compiled=False, plant="printed")
        errors[weight] = run.metrics.max_slip_rate_error
    assert errors[1.0] > 50 * errors[0.5]


@pytest.mark.parametrize("weight", [0.0, 1.5, math.nan])
def test_a_weight_is_a_share(weight):
    with pytest.raises(ParameterError, match="weight"):
        simulation_scheme("compensated", weight=weight)


def test_linear_feedback_is_compensated_too():
    law = control_law("elqr").from_values(("2e7", "2e7", "2e6", "2e4"))
    plain, better = (
        simulate(REAL, law, scheme=name, duration=2000.0, compiled=False).metrics.max_slip_error
        for name in ("implicit", "compensated")
    )
    assert better < plain
    assert np.isfinite(better)
