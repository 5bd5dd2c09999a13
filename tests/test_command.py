"""What a check says beyond the verdict: whom a certificate covers, and in which lines."""

import json
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import pytest

from quakedesign import lyapunov as certificates
from quakedesign.checking import check_files, statement
from quakedesign.errors import CertificateError
from quakedesign.fault import load_fault
from quakedesign.guarantees import ContinuousProof, TrackingProof, load_guarantee, save_guarantee
from quakedesign.loop import exact_integrals
from quakedesign.lyapunov import Certificate, Verdict, load_certificate
from quakedesign.lyapunov.exact.claim import Equilibrium
from quakedesign.symbolic.terms import Term

CERTIFICATES = Path(__file__).parents[1] / "proofs" / "certificates"
ELQR = load_certificate(CERTIFICATES / "elqr_lab-fault.json")
CTA = load_certificate(CERTIFICATES / "cta_13_7.5_2.3_1.1.json")


def checked(path, fault=None):
    ((found, said),) = check_files([path], fault).values()
    return found, said


def test_files_are_checked_one_by_one_under_their_names(tmp_path):
    paths = [CERTIFICATES / f"{name}.json" for name in ("super-twisting_1.5_1.1", "motzkin_not-sos")]
    found = check_files(paths)
    assert list(found) == list(map(str, paths))
    assert [verdict for verdict, _ in found.values()] == ["proved", "refuted"]
    for missing in (tmp_path, tmp_path / "none.json", Path("\0"), Path("x" * 5000)):
        with pytest.raises(CertificateError, match="certificate must be a file"):
            check_files([missing])
    (tmp_path / "broken.json").write_text('{"format": 1,\n')
    verdict, said = checked(tmp_path / "broken.json")
    assert verdict.startswith("invalid: ")
    assert "\n" not in verdict
    assert said == []


def test_a_proof_about_a_polynomial_says_nothing_about_a_fault(tmp_path):
    path = CERTIFICATES / "motzkin_multiplier_sos.json"
    verdict, said = checked(path)
    assert verdict == "proved"
    assert not any(line.endswith("exact arithmetic") for line in said)
    about = checked(path, "lab-fault")
    assert about == ("proved", [*said, 'the file names no fault: not compared with "lab-fault"'])
    raw = json.loads(path.read_text())
    first = next(iter(raw["polynomial"]))
    raw["polynomial"][first] = "7"
    (tmp_path / "other.json").write_text(json.dumps(raw))
    assert checked(tmp_path / "other.json") == ("invalid: the proof does not decide the statement", [])


def test_a_verdict_that_is_no_proof_covers_nobody(monkeypatch):
    path = CERTIFICATES / "elqr_lab-fault.json"
    monkeypatch.setattr(certificates, "covers", lambda certificate, fault: [f"covers {fault.name}"])
    monkeypatch.setattr(Certificate, "check", lambda self: Verdict.PROVED)
    assert checked(path) == ("proved", statement(ELQR))
    assert checked(path, "lab-fault") == ("proved", [*statement(ELQR), "covers lab-fault"])
    monkeypatch.setattr(Certificate, "check", lambda self: Verdict.REFUTED)
    assert checked(path, "lab-fault") == ("refuted", statement(ELQR))


def test_a_law_in_continuous_time_has_no_sampling_time_to_compare(monkeypatch, tmp_path):
    stored = load_guarantee(CERTIFICATES / "guarantee_lab-fault.json")
    law = exact_integrals((F(1),) * 4)
    save_guarantee(ContinuousProof(task=stored.task, law=law, claims=stored.claims), tmp_path / "peaks.json")
    monkeypatch.setattr(ContinuousProof, "check", lambda self: Verdict.PROVED)
    assert checked(tmp_path / "peaks.json", "lab-fault")[1][-1] == 'the data are those of "lab-fault", box paper'


