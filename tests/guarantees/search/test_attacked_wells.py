"""Guarantees through rock, behind a lag and of the class `rate` against ten thousand courses of its own simulator."""

import importlib.util
from dataclasses import replace
from fractions import Fraction as F
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from thinned import few

from quakedesign.fault import load_fault
from quakedesign.guarantees import design_sampled_law
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.lyapunov import Verdict
from quakedesign.plant import uncertain_plant

SPECIFICATION = importlib.util.spec_from_file_location("attacker", Path(__file__).with_name("attacker.py"))
attacker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(attacker)

REAL, STEP = load_fault("real-fault"), F("0.05")
WELLS = {1: (1.2e-4, 1.5), 2: (2.0e-4, 1.5), 5: (6e-4, 2)}  # L²/D [s]: certified slip-rate error [m/s], over found


@cache
def through(rock):
    return design_sampled_law(uncertain_plant(REAL), STEP, objective="peak", setup=ExactSetup(diffusion=F(rock)))


def worst(held, periods, pieces, *chosen):
    """Largest slip error and slip-rate error of several choices."""
    return np.max(
        [attacker.run(held, periods, pieces, choose, count)[0].max(axis=1) for choose, count in chosen], axis=0
    )


def along(held, periods, pieces, slowed=lambda choose: choose):
    """Courses along the responses of both errors, with either end of β."""
    for gain in held.beta:
        ends = attacker.responses(replace(held, beta=(gain, gain)), periods, pieces)
        for response in ends:
            yield slowed(attacker.slowly(held, pieces, attacker.aligned(held, response))), 4


def test_the_modes_of_the_layer_are_its_closed_form():
    """Against the images of wells beyond the fault, Σ (−1)ⁿ 2 erfc((2n + 1) √τ / (2 √t)), which converge early."""
    from scipy.special import erfc

    rates, shares = attacker.spreading(2.0, 40)
    assert shares.sum() == pytest.approx(1, abs=1e-15)
    for t in (0.02, 0.3, 4.0):
        images = sum((-1) ** n * 2 * erfc((2 * n + 1) * np.sqrt(2.0 / t) / 2) for n in range(30))
        assert 1 - shares @ np.exp(-rates * t) == pytest.approx(images, abs=2e-12 + 0.02 * np.exp(-rates[-1] * t))


@pytest.mark.slow
@pytest.mark.parametrize("rock", WELLS)
def test_no_course_of_ten_thousand_violates_a_guarantee_through_rock(rock):
    claim, (most, ratio) = through(rock), WELLS[rock]
    assert claim.check() is Verdict.PROVED
    assert claim.claims.slip_rate_error <= most
    held, periods, pieces = attacker.numbers(claim), 40 * rock + 80, 4
    random = attacker.slowly(held, pieces, attacker.switching(held, 10_000, periods * pieces, seed=3))
    slip, rate = worst(held, periods, pieces, (random, 10_000), *along(held, periods, pieces))
    assert slip <= claim.claims.slip_error
    assert rate <= claim.claims.slip_rate_error <= ratio * rate
    fine = worst(replace(held, modes=400), periods, 2 * pieces, *along(held, periods, 2 * pieces))
    assert np.all(fine <= (claim.claims.slip_error, claim.claims.slip_rate_error))
    assert fine[1] == pytest.approx(rate, rel=0.05)


def test_a_lag_is_followed_as_its_closed_form():
    """A pressure of 1 from the first sample on: v = 1 − e^{−t/lag}, seen as what the plant is pushed with."""
    seen, nothing = [], np.zeros((1, 1))
    held = attacker.Held(
        nothing, np.zeros((1, 2)), np.ones(1), np.zeros(2), 1.0, (0, 0), (0, 0), (1, 1), 0.5, 0.0, 0.0, lag=0.3
    )
    held = replace(held, F=np.ones((1, 1)), first=np.array([[1.0, 0.0]]))
    choose = lambda k, e, v: seen.append(float(v[0])) or (0, 0, 1.0, 0.0)  # noqa: E731
    attacker.run(held, 4, 10, choose, 1, start=[[1.0], [0.0]])
    assert seen == pytest.approx(1 - np.exp(-0.05 / 0.3 * np.arange(40)), rel=1e-12)


LAGS = {("0.184", "0.2"): 2.3e-4, ("0.05", "0.2"): 6.6e-5, ("0.184", "0.001"): 1.8e-4}  # T_s, lag [s]: certified [m/s]


