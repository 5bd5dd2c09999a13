"""Everything about a K in one place, and the files that prove it."""

import json

import pytest

import quakedesign as qd
from quakedesign.checking import check_files
from quakedesign.errors import OutputError, ParameterError, UnknownNameError
from quakedesign.laws import published
from quakedesign.linear.verdict import judge

LAB = qd.load_fault("lab-fault")


@pytest.mark.slow
def test_every_proof_of_the_published_gains_is_a_file_that_checks(tmp_path):
    judged = judge(LAB, published("lab-fault")["elqr"], step="0.5e-3")
    facts = json.loads(json.dumps(judged.to_dict()))
    assert (facts["verdict"], facts["held"]["varying"]) == ("proved", "proved")
    assert facts["peaks"] is None
    out = tmp_path / "k.json"
    paths = judged.save(out)
    names = {"stability", "friction-slope", "low-beta", "high-beta", "held", "held-1", "held-2"}
    assert set(paths) == names
    assert paths["stability"] == str(out)
    verdicts = {verdict for verdict, _ in check_files([tmp_path / p for p in paths.values()]).values()}
    assert verdicts == {"proved"}
    with pytest.raises(OutputError, match="--force"):
        judged.save(out)
    assert judged.save(out, force=True) == paths


def test_what_cannot_be_asked_is_refused_before_the_work(monkeypatch):
    for place in ("verdict.linear_entries", "sampled_stability.largest_varying_step"):
        monkeypatch.setattr(f"quakedesign.linear.{place}", lambda *_, **__: pytest.fail("worked"))
    with pytest.raises(UnknownNameError, match="amplitude, rate"):
        judge(LAB, published("lab-fault")["elqr"], peaks="any")
    with pytest.raises(ParameterError, match="step must be positive"):
        judge(LAB, published("lab-fault")["elqr"], step=-1)
