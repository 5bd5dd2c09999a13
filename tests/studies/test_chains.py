"""Limits of several blocks beside closed forms and a run of a mode, and the commands that take such a file."""

import json
import re
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import quakedesign as qd
from quakedesign.cli import main
from quakedesign.errors import CertificateError, ParameterError
from quakedesign.exact import UpperBound
from quakedesign.guarantees import NoProof, PlantGuarantee
from quakedesign.guarantees.exact.guarantee_files import load_guarantee
from quakedesign.guarantees.exact.plant_loop import MatrixLaw
from quakedesign.guarantees.exact.plant_proof import PlantClaims, PlantProof
from quakedesign.guarantees.exact.sliding_blocks import BlockClaims, SlidingBlocks
from quakedesign.guarantees.search.plant_search import linear_part
from quakedesign.guarantees.search.sliding_block_design import covered_stress
from quakedesign.lyapunov.exact.claim import Verdict
from quakedesign.simulation.coupled_sliders import BlockEvent
from quakedesign.simulation.earthquake import natural_peak
from quakedesign.studies import several_blocks as chains

PATH = Path(__file__).parents[1] / "data" / "three_blocks.toml"
CHAIN = qd.load_chain(PATH)
SLIDING = PATH.with_name("three_sliding_blocks.toml")
CERTIFICATES = Path(__file__).parents[2] / "proofs" / "certificates"
TWO_BLOCKS, ONE_BLOCK = (
    CERTIFICATES / f"{n}.json" for n in ("uncertain_plant_real-fault-2-blocks", "sliding_crustal-patch")
)


def run(*arguments):
    with pytest.raises(SystemExit) as stop:
        main([*map(str, arguments)])
    return stop.value.code


def test_friction_of_a_user_is_allowed_by_the_option_that_its_refusal_names(tmp_path, capsys):
    path, law = tmp_path / "blocks.toml", "tests.data.own_parts:Hyperbolic"
    path.write_text(PATH.read_text().replace('law = "linear-slip-weakening"', f'law = "{law}"'))
    assert run("fault", path) == 2
    assert "block 3: friction law in a file" in capsys.readouterr().err.replace("\n", " ")
    assert run("fault", path, "--allow-code") == 0
    assert "3 blocks" in capsys.readouterr().out


def test_a_design_beyond_floating_point_is_refused(tmp_path, capsys):
    path = tmp_path / "blocks.toml"
    path.write_text(PATH.read_text().replace('critical_slip = "300 mm"', 'critical_slip = "1 nm"'))
    assert run("guarantee", path) == 2
    assert "Shorten the step, or check units" in " ".join(capsys.readouterr().err.split())


