"""Designed guarantees against the targets and against a simulator that shares nothing with the package."""

import importlib.util
from dataclasses import replace
from fractions import Fraction as F
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from thinned import few

import quakedesign as qd
from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.guarantees import (
    NoProof,
    TrackingGuarantee,
    TrackingProof,
    design_sampled_law,
    guarantee,
    worst_tracking,
)
from quakedesign.guarantees.exact.guarantee_files import parse_guarantee
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search import linear_design
from quakedesign.guarantees.search.linear_design import _with_noise, closest
from quakedesign.guarantees.search.worst_case import WorstCase
from quakedesign.laws import published
from quakedesign.laws.elqr import ExtendedLQR
from quakedesign.lyapunov.exact.claim import Verdict
from quakedesign.plant import uncertain_plant
from quakedesign.synthesis import Design, state_feedback

SPECIFICATION = importlib.util.spec_from_file_location("attacker", Path(__file__).with_name("attacker.py"))
attacker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(attacker)

PROOFS = Path(__file__).parents[3] / "proofs" / "certificates"

# loop: fault, T_s, objective, largest certified slip-rate error [m/s], largest certified slip error [m]
ROWS = {
    "real peak": ("real-fault", F("0.184"), "peak", 2.0e-4, 8e-5),
    "real tracking": ("real-fault", F("0.184"), "tracking", 3.0e-4, 6e-5),
    "lab 1 ms": ("lab-fault", F("0.001"), "tracking", np.inf, np.inf),
    "lab 2 ms": ("lab-fault", F("0.002"), "peak", np.inf, np.inf),
    "real one period late": ("real-fault", F("0.184"), "peak", 6e-4, np.inf),
}
DELAYS = {"real one period late": F("0.184")}


@cache
def designed(row):
    name, step, objective, *_ = ROWS[row]
    return design_sampled_law(
        uncertain_plant(load_fault(name)), step, objective=objective, setup=ExactSetup(delay=DELAYS.get(row, F(0)))
    )


@cache
def worst(row, sticks=False):
    return worst_tracking(designed(row), sticks=sticks)


def courses(held, pieces, count, seed, periods):
    """Courses of all that may switch; friction depends on the slip alone."""
    return attacker.slowly(held, pieces, attacker.switching(held, count, periods * pieces, seed=seed))


def aligned(held, periods, pieces, k):
    """Largest error k of courses along the response of the loop with either end of β, and before it at the other."""
    found = []
    for gain in held.beta:
        ends = attacker.responses(replace(held, beta=(gain, gain)), periods, pieces)
        choose = attacker.slowly(held, pieces, attacker.aligned(held, ends[k]))
        found.append(attacker.run(held, periods, pieces, choose, 4)[0][k].max())
    return max(found)


@few("row", ROWS, every=5)
def test_designs_are_guaranteed_within_the_targets(row):
    claim, (*_, rate, slip) = designed(row), ROWS[row]
    assert isinstance(claim, TrackingProof)
    assert claim.check() is Verdict.PROVED
    assert claim.claims.slip_rate_error <= rate
    assert claim.claims.slip_error <= slip


@pytest.mark.slow
def test_the_class_rate_is_guaranteed_far_lower():
    claim = guarantee(
        uncertain_plant(load_fault("real-fault"), rate_limited=True), designed("real tracking").sampled_loop
    )
    assert claim.claims.slip_rate_error <= F(7, 10**5)
    assert claim.claims.slip_error <= F(5, 10**5)


@pytest.mark.slow
@pytest.mark.parametrize("objective", [pytest.param("tracking", marks=pytest.mark.slow), "peak"])
def test_a_law_for_the_class_rate_is_chosen_for_that_class(objective):
    claim = design_sampled_law(
        uncertain_plant(load_fault("real-fault"), rate_limited=True), F("0.184"), objective=objective
    )
    assert claim.claims.slip_rate_error <= F(7, 10**5)
    assert claim.claims.slip_error <= F(1, 10**5)


@few("row", ROWS, every=5)
def test_no_course_of_ten_thousand_violates_a_guarantee(row):
    claim = designed(row)
    held = attacker.numbers(claim)
    largest, _ = attacker.run(held, 40, 6, courses(held, 6, 10_000, 3, 40), 10_000)
    assert largest[0].max() <= claim.claims.slip_error
    assert largest[1].max() <= claim.claims.slip_rate_error
    assert largest[1].max() > 0.3 * float(claim.claims.slip_rate_error)  # the courses do hurt


