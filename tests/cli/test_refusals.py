"""What is wrong is refused in one line before any work is done; nothing is left behind."""

import errno
import io
import json
import os
import shlex
import sys
import time
from fractions import Fraction
from pathlib import Path

import pytest

from quakedesign.cli import main
from quakedesign.errors import ParameterError
from quakedesign.exact import rational


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        main(list(map(str, arguments)))
    out, err = capsys.readouterr()
    return ended.value.code, out, err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["map", "cta", "--over", "k1", "k2", "--points", "2.5"], "points must be a whole number. Received '2.5'"),
        (["campaign", "lab-fault", "--samples", "2.5"], "samples must be a whole number. Received '2.5'"),
        (["simulate", "lab-fault", "--scheme", "explicit", "--substeps", "1.7"], "substeps must be a whole number"),
        (["simulate", "lab-fault", "--gains", "1", "2", "3", "4"], "need a controller. Received none"),
        (["campaign", "lab-fault", "--samples", "2", "--controller", "none", "--scale", "2"], "need a controller"),
        (["campaign", "lab-fault", "--samples", "2", "--rerun", "2"], "rerun must be an index below 2"),
        (["synthesise", "cta", "--degree", "5.5"], 'unable to convert "5.5" into int'),
        (["simulate", "lab-fault", "--controller", "cta", "--saturation", "5 MPa"], "with the scheme continuous"),
        (["certify", "elqr", "lab-fault", "--gains", "1", "2", "3", "4", "--step", "1 m"], "step"),
    ],
)
def test_one_line_says_what_is_wrong(capsys, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, *arguments)
    assert (code, out) == (2, "")
    assert said in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        ("design real-fault --controller elqrr", "elqr"),
        ("design real-fault --controller ELQR", "elqr"),
        ("design real-fault --box ten_percent", "ten-percent"),
        ("design real-fault --published-scheme explict", "explicit"),
        ("design real-fault --objective pek", "peak"),
        ("compare real-fault --objective pek", "peak"),
        ("guarantee real-fault --controller elqrr", "elqr"),
        ("guarantee real-fault --controller cta --scheme compensatd", "compensated"),
        ("guarantee real-fault --class ratee", "rate"),
        ("guarantee real-fault --step '3 mss'", "ms"),
        ("simulate real-fault --controller cta --gains publishd", "published"),
        ("simulate real-fault --controller cta --feedforward nominl", "nominal"),
        ("simulate real-fault --controller cta --plant stick-slop", "stick-slip"),
        ("simulate real-fault --controller cta --method dormand-prnce", "dormand-prince"),
        ("simulate crustal-patch --start lokced", "locked"),
        ("synthesise cta real-fault --objective decy", "decay"),
        ("certify ctaa real-fault --gains 1 2 3 4", "cta"),
        ("certify cta --gains 7 5 2 1 --maximize lipschiz", "lipschitz"),
        ("figures real-fault --format svgg", "svg"),
        ("fault real-fault --log-level inf", "info"),
        ("fault real-falt", "real-fault"),
        ("completion bsh", "bash"),
    ],
)
def test_what_is_misspelt_is_asked_for_by_its_nearest_name(capsys, tmp_path, monkeypatch, arguments, meant):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, *shlex.split(arguments))
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.replace('"', "").endswith(f"Did you mean {meant}?\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["design", "compare", "figures"])
def test_friction_with_a_state_has_no_other_plant_and_nothing_is_done(capsys, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, command, "crustal-patch", "--plant", "printed")
    assert (code, out) == (2, "")
    assert "plant must be omitted for friction with a state, which never rests. Received 'printed'" in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "arguments",
    [
        ["design", "lab-fault", "--out"],
        ["sampling", "lab-fault", "--out"],
        ["map", "cta", "--over", "k1", "k2", "--out"],
        ["simulate", "lab-fault", "--out"],
        ["certify", "cta", "--gains", "7", "5", "2.3", "1.1", "--lipschitz", "1", "--out"],
    ],
)
def test_a_place_that_cannot_be_written_is_refused_before_the_work(capsys, tmp_path, monkeypatch, arguments):
    search = "quakedesign.lyapunov.search.lyapunov_search"
    for module in ("quakedesign.simulation.simulate", search, "quakedesign.lyapunov.maps.gain_map"):
        __import__(module)
    monkeypatch.setattr(f"{search}.find_certificate", lambda *_, **__: pytest.fail("searched"))
    code, out, err = run(capsys, *arguments, tmp_path / "none" / "there")
    assert (code, out) == (2, "")
    assert "must be in a folder that can be written" in err