def test_what_is_printed_of_a_proof_and_a_run_names_plant_and_units(tmp_path, capsys, monkeypatch):
    class Proved:
        """Stands for a proof, whose search takes seconds."""

        available, notes = True, ("a note",)
        part = SimpleNamespace(disturbances=[((), F(1))] * 2 + [((), F(1, 10**7))] * 2)  # forces, balances
        law = MatrixLaw(
            step=F(23, 125),
            delay=F(0),
            update=(),
            measured=(),
            output=((),) * 3,
            feedback=tuple((*(F(0),) * 6,) for _ in range(3)),
        )
        claims = PlantClaims(
            outputs=tuple(UpperBound(F(i, 10**5)) for i in range(1, 7)), controls=(UpperBound(10),) * 3
        )

        def statement(self):
            return [f"proved: {self.sentence()}"]

        def sentence(self):
            return "a sentence"

        def to_dict(self):
            return {"notes": list(self.notes)}

    for place in ("synthesis", "studies.several_blocks"):
        monkeypatch.setattr(f"quakedesign.{place}.guarantee", lambda *_, **__: SimpleNamespace(proof=Proved()))
    assert run("guarantee", PATH) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert (
        "'load of a pressure' in the statement: the well pressure that keeps the blocks in balance on the reference"
        in told
    )
    assert "equilibrium of each block" not in told
    first = "With the centralised law the slip rate of no block exceeds 62.3 µm/s (0.078 % of the natural earthquake's"
    assert first in told  # 60 µm/s of error and 15/8 of 785 mm in 663012 s
    assert "slip of each stays within 30 µm of the reference" in told
    assert "block 1 42.3 – 10 –" in told
    alone = PATH.read_text().split("[[block]]")[0] + '[[block]]\nlength = "2.5 km"\n' * 2
    (tmp_path / "blocks.toml").write_text(alone + '[[well]]\nposition = "1 km"\n')
    assert run("guarantee", tmp_path / "blocks.toml") == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "slip errors are relative to the equilibrium of each block under these pressures" in told
    assert re.search(r"within 0\.\d+ m of the reference at every time", told)
    assert re.search(r"of its equilibrium, which lies within 35\.\d mm of the reference", told)
    assert "proved -" not in told
    assert run("guarantee", PATH, "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert [float(F(v)) for v in facts["slip_rates"]] == pytest.approx([4.22e-5, 5.22e-5, 6.22e-5], rel=1e-3)
    assert len(facts["pressures"]) == 3
    assert facts["natural_peak_slip_rate"] == pytest.approx(0.0806, rel=1e-3)
    notes = facts["notes"]
    assert notes[0] == "a note"
    assert notes[1].startswith("'load of a pressure' in the statement")
    healed = tmp_path / "healed.toml"
    healed.write_text(PATH.read_text().replace("drop = 0.1", "drop = 0.1\nhealing = 0.02"))
    assert run("guarantee", healed) == 0
    assert "not covered: friction at rest up to 0.02 above" in " ".join(capsys.readouterr().out.split())
    assert run("simulate", healed, "--duration", "2 s") == 2
    assert "does not support healing" in " ".join(capsys.readouterr().err.split())
    assert run("simulate", PATH, "--duration", "2 s") == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "run: 1.84 s on the stick-slip plant, where errors and pressures may exceed bounds" in told
    assert re.search(r"well 3 proved -[\d.]+ MPa to [\d.]+ MPa, run 0 Pa to 0 Pa", told)


def test_equal_blocks_slip_as_one_block_does_without_control():
    one = qd.load_fault("real-fault")
    chain = replace(CHAIN, blocks=(replace(CHAIN.blocks[0], length=2500.0),) * 2, wells=(1000.0,))
    assert chains.natural_peak(chain) == pytest.approx(natural_peak(one), rel=1e-4)
    stiff = replace(chain, fault=replace(chain.fault, shear_modulus=3e12))
    assert chains.natural_peak(stiff) is None
    healed = replace(chain.blocks[0], friction=replace(chain.blocks[0].friction, healing=0.01))
    assert chains.natural_peak(replace(chain, blocks=(healed, healed))) is None


def test_a_fault_that_is_unstable_in_its_box_alone_has_no_earthquake():
    """Friction weakens by 1.447 1/s², in the box by up to 1.6; a stiffness of 1.5 1/s² holds the fault as it is."""
    one = (replace(CHAIN.blocks[0], length=2500.0),) * 2
    chain = replace(CHAIN, blocks=one, wells=(1000.0,), fault=CHAIN.fault.with_box("ten-percent"))
    stiff = replace(chain, fault=replace(chain.fault, shear_modulus=1.5 / 0.48 * chain.fault.shear_modulus))
    assert chains._growth(stiff) > 0
    assert chains.natural_peak(stiff) is None
    assert chains.natural_peak(qd.load_chain(SLIDING)) is None


def test_modes_that_floating_point_does_not_tell_apart_leave_the_stability_unknown(monkeypatch):
    def unknown(_):
        raise ParameterError("modes are too close")

    monkeypatch.setattr(chains, "chain_limits", unknown)
    chain = replace(CHAIN, wells=(900.0, 2500.0, 4000.0))  # not in the cache
    assert any("stability unknown" in line for line in chains.chain_lines(chain))
    facts = chains.chain_dict(chain)
    assert (facts["growth_rate"], facts["natural_peak_slip_rate"]) == (None, None)


def test_pressures_themselves_are_those_of_equilibrium_and_what_is_proved_beside_them():
    """Friction falls to its least after one critical slip, or stays at its largest over the whole task."""
    chain = replace(CHAIN, blocks=(replace(CHAIN.blocks[0], length=2500.0),) * 2, wells=(1250.0, 3750.0))
    claims = PlantClaims(outputs=(UpperBound(1),) * 4, controls=(UpperBound(1000), UpperBound(2000)))
    found = SimpleNamespace(claims=claims, available=True)
    pressures = np.array([[0.0, -14.1e6], [1e6, -14.2e6], [2e6, 14.1e6]])
    seen = {"slip_rate": np.zeros((3, 2)), "slip_error": np.zeros(2), "rest": np.ones(2), "times": [7.0]}
    run = SimpleNamespace(pressure=pressures, reversed=False, opened=True, **seen)
    one = chains.ChainRun(chain=chain, controller="centralised", proof=found, run=run)
    unloading, strength = 30e9 / 5000, 0.3353 * 50e6  # per slip, at first [Pa/m], [Pa]
    least = 50e6 - (strength - unloading * 0.27635) / 0.2353
    largest = 50e6 - (strength - unloading * 0.785) / 0.3353
    for (low, high), error in zip(one.proved_pressures, (1000, 2000), strict=True):
        assert [float(low), float(high)] == pytest.approx([least - error, largest + error], abs=100)
    apart = replace(one, chain=replace(chain, wells=(1000.0, 4000.0)))  # a block has 11/12 of its well's pressure
    low, high = apart.proved_pressures[0]
    expected = [1.1 * least - 0.1 * largest - 1000, 1.1 * largest - 0.1 * least + 1000]
    assert [float(low), float(high)] == pytest.approx(expected, abs=100)
    assert replace(apart, chain=replace(chain, diffusivity=1e6)).proved_pressures is None
    assert not any("about a block's equilibrium" in line for line in one.lines())
    alone = SimpleNamespace(**{**vars(run), "pressure": pressures[:, :1]})
    lone = replace(one, chain=replace(chain, wells=(1250.0,)), run=alone).lines()
    assert "slip error: relative to equilibrium in the proof, to the reference in the run" in lone
    assert [line for line in lone if line.startswith("well")] == ["well 1    run 0 Pa to 2 MPa"]
    told = one.lines()
    assert [line.endswith("(OUTSIDE)") for line in told if line.startswith("well")] == [False, True]
    assert "as pressures do here" in " ".join(told)
    assert told[-1] == "a block opens: the run is outside the model"
    assert max(map(len, told)) <= 80


def test_a_duration_out_of_range_is_refused_before_the_search(tmp_path, capsys):
    for duration in ("1 ms", "1e30 s", "nan s"):
        assert run("simulate", PATH, "--duration", duration, "--out", tmp_path / "run") == 2
        said = " ".join(capsys.readouterr().err.split())
        assert "substeps" not in said
        assert "duration" in said
    assert not list(tmp_path.iterdir())


def test_commands_take_the_file(capsys):
    assert run("fault", PATH) == 0
    assert "0, 0.857, 0.143" in capsys.readouterr().out
    assert run("fault", PATH, "--json") == 0
    assert json.loads(capsys.readouterr().out)["shares"][2] == [0, 0, 1]
    assert run("limits", PATH, "--json") == 0
    assert json.loads(capsys.readouterr().out)["feasible"] is True


@pytest.mark.slow
def test_a_law_is_designed_proved_run_and_drawn(tmp_path, capsys):
    file, out = tmp_path / "proved.json", tmp_path / "run"
    assert run("guarantee", PATH, "--out", file) == 0
    assert "|slip-rate error 3| <=" in capsys.readouterr().out.replace("\n", " ")
    assert run("check", file) == 0
    assert run("simulate", PATH, "--duration", "1 hour", "--out", out) == 0
    told = capsys.readouterr().out
    assert "bounds, which are proved for the plant without stick" in " ".join(told.split())
    assert (out / "blocks.png").stat().st_size > 20_000
    facts = json.loads((out / "results.json").read_text())
    assert facts["guarantee"]["verdict"] == "proved"
    assert len(facts["run"]["max_slip_error"]) == 3


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("guarantee", PATH, "--delay", "20 ms"), "Received --delay. Omit these options."),
        (("guarantee", PATH, PATH), "takes one fault of several blocks at a time. Received more faults"),
        (("guarantee", PATH, "--delay", "20 ms"), "among --box, --controller, --force, --json, --lag, --out"),
        (("limits", PATH, "--measured", "slip"), "Received --measured"),
        (("limits", PATH, "--pressure", "1 MPa"), "diffusivity of limits of several blocks need friction with a state"),
        (("limits", PATH, "--stress", "1 kPa"), "diffusivity of limits of several blocks need friction with a state"),
        (("limits", PATH, "--diffusivity", "2"), "diffusivity of limits of several blocks need friction with a state"),
        (("limits", SLIDING, "--stress", "0 Pa"), "stress must be positive"),
        (("simulate", PATH, "--controller", "cta"), "must be one of centralised, decentralised. Received 'cta'"),
        (("design", PATH, "--controller", "decentralized"), "Did you mean decentralised?"),
        (("compare", PATH, "--objective", "peak"), "Received --objective"),
        (("export", PATH, "--scheme", "implicit"), "--certificate, --controller, --fmu, --force, --json, --out"),
        (
            ("export", PATH, "--controller", "decentralised", "--certificate", SLIDING.with_suffix(".json")),
            "Omit --con",
        ),
        (("export", SLIDING), "takes the law of a certificate. Received none. Use guarantee with --lag, --stress and"),
        (("design", PATH, "--stress", "1 kPa"), "--lag and --stress of several blocks need friction with a state"),
        (("compare", PATH, "--lag", "1 s"), "--lag and --stress of several blocks need friction with a state"),
        (("simulate", PATH, "--drift", "1 nm/s"), "--plant, --drift and --stress of several blocks need friction with"),
        (("simulate", PATH, "--stress", "1 kPa"), "--plant, --drift and --stress of several blocks need friction with"),
        (("simulate", SLIDING, "--stress", "1 kPa"), "stress on blocks needs a law"),
        (("simulate", SLIDING, "--start", "late"), "do not apply to several blocks. Received --start"),
        (("simulate", SLIDING, "--controller", "centralised"), "run under the law of a certificate"),
        (("simulate", SLIDING, "--plant", "printed"), "must be one of smooth, quasi-dynamic"),
        (("simulate", SLIDING, "--certificate", TWO_BLOCKS), "about these blocks in slow sliding"),
        (("simulate", SLIDING, "--certificate", ONE_BLOCK), "must be about several blocks"),
        (
            ("simulate", SLIDING, "--certificate", SLIDING.with_suffix(".json"), "--drift", "1 nm/s"),
            "the far end of the springs is fixed in slow sliding",
        ),
        (("simulate", PATH, "--certificate", TWO_BLOCKS), "must be about three-blocks, 3 blocks, 3 wells"),
        (("export", PATH, "--certificate", ONE_BLOCK), "must be about three-blocks, 3 blocks, 3 wells"),
        (("derive", PATH), "Use the commands fault, design, guarantee, compare, simulate, export or limits"),
    ],
)
def test_what_does_not_take_it_says_so_in_one_line(arguments, said, capsys):
    assert run(*arguments) == 2
    error = capsys.readouterr().err
    assert said in " ".join(error.split())