def test_a_guarantee_covers_the_fault_whose_data_it_has(monkeypatch, tmp_path):
    path = CERTIFICATES / "guarantee_real-fault.json"
    monkeypatch.setattr(TrackingProof, "check", lambda self: Verdict.PROVED)
    verdict, said = checked(path)
    assert (verdict, said[0]) == ("proved", 'fault "real-fault", by the data in the file')
    assert said[1].startswith("on the plant without stick, from rest, with zero-order hold over 0.184 s")
    assert checked(path, "real-fault") == ("proved", [*said, 'the data are those of "real-fault", box paper'])
    slower = replace(load_fault("real-fault"), sampling_time=0.5)
    monkeypatch.setattr(
        "quakedesign.fault.load_fault", lambda name, **_: slower if name == "slower" else load_fault(name)
    )
    told = 'the data are those of "real-fault", box paper; proved at T_s = 0.184 s, NOT at the T_s of the fault, 0.5 s'
    assert checked(path, "slower") == ("proved", [*said, told])
    slower = replace(slower, sampling_time=0.1840001)
    assert checked(path, "slower")[1][-1].endswith("T_s = 0.184 s, NOT at the T_s of the fault, 0.1840001 s")
    assert checked(path, "lab-fault") == ('invalid: the data are not those of "lab-fault"', [])
    raw = json.loads(path.read_text())
    raw["disturbance"]["change"] = "69/312500"
    (tmp_path / "slow.json").write_text(json.dumps(raw))
    assert checked(tmp_path / "slow.json", "real-fault")[0] == "proved"
    raw["disturbance"]["change"] = "7/31250"
    (tmp_path / "slow.json").write_text(json.dumps(raw))
    assert checked(tmp_path / "slow.json", "real-fault")[0] == 'invalid: the data are not those of "real-fault"'
    monkeypatch.setattr(TrackingProof, "check", lambda self: Verdict.UNDECIDED)
    expected = "invalid: the claims do not follow from the loop and the fault's data"
    assert checked(path) == (expected, [])


def test_a_certificate_is_said_in_lines():
    small = replace(
        CTA,
        loop=replace(CTA.loop, field={"x": (Term(F(-2), ("k",), (("x", F(1, 2), "s"),)),)}, states={"x": 2},
                     gains={"k": F(3)}, uncertain={"beta": (F(1), F(2))}),
        lyapunov=(Term(F(1, 3), (), (("x", F(3, 2), "a"),)), Term(F(4), (), (("x", F(3), "s"),))),
        claims={"positive": F(1, 2), "decrease": F(2, 3)},
    )  # fmt: skip
    head = [
        "in continuous time, for the equations below: sampling with zero-order hold is not covered",
        "law cta, vector field equal to that of the law",
        "k = 3",
        "domain: cells; states with weights: x = 2",
        "beta in [1, 2]",
        "x' = -2*k*SignedPower(x, 1/2)",
    ]
    assert statement(small) == [
        *head,
        "V = (AbsolutePower(x, 3/2)/3) + (4*SignedPower(x, 3))",
        "SignedPower(x, a) is |x|^a with the sign of x, AbsolutePower(x, a) is |x|^a",
        "claims: positive 1/2, decrease 2/3",
    ]
    refuted = replace(small, refutation=Equilibrium(point={"x": F(1, 4)}, parameters={}, weights={}))
    assert statement(refuted) == [*head, "Filippov equilibrium away from the origin, in cell coordinates x: 1/4"]


FRESH = """
import sys
from pathlib import Path
from quakedesign.checking import check_files
for verdict, _ in check_files([*map(Path, sys.argv[1:])]).values():
    print(verdict, *({"sympy", "numpy"} & set(sys.modules)))
"""


@pytest.mark.slow
def test_checking_does_not_wait_for_sympy():
    names = ("super-twisting_1.5_1.1", "guarantee_real-fault", "motzkin_not-sos")
    call = [sys.executable, "-c", FRESH, *(str(CERTIFICATES / f"{name}.json") for name in names)]
    assert subprocess.run(call, capture_output=True, text=True, check=True).stdout.split() == [
        "proved", "proved", "refuted",
    ]  # fmt: skip