def test_an_unknown_metric_is_refused_before_any_sample_runs(capsys, tmp_path):
    folder = tmp_path / "campaign"
    code, _, err = run(capsys, "campaign", "lab-fault", "--samples", "2", "--search", "foo", "--out", folder)
    assert code == 2
    assert "metric must be one of" in err
    assert not folder.exists()


def test_a_step_has_a_unit_or_is_a_fraction_of_seconds(capsys, monkeypatch):
    asked = ("certify", "elqr", "real-fault", "--gains", "1.88e9", "5.79e8", "1.02e6", "18.52", "--json", "--step")
    code, out, _ = run(capsys, *asked, "92 ms")
    assert (code, json.loads(out)["held"]["step"]) == (0, 0.092)
    steps = []

    def told(*_, step, **__):
        steps.append(rational(step, "step"))
        raise ParameterError("that is all")

    monkeypatch.setattr("quakedesign.linear.verdict.judge", told)
    for written in ("92 ms", "23/250", "0.092", "9.2E-2"):
        assert run(capsys, *asked, written)[0] == 2
    assert steps == [Fraction(92, 1000)] * 4


def test_a_proof_about_a_polynomial_says_nothing_about_a_fault(capsys, tmp_path):
    file = tmp_path / "square.json"
    assert run(capsys, "sos", "x^2 + 1", "--out", file)[0] == 0
    code, out, _ = run(capsys, "check", file, "--fault", "lab-fault")
    assert code == 0
    assert 'not compared with "lab-fault"' in out


class Full(io.StringIO):
    """A stream on a full disk."""

    def write(self, _text):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_full_disk_is_no_defect(capsys, monkeypatch):
    monkeypatch.setattr(sys, "stdout", Full())
    code, _, err = run(capsys, "fault", "lab-fault", "--json")
    assert code == 2
    assert "No space left on device" in err


def test_another_error_of_the_system_stays_a_defect(capsys, monkeypatch):
    monkeypatch.setattr("quakedesign.fault.load_fault", lambda *_, **__: os.read(-1, 1))
    code, _, err = run(capsys, "fault", "lab-fault")
    assert code == 3
    assert "internal error: OSError" in err


@pytest.mark.slow
def test_a_design_whose_run_opens_the_fault_is_no_positive_answer(capsys, tmp_path):
    import importlib.resources

    text = (importlib.resources.files("quakedesign.fault") / "presets" / "lab-fault.toml").read_text()
    text = (
        text.replace('"lab-fault"', '"hasty"')
        .replace("1 hour", "1 s")
        .replace("target_slip = ", 'target_slip = "2 m" # ')
    )
    path = tmp_path / "hasty.toml"
    path.write_text(text)
    code, out, _ = run(
        capsys, "design", path, "--controller", "elqr", "--continuous", "--out", tmp_path / "out", "--json"
    )
    (found,) = json.loads(out)["controllers"].values()
    assert found["verdict"] == "proved"
    assert {"opening", "diverged"} & set(found["events"])
    assert code == 1