def test_wells_that_act_alike_are_refused_with_a_remedy(tmp_path, capsys):
    path = tmp_path / "blocks.toml"
    path.write_text(PATH.read_text().replace('"2.5 km"', '"0.9 km"').replace('"1 km"', '"0.5 km"'))
    assert run("guarantee", path) == 2
    assert "Move or omit wells" in " ".join(capsys.readouterr().err.split())


@pytest.mark.slow
def test_laws_are_compared_side_by_side(tmp_path, capsys):
    path = tmp_path / "blocks.toml"
    text = PATH.read_text().replace('[[well]]\nposition = "2.5 km"\n', "")
    path.write_text(text.replace('"184.17 hour"', '"1 hour"').replace('"785 mm"', '"1 mm"'))
    assert run("compare", path) == 0
    told = capsys.readouterr().out.splitlines()
    assert max(map(len, told)) <= 80
    rows = {line.split()[0]: line for line in told if line.startswith(("centralised", "decentralised"))}
    assert len(rows) == 2
    assert run("compare", path, "--controller", "decentralised", "--json") == 0
    (one,) = json.loads(capsys.readouterr().out).values()
    proved = max(F(v) for name, v in one["guarantee"]["peaks"].items() if name.startswith("slip-rate"))
    assert proved > max(one["run"]["max_slip_rate_error"])
    shown = float(re.search(r"([0-9.]+) µm/s", rows["decentralised"])[1])
    assert proved * 10**6 <= F(str(shown)) <= proved * F(101, 100) * 10**6


