"""What is watched at one instant: thresholds met exactly, and figures by hand."""

import math

import casadi as ca
import numpy as np
import pytest

from quakedesign.fault import load_fault
from quakedesign.laws import control_law, published
from quakedesign.loop import Actuator, Lag, simulation_scheme
from quakedesign.simulation.closed_loop import ClosedLoop
from quakedesign.simulation.recorder import Recorder
from quakedesign.simulation.stick_slip_plant import StickSlipLoop

LAB = load_fault("lab-fault")
STRESS = LAB.effective_normal_stress
STEP = 0.5


def recording(law=None, pressure=0.0, kind=ClosedLoop, scheme="continuous", **settings):
    return Recorder(kind(LAB, law, pressure), simulation_scheme(scheme, **settings), STEP)


def watched(states, *, settled_from=-1.0, begin=0, **loop):
    """What is known after states [m, m/s] at instants one after the other, from number `begin` on."""
    recorder = recording(**loop)
    vector = ca.SX.sym("vector", recorder.size)
    observe = ca.Function("observe", [vector], [recorder.observe(vector)])
    now = recorder.start(settled_from)
    for number, state in enumerate(states, start=begin):
        now[0], now[2 : 2 + len(state)] = number, state
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
    found = watched([resting, moving, resting, resting], kind=StickSlipLoop)
    assert (found["stick"], found["rest_count"]) == (2 * STEP, 3)
    assert watched([resting, resting], kind=StickSlipLoop)["stick"] == STEP
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


def test_at_rest_at_the_start_there_is_nothing_but_an_instant_that_counts():
    found = watched([(0.0, 0.0)], law=linear(0.0))
    events = dict.fromkeys(("diverged", "opening", "reverse_slip", "stick", "load_reversed"), -1.0)
    h = float(ClosedLoop(LAB, linear(0.0)).perturbation(0, [0, 0], [0, 0, 0])[0])
    assert found == dict.fromkeys(found, 0.0) | events | {"settled_count": 1, "previous_h": h}


def linear(gain):
    """Law that asks for a pressure by the slip error alone [Pa/m]."""
    units = published("lab-fault")["elqr"].gain_units
    return control_law("elqr")(gains=dict.fromkeys(units, 0.0) | {next(iter(units)): gain})


def test_pressures_and_perturbations_change_from_one_instant_to_the_next_and_not_before_the_first():
    """The steepest changes are the first ones; before them there was nothing to change from."""
    law, slips, rates = linear(8.0), np.array([50.0, -30.0, 10.0, 5.0]), np.array([0.3, -0.4, 0.1, 0.2])
    found, loop = watched(list(zip(slips, rates, strict=True)), law=law), ClosedLoop(LAB, law)
    reference = [loop.reference(STEP * n).full().ravel() for n in range(4)]
    pressure = np.abs(8 * (slips - [r[0] for r in reference]))
    sense = np.sign(found["previous_pressure"]) * np.array([1, -1, 1, 1])
    assert found["pressure_variation"] == pytest.approx(np.sum(np.abs(np.diff(sense * pressure))), rel=1e-12)
    assert found["sum_square_pressure"] == pytest.approx(np.sum(pressure**2), rel=1e-12)
    h = [float(loop.perturbation(STEP * n, [slips[n], rates[n]], reference[n])[0]) for n in range(4)]
    changes = np.abs(np.diff(h))
    assert np.argmax(changes) == 0
    assert abs(h[0]) != changes[0]
    assert found["max_h_change"] == pytest.approx(changes[0], rel=1e-12)


def test_slip_is_reverse_below_zero_alone():
    assert watched([(0.0, rate) for rate in (-1.0, -2.0, 0.5, 0.0, 3.0)])["reverse_count"] == 2
    assert watched([(0.0, rate) for rate in (-1.0, -2.0, -1e-300, 0.0, 3.0)])["reverse_count"] == 3


@pytest.mark.parametrize("place", [2, 3])
def test_a_state_of_the_law_beyond_all_squares_is_a_divergence(place):
    for size, when in ((1e100, -1.0), (math.nextafter(1e100, math.inf), 0.0)):
        state = [0.0, 0.0, 0.0, 0.0]
        state[place] = -size
        assert watched([state], law=linear(0.0))["diverged"] == when


def test_a_vector_has_a_place_for_what_schemes_remember_and_actuators_do():
    lagged = recording(linear(0.0), scheme="explicit", actuator=Actuator(stages=(Lag(time_constant=1.0),)))
    assert lagged.memory
    assert len(lagged.start(0.0)) == lagged.size
    found = watched([(0.0, 0.0)], law=linear(0.0), scheme="explicit", actuator=lagged.scheme.actuator)
    assert (found["max_well_pressure"], found["min_well_pressure"]) == (0.0, 0.0)


def test_the_energy_of_a_run_that_has_not_moved_is_none_wherever_it_starts():
    recorder = Recorder(ClosedLoop(LAB), simulation_scheme("continuous"), STEP, (1e-3, 0.2))
    assert set(recorder.energy(recorder.start(0.0)).to_dict().values()) == {0.0}
