"""Which instants of a long run are kept: those of something that repeats must not be of one phase."""

import math

import numpy as np
import pytest

from quakedesign.fault import load_fault
from quakedesign.laws import published
from quakedesign.simulation import simulate
from quakedesign.simulation.stepping import instants

REAL = load_fault("real-fault")


@pytest.mark.parametrize("steps", [1, 2, 3, 7, 100, 1999, 2000, 2001, 3_600_000])
@pytest.mark.parametrize("samples", [1, 2, 3, 2000])
def test_first_and_last_are_kept_and_one_of_every_stride(steps, samples):
    kept = np.array(instants(steps, samples))
    stride = math.ceil(steps / samples)
    assert (kept[0], kept[-1]) == (0, steps)
    assert np.all(np.diff(kept) > 0)
    assert np.array_equal(kept[:-1] // stride, np.arange(len(kept) - 1))
    assert len(kept) - 1 <= samples
    if steps <= samples:
        assert np.array_equal(kept, np.arange(steps + 1))


@pytest.mark.parametrize("stride", [2, 3, 4, 18, 1800, 7200])
@pytest.mark.parametrize("period", [2, 3, 4, 5, 7, 8, 18, 49.19, 91.06, 100, 1799, 1800, 1800.01])
def test_whatever_repeats_is_met_in_all_its_phases(stride, period):
    """At equal distances of 1800 steps periods of 2, 18 and 1800 would be met in one phase."""
    kept = np.array(instants(2000 * stride, 2000))
    phases = np.sort(kept % period) / period
    gaps = np.diff([*phases, phases[0] + 1])
    assert gaps.max() <= max(0.02, 1 / period + 1e-9)


@pytest.mark.parametrize("period", [2, 18, 91.06, 1800])
def test_already_a_band_of_forty_instants_meets_most_phases(period):
    """Figures draw the extremes of forty; those of a sine are then met to 7 % of its amplitude, or as steps have it."""
    kept = np.array(instants(3_600_000, 2000))
    angles = 2 * np.pi * np.arange(int(period)) / period
    for first in range(0, 1960, 40):
        seen = np.sin(2 * np.pi * kept[first : first + 40] / period + 0.3)
        assert seen.max() > np.sin(angles + 0.3).max() - 0.07
        assert seen.min() < np.sin(angles + 0.3).min() + 0.07


def test_a_decimated_run_shows_the_chatter_that_its_metrics_tell():
    """Explicit 2-CTA: at every even step alone one would see half of it."""
    run = simulate(
        REAL, published("real-fault")["cta"], scheme="explicit", duration=4000.0, samples=500, plant="printed"
    )
    settled = run.time > run.metrics.settled_from
    assert run.metrics.steps / 500 > 40
    for errors, largest in (
        (run.slip_error, run.metrics.max_slip_error),
        (run.slip_rate_error, run.metrics.max_slip_rate_error),
    ):
        assert 0.9 * largest < np.abs(errors[settled]).max() <= largest
        assert errors[settled].min() < -0.5 * largest
        assert errors[settled].max() > 0.5 * largest
