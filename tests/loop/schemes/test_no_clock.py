"""Samples by no clock in a run: when they are, what the law makes of them, and that a run stays in its guarantee."""

from dataclasses import replace
from fractions import Fraction as F
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from quakedesign import simulate
from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.guarantees.exact.guarantee_files import load_guarantee
from quakedesign.loop import Actuator
from quakedesign.loop.actuators.delay import Delay
from quakedesign.loop.schemes.base import MOST_STEPS, AperiodicClock
from quakedesign.loop.schemes.explicit import Explicit
from quakedesign.loop.sensing.measurement import Measurement
from quakedesign.simulation.export import controller_step

FILE = Path(__file__).parents[3] / "proofs" / "certificates" / "guarantee_no-clock_lab-fault.json"
FAULT, STEPS = load_fault("lab-fault"), 4000
SHORT = {"duration": STEPS / 8000, "samples": STEPS, "compiled": False}


@cache
def claim():
    return load_guarantee(FILE)


@cache
def seen(seed=None):
    own = {} if seed is None else {"scheme": Explicit(clock=AperiodicClock(shortest=8, longest=16, seed=seed))}
    return simulate(FAULT, claim().controller, plant="printed", **own, **SHORT)


def sampled(run):
    """Numbers of the steps from which the pressure is another one; the first sample asks for none."""
    return [0, *(np.flatnonzero(np.diff(run.pressure)) + 1).tolist()]


@pytest.mark.slow
def test_samples_come_one_to_two_shortest_intervals_after_the_last_each_as_often():
    often = np.bincount(np.diff(sampled(seen())), minlength=17)
    assert sum(often[:8]) == 0
    assert len(often) == 17
    assert min(often[8:]) > 0.4 * np.mean(often[8:])
    assert seen(0).pressure.tolist() == seen().pressure.tolist()
    assert sampled(seen(1)) != sampled(seen())


def test_the_law_of_the_file_asks_for_every_pressure_of_the_run():
    law, run = claim().sampled_loop.law, seen().to_pandas()
    update, measured = (np.array(rows, dtype=float) for rows in (law.update, law.measured))
    output, feedback = (np.array(row, dtype=float) for row in (law.output, law.feedback))
    errors = np.column_stack(
        [run["slip [m]"] - run["reference [m]"], run["slip_rate [m/s]"] - run["reference_rate [m/s]"]]
    )
    states = np.zeros(len(law.states))
    asked = np.empty(len(errors))
    for first, after in zip(places := sampled(seen()), [*places[1:], len(errors)], strict=True):
        told = errors[first]
        asked[first:after] = output @ states + feedback @ told
        states = update @ states + measured @ told
    assert np.abs(asked).max() > 20
    assert np.abs(asked - run["pressure [Pa]"]).max() < 1e-9


@pytest.mark.slow
def test_equal_intervals_are_those_of_a_clock_in_every_digit():
    fixed = simulate(FAULT, claim().controller, scheme=Explicit(clock=AperiodicClock(shortest=8, longest=8)), **SHORT)
    law = replace(claim().controller, longest=F(0))
    clock = simulate(FAULT, law, substeps=8, **SHORT | {"samples": STEPS // 8})
    assert fixed.pressure[::8].tolist() == clock.pressure.tolist()
    assert fixed.slip[::8].tolist() == clock.slip.tolist()


def test_a_run_stays_in_its_guarantee():
    metrics = seen().metrics
    assert metrics.max_slip_error < claim().claims.slip_error
    assert metrics.max_slip_rate_error < claim().claims.slip_rate_error
    assert "AperiodicClock(shortest=8, longest=16, seed=0)" in seen().provenance["clock"]


@pytest.mark.slow
def test_noise_is_told_at_the_samples_alone():
    loud = simulate(FAULT, claim().controller, measurement=Measurement(slip_noise=1e-8, rate_noise=1e-6), **SHORT)
    assert sampled(loud) == sampled(seen())
    assert np.abs(loud.pressure - seen().pressure).max() > 0.1


@pytest.mark.parametrize("wrong", [(0, 1), (2, 1), (1, MOST_STEPS + 1), (1.0, 2), (True, 2)])
def test_other_intervals_are_refused(wrong):
    shortest, longest = wrong
    with pytest.raises(ParameterError, match="interval of aperiodic sampling"):
        AperiodicClock(shortest=shortest, longest=longest)


def test_a_delay_within_a_step_is_refused():
    late = Actuator(stages=(Delay(samples=0, part=0.5),))
    with pytest.raises(ParameterError, match="whole number of steps with aperiodic sampling"):
        Explicit(clock=AperiodicClock(shortest=8, longest=16), actuator=late)


def test_grains_never_reach_beyond_the_longest_interval():
    known = {F(2): (8, 16), F("1.3"): (10, 13), F(25, 23): (23, 25), F(50, 49): (49, 50), F(10**6): (8, MOST_STEPS)}
    for ratio, steps in known.items():
        found = AperiodicClock.of(F(3), 3 * ratio)
        assert (found.shortest, found.longest) == steps
    drawn = AperiodicClock.of(F(1, 3), F("0.4321"))
    assert F("1.2963") - F(1, 100) < F(drawn.longest, drawn.shortest) <= F("1.2963")


@pytest.mark.slow
def test_a_run_says_its_intervals_and_what_is_exported_that_a_clock_calls_it():
    assert [seen().provenance[f"{end}_interval"] for end in ("shortest", "longest")] == [0.001, 0.002]
    assert any("to be called periodically, once every 0.001 s" in line for line in remarks_of(claim().controller))
    assert not any("periodically" in line for line in remarks_of(replace(claim().controller, longest=F(0))))


def remarks_of(law):
    return controller_step(FAULT, law).remarks
