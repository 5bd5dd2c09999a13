"""Guarantees from every start of a box, attacked from its corners by a simulator that shares nothing with them."""

import importlib.util
import json
from dataclasses import replace
from fractions import Fraction as F
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from quakedesign import simulate
from quakedesign.cli import main
from quakedesign.fault import load_fault
from quakedesign.guarantees import WorstCase, guarantee, worst_tracking
from quakedesign.guarantees.exact.guarantee_files import parse_guarantee
from quakedesign.guarantees.search.float_bounds import estimated
from quakedesign.lyapunov.exact.claim import Verdict

SPECIFICATION = importlib.util.spec_from_file_location("attacker", Path(__file__).with_name("attacker.py"))
attacker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(attacker)

PROOFS = Path(__file__).parents[3] / "proofs" / "certificates"
PIECES = 6
BOXES = {"near": ("1e-5", "4e-5"), "slip": ("1e-4", "0"), "fast": ("0", "1e-3")}


@cache
def started(box, name="real-fault", slow=True):
    known = parse_guarantee((PROOFS / f"guarantee_{name}.json").read_text())
    slip, rate = map(F, BOXES[box])
    held = replace(known.sampled_loop, initial_slip=slip, initial_slip_rate=rate)
    return guarantee(known.task, held, known.varying_gain if slow else None)


def deadbeat(e1, e2):
    return -e1 / 0.184


def numbers(claim):
    law = claim.sampled_loop.law
    first = np.array(law.first, dtype=float) if law.first else None
    return replace(attacker.numbers(claim), ends=deadbeat if law.implicit_step else None, first=first)


def corners(claim, courses):
    """Half of the box's corners, again and again; the courses have the signs of all."""
    slip, rate = map(float, claim.sampled_loop.initial_errors)
    signs = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])[np.arange(courses) // 4 % 4]
    return (signs * [slip, rate]).T


def along(claim, periods):
    """Largest errors of courses from the corners, along the responses that count after so many periods."""
    held, found = numbers(claim), []
    for gain in held.beta:
        for response in attacker.responses(replace(held, beta=(gain, gain)), periods, PIECES):
            choose = course(claim, held, attacker.aligned(held, response))
            found.append(attacker.run(held, periods, PIECES, choose, 16, start=corners(claim, 16))[0])
    return np.max(found, axis=(0, 2))


def course(claim, held, choose):
    """As it is, or with an input gain of the slip alone where the proof needs that."""
    return choose if claim.varying_gain is None else attacker.slowly(held, PIECES, choose)


@pytest.mark.parametrize("slow", [True, False])
@pytest.mark.parametrize("box", BOXES)
def test_no_course_from_a_corner_leaves_the_claims_and_some_come_near(box, slow):
    claim = started(box, slow=slow)
    held, periods, courses = numbers(claim), 30, 400
    random = course(claim, held, attacker.switching(held, courses, periods * PIECES, seed=11))
    switched = attacker.run(held, periods, PIECES, random, courses, start=corners(claim, courses))[0].max(axis=1)
    slip, rate = np.max([switched, *(along(claim, n) for n in (1, 2, 3, 6, 30))], axis=0)
    assert slip <= claim.claims.slip_error
    assert rate <= claim.claims.slip_rate_error
    near = 1.6 if slow else 2.8
    assert claim.claims.slip_error <= near * slip
    assert claim.claims.slip_rate_error <= near * rate


def test_what_holds_from_rest_does_not_hold_from_the_box():
    rest = parse_guarantee((PROOFS / "guarantee_real-fault.json").read_text())
    slip, rate = along(started("fast"), 1)
    assert slip > rest.claims.slip_error
    assert rate > rest.claims.slip_rate_error


def test_a_sliding_mode_begins_with_the_slip_rate_that_it_is_told():
    claim = started("near", "cta_real-fault")
    assert claim.check() is Verdict.PROVED
    largest = along(claim, 20)
    assert largest[0] <= claim.claims.slip_error
    assert largest[1] <= claim.claims.slip_rate_error


def test_a_run_from_a_corner_stays_within_the_claims_of_its_law():
    claim, fault = started("near"), load_fault("real-fault")
    start = {"initial_slip": 1e-5, "initial_slip_rate": 4e-5}
    run = simulate(fault, claim.sampled_loop.controller, duration=0.184 * 50, samples=51, compiled=False, **start)
    assert (run.slip_error[0], run.slip_rate_error[0]) == pytest.approx((1e-5, 4e-5))
    assert np.abs(run.slip_error).max() <= claim.claims.slip_error
    assert np.abs(run.slip_rate_error).max() <= claim.claims.slip_rate_error


@pytest.mark.slow
def test_a_search_leaves_from_the_corners_and_the_floats_of_a_design_know_the_start():
    claim, errors = started("fast"), {}
    for sticks in (False, True):
        seen = errors[sticks] = worst_tracking(claim, sticks=sticks)
        assert claim.claims.slip_rate_error / 1.6 <= seen.slip_rate_error <= claim.claims.slip_rate_error
        assert seen.slip_error <= claim.claims.slip_error
    assert claim.claims.slip_error <= 1.6 * errors[False].slip_error
    guessed, bounds = estimated(claim.task, claim.sampled_loop).bounds, started("fast", slow=False).theorem_bounds()
    assert float(guessed.slip_rate_error) == pytest.approx(float(bounds.slip_rate_error), rel=0.01)
    assert float(guessed.slip_error) == pytest.approx(float(bounds.slip_error), rel=0.01)


GAINS = ("--gains", "6.96e8", "2.53e8", "6.02e8", "2.16e8")


def called(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        main(["guarantee", *arguments])
    return ended.value.code, capsys.readouterr()


@pytest.mark.slow
def test_the_command_says_from_where(capsys, monkeypatch):
    seen = WorstCase(slip_error=1e-5, slip_rate_error=1e-4)
    monkeypatch.setattr("quakedesign.guarantees.tracking_result.worst_tracking", lambda *_, **__: seen)
    code, said = called(
        capsys, "real-fault", *GAINS, "--initial-slip", "0.01 mm", "--initial-slip-rate", "0.04 mm/s", "--json"
    )
    found = json.loads(said.out)
    assert (code, found["verdict"]) == (0, "proved")
    assert (found["initial_slip"], found["initial_slip_rate"]) == ("1/100000", "1/25000")
    assert found["sentence"].startswith(
        "on the plant without stick, from every initial state within 1e-05 m and 4e-05 m/s of rest, with zero-order "
    )


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ("real-fault", *GAINS, "--initial-slip-rate=-1 mm/s"),
            "initial slip rate must be 0 or more. Received -0.001 m/s",
        ),
        (("crustal-patch", "--diffusion", "833 s", "--initial-slip", "1 um"), "from steady sliding"),
    ],
)
def test_a_start_that_is_none_is_refused_in_one_line(capsys, arguments, said):
    code, found = called(capsys, *arguments)
    assert code == 2
    assert said in found.err
    assert len(found.err.strip().splitlines()) == 1
