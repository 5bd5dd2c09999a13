"""Metrics from inside the loop against NumPy on a run that keeps every step."""

from dataclasses import fields

import numpy as np
import pytest
from thinned import few

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.laws import published
from quakedesign.simulation import Metrics, simulate

REAL = load_fault("real-fault")


@pytest.fixture(params=("cta", "dia", "elqr"))
def law(request):
    return published("real-fault")[request.param]


@few("settled_from", [None, 0.0, 300.0], every=2)
def test_they_agree_with_numpy(law, settled_from):
    run = simulate(REAL, law, duration=800.0, samples=10**6, settled_from=settled_from, plant="printed")
    start = 200.0 if settled_from is None else settled_from
    kept = run.time > start
    slip_error, rate_error = run.slip_error[kept], run.slip_rate_error[kept]
    changes = np.abs(np.diff(run.pressure))
    expected = {
        "max_slip_error": np.max(np.abs(slip_error)),
        "max_slip_rate_error": np.max(np.abs(rate_error)),
        "rms_slip_error": np.sqrt(np.mean(slip_error**2)),
        "rms_slip_rate_error": np.sqrt(np.mean(rate_error**2)),
        "mise_slip": np.mean(slip_error**2),
        "mise_slip_rate": np.mean(rate_error**2),
        "rms_pressure": np.sqrt(np.mean(run.pressure[kept] ** 2)),
        "pressure_total_variation": np.sum(changes[kept[1:]]),
        "reverse_slip_fraction": np.mean(run.slip_rate[kept] < 0),
        "peak_slip_rate": np.max(np.abs(run.slip_rate)),
        "max_h_rate": np.max(np.abs(np.diff(run.matched_perturbation))) / 0.184,
        "max_pressure": np.max(run.pressure),
        "min_pressure": np.min(run.pressure),
    }
    found = run.metrics.to_dict()
    assert set(found) - set(expected) == {"time_at_rest_fraction", "settled_from", "steps", "seconds"}
    assert found["time_at_rest_fraction"] is None
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, rel=1e-11), name
    assert found["steps"] == len(run.time) - 1


def test_they_do_not_depend_on_what_is_kept(law):
    few, many = (simulate(REAL, law, duration=500.0, samples=n).metrics.to_dict() for n in (3, 1000))
    assert few | {"seconds": 0} == many | {"seconds": 0}


def test_without_control_only_peak_and_rest_are_given():
    found = simulate(REAL, duration=30.0).metrics.to_dict()
    assert {name for name, value in found.items() if value is not None} == {
        "peak_slip_rate",
        "time_at_rest_fraction",
        "settled_from",
        "steps",
        "seconds",
    }


def test_errors_that_count_from_the_end_of_the_run_on_are_refused(law):
    with pytest.raises(ParameterError, match="settled_from must be at least 0 s and less than the duration of 30"):
        simulate(REAL, law, duration=30.0, settled_from=31.0)


def test_every_figure_has_a_unit():
    assert all(isinstance(Metrics.unit(field.name), str) for field in fields(Metrics))