@pytest.mark.slow
def test_a_proved_design_that_is_faster_than_the_natural_earthquake_is_no_positive_answer(capsys):
    path = Path(__file__).parent.parent / "data" / "undersampled_fault.toml"
    code, out, _ = run(capsys, "compare", path, "--controller", "cta", "--continuous", "--plant", "printed", "--json")
    answer = json.loads(out)
    (found,) = answer["controllers"].values()
    assert code == 1
    assert (found["verdict"], found["outcome"]["kind"]) == ("proved", "earthquake")
    assert found["outcome"]["peak_slip_rate"] > answer["uncontrolled"]["outcome"]["peak_slip_rate"] > 0.3
    assert found["headline"].startswith("earthquake: ")


@pytest.mark.slow
def test_a_design_for_a_shorter_period_than_that_of_the_fault_is_no_positive_answer(capsys):
    path = Path(__file__).parent.parent / "data" / "undersampled_fault.toml"
    code, out, _ = run(capsys, "compare", path, "--controller", "cta", "--json")
    (found,) = json.loads(out)["controllers"].values()
    assert code == 1
    assert (found["verdict"], found["outcome"]["kind"]) == ("proved", "tracked")
    (premise,) = (p for p in found["premises"] if p["name"] == "sampling_time")
    assert not premise["holds"]
    assert premise["required"] == pytest.approx(0.1)
    assert found["run"]["step"] == pytest.approx(premise["certified"])


UNTIMELY = {
    "no workers": ("map", "cta", "--over", "k1", "k2", "--workers", "0"),
    "many workers": ("map", "cta", "--over", "k1", "k2", "--workers", "100000"),
    "no workers to search": ("synthesise", "cta", "--workers", "0"),
    "a long folder": ("design", "real-fault", "--out", "a" * 300),
    "a long folder of letters of four bytes": ("design", "real-fault", "--out", chr(0x1D49C) * 60),
    "a long file": ("simulate", "real-fault", "--out", "a" * 300 + ".nc"),
    "a long export": ("export", "real-fault", "--out", "a" * 300),
    "a long path": ("fault", "/".join("a" * 200 for _ in range(25)) + ".toml"),
}


@pytest.mark.parametrize("arguments", UNTIMELY.values(), ids=UNTIMELY)
def test_what_cannot_be_is_refused_before_the_work(arguments, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    began = time.process_time()
    code, out, err = run(capsys, *arguments)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert len(err) < 600
    assert time.process_time() - began < 10
    assert list(tmp_path.iterdir()) == []


def test_a_compiler_that_cannot_be_read_is_none(capsys, monkeypatch):
    monkeypatch.setenv("CC", "'x")
    code, _, err = run(capsys, "simulate", "lab-fault", "--duration", "0.01", "--json")
    assert (code, err) == (0, "")


@pytest.mark.parametrize(
    ("given", "where"),
    [
        (("guarantee", "lab-fault", "--step", "-1 ms"), "write --option=value. See quakedesign guarantee --help."),
        (("limits", "lab-fault", "lab-fault"), "See quakedesign limits --help."),
        (("--json", "fault", "lab-fault"), "See quakedesign --help."),
        (("fault", "lab-fault", "--where", "x"), "See quakedesign fault --help."),
    ],
)
def test_what_is_in_the_wrong_place_is_told_where_to_look(given, where, capsys):
    with pytest.raises(SystemExit) as end:
        main(list(given))
    err = capsys.readouterr().err
    assert (end.value.code, err.count("\n")) == (2, 1)
    assert err.rstrip().endswith(where)


def test_a_value_that_is_wrong_has_its_own_remedy(capsys):
    with pytest.raises(SystemExit):
        main(["guarantee", "lab-fault", "--step=-1 ms"])
    assert "--help" not in capsys.readouterr().err


def test_a_folder_is_no_certificate(tmp_path, capsys):
    with pytest.raises(SystemExit) as end:
        main(["check", str(tmp_path)])
    assert end.value.code == 2
    assert f"certificate must be a file. Received {tmp_path}, which is not a file" in capsys.readouterr().err
