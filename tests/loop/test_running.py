"""The law that simulations run is the law of the proof."""

from fractions import Fraction as F

import numpy as np
import pytest

from quakedesign import simulate
from quakedesign.certificates.guarantee import Guarantee, Held, guarantee, task_of
from quakedesign.errors import UnsupportedError
from quakedesign.fault import load_fault
from quakedesign.loop import Prediction, SampledController, disturbance_estimate

STEP = F("0.184")
LAW = disturbance_estimate(
    (F(672300000), F(206000000)),
    F("0.57"),
    Prediction(of_slip=F("0.0722"), of_rate=F("0.7475"), of_pushes=(F("0.1596"),)),
    F("2.282e-8"),
)
HELD = Held(law=LAW, step=STEP)


def test_a_run_asks_for_the_pressure_of_the_matrices():
    """Pressures of 100 samples from the recorded errors, by the recursion p = Cz + Dy, z ← Fz + Gy."""
    run = simulate(load_fault("real-fault"), HELD.controller, scheme="explicit", duration=18.4, samples=101).to_pandas()
    as_floats = lambda rows: np.array(rows, dtype=float)  # noqa: E731
    z, errors = np.zeros(2), []
    for _, row in run.iloc[:-1].iterrows():
        y = [row["slip [m]"] - row["reference [m]"], row["slip_rate [m/s]"] - row["reference_rate [m/s]"]]
        errors.append(row["pressure [Pa]"] - as_floats(LAW.output) @ z - as_floats(LAW.feedback) @ y)
        z = as_floats(LAW.update) @ z + as_floats(LAW.measured) @ y
    assert np.abs(run["pressure [Pa]"]).max() > 1e3
    assert np.abs(errors).max() < 1e-6


def test_the_whole_task_stays_far_inside_the_guarantee():
    fault = load_fault("real-fault")
    claim = guarantee(task_of(fault), HELD)
    assert isinstance(claim, Guarantee)
    found = simulate(fault, HELD.controller, scheme="explicit").metrics
    assert found.max_slip_error <= 6e-6 < claim.claims.slip_error
    assert found.max_slip_rate_error <= 4.5e-6 < claim.claims.slip_rate_error
    assert found.peak_slip_rate <= claim.claims.peak_slip_rate
    assert claim.claims.least_pressure <= found.min_pressure
    assert found.max_pressure <= claim.claims.largest_pressure


def test_it_has_no_loop_in_continuous_time():
    with pytest.raises(UnsupportedError, match="guarantee"):
        SampledController.loop_field()
