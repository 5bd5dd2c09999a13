"""Verdicts on made-up records: what is explained, what is not, and what a record cannot tell."""

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from thinned import few

from quakedesign.errors import ParameterError, RecordError
from quakedesign.fault import fault_toml, load_fault, parse_fault, with_accepted_fit
from quakedesign.identification.assessment import Check, _beginning, in_doubt, sign_check
from quakedesign.identification.fault_file import identified_fault, next_command, poor_fit, save_fault
from quakedesign.identification.identification_result import ParameterEstimate
from quakedesign.identification.identify import AGEING, SLIP, identify
from quakedesign.identification.record import Record
from quakedesign.report.identification_page import identification_lines
from quakedesign.synthesis import design, guarantee

SPECIFICATION = importlib.util.spec_from_file_location("synthetic_records", Path(__file__).with_name("synthetic.py"))
synthetic = importlib.util.module_from_spec(SPECIFICATION)
sys.modules[SPECIFICATION.name] = synthetic
SPECIFICATION.loader.exec_module(synthetic)
ONE = ((40.0, 1e-6), (30.0, 1e-5))


def record(made, seed=0, **changes):
    return replace(made.noisy(seed), **changes)


def step(a=0.012, b=0.008, seed=0, trend=0.0, **more):
    """One step up, on a trend [1/m]."""
    made = synthetic.sliding("rate-and-state-slip", ONE, sample=0.1, a=a, b=b, spring=3e-3, **more)
    return record(made, seed, friction=made.noisy(seed).friction + trend * made.load_point)


@pytest.fixture(scope="module")
def trended():
    """Stronger with rate, on a trend that without a name for it makes it weaker."""
    return identify(step(trend=-50.0), "rate-and-state-slip")


def test_a_trend_is_a_parameter_and_leaves_the_sign(trended):
    trend, difference = trended.estimates["trend"], trended.difference
    assert trend.low < -50 < trend.high
    assert trend.high - trend.low < 10
    assert 0 < difference.low < 0.004 < difference.high
    assert trended.assessment.verdict == "explains the record"
    lines = identification_lines(trended)
    assert "explains the record. Friction strengthens with rate: a - b = 0.00" in " ".join(map(str.strip, lines))
    assert "passed: a - b is positive" in " ".join(identification_lines(trended, verbose=True))
    assert next_command(trended, "file.toml").startswith("none is needed: friction strengthens with rate")
    assert len(lines) < 40
    assert max(map(len, lines)) <= 80


def test_a_record_without_a_trend_has_none_and_its_sign_holds_with_one():
    found = identify(step(a=0.008, b=0.012), "rate-and-state-slip")
    assert "trend" not in found.estimates
    (sign,) = [check for check in found.assessment.checks if check.name == "sign"]
    assert sign.passed
    assert "negative: friction weakens with rate, also with a trend in displacement (AIC" in sign.sentence
    assert poor_fit(found) == ""


@pytest.mark.slow
def test_a_sign_that_a_trend_turns_is_not_told():
    """A slip of one critical slip after the step: drift and evolution look alike."""
    made = synthetic.sliding(
        "rate-and-state-slip",
        ((5.0, 1e-6), (3.0, 1e-5)),
        sample=0.02,
        a=0.009,
        b=0.010,
        spring=3e-3,
        critical_slip=3e-5,
    )
    found = identify(record(made), "rate-and-state-slip")
    assert found.assessment.verdict == "cannot tell"
    text = " ".join(" ".join(identification_lines(found)).split())
    assert "cannot tell" in text
    assert "would decide:" in text
    assert not found.explained


@few("second", [(-0.004, 2e-4), (0.004, 4e-4)], every=2)
def test_slow_evolution_that_looks_like_a_trend_leaves_the_sign_open(second):
    """a - b - b_2 has the other sign than a - b: evolution follows the step, and the beginning has none."""
    plain = ((60.0, 1e-6), (40.0, 1e-5))
    made = synthetic.sliding(
        "rate-and-state-aging", plain, sample=0.1, a=0.01, b=0.01 - second[0] / 2, spring=3e-3, second=second
    )
    found = identify(made.noisy(7), "rate-and-state-aging")
    assert "trend" in found.estimates
    assert found.assessment.verdict == "cannot tell"
    assert "the trend may begin with the change of rate" in found.assessment.open[-1]


@pytest.mark.slow
def test_a_drift_that_dies_out_and_looks_like_an_unsteady_beginning_leaves_the_sign_open():
    made = synthetic.sliding("rate-and-state-slip", ONE, sample=0.1, a=0.010, b=0.008, spring=3e-3)
    drift = -0.02 * (1 - np.exp(-made.load_point / 4e-5))
    found = identify(record(made, 2, friction=made.noisy(2).friction + drift), "rate-and-state-slip")
    assert found.assessment.verdict == "cannot tell"
    assert "the beginning, of 2" in found.assessment.open[-1]


