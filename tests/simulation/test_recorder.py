"""What is watched at one instant: thresholds met exactly, and figures by hand."""

import math

import casadi as ca
import numpy as np
import pytest

from quakedesign.fault import load_fault
from quakedesign.loop.schemes import simulation_scheme
from quakedesign.simulation.closed_loop import ClosedLoop
from quakedesign.simulation.coulomb import CoulombLoop
from quakedesign.simulation.recorder import Recorder

LAB = load_fault("lab-fault")
STRESS = LAB.effective_normal_stress
STEP = 0.5


def watched(states, *, pressure=0.0, settled_from=-1.0, kind=ClosedLoop, begin=0):
    """What is known after states [m, m/s] at instants one after the other, from number `begin` on."""
    recorder = Recorder(kind(LAB, None, pressure), simulation_scheme("continuous"), STEP)
    vector = ca.SX.sym("vector", recorder.size)
    observe = ca.Function("observe", [vector], [recorder.observe(vector)])
    now = recorder.start(settled_from)
    for number, state in enumerate(states, start=begin):
        now[0], now[2:4] = number, state
        now = observe(now).full().ravel().tolist()
    return recorder.watched(now)


@pytest.mark.parametrize(("pressure", "when"), [(STRESS, 0.0), (math.nextafter(STRESS, 0), -1.0), (2 * STRESS, 0.0)])
def test_the_fault_opens_at_the_pressure_that_is_its_stress(pressure, when):
    assert watched([(0.0, 0.0)], pressure=pressure)["opening"] == when


@pytest.mark.parametrize(
    ("place", "largest"),
    [("slip", 1e9), ("slip_rate", 1e9), ("slip_rate", -1e9), ("pressure", 1e100), ("pressure", -1e100)],
)
def test_numbers_beyond_the_largest_are_a_divergence_and_the_largest_are_not(place, largest):
    """Friction itself grows without end at slips below zero, which are left out here."""

    def at(size):
        given = dict.fromkeys(("slip", "slip_rate", "pressure"), 0.0) | {place: size}
        return watched([(given["slip"], given["slip_rate"])], pressure=given["pressure"], begin=3)["diverged"]

    assert at(largest) == -1.0
    assert at(math.nextafter(largest, 2 * largest)) == 3 * STEP


def test_an_event_keeps_the_time_at_which_it_was_first():
    found = watched([(0.0, 0.0), (0.0, -1e-300), (0.0, 1.0), (0.0, -1.0)])
    assert found["reverse_slip"] == STEP
    assert watched([(0.0, 0.0), (0.0, 1.0)])["reverse_slip"] == -1.0


def test_rest_is_what_set_valued_friction_holds_but_for_the_start():
    moving, resting = (0.0, 1e-300), (0.0, 0.0)
    found = watched([resting, moving, resting, resting], kind=CoulombLoop)
    assert (found["stick"], found["rest_count"]) == (2 * STEP, 3)
    passing = watched([resting, moving, resting, resting])
    assert (passing["stick"], passing["rest_count"]) == (-1.0, 0)


def test_errors_count_after_the_time_from_which_they_do_and_the_peak_always():
    """Reference and its rate are nothing at the start of the operation, to 1e-9 of the slips taken here."""
    states = [(7.0, -9.0), (-3.0, 2.0), (1.0, -4.0), (2.0, 1.0)]
    found = watched(states, settled_from=STEP, pressure=3.0)
    moving = ClosedLoop(LAB).reference
    reference = np.array([moving(STEP * n).full().ravel()[:2] for n in range(4)])
    errors = (np.array(states) - reference)[2:]
    assert found["settled_count"] == 2
    assert found["reverse_count"] == 1
    assert [found["max_slip_error"], found["max_slip_rate_error"]] == pytest.approx(np.abs(errors).max(0), rel=1e-14)
    sums = [found["sum_square_slip_error"], found["sum_square_slip_rate_error"]]
    assert sums == pytest.approx((errors**2).sum(0), rel=1e-14)
    assert found["sum_square_pressure"] == 2 * 3.0**2
    assert found["peak_slip_rate"] == 9.0
    assert (found["max_pressure"], found["min_pressure"], found["pressure_variation"]) == (3.0, 3.0, 0.0)
