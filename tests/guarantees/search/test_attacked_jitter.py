"""Guarantees with jitter and slow pumps against thousands of courses of a simulator that shares nothing with them."""

import importlib.util
from dataclasses import replace
from fractions import Fraction as F
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from thinned import few

from quakedesign.guarantees import NoProof, guarantee, worst_tracking
from quakedesign.guarantees.exact.guarantee_files import parse_guarantee
from quakedesign.guarantees.search.float_bounds import estimated
from quakedesign.guarantees.search.worst_case import _events, _on_time
from quakedesign.loop.loop_setup import Pump
from quakedesign.lyapunov.exact.claim import Verdict

SPECIFICATION = importlib.util.spec_from_file_location("attacker", Path(__file__).with_name("attacker.py"))
attacker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(attacker)

PROOFS = Path(__file__).parents[3] / "proofs" / "certificates"
PIECES = 46  # of 4 ms for the real fault
ROWS = {
    "jitter": ("real-fault", {"jitter": F("0.004")}, 1.75),
    "of the delay": ("real-fault", {"delay_jitter": F("0.008")}, 1.6),
    "late": ("late_real-fault", {"jitter": F("0.004")}, 2.6),
    "means": ("real-fault", {"averaging": F("0.016"), "delay": F("0.008")}, 2.2),
    "slow pump": ("real-fault", {"pump": Pump(rate=F(8_000_000))}, 1.6),
    "both": ("real-fault", {"jitter": F("0.004"), "pump": Pump(rate=F(20_000_000))}, 2.4),
    "sliding mode": ("cta_real-fault", {"jitter": F("0.004")}, 2.2),
}


@cache
def proved(row):
    name, changes, _ = ROWS[row]
    known = parse_guarantee((PROOFS / f"guarantee_{name}.json").read_text())
    return guarantee(known.task, replace(known.sampled_loop, **changes), known.varying_gain)


def deadbeat(e1, e2):
    return -e1 / 0.184


def numbers(claim):
    return replace(attacker.numbers(claim), ends=deadbeat if claim.sampled_loop.law.implicit_step else None)


def moved(claim, held, periods, courses, seed, along=None):
    """Small steps by which measurements and pressures are late or early, at their ends; half of them switch slowly."""
    random, count = np.random.default_rng(seed), (periods, courses)
    pace = np.where(np.arange(courses) % 2, 0.5, 0.1)
    signs = 1 - 2 * (np.cumsum(random.random(count) < pace, axis=0) % 2)
    grain = held.step / PIECES
    off, more = (round(float(v) / grain) for v in (claim.sampled_loop.jitter, claim.sampled_loop.delay_jitter))
    others = np.where(random.random(courses) < 0.5, signs, 1 - 2 * random.integers(2, size=count))
    mean = round(float(claim.sampled_loop.averaging) / grain)
    return attacker.Moved(
        measured=off * signs + mean // 2, arrived=off * signs + more * others, rate=_rate(claim), mean=mean
    )


def _rate(claim):
    """How fast b·p changes in the pump [m/s³]; None for at once."""
    pump = claim.sampled_loop.pump
    return None if pump is None else float(pump.rate * claim.task.authority)


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS)
def test_no_course_leaves_the_claims_and_some_come_near(row):
    claim = proved(row)
    assert claim.check() is Verdict.PROVED
    held, periods, courses = numbers(claim), 30, 60
    largest = []
    for n in (6, 30):
        for gain in held.beta:
            for response in attacker.responses(replace(held, beta=(gain, gain)), n, PIECES):
                choose = attacker.slowly(held, PIECES, attacker.aligned(held, response))
                off = moved(claim, held, n, courses, seed=n)
                largest.append(attacker.run(held, n, PIECES, choose, courses, off=off)[0].max(axis=1))
    random = attacker.slowly(held, PIECES, attacker.switching(held, 200, periods * PIECES, seed=5))
    off = moved(claim, held, periods, 200, seed=9)
    largest.append(attacker.run(held, periods, PIECES, random, 200, off=off)[0].max(axis=1))
    slip, rate = np.max(largest, axis=0)
    assert slip <= claim.claims.slip_error <= ROWS[row][2] * slip
    assert rate <= claim.claims.slip_rate_error <= ROWS[row][2] * rate


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS)
def test_no_mixed_course_of_ten_thousand_leaves_the_claims(row):
    claim, periods, courses = proved(row), 40, 10_000
    held = numbers(claim)
    held = held if claim.varying_gain else replace(held, slope=0.0)
    choose, _ = attacker.mixed(held, PIECES, courses, seed=4, memory=20)
    off = moved(claim, held, periods, courses, seed=6)
    slip, rate = attacker.run(held, periods, PIECES, choose, courses, off=off)[0].max(axis=1)
    assert slip <= claim.claims.slip_error
    assert claim.claims.slip_rate_error / ROWS[row][2] <= rate <= claim.claims.slip_rate_error


