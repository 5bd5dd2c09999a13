"""The implicit scheme on the real fault: what it reaches, and the price."""

import numpy as np
import pytest

from quakedesign.fault import load_fault
from quakedesign.laws import control_law
from quakedesign.simulation import simulate

REAL = load_fault("real-fault")
DIVISOR = "2353/125000000000"


def law(scale):
    return control_law("cta").from_values(("7", "5", "2.3", "1.1"), scale=scale, divisor=DIVISOR)


def test_in_the_discrete_sliding_mode_the_slip_error_is_the_unknown_force_times_the_step_squared():
    """There the pressure is −(e2 + e1/T_s)/(T_s·B0), and a slow force −h gives e1 = T_s²h to first order."""
    run = simulate(REAL, law("1/100"), scheme="implicit", duration=8000.0, samples=400, compiled=False, plant="printed")
    late = run.time > 4000
    asked = -(run.slip_rate_error + run.slip_error / 0.184) / 0.184
    assert np.allclose(run.pressure[late] * float(law(1).divisor), asked[late], rtol=1e-6, atol=1e-12)
    predicted = 0.184**2 * run.matched_perturbation
    assert np.max(np.abs(run.slip_error - predicted)[late]) < 0.1 * np.max(np.abs(predicted[late]))


@pytest.mark.slow
@pytest.mark.parametrize(("scale", "limit"), [("1/1000", 1e-5), ("1/100", 8e-6)])
def test_certified_gains_keep_the_rate_error_below_ten_micrometres_per_second(scale, limit):
    run = simulate(REAL, law(scale), scheme="implicit", samples=10, plant="printed")
    assert run.metrics.max_slip_rate_error < limit
    assert run.metrics.max_h_rate < float(law(scale).scale)
