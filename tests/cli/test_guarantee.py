"""The command about the loop that runs."""

import json
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction as F
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import quakedesign as qd
from quakedesign.checking import check_files
from quakedesign.cli import main
from quakedesign.cli.design_commands import DesignOptions
from quakedesign.cli.options import SetupOptions
from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.fault.fault_toml import source_text as load_text
from quakedesign.guarantees import NoProof, SampledLoop, TrackingGuarantee, guarantee
from quakedesign.guarantees.exact.guarantee_files import parse_guarantee
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search import linear_design as design
from quakedesign.guarantees.search.lqg import family_of
from quakedesign.loop.loop_setup import LoopSetup
from quakedesign.plant import uncertain_plant
from quakedesign.synthesis.state_feedback import StateFeedback

PROOFS = Path(__file__).parents[2] / "proofs" / "certificates"


@pytest.fixture
def call(capsys):
    """Exit code, standard output and standard error."""

    def run(*arguments):
        with pytest.raises(SystemExit) as ended:
            main(["guarantee", *arguments])
        said = capsys.readouterr()
        return ended.value.code, said.out, said.err

    return run


@pytest.mark.slow
def test_a_designed_loop_of_the_stick_slip_plant_with_its_file(call, tmp_path):
    """By default; the bounds that are asked for, and those of an adversary below them."""
    path = tmp_path / "loop.json"
    code, out, _ = call("real-fault", "--json", "--out", str(path))
    found = json.loads(out)
    assert (code, found["verdict"], found["certificate"]) == (0, "proved", str(path))
    assert (found["plant"], found["class"]) == ("stick-slip", "amplitude")
    assert "on the plant without stick" not in found["sentence"]
    assert "whether the fault slides or sticks" in found["sentence"]
    assert F(found["peak_slip_rate"]) <= F(19, 10**5)
    assert F(found["slip_error"]) == F(found["slip_ahead"]) <= F(37, 10**6)
    assert F(found["slip_behind"]) <= F(21, 10**6)
    seen, limit = found["worst_found"], F(found["limit"]["slip_rate"])
    assert F(1, 10**4) < limit < F(found["peak_slip_rate"])
    assert 0.65 * float(F(found["peak_slip_rate"])) < seen["slip_rate"] < F(found["peak_slip_rate"])
    assert 0 < seen["slip_behind"] < F(found["slip_behind"])
    assert 0 < seen["slip_ahead"] < F(found["slip_ahead"])
    assert check_files([path], "real-fault")[str(path)][0] == "proved"


@pytest.mark.slow
def test_a_designed_loop_with_its_file(call, tmp_path):
    path = tmp_path / "loop.json"
    code, out, _ = call("real-fault", "--plant", "printed", "--json", "--out", str(path))
    found = json.loads(out)
    assert (code, found["verdict"], found["certificate"]) == (0, "proved", str(path))
    assert (found["measured"], found["slip_noise"], found["rate_noise"]) == ("slip-and-rate", "0", "0")
    assert F(found["slip_rate_error"]) <= F(3, 10**4)
    assert F(found["slip_error"]) <= F(6, 10**5)
    assert F(found["slip_rate_error"]) < F(found["peak_slip_rate"]) < F(found["slip_rate_error"]) * F(11, 10)
    assert F(found["pressure"][0]) < -14_000_000
    assert F(found["pressure"][1]) > 14_000_000
    assert 0 < found["small_gain"] < 1
    assert len(found["law"]["applied"]) == len(found["law"]["states"])
    assert F(found["rest_limit"]["width"]) >= 2 * (F(found["pressure"][1]) - 14_050_000)  # p* is at most 14.05 MPa
    for seen in ("worst_found", "worst_found_with_stick"):
        assert 0 < found[seen]["slip_error"] <= F(found["slip_error"])
        assert F(found["slip_rate_error"]) / 2 <= found[seen]["slip_rate_error"] <= F(found["slip_rate_error"])
    limit = F(found["limit"]["slip_rate_error"])
    assert F(1, 10**4) < limit < F(found["slip_rate_error"])
    assert check_files([path], "real-fault")[str(path)][0] == "proved"
    code, _, err = call("real-fault", "--out", str(path))
    assert code == 2
    assert "must be new" in err