@pytest.mark.slow
def test_the_worst_found_is_no_less_than_what_a_disturbance_does_to_the_plant_that_forgets_last():
    """Friction that falls as fast as it may, at its least: a linear loop, and a disturbance along its own response."""
    claim = designed("real peak")
    held, periods, pieces = attacker.numbers(claim), 350, 2
    plant = replace(held, s=2 * held.s[1:], w=2 * held.w[1:], beta=2 * held.beta[:1])
    response = attacker.responses(plant, periods, pieces)[0]
    largest, _ = attacker.run(plant, periods, pieces, attacker.aligned(plant, response), 1)
    found = worst("real peak").slip_error
    assert largest[0].max() <= found <= claim.claims.slip_error


@few("row", ROWS, every=5)
def test_courses_along_the_nominal_response_come_close_and_stay_below(row):
    claim = designed(row)
    seen = [aligned(attacker.numbers(claim), 60, 8, k) for k in (0, 1)]
    assert seen[0] <= claim.claims.slip_error
    assert seen[1] <= claim.claims.slip_rate_error <= 2 * seen[1]
    if row == "real peak":
        assert claim.claims.slip_rate_error <= 1.5 * seen[1]


def test_where_stick_leaves_the_bounds_the_answer_says_so():
    claim = designed("real peak")
    beyond = WorstCase(slip_error=1.01 * float(claim.claims.slip_error), slip_rate_error=0.0)
    found = TrackingGuarantee(fault=load_fault("real-fault"), proof=claim, stick_search=beyond)
    assert found.lines()[-1].startswith("on the stick-slip plant a run was found that exceeds the bounds")
    within = replace(found, stick_search=replace(beyond, slip_error=0.99 * float(claim.claims.slip_error)))
    assert not within.exceeded_on_stick_slip


@few("row", ROWS, every=5)
def test_a_designed_law_left_to_itself_settles_but_for_its_integral(row):
    """On a fault that rests whatever the pressure, the pressure that is asked for grows evenly, and no faster."""
    law = designed(row).sampled_loop.law
    rows, seen, output = (np.array(m, dtype=float) for m in (law.update, law.measured, law.output))
    states, asked = np.zeros(len(output)), []
    for _ in range(260):
        asked.append(output @ states)
        states = rows @ states + seen @ [1e-6, -1e-6]
    assert np.abs(np.diff(asked, 2)[-60:]).max() < 1e-8 * np.abs(asked).max()


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS)
def test_with_stick_no_course_leaves_the_bounds(row):
    """The reference moves at its largest rate; the fault never slides backward."""
    claim = designed(row)
    held, back = attacker.numbers(claim), float(claim.task.reference_rates[0])
    largest, _ = attacker.run(held, 60, 6, courses(held, 6, 4_000, 5, 60), 4_000, back=back)
    assert largest[0].max() <= claim.claims.slip_error
    assert largest[1].max() <= claim.claims.slip_rate_error
    found = worst(row, sticks=True)
    assert found.slip_error <= claim.claims.slip_error
    assert found.slip_rate_error <= claim.claims.slip_rate_error


@few("row", ROWS, every=5)
def test_the_worst_found_is_below_the_bound_and_no_less_than_the_attacker_s(row):
    claim = designed(row)
    found, held = worst(row), attacker.numbers(claim)
    largest, _ = attacker.run(held, 40, 6, courses(held, 6, 1_000, 4, 40), 1_000)
    assert largest[1].max() <= found.slip_rate_error <= claim.claims.slip_rate_error
    assert found.slip_error <= claim.claims.slip_error


@pytest.mark.parametrize("delay", [F("0.03"), F("0.1")])
def test_a_delay_is_attacked_too(delay):
    task = uncertain_plant(load_fault("real-fault"))
    claim = guarantee(task, replace(designed("real peak").sampled_loop, delay=delay))
    if delay == F("0.03"):
        assert isinstance(claim, TrackingProof)
    if isinstance(claim, NoProof):
        assert "small gain" in claim.reason
        assert claim.small_gain >= 1
        return
    held = attacker.numbers(claim)
    ends = attacker.responses(held, 60, 46)
    largest, _ = attacker.run(held, 60, 46, attacker.aligned(held, ends[1]), 1)
    assert largest[1].max() <= claim.claims.slip_rate_error <= 2 * largest[1].max()


