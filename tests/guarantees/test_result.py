"""Results of `guarantee` offer the same names, whatever friction and plant they are about."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

import quakedesign as qd
from quakedesign.errors import CertificateError
from quakedesign.exact import LowerBound, UpperBound
from quakedesign.guarantees import NoProof, PlantGuarantee, TrackingProof, tracking_result
from quakedesign.guarantees.exact.plant_proof import PlantProof
from quakedesign.guarantees.search.worst_case import WorstCase
from quakedesign.guarantees.sliding_result import SlidingGuarantee
from quakedesign.guarantees.stick_slip_result import StickSlipGuarantee
from quakedesign.guarantees.tracking_result import TrackingGuarantee
from quakedesign.lyapunov.exact.claim import Verdict

PROOFS = Path(__file__).parents[2] / "proofs" / "certificates"
FAULT = qd.load_fault("real-fault")
OF_BOUNDS_ALONE = {"slip_rate_error", "least_pressure", "largest_pressure"}


def stored(kind):
    """Claim of the first stored certificate of a kind, on the stick-slip plant of a linear law."""
    named = (path for path in sorted(PROOFS.glob("*.json")) if f'"kind": "{kind}"' in path.read_text())
    claims = map(qd.load_guarantee, named)
    return next(claim for claim in claims if kind != "stick_slip" or not claim.sampled_loop.law.pull)


def test_each_kind_of_result_has_the_bounds_of_its_claims_in_si(monkeypatch):
    sticking, slow = stored("stick_slip"), stored("slow_sliding")
    printed = qd.guarantee(FAULT, law=qd.SampledLaw.from_gains([3e8, 2.5e8, 5e7], step="0.184"))
    seen = WorstCase(slip_error=3e-6, slip_behind=1e-6, slip_ahead=3e-6, peak_slip_rate=2e-6)
    monkeypatch.setattr(tracking_result, "worst_tracking", lambda *_, **__: replace(seen, slip_rate_error=1e-6))
    stick_slip = StickSlipGuarantee(fault=FAULT, proof=sticking, worst=seen)
    sliding = SlidingGuarantee(proof=slow, task=slow.task, sampled_loop=slow.sampled_loop)
    common = {"slip_error", "peak_slip_rate", "least_pressure", "largest_pressure"}
    for result in (printed, stick_slip, sliding):
        assert common <= result.bounds.keys()
        assert result.bounds["least_pressure"] < result.bounds["largest_pressure"]
        assert (result.verdict, result.reason) == (Verdict.PROVED, "")
        assert result.sentence() == result.proof.sentence()
        assert result.controller == result.proof.controller
    written = printed.to_dict()
    for name in ("slip_error", "slip_rate_error", "peak_slip_rate"):
        assert printed.bounds[name].exact == written[name]
    assert [printed.bounds[end].exact for end in ("least_pressure", "largest_pressure")] == written["pressure"]
    assert stick_slip.bounds["slip_error"] == max(sticking.claims.slip_behind, sticking.claims.slip_ahead)
    assert stick_slip.bounds["peak_slip_rate"] == sticking.claims.peak_slip_rate
    assert [sliding.bounds[end] for end in ("least_pressure", "largest_pressure")] == list(slow.pressures)
    assert stick_slip.worst_case.keys() == stick_slip.bounds.keys() - OF_BOUNDS_ALONE
    assert stick_slip.worst_case["slip_error"] == 3e-6
    assert printed.worst_case["slip_error"] == written["worst_found"]["slip_error"] > 0
    assert "least_pressure" not in printed.worst_case or printed.worst_case["least_pressure"] < 0


def test_the_pressures_are_those_in_the_fault_and_not_at_the_valve():
    """Behind a lag the commanded pressure may go farther than that in the fault."""
    one = qd.load_guarantee(PROOFS / "guarantee_lab-fault.json")
    assert isinstance(one, TrackingProof)
    asked = {"least_asked": LowerBound(Fraction(-(10**9))), "largest_asked": UpperBound(Fraction(10**9))}
    found = TrackingGuarantee(fault=FAULT, proof=replace(one, claims=replace(one.claims, **asked))).bounds
    assert (found["least_pressure"], found["largest_pressure"]) == (
        one.claims.least_pressure,
        one.claims.largest_pressure,
    )
    assert asked.items() <= found.items()


def test_check_of_a_result_is_that_of_its_certificate(monkeypatch):
    sticking = stored("stick_slip")
    monkeypatch.setattr(type(sticking), "check", lambda _: Verdict.UNDECIDED)
    assert StickSlipGuarantee(fault=FAULT, proof=sticking).check() is Verdict.UNDECIDED


def test_a_result_is_saved_as_a_certificate_and_read_again(tmp_path):
    slow = stored("slow_sliding")
    SlidingGuarantee(proof=slow, task=slow.task, sampled_loop=slow.sampled_loop).save(tmp_path / "proof.json")
    assert qd.load_guarantee(tmp_path / "proof.json") == slow


def test_without_a_guarantee_there_is_a_reason_and_nothing_else(tmp_path):
    none = TrackingGuarantee(fault=FAULT, proof=NoProof(reason="the gain is 2"))
    assert (none.verdict, none.reason, none.bounds, none.worst_case) == (Verdict.UNDECIDED, "the gain is 2", {}, {})
    assert none.check() is Verdict.UNDECIDED
    with pytest.raises(CertificateError, match=r"must be proved.*Received none: the gain is 2"):
        none.save(tmp_path / "proof.json")
    with pytest.raises(CertificateError, match="must be proved"):
        none.controller  # noqa: B018
    assert not list(tmp_path.iterdir())
    assert (none.proof.check(), dict(none.proof.bounds)) == (Verdict.UNDECIDED, {})


def test_a_result_about_an_own_plant_has_its_peaks_by_name():
    plant = stored("uncertain_plant")
    assert isinstance(plant, PlantProof)
    named = PlantProof(
        part=plant.part, law=plant.law, pieces=plant.pieces, inputs=plant.inputs, claims=plant.claims,
        outputs=tuple(f"y{i}" for i, _ in enumerate(plant.claims.outputs)),
        controls=tuple(f"u{i}" for i, _ in enumerate(plant.claims.controls)),
    )  # fmt: skip
    assert list(named.bounds.values()) == [*plant.claims.outputs, *plant.claims.controls]
    assert list(named.bounds)[-1] == f"u{len(plant.claims.controls) - 1}"
    result = PlantGuarantee(proof=named)
    assert (result.verdict, result.reason, result.bounds) == (Verdict.PROVED, "", named.bounds)
    assert result.controller is named.law


def test_worst_slow_sliding_is_given_by_name(monkeypatch):
    slow = stored("slow_sliding")
    seen = WorstCase(log_rate=0.1, slip_error=2e-6)
    monkeypatch.setattr("quakedesign.guarantees.sliding_result.worst_sliding", lambda _: seen)
    assert SlidingGuarantee(proof=slow, task=slow.task, sampled_loop=slow.sampled_loop).worst_case == {
        "log_rate": 0.1,
        "slip_error": 2e-6,
    }