GAINS = ("6.96e8", "2.53e8", "6.02e8", "2.16e8")
GUARANTEE = import_module("quakedesign.synthesis.guarantee")  # the module: the package has a function of this name


@pytest.mark.slow
def test_given_gains_for_people(call):
    code, out, _ = call("real-fault", "--gains", *GAINS)
    assert code == 0
    answer, told = out.split("\n\n", 1)
    first = "real-fault: guaranteed. On the plant without stick, the slip rate never exceeds "
    assert " ".join(answer.split()).startswith(first)
    assert "% of the natural earthquake's 74.5 mm/s, magnitude 5.8), and the slip stays within" in " ".join(
        answer.split()
    )
    assert told.startswith(
        "proved: on the plant without stick, from rest, with zero-order hold over 0.184 s, with exact measurements of "
        "slip and slip rate, for every disturbance of at most 0.00032 m/s^2 (4 kPa"
    )
    assert "worst case found on the stick-slip plant" in out
    assert "of the box: the slip rate never exceeds" in " ".join(out.split())
    assert max(map(len, out.splitlines())) <= 200


@pytest.mark.slow
def test_a_law_that_is_unstable_by_itself_is_not_for_a_fault_that_sticks():
    """A design one period late with larger gains, run on a fault at rest whatever it asks for: its own recursion."""
    fault, late = load_fault("real-fault"), F("0.184")
    law = family_of(uncertain_plant(fault), late, "slip-and-rate", ExactSetup(delay=late)).law(
        np.array((0.6, 1.0, 0.1))
    )
    found = TrackingGuarantee(
        fault=fault, proof=guarantee(uncertain_plant(fault), SampledLoop(law=law, step=late, delay=late))
    )
    assert found.proved
    rows, seen = (np.array(m, dtype=float) for m in (law.update, law.measured))
    states, sizes = np.zeros(len(rows)), []
    for _ in range(200):
        states = rows @ states + seen @ np.array([1e-6, 0.0])
        sizes.append(np.abs(states).max())
    assert found.grows_at_rest == pytest.approx(0.184 * 20 / np.log(sizes[-1] / sizes[-21]), rel=1e-6)
    assert found.lines()[1].startswith("NOT for a stick-slip fault: the law is unstable in open loop")
    held = qd.guarantee(fault, plant="printed")
    assert held.proved
    assert held.grows_at_rest is None  # it has an integral, and grows no faster than a line
    assert not any("NOT" in line for line in held.lines())


@pytest.mark.slow
def test_one_period_late_the_design_is_for_a_fault_that_sticks(call):
    code, out, _ = call("real-fault", "--delay", "184 ms", "--json")
    found = json.loads(out)
    assert (code, found["verdict"], found["grows_at_rest"]) == (0, "proved", None)
    assert F(found["slip_rate_error"]) <= F(6, 10**4)
    for name in ("slip_error", "slip_rate_error"):
        assert found["worst_found_with_stick"][name] <= F(found[name]) <= 2 * F(found["worst_found"][name])


@pytest.mark.slow
def test_gains_that_are_not_guaranteed_say_what_fails(call):
    code, out, _ = call("real-fault", "--gains", *GAINS, "--delay", "150 ms", "--json")
    found = json.loads(out)
    assert (code, found["verdict"], found["shorter"]) == (1, "undecided", None)
    assert found["nearest"]["quantity"] == "gains"  # a design is proved with all else as it is
    assert found["reason"].startswith("small gain")
    assert F(found["small_gain"]) >= 1
    assert found["class"] == "amplitude"


@pytest.mark.slow
def test_gains_that_do_not_hold_the_nominal_fault_either(call, tmp_path):
    path = tmp_path / "law.json"
    code, out, _ = call("real-fault", "--gains", "1", "1", "1", "1", "--out", str(path))
    assert (code, path.exists()) == (1, False)
    assert out.startswith("none: with zero-order hold over 0.184 s even the nominal loop is not stable")
    assert f"{path} is not written" in out


