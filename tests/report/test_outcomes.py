"""What a run is said to have come to, how far a proof reaches, and when a comparison is a positive answer."""

import dataclasses
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import pytest

from quakedesign.cli.design_commands import positive
from quakedesign.exact import LowerBound, UpperBound
from quakedesign.fault import load_fault
from quakedesign.guarantees import ContinuousProof
from quakedesign.laws import SampledLaw, control_law
from quakedesign.linear.sampled_stability import SampledStability
from quakedesign.lyapunov import Verdict
from quakedesign.lyapunov.exact.premises import Premise
from quakedesign.report import headline
from quakedesign.report.sentences import (
    exceeded_line,
    grade,
    outcome_sentence,
    pressure_sentence,
    proved_line,
    sentences,
)
from quakedesign.simulation import simulate
from quakedesign.studies import Entry
from quakedesign.synthesis import Design

FAULT = load_fault(Path(__file__).parent.parent / "data" / "undersampled_fault.toml")
LAW = control_law("cta").from_values(("7", "5", "2.3", "1.1"), divisor="27/260000000").scaled("0.000136822")
FINE = Premise(name="along_reference", required=0.9, certified=1.0, unit="m/s^3")
CHATTER = Premise(name="on_trajectory", required=1.0004, certified=1.0, unit="m/s^3", measured=True)
MOVING = Premise(name="constant_reference", required=1.0, certified=0.0, unit="m/s")


def entry(run, *premises, verdict=Verdict.PROVED, **more):
    design = Design(
        fault=FAULT, name="cta", verdict=verdict, controller=LAW, certificate=None, premises=tuple(premises)
    )
    return Entry(label="x", origin="designed", design=design, run=run, **more)


@pytest.fixture(scope="module")
def slow():
    return simulate(FAULT, LAW, duration=200.0, plant="printed")  # within 100 s one of six escapes, by its last digits


@pytest.fixture(scope="module")
def fine():
    return simulate(FAULT, LAW, duration=100.0, step=0.01)


def test_a_proved_design_whose_run_is_an_earthquake_is_no_positive_answer(slow, fine):
    answers = [positive(SimpleNamespace(of=lambda _, run=run: (entry(run, FINE),))) for run in (slow, fine)]
    assert answers == [False, True]


def test_the_headline_says_the_outcome_before_the_verdict_and_the_pressure_is_not_lost(slow):
    parts = sentences(entry(slow, FINE))
    assert parts[0] == outcome_sentence(slow)
    share = 100 * slow.outcome.share_of_natural
    peak = slow.metrics.peak_slip_rate
    assert parts[0] == f"earthquake: peak slip rate {peak:.3g} m/s, {share:.3g} % of the natural earthquake's 0.313 m/s"
    assert parts[1:3] == ["proved in continuous time", "every premise holds"]
    assert parts[3].startswith("pressure from -")
    assert "(withdrawal) to" in parts[3]
    assert headline(entry(slow, FINE)).startswith("; ".join(parts[:3]))
    assert entry(slow).to_dict()["outcome"] == slow.outcome.to_dict()


@pytest.mark.parametrize(
    ("plant", "said"),
    [
        ("printed", "proved for the loop that ran, for all t >= 0"),
        ("stick-slip", "proved for this sampled loop on the plant without stick, for all t >= 0"),
    ],
)
def test_a_proof_of_one_plant_is_not_said_of_a_run_on_another(slow, plant, said):
    run = dataclasses.replace(slow, provenance={**slow.provenance, "plant": plant})
    shown = entry(run, FINE)
    law = SampledLaw.from_gains([3e8, 2e8, 2e7], step="184 ms")
    proved = dataclasses.replace(shown, design=dataclasses.replace(shown.design, controller=law))
    assert sentences(proved)[1] == said


def test_a_negative_slip_rate_is_said_with_its_plant(slow):
    share = f"{100 * slow.metrics.reverse_slip_fraction:.3g}"
    assert f"on the plant without stick, the slip rate is negative in {share} % of the steps" in sentences(entry(slow))
    still = dataclasses.replace(slow, metrics=dataclasses.replace(slow.metrics, reverse_slip_fraction=0.0))
    assert not any("negative" in sentence for sentence in sentences(entry(still)))


@pytest.mark.parametrize(
    ("ends", "said"),
    [
        ((-5.674e6, 2.5e4), "pressure from -5.67 MPa (withdrawal) to 0.025 MPa (injection)"),
        ((0.0, 2e6), "pressure from 0 MPa to 2 MPa (injection)"),
        ((-7.4e6, 2.9e-10), "pressure from -7.4 MPa (withdrawal) to 0 MPa"),
        ((-0.0, 0.0), "pressure from 0 MPa to 0 MPa"),
    ],
)
def test_the_sign_of_the_pressure_is_said(ends, said):
    assert pressure_sentence(*ends) == said


PEAKS = object.__new__(ContinuousProof)  # that there are some is all that counts here


def test_verdicts_are_graded_by_what_the_proof_leaves_out(slow):
    assert grade(entry(slow, FINE)) == "proved for this loop and task"
    assert (
        grade(entry(slow, FINE, CHATTER)) == "proved, but on_trajectory fails: requires 1.01 times the certified value"
    )
    assert grade(entry(slow, MOVING)) == "proved, but constant_reference fails (nothing is certified)"
    assert grade(entry(slow, MOVING, peaks={"amplitude": PEAKS})) == "proved for this loop and task"
    assert grade(entry(slow, FINE, growth_per_step=1.2)) == "proved, but UNSTABLE at the step used"
    assert grade(entry(slow, FINE, verdict=Verdict.UNDECIDED)) == "undecided"
    assert grade(entry(slow, FINE, verdict=Verdict.REFUTED)) == "refuted"


def test_a_held_pressure_is_not_what_is_proved(slow):
    held = simulate(FAULT, LAW, duration=1.0, scheme="implicit")
    assert grade(entry(held, FINE)) == "proved, but zero-order hold (scheme implicit) is not covered"
    runs = SimpleNamespace(verdict=Verdict.REFUTED)
    unstable = SampledStability(verdict_at_step=runs, longest=None, radius=1.1)
    assert (
        grade(entry(slow, FINE, zero_order_hold=unstable))
        == "proved for this loop and task; UNSTABLE with zero-order hold over T_s"
    )


@pytest.mark.parametrize(
    ("low", "high", "beyond"), [(-14e6, 2e6, False), (-30e6, 0.0, True), (0.0, 3e6, True), (None, None, False)]
)
def test_a_run_says_how_its_pressure_exceeds_the_proved_range(low, high, beyond):
    metrics = SimpleNamespace(min_pressure=low, max_pressure=high)
    said = exceeded_line(metrics, LowerBound(Fraction(-14_300_000)), UpperBound(Fraction(2_500_000)))
    assert bool(said) == beyond
    if low == -30e6:
        assert said == "its pressure EXCEEDS the proved range: -30 MPa to 0 Pa, proved -14.3 MPa to 2.5 MPa"
        line = proved_line("the slip stays", ["plant"], said)
        others = "this run is NOT covered by the proof, from which it differs in: plant"
        assert line == f"{others}; {said}; the proof says: the slip stays"
