"""Gains chosen by their sampled errors: measured again, proved, and better than the published ones."""

from fractions import Fraction as F

import pytest

import quakedesign as qd
from quakedesign.errors import ParameterError, UnknownNameError
from quakedesign.lyapunov import Verdict
from quakedesign.synthesis.simulated_error import sampling, synthesise_sampled


@pytest.fixture(scope="module")
def fault():
    return qd.load_fault("real-fault")


def test_the_scale_makes_the_unit_bound_enough_for_the_fault(fault):
    trial = sampling(fault)
    from quakedesign.lyapunov.exact.perturbation_bounds import Errors, largest_matched_rate

    needed = largest_matched_rate(fault, trial.divisor, Errors())
    assert 1.1 * float(needed) <= float(trial.scale) <= 1.25 * float(needed)
    assert trial.step == fault.sampling_time
    assert trial.duration == 4000 * fault.sampling_time


@pytest.mark.slow
def test_smaller_gains_chatter_less_and_have_a_proof(fault):
    trial = sampling(fault, scheme="explicit", duration=1000 * fault.sampling_time)
    found = synthesise_sampled(trial, degrees=(5,), rounds=8)
    assert found.certificate.check() is Verdict.PROVED
    assert found.certificate.loop.uncertain["d"] == (-1, 1)
    law = trial.controller(tuple(found.gains.values()))
    run = qd.simulate(fault, law, scheme="explicit", duration=trial.duration, samples=2, plant="printed")
    assert run.metrics.max_slip_rate_error == found.value
    assert found.unit == "m/s"
    assert found.value < found.compared[0].value < found.compared[-1].value
    assert found.compared[0].ratio == pytest.approx(found.compared[0].value / found.value)


def test_errors_are_those_of_the_plant_of_the_certificates(fault):
    """On the stick-slip plant the fault rests in a trial, and all gains have the same error."""
    trial, gains = sampling(fault, duration=200 * fault.sampling_time), (F(7), F(5), F("2.3"), F("1.1"))
    law = trial.controller(gains)
    without, sticking = (
        qd.simulate(fault, law, scheme="explicit", duration=trial.duration, samples=2, plant=plant, compiled=False)
        for plant in ("printed", "stick-slip")
    )
    assert trial.error(gains) == without.metrics.max_slip_rate_error > 10 * sticking.metrics.max_slip_rate_error


def test_what_is_given_takes_the_place_of_what_the_fault_needs(fault):
    trial = sampling(fault, lipschitz="1e-3", gain_range=("0.9", "1.2"), step=0.05)
    assert 1e-3 <= trial.scale < 1.1e-3
    assert trial.gain_range == (F(9, 10), F(6, 5))
    assert trial.step == 0.05
    assert trial.duration == 4000 * 0.05


@pytest.mark.slow
def test_gains_from_the_literature_are_returned_where_nothing_is_better(fault, monkeypatch):
    from quakedesign.synthesis import simulated_error

    monkeypatch.setattr(simulated_error, "synthesise", lambda *_, **__: None)
    monkeypatch.setattr(simulated_error, "_tried", lambda *_: {})
    trial = sampling(fault, duration=400 * fault.sampling_time)
    kept = synthesise_sampled(trial, degrees=(5,))
    assert tuple(kept.gains.values()) in {tuple(c.gains.values()) for c in kept.compared}
    assert min(c.ratio for c in kept.compared) == 1
    assert kept.certificate.check() is Verdict.PROVED


def test_bad_input_gets_one_clear_message(fault):
    with pytest.raises(ParameterError, match="needs a sliding mode"):
        sampling(fault, "elqr")
    with pytest.raises(ParameterError, match="metric must be one of"):
        sampling(fault, metric="speed")
    with pytest.raises(ParameterError, match="metric must be one of"):
        sampling(fault, metric="steps")
    with pytest.raises(ParameterError, match="scheme must be one of"):
        sampling(fault, scheme="best")
    with pytest.raises(ParameterError, match="step must be positive"):
        sampling(fault, step=0)
    with pytest.raises(ParameterError, match="lipschitz must be positive"):
        sampling(fault, lipschitz=0)
    with pytest.raises(UnknownNameError):
        sampling(fault, "pid")
