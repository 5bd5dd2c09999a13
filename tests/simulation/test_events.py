"""What happened is named with its time, and nothing that is no number reaches a figure."""

import json
import math

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from quakedesign.errors import QuakedesignError, SimulationError
from quakedesign.fault import Disturbance, load_fault
from quakedesign.laws import control_law, published
from quakedesign.simulation import simulate
from quakedesign.simulation.closed_loop import Load
from quakedesign.simulation.recorder import EVENTS, events

REAL = load_fault("real-fault")
DIVISOR = {"divisor": published("real-fault")["cta"].divisor}
gain = st.floats(-1e250, 1e250, allow_nan=False)


@settings(max_examples=5, deadline=None)
@given(st.sampled_from(["cta", "elqr", "dia"]), st.lists(gain, min_size=4, max_size=4), st.booleans())
def test_no_figure_of_any_run_is_not_a_number(law, gains, sticks):
    plant = "stick-slip" if sticks else "printed"
    try:
        controller = control_law(law).from_values(tuple(gains), **({} if law == "elqr" else DIVISOR))
        run = simulate(REAL, controller, duration=4.0, plant=plant, compiled=False)
    except QuakedesignError:
        return
    told = run.metrics.to_dict()
    json.dumps(told | dict(run.events), allow_nan=False)
    for values, _, _ in run.signals().values():
        assert np.all(np.isfinite(values))
    if "diverged" in run.events:
        assert run.energy is None
        known = {name for name, value in told.items() if value is not None}
        assert known - {"peak_slip_rate"} == {"settled_from", "steps", "seconds"}  # the plant may have stayed finite
        assert max(run.events.values()) == run.events["diverged"]
    else:
        assert all(math.isfinite(value) for value in run.energy.to_dict().values())
    run.to_xarray()


def test_opening_is_named_at_the_first_step_at_which_the_pressure_is_the_stress():
    """A push that grows makes the linear law inject until p ≥ σ'."""
    controller = published("real-fault")["elqr"]
    run = simulate(
        REAL,
        controller,
        duration=60.0,
        samples=10**5,
        load=Load(perturbation=-0.1 * sp.Symbol("time")),
        plant="printed",
    )
    opened = run.pressure >= REAL.effective_normal_stress
    assert np.any(opened)
    assert run.events["opening"] == run.time[np.argmax(opened)]
    assert run.metrics.max_pressure >= REAL.effective_normal_stress


def test_reverse_slip_of_the_uncontrolled_fault_is_named():
    backward = REAL.with_disturbance(Disturbance(constant=-1e-3))
    run = simulate(backward, duration=5.0, samples=10**5, plant="printed")
    assert run.events["reverse_slip"] == run.time[1]


def test_a_pressure_beyond_all_numbers_is_a_divergence():
    """x1 and x2 are still small when a gain of 1e160 asks for a pressure whose square is none."""
    gains = {name: 1e160 for name in published("real-fault")["elqr"].gain_units}
    law = control_law("elqr")(gains=gains)
    run = simulate(REAL, law, duration=10.0, compiled=False, plant="printed")
    assert run.events["diverged"] <= 2 * REAL.sampling_time
    assert run.metrics.rms_pressure is None
    assert np.all(np.isfinite(run.pressure))


def test_a_loop_without_a_value_at_the_start_is_an_error():
    pole = 1 / sp.Symbol("time")
    with pytest.raises(SimulationError, match="initial values of the loop are infinite or undefined"):
        simulate(REAL, duration=10.0, compiled=False, load=Load(perturbation=pole))


def test_a_singular_perturbation_ends_the_run_there():
    late = sp.sqrt(3 - sp.Symbol("time"))
    run = simulate(REAL, step=0.1, duration=10.0, compiled=False, load=Load(perturbation=late * 1e-3))
    assert 2.8 < run.events["diverged"] < 3.3
    assert 1e-3 < run.metrics.peak_slip_rate < 2e-3 * 3**0.5  # of the plant until then: below the integral 2e-3·√3


def test_what_comes_after_a_divergence_did_not_happen():
    watched = dict.fromkeys(EVENTS, -1.0) | {"diverged": 2.0, "opening": 1.0, "reverse_slip": 3.0}
    assert events(watched) == {"diverged": 2.0, "opening": 1.0}
