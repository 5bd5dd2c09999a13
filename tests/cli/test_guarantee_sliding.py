"""``guarantee`` of faults with rate-and-state friction: the sentence first, and one line for what does not apply."""

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from quakedesign.cli import main
from quakedesign.exact import UpperBound
from quakedesign.fault import friction_law, load_fault
from quakedesign.fault.fault_toml import fault_toml
from quakedesign.guarantees import NoProof, SampledLoop, SlidingClaims, SlidingProof, sliding_result
from quakedesign.guarantees.exact.guarantee_files import parse_guarantee
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search.sliding_design import FarthestWell, proved_sliding
from quakedesign.laws import LinearLaw
from quakedesign.loop.loop_setup import Pump
from quakedesign.lyapunov import Verdict
from quakedesign.plant import WHOLE
from quakedesign.synthesis import design as synthesise
from quakedesign.synthesis import state_feedback

LAW = LinearLaw(states=(), update=(), measured=(), output=(), feedback=(Fraction(1), Fraction(0)))
HELD = SampledLoop(law=LAW, step=Fraction(300))
CLAIMS = SlidingClaims(**{name: UpperBound(Fraction(1)) for name in SlidingClaims.__dataclass_fields__})
PROOFS = Path(__file__).parents[2] / "proofs" / "certificates"
NONE = NoProof(reason="too much")
LAGGED = ("guarantee", "creeping-patch", "--lag", "200 s", "--step", "4000 s")


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as stop:
        main(list(arguments))
    captured = capsys.readouterr()
    return stop.value.code, captured.out, captured.err


@pytest.mark.slow
def test_a_creeping_patch_is_held_below_1_65_times_its_rate(capsys, tmp_path):
    path = tmp_path / "sliding.json"
    code, out, _ = run(capsys, *LAGGED, "--stress", "10 kPa", "--out", str(path), "--json")
    answer = json.loads(out)
    assert code == 0
    assert answer["verdict"] == "proved"
    assert answer["stress"] == "10000"
    assert 1e-7 < Fraction(answer["peak_slip_rate"]) < Fraction("1.65e-7")
    assert parse_guarantee(path.read_text()).check() is Verdict.PROVED


def test_a_step_that_is_too_short_is_said_to_be(capsys):
    code, out, _ = run(capsys, "guarantee", "creeping-patch", "--lag", "200 s", "--step", "10 s", "--stress", "10 kPa")
    assert code == 1
    assert out.startswith("none: no law with zero-order hold over 10 s")
    assert "4e+03 s, suits" in out


def test_an_estimate_of_the_largest_stress_that_is_too_large_is_lowered_until_it_is_proved(monkeypatch):
    tried = []

    def proved(task, design, *, log_rate):
        tried.append(task.stress)
        return SlidingProof(task=task, sampled_loop=design, cuts=WHOLE, claims=CLAIMS) if task.stress < 35_000 else NONE

    monkeypatch.setattr(sliding_result, "designed_sliding", lambda task, step, **around: HELD)
    monkeypatch.setattr(sliding_result, "largest_stress", lambda task, design, *, log_rate: Fraction(41_000))
    monkeypatch.setattr(sliding_result, "proved_sliding", proved)
    found = sliding_result.guarantee_sliding(load_fault("crustal-patch"), setup=ExactSetup(diffusion=Fraction(800)))
    assert found.proved
    assert tried == [41_000, 36_000, 30_000]


def test_where_a_law_is_estimated_to_stand_no_stress_those_for_narrower_bounds_are_asked(monkeypatch):
    stands, tried = {Fraction(1, 2): 0, Fraction(1, 4): 7_000, Fraction(1, 8): 90_000}, []

    def proved(task, design, *, log_rate):
        tried.append((log_rate, task.stress))
        return SlidingProof(task=task, sampled_loop=design, cuts=WHOLE, claims=CLAIMS)

    monkeypatch.setattr(sliding_result, "designed_sliding", lambda task, step, **around: HELD)
    monkeypatch.setattr(sliding_result, "largest_stress", lambda task, design, *, log_rate: Fraction(stands[log_rate]))
    monkeypatch.setattr(sliding_result, "proved_sliding", proved)
    fault, half, quarter = load_fault("crustal-patch"), Fraction(1, 2), Fraction(1, 4)
    assert sliding_result.guarantee_sliding(fault, setup=ExactSetup(diffusion=Fraction(800))).task.stress == 7_000
    assert tried == [(half, 1), (quarter, 7_000)]
    stands[half] = stands[quarter] = stands[Fraction(1, 8)] = 0
    assert sliding_result.guarantee_sliding(fault, setup=ExactSetup(diffusion=Fraction(800))).proof.task.stress == 1
    tried.clear()
    assert (
        sliding_result.guarantee_sliding(
            fault, setup=ExactSetup(diffusion=Fraction(800)), stress=Fraction(1, 2)
        ).task.stress
        == half
    )
    assert tried == [(half, half)]


