"""The command that says what no controller can do."""

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from quakedesign.cli import main
from quakedesign.fault import fault_toml, load_fault
from quakedesign.guarantees import NoProof
from quakedesign.guarantees.exact.guarantee_files import parse_guarantee
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.sliding_result import SlidingGuarantee
from quakedesign.loop.loop_setup import Pump
from quakedesign.studies import performance_limits as impossible_and_proved

PROOFS = Path(__file__).parents[2] / "proofs" / "certificates"
KEYS = ("peak_slip_rate_error", "largest_step", "largest_delay", "largest_diffusion_time", "farthest_well")


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr("quakedesign.studies.performance_limits.natural_peak", lambda _fault: 0.05)
    monkeypatch.setattr(
        "quakedesign.studies.performance_limits.design_sampled_law",
        lambda *_, **__: NoProof(reason="none"),
    )
    for name in ("longest_step", "longest_delay", "longest_diffusion_time"):
        monkeypatch.setattr(f"quakedesign.studies.performance_limits.{name}", lambda *_, **__: None)


def run(*arguments):
    with pytest.raises(SystemExit) as end:
        main(["limits", *arguments])
    return end.value.code


def test_json_has_both_sides(capsys):
    assert run("lab-fault", "--pressure", "40 kPa", "--diffusivity", "1e-2", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert {"impossible_beyond", "proved_up_to"} <= set.intersection(*(set(found[key]) for key in KEYS))
    assert found["withdrawal"] == 40000
    well, time = (float(found[key]["impossible_beyond"]) for key in ("farthest_well", "largest_diffusion_time"))
    assert well == pytest.approx((1e-2 * time) ** 0.5, rel=1e-5)
    assert found["farthest_well"]["proved_up_to"] is None


def test_a_step_takes_the_place_of_the_sampling_time(capsys):
    """A longer T_s takes as much from the longest delay, which is the reaction time less T_s."""
    found = {}
    for step in ("5 ms", "1/250"):
        assert run("lab-fault", "--step", step, "--json") == 0
        found[step] = json.loads(capsys.readouterr().out)
    delays = [Fraction(one["largest_delay"]["impossible_beyond"]) for one in found.values()]
    assert [one["step"] for one in found.values()] == [0.005, 0.004]
    assert float(delays[1] - delays[0]) == pytest.approx(0.001, rel=1e-3)


def test_a_folder_with_a_figure(tmp_path, capsys):
    folder = tmp_path / "limits"
    assert run("lab-fault", "--out", str(folder), "--format", "pdf", "png") == 0
    assert {path.name for path in folder.iterdir()} == {"limits.pdf", "limits.png", "results.json"}
    assert "written" in capsys.readouterr().out
    assert run("lab-fault", "--out", str(folder)) == 2
    assert "must be new" in capsys.readouterr().err


@pytest.mark.parametrize("given", [("--pressure", "-1 MPa"), ("--diffusivity", "0"), ("--pressure", "1 m")])
def test_nonsense_is_refused_in_one_line(given, capsys):
    assert run("lab-fault", *given) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_disturbance_may_be_a_shear_stress(capsys):
    """10 Pa on 1385 kg/m³ times 10 cm."""
    assert run("lab-fault", "--disturbance", "10 Pa", "--json") == 0
    assert json.loads(capsys.readouterr().out)["disturbance"] == pytest.approx(10 / 138.5, rel=1e-15)
    assert run("lab-fault", "--disturbance", "10 kPaa") == 2
    assert capsys.readouterr().err.endswith("whose unit is unknown. Did you mean kPa?\n")
    assert run("crustal-patch", "--disturbance", "10 kPa") == 2
    assert "Give --stress" in capsys.readouterr().err


def test_limits_of_slow_sliding_are_said_to_be_those_of_the_linearised_fault(capsys, monkeypatch, tmp_path):
    known = parse_guarantee((PROOFS / "sliding_crustal-patch.json").read_text())
    answer = SlidingGuarantee(proof=known, task=known.task, sampled_loop=known.sampled_loop)
    monkeypatch.setattr(impossible_and_proved, "guarantee_sliding", lambda fault, **asked: answer)
    assert run("crustal-patch", "--out", str(tmp_path / "limits")) == 0
    said = capsys.readouterr().out
    assert said.splitlines()[1] == "(any shear stress of at most 25 kPa, T_s = 300 s)"
    said = " ".join(said.split())
    behind = "behind a diffusion path of L^2/D = 833 s, for the given a"
    assert f"bounds of an e-LQR that was designed for this table {behind}" in said
    assert "another design has other bounds" in said
    ranges = {
        name: (Fraction(95, 100) * low, Fraction(105, 100) * high) for name, (low, high) in known.task.ranges.items()
    }
    wide = replace(known, task=replace(known.task, ranges=ranges))
    monkeypatch.setattr(impossible_and_proved, "guarantee_sliding", lambda fault, **_: replace(answer, proof=wide))
    assert run("crustal-patch") == 0
    assert "for a, b and D_c with relative spreads of 0.05, on" in " ".join(capsys.readouterr().out.split())
    assert "linearised about slow sliding" in said
    found = json.loads((tmp_path / "limits" / "results.json").read_text())
    assert found["stress"] == 25000.0
    assert "linearised" in found["farthest_well"]["holds_for"]
    for name in ("peak_slip_rate_error", "smallest_pressure"):
        assert float(found[name]["impossible_beyond"]) < float(found[name]["proved_up_to"])
    assert float(found["largest_diffusion_time"]["proved_up_to"]) == 833


@pytest.mark.parametrize(
    ("half_width", "said"), [(Fraction(2, 30), "0.0666"), (Fraction(1, 20), "0.05"), (Fraction(99999, 10**6), "0.0999")]
)
def test_a_covered_spread_is_rounded_inward(half_width, said, capsys, monkeypatch):
    """A proof within 0.0666… covers 0.0666, not 0.0667."""
    known = parse_guarantee((PROOFS / "sliding_crustal-patch.json").read_text())
    ranges = {name: ((1 - half_width) * low, (1 + half_width) * low) for name, (low, _) in known.task.ranges.items()}
    wide = replace(known, task=replace(known.task, ranges=ranges))
    answer = SlidingGuarantee(proof=wide, task=wide.task, sampled_loop=wide.sampled_loop)
    monkeypatch.setattr(impossible_and_proved, "guarantee_sliding", lambda fault, **_: answer)
    assert run("crustal-patch") == 0
    assert f"for a, b and D_c with relative spreads of {said}, on" in " ".join(capsys.readouterr().out.split())


def test_noise_forbids_more(capsys):
    found = []
    for noise in ((), ("--measured", "slip", "--slip-noise", "1 um")):
        assert run("lab-fault", "--json", *noise) == 0
        found.append(json.loads(capsys.readouterr().out))
    assert (found[1]["measured"], found[1]["slip_noise"]) == ("slip", "1/1000000")
    errors = [float(one["peak_slip_rate_error"]["impossible_beyond"]) for one in found]
    assert errors[1] > 4 * errors[0]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("crustal-patch", "--slip-noise", "1 um"), "no performance limit of slow sliding with noise is known"),
        (("crustal-patch", "--stress", "0 Pa"), "stress must be positive"),
        (("real-fault", "--stress", "1 kPa"), "stress needs friction with a state"),
    ],
)
def test_a_stress_or_noise_that_does_not_apply_is_refused(given, said, capsys):
    assert run(*given) == 2
    assert said in capsys.readouterr().err


