"""Everything about a K in one place, and the files that prove it."""

import json
from dataclasses import replace
from fractions import Fraction as F
from types import SimpleNamespace

import pytest

import quakedesign as qd
from quakedesign.checking import check_files
from quakedesign.errors import OutputError, ParameterError, UnknownNameError
from quakedesign.guarantees import Bounds, Claims, ContinuousProof
from quakedesign.guarantees.exact.guarantee_files import parse_guarantee
from quakedesign.laws import published
from quakedesign.linear import verdict
from quakedesign.linear.verdict import judge
from quakedesign.loop import exact_integrals
from quakedesign.plant import uncertain_plant

LAB = qd.load_fault("lab-fault")
GAINS = tuple(map(F, ("2640677339", "523784305.9", "2647975129", "957074176.5")))


class NamedProof:
    """Proof whose file contains a name alone."""

    def __init__(self, name):
        self.name = name

    def save(self, path):
        path.write_text(self.name)


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


def test_each_proof_has_a_file_named_after_it_and_no_file_is_replaced_without_force(tmp_path, monkeypatch):
    task = uncertain_plant(qd.load_fault("real-fault"))
    bounds = Bounds(slip_error=F(1, 3), slip_rate_error=F(1, 7), push=F(1, 9), small_gain=F(1, 2))
    peaks = ContinuousProof(task=task, law=exact_integrals(GAINS), claims=Claims.of(task, bounds))
    certificates = {name: NamedProof(name) for name in ("stability", "low-beta")}
    monkeypatch.setattr(verdict, "sampled_files", lambda *_: [NamedProof("held"), NamedProof("held-1")])
    judged = verdict.LinearVerdict(
        fault=LAB,
        controller=published("lab-fault")["elqr"],
        analysis=SimpleNamespace(certificates=certificates, to_dict=lambda: {"verdict": "proved"}),
        facts={"held": None},
        sampled=SimpleNamespace(verdict_at_step=None),
        peaks=peaks,
    )
    assert judged.to_dict() == {"verdict": "proved", "held": None, "peaks": peaks.to_dict()}
    assert replace(judged, peaks=None).to_dict()["peaks"] is None
    assert "peaks" not in replace(judged, peaks=None).proofs()
    out = tmp_path / "gains.json"
    names = {"stability": "gains"} | {name: f"gains-{name}" for name in ("low-beta", "peaks", "held", "held-1")}
    assert judged.save(out) == {name: str(tmp_path / f"{stem}.json") for name, stem in names.items()}
    written = {path.stem: path.read_text() for path in tmp_path.iterdir()}
    assert parse_guarantee(written.pop("gains-peaks")) == peaks
    assert written == {names[name]: name for name in names if name != "peaks"}
    (tmp_path / "gains-held.json").unlink()
    out.write_text("other")
    with pytest.raises(OutputError, match="--force") as error:
        judged.save(out)
    assert "gains-low-beta.json" in str(error.value)
    assert "gains-held.json" not in str(error.value)
    assert out.read_text() == "other"
    judged.save(out, force=True)
    assert out.read_text() == "stability"


def test_what_cannot_be_asked_is_refused_before_the_work(monkeypatch):
    for place in ("verdict.linear_entries", "sampled_stability.largest_varying_step"):
        monkeypatch.setattr(f"quakedesign.linear.{place}", lambda *_, **__: pytest.fail("worked"))
    with pytest.raises(UnknownNameError, match="amplitude, rate"):
        judge(LAB, published("lab-fault")["elqr"], peaks="any")
    with pytest.raises(ParameterError, match="step must be positive"):
        judge(LAB, published("lab-fault")["elqr"], step=-1)
    with pytest.raises(ParameterError, match="a verdict on gains"):
        judge(qd.load_fault("crustal-patch"), published("lab-fault")["elqr"])