def test_a_well_that_is_impossible_is_said_to_be_that_before_what_would_do(monkeypatch):
    """Beyond 1.3e6 s for 25 kPa on this fault, whatever law is looked for."""
    monkeypatch.setattr(sliding_result, "designed_sliding", lambda *_, **__: NONE)
    monkeypatch.setattr(sliding_result, "farthest", lambda *_, **__: FarthestWell(share=Fraction(1, 2)))
    monkeypatch.setattr(sliding_result, "possible_remedy", lambda *_, **__: "another")
    fault = load_fault("crustal-patch")

    def reason(diffusion, stress):
        return sliding_result.guarantee_sliding(
            fault, setup=ExactSetup(diffusion=Fraction(diffusion)), stress=stress
        ).proof.reason

    assert reason(10**6, Fraction(25_000)) == "too much; another"
    assert reason(2 * 10**6, None) == "too much; another"
    said = reason(2 * 10**6, Fraction(25_000))
    assert said.startswith("no controller whose pressure stays within 50 MPa")
    assert said.endswith("; another")


def test_where_a_stress_has_no_proof_a_smaller_one_that_has_is_named(monkeypatch):
    def proved(task, design, *, log_rate):
        return SlidingProof(task=task, sampled_loop=design, cuts=WHOLE, claims=CLAIMS) if task.stress < 35_000 else NONE

    monkeypatch.setattr(sliding_result, "designed_sliding", lambda task, step, **around: HELD)
    monkeypatch.setattr(sliding_result, "largest_stress", lambda task, design, *, log_rate: Fraction(20_000))
    monkeypatch.setattr(sliding_result, "proved_sliding", proved)
    fault, around = load_fault("crustal-patch"), {"diffusion": Fraction(800)}
    found = sliding_result.guarantee_sliding(fault, stress=Fraction(40_000), setup=ExactSetup(**around)).proof
    assert found.reason == (
        "too much; a proof was found for a stress of at most 20 kPa: give --stress '20 kPa', or somewhat more"
    )
    none = NoProof(reason="no law whose loop is stable")
    with monkeypatch.context() as patched:
        found_below = lambda task, step, **around: HELD if task.stress < 35_000 else none  # noqa: E731
        patched.setattr(sliding_result, "designed_sliding", found_below)
        patched.setattr(sliding_result, "farthest", lambda *_, **__: FarthestWell(share=Fraction(1)))
        found = sliding_result.guarantee_sliding(fault, stress=Fraction(40_000), setup=ExactSetup(**around)).proof
    assert found.reason.startswith("no law was found that controls the fault under 40 kPa; a proof was found")
    monkeypatch.setattr(sliding_result, "proved_sliding", lambda task, design, *, log_rate: NONE)
    assert sliding_result.guarantee_sliding(fault, stress=Fraction(40_000), setup=ExactSetup(**around)).proof == NONE


def test_where_a_slip_noise_has_no_proof_a_smaller_one_that_has_is_named(monkeypatch):
    def proved(task, design, *, log_rate):
        quiet = design.slip_noise <= Fraction(1, 10**7)
        return SlidingProof(task=task, sampled_loop=design, cuts=WHOLE, claims=CLAIMS) if quiet else NONE

    design = lambda task, step, **more: replace(HELD, slip_noise=more["setup"].slip_noise)  # noqa: E731
    monkeypatch.setattr(sliding_result, "designed_sliding", design)
    monkeypatch.setattr(sliding_result, "largest_stress", lambda task, design, *, log_rate: Fraction(20_000))
    monkeypatch.setattr(sliding_result, "proved_sliding", proved)
    around = {"diffusion": Fraction(800), "slip_noise": Fraction(1, 10**6)}
    for stress in (None, Fraction(10_000)):
        found = sliding_result.guarantee_sliding(
            load_fault("crustal-patch"), stress=stress, setup=ExactSetup(**around)
        ).proof
        assert found.reason == "too much; a proof was found with slip noise of at most 100 nm"


def test_a_stress_far_beyond_what_a_law_stands_has_no_guarantee():
    known = parse_guarantee((PROOFS / "sliding_crustal-patch.json").read_text())
    found = proved_sliding(replace(known.task, stress=20 * known.task.stress), known.sampled_loop)
    assert found.reason.startswith("a stress of 5e+05 Pa is not shown to keep |ln(v/V)| below 0.5")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("guarantee", "crustal-patch"), "needs a diffusion path or a lag"),
        (("guarantee", "crustal-patch", "--diffusion", "833 s", "--jitter", "1 s"), "Received jitter. Omit"),
        (
            ("guarantee", "crustal-patch", "--diffusion", "833 s", "--rate-limit", "1 Pa/s"),
            "no guarantee with the rate limit of a pump",
        ),
        ((*LAGGED, "--stress", "0 Pa"), "stress must be positive. Received 0 Pa"),
        ((*LAGGED, "--spread", "1"), "spread must be from 0 to below 1"),
        ((*LAGGED, "--spread", "36"), "Received 36. Give a fraction: 36 % is 0.36."),
        ((*LAGGED, "--spread", "-1"), "Received -1. Give a fraction."),
        ((*LAGGED, "--well", "8 m"), "Received --well of 8.0 m alone. Give"),
        ((*LAGGED, "--controller", "cta"), "Give --controller elqr"),
        ((*LAGGED, "--box", "ten-percent"), "--box paper and --spread"),
        ((*LAGGED, "--class", "rate"), "Omit these options"),
        ((*LAGGED, "--gains", "1", "2", "3", "4"), "Omit these options"),
        (("guarantee", "real-fault", "--stress", "1 kPa"), "need friction with a state"),
        (("guarantee", "real-fault", "--spread", "0.1"), "need friction with a state"),
    ],
)
def test_what_does_not_apply_is_one_line(arguments, said, capsys):
    code, out, err = run(capsys, *arguments)
    assert code == 2
    assert not out
    assert said in " ".join(err.split())


