import dataclasses

import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.simulation import natural_earthquake

REAL = load_fault("real-fault")


def test_the_real_fault_slips_as_fast_as_in_the_paper():
    """Section IV: 20 times the 3.5e-3 m/s of the laboratory's scale, then rest at the next equilibrium."""
    run = natural_earthquake(REAL)
    assert run.metrics.peak_slip_rate == pytest.approx(0.07, rel=0.1)
    assert run.slip[-1] == pytest.approx(REAL.rest_slip, rel=1e-6)
    assert abs(run.slip_rate[-1]) < 1e-6
    assert np.all(run.pressure == 0)


def test_the_laboratory_fault_ends_at_its_rest_slip():
    lab = load_fault("lab-fault")
    assert natural_earthquake(lab).slip[-1] == pytest.approx(lab.rest_slip, rel=1e-6)


def test_injected_fluid_makes_it_larger():
    """Where the spring has unloaded to residual friction at the lower effective stress."""
    run = natural_earthquake(REAL, 5e6)
    law, stress, stiffness = REAL.friction, REAL.effective_normal_stress, REAL.stiffness / REAL.area
    final = run.slip[-1]
    strength = (law.residual + law.drop * np.exp(-final / law.critical_slip)) * (stress - 5e6)
    assert strength == pytest.approx(law.bounds[1] * stress - stiffness * final, rel=1e-9)
    assert run.metrics.peak_slip_rate > natural_earthquake(REAL).metrics.peak_slip_rate


def test_a_stable_fault_stays():
    stable = dataclasses.replace(REAL, friction=dataclasses.replace(REAL.friction, drop=0.0))
    run = natural_earthquake(stable)
    assert run.metrics.peak_slip_rate < 1e-14
    assert run.time[-1] == pytest.approx(200 * np.pi / REAL.natural_frequency, rel=1e-3)


@pytest.mark.parametrize("pressure", [50e6, -60e6, float("nan")])
def test_a_pressure_that_opens_the_fault_is_refused(pressure):
    with pytest.raises(ParameterError, match="effective normal stress"):
        natural_earthquake(REAL, pressure)