@pytest.mark.parametrize(
    ("low", "high", "shift", "passed"),
    [
        (0.001, 0.003, None, True),
        (0.001, 0.003, -0.0009, True),
        (0.001, 0.003, -0.0011, False),
        (-0.003, -0.001, 0.0009, True),
        (-0.003, -0.001, 0.0011, False),
        (-0.003, -0.001, -0.0011, True),
        (-0.003, 0.0, None, False),
    ],
)
def test_a_sign_must_hold_with_what_a_late_trend_adds(low, high, shift, passed):
    told = estimate_between(low, high)
    assert sign_check(told, {}, shift).passed == passed
    assert not sign_check(told, {}, shift, ": the beginning is not steady").passed


def test_a_fit_with_another_trend_counts_unless_it_is_worse_by_ten():
    told, other = estimate_between(0.001, 0.003), estimate_between(-0.003, -0.001)
    assert [in_doubt(9.9, None), in_doubt(10.0, None), in_doubt(10.0, 0.0)] == [True, False, True]
    check = sign_check(told, {"without a trend": (other, 9.9)})
    assert not check.passed
    told_both = "from 0.001 to 0.003 in the selected fit, from -0.003 to -0.001 without a trend (AIC +9.9)"
    assert check.sentence == f"the sign of a - b is open: {told_both}"
    agreeing = sign_check(told, {"with a trend in time": (estimate_between(0.002, 0.004), 1.0)})
    assert agreeing.passed
    assert agreeing.sentence.endswith("strengthens with rate, also with a trend in time (AIC +1)")
    assert sign_check(None, {}) is None


def estimate_between(low, high):
    value = (low + high) / 2
    return ParameterEstimate(name="a - b", unit="", value=value, low=low, high=high, least=low, most=high)


@pytest.mark.slow
def test_a_law_that_leaves_a_peak_is_said_not_to_explain():
    """Friction with a second, slower and negative effect, of which the fit knows nothing."""
    plain = step()
    moved = np.maximum(plain.load_point - 4e-5, 0)
    bump = 0.01 * np.exp(-((moved - 6e-5) ** 2) / (2 * 1.2e-5**2)) * (moved > 0)
    found = identify(replace(plain, friction=plain.friction + bump), "rate-and-state-slip")
    assert found.assessment.verdict == "does not explain the record"
    assert found.assessment.factor > 2
    assert not found.identified
    text = " ".join(" ".join(identification_lines(found)).split())
    assert "does not explain the record: residuals are" in text
    assert "try: --figure" in text


@pytest.mark.slow
def test_an_unsteady_beginning_is_fitted_and_told():
    made = synthetic.sliding("rate-and-state-slip", ((5.0, 3e-6), *ONE), sample=0.2, a=0.008, b=0.012)
    late = made.time >= 10.0
    cut = record(made)
    cut = replace(
        cut,
        **{n: getattr(cut, n)[late] for n in ("friction", "normal")},
        time=cut.time[late] - cut.time[late][0],
        load_point=cut.load_point[late] - cut.load_point[late][0],
    )
    found = identify(cut, "rate-and-state-slip", stiffness=made.stiffness)
    assert "start_state" in found.estimates
    assert found.estimates["evolution_effect"].low < 0.012 < found.estimates["evolution_effect"].high
    assert not next(check for check in found.assessment.checks if check.name == "beginning").passed


def test_an_effect_below_zero_is_told_and_no_fault_file_holds_it():
    """Radau on equations of its own, with b = -0.006."""
    found = identify(step(a=0.008, b=-0.006), "rate-and-state-slip")
    effect = found.estimates["evolution_effect"]
    assert effect.low < -0.006 < effect.high < 0
    with pytest.raises(RecordError, match=r"friction strengthens with rate and needs no control"):
        identified_fault(found, load_fault("crustal-patch"))


@pytest.mark.slow
def test_a_second_state_is_found_where_there_is_one():
    plain = step(a=0.012, b=0.008)
    after = np.maximum(plain.load_point - 4e-5, 0)
    slow = -0.004 * np.log(10) * (1 - np.exp(-after / 6e-5))  # of the slip law, behind a stiff spring
    changed = replace(plain, friction=plain.friction + slow)
    two = identify(changed, "rate-and-state-slip", states=2)
    assert two.estimates["second_effect"].low < 0.004 < two.estimates["second_effect"].high
    assert two.law.name == "rate-and-state-slip, two states"
    with pytest.raises(RecordError, match=r"Received two states\. Omit --states"):
        identified_fault(two, load_fault("crustal-patch"))
    with pytest.raises(RecordError, match="states must be 1 or 2"):
        identify(changed, states=3)


