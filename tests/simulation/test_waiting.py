"""A run that ends before its event says so, and when the event would begin."""

from dataclasses import replace

import numpy as np
import pytest

from quakedesign.fault import Disturbance, load_fault
from quakedesign.report.sentences import run_sentences
from quakedesign.simulation import simulate
from quakedesign.simulation.earthquake import waiting

REAL = load_fault("real-fault")
QUIET = REAL.with_disturbance(Disturbance())


def test_at_rest_without_disturbance_nothing_ever_begins():
    run = simulate(QUIET, duration=60, samples=50)
    found = waiting(run, QUIET)
    assert run.metrics.peak_slip_rate == 0
    assert found.onset is None
    assert found.growth == pytest.approx(0.468, abs=1e-3)
    assert "has not begun by 59.98 s: no forward disturbance acts" in run_sentences(run, QUIET)[1]


def test_a_small_push_begins_where_a_longer_run_does():
    pushed = REAL.with_disturbance(Disturbance(constant=1e-12))
    found = waiting(simulate(pushed, duration=30, samples=50), pushed)
    longer = simulate(pushed, duration=120, samples=2000)
    begun = longer.time[np.argmax(longer.slip_rate > 0.1 * longer.criterion.natural_peak)]
    assert found.onset == pytest.approx(begun, abs=1.5)
    assert waiting(longer, pushed) is None


def test_a_stable_fault_waits_for_nothing():
    stable = replace(QUIET, friction=replace(REAL.friction, drop=0.0))
    assert waiting(simulate(stable, duration=60, samples=50), stable) is None