# ----------------------------------------------------------------------
# Laws of certificates: which plant they are about, and runs of them.


def law_that_is_proved(chain=CHAIN):
    """A guarantee without a search: weak feedback of the slip error, proved of nothing until it is checked."""
    one = F(-(10**9))
    law = MatrixLaw(
        step=F("0.184"),
        delay=F(0),
        update=(),
        measured=(),
        output=((),) * 3,
        feedback=tuple(tuple(one * (i == j) for j in range(6)) for i in range(3)),
    )
    plant = qd.UncertainPlant.from_blocks(chain)
    part = linear_part(plant, {})
    claims = PlantClaims(outputs=(UpperBound(1),) * 6, controls=(UpperBound(1),) * 3)
    return PlantProof(part=part, law=law, pieces=8, inputs=(F(0),) * len(part.sectors), claims=claims)


def test_a_certificate_that_does_not_hold_or_is_of_other_blocks_gives_no_law(tmp_path, monkeypatch):
    claim, path = law_that_is_proved(), tmp_path / "claimed.json"
    monkeypatch.setattr(chains, "load_guarantee", lambda _: claim)
    with pytest.raises(CertificateError, match="must be valid"):
        chains.chain_law(CHAIN, certificate=path)
    monkeypatch.setattr(PlantProof, "check", lambda _: Verdict.PROVED)
    found = chains.chain_law(CHAIN, certificate=path)
    assert found.law == claim.law
    assert "|slip-rate error 2| <= 1 m/s" in found.sentence()
    with pytest.raises(CertificateError, match="about another plant"):
        chains.chain_law(replace(CHAIN, wells=(1000.0, 2500.0, 4000.0)), certificate=path)
    late = replace(claim, law=replace(claim.law, delay=F(1, 100)))
    monkeypatch.setattr(chains, "load_guarantee", lambda _: late)
    with pytest.raises(CertificateError, match="must have no delay"):
        chains.chain_law(CHAIN, certificate=path)