@few("row", ["jitter", "of the delay", "sliding mode"], every=3)
def test_the_search_stays_inside_and_finds_more_than_on_time(row):
    claim = proved(row)
    on_time = replace(claim, sampled_loop=replace(claim.sampled_loop, jitter=F(0), delay_jitter=F(0)))
    seen, before = map(worst_tracking, (claim, on_time))
    assert 1.002 * before.slip_error < seen.slip_error <= claim.claims.slip_error
    assert before.slip_rate_error < seen.slip_rate_error <= claim.claims.slip_rate_error


@pytest.mark.slow
def test_the_search_with_stick_stays_inside():
    claim = proved("late")
    seen = worst_tracking(claim, sticks=True)
    assert claim.claims.slip_error / 4 < seen.slip_error <= claim.claims.slip_error
    assert claim.claims.slip_rate_error / 4 < seen.slip_rate_error <= claim.claims.slip_rate_error


@pytest.mark.parametrize(
    ("changes", "delay", "off", "early"),
    [
        ({"jitter": "1/100"}, "0", "1/100", "0"),  # with the sample
        ({"jitter": "1/100", "delay_jitter": "1/50"}, "0", "1/100", "0"),
        ({"delay_jitter": "1/50"}, "1/50", "0", "31/1600"),  # after a sample on time
        ({"jitter": "1/100", "delay": "1/20"}, "3/50", "1/100", "1/50"),
        ({"jitter": "1/100", "delay_jitter": "1/100", "delay": "1/20"}, "7/100", "1/100", "1/25"),
        ({"jitter": "1/20", "delay": "1/20"}, "19/256", "1/40", "31/640"),  # events keep their order
        ({"jitter": "1/100", "delay": "184/1000"}, "184/1000", "1/100", "0"),
        ({"jitter": "1/100", "initial_slip": "1"}, "0", "1/200", "0"),  # the first one is on time
    ],
)
def test_events_are_moved_as_far_as_they_may_be_and_keep_their_order(changes, delay, off, early):
    known = parse_guarantee((PROOFS / "guarantee_real-fault.json").read_text())
    held = replace(known.sampled_loop, **{name: F(v) for name, v in changes.items()})
    plain, samples, pressures = _on_time(held)
    assert (plain.delay, samples, pressures) == tuple(map(F, (delay, off, early)))
    assert (plain.jitter, plain.delay_jitter, plain.instants) == (0, 0, None)
    events = _events(plain.loop(known.task), samples, pressures)
    assert sum(event.duration for event in events) == held.step
    assert min(event.duration for event in events) >= 0
    latest = [event.duration for event in events if event.soon]
    assert latest == [v for v in (2 * samples, pressures) if v]


def test_the_floats_of_a_design_know_of_jitter():
    claim = proved("jitter")
    anyhow = guarantee(claim.task, claim.sampled_loop)
    bounds, guessed = anyhow.theorem_bounds(), estimated(claim.task, claim.sampled_loop).bounds
    assert float(guessed.slip_rate_error) == pytest.approx(float(bounds.slip_rate_error), rel=0.04)
    assert float(guessed.stepped) == pytest.approx(float(bounds.stepped), rel=0.04)


def test_a_pump_is_as_slow_as_it_may_be_where_it_has_a_ramp_that_closes():
    claim = proved("slow pump")
    assert claim.sampled_loop.pump.rate * claim.sampled_loop.ramp >= claim.claims.largest_step
    slower = replace(claim.sampled_loop, pump=Pump(rate=F(1_000_000)), ramp=F(0))
    none = guarantee(claim.task, slower, claim.varying_gain)
    assert isinstance(none, NoProof)
    assert "jitter, or the duration of a pressure change contributes" in none.reason
    narrow = replace(
        claim, sampled_loop=replace(claim.sampled_loop, pump=Pump(rate=claim.sampled_loop.pump.rate * F(9, 10)))
    )
    assert narrow.check() is Verdict.UNDECIDED