def test_where_no_design_stands_a_stress_the_reason_is_told(capsys, monkeypatch):
    """A sampling time that suits no law would else look like a missing option."""
    none = NoProof(reason="T_s near 0.51 s suits")
    answer = SlidingGuarantee(proof=none, task=None, sampled_loop=None)
    monkeypatch.setattr(impossible_and_proved, "guarantee_sliding", lambda fault, **asked: answer)
    assert run("crustal-patch") == 2
    assert "no design was found that withstands any: T_s near 0.51 s suits. Give --stress" in capsys.readouterr().err


def test_without_a_real_growing_pole_it_is_not_said_that_nothing_grows(capsys, monkeypatch, tmp_path):
    """Softer than steady sliding needs, but the error swings while it grows."""
    file = tmp_path / "swings.toml"
    patch = load_fault("double-direct-shear")
    file.write_text(fault_toml(patch))
    known = parse_guarantee((PROOFS / "sliding_crustal-patch.json").read_text())
    answer = SlidingGuarantee(proof=known, task=known.task, sampled_loop=known.sampled_loop)
    monkeypatch.setattr(impossible_and_proved, "guarantee_sliding", lambda fault, **asked: answer)
    assert run(str(file)) == 0
    assert "errors of this fault oscillate while they grow, or do not grow" in " ".join(capsys.readouterr().out.split())


def test_both_sides_are_of_the_stress_that_the_design_behind_the_well_stands(monkeypatch, capsys):
    """A design behind a farther well stands less than that near the fault; where there is none, nothing is proved."""
    near = parse_guarantee((PROOFS / "sliding_crustal-patch.json").read_text())
    known = {Fraction(800): near, Fraction(900): replace(near, task=replace(near.task, stress=near.task.stress / 2))}

    def answered(fault, *, setup, **asked):
        found = known.get(setup.diffusion, NoProof(reason="too far"))
        return SlidingGuarantee(proof=found, task=near.task, sampled_loop=None)

    monkeypatch.setattr(impossible_and_proved, "guarantee_sliding", answered)
    sides = {}
    for diffusion in ("800 s", "900 s", "1000 s"):
        assert run("crustal-patch", "--diffusion", diffusion, "--json") == 0
        sides[diffusion] = json.loads(capsys.readouterr().out)
    full, half, none = sides.values()
    assert half["stress"] == full["stress"] / 2 == none["stress"] / 2 == float(near.task.stress) / 2
    rates = [float(one["peak_slip_rate_error"]["impossible_beyond"]) for one in (full, half)]
    assert rates[1] == pytest.approx(rates[0] / 2, rel=1e-3)  # of the linearised fault
    assert none["peak_slip_rate_error"]["proved_up_to"] is None
    assert run("crustal-patch", "--diffusion", "1000 s") == 0
    assert "proved: no design" in capsys.readouterr().out


