"""Loops of every kind that is guaranteed, against ten thousand courses of a simulator that shares nothing with them."""

import importlib.util
from dataclasses import replace
from fractions import Fraction as F
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from quakedesign.fault import load_fault
from quakedesign.guarantees import design_compensated, design_sampled_law, with_varying_gain
from quakedesign.guarantees.exact.guarantee_files import parse_guarantee
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.tracking_result import with_worst_case as beside_searches
from quakedesign.laws import control_law
from quakedesign.lyapunov.exact.claim import Verdict
from quakedesign.plant import uncertain_plant

SPECIFICATION = importlib.util.spec_from_file_location("attacker", Path(__file__).with_name("attacker.py"))
attacker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(attacker)

PROOFS = Path(__file__).parents[3] / "proofs" / "certificates"
REAL, LAB, STEP, SHORT = "real-fault", "lab-fault", F("0.184"), F("0.05")
PEAK, SLIP = {"objective": "peak"}, {"measured": "slip", "slip_noise": F(1, 10**6)}
LONG = (120, 60, 6)  # periods that are run, over how many of them responses are followed, small steps in each
# fault, T_s, objective and loop setup, extent of the attack
ROWS = {
    "peak": (REAL, STEP, PEAK, LONG),
    "tracking": (REAL, STEP, {}, LONG),
    "rate, peak": (REAL, STEP, PEAK, LONG),
    "rate": (REAL, STEP, {}, LONG),
    "laboratory, 1 ms": (LAB, F("0.001"), {}, LONG),
    "laboratory, 2 ms": (LAB, F("0.002"), {}, LONG),
    "well, 1 s": (REAL, SHORT, PEAK | {"diffusion": F(1)}, (240, 160, 4)),
    "well, 2 s": (REAL, SHORT, PEAK | {"diffusion": F(2)}, (320, 240, 4)),
    "well, 5 s": (REAL, SHORT, PEAK | {"diffusion": F(5)}, (560, 440, 4)),
    "late, peak": (REAL, STEP, PEAK | {"delay": STEP}, LONG),
    "late": (REAL, STEP, {"delay": STEP}, LONG),
    "slip alone, peak": (REAL, STEP, PEAK | SLIP, LONG),
    "slip alone": (REAL, STEP, SLIP, LONG),
    "cta": (REAL, STEP, {}, LONG),
    "cta, peak": (REAL, STEP, PEAK, LONG),
    "dia": (REAL, STEP, {}, LONG),
    "dia, peak": (REAL, STEP, PEAK, LONG),
}
GAINS = {"cta": ("7", "5", "2.3", "1.1"), "dia": ("25/16", "27/5", "6/5", "0")}


@cache
def designed(row):
    """A guarantee and the numbers of its loop."""
    name, step, given, _ = ROWS[row]
    setup = ExactSetup(**{key: value for key, value in given.items() if key not in ("objective", "measured")})
    wanted = {key: value for key, value in given.items() if key in ("objective", "measured")}
    fault, kind = load_fault(name), row.split(",")[0]
    task = uncertain_plant(fault, rate_limited=kind == "rate")
    if kind in GAINS:
        law = control_law(kind).from_values(GAINS[kind], scale=F(1), divisor=task.authority)
        made = design_compensated(task, law, step, setup=setup, **wanted)
        claim = with_varying_gain(made.proof)
        held = attacker.sliding(made.controller, made.weight, made.authority, claim, float(task.authority))
    else:
        claim = design_sampled_law(task, step, setup=setup, **wanted)
        claim = beside_searches(fault, claim).proof if kind == "rate" else claim  # claims with room for stick
        held = attacker.numbers(claim, force=task.amplitude if kind == "rate" else None)
    return claim, held if claim.varying_gain else replace(held, slope=0.0)  # any course of the gain where none is slow


def attacked(of, times, courses, seed, sticks=False):
    """Largest errors of mixed courses, over what is claimed; with stick at the largest rate of the reference."""
    (claim, held), (periods, memory, pieces) = of, times
    choose, hear = attacker.mixed(held, pieces, courses, seed, memory)
    if claim.task.change is not None:
        choose = attacker.drifting(held, float(claim.task.change), pieces, choose)
    back = held.pace if sticks else None
    largest, _ = attacker.run(held, periods, pieces, choose, courses, hear=hear, back=back)
    return largest.max(axis=1) / np.array((claim.claims.slip_error, claim.claims.slip_rate_error), dtype=float)


def shipped(name):
    """A guarantee among the shipped proofs and the numbers of its loop."""
    claim = parse_guarantee((PROOFS / f"guarantee_{name}.json").read_text())
    held = attacker.numbers(claim)
    ends = (lambda e1, e2: -e1 / held.step) if claim.sampled_loop.law.implicit_step else None
    return claim, replace(held, ends=ends, slope=held.slope if claim.varying_gain else 0.0)


@pytest.mark.parametrize("sticks", [False, True])
@pytest.mark.parametrize("name", ["real-fault", "late_real-fault", "lab-fault", "cta_real-fault"])
def test_no_mixed_course_violates_a_shipped_guarantee(name, sticks):
    seen = attacked(shipped(name), LONG, 300, seed=1, sticks=sticks)
    assert 0.4 < seen.max() <= 1


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS)
def test_no_mixed_course_of_ten_thousand_violates_a_guarantee(row):
    claim, held = designed(row)
    assert claim.check() is Verdict.PROVED
    for sticks in (False, True):
        slip, rate = attacked((claim, held), ROWS[row][-1], 10_000, seed=2, sticks=sticks)
        assert slip <= 1
        assert (0.3 if sticks else 0.5) < rate <= 1  # the courses do hurt


def test_the_steps_of_the_simulator_are_those_of_exponentials():
    """One period of a law without states, s, w and beta at one end of their ranges, from an error of the slip."""
    _, held = shipped("real-fault")
    held = replace(held, C=np.zeros(1), F=np.zeros((1, 1)), G=np.zeros((1, 2)), s=held.s[:1] * 2, w=held.w[:1] * 2)
    choose = lambda k, e, v: (held.s[0], held.w[0], held.beta[1], held.force)  # noqa: E731
    _, end = attacker.run(held, 1, 6, choose, 1, start=[[1e-4], [1e-5]])
    push = held.beta[1] * held.b * held.D @ [1e-4, 1e-5] + held.force
    flow = np.array([[0, 1, 0], [held.s[0], -held.w[0], push], [0, 0, 0]])
    assert end[:, 0] == pytest.approx((expm(flow * held.step) @ [1e-4, 1e-5, 1])[:2], rel=1e-7)