def test_a_guarantee_of_slow_sliding_tells_its_lag_and_the_stress_that_it_covers():
    """Proved for 10 kPa; what inertia adds to the stress is below a pascal."""
    chain, claim = qd.load_chain(SLIDING), load_guarantee(SLIDING.with_suffix(".json"))
    lag, stress, rate, found = covered_stress(chain, claim)
    assert lag == 800
    assert "|slip error 1| <= 34.84 µm" in found.sentence()
    assert "under any shear stress of at most 10 kPa" in found.notes[0]
    assert 0.07 < rate < 0.0739  # of the proof, with larger claims: 0.0738
    assert 10_000 <= stress < 10_001
    smaller = tuple((entry, size / 2) for entry, size in claim.part.disturbances)
    _, half, *_ = covered_stress(chain, replace(claim, part=replace(claim.part, disturbances=smaller)))
    assert float(half) == pytest.approx(5000, abs=1)
    friction = replace(chain.blocks[0].friction, evolution_effect=0.02)
    others = (
        replace(chain, blocks=tuple(replace(block, friction=friction) for block in chain.blocks)),
        replace(chain, fault=replace(chain.fault, shear_modulus=32.05e9)),
    )
    for other in others:
        with pytest.raises(CertificateError, match="about these blocks"):
            covered_stress(other, claim)
    for place in (0, 2):  # a sector that is narrower than that of the blocks
        sector = claim.part.sectors[place]
        low, high = sector.slopes
        narrow = replace(sector, slopes=(low + (high - low) / 5, high))
        sectors = (*claim.part.sectors[:place], narrow, *claim.part.sectors[place + 1 :])
        with pytest.raises(CertificateError):
            covered_stress(chain, replace(claim, part=replace(claim.part, sectors=sectors)))


