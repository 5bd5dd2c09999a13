"""Claims about laws in continuous time: what decides them, and what is said, written and refused."""

import json
from dataclasses import replace
from fractions import Fraction as F

import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.guarantees import Bounds, Claims, ContinuousProof, NoProof
from quakedesign.guarantees.exact import tracking_proof as continuous
from quakedesign.guarantees.exact.guarantee_files import parse_guarantee, save_guarantee
from quakedesign.loop import exact_integrals
from quakedesign.lyapunov.exact.claim import Verdict
from quakedesign.plant import uncertain_plant

TASK = uncertain_plant(load_fault("real-fault"))
LAW = exact_integrals(tuple(map(F, ("2640677339", "523784305.9", "2647975129", "957074176.5"))))
BOUNDS = Bounds(slip_error=F(1, 3), slip_rate_error=F(1, 7), push=F(1, 9), small_gain=F(1, 2))
NONE = NoProof(reason="none")
PEAKS = ContinuousProof(task=TASK, law=LAW, claims=Claims.of(TASK, BOUNDS))


@pytest.mark.parametrize(
    ("found", "verdict"),
    [
        (BOUNDS, Verdict.PROVED),
        (replace(BOUNDS, push=F(1, 8)), Verdict.UNDECIDED),
        (NONE, Verdict.UNDECIDED),
    ],
)
def test_claims_are_proved_where_the_bounds_give_them(found, verdict, monkeypatch):
    monkeypatch.setattr(continuous, "certified_bounds", lambda *_: found)
    assert PEAKS.check() is verdict


def test_peaks_are_the_bounds_a_little_wider_or_none(monkeypatch):
    monkeypatch.setattr(continuous, "certified_bounds", lambda *_: BOUNDS)
    found = continuous.continuous_peaks(TASK, LAW)
    assert found == replace(PEAKS, claims=PEAKS.claims.rounded())
    assert found.claims.covers(PEAKS.claims)
    monkeypatch.setattr(continuous, "certified_bounds", lambda *_: NONE)
    assert continuous.continuous_peaks(TASK, LAW) is NONE


def test_a_loop_that_is_not_seen_to_be_stable_has_no_peaks():
    found = continuous.continuous_peaks(TASK, exact_integrals((F(1), F(1), F(1), F(1))))
    assert isinstance(found, NoProof)
    assert "even the nominal loop is not stable" in found.reason


@pytest.mark.parametrize(("change", "said"), [(None, "amplitude"), (F(0), "rate"), (F(1), "rate")])
def test_what_is_said_names_the_class_and_the_exact_claims(change, said):
    found = replace(PEAKS, task=replace(TASK, change=change)).to_dict()
    assert found["disturbance_class"] == said
    assert found["slip_error"] == "1/3"
    assert found["premises"] == list(continuous.PREMISES)
    assert json.dumps(found)


def test_a_saved_file_is_read_again_as_the_same(tmp_path):
    save_guarantee(PEAKS, tmp_path / "peaks.json")
    assert parse_guarantee((tmp_path / "peaks.json").read_text()) == PEAKS


@pytest.mark.parametrize("of_reference", [(F(1), F(0)), (F(0), F(1))])
def test_a_law_of_the_state_needs_a_reference_without_jumps_of_acceleration(of_reference):
    law, cubic = replace(LAW, of_reference=of_reference), replace(TASK, shape=(F(0), F(0), F(3), F(-2)))
    assert len(replace(PEAKS, law=law).loop.inputs) == 3
    assert replace(PEAKS, task=cubic).loop
    with pytest.raises(ParameterError, match="without acceleration"):
        _ = replace(PEAKS, law=law, task=cubic).loop
