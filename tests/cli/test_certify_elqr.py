"""certify and design for the e-LQR on the command line."""

import importlib.resources
import json
from fractions import Fraction

import pytest

from quakedesign.cli import main

SLOW = ("230909365.4", "327662.0266", "39426629850", "2484414953000")


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as stop:
        main(list(arguments))
    out, err = capsys.readouterr()
    return stop.value.code, out, err


def test_given_gains_are_proved_with_margins_peaks_and_files(capsys, tmp_path):
    out = tmp_path / "k.json"
    arguments = ("certify", "elqr", "lab-fault", "--gains", *SLOW, "--peaks", "rate", "--json", "--out", str(out))
    code, said, _ = run(capsys, *arguments)
    found = json.loads(said)
    assert code == 0
    assert {"verdict", "friction_slope_margin", "inverse_optimal", "seconds"} <= set(found)
    assert (found["verdict"], found["inverse_optimal"], found["held"]["verdict"]) == ("proved", True, "proved")
    assert found["certificate"] == str(out)
    assert sorted(str(p) for p in tmp_path.iterdir()) == sorted(found["certificates"].values())
    code, said, _ = run(capsys, "check", found["certificates"]["peaks"], str(out), "--fault", "lab-fault")
    assert code == 0
    assert "the slip rate never exceeds" in said
    assert run(capsys, *arguments)[0] == 2


def test_a_destabilising_gain_is_refuted_in_words(capsys):
    code, said, _ = run(capsys, "certify", "elqr", "lab-fault", "--gains", f"-{SLOW[0]}", *SLOW[1:])
    assert code == 1
    assert said.startswith("refuted: elqr")
    assert "not stable near β = 1" in said


WRONG = {
    "without a fault": (("elqr", "--gains", *SLOW), "needs a fault"),
    "with a bound on the rate": (("elqr", "lab-fault", "--gains", *SLOW, "--lipschitz", "1"), "--lipschitz cannot"),
    "with a range": (("elqr", "lab-fault", "--gains", *SLOW, "--gain-range", "1", "2"), "--gain-range cannot"),
    "three gains": (("elqr", "lab-fault", "--gains", *SLOW[:3]), "needs 4 gains"),
    "no number": (("elqr", "lab-fault", "--gains", "a", *SLOW[1:]), "gain k1"),
    "unknown feedback": (("elqr", "lab-fault", "--gains", *SLOW, "--feedback", "x"), "feedback must be one of"),
    "unknown class": (("elqr", "lab-fault", "--gains", *SLOW, "--peaks", "x"), "amplitude, rate"),
    "negative step": (("elqr", "lab-fault", "--gains", *SLOW, "--step", "-1"), "step"),
    "fault of a sliding mode": (
        ("cta", "lab-fault", "--gains", "7", "5", "2", "1", "--lipschitz", "1"),
        "FAULT cannot",
    ),
    "peaks of a sliding mode": (("cta", "--gains", "7", "5", "2", "1", "--peaks", "rate"), "--peaks cannot"),
    "neither": (("cta", "--gains", "7", "5", "2", "1"), "needs a bound on |h'|"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_combinations_are_one_line(case, capsys):
    arguments, reason = WRONG[case]
    code, out, err = run(capsys, "certify", *arguments)
    assert (code, out) == (2, "")
    assert len(err.strip().splitlines()) == 1
    assert reason in err


def test_held_is_for_the_elqr(capsys, tmp_path):
    code, _, err = run(capsys, "design", "lab-fault", "--controller", "cta", "--held", "--out", str(tmp_path / "o"))
    assert code == 2
    assert "--held is for the e-LQR" in err


def test_a_held_design_is_reported_with_its_peaks(capsys, tmp_path):
    text = (importlib.resources.files("quakedesign.fault") / "presets" / "lab-fault.toml").read_text()
    path, out = tmp_path / "short.toml", tmp_path / "o"
    path.write_text(text.replace('"lab-fault"', '"short"').replace("1 hour", "1 minute"))
    arguments = ("design", str(path), "--controller", "elqr", "--held", "--out", str(out), "--json")
    code, said, _ = run(capsys, *arguments)
    found = json.loads(said)["controllers"]["elqr"]
    assert code == 0
    assert (found["held"]["verdict"], found["held"]["varying"]) == ("proved", "proved")
    assert found["held"]["largest_step"] > found["held"]["step"] == 0.001
    peaks = found["peaks"]
    assert set(peaks) == {"amplitude", "rate"}
    for entry in peaks.values():
        assert found["metrics"]["peak_slip_rate"] < float(Fraction(entry["peak_slip_rate"]))
        assert (out / entry["certificate"]).is_file()
    assert "stable if p is held over T_s = 0.001 s, proved for any course" in found["headline"]