@pytest.mark.parametrize("own", [0, 1])
def test_a_certificate_whose_pressures_have_no_lag_is_about_other_blocks(own):
    chain, claim = qd.load_chain(SLIDING), load_guarantee(SLIDING.with_suffix(".json"))
    A = [list(row) for row in claim.part.A]
    A[6][6] = F(own)
    with pytest.raises(CertificateError, match="about these blocks"):
        covered_stress(chain, replace(claim, part=replace(claim.part, A=tuple(map(tuple, A)))))


def test_inertia_counts_in_the_stress_that_a_guarantee_covers():
    """Of a rock a thousand times as dense, whose inertia takes some 30 Pa of what the disturbances allow."""
    chain, claim = qd.load_chain(SLIDING), load_guarantee(SLIDING.with_suffix(".json"))
    dense = replace(chain, fault=replace(chain.fault, density=2670e3))
    claims = BlockClaims(log_state=F("0.02"), pull=F(30_000), push=F(200_000))
    plant = SlidingBlocks(chain=dense, lag=F(800), stress=F(10_000)).plant(claims)
    part, controls = linear_part(plant, {}), (UpperBound(F("0.1999")),) * 3
    found = replace(claim, part=part, claims=replace(claim.claims, controls=controls))
    (size, slope) = part.disturbances[0][1], part.sectors[1].slopes[1]
    assert size / slope * 10**6 > 10_020
    assert covered_stress(dense, found)[1] == pytest.approx(10_000, abs=1)


@pytest.mark.parametrize("happened", [(), ("reversed",), ("opened",), ("reversed", "opened")])
def test_a_run_outside_its_model_is_not_safe(happened):
    run = SimpleNamespace(**{name: name in happened for name in ("reversed", "opened")})
    assert chains.ChainRun(chain=CHAIN, controller="", proof=None, run=run).safe is (happened == ())


