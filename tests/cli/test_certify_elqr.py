"""certify and design for the e-LQR on the command line."""

import importlib.resources
import json
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import pytest

from quakedesign.cli import main
from quakedesign.cli.design_commands import DesignOptions
from quakedesign.loop.loop_setup import LoopSetup

SLOW = ("230909365.4", "327662.0266", "39426629850", "2484414953000")


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as stop:
        main(list(arguments))
    out, err = capsys.readouterr()
    return stop.value.code, out, err


@pytest.mark.slow
def test_given_gains_are_proved_with_margins_peaks_and_files(capsys, tmp_path):
    out = tmp_path / "k.json"
    arguments = ("certify", "elqr", "lab-fault", "--gains", *SLOW, "--peaks", "rate", "--json", "--out", str(out))
    code, said, _ = run(capsys, *arguments)
    found = json.loads(said)
    assert code == 0
    assert {"verdict", "friction_slope_margin", "held", "seconds"} <= set(found)
    assert (found["verdict"], found["held"]["verdict"]) == ("proved", "proved")
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


def test_the_slip_alone_is_refused_without_the_elqr(capsys, tmp_path):
    options = ("--measured", "slip", "--out", str(tmp_path / "o"))
    code, _, err = run(capsys, "design", "lab-fault", "--controller", "cta", *options)
    assert code == 2
    assert "--measured slip is for the e-LQR" in err


def test_of_the_slip_alone_the_laws_that_need_more_are_left_out_and_noise_is_for_all():
    asked = DesignOptions(measured="slip", slip_noise="1/1000000").problem("lab-fault")[1]
    assert asked["names"] == ["elqr"]
    assert DesignOptions().problem("lab-fault")[1]["names"] == ["cta", "dia", "elqr"]
    assert asked["options"]["setup"] == LoopSetup(measured="slip", slip_noise="1 um")


def test_an_objective_is_refused_in_continuous_time(capsys, tmp_path):
    options = ("--continuous", "--objective", "peak", "--out", str(tmp_path / "o"))
    code, _, err = run(capsys, "design", short(tmp_path), "--controller", "cta", *options)
    assert (code, len(err.strip().splitlines())) == (2, 1)
    assert "the objective of a design in continuous time must be tracking. Received 'peak'" in err


def short(folder):
    """The laboratory fault with a task of a minute."""
    text = (importlib.resources.files("quakedesign.fault") / "presets" / "lab-fault.toml").read_text()
    path = folder / "short.toml"
    path.write_text(text.replace('"lab-fault"', '"short"').replace("1 hour", "1 minute"))
    return str(path)


@pytest.mark.slow
def test_a_design_in_continuous_time_is_reported_with_its_peaks_and_without_a_guarantee(capsys, tmp_path):
    out = tmp_path / "o"
    arguments = ("design", short(tmp_path), "--controller", "elqr", "--continuous", "--plant", "printed")
    arguments = (*arguments, "--out", str(out), "--json")
    code, said, _ = run(capsys, *arguments)
    found = json.loads(said)["controllers"]["elqr"]
    assert code == 0
    assert found["guarantee"]["sentence"].startswith("none: ")
    assert found["guarantee"]["verdict"] == "undecided"
    assert set(found["gains"]) == {"k1", "k2", "k3", "k4"}
    peaks = found["peaks"]
    assert set(peaks) == {"amplitude", "rate"}
    for entry in peaks.values():
        assert found["metrics"]["peak_slip_rate"] < float(Fraction(entry["peak_slip_rate"]))
        assert (out / entry["certificate"]).is_file()


@pytest.mark.slow
def test_a_design_is_reported_with_the_guarantee_of_the_loop_that_ran(capsys, tmp_path):
    out = tmp_path / "o"
    code, said, _ = run(capsys, "design", short(tmp_path), "--controller", "elqr", "--out", str(out), "--json")
    found = json.loads(said)["controllers"]["elqr"]
    assert code == 0
    assert next(iter(found)) == "guarantee"
    assert found["guarantee"]["sentence"].startswith(
        "on the plant without stick, from rest, with zero-order hold over 0.001 s"
    )
    told, metrics = found["guarantee"], found["metrics"]
    assert metrics["peak_slip_rate"] <= Fraction(told["peak_slip_rate"])
    assert Fraction(told["pressure"][0]) <= metrics["min_pressure"] < metrics["max_pressure"]
    assert metrics["max_pressure"] <= Fraction(told["pressure"][1])
    assert told["worst_found"]["slip_error"] <= Fraction(told["slip_error"])
    assert (found["run"]["scheme"], found["run"]["step"], found["peaks"]) == ("explicit", 0.001, None)
    assert found["certificate"] == told["certificate"] == "certificates/elqr-guarantee.json"
    page = (out / "report.html").read_text()
    assert page.index("guarantee: on the plant without stick, from rest") < page.index("tracked: peak slip rate")
    checker = Path(__file__).parents[2] / "proofs" / "check.py"
    command = [sys.executable, str(checker), str(out / found["certificate"])]
    assert "proved" in subprocess.run(command, capture_output=True, text=True, check=True, timeout=120).stdout
    assert run(capsys, "check", str(out / found["certificate"]), "--fault", short(tmp_path))[0] == 0


def test_a_diffusion_of_zero_is_not_taken_for_one_that_is_not_given(capsys, tmp_path):
    code, _, err = run(capsys, "design", "crustal-patch", "--diffusion", "0", "--out", str(tmp_path / "o"))
    assert (code, "diffusion must be above 0 s. Received 0 s" in err) == (2, True)
