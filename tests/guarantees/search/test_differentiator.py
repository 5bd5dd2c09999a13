"""Guarantees of laws that are told by the printed differentiator, against simulators that share nothing with them."""

import importlib.util
from fractions import Fraction as F
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import quakedesign as qd
from quakedesign.errors import ParameterError
from quakedesign.exact import UpperBound
from quakedesign.fault import load_fault
from quakedesign.guarantees import NoProof, TrackingGuarantee, design_sampled_law
from quakedesign.guarantees.exact.guarantee_files import guarantee_text
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search.lqg import measured_by
from quakedesign.loop.sensing.differentiator import least_bound
from quakedesign.lyapunov import Verdict
from quakedesign.plant import uncertain_plant
from quakedesign.studies import limits

SPECIFICATION = importlib.util.spec_from_file_location("attacker", Path(__file__).with_name("attacker.py"))
attacker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(attacker)
CHECK = importlib.util.spec_from_file_location("check", Path(__file__).parents[3] / "proofs" / "check.py")
checker = importlib.util.module_from_spec(CHECK)
CHECK.loader.exec_module(checker)

REAL, STEP, NOISE, PIECES = load_fault("real-fault"), F("0.184"), F(1, 10**6), 6
GAINS = ("6.96e8", "2.53e8", "6.02e8", "2.16e8")
# objective, noise: certified slip-rate error [m/s] and slip error [m] at most
ROWS = {("peak", F(0)): (2.0e-4, 9e-5), ("tracking", F(0)): (2.6e-4, 7e-5), ("peak", NOISE): (2.4e-4, 1e-4)}


@cache
def designed(row):
    objective, noise = row
    return design_sampled_law(
        uncertain_plant(REAL), STEP, objective=objective, measured="differentiator", setup=ExactSetup(slip_noise=noise)
    )


@pytest.mark.slow
@pytest.mark.parametrize("courses", [300, pytest.param(10_000, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "row", [pytest.param(row, marks=[pytest.mark.slow] * (row != ("peak", NOISE))) for row in ROWS]
)
def test_no_course_leaves_what_is_proved_nor_what_the_differentiator_can_follow(row, courses):
    claim = designed(row)
    assert (claim.check(), measured_by(claim.sampled_loop.law)) == (Verdict.PROVED, "differentiator")
    assert claim.claims.slip_rate_error <= ROWS[row][0]
    assert claim.claims.slip_error <= ROWS[row][1]
    assert checker.check(guarantee_text(claim)).verdict == "proved"
    held = attacker.numbers(claim)
    choose, hear = attacker.mixed(held, PIECES, courses, seed=5, memory=60)
    slips, accelerations = [], []

    def followed(k, e, v):
        s, w, beta, phi = choose(k, e, v)
        slips.extend([e[0]] * (k % PIECES == 0))
        accelerations.append(np.abs(s * e[0] - w * e[1] + beta * v + phi).max())
        return s, w, beta, phi

    largest, _ = attacker.run(held, 100, PIECES, followed, courses, hear=hear)
    slip, rate = largest.max(axis=1)
    assert slip <= claim.claims.slip_error
    assert rate <= claim.claims.slip_rate_error <= 1.5 * rate
    assert max(accelerations) <= claim.slip_acceleration <= 3 * max(accelerations)
    most = 1.1 * float(STEP) ** 3 * float(least_bound(claim.slip_acceleration, row[1], STEP))
    assert np.abs(np.diff(slips, 3, axis=0)).max() + 8 * float(row[1]) <= most


@pytest.mark.slow
def test_the_acceleration_is_what_all_claims_allow_at_once():
    claim = designed(("peak", NOISE))
    held, claims, task = attacker.numbers(claim), claim.claims, claim.task
    low, high = map(float, task.rest_pressure)
    away = max(float(claims.largest_pressure) - high, low - float(claims.least_pressure))
    most = [max(map(abs, ends)) for ends in (held.s, held.w, held.beta)]
    parts = most[0] * float(claims.slip_error), most[1] * float(claims.slip_rate_error), most[2] * held.b * away
    assert float(claim.slip_acceleration) == pytest.approx(sum(parts) + held.force, rel=1e-12)


@pytest.mark.slow
def test_the_answer_tells_the_least_bound_of_the_differentiator():
    claim = designed(("peak", NOISE))
    found = TrackingGuarantee(fault=REAL, proof=claim)
    bound = least_bound(claim.slip_acceleration, NOISE, STEP)
    assert F(found.to_dict()["differentiator_bound"]) == bound
    assert found.to_dict()["measured"] == "differentiator"
    (said,) = [line for line in found.lines() if "differentiator" in line]
    assert f"for lambda_d of {UpperBound(bound):.3g} m/s^3 or more this estimate is (3 x - 4 x_1 + x_2)/(2 T_s)" in said


@pytest.mark.slow
def test_given_gains_are_told_as_designed_ones_are():
    found = qd.guarantee(REAL, gains=GAINS, step="50 ms", measured="differentiator")
    assert found.proof.claims.slip_rate_error <= F("1.7e-4")
    assert found.to_dict()["measured"] == "differentiator"
    plain = qd.guarantee(REAL, gains=GAINS, step="50 ms")
    assert (plain.differentiator_bound, plain.to_dict()["measured"]) == (None, "slip-and-rate")
    assert not any("differentiator" in line for line in plain.lines())


@pytest.mark.parametrize("gains", [(), GAINS])
@pytest.mark.parametrize(
    "around", [{"initial_slip": "1 um"}, {"jitter": "1 ms"}, {"lag": "0.1 s"}, {"diffusion": "2 s"}]
)
def test_where_it_is_not_known_what_it_tells_nothing_is_proved(around, gains):
    found = qd.guarantee(REAL, gains=gains, measured="differentiator", **around).proof
    assert isinstance(found, NoProof)
    assert "a law with a differentiator requires zero initial errors" in found.reason


def test_noise_of_a_slip_rate_that_is_not_measured_is_refused():
    with pytest.raises(ParameterError, match="needs a law that measures the slip rate"):
        qd.guarantee(REAL, measured="differentiator", rate_noise="1 um/s")
    with pytest.raises(ParameterError, match="measured must be one of slip-and-rate, slip"):
        limits(REAL, measured="differentiator")
