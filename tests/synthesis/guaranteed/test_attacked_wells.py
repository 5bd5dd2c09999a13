"""Guarantees through rock and of the class `rate` against ten thousand courses of a simulator of its own."""

import importlib.util
from dataclasses import replace
from fractions import Fraction as F
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from quakedesign.certificates import Verdict
from quakedesign.certificates.guarantee import task_of
from quakedesign.fault import load_fault
from quakedesign.synthesis.guaranteed import design_held

SPECIFICATION = importlib.util.spec_from_file_location("attacker", Path(__file__).with_name("attacker.py"))
attacker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(attacker)

REAL, STEP = load_fault("real-fault"), F("0.05")
WELLS = {1: (1.2e-4, 1.5), 2: (2.0e-4, 1.5), 5: (6e-4, 2)}  # L²/D [s]: certified slip-rate error [m/s], over found


@cache
def through(rock):
    return design_held(task_of(REAL), STEP, objective="peak", diffusion=F(rock))


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


@pytest.mark.slow
@pytest.mark.parametrize("objective", ["peak", "tracking"])
def test_no_course_of_ten_thousand_violates_a_guarantee_of_the_class_rate(objective):
    task = task_of(REAL, rate_limited=True)
    claim = design_held(task, F("0.184"), objective=objective)
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
