"""A law from the file of its guarantee: run, exported and sampled as it is proved, for its fault alone."""

import json
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import pytest
import xarray as xr

import quakedesign as qd
from quakedesign.cli import main
from quakedesign.guarantees import SampledLoop, TrackingProof, guarantee, save_guarantee
from quakedesign.laws import ErrorModel, disturbance_estimate
from quakedesign.plant import uncertain_plant

REAL = qd.load_fault("real-fault")
STEP = F(3, 20)
LAW = disturbance_estimate(
    (F(672300000), F(206000000)),
    F("0.57"),
    ErrorModel.delayed(((F(1), F(0)), (F("0.0722"), F("0.7475"))), ((F(0), F("0.1596")),), F("2.282e-8")),
)
HELD = SampledLoop(law=LAW, step=STEP, lag=F(1, 50), slip_noise=F(1, 10**7))
CLAIM = guarantee(uncertain_plant(REAL), HELD)
SHORT = ("--duration", "30 s")


@pytest.fixture
def file(tmp_path):
    assert isinstance(CLAIM, TrackingProof)
    save_guarantee(CLAIM, tmp_path / "law.json")
    return tmp_path / "law.json"


def told(capsys, *arguments):
    with pytest.raises(SystemExit) as stop:
        main([*map(str, arguments)])
    out, err = capsys.readouterr()
    return stop.value.code, out, err


def test_a_file_holds_its_law_with_the_limit_at_rest_and_what_stands_around_it(file):
    law = qd.load_guarantee(file).controller
    assert law.rest_limit == CLAIM.controller.rest_limit is not None
    assert (law.law.applied, law.sampling) == (LAW.applied, CLAIM.controller.sampling)
    assert law.sampling.path == {"delay": 0, "lag": F(1, 50), "diffusion": 0}
    assert qd.loop_transfer(REAL, law).nstates == 2 + 1 + 2


def test_a_file_about_an_uncertain_plant_holds_no_law_of_a_fault(capsys):
    pendulum = Path(__file__).parents[2] / "proofs" / "certificates" / "uncertain_plant_pendulum.json"
    code, out, err = told(capsys, "simulate", "real-fault", "--certificate", pendulum, *SHORT)
    assert (code, out) == (2, "")
    assert "about an uncertain plant" in " ".join(err.split())


@pytest.mark.slow
def test_it_runs_behind_its_lag_with_its_noise(file, capsys):
    code, out, _ = told(capsys, "simulate", "real-fault", "--certificate", file, *SHORT, "--json")
    answer = json.loads(out)
    assert (code, answer["guarantee"]["sentence"]) == (0, CLAIM.sentence())
    assert (answer["run"]["step"], answer["run"]["actuator"]) == (0.15, "Lag(time_constant=0.02)")
    assert answer["run"]["measurement"] == "Measurement(slip_noise=1e-07, rate_noise=0.0, seed=0, bounded=True)"
    code, out, _ = told(
        capsys, "simulate", "real-fault", "--certificate", file, *SHORT, "--slip-noise-deviation", "1 nm",
        "--lag", "0.1 s", "--saturation", "20 MPa", "--plant", "printed", "--json",
    )  # fmt: skip
    answer = json.loads(out)
    assert (answer["guarantee"]["sentence"], answer["outside"]) == (
        CLAIM.sentence(),
        ["saturation", "lag", "slip_noise"],
    )
    run = answer["run"]
    assert run["actuator"] == "Saturation(lowest=-20000000.0, highest=20000000.0), Lag(time_constant=0.1)"
    assert run["measurement"].startswith("Measurement(slip_noise=1e-09, ")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("more", "outside"),
    [
        (("--plant", "printed"), ""),
        (("--lag", "20 ms", "--substeps", "20", "--seed", "3", "--plant", "printed"), ""),
        (("--saturation", "1 kPa", "--plant", "printed"), "saturation"),
        ((), "plant"),
        (("--initial-slip", "1 mm"), "plant, initial_slip"),
        (("--perturbation", "0.01", "--plant", "printed"), "perturbation"),
    ],
)
def test_a_run_that_is_not_what_is_proved_says_so(file, capsys, more, outside):
    out = " ".join(told(capsys, "simulate", "real-fault", "--certificate", file, *SHORT, *more)[1].split())
    if outside:
        assert (
            f"NOT covered by the proof, from which it differs in: {outside}; the proof says: on the plant without"
            in out
        )
        assert " proved: " not in out
    else:
        assert f"proved: {CLAIM.sentence()}" in out


def test_a_run_does_not_call_the_law_of_a_file_by_the_name_of_a_design(file, capsys):
    code, out, _ = told(
        capsys, "simulate", "real-fault", "--certificate", file, "--duration", "3 s", "--plant", "printed"
    )
    assert (code, out.splitlines()[0]) == (0, "real-fault, law of the certificate, plant without stick")


