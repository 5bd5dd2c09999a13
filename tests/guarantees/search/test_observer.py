"""Guarantees of designs that are told the slip alone, with noise, against a simulator of its own."""

import importlib.util
from dataclasses import replace
from fractions import Fraction as F
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from thinned import few

import quakedesign as qd
from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.guarantees import NoProof, TrackingProof, best_guarantee, design_sampled_law, guarantee, worst_tracking
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search.linear_design import Longest, closest, design_at
from quakedesign.loop.loop_setup import LoopSetup
from quakedesign.loop.sensing.measurement import Measurement
from quakedesign.lyapunov.exact.claim import Verdict
from quakedesign.parallel import in_background
from quakedesign.plant import uncertain_plant
from quakedesign.studies import comparison

SPECIFICATION = importlib.util.spec_from_file_location("attacker", Path(__file__).with_name("attacker.py"))
attacker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(attacker)

REAL = load_fault("real-fault")
STEP, NOISE, PERIODS, PIECES = F("0.184"), F(1, 10**6), 40, 6


@cache
def designed(name):
    around = {
        "slip alone": {"measured": "slip", "setup": ExactSetup(slip_noise=NOISE)},
        "both": {"setup": ExactSetup(slip_noise=NOISE, rate_noise=F(1, 10**5))},
    }[name]
    return design_sampled_law(uncertain_plant(REAL), STEP, objective="peak", **around)


def within(largest, claim):
    return largest[0].max() <= claim.claims.slip_error and largest[1].max() <= claim.claims.slip_rate_error


def test_the_slip_alone_is_enough_for_the_target():
    claim = designed("slip alone")
    assert isinstance(claim, TrackingProof)
    assert claim.sampled_loop.law.of_slip_alone
    assert (claim.sampled_loop.slip_noise, claim.check()) == (NOISE, Verdict.PROVED)
    assert claim.claims.slip_rate_error <= F(4, 10**4)
    assert claim.claims.slip_error <= F(12, 10**5)


@few("name", ["slip alone", "both"], every=2)
@pytest.mark.parametrize("sticks", [False, True])
def test_no_course_of_ten_thousand_with_noise_violates_a_guarantee(name, sticks):
    claim, courses = designed(name), 4_000 if sticks else 10_000
    held, back = attacker.numbers(claim), float(claim.task.reference_rates[0]) if sticks else None
    hear = attacker.noisy(held, courses, PERIODS * PIECES, seed=8)
    choose = attacker.slowly(held, PIECES, attacker.switching(held, courses, PERIODS * PIECES, seed=3))
    largest, _ = attacker.run(held, PERIODS, PIECES, choose, courses, back=back, hear=hear)
    assert within(largest, claim)
    assert largest[1].max() > 0.3 * float(claim.claims.slip_rate_error)  # the courses do hurt


def nominal_response(held, k):
    """Of the slip error (0) or the slip-rate error (1) at the end, to a push and to noise in every step."""
    count = PERIODS * PIECES
    ends = attacker.responses(held, PERIODS, PIECES)[k]
    off = np.zeros((2, count))
    for place in (0, 1):
        hear = lambda i, place=place: np.outer(np.arange(2) == place, np.arange(count) == i)  # noqa: E731
        _, end = attacker.run(held, PERIODS, PIECES, attacker.nominal(held), count, hear=hear)
        off[place] = end[k]
    return ends, off


@pytest.mark.slow
@few("name", ["slip alone", "both"], every=2)
def test_noise_along_the_nominal_response_comes_close_and_the_worst_found_is_no_less(name):
    claim, seen = designed(name), []
    held = attacker.numbers(claim)
    for k in (0, 1):
        ends, off = nominal_response(held, k)
        choose = attacker.slowly(held, PIECES, attacker.aligned(held, ends))
        largest, _ = attacker.run(held, PERIODS, PIECES, choose, 4, hear=attacker.heard(held, off))
        quiet, _ = attacker.run(held, PERIODS, PIECES, choose, 4)
        assert largest[k].max() > 1.02 * quiet[k].max()
        assert within(largest, claim)
        seen.append(largest[k].max())
    assert claim.claims.slip_rate_error <= 2 * seen[1]
    found = worst_tracking(claim)
    assert 0.97 * seen[0] <= found.slip_error <= claim.claims.slip_error
    assert 0.97 * seen[1] <= found.slip_rate_error <= claim.claims.slip_rate_error <= 2 * found.slip_rate_error
    assert claim.claims.slip_error <= 2 * found.slip_error


@pytest.mark.slow
def test_the_search_uses_the_noise():
    claim = designed("slip alone")
    quiet = replace(claim, sampled_loop=replace(claim.sampled_loop, slip_noise=F(0)))
    loud, still = worst_tracking(claim), worst_tracking(quiet)
    assert loud.slip_error > 1.02 * still.slip_error
    assert loud.slip_rate_error > 1.02 * still.slip_rate_error


