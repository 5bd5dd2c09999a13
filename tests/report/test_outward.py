"""Every certified number of a design that reaches a person or a file lies on the outer side of the exact one."""

import json
import re
from fractions import Fraction as F

import pytest

import quakedesign as qd
from quakedesign.exact import LowerBound, UpperBound
from quakedesign.linear.verdict import judge
from quakedesign.lyapunov import Verdict
from quakedesign.lyapunov.exact.premises import Premise
from quakedesign.report.sentences import domain_sentence, hold_sentences, peaks_sentence, sentences, verdict_lines
from quakedesign.report.terminal import _line
from quakedesign.studies.comparison import Entry

LAB = qd.load_fault("lab-fault")
NUMBER = r"(-?\d+(?:\.\d+)?(?:e[-+]\d+)?)"


@pytest.fixture(scope="module")
def linear(kept):
    return judge(LAB, qd.published("lab-fault")["elqr"], step="0.5e-3", peaks="rate")


@pytest.fixture(scope="module")
def sliding():
    return qd.design(LAB, "cta", continuous=True)


def outward(bound, text):
    """Whether a printed number is on the outer side of a bound, and within a thousandth or its third digit."""
    shown = F(text)
    side = shown >= bound if isinstance(bound, UpperBound) else shown <= bound
    return side and abs(shown - bound) <= abs(F(bound)) / 10


def numbers(pattern, text):
    found = re.search(pattern.replace("#", NUMBER), text)
    assert found, f"{pattern} in {text}"
    return found.groups()


def test_every_certified_number_in_the_lines_about_a_linear_law(linear):
    said = "\n".join(verdict_lines(linear))
    found, held, peaks = linear.analysis, linear.sampled, linear.peaks
    expected = {
        "decay rate # 1/s certified": (found.decay.certified,),
        "margin # certified; unstable from # on": (found.slope.certified, found.slope.limit),
        r"certified ranges of beta: \[# \(unstable at #\), upper end of the box\] and \[lower end of the box, #\]": (
            found.span.low,
            found.span.low_limit,
            found.span.high,
        ),
        "stability is proved for every T_s up to # s": (held.largest_step,),
        r"slip rate below # m/s \(slip error # m\)": (peaks.claims.peak_slip_rate, peaks.claims.slip_error),
    }
    for pattern, bounds in expected.items():
        shown = numbers(pattern, said)
        assert all(outward(bound, text) for bound, text in zip(bounds, shown, strict=True)), pattern
    assert "; ".join(hold_sentences(held)) in said
    assert peaks_sentence({"rate": peaks}) in said


def test_every_certified_float_in_the_facts_of_a_linear_law(linear):
    facts, held = json.loads(json.dumps(linear.to_dict())), linear.sampled
    longest = facts["held"]["largest_step"]
    assert F(longest) <= held.largest_step < F(longest) * (1 + F(1, 10**15))
    assert F(facts["held"]["refuted_step"]) >= held.refuted_step
    margin = linear.analysis.slope
    assert F(facts["working_margin"]) <= margin.certified * margin.slope / margin.working_slope
    assert F(facts["decay_rate"]) == linear.analysis.decay.certified
    assert F(facts["peaks"]["peak_slip_rate"]) == linear.peaks.claims.peak_slip_rate


def test_every_premise_of_a_sliding_mode(sliding):
    assert sliding.verdict is Verdict.PROVED
    for premise in sliding.premises:
        assert isinstance(premise.required, UpperBound)
        assert isinstance(premise.certified, LowerBound)
        if premise.required == premise.certified:
            required, ratio = numbers("required at most #.*, certified equal, ratio #", _line(premise))
        else:
            required, certified, ratio = numbers("required #.*, certified #.*, ratio #", _line(premise))
            assert F(certified) <= premise.certified
        assert F(required) >= premise.required
        assert F(ratio) >= F(premise.required) / F(premise.certified)
        written = json.loads(json.dumps(premise.to_dict()))
        assert F(written["required"]) >= premise.required
        assert F(written["certified"]) <= premise.certified
        assert F(written["ratio"]) >= F(premise.required) / F(premise.certified)
        assert premise.holds == (F(premise.required) <= F(premise.certified))


def test_equal_sides_of_a_premise_are_not_said_to_differ():
    third, more = F(1, 3), F(1, 3) + F(1, 10**9)
    alike = Premise(name="x", required=third, certified=third, unit="m")
    assert _line(alike) == "premise x holds: required at most 0.3334 m, certified equal, ratio 1"
    fails = Premise(name="x", required=more, certified=third, unit="-")
    assert _line(fails) == "premise x FAILS: required 0.3334, certified 0.3333, ratio 1.01"
    nothing = {"verdict": Verdict.UNDECIDED, "controller": None, "certificate": None}
    held = qd.Design(fault=LAB, name="cta", premises=(alike,), **nothing)
    assert "<td>at most 0.3334 m</td><td>equal</td>" in held._repr_html_()


def test_sentences_and_domain_of_a_sliding_mode(sliding):
    said = "; ".join(sentences(Entry(label="x", origin="designed", design=sliding, run=None)))
    failing = [p for p in sliding.premises if not p.holds]
    shown = re.findall(rf"{NUMBER} times", said)
    assert len(shown) == len(failing)
    assert all(F(text) >= F(p.required) / F(p.certified) for text, p in zip(shown, failing, strict=True))
    domain = sliding.domain
    bounds = (domain.slip_error, domain.slip_rate_error, domain.start_slip_error, domain.start_slip_rate_error)
    shown = re.findall(rf"\|e\d\| <= {NUMBER} m", domain_sentence(domain))
    assert all(outward(bound, text) for bound, text in zip(bounds, shown, strict=True))
    written = json.loads(json.dumps(domain.to_dict()))
    assert F(written["slip_error"]) >= domain.slip_error
    assert F(written["start_perturbation"]) <= domain.start_perturbation