def test_the_pressure_of_a_run_is_compared_with_that_in_the_fault(file, capsys, monkeypatch):
    compared = []
    monkeypatch.setattr("quakedesign.report.sentences.exceeded_line", lambda *seen: compared.append(seen) or "TOO FAR")
    options = ("--duration", "3 s", "--plant", "printed")
    assert "TOO FAR" not in told(capsys, "simulate", "real-fault", "--certificate", file, *options)[1]
    said = told(capsys, "simulate", "real-fault", "--certificate", file, *options, "--initial-slip", "1 um")[1]
    assert "from which it differs in: initial_slip; TOO FAR; the proof says" in " ".join(said.split())
    assert {(least, largest) for _, least, largest in compared} == {CLAIM.claims.pressures[-1]}


@pytest.mark.slow
def test_a_start_for_which_a_law_is_proved_is_in_what_is_proved(capsys, tmp_path):
    held = replace(HELD, initial_slip=F(1, 10**5))
    claim = guarantee(uncertain_plant(REAL), held)
    save_guarantee(claim, tmp_path / "law.json")
    run = (
        "simulate",
        "real-fault",
        "--certificate",
        tmp_path / "law.json",
        *SHORT,
        "--plant",
        "printed",
        "--json",
        "--initial-slip",
    )
    assert json.loads(told(capsys, *run, "10 um")[1])["outside"] == []
    assert json.loads(told(capsys, *run, "11 um")[1])["outside"] == ["initial_slip"]


@pytest.mark.slow
def test_what_is_exported_says_first_what_it_is_for(file, capsys, tmp_path):
    code, out, _ = told(capsys, "export", "real-fault", "--certificate", file, "--out", tmp_path / "c")
    lines = out.splitlines()
    assert (code, lines[0]) == (0, "NOT for the fault's T_s = 0.184 s: it the law runs every 0.15 s")
    assert lines[1].startswith("designed for a lag of 0.02 s between controller and fault")
    assert "".join(lines[2:5]).replace(" ", "") == f"proved: {CLAIM.sentence()}".replace(" ", "")
    header = (tmp_path / "c" / "controller.h").read_text(encoding="utf-8")
    assert header.startswith(
        "/*\n * NOT for the fault's T_s = 0.184 s: it the law runs every 0.15 s\n *\n * designed for a lag"
    )
    assert "rest_limit: width" in header
    assert "#define CONTROLLER_STEP 0.15 /* s */" in header


def test_what_is_exported_without_a_certificate_says_that_nothing_is_stated(capsys, tmp_path):
    code, _, _ = told(capsys, "export", "real-fault", "--controller", "elqr", "--out", tmp_path / "c")
    header = (tmp_path / "c" / "controller.h").read_text(encoding="utf-8")
    assert code == 0
    assert header.startswith("/*\n * no guarantee is stated here: quakedesign guarantee --out FILE, then export")
    assert "proved" not in header


@pytest.mark.slow
def test_a_campaign_runs_it_as_it_is_proved(file, capsys, tmp_path):
    arguments = "--samples", "1", "--rerun", "0", "--workers", "1", "--duration", "3 s", "--out", tmp_path / "samples"
    code, _, err = told(capsys, "campaign", "real-fault", "--certificate", file, *arguments)
    assert (code, err) == (0, "")
    with xr.open_dataset(tmp_path / "samples" / "sample-0.nc") as run:
        assert run.attrs["actuator"] == "Lag(time_constant=0.02)"
        assert run.attrs["measurement"].startswith("Measurement(slip_noise=1e-07, ")


@pytest.mark.parametrize(
    ("fault", "more", "said"),
    [
        ("lab-fault", (), "shear_modulus [Pa] 3.00000e+10 in the certificate"),
        ("real-fault", ("--target-slip", "0.5 m"), "target_slip [m] 0.785 in the certificate, 0.5 in the fault"),
        ("real-fault", ("--gains", "designed"), "--certificate contains the law"),
        ("real-fault", ("--controller", "cta"), "--certificate contains the law"),
        ("real-fault", ("--step", "0.1 s"), "a sampled law runs with the scheme explicit and the step 0.15 s"),
        ("crustal-patch", (), "certificate"),
    ],
)
def test_it_is_for_its_fault_and_as_it_is(file, capsys, fault, more, said):
    code, out, err = told(capsys, "simulate", fault, "--certificate", file, *more)
    assert (code, out) == (2, "")
    assert said in err


def test_a_file_that_does_not_hold_is_not_run(file, capsys):
    better = replace(CLAIM, claims=replace(CLAIM.claims, slip_error=type(CLAIM.claims.slip_error)(F(1, 10**9))))
    save_guarantee(better, file)
    code, _, err = told(capsys, "export", "real-fault", "--certificate", file, "--out", file.parent / "c")
    assert code == 2
    assert "its claims do not follow" in err
    assert not (file.parent / "c").exists()
