"""Events of faults with a state: when they begin and end, how large they are, and where runs start."""

import dataclasses
import math

import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault import friction_law, load_fault
from quakedesign.simulation import simulate_state
from quakedesign.simulation.stick_slip import dynamic_rate, late_in_cycle, locked, sliding

RATE, YEAR = 1e-9, 3.15576e7
QUASI = {"inertia": False, "method": "dop853", "rtol": 1e-8}


def fault(**changes):
    given = {
        "reference_coefficient": 0.6,
        "direct_effect": 0.005,
        "evolution_effect": 0.01,
        "critical_slip": 0.02,
        "reference_rate": RATE,
        "slowest_rate": 1e-14,
        "fastest_rate": 10.0,
    }
    return dataclasses.replace(
        load_fault("real-fault"), friction=friction_law("rate-and-state-aging")(**(given | changes))
    )


@pytest.fixture(scope="module")
def cycles():
    return simulate_state(fault(), RATE, duration=120 * YEAR, start_rate=2 * RATE, **QUASI)


def test_events_begin_at_the_loading_rate_and_end_at_ten_times_it(cycles):
    events = cycles.slip_events
    assert len(events) == len(cycles.onsets) >= 2
    for event in events[1:]:
        assert event.nucleation < event.onset < event.arrest
        assert np.interp(event.nucleation, cycles.time, np.log(cycles.slip_rate / RATE)) == pytest.approx(0.0, abs=1e-9)
        faster = cycles.slip_rate > 10 * RATE
        assert not np.any(faster[(cycles.time > event.nucleation) & (cycles.time < event.onset)])
        assert np.all(faster[(cycles.time > event.onset) & (cycles.time < event.arrest)])
        assert np.interp(event.arrest, cycles.time, cycles.slip_rate) == pytest.approx(10 * RATE, rel=1e-6)
        between = (cycles.time > event.nucleation * (1 + 1e-9)) & (cycles.time < event.onset * (1 - 1e-9))
        assert np.all(cycles.slip_rate[between] >= RATE)
        lasting = (cycles.time > event.onset) & (cycles.time < event.arrest)
        assert event.peak_slip_rate == np.max(cycles.slip_rate[lasting])
        assert event.moment == pytest.approx(30e9 * 25e6 * event.slip, rel=1e-12)
        assert event.magnitude == pytest.approx(2 / 3 * math.log10(event.moment) - 6.07, rel=1e-12)


def test_an_event_that_is_not_over_has_no_size(cycles):
    end = float(cycles.onsets[1]) * 1.00001
    run = simulate_state(fault(), RATE, duration=end, start_rate=2 * RATE, **QUASI)
    first, last = run.slip_events
    assert first.slip is not None
    assert (last.arrest, last.slip, last.moment, last.magnitude) == (None,) * 4


def test_what_a_run_comes_to_is_measured_by_the_direct_effect_over_damping_and_inertia(cycles):
    """aσ'A over η + √(km), 0.005·50 MPa·25 km² / (5e14 + √(1.5e14·3.125e14)) kg/s."""
    assert dynamic_rate(fault()) == pytest.approx(
        0.005 * 50e6 * 25e6 / (5e14 + math.sqrt(1.5e14 * 3.125e14)), rel=1e-12
    )
    assert cycles.outcome.kind == "earthquake"
    slow = simulate_state(fault(), [(1e5, RATE), (1e5, 30 * RATE)], onset_rate=20 * RATE, start_rate=RATE, **QUASI)
    assert slow.outcome.kind == "creep"
    step = simulate_state(fault(), [(1e5, RATE)], onset_rate=2 * RATE, start_rate=3 * RATE, **QUASI)
    assert step.outcome.kind == "slow slip"


def test_steady_sliding_stays_as_it_is():
    start = sliding(fault(), RATE)
    run = simulate_state(fault(), RATE, duration=YEAR, start_rate=start.slip_rate, start_state=start.state, **QUASI)
    assert start.state == pytest.approx((0.02 / RATE,), rel=1e-15)
    assert np.max(np.abs(run.slip_rate / RATE - 1)) < 1e-6


def test_a_locked_fault_ages_with_the_time_that_it_is_held():
    """Without slip θ grows by 1 s a second (Dieterich): after a hold far beyond d_c/v nearly by the hold."""
    hold = 100 * YEAR
    start = locked(fault(), RATE, hold, **QUASI)
    assert 0.9 * hold < start.state[0] < hold + 0.02 / RATE
    assert start.slip_rate < 1e-3 * RATE
    with pytest.raises(ParameterError, match="hold must be positive"):
        locked(fault(), RATE, 0.0)


@pytest.mark.slow
def test_late_in_the_cycle_the_rest_of_the_interval_is_left():
    start = late_in_cycle(fault(), RATE, 0.9, **QUASI)
    run = simulate_state(
        fault(), RATE, duration=60 * YEAR, start_rate=start.slip_rate, start_state=start.state, **QUASI
    )
    interval = run.onsets[1] - run.onsets[0]
    assert run.onsets[0] == pytest.approx(0.1 * interval, rel=1e-3)


def test_a_fault_that_creeps_has_no_cycle():
    with pytest.raises(ParameterError, match="repeated events"):
        late_in_cycle(fault(direct_effect=0.02), RATE, 0.9, **QUASI)
    with pytest.raises(ParameterError, match="share of the cycle"):
        late_in_cycle(fault(), RATE, 1.0)
