"""A law from the file of its guarantee of slow sliding: run as it is proved, for what the proof covers alone."""

import json
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import numpy as np
import pytest

import quakedesign as qd
from quakedesign.checking import check_files
from quakedesign.cli import main
from quakedesign.cli.options import LawOptions, SpreadOptions
from quakedesign.errors import CertificateError, ParameterError
from quakedesign.guarantees import save_guarantee
from quakedesign.loop.sensing import Transducer
from quakedesign.lyapunov import Verdict
from quakedesign.plant import slow_sliding_plant
from quakedesign.simulation.slow_sliding import simulate_sliding
from quakedesign.simulation.state_plant import TIDE, SlidingVariation, Tide
from quakedesign.studies import single_runs as state_runs
from quakedesign.studies.single_runs import run_sliding

FILE = Path(__file__).parents[2] / "proofs" / "certificates" / "sliding_crustal-patch.json"
CRUSTAL = qd.load_fault("crustal-patch")
CLAIM = qd.load_guarantee(FILE)
SHORT = ("--duration", "3 h")
SAID = {
    "direct_effect": "a [-]",
    "evolution_effect": "b [-]",
    "critical_slip": "D_c [m]",
    "coefficient": "friction at V [-]",
    "normal_stress": "normal stress [Pa]",
}


def told(capsys, *arguments):
    with pytest.raises(SystemExit) as stop:
        main([*map(str, arguments)])
    out, err = capsys.readouterr()
    return stop.value.code, out, err


@pytest.mark.slow
def test_it_runs_with_its_step_and_rock_under_all_the_stress_that_it_is_proved_for(capsys):
    code, out, err = told(capsys, "simulate", "crustal-patch", "--certificate", FILE, *SHORT, "--json")
    answer, held, stress = json.loads(out), CLAIM.sampled_loop, float(CLAIM.task.stress)
    assert (code, err, answer["guarantee"]["sentence"]) == (0, "", CLAIM.sentence())
    assert (answer["step"], answer["diffusion"]) == (float(held.step), float(held.diffusion))
    same = qd.simulate(CRUSTAL, CLAIM.controller, duration=3 * 3600.0, tide=Tide(amplitude=stress, period=TIDE))
    assert answer["metrics"]["max_asked"] == pytest.approx(float(np.max(np.abs(same.feedback_pressure))), rel=1e-9)
    assert answer["stress"] == pytest.approx(float(np.max(np.abs(same.stress))), rel=1e-9)
    code, out, _ = told(
        capsys, "simulate", "crustal-patch", "--certificate", FILE, *SHORT, "--stress", "1 kPa", "--controller", "elqr"
    )
    assert code == 0
    assert "under a shear stress of up to 0.9986 kPa" in out
    assert "proved: from steady sliding" in out


@pytest.mark.parametrize(
    ("more", "outside"),
    [
        ((), []),
        (("--stress", "200 kPa"), ["stress"]),
        (("--saturation", "1 MPa", "--slip-noise-deviation", "1 um", "--seed", "2"), ["saturation", "slip_noise"]),
    ],
)
def test_a_run_that_is_not_what_is_proved_says_so(capsys, more, outside):
    run = ("simulate", "crustal-patch", "--certificate", FILE, "--duration", "1000 s", *more)
    assert json.loads(told(capsys, *run, "--json")[1])["outside"] == outside
    said = " ".join(told(capsys, *run)[1].split())
    assert ("this run is NOT covered by the proof, from which it differs in: " + ", ".join(outside) in said) == bool(
        outside
    )
    assert (" proved: from steady sliding" in said) == (not outside)


@pytest.mark.parametrize(
    ("fault", "more", "said"),
    [
        ("creeping-patch", (), "rate [m/s] 0.000001 in the certificate"),
        ("real-fault", (), "for friction with a state if and only if the fault has such"),
        ("crustal-patch", ("--lag", "2 s"), "lag cannot be used with"),
        ("crustal-patch", ("--controller", "cta"), "--certificate contains the law"),
    ],
)
def test_it_is_for_its_fault_and_as_it_is(capsys, fault, more, said):
    code, out, err = told(capsys, "simulate", fault, "--certificate", FILE, *more)
    assert (code, out) == (2, "")
    assert said in err


def test_a_delay_and_noise_of_the_proof_are_in_the_run(capsys, monkeypatch, tmp_path):
    late = replace(
        CLAIM, sampled_loop=replace(CLAIM.sampled_loop, delay=CLAIM.sampled_loop.step, slip_noise=F(1, 10**6))
    )
    assert run_sliding(CRUSTAL, claim=late, duration=1000.0)[1]["stages"] == ["delay"]
    save_guarantee(late, tmp_path / "late.json")
    monkeypatch.setattr(type(CLAIM), "check", lambda claim: Verdict.PROVED)
    seen = {}
    monkeypatch.setattr(
        state_runs, "run_sliding", lambda fault, **told: seen.update(told) or run_sliding(fault, **told)
    )
    code, out, _ = told(
        capsys, "simulate", "crustal-patch", "--certificate", tmp_path / "late.json", "--duration", "1000 s", "--json"
    )
    assert (code, json.loads(out)["stages"]) == (0, ["delay"])
    assert seen["transducer"] == Transducer(quantum=2e-6)
    with pytest.raises(ParameterError, match=r"a certificate with a delay of .* and slip noise of"):
        SpreadOptions().choose(CRUSTAL, LawOptions(certificate=tmp_path / "late.json"), None, {})