@pytest.mark.slow
def test_with_stick_no_course_is_found_that_leaves_the_bounds():
    claim = designed("slip alone")
    found = worst_tracking(claim, sticks=True)
    assert claim.claims.slip_rate_error / 4 < found.slip_rate_error <= claim.claims.slip_rate_error
    assert claim.claims.slip_error / 4 < found.slip_error <= claim.claims.slip_error


def test_more_noise_is_guaranteed_less():
    claim = designed("slip alone")
    more = guarantee(uncertain_plant(REAL), replace(claim.sampled_loop, slip_noise=2 * NOISE))
    assert more.claims.slip_rate_error > claim.claims.slip_rate_error
    assert more.claims.slip_error > claim.claims.slip_error


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"measured": "rate"}, "measured must be one of slip-and-rate, slip"),
        ({"measured": "slip", "gains": ("1", "1", "1", "1")}, "measured is for the e-LQR"),
        ({"measured": "slip", "controller": "cta"}, "measured is for the e-LQR"),
        ({"slip_noise": F(-1)}, "slip noise must be 0 or more. Received -1 m"),
        ({"measured": "slip", "rate_noise": F(1)}, "needs a law that measures the slip rate"),
    ],
)
def test_what_cannot_be_measured_so_is_refused(wrong, said):
    with pytest.raises(ParameterError, match=said):
        qd.guarantee(REAL, **wrong)


MODULE = "quakedesign.guarantees.search.default_designs"


@pytest.fixture
def asked(monkeypatch):
    """What is asked of the searches of a design, which answer with one that is known."""
    found = {}
    answers = {"design_sampled_law": designed("slip alone"), "longest_step": None, "longest_delay": None}
    for name, known in answers.items():
        monkeypatch.setattr(f"{MODULE}.{name}", lambda *_, n=name, a=known, **told: found.__setitem__(n, told) or a)
    return found


def test_a_design_is_guaranteed_and_run_with_the_noise_that_it_is_made_for(asked, monkeypatch):
    design = qd.design(REAL, "elqr", measured="slip", slip_noise="1e-6")
    claim, told = design.guarantee, {"measured": "slip", "setup": ExactSetup(slip_noise=NOISE)}
    assert asked["design_sampled_law"] == told | {"objective": "tracking"}
    assert (asked["longest_step"], asked["longest_delay"]) == (told, told)
    assert (design.verdict, claim) == (Verdict.PROVED, designed("slip alone"))
    assert (design.details["measured"], design.details["slip_noise"]) == ("slip", "1/1000000")
    ran = []
    monkeypatch.setattr(comparison, "simulate", lambda *_, measurement, **__: ran.append(measurement))
    with in_background() as runs:
        for one in (design, replace(design, setup=LoopSetup())):
            comparison._begun("designed", one, {"designed": "explicit"}, runs, None)[1].result()
    assert ran == [Measurement(slip_noise=1e-6, bounded=True), None]


def test_the_noisy_run_of_a_design_stays_within_its_guarantee():
    claim = designed("slip alone")
    noise = Measurement(slip_noise=1e-6, bounded=True)
    for measurement in (None, noise):
        seen = qd.simulate(REAL, claim.sampled_loop.controller, duration=18400.0, measurement=measurement).metrics
        assert 0 < seen.max_slip_error <= claim.claims.slip_error
        assert 0 < seen.max_slip_rate_error <= claim.claims.slip_rate_error


def test_a_delay_is_designed_for_with_the_slip_alone():
    near = closest(uncertain_plant(REAL), STEP, measured="slip", setup=ExactSetup(slip_noise=NOISE, delay=F("0.1")))
    assert near.distance < 1
    found = best_guarantee(uncertain_plant(REAL), near.sampled_loop)
    assert found.sampled_loop.law.of_slip_alone
    assert (found.sampled_loop.slip_noise, found.sampled_loop.delay) == (NOISE, F("0.1"))
    assert found.sampled_loop.law.states[-1] == "asked_1_ago"
    assert found.check() is Verdict.PROVED


def test_near_the_longest_time_a_design_is_sought_for_what_a_guarantee_measures(monkeypatch):
    claim, told, none = designed("slip alone"), [], NoProof(reason="none")
    monkeypatch.setattr(
        "quakedesign.guarantees.search.linear_design.nearby", lambda *a, **k: told.append((a[:2], k)) or none
    )
    assert design_at(claim.task, Longest(claim, np.zeros(4))) is claim
    assert told == [((claim.task, STEP), {"measured": "slip", "setup": ExactSetup(slip_noise=NOISE)})]