@pytest.mark.slow
@pytest.mark.parametrize("count", [500, pytest.param(10_000, marks=pytest.mark.slow)])
@few("times", LAGS, every=3)
def test_no_course_violates_a_guarantee_behind_a_lag(times, count):
    step, lag = map(F, times)
    claim = design_sampled_law(uncertain_plant(REAL), step, setup=ExactSetup(lag=lag))
    assert claim.check() is Verdict.PROVED
    assert claim.claims.slip_rate_error <= LAGS[times]
    held, periods, pieces = attacker.numbers(claim), 60, 6
    random = attacker.switching(held, count, periods * pieces, seed=3)
    slowed = (lambda choose: attacker.slowly(held, pieces, choose)) if claim.varying_gain else lambda choose: choose
    ends = attacker.responses(held, periods, pieces)
    aligned = [(slowed(attacker.aligned(held, response)), 4) for response in ends]
    slip, rate = worst(held, periods, pieces, (slowed(random), count), *aligned)
    assert slip <= claim.claims.slip_error
    assert rate <= claim.claims.slip_rate_error <= 2 * rate


SLIP_ALONE = {
    "lag": ({"lag": F("0.05")}, F("0.184"), 2.6e-4, 400),
    "rock": ({"diffusion": F(1)}, STEP, 2.5e-4, 5000),
}


@pytest.mark.slow
@pytest.mark.parametrize("behind", ["lag", "rock"])
def test_no_course_with_noise_violates_a_guarantee_of_the_slip_alone(behind):
    around, step, most, count = SLIP_ALONE[behind]
    claim = design_sampled_law(
        uncertain_plant(REAL), step, measured="slip", setup=ExactSetup(slip_noise=F(1, 10**6), **around)
    )
    assert claim.sampled_loop.law.of_slip_alone
    assert claim.check() is Verdict.PROVED
    assert claim.claims.slip_rate_error <= most
    held, periods, pieces = attacker.numbers(claim), 60, 6
    slowed = (lambda choose: attacker.slowly(held, pieces, choose)) if claim.varying_gain else lambda choose: choose
    hear = attacker.noisy(held, count, periods * pieces, seed=5)
    random = slowed(attacker.switching(held, count, periods * pieces, seed=3))
    seen = [attacker.run(held, periods, pieces, random, count, hear=hear)[0].max(axis=1)]
    for response in attacker.responses(held, periods, pieces):
        chosen = slowed(attacker.aligned(held, response))
        seen.append(attacker.run(held, periods, pieces, chosen, 4, hear=lambda k: hear(k)[:, :4])[0].max(axis=1))
    slip, rate = np.max(seen, axis=0)
    assert slip <= claim.claims.slip_error
    assert rate <= claim.claims.slip_rate_error <= 2.5 * rate


@pytest.mark.slow
def test_behind_a_short_lag_a_design_holds_as_well_as_behind_none():
    task, step = uncertain_plant(REAL), F("0.184")
    short, none = design_sampled_law(task, step, setup=ExactSetup(lag=F("0.001"))), design_sampled_law(task, step)
    for name in ("slip_error", "slip_rate_error"):
        assert getattr(short.claims, name) == pytest.approx(getattr(none.claims, name), rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("objective", ["peak", "tracking"])
def test_no_course_of_ten_thousand_violates_a_guarantee_of_the_class_rate(objective):
    task = uncertain_plant(REAL, rate_limited=True)
    claim = design_sampled_law(task, F("0.184"), objective=objective)
    assert claim.check() is Verdict.PROVED
    held, periods, pieces = attacker.numbers(claim, task.amplitude), 60, 6
    drifts = lambda choose: attacker.drifting(held, float(task.change), pieces, choose)  # noqa: E731
    random = attacker.slowly(held, pieces, attacker.switching(held, 10_000, periods * pieces, seed=3))
    slip, rate = worst(held, periods, pieces, (drifts(random), 10_000), *along(held, periods, pieces, drifts))
    assert slip <= claim.claims.slip_error
    assert rate <= claim.claims.slip_rate_error <= 2 * rate


def test_a_drifting_disturbance_keeps_its_rate_and_its_amplitude():
    held = attacker.Held(None, None, None, None, 1.0, (0, 0), (0, 0), (1, 1), 0.1, 0.0, 1.0)
    choose = attacker.drifting(held, 2.0, 4, lambda k, e, v: (0, 0, 0, np.array([-1.0, 1.0]) * (1 if k < 300 else -1)))
    course = np.array([choose(k, None, None)[3] for k in range(600)])
    assert np.abs(course).max() <= 1
    assert np.abs(np.diff(course, axis=0)).max() * 4 / held.step == pytest.approx(2.0)
