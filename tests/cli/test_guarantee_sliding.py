"""``guarantee`` of faults with rate-and-state friction: the sentence first, and one line for what does not apply."""

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from quakedesign.bounds import UpperBound
from quakedesign.certificates import Verdict
from quakedesign.certificates.guarantee import Held, NoGuarantee
from quakedesign.certificates.guarantee.files import parse_guarantee
from quakedesign.certificates.slow_sliding import WHOLE, SlidingClaims, SlidingGuarantee
from quakedesign.cli import main
from quakedesign.fault import load_fault
from quakedesign.loop import LinearLaw
from quakedesign.synthesis.guaranteed import sliding_answer
from quakedesign.synthesis.guaranteed.slow_sliding import proved_sliding

LAW = LinearLaw(states=(), update=(), measured=(), output=(), feedback=(Fraction(1), Fraction(0)))
HELD = Held(law=LAW, step=Fraction(300))
CLAIMS = SlidingClaims(**{name: UpperBound(Fraction(1)) for name in SlidingClaims.__dataclass_fields__})
PROOFS = Path(__file__).parents[2] / "proofs" / "certificates"
NONE = NoGuarantee(reason="too much", small_gain=None)
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
    assert out.startswith("none: no law held over 10 s")
    assert "4e+03 s, suits" in out


def test_an_estimate_of_the_largest_stress_that_is_too_large_is_lowered_until_it_is_proved(monkeypatch):
    tried = []

    def proved(task, design):
        tried.append(task.stress)
        return SlidingGuarantee(task=task, held=design, cuts=WHOLE, claims=CLAIMS) if task.stress < 35_000 else NONE

    monkeypatch.setattr(sliding_answer, "designed_sliding", lambda task, step, **around: HELD)
    monkeypatch.setattr(sliding_answer, "largest_stress", lambda task, design: Fraction(41_000))
    monkeypatch.setattr(sliding_answer, "proved_sliding", proved)
    found = sliding_answer.answer_sliding(load_fault("crustal-patch"), diffusion=Fraction(800))
    assert found.proved
    assert tried == [41_000, 36_000, 30_000]


def test_a_stress_far_beyond_what_a_law_stands_has_no_guarantee():
    known = parse_guarantee((PROOFS / "sliding_crustal-patch.json").read_text())
    found = proved_sliding(replace(known.task, stress=20 * known.task.stress), known.held)
    assert found.reason.startswith("a stress of 5e+05 Pa is not shown to leave |ln(v/V)| below 0.5")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("guarantee", "crustal-patch"), "through rock or a lag"),
        ((*LAGGED, "--stress", "0 Pa"), "a stress above 0"),
        ((*LAGGED, "--spread", "1"), "a spread must be from 0 to below 1"),
        ((*LAGGED, "--controller", "cta"), "Give --controller elqr"),
        ((*LAGGED, "--box", "ten-percent"), "--box paper and --spread"),
        ((*LAGGED, "--class", "rate"), "Leave them out"),
        ((*LAGGED, "--gains", "1", "2", "3", "4"), "Leave them out"),
        (("guarantee", "real-fault", "--stress", "1 kPa"), "need friction with a state"),
        (("guarantee", "real-fault", "--spread", "0.1"), "need friction with a state"),
    ],
)
def test_what_does_not_apply_is_one_line(arguments, said, capsys):
    code, out, err = run(capsys, *arguments)
    assert code == 2
    assert not out
    assert said in " ".join(err.split())
