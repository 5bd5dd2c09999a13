"""Sentences about an e-LQR say what was decided, and round every bound to its outer side."""

from dataclasses import replace
from fractions import Fraction as F
from types import SimpleNamespace

import pytest

from quakedesign.exact import LowerBound, UpperBound
from quakedesign.fault import load_fault
from quakedesign.guarantees import Bounds, Claims, ContinuousProof, NoProof
from quakedesign.linear.sampled_stability import LargestVaryingStep, SampledStability, VaryingVerdict
from quakedesign.loop import exact_integrals
from quakedesign.lyapunov import Verdict
from quakedesign.plant import uncertain_plant
from quakedesign.report.sentences import hold_sentences, margin_lines, peaks_sentence

LONGEST = LargestVaryingStep(proved=LowerBound("0.15769"), refuted=UpperBound("0.15822"), proofs=())


def held(verdict, *, step="0.184", longest=LONGEST, witness=None):
    runs = VaryingVerdict(verdict=verdict, step=F(step), witness=witness)
    return SampledStability(verdict_at_step=runs, longest=longest, radius=0.9)


@pytest.mark.parametrize(
    ("loop", "said"),
    [
        (held(Verdict.PROVED, step="0.1"), "T_s = 0.1 s, proved for any time-varying parameters, with integrals"),
        (held(Verdict.PROVED, step="0.1"), "T_s up to 0.1576 s and refuted for 0.15822 s"),
        (held(Verdict.REFUTED, witness=(F("1.4"), F(-1, 2), F(2))), "UNSTABLE with zero-order hold over T_s = 0.184 s"),
        (held(Verdict.UNDECIDED, step="0.158"), "undecided with zero-order hold over T_s = 0.158 s; stability is"),
        (held(Verdict.UNDECIDED, longest=None), "undecided with zero-order hold over T_s = 0.184 s; no T_s is proved"),
    ],
)  # fmt: skip
def test_a_held_pressure(loop, said):
    assert said in "; ".join(hold_sentences(loop))


def test_peaks_of_one_or_no_class():
    bounds = Bounds(slip_error=F("0.5"), slip_rate_error=F(1, 10**5), push=F(1), small_gain=F(1, 2))
    task, law = uncertain_plant(load_fault("real-fault")), exact_integrals((F(1),) * 4)
    claims = replace(
        Claims.of(task, bounds), peak_slip_rate=UpperBound("8.33542235e-5"), slip_error=UpperBound("0.50001")
    )
    peaks = ContinuousProof(task=task, law=law, claims=claims)
    none = NoProof(reason="small gain 2: too much", small_gain=UpperBound(2))
    said = peaks_sentence({"rate": peaks, "amplitude": none})
    assert said.endswith("(slip error 0.501 m) for any disturbance of the fault's amplitude and rate")
    assert "slip rate below 8.34e-05 m/s (slip error" in said
    assert peaks_sentence({"rate": none}) == "no bound on the slip rate is certified; small gain 2: too much"


def test_margins_are_rounded_towards_what_is_proved_and_limits_away_from_it():
    found = SimpleNamespace(
        unstable_at=None,
        decay=SimpleNamespace(certified=LowerBound("0.55559"), limit=0.7),
        slope=SimpleNamespace(certified=LowerBound("1.2345678"), limit=UpperBound("1.2345678")),
        span=SimpleNamespace(low=UpperBound("0.70001"), high=LowerBound("5.69999"), low_limit=LowerBound("0.69999")),
    )
    decay, slope, span = margin_lines(found)
    assert "0.5555 1/s certified" in decay
    assert slope == "friction-slope margin 1.2345 certified; unstable from 1.2346 on"
    upper, lower = "[0.7001 (unstable at 0.6999), upper end of the box]", "[lower end of the box, 5.699]"
    assert span == f"certified ranges of beta: {upper} and {lower}"