@pytest.mark.slow
def test_the_slip_law_is_proved_with_a_smaller_bound_of_the_slip_rate_than_is_tried_first(capsys, tmp_path):
    """`crustal-patch` with it; its own ageing law is proved under 40 kPa."""
    patch, path = load_fault("crustal-patch"), tmp_path / "slip.toml"
    law = {name: getattr(patch.friction, name) for name in patch.friction.quantities()}
    path.write_text(fault_toml(replace(patch, name="slip-patch", friction=friction_law("rate-and-state-slip")(**law))))
    code, out, _ = run(capsys, "guarantee", str(path), "--diffusion", "3600 s", "--json", "--out", str(tmp_path / "g"))
    answer = json.loads(out)
    assert (code, answer["verdict"]) == (0, "proved")
    assert Fraction(answer["stress"]) >= 14_000
    assert 0.05 < answer["worst_found"]["log_rate"] < float(Fraction(answer["log_rate"])) < 0.15
    assert "state by the slip law" in answer["sentence"]
    found = parse_guarantee((tmp_path / "g").read_text())
    assert found.task.state_law == "slip"
    assert found.check() is Verdict.PROVED


@pytest.mark.slow
def test_a_pump_that_cannot_hold_what_may_be_asked_for_has_no_guarantee(monkeypatch):
    """The known law asks for -153 kPa to 3.713 MPa under 25 kPa; less stress asks for less."""
    known = parse_guarantee((PROOFS / "sliding_crustal-patch.json").read_text())
    monkeypatch.setattr(sliding_result, "designed_sliding", lambda task, step, **around: known.sampled_loop)
    monkeypatch.setattr(sliding_result, "proved_sliding", lambda task, held, log_rate: replace(known, task=task))
    monkeypatch.setattr(sliding_result, "largest_stress", lambda task, held, log_rate: Fraction(25000))
    least, largest = known.valve_pressures
    fault, asked = load_fault("crustal-patch"), {"diffusion": Fraction(833)}
    for stress in (Fraction(25000), None):
        enough = sliding_result.guarantee_sliding(
            fault, stress=stress, setup=ExactSetup(pump=Pump(least=Fraction(least), largest=Fraction(largest)), **asked)
        )
        assert enough.proved
        assert enough.to_dict()["asked_pressure"] == [least.exact, largest.exact]
        for low, high in ((Fraction(least) + 1, Fraction(largest)), (Fraction(-(10**6)), Fraction(largest) - 1)):
            weak = Pump(least=low, largest=high)
            found = sliding_result.guarantee_sliding(fault, stress=stress, setup=ExactSetup(pump=weak, **asked))
            assert not found.proved
            assert "may be commanded, but the pump supplies only" in found.lines()[0]


def test_the_stresses_that_are_tried_are_told_with_what_came_of_them(monkeypatch):
    def proved(task, design, *, log_rate):
        return SlidingProof(task=task, sampled_loop=design, cuts=WHOLE, claims=CLAIMS) if task.stress < 38_000 else NONE

    monkeypatch.setattr(sliding_result, "designed_sliding", lambda task, step, **around: HELD)
    monkeypatch.setattr(sliding_result, "largest_stress", lambda task, design, *, log_rate: Fraction(41_000))
    monkeypatch.setattr(sliding_result, "proved_sliding", proved)
    told = []
    known = sliding_result.guarantee_sliding(
        load_fault("crustal-patch"),
        setup=ExactSetup(diffusion=Fraction(800)),
        progress=lambda what, done: told.append(what),
    )
    assert known.task.stress == 36_000
    tried = [what for what in told if "stress" in what]
    assert [what.partition(" Pa")[0] for what in tried] == ["a stress of 4.1e+04"] * 2 + ["a stress of 3.6e+04"] * 2
    assert [what.rpartition(": ")[2] for what in tried] == ["proof", "not proved", "proof", "proved"]
    missing = replace(known, proof=NONE, sampled_loop=None)
    monkeypatch.setattr(
        state_feedback, "guarantee_sliding", lambda *_, progress, **__: progress("a law", 0.5) or missing
    )
    synthesise(load_fault("crustal-patch"), "elqr", progress=lambda what, done: told.append(what))
    assert told[-1] == "a law"