def test_a_campaign_varies_what_it_is_proved_for_unless_told():
    law = LawOptions(certificate=FILE)
    chosen, varied = SpreadOptions().choose(CRUSTAL, law, None, {})
    assert chosen.controller == CLAIM.controller
    low, high = CLAIM.task.ranges["direct_effect"]
    assert varied == {"spread": (high - low) / (high + low), "stress": float(CLAIM.task.stress)}
    told = {"spread": F(1, 100), "stress": 1000.0, "stress_period": 60.0}
    assert SpreadOptions(spread="0.01", stress=1000.0, stress_period=60.0).choose(CRUSTAL, law, None, {})[1] == told


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("density", F(1)), ("shear_modulus", F(1)), ("length", F(1)), ("damping", F(1)), ("rate", F(1)), ("ramp", F(1)),
        ("state_law", "slip"), ("regularised", True), ("distance", F(10)), ("swing", F(1, 2)), ("stress", F(10**9)),
    ],
)  # fmt: skip
def test_what_a_proof_does_not_cover_is_named(name, value):
    (found,) = CLAIM.task.differences(replace(CLAIM.task, **{name: value}))
    assert found.startswith(f"{name} [")
    assert not CLAIM.task.differences(replace(CLAIM.task, distance=F(1, 10**6), stress=F(1), name="another"))


def test_constants_of_friction_lie_within_those_of_a_proof():
    for axis, (low, high) in CLAIM.task.ranges.items():
        wide = replace(CLAIM.task, ranges={**CLAIM.task.ranges, axis: (low * F(9, 10), high * F(11, 10))})
        assert wide.differences(CLAIM.task) == []
        for ends in ((low * F(9, 10), high), (low, high * F(11, 10))):
            (found,) = CLAIM.task.differences(replace(CLAIM.task, ranges={**CLAIM.task.ranges, axis: ends}))
            assert found.startswith(f"{SAID[axis]} from ")


@pytest.mark.parametrize(("fault", "verdict"), [("crustal-patch", "proved"), ("creeping-patch", "invalid")])
def test_check_compares_a_fault_with_a_file_of_uncertain_friction(monkeypatch, tmp_path, fault, verdict):
    """The ranges of the file are 1 % to both sides of the fault's constants."""
    wide = replace(CLAIM, task=slow_sliding_plant(CRUSTAL, CLAIM.task.stress, F(1, 100)))
    save_guarantee(wide, tmp_path / "wide.json")
    monkeypatch.setattr(type(CLAIM), "check", lambda claim: Verdict.PROVED)
    ((found, lines),) = check_files([tmp_path / "wide.json"], fault).values()
    assert found.startswith(verdict)
    assert ('the data are those of "crustal-patch"' in lines) == (verdict == "proved")


def test_a_fault_within_the_box_of_a_proof_runs_with_the_plan_of_the_proof(capsys, monkeypatch, tmp_path):
    """The run is that of the nominal fault whose true a is larger; the certificate's point box is widened for it."""
    wide = {axis: (low * F(99, 100), high * F(101, 100)) for axis, (low, high) in CLAIM.task.ranges.items()}
    claim = replace(CLAIM, task=replace(CLAIM.task, ranges=wide))
    file = tmp_path / "wide.json"
    save_guarantee(claim, file)
    monkeypatch.setattr(type(CLAIM), "check", lambda claim: Verdict.PROVED)
    true = replace(CRUSTAL, friction=replace(CRUSTAL.friction, direct_effect=1.005 * CRUSTAL.friction.direct_effect))
    assert LawOptions(certificate=file).choose(true).claim.task.ranges == wide
    found = run_sliding(true, claim=claim, stress=1000.0, duration=3000.0)[0]
    expected = simulate_sliding(
        CRUSTAL,
        CLAIM.sampled_loop.law,
        CLAIM.sampled_loop.step,
        lag=CLAIM.sampled_loop.lag,
        diffusion=CLAIM.sampled_loop.diffusion,
        tide=Tide(amplitude=1000.0, period=TIDE),
        variation=SlidingVariation(direct_effect=1.005),
        duration=3000.0,
        inertia=True,
    )
    assert found.pressure == pytest.approx(expected.pressure, rel=1e-9, abs=1e-3)
    assert found.slip == pytest.approx(expected.slip, rel=1e-9)
    with pytest.raises(ParameterError, match="the fault of a campaign of slow sliding must have the constants"):
        SpreadOptions().choose(true, LawOptions(certificate=file), None, {})
    far = replace(CRUSTAL, friction=replace(CRUSTAL.friction, critical_slip=1.02 * CRUSTAL.friction.critical_slip))
    with pytest.raises(
        CertificateError, match=r": D_c \[m\] from 0\.\d+ to 0\.\d+ in the certificate, 0\.\d+ in the f"
    ):
        LawOptions(certificate=file).choose(far)


def test_a_sentence_names_the_noise_or_exact_measurements_and_the_slip_rounded_down():
    noisy = replace(
        CLAIM,
        sampled_loop=replace(CLAIM.sampled_loop, slip_noise=F(1, 10**6)),
        task=replace(CLAIM.task, distance=F("0.12345")),
    )
    for claim, said, slip in (
        (CLAIM, "with exact measurements of slip", "1 m"),
        (noisy, "with any noise of at most 1e-06 m in the measured slip", "0.1234 m"),
    ):
        assert f", {said}, for every shear stress" in claim.sentence()
        assert (
            f"during the {slip} of slip of the task, in which the fault slides forward throughout" in claim.sentence()
        )