def test_where_no_controller_can_hold_the_fault_the_nearest_rock_that_is_proved_is_named(call, monkeypatch):
    stored = parse_guarantee((PROOFS / "guarantee_real-fault.json").read_text())
    near = replace(stored, sampled_loop=replace(stored.sampled_loop, diffusion=F(7)))
    monkeypatch.setattr(GUARANTEE, "nearest_setup", lambda *_, **__: ("diffusion", near))
    code, out, _ = call("real-fault", "--diffusion", "180 s")
    assert code == 1
    assert out.startswith(
        "none: no controller that withdraws at most 50 MPa can hold the fault through a diffusion path"
    )
    assert "with a diffusion time L^2/D of 7 s: on the plant without stick, from rest, " in out
    assert "command limits" not in out


@pytest.mark.parametrize(("name", "least", "most"), [("delay", F("17.6"), F("18.5")), ("diffusion", F(172), F(180))])
def test_everything_else_is_designed_for(monkeypatch, name, least, most):
    """The limits at T_s = 0.184 s are 17.7 s and 172 s; those for any T_s a little more."""
    fault = load_fault("real-fault")
    monkeypatch.setattr(StateFeedback, "sampled", lambda *_: "designed")
    monkeypatch.setattr(GUARANTEE, "nearest_setup", lambda *_, **__: None)
    assert qd.guarantee(fault, **{name: least}) == "designed"
    smooth = qd.guarantee(fault, **{name: most}, disturbance_class="rate")
    assert smooth == "designed"  # the limits push with what jumps
    assert qd.guarantee(fault, **{name: most}, gains=GAINS) == "designed"
    assert not qd.guarantee(fault, **{name: most}).proved


@pytest.mark.parametrize(("step", "slow"), [(F("17.8"), False), (F("18.5"), True)])
def test_where_no_controller_renews_its_pressure_so_slowly_the_answer_says_so(monkeypatch, step, slow):
    """17.9 s on real-fault: a constant push needs 50 MPa by then."""
    fault = load_fault("real-fault")
    none = TrackingGuarantee(fault=fault, proof=NoProof(reason="small gain 7"))
    monkeypatch.setattr(StateFeedback, "sampled", lambda *_: none)
    said = qd.guarantee(fault, step=step).proof.reason
    assert said.startswith("no controller that withdraws at most 50 MPa can hold the fault with T_s") is slow
    assert (" s (for some friction of the box, under the largest disturbance" in said) is slow
    for other in ({"gains": GAINS}, {"disturbance_class": "rate"}):
        assert qd.guarantee(fault, step=step, **other) == none


@pytest.mark.slow
def test_a_sliding_mode_with_its_file(call, tmp_path):
    path = tmp_path / "cta.json"
    printed = "--plant", "printed"
    code, out, _ = call("real-fault", "--controller", "cta", *printed, "--json", "--out", str(path))
    found = json.loads(out)
    assert (code, found["verdict"], found["controller"]["scheme"]) == (0, "proved", "compensated")
    assert F(found["slip_rate_error"]) <= F(4, 10**4)
    assert F(found["slip_error"]) <= F(6, 10**5)
    for seen in ("worst_found", "worst_found_with_stick"):
        assert 0 < found[seen]["slip_error"] <= F(found["slip_error"])
        assert 0 < found[seen]["slip_rate_error"] <= F(found["slip_rate_error"])
    assert F(found["slip_rate_error"]) <= 2 * found["worst_found"]["slip_rate_error"]
    assert 0 < found["small_gain"] < 1
    assert F(1, 10**4) < F(found["limit"]["slip_rate_error"]) < F(found["slip_rate_error"])
    assert check_files([path], "real-fault")[str(path)][0] == "proved"


@pytest.mark.slow
def test_a_sliding_mode_with_given_gains_for_people(call):
    printed = "--objective", "peak", "--plant", "printed"
    code, out, _ = call("real-fault", "--controller", "dia", "--gains", "1", "20", "1", "0", *printed)
    assert code == 0
    told = out.split("\n\n", 1)[1]
    assert told.startswith("proved: on the plant without stick, from rest, with zero-order hold over 0.184 s")
    assert "2-DIA with kI1 = 1, kI2 = 20, kI3 = 1, kI4 = 0" in out
    assert "within the proved errors its implicit step is deadbeat, e1 + T_s·w = 0: its pressures are those" in out


