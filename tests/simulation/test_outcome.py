"""What a run comes to: closed forms at every threshold, and runs whose end is known."""

import json
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from quakedesign.fault import Disturbance, load_fault
from quakedesign.laws import LinearLaw, SampledController, control_law, published
from quakedesign.report.sentences import outcome_sentence
from quakedesign.simulation import Outcome, OutcomeCriterion, natural_earthquake, simulate
from quakedesign.simulation import earthquake as memoryless_earthquake
from quakedesign.simulation.campaign import SampleResult, campaign_problem
from quakedesign.simulation.campaign.campaign_result import Campaign
from quakedesign.simulation.earthquake import natural_peak
from quakedesign.simulation.trajectory import KINDS

REAL, LAB = load_fault("real-fault"), load_fault("lab-fault")
UNDERSAMPLED = load_fault(Path(__file__).parent.parent / "data" / "undersampled_fault.toml")
STABLE = replace(REAL, friction=replace(REAL.friction, drop=0.0))
CRITERION = OutcomeCriterion(natural_peak=0.5, inertial_rate=1.0, reference_rate=0.125, target_slip=2.0)


@pytest.mark.parametrize(
    ("peak", "error", "events", "kind"),
    [
        (0.125, 0.0, {}, "tracked"),
        (0.125 + 0.00499, 0.04, {}, "tracked"),
        (0.125 + 0.00501, 0.04, {}, "slow slip"),
        (0.125 + 0.00499, 0.040001, {}, "slow slip"),
        (0.125 + 0.0499, 0.0, {}, "slow slip"),
        (0.125 + 0.0501, 0.0, {}, "earthquake"),
        (0.126, None, {}, "tracked"),
        (0.126, 0.0, {"reverse_slip": 1.0, "stick": 2.0}, "tracked"),
        (0.126, 0.0, {"opening": 1.0}, "opened"),
        (0.9, 0.0, {"opening": 1.0}, "opened"),
        (None, None, {"opening": 1.0, "diverged": 2.0}, "diverged"),
        (0.9, None, {"diverged": 2.0}, "earthquake"),
        (0.9, None, {"opening": 1.0, "diverged": 2.0}, "opened"),
        (0.126, None, {"diverged": 2.0}, "diverged"),
    ],
)
def test_a_tenth_of_the_natural_peak_beyond_the_reference_is_an_earthquake_a_hundredth_is_not_tracked(
    peak, error, events, kind
):
    found = CRITERION.outcome(peak, error, events, followed=True)
    assert found.kind == kind
    assert found.peak_slip_rate == peak
    assert found.share_of_natural == (None if peak is None else peak / 0.5)
    assert found.harmless == (kind in ("tracked", "slow slip"))


def test_what_is_as_fast_as_a_threshold_is_still_tracked_and_already_an_earthquake():
    """A natural peak of 100 m/s: a hundredth and a tenth of it are whole numbers, which floats hold exactly."""
    quick = replace(CRITERION, natural_peak=100.0)
    assert [quick.outcome(0.125 + excess, 0.0, {}, followed=True).kind for excess in (1.0, 10.0)] == [
        "tracked",
        "earthquake",
    ]


def test_friction_with_a_state_is_compared_with_its_dynamic_rate_whatever_its_natural_peak():
    state = replace(CRITERION, dynamic_rate=0.01)
    assert state.outcome(0.125 + 0.0011, 0.0, {}, followed=True) == Outcome(
        kind="earthquake", peak_slip_rate=0.125 + 0.0011, share_of_natural=(0.125 + 0.0011) / 0.5
    )
    assert state.outcome(0.125 + 0.0009, 0.0, {}, followed=True).kind == "slow slip"


def test_what_follows_nothing_is_never_tracked_and_has_no_reference_to_be_as_fast_as():
    assert CRITERION.outcome(0.0, None, {}, followed=False).kind == "slow slip"
    assert CRITERION.outcome(0.051, None, {}, followed=False).kind == "earthquake"


def test_a_stable_fault_is_compared_with_its_own_swing_through_the_target():
    """ω_n·d_max = √(0.48)·0.785 m/s for the real fault."""
    criterion = OutcomeCriterion.of(STABLE, natural_peak(STABLE))
    assert criterion.natural_peak is OutcomeCriterion.of(STABLE, 0.0).natural_peak is None
    assert criterion.inertial_rate == pytest.approx(np.sqrt(30e9 / 2500 / 5000**2) * 0.785, rel=1e-12)
    tenth = criterion.inertial_rate / 10
    assert criterion.outcome(0.99 * tenth, 0.0, {}, followed=True).kind == "slow slip"
    assert criterion.outcome(1.01 * tenth, 0.0, {}, followed=True) == Outcome(
        kind="earthquake", peak_slip_rate=1.01 * tenth, share_of_natural=None
    )
    assert natural_earthquake(STABLE).outcome.kind == "slow slip"


def test_the_largest_reference_rate_is_that_of_a_fine_grid():
    stage = np.linspace(0, 1, 100_001)
    slip = REAL.reference.target_slip * REAL.reference.shape(stage)
    steepest = np.max(np.diff(slip)) / (REAL.reference.operation_time / 100_000)
    assert REAL.reference.largest_rate == pytest.approx(steepest, rel=1e-8)


def test_the_natural_earthquake_is_all_of_itself_and_an_induced_one_more():
    natural, induced = natural_earthquake(LAB), natural_earthquake(LAB, 1e4)
    assert (natural.outcome.kind, natural.outcome.share_of_natural) == ("earthquake", 1.0)
    assert induced.outcome.kind == "earthquake"
    ratio = induced.metrics.peak_slip_rate / natural.metrics.peak_slip_rate
    assert induced.outcome.share_of_natural == ratio > 1


