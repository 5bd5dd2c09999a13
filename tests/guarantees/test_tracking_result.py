"""A guarantee beside what was seen: claims that a course with stick leaves make way, one by one."""

from dataclasses import replace
from fractions import Fraction as F
from importlib import import_module
from pathlib import Path

import pytest

from quakedesign.exact import UpperBound
from quakedesign.fault import load_fault
from quakedesign.guarantees import TrackingGuarantee, WorstCase, guarantee, with_worst_case
from quakedesign.guarantees.exact.guarantee_files import parse_guarantee
from quakedesign.lyapunov.exact.claim import Verdict

MODULE = import_module("quakedesign.guarantees.tracking_result")
FILE = Path(__file__).parents[2] / "proofs" / "certificates" / "guarantee_real-fault.json"
REAL = load_fault("real-fault")
SLOW = parse_guarantee(FILE.read_text())
WIDE = guarantee(SLOW.task, SLOW.sampled_loop)
ANYHOW = WIDE.claims


def between(name, share=F(1, 2)):
    """A number between the claims of both proofs."""
    return float(getattr(SLOW.claims, name) * (1 - share) + getattr(ANYHOW, name) * share)


def stuck(monkeypatch, slip, rate):
    """Answer where a search on the sticking fault ends at these errors."""
    seen = WorstCase(slip_error=slip, slip_rate_error=rate)
    quiet = WorstCase(slip_error=0.0, slip_rate_error=0.0)
    monkeypatch.setattr(MODULE, "worst_tracking", lambda _, sticks=False: seen if sticks else quiet)
    return with_worst_case(REAL, SLOW)


def test_claims_that_no_course_leaves_stay(monkeypatch):
    inside = (float(v) * (1 - 1e-9) for v in (SLOW.claims.slip_error, SLOW.claims.slip_rate_error))
    assert stuck(monkeypatch, *inside).proof == SLOW


@pytest.mark.parametrize(
    ("slip", "rate", "left"),
    [
        (between("slip_error"), 0.0, {"slip_error"}),
        (0.0, between("slip_rate_error"), {"slip_rate_error", "peak_slip_rate"}),
    ],
)
def test_a_claim_that_a_course_with_stick_leaves_is_that_of_any_gain(monkeypatch, slip, rate, left):
    found = stuck(monkeypatch, slip, rate)
    assert not found.exceeded_on_stick_slip
    assert (found.proof.check(), found.proof.varying_gain) == (Verdict.PROVED, SLOW.varying_gain)
    for name in ("slip_error", "slip_rate_error", "peak_slip_rate", "least_pressure", "largest_pressure"):
        assert getattr(found.proof.claims, name) == getattr(ANYHOW if name in left else SLOW.claims, name)


def test_a_disturbance_that_is_slow_has_a_class_of_its_own(monkeypatch):
    found = stuck(monkeypatch, 0.0, 0.0)
    given = found.fault.disturbance
    said = [line for line in found.lines() if "these bounds allow the disturbance to jump" in line]
    assert len(said) == 1
    assert f"changes by at most {given.amplitude * given.frequency:.3g}"[:-1] in said[0]
    for other in (replace(given, constant=1e-6), replace(given, frequency=0.0)):
        asked = replace(found, fault=replace(found.fault, disturbance=other))
        assert "to jump" not in " ".join(asked.lines())
    of_rate = replace(found.proof, task=replace(found.proof.task, change=F(1)))
    assert "to jump" not in " ".join(replace(found, proof=of_rate).lines())


def test_a_course_beyond_both_is_said_and_the_narrow_claims_stay(monkeypatch):
    found = stuck(monkeypatch, between("slip_error", F(2)), 0.0)
    assert found.proof == SLOW
    assert "exceeds the bounds" in found.lines()[-1]
    assert found.limit_lines()[0].startswith(
        "no controller with zero-order hold over T_s = 0.184 s keeps the slip-rate error below "
    )


def test_what_is_widened_is_proved_or_not_said(monkeypatch):
    monkeypatch.setattr(MODULE, "guarantee", lambda *_: SLOW)
    assert stuck(monkeypatch, between("slip_error"), 0.0).proof == SLOW
    monkeypatch.setattr(type(SLOW), "check", lambda _: Verdict.UNDECIDED)
    monkeypatch.setattr(MODULE, "guarantee", lambda *_: WIDE)
    assert stuck(monkeypatch, between("slip_error"), 0.0).proof == SLOW


def test_a_sliding_mode_of_a_file_whose_law_states_no_gains_has_lines():
    """Its law is run from the controller of the design, and its pressure has a limit at rest: nothing to warn of."""
    claim = parse_guarantee(FILE.with_name("guarantee_cta_real-fault.json").read_text())
    told = TrackingGuarantee(fault=load_fault("real-fault"), proof=claim).lines()
    assert told[0] == f"proved: {claim.sentence()}"
    assert not any("on a fault that sticks" in line for line in told)


def test_a_law_that_would_wind_up_is_warned_of_unless_its_pressure_is_limited_at_rest(monkeypatch):
    monkeypatch.setattr("quakedesign.laws.sampled_controller.winds_up", lambda _: True)
    answer = TrackingGuarantee(fault=load_fault("real-fault"), proof=SLOW)
    assert any(line.startswith("MAY WIND UP") for line in answer.lines())
    monkeypatch.setattr(type(SLOW), "rest_limit", property(lambda _: "a limit"))
    assert not any(line.startswith("MAY WIND UP") for line in answer.lines())


def test_the_verdict_of_a_result_is_that_of_its_proof_and_found_once(monkeypatch):
    """A proof that was read from a file is decided when it is written; bounds are not computed twice for this."""
    computed, bounds = [], type(SLOW).theorem_bounds
    monkeypatch.setattr(type(SLOW), "theorem_bounds", lambda proof: computed.append(proof) or bounds(proof))
    assert TrackingGuarantee(fault=REAL, proof=SLOW).to_dict()["verdict"] == "proved"
    sharper = replace(SLOW, claims=replace(SLOW.claims, slip_error=UpperBound(SLOW.claims.slip_error / 2)))
    assert TrackingGuarantee(fault=REAL, proof=sharper).to_dict()["verdict"] == "undecided"
    assert computed == [SLOW, sharper]