@pytest.mark.slow
def test_a_sliding_mode_is_guaranteed_on_the_stick_slip_plant_with_its_file(call, tmp_path):
    path = tmp_path / "dia.json"
    code, out, _ = call("real-fault", "--controller", "dia", "--json", "--out", str(path))
    found = json.loads(out)
    assert (code, found["verdict"], found["plant"]) == (0, "proved", "stick-slip")
    assert found["controller"]["scheme"] == "stick-slip"
    assert F(1, 10**4) < F(found["limit"]["slip_rate"]) < F(found["peak_slip_rate"]) <= F("2.4e-4")
    assert F(found["slip_error"]) <= F("5e-5")
    for name, claim in (("slip_rate", "peak_slip_rate"), ("slip_error", "slip_error")):
        assert F("0.65") * F(found[claim]) <= found["worst_found"][name] <= F(found[claim])
    assert check_files([path], "real-fault")[str(path)][0] == "proved"
    code, out, _ = call("real-fault", "--controller", "dia", "--gains", "1", "20", "1", "0")
    assert code == 0
    assert "2-DIA with kI1 = 1, kI2 = 20, kI3 = 1, kI4 = 0" in out
    assert "in the scheme stick-slip with slip weight 0.5" in out
    assert "whether the fault slides or sticks" in out


@pytest.mark.parametrize(
    ("scheme", "words"),
    [("explicit", "chatters"), ("semi-implicit", "chatters"), ("continuous", "at every instant"),
     ("implicit", "an equilibrium pressure p* leaves the error e1 = T_s²·B0·p*, here up to 0.0091 m")],
)  # fmt: skip
def test_other_schemes_of_sliding_modes_get_an_honest_none(call, scheme, words):
    code, out, _ = call("real-fault", "--controller", "cta", "--scheme", scheme)
    assert code == 1
    assert out.startswith("none: ")
    assert words in out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("real-fault", "--gains", "1", "2"), "four numbers"),
        (("real-fault", "--controller", "cta", "--gains", "1", "2"), "4 gains"),
        (("real-fault", "--controller", "cta", "--scheme", "none"), "scheme must be one of"),
        (("real-fault", "--scheme", "compensated"), "runs in the scheme explicit"),
        (("real-fault", "--step", "0"), "step must be positive"),
        (("real-fault", "--step", "1e-300"), "step must be positive"),
        (("real-fault", "--gains", *GAINS, "--delay", "-1"), "delay"),
        (("real-fault", "--delay", "9"), "delay"),
        (("real-fault", "--gains", *GAINS, "--lag", "-1"), "lag"),
        (("real-fault", "--class", "none"), "class"),
        (("nowhere",), "fault must be"),
    ],
)
def test_what_cannot_be_understood_is_one_line(call, arguments, words):
    code, out, err = call(*arguments)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert words in err


@pytest.fixture
def unattacked(monkeypatch):
    """Without the search for the worst, which has tests of its own."""
    module = import_module("quakedesign.guarantees.tracking_result")
    monkeypatch.setattr(module, "worst_tracking", lambda *_, **__: None)


@pytest.mark.slow
@pytest.mark.usefixtures("unattacked")
def test_the_slip_alone_with_noise_and_its_file(call, tmp_path):
    path = tmp_path / "slip.json"
    line = ("--measured", "slip", "--slip-noise", "1 um", "--json", "--out", str(path))
    code, out, _ = call("real-fault", *line)
    found = json.loads(out)
    assert (code, found["verdict"]) == (0, "proved")
    assert (
        "with the slip alone measured, with any noise of at most 1e-06 m in the measured slip, for" in found["sentence"]
    )
    assert (found["measured"], found["slip_noise"], found["rate_noise"]) == ("slip", "1/1000000", "0")
    assert F(139, 10**6) < F(found["limit"]["slip_rate_error"]) < F(found["slip_rate_error"]) <= F(4, 10**4)
    assert json.loads(path.read_text())["loop"]["noise"] == {"slip": "1/1000000", "rate": "0"}
    assert check_files([path], "real-fault")[str(path)][0] == "proved"