def test_sharper_claims_are_not_proved():
    claim = designed("real tracking")
    for name in ("slip_error", "slip_rate_error", "peak_slip_rate", "largest_pressure", "least_pressure"):
        sharper = type(getattr(claim.claims, name))(getattr(claim.claims, name) * F(99, 100))
        wrong = replace(claim, claims=replace(claim.claims, **{name: sharper}))
        assert wrong.check() is Verdict.UNDECIDED


def test_a_step_far_too_long_has_no_guarantee_and_says_why():
    found = design_sampled_law(uncertain_plant(load_fault("real-fault")), F(2), objective="peak")
    assert isinstance(found, NoProof)
    assert "is not stable" in found.reason


def test_a_step_beyond_all_sizes_is_refused():
    for search in (closest, design_sampled_law):
        with pytest.raises(ParameterError, match=r"step must be positive, between 1e-9 s and 1e9 s\."):
            search(uncertain_plant(load_fault("real-fault")), F(10) ** 400)


def test_a_step_in_which_errors_outgrow_all_numbers_has_none_either():
    """The pole (√(w² + 4s) − w)/2 with s = 0.4493 1/s² and w = 1.6 1/s is 0.2437 1/s, for an hour: e^877."""
    task = uncertain_plant(load_fault("real-fault"))
    for found in (design_sampled_law(task, F(3600)), closest(task, F(3600))):
        assert isinstance(found, NoProof)
        assert found.reason == "errors grow by a factor of e^877 within T_s = 3600 s"


def test_another_objective_is_refused():
    with pytest.raises(ParameterError, match="tracking, peak"):
        design_sampled_law(uncertain_plant(load_fault("real-fault")), F(1), objective="speed")


def test_designs_say_what_is_guaranteed_of_them_as_they_run():
    """The published e-LQR is unstable with a hold over 184 ms; gains for the sampled loop are guaranteed."""
    fault = load_fault("real-fault")
    gains = dict(zip(("k1", "k2", "k3", "k4"), map(F, ("6.96e8", "2.53e8", "6.02e8", "2.16e8")), strict=True))
    made = [
        Design(fault=fault, name=law.name, verdict=Verdict.UNDECIDED, controller=law, certificate=None, premises=())
        for law in (
            ExtendedLQR(gains=gains),
            ExtendedLQR(gains=published("real-fault")["elqr"].gains),
            published("real-fault")["cta"],
        )
    ]
    held, unstable, sliding = (design.guarantee for design in made)
    assert isinstance(held, TrackingProof)
    assert held.check() is Verdict.PROVED
    assert unstable.check() is sliding.check() is Verdict.UNDECIDED
    assert unstable.sentence().startswith("none: with zero-order hold over 0.184 s even the nominal loop is not stable")
    assert sliding.sentence().startswith("none: 2-CTA is designed in continuous time, and a sampled controller cannot")
    assert sliding.sentence().endswith("without --continuous, and in the scheme stick-slip")


@pytest.mark.slow
@few("row", ["real peak", "real tracking"], every=2)
def test_the_worst_found_with_stick_is_no_less_than_the_attacker_s(row):
    claim = designed(row)
    found, held, back = worst(row, sticks=True), attacker.numbers(claim), float(claim.task.reference_rates[0])
    largest, _ = attacker.run(held, 40, 24, courses(held, 24, 500, 6, 40), 500, back=back)
    assert largest[1].max() <= found.slip_rate_error <= claim.claims.slip_rate_error
    assert largest[0].max() <= found.slip_error <= claim.claims.slip_error


# slip error [m] and slip-rate error [m/s] of an attacker of its own, exact where the fault stops: 150 periods, a
# push and a slope in every quarter, sign ascent along the adjoint from a hundred starts, crossed and shifted
BY_ASCENT = {
    ("real-fault", "elqr"): (2.6085e-5, 1.3677e-4),
    ("real-fault", "cta"): (2.6095e-5, 1.4144e-4),
    ("lab-fault", "elqr"): (2.3756e-7, 2.2737e-4),
}