def test_a_failed_test_of_an_explained_record_is_said_below_the_verdict_and_in_the_file(trended, tmp_path):
    text = "the trend changes at the last step (4.2 standard deviations)"
    late = Check(name="halves", passed=False, value=1.05, limit=1.0, sentence=text)
    checks = tuple(late if check.name == "halves" else check for check in trended.assessment.checks)
    assert late in checks
    found = replace(trended, assessment=replace(trended.assessment, checks=checks))
    lines = identification_lines(found)
    assert f"{' '.join(map(str.strip, lines[: lines.index('')]))}".endswith(f" But {text}.")
    assert not [line for line in lines if line.startswith("not passed")]
    patch = load_fault("crustal-patch")
    weakening = replace(found, law=patch.friction)
    save_fault(weakening, patch, tmp_path / "found.toml")
    assert f"# Not passed: {text}.\n" in (tmp_path / "found.toml").read_text()


@pytest.mark.parametrize(
    ("record", "name"),
    [
        ("step 7, wet", "crustal-patch-identified-step-7"),
        ("übung", "crustal-patch-identified-bung"),
        ("µ", "crustal-patch-identified"),
        ("a" * 70, f"crustal-patch-identified-{'a' * 35}"),
    ],
)
def test_the_name_of_an_identified_fault_ends_in_that_of_the_record(trended, record, name):
    patch = load_fault("crustal-patch")
    found = replace(trended, record=replace(trended.record, name=record), law=patch.friction)
    assert identified_fault(found, patch).name == name


def test_a_poor_fit_is_designed_for_only_if_that_is_accepted(trended):
    patch = load_fault("crustal-patch")
    told = replace(trended.assessment, factor=3.1)
    poor = identified_fault(replace(trended, assessment=told, law=replace(patch.friction)), patch)
    assert poor.poor_fit == "the fit does not explain the record: residuals are 3.1 times the noise"
    assert parse_fault(fault_toml(poor), "poor") == poor
    assert "--accept-poor-fit" in next_command(replace(trended, assessment=told), "poor.toml")
    for asked in (design, guarantee):
        with pytest.raises(
            ParameterError, match=r"residuals are 3\.1 times the noise.*accept it with --accept-poor-fit"
        ):
            asked(poor, "elqr")
    accepted = with_accepted_fit(poor, True)
    assert accepted.name == "crustal-patch-identified-made-poor-fit"
    assert accepted.source.startswith("poor fit accepted (the fit does not explain the record")
    assert accepted.poor_fit == ""
    assert with_accepted_fit(patch, False) is patch


@pytest.mark.slow
def test_a_record_of_nothing_but_noise_tells_nothing():
    time = np.arange(0.0, 60.0, 0.1)
    friction = 0.6 + 3e-4 * np.random.default_rng(0).standard_normal(len(time))
    moved = 1e-6 * np.minimum(time, 30) + 1e-5 * np.maximum(time - 30, 0)
    flat = Record(
        name="flat",
        time=time,
        friction=friction,
        load_point=moved,
        slip=None,
        normal=np.full(len(time), 5e6),
        normal_unit="Pa",
    )
    found = identify(flat, "rate-and-state-slip")
    assert found.assessment.verdict == "cannot tell"


def test_a_trend_is_told_with_the_unit_of_what_it_is_along():
    said = _beginning({"trend": 5.0, "trend_in_time": 3e-6}, SimpleNamespace(first_rate=1e-6)).sentence
    assert said.endswith("at 1e-06 m/s, on a trend of 5 1/m, on a trend of 3e-06 1/s")


@few("seed", [1, 4], every=2)
def test_a_sign_that_the_other_law_does_not_have_is_open(seed):
    """A short step on a strong trend, which each law explains, with another sign of a - b; the truth is +0.0005."""
    made = synthetic.sliding(
        AGEING,
        ((200.0, 1e-6), (12.0, 1e-5)),
        sample=0.1,
        stiffness_given=False,
        a=0.006,
        b=0.0055,
        critical_slip=40e-6,
        spring=2e-3,
    )
    drawn = replace(made, noise=4e-4).noisy(seed)
    drawn = replace(drawn, friction=drawn.friction + 400 * drawn.load_point)
    found, alone = identify(drawn), {law: identify(drawn, law).difference for law in (AGEING, SLIP)}
    assert alone[AGEING].low > 0 > alone[SLIP].high
    assert found.rival.excess < 10
    assert found.assessment.verdict == "cannot tell"
    other = {AGEING: SLIP, SLIP: AGEING}[found.law.name]
    assert f"by {other} (AIC +{found.rival.excess:.3g})" in found.assessment.open[0]