@pytest.mark.slow
@pytest.mark.usefixtures("unattacked")
def test_noise_in_given_gains_and_in_a_sliding_mode(call):
    noise = ("--slip-noise", "1e-6", "--rate-noise", "1/1000000")
    said = "with any noise of at most 1e-06 m in the measured slip, with any noise of at most 1e-06 m/s in the measured"
    for more in (("--gains", *GAINS), ("--controller", "cta")):
        code, out, _ = call("real-fault", *more, *noise)
        assert (code, said in out) == (0, True)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--slip-noise", "1 s"), "slip noise"),
        (("--rate-noise", "-1e-6"), "rate noise must be 0 or more. Received -1e-06 m/s"),
        (("--slip-noise=-2um", "--measured", "slip"), "slip noise must be 0 or more. Received -2e-06 m."),
        (("--diffusion=-1/1000",), "diffusion must be 0 or more. Received -0.001 s"),
        (("--measured", "rate"), "measured"),
    ],
)
def test_noise_that_is_none_is_refused_in_a_line(call, options, said):
    code, _, err = call("real-fault", *options)
    assert code == 2
    assert said in err


def test_gains_that_know_nothing_of_the_rock_say_what_fails(call, monkeypatch):
    none = NoProof(reason="a design through rock is another test's")
    family = import_module("quakedesign.synthesis.state_feedback")
    for name, found in (("design_sampled_law", none), ("longest_step", None), ("nearest_setup", None)):
        monkeypatch.setattr(family, name, lambda *_, a=found, **__: a)
    code, out, _ = call("real-fault", "--gains", *GAINS, "--diffusion", "1 s")
    assert code == 1
    assert out.startswith("none: ")
    code, _, err = call("real-fault", "--gains", *GAINS, "--diffusion", "1 ms")
    assert code == 2
    assert "the diffusion time L^2/D must be 0, or at least T_s/32 = 0.00575 s. Received 0.001 s" in err


@pytest.mark.slow
def test_a_fault_behind_a_well_with_its_file(call, tmp_path):
    path = tmp_path / "well.json"
    more = ("--step", "50 ms", "--diffusion", "1 s", "--objective", "peak", "--json", "--out", str(path))
    code, out, _ = call("real-fault", *more)
    found = json.loads(out)
    assert (code, found["verdict"]) == (0, "proved")
    assert F(found["slip_rate_error"]) <= F(22, 10**5)
    assert F(found["slip_rate_error"]) / 2 <= found["worst_found"]["slip_rate_error"] <= F(found["slip_rate_error"])
    for seen in ("worst_found", "worst_found_with_stick"):
        assert found[seen]["slip_error"] <= F(found["slip_error"])
        assert found[seen]["slip_rate_error"] <= F(found["slip_rate_error"])
    assert check_files([path], "real-fault")[str(path)][0] == "proved"


@pytest.mark.slow
def test_several_faults_are_asked_the_same_and_each_has_its_answer(call, tmp_path):
    own, folder = tmp_path / "own.toml", tmp_path / "proofs"
    own.write_text(load_text("real-fault").replace('name = "real-fault"', 'name = "own"'), encoding="utf-8")
    asked = ("real-fault", "crustal-patch", str(own), "--step", "0.1 s", "--workers", "2", "--out", str(folder))
    command = [sys.executable, "-m", "quakedesign", "guarantee", *asked, "--json"]
    told = subprocess.run(command, capture_output=True, text=True, check=False)
    assert told.returncode == 1, told.stderr
    found = json.loads(told.stdout)["guarantees"]
    assert [(one["fault"], one["verdict"]) for one in found] == [
        ("real-fault", "proved"),
        ("crustal-patch", "refused"),
        ("own", "proved"),
    ]
    assert "Give --diffusion" in found[1]["reason"]
    files = sorted(folder.iterdir())
    assert [one["certificate"] for one in found] == [str(files[1]), None, str(files[0])]
    assert [each[0] for each in check_files(files).values()] == ["proved", "proved"]
    assert {k: v for k, v in found[0].items() if k not in ("fault", "certificate")} == {
        k: v for k, v in found[2].items() if k not in ("fault", "certificate")
    }
    code, _, err = call(*asked)
    assert (code, "must be new" in err) == (2, True)


@pytest.mark.slow
def test_several_faults_for_people(call, monkeypatch):
    monkeypatch.setattr(GUARANTEE, "nearest_setup", lambda *_, **__: None)
    code, out, _ = call("real-fault", "crustal-patch", "--diffusion", "180 s", "--stress", "1 MPa", "--spread", "0")
    assert code == 1
    assert out.startswith('"real-fault": refused: stress and spread need friction with a state')
    code, out, _ = call("real-fault", "crustal-patch", "--diffusion", "180 s", "--measured", "slip-and-rate")
    assert out.startswith('"real-fault": none: no controller that withdraws at most 50 MPa can hold')
    assert '\n"crustal-patch": proved: ' in out
    code, _, err = call("real-fault", "real-fault")
    assert (code, "must have different names" in err) == (2, True)