def test_designs_of_slow_sliding_are_proved_behind_the_lag_and_the_well_that_are_told(monkeypatch, capsys):
    """(40 m)²/(2 m²/s) = 800 s."""
    known, asked = parse_guarantee((PROOFS / "sliding_crustal-patch.json").read_text()), []
    spreads = []

    def answered(fault, *, stress, spread, setup):
        asked.append(setup)
        spreads.append(spread)
        return SlidingGuarantee(proof=known, task=known.task, sampled_loop=known.sampled_loop)

    monkeypatch.setattr(impossible_and_proved, "guarantee_sliding", answered)
    patch = ("crustal-patch", "--stress", "25 kPa")
    assert run(*patch, "--well", "40 m", "--diffusivity", "2 m^2/s", "--lag", "5 s") == 0
    told = " ".join(capsys.readouterr().out.split())
    assert (
        f"behind a diffusion path of L^2/D = {float(known.sampled_loop.diffusion):.4g} s, for the given a, b and D_c"
        in told
    )
    assert "D = 2 m^2/s" in told
    assert run(*patch, "--diffusion", "9 s") == run(*patch, "--diffusivity", "2") == 0
    near = ExactSetup(diffusion=asked[0].diffusion)
    assert near.diffusion == pytest.approx(800)  # D_c/(10 V)
    ours = [ExactSetup(lag=Fraction(5), diffusion=Fraction(800)), ExactSetup(diffusion=Fraction(9))]
    assert asked == [near, ours[0], near, ours[1], near]
    assert "L^2/D = 9 s: not shown to be infeasible" in " ".join(capsys.readouterr().out.split())
    asked.clear()
    assert run(*patch, "--well", "100 km") == 0
    assert asked == [near]  # no design is looked for behind what is impossible
    told = " ".join(capsys.readouterr().out.split())
    assert "L^2/D = 1e+10 s: INFEASIBLE for every controller" in told
    assert (
        f"behind a diffusion path of L^2/D = {float(known.sampled_loop.diffusion):.4g} s, for the given a, b and D_c"
        in told
    )
    assert set(spreads) == {0}
    assert run(*patch, "--diffusion", "9 s", "--spread", "0.01") == 0
    assert spreads[-2:] == [Fraction(1, 100)] * 2
    assert run("lab-fault", "--spread", "0.01") == 2
    assert "a spread needs friction with a state" in capsys.readouterr().err
    for others in (("--well", "40 m", "--diffusion", "9 s"), ("--well", "0 m")):
        assert run(*patch, *others) == 2
    assert run(*patch, "--delay", "1 s") == 2
    errors = capsys.readouterr().err.splitlines()
    assert ["the diffusion path needs the distance of the well" in errors[0], "must be positive" in errors[1]] == [
        True,
        True,
    ]
    assert errors[2].endswith("limits of slow sliding take lag and diffusion only. Received delay. Omit these.")


def test_designs_are_proved_with_the_whole_setup(monkeypatch, capsys):
    """A well of 2 m at 0.5 m²/s is L²/D = 8 s; a mean over 0.02 s comes 0.01 s later."""
    told = {}
    for name in ("design_sampled_law", "longest_step"):
        none = NoProof(reason="none") if name == "design_sampled_law" else None
        monkeypatch.setattr(
            f"quakedesign.studies.performance_limits.{name}",
            lambda *_, n=name, a=none, **around: told.__setitem__(n, around) or a,
        )
    setup = ("--delay", "20 ms", "--lag", "0.3 s", "--well", "2 m", "--diffusivity", "0.5", "--jitter", "1 ms")
    noise = ("--measured", "slip", "--slip-noise", "5 um", "--averaging-time", "20 ms", "--rate-limit", "2 MPa/s")
    assert run("real-fault", *setup, *noise, "--json") == 0
    path = {name: Fraction(value) for name, value in (("delay", "0.03"), ("lag", "0.3"), ("diffusion", "8"))}
    times = {"jitter": Fraction(1, 1000), "averaging": Fraction(1, 50), "pump": Pump(rate=Fraction(2 * 10**6))}
    wanted = {"measured": "slip", "setup": ExactSetup(**path, **times, slip_noise=Fraction(5, 10**6))}
    assert told == {"design_sampled_law": wanted | {"objective": "peak"}, "longest_step": wanted}
    assert run("lab-fault", "--jitter", "-1 s") == run("lab-fault", "--well", "0 m") == 2
    assert capsys.readouterr().err.count("\n") == 2