@pytest.mark.slow
@few("fault_and_law", BY_ASCENT, every=3)
def test_the_worst_found_with_stick_is_that_of_an_attacker_who_lets_the_fault_rest(fault_and_law):
    """Ahead of its reference the fault rests for 60 to 90 periods, and the law follows: in 64 periods 7 % less."""
    name, controller = fault_and_law
    answer = qd.guarantee(load_fault(name), controller=controller, plant="printed")
    claim = answer.compensation.proof if answer.compensation else answer.proof
    found, (slip, rate) = worst_tracking(claim, sticks=True), BY_ASCENT[fault_and_law]
    assert 0.99 * slip <= found.slip_error <= claim.claims.slip_error
    assert 0.99 * rate <= found.slip_rate_error <= claim.claims.slip_rate_error


NOISES = [({"slip_noise": "1e-6"}, True), ({"slip_noise": "5", "rate_noise": "1/10"}, False)]


@pytest.mark.parametrize(("noise", "proved"), NOISES)
def test_noise_is_blamed_for_what_it_does_to_a_law_that_is_proved_without(noise, proved):
    """No small gain of a linear law depends on noise: what it does is to open the fault."""
    without = parse_guarantee((PROOFS / "guarantee_real-fault.json").read_text())
    bounds = {name: F(bound) for name, bound in noise.items()}
    found = _with_noise(without, bounds)
    assert isinstance(found, TrackingProof) is proved
    if proved:
        assert found.sampled_loop.noise == bounds | {"rate_noise": F(0)} or found.sampled_loop.noise == bounds
        return
    assert found.reason.startswith("with slip noise of 5 m and rate noise of 0.1 m/s: the pressure may rise to ")
    assert found.reason.endswith(": the fault may open; without noise a law is proved")


def test_a_design_that_noise_leaves_without_a_proof_is_designed_without_noise(monkeypatch):
    stored, noises = parse_guarantee((PROOFS / "guarantee_real-fault.json").read_text()), []

    def laws(task, step, measured, setup):
        noises.append(setup.slip_noise)
        held = replace(stored.sampled_loop, slip_noise=setup.slip_noise)
        family = SimpleNamespace(starts=[np.zeros(3)])
        best = {"least_peak": lambda x: (0.5, x), "seen": lambda x: None, "sampled_loop": lambda x: held}
        return SimpleNamespace(template=held, family=family, **best)

    monkeypatch.setattr(linear_design._Laws, "of", laws)
    found = design_sampled_law(
        stored.task, stored.sampled_loop.step, objective="peak", setup=ExactSetup(slip_noise=F(5))
    )
    assert noises == [5, 0]
    assert found.reason.startswith("with slip noise of 5 m: the pressure may rise to ")
    assert found.reason.endswith("; without noise a law is proved")


@pytest.mark.slow
def test_the_first_words_are_that_nothing_is_guaranteed_at_the_step_that_was_asked_for(monkeypatch):
    """Where a design for a shorter one is: it comes second."""
    shorter = parse_guarantee((PROOFS / "guarantee_real-fault.json").read_text())
    none = NoProof(reason="small gain 2")
    monkeypatch.setattr(state_feedback, "design_sampled_law", lambda *_, **__: none)
    monkeypatch.setattr(state_feedback, "longest_step", lambda *_, **__: shorter)
    monkeypatch.setattr(state_feedback, "design_at", lambda *_: shorter)
    for search in ("design_near_longer_step", "nearest_setup"):
        monkeypatch.setattr(state_feedback, search, lambda *_, **__: None)
    found = qd.guarantee(load_fault("real-fault"), step=F("0.5"), plant="printed")
    assert not found.proved
    assert found.lines()[:2] == [
        "not guaranteed at T_s = 0.5 s: small gain 2", f"with T_s = 0.184 s: {shorter.sentence()}"
    ]  # fmt: skip
    monkeypatch.setattr(state_feedback, "longest_step", lambda *_, **__: None)
    assert qd.guarantee(load_fault("real-fault"), step=F("0.5")).lines()[0] == "none: small gain 2"