@pytest.mark.slow
def test_a_pump_is_asked_for_no_more_than_it_can_do(call):
    """14.3 MPa of withdrawal and 14.2 MPa of injection are what is proved of this loop."""
    given = ("real-fault", "--gains", *GAINS, "--saturation", "15 MPa", "--json")
    code, out, _ = call(*given)
    assert (code, json.loads(out)["pump"]) == (0, {"least": "-15000000", "largest": "15000000"})
    code, out, _ = call(*given, "--withdrawal", "14 MPa")
    assert (code, json.loads(out)["verdict"]) == (1, "undecided")
    assert "but the pump supplies only -14 MPa to 15 MPa" in json.loads(out)["reason"]
    code, _, err = call("real-fault", "--withdrawal", "14 MPa")
    assert (code, "withdrawal needs saturation" in err) == (2, True)


@pytest.mark.slow
def test_jitter_and_a_slow_pump_are_in_the_answer_and_in_the_file(call, tmp_path):
    path = tmp_path / "late.json"
    asked = ("--jitter", "1 ms", "--delay-jitter", "1/2000", "--rate-limit", "60 MPa/s", "--json", "--out", str(path))
    code, out, _ = call("real-fault", "--gains", *GAINS, *asked)
    found = json.loads(out)
    assert (code, found["jitter"], found["delay_jitter"]) == (0, "1/1000", "1/2000")
    assert found["pump"] == {"rate": "60000000"}
    assert F(found["largest_step"]) > 0
    assert found["worst_found"]["slip_rate_error"] <= F(found["slip_rate_error"])
    assert check_files([path], "real-fault")[str(path)][0] == "proved"
    code, out, _ = call("real-fault", "--gains", *GAINS, "--rate-limit", "1 kPa/s")
    assert code == 1
    for given in (("--jitter", "100 ms"), ("--jitter", "1 ms", "--diffusion", "1 s"), ("--rate-limit", "0 Pa/s")):
        assert call("real-fault", "--gains", *GAINS, *given)[0] == 2


@pytest.mark.slow
def test_means_count_from_their_middle(call, tmp_path):
    path = tmp_path / "mean.json"
    given = ("real-fault", "--gains", *GAINS, "--averaging-time")
    code, out, _ = call(*given, "2 ms", "--json", "--out", str(path))
    assert (code, json.loads(out)["averaging"]) == (0, "1/500")
    loop = json.loads(path.read_text())["loop"]
    assert (loop["delay"], loop["jitter"]) == ("1/1000", {"measured": "0", "delay": "0", "mean": "1/500"})
    code, _, err = call(*given[:-1], "--averaging-time=-1 ms")
    assert (code, "averaging time must be 0 or more. Received -0.001 s" in err) == (2, True)


def test_a_well_is_told_by_its_distance_and_the_diffusivity_of_the_rock():
    """(40 m)²/(0.5 m²/s) = 3200 s, exactly."""
    assert SetupOptions(well="40", diffusivity="0.5").setup().diffusion == 3200
    assert SetupOptions(diffusion="7").setup().diffusion == 7
    told = DesignOptions(well="1/3", diffusivity="2").arguments()["options"]
    assert (told["setup"].diffusion, DesignOptions().arguments()["options"]["setup"]) == (F(1, 18), LoopSetup())
    behind = DesignOptions(well="40", diffusivity="0.5").problem("real-fault")[1]
    assert behind["names"] == ["elqr"]
    for wrong in ({"well": "40"}, {"diffusivity": "1"}, {"well": "40", "diffusivity": "1", "diffusion": "3"}):
        with pytest.raises(ParameterError, match="needs the distance of the well and the diffusivity"):
            SetupOptions(**wrong).setup()
    for wrong in ({"well": "0", "diffusivity": "1"}, {"well": "40", "diffusivity": "-1"}):
        with pytest.raises(ParameterError, match="must be positive"):
            DesignOptions(**wrong).arguments()