def test_the_natural_peak_is_computed_once_for_a_fault_whatever_disturbs_it(monkeypatch):
    natural_peak(LAB)
    monkeypatch.setattr(memoryless_earthquake, "natural_earthquake", lambda *_, **__: pytest.fail("computed again"))
    shaken = LAB.with_disturbance(Disturbance(amplitude=1e-3, frequency=1.0)).with_box("ten-percent")
    for fault in (LAB, shaken):
        assert simulate(fault, published("lab-fault")["elqr"], duration=0.1).outcome.share_of_natural > 0


@pytest.mark.slow
def test_a_loop_that_is_sampled_too_slowly_for_its_instability_is_an_earthquake():
    """Certified gains, T_s = 0.1 s, unstable pole at 13 1/s; at a tenth of this T_s the same gains track.

    Within 100 s one such run of six escapes the earthquake, by the last digits of what it is computed from.
    """
    law = control_law("cta").from_values(("7", "5", "2.3", "1.1"), divisor="27/260000000").scaled("0.000136822")
    slow, fine = (simulate(UNDERSAMPLED, law, duration=200.0, step=step, plant="printed") for step in (0.1, 0.01))
    assert slow.outcome.kind == "earthquake"
    assert slow.outcome.share_of_natural == slow.metrics.peak_slip_rate / natural_peak(UNDERSAMPLED) > 0.5
    assert fine.outcome.kind == "tracked"


def test_a_loop_that_diverges_or_opens_says_so():
    law = published("real-fault")["elqr"]
    run = simulate(REAL, law, scheme="explicit", duration=400.0, plant="printed")
    assert run.outcome == Outcome(kind="diverged", peak_slip_rate=None, share_of_natural=None)
    sooner = simulate(REAL, law, scheme="explicit", duration=run.events["opening"] + 1, plant="printed")
    assert "diverged" not in sooner.events
    assert sooner.outcome.kind == "opened"


class Clipped(SampledController):
    """A law that cuts off its pressure itself and does not tell its states."""

    def pressure(self, signals):
        return sp.Max(-300000, sp.Min(300000, super().pressure(signals)))


def doubling(push):
    """Law of samples that asks for z Pa, z doubled at every sample from one metre of slip error on."""
    fed, none = ((F(push), F(0)),), (F(0), F(0))
    law = LinearLaw(states=("z",), update=((F(2),),), measured=fed, output=(F(1),), feedback=none)
    return Clipped(law=law, step=F("0.184"))


@pytest.mark.parametrize(("push", "kind"), [("1e12", "earthquake"), ("-1e12", "diverged")])
def test_an_earthquake_stays_one_where_the_numbers_of_the_law_overflow(push, kind):
    """What doubles is beyond 1e100 after 2^303, and the fault feels 0.3 MPa: pushed on it runs, held back it rests."""
    run = simulate(REAL, doubling(push), duration=100.0, initial_slip=1e-3, plant="stick-slip")
    assert run.outcome.kind == kind
    assert 290 < run.events["diverged"] / 0.184 < 340
    assert run.outcome.peak_slip_rate == run.metrics.peak_slip_rate
    peak = run.outcome.peak_slip_rate
    assert (peak > 0.1 * natural_peak(REAL)) is (kind == "earthquake")
    assert run.outcome.share_of_natural == peak / natural_peak(REAL)
    assert peak >= run.slip_rate.max() * (1 - 1e-9)
    assert run.metrics.max_pressure is None
    assert f"{kind}: peak slip rate" in outcome_sentence(run)
    assert outcome_sentence(run).endswith(f"floating-point overflow at {run.events['diverged']:.4g} s")


def test_every_file_of_a_run_holds_its_outcome():
    run = simulate(LAB, published("lab-fault")["elqr"], duration=0.1)
    assert json.loads(run.to_xarray().attrs["outcome"]) == run.outcome.to_dict()
    assert set(run.outcome.to_dict()) == {"kind", "peak_slip_rate", "share_of_natural"}


def test_a_campaign_counts_the_outcomes_of_its_samples():
    problem = campaign_problem(LAB, published("lab-fault")["elqr"], duration=0.1)
    natural, target = natural_peak(LAB), LAB.reference.target_slip
    figures = [
        {"peak_slip_rate": 1e-6, "max_slip_error": 0.01 * target},
        {"peak_slip_rate": natural / 2, "max_slip_error": 0.0},
        {"peak_slip_rate": 1e-6, "max_slip_error": 0.03 * target},
    ]
    results = [SampleResult(figures=found, events={}) for found in figures]
    results += [SampleResult(figures={}, events={"diverged": 0.1}), None]
    done = Campaign(problem=problem, results=tuple(results))
    assert [outcome and outcome.kind for outcome in done.outcomes] == [
        "tracked",
        "earthquake",
        "slow slip",
        "diverged",
        None,
    ]
    told = done.to_dict()["outcomes"]
    assert list(told) == list(KINDS)
    assert {kind: found["count"] for kind, found in told.items()} == {**dict.fromkeys(KINDS, 1), "opened": 0}
    assert done.to_pandas()["outcome [-]"].tolist()[:2] == ["tracked", "earthquake"]


def test_a_sample_of_a_campaign_comes_to_what_its_trajectory_comes_to():
    problem = campaign_problem(LAB, published("lab-fault")["elqr"], duration=0.05)
    run = problem.trajectory(problem.sample(0), 10)
    figures = {name: v for name, v in run.metrics.to_dict().items() if v is not None}
    assert problem.outcome(SampleResult(figures=figures, events=run.events)) == run.outcome