@pytest.mark.slow
def test_a_run_of_slow_sliding_says_whether_it_stays_within_what_is_proved(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(PlantProof, "check", lambda _: Verdict.PROVED)  # takes 17 s; decided in the slow tests
    certificate = SLIDING.with_suffix(".json")
    assert (
        run("simulate", SLIDING, "--certificate", certificate, "--duration", "2 hours", "--out", tmp_path / "run") == 0
    )
    told = " ".join(capsys.readouterr().out.split())
    assert "proved for up to 10 kPa, a lag of 800 s, with |ln(v/V)| <= 0.07" in told
    assert "within the proved bounds of slips, rates, states and pressures" in told
    facts = json.loads((tmp_path / "run" / "results.json").read_text())["run"]
    assert facts["within"] is True
    assert facts["stress"] == pytest.approx(10_000, rel=1e-4)
    assert (tmp_path / "run" / "blocks.png").stat().st_size > 20_000
    chain = qd.load_chain(SLIDING)
    strong = chains.run_sliding_chain(chain, certificate=certificate, stress=2e5, duration=2e4, inertia=True)
    assert not strong.within
    assert "OUTSIDE what is proved" in strong.lines()[-1]
    assert strong.to_dict()["plant"] == "smooth"


@pytest.mark.slow
def test_cycles_without_control_are_told(capsys, tmp_path):
    assert run("simulate", SLIDING, "--duration", "1 year", "--drift", "1 nm/s", "--out", tmp_path / "run") == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "under remote loading at 1 nm/s: 1 event in 3.156e+07 s" in told
    assert "recurrence" not in told
    facts = json.loads((tmp_path / "run" / "results.json").read_text())["run"]
    (event,) = facts["slip_events"]
    assert event["magnitude"] == pytest.approx(2 / 3 * np.log10(32.04e9 * 5e3 * 15e3 * sum(event["slip"])) - 6.07)
    assert facts["recurrence_interval"] is None
    assert (tmp_path / "run" / "blocks.png").stat().st_size > 20_000


@pytest.mark.slow
def test_a_proved_law_of_slow_sliding_runs_within_its_claims_which_are_decided_anew(capsys):
    assert run("simulate", SLIDING, "--certificate", SLIDING.with_suffix(".json"), "--duration", "2 day", "--json") == 0
    facts = json.loads(capsys.readouterr().out)["run"]
    assert facts["within"] is True
    assert max(facts["max_log_rate"]) > 0.005


@pytest.mark.slow
def test_the_law_of_a_certificate_is_exported_and_run(capsys, tmp_path):
    proof, out = tmp_path / "proved.json", tmp_path / "c"
    assert run("guarantee", PATH, "--out", proof) == 0
    capsys.readouterr()
    assert run("export", PATH, "--certificate", proof, "--out", out, "--fmu") == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "|slip-rate error 3| <=" in told
    assert "µm/s" in told
    header = (out / "controller.h").read_text(encoding="utf-8")
    assert "#define CONTROLLER_PRESSURES 3" in header
    assert "for all friction and constants of box paper" in " ".join(
        header.replace("*", "").split("for all t")[0].split()
    )
    assert run("simulate", PATH, "--certificate", proof, "--duration", "1 min") == 0
    assert run("simulate", PATH, "--duration", "1 min", "--json") == 0


@pytest.mark.slow
def test_nothing_is_exported_where_nothing_is_proved(capsys, tmp_path):
    path = tmp_path / "blocks.toml"
    path.write_text(PATH.read_text().replace('"184 ms"', '"20 s"'))
    assert run("export", path, "--out", tmp_path / "c") == 1
    assert "nothing is exported, as no law is proved" in capsys.readouterr().out.replace("\n", " ")
    assert not (tmp_path / "c").exists()


# ----------------------------------------------------------------------
# Blocks in slow sliding: a law is designed, proved, run, compared and exported, as for other friction.


@pytest.fixture
def designed(monkeypatch):
    """The guarantee of the file stands for the search, which takes half a minute; what it is told is counted."""
    told, claim = [], load_guarantee(SLIDING.with_suffix(".json"))
    *_, found = covered_stress(qd.load_chain(SLIDING), claim)

    def guarantee(chain, controller, **sliding):
        told.append((controller, sliding))
        return PlantGuarantee(proof=found)

    monkeypatch.setattr(chains, "guarantee", guarantee)
    return told


LOADS = ("--lag", "800 s", "--stress", "10 kPa")


def test_blocks_in_slow_sliding_are_designed_run_and_drawn(designed, tmp_path, capsys):
    assert run("design", SLIDING, *LOADS, "--out", tmp_path / "run", "--controller", "decentralised") == 0
    told = " ".join(capsys.readouterr().out.split())
    assert designed == [("decentralised", {"lag": F(800), "stress": F(10_000)})]
    assumptions = told.split("for all t >= 0")[0]
    assert "with a lag of 800 s at the wells, which does not act on the planned pressure" in assumptions
    assert "(changes of slip rate, divided by V, due to 10 kPa of shear stress and up to " in assumptions
    assert "so the slip rate of every block stays at most 1.077e-06 m/s" in told
    assert "run of 1e+06 s (11.6 days) under a sinusoidal shear stress of 10 kPa" in told
    assert "within the proved bounds" in told
    facts = json.loads((tmp_path / "run" / "results.json").read_text())
    assert facts["guarantee"]["peaks"].keys() >= {"slip error 3", "log state 1", "pressure 2"}
    assert facts["run"]["plant"] == "quasi-dynamic"
    assert load_guarantee(tmp_path / "run" / "guarantee.json").law == load_guarantee(SLIDING.with_suffix(".json")).law


@pytest.mark.slow
def test_laws_of_slow_sliding_are_compared_side_by_side(designed, capsys):
    assert run("compare", SLIDING, *LOADS) == 0
    told = capsys.readouterr().out.splitlines()
    assert [one for one, _ in designed] == ["centralised", "decentralised"]
    assert max(map(len, told)) <= 80
    (row,) = (line.split() for line in told if line.startswith("centralised"))
    numbers = [float(v) for v in row[1::2]]
    assert row[2::2] == ["µm/s", "µm", "µm/s", "µm", "kPa", "kPa"]
    assert numbers[0] == 1.08  # rounded up from V·exp(0.0738)
    assert numbers[1] == 37.4
    assert 1 < numbers[2] < numbers[0]
    assert 5 < numbers[3] < numbers[1]
    assert -30 < numbers[4] < -5 < 5 < numbers[5] < 30
    assert "proved for any shear stress of up to 10 kPa" in told[-1]


def test_a_comparison_of_slow_sliding_gives_the_keys_of_every_law(designed, capsys):
    assert run("compare", SLIDING, *LOADS, "--controller", "decentralised", "--json") == 0
    (one,) = json.loads(capsys.readouterr().out).values()
    assert [law for law, _ in designed] == ["decentralised"]
    assert one["run"]["within"] is True


def test_where_nothing_is_proved_of_slow_sliding_no_law_runs(monkeypatch, capsys, tmp_path):
    none = NoProof(reason="no bounds close")
    monkeypatch.setattr(chains, "guarantee", lambda *_, **__: PlantGuarantee(proof=none))
    assert run("design", SLIDING, *LOADS, "--out", tmp_path / "run") == 1
    told = capsys.readouterr().out
    assert "no bounds close" in told
    assert "nothing is simulated, as no law is proved" in told
    assert not (tmp_path / "run").exists()
    assert run("compare", SLIDING, *LOADS, "--json") == 1
    answer = json.loads(capsys.readouterr().out)
    assert answer["decentralised"] == {"verdict": "undecided", "reason": "no bounds close"}


def test_a_law_of_slow_sliding_with_a_delay_is_neither_run_nor_exported(monkeypatch, capsys, tmp_path):
    claim = load_guarantee(SLIDING.with_suffix(".json"))
    late = replace(claim, law=replace(claim.law, delay=F(1)))
    monkeypatch.setattr(PlantProof, "check", lambda _: Verdict.PROVED)
    monkeypatch.setattr(chains, "load_guarantee", lambda _: late)
    for command in ("simulate", "export"):
        assert run(command, SLIDING, "--certificate", tmp_path / "x.json") == 2
        assert "must have no delay. Received" in " ".join(capsys.readouterr().err.split())


def test_the_law_of_slow_sliding_is_exported_with_its_plan(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(PlantProof, "check", lambda _: Verdict.PROVED)  # takes 16 s; decided in the slow tests
    certificate = SLIDING.with_suffix(".json")
    assert run("export", SLIDING, "--certificate", certificate, "--out", tmp_path / "c", "--json") == 0
    answer = json.loads(capsys.readouterr().out)
    assert list(answer["measurement"].items()) == [(f"slip_{i}", "m") for i in (1, 2, 3)]
    assert answer["guarantee"]["verdict"] == "proved"
    header = " ".join((tmp_path / "c" / "controller.h").read_text(encoding="utf-8").replace("*", "").split())
    assert "of CONTROLLER_PRESSURES wells, in addition to the planned pressure, to be held" in header
    assert "the planned pressure reaches the fault unchanged" in header
    assert "|ln(v/V)| <= 0.0738" in header


def test_a_small_event_before_a_large_one_is_no_cycle(monkeypatch):
    """Main events 100 s apart, a foreshock with a hundredth of their slip 1 s before the last."""
    slips = ((1.0, 1.0), (1.0, 1.0), (0.02, 0.0), (1.0, 1.0))
    onsets = (50.0, 150.0, 249.0, 250.0)
    events = tuple(
        BlockEvent(onset=onset, arrest=onset + 1, slip=slip, peak_slip_rate=(1.0, 1.0), magnitude=None)
        for onset, slip in zip(onsets, slips, strict=True)
    )
    monkeypatch.setattr(chains.SlidingChainRun, "events", events)
    run = SimpleNamespace(times=[0.0, 300.0], loading_rate=1e-9, onsets=onsets)
    chain = SimpleNamespace(name="two")
    free = chains.SlidingChainRun(chain=chain, run=run, inertia=False, proof=None, controller="")
    assert free.lines()[-1] == "recurrence interval 100 s, of events with over 10% of the largest slip"