@pytest.mark.slow
def test_samples_by_no_clock_are_in_the_answer_and_in_the_file(call, tmp_path, monkeypatch):
    monkeypatch.setattr(design, "_FEWER", 8)
    path, asked = tmp_path / "loop.json", ("lab-fault", "--step", "1 ms", "--longest-step", "3/2000")
    code, out, _ = call(*asked, "--objective", "peak", "--out", str(path), "--plant", "printed")
    said = " ".join(out.split())
    assert (code, "with zero-order hold over sampling intervals from 0.001 s to 0.0015 s in any order" in said) == (
        0,
        True,
    )
    assert "no controller with zero-order hold over T_s = 0.0015 s keeps the slip-rate error below" in said
    loop = json.loads(path.read_text())["loop"]
    assert (loop["step"], loop["longest"]) == ("1/1000", "3/2000")
    assert check_files([path], "lab-fault")[str(path)][0] == "proved"
    for more in (("--controller", "cta"), ("--delay", "1/2000"), ("--jitter", "1/10000"), ("--rate-limit", "1 MPa/s")):
        code, _, err = call(*asked, *more)
        assert (code, "aperiodic sampling needs a linear law" in err) == (2, True)


@pytest.mark.slow
def test_aperiodic_sampling_is_proved_where_friction_sticks(call, tmp_path):
    path = tmp_path / "loop.json"
    code, out, _ = call("real-fault", "--step", "92 ms", "--longest-step", "184 ms", "--out", str(path), "--json")
    found = json.loads(out)
    assert (code, found["plant"], found["step"], found["longest_step"]) == (0, "stick-slip", "23/250", "23/125")
    assert "over sampling intervals from 0.092 s to 0.184 s in any order" in found["sentence"]
    assert float(F(found["peak_slip_rate"])) < 1.9e-4  # 2.6e-4 is what some other laws reach in floating point
    assert found["worst_found"]["slip_rate"] < float(F(found["peak_slip_rate"]))
    assert found["limit"]["slip_rate"] is not None
    assert check_files([path], "real-fault")[str(path)][0] == "proved"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("step", "more", "most"), [("50 ms", (), 2.5e-4), ("92 ms", ("--objective", "peak"), 1.75e-4)], ids=["wide", "peak"]
)
def test_a_wider_range_and_the_smallest_slip_rate_have_gains_of_their_own(call, step, more, most):
    code, out, _ = call("real-fault", "--step", step, "--longest-step", "184 ms", *more, "--json")
    found = json.loads(out)
    assert (code, found["plant"], found["longest_step"]) == (0, "stick-slip", "23/125")
    assert float(F(found["peak_slip_rate"])) < most


def test_no_law_is_designed_for_intervals_that_no_controller_could_wait_for(call):
    code, out, _ = call("lab-fault", "--step", "1 ms", "--longest-step", "2 s", "--json")
    assert (code, json.loads(out)["verdict"]) == (1, "undecided")
    assert "no controller that withdraws" in json.loads(out)["reason"]


@pytest.mark.slow
def test_a_small_gain_of_any_length_is_an_answer(tmp_path, capsys):
    """A mass that is tiny against its damping: 10^96564, which Python does not write at once."""
    path = tmp_path / "digits.toml"
    path.write_text(TINY_MASS, encoding="utf-8")
    with pytest.raises(SystemExit) as stop:
        main(["guarantee", str(path), "--json"])
    assert stop.value.code == 1
    assert json.loads(capsys.readouterr().out)["verdict"] != "proved"


TINY_MASS = """
name = "tiny-mass"
density = "0.00371319 kg/m^3"
shear_modulus = "23.0998 GPa"
length = "0.000490848 km"
damping = "6.98887e+09 kg/s"
effective_normal_stress = "50 MPa"
uncertainty = "ten-percent"
[friction]
law = "exponential-slip-weakening"
residual = 4.242158124781814e-08
drop = 0.08992276392074365
critical_slip = "276.35 mm"
[task]
target_slip = "27.3375 mm"
operation_time = "132.194 hour"
sampling_time = "168.833 ms"
[disturbance]
amplitude = "0.0215774 m/s^2"
frequency = "0.973285 rad/s"
slip_growth = "1.51141e-06 1/s^2"
"""
