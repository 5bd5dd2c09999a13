"""Several steps of one experiment: windows, the common fit and its test, against simulations of SciPy's."""

import importlib.util
import json
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

from quakedesign.errors import RecordError
from quakedesign.identification import record, several_steps
from quakedesign.identification.assessment import Assessment, Check
from quakedesign.identification.correlated_noise import CorrelatedNoise
from quakedesign.identification.identification_result import Identification, ParameterEstimate
from quakedesign.identification.record import part
from quakedesign.identification.several_steps import _assessed, _common, cut, identify_steps, read_steps
from quakedesign.report.identification_page import identification_lines, save_figure, steps_figure

SPECIFICATION = importlib.util.spec_from_file_location("synthetic_steps", Path(__file__).with_name("synthetic.py"))
synthetic = importlib.util.module_from_spec(SPECIFICATION)
sys.modules[SPECIFICATION.name] = synthetic
SPECIFICATION.loader.exec_module(synthetic)
UP, DOWN = ((15.0, 1e-6), (15.0, 1e-5)), ((10.0, 1e-5), (40.0, 1e-6))
MORE = {"sample": 0.25, "spring": 3e-3, "b": 0.012}


def step(pieces, seed, trend=0.0, **more):
    made = synthetic.sliding("rate-and-state-slip", pieces, **(MORE | more))
    noisy = replace(made.noisy(seed), name=f"step {seed}")
    return replace(noisy, friction=noisy.friction + trend * noisy.load_point)


@pytest.fixture(scope="module")
def agreeing():
    """Two steps of one rock on trends of their own; the stiffness is known."""
    records = [step(UP, 1, 40.0), step(DOWN, 2, -20.0)]
    return identify_steps(records, "rate-and-state-slip", stiffness=3e3 * synthetic.NORMAL)


def test_steps_of_one_rock_have_one_law_that_is_sharper_than_that_of_each(agreeing):
    assert agreeing.probability > 0.01
    assert agreeing.common.assessment.verdict == "explains the record"
    assert not {"trend", "trend (step 2)"} & set(agreeing.common.estimates)
    truth = {"direct_effect": 0.008, "evolution_effect": 0.012, "critical_slip": 1e-5}
    for name, value in truth.items():
        common = agreeing.common.estimates[name]
        assert common.least < value < common.most
        for one in agreeing.steps:
            own = one.estimates[name]
            assert common.high - common.low < own.high - own.low
    assert agreeing.common.difference.low < -0.004 < agreeing.common.difference.high


def test_the_size_of_shared_noise_is_known_from_its_pieces_in_all_steps(agreeing):
    """Noise that fades over 1 s of 40 s has 10 pieces, over 0.5 s of 60 s 30: F of 1 and 40 has 4.085 (tables)."""
    told = []
    for length, most, step in zip((1.0, 0.5), (40.0, 60.0), agreeing.steps, strict=True):
        along = np.linspace(0, most, len(step.fit.measured))
        noise = CorrelatedNoise(share=1e-9, length=length, along=along, counts=step.fit.counts, of_time=True)
        told.append(replace(step, fit=replace(step.fit, correlated=noise)))
    best = _common(told)[0]
    assert best.threshold(1) == pytest.approx(4.085, abs=1e-3)
    assert _common(agreeing.steps)[0].threshold(1) == pytest.approx(3.87, abs=0.01)


@pytest.mark.slow
def test_the_common_fit_of_a_step_and_itself_is_that_of_the_step(agreeing):
    """Twice the squares, the same parameters, and an F of nothing."""
    record = step(UP, 1, 40.0)
    twice = identify_steps([record, record], "rate-and-state-slip", stiffness=3e3 * synthetic.NORMAL)
    assert twice.probability == pytest.approx(1.0, abs=1e-6)
    for name in ("direct_effect", "evolution_effect", "critical_slip"):
        own, common = twice.steps[0].estimates[name], twice.common.estimates[name]
        assert common.value == pytest.approx(own.value, rel=1e-3)
        assert common.high - common.low == pytest.approx((own.high - own.low) / 2**0.5, rel=0.05)


@pytest.mark.slow
def test_steps_of_two_rocks_are_said_to_differ():
    records = [step(UP, 1), step(UP, 2, critical_slip=14e-6)]
    found = identify_steps(records, "rate-and-state-slip", stiffness=3e3 * synthetic.NORMAL)
    assert found.probability < 1e-6
    assert found.common.assessment.verdict == "cannot tell"
    (said,) = found.common.assessment.open
    assert said.startswith("one set of parameters does not explain all steps (p-value")
    assert said in " ".join(" ".join(identification_lines(found)).split())


def test_the_text_is_one_screen_with_a_row_a_step(agreeing):
    lines = identification_lines(agreeing)
    assert len(lines) <= 40
    assert max(map(len, lines)) <= 80
    text = "\n".join(lines)
    rows = [line.split() for line in lines if line[:1] in ("1", "2")]
    assert [row[0] for row in rows] == ["1", "2"]
    assert [row[-1] for row in rows] == [
        one.assessment.verdict.split()[-1].replace("record", "explains") for one in agreeing.steps
    ]
    assert [float(row[1]) for row in rows] == pytest.approx([0.008, 0.008], rel=0.1)
    assert "All steps jointly: one set of parameters explains all steps (p-value" in text
    assert len(identification_lines(agreeing, verbose=True)) > len(lines)


def test_facts_hold_every_step(agreeing):
    facts = json.loads(json.dumps(agreeing.to_dict()))
    assert [step["record"] for step in facts["steps"]] == ["step 1", "step 2"]
    assert facts["probability"] == agreeing.probability
    assert facts["parameters"]["direct_effect"]["identified"]


def test_the_figure_has_a_panel_a_step_with_both_fits_and_a_region_for_each(agreeing, tmp_path):
    drawing = steps_figure(agreeing)
    panels = [axis for axis in drawing.axes if axis.get_title()]
    assert [axis.get_title() for axis in panels] == ["1: step 1", "2: step 2"]
    for axis, one in zip(panels, agreeing.steps, strict=True):
        common = next(line for line in axis.lines if line.get_label() == "common fit")
        assert np.max(np.abs(common.get_ydata() - one.fit.measured)) < 6 * one.fit.noise
    (region,) = [axis for axis in drawing.axes if axis.get_xlabel().startswith("direct_effect")]
    assert [text.get_text() for text in region.get_legend().get_texts()] == ["1", "2", "all"]
    save_figure(agreeing, tmp_path / "steps.png")
    assert (tmp_path / "steps.png").read_bytes().startswith(b"\x89PNG")


def stub(sign=0, passed=True, factor=1.0, law="", excess=0.0, record=None):
    """Identification of a step by its sign of a - b, residuals over noise, law and by how much its rival is worse."""
    check = Check(name="sign", passed=passed, value=float(sign), limit=0.0, sentence="")
    return Mock(
        spec=Identification,  # as the check of arguments asks, once Steps was loaded by its public name
        assessment=Assessment(checks=(check,), factor=factor),
        fit=SimpleNamespace(correlation=2.0),
        law=SimpleNamespace(name=law),
        rival=SimpleNamespace(law={"one": "other", "other": "one"}[law], excess=excess) if law else None,
        record=record,
        notes=(),
    )


@pytest.mark.parametrize(
    ("signs", "ends", "reason"),
    [
        ([(-1, True), (1, False)], (-3, -1), ""),
        ([(-1, False), (-1, False)], (-3, -1), "no step alone determines it"),
        ([(-1, True), (1, True)], (-3, -1), "the steps disagree"),
        ([(-1, True), (-1, True)], (-3, 1), "from -3 to 1"),
        ([(1, True), (1, True)], (-3, -1), "the steps disagree"),
    ],
)
def test_a_sign_needs_a_step_that_has_it_none_against_it_and_the_common_fit(signs, ends, reason):
    difference = ParameterEstimate(
        name="a - b", unit="", value=sum(ends) / 2, low=ends[0], high=ends[1], least=ends[0], most=ends[1]
    )
    common = SimpleNamespace(difference=difference, undetermined=lambda: (), experiments=lambda sign: ())
    told = _assessed(common, [stub(*each) for each in signs], 0.5)
    assert [check.passed for check in told.checks] == [True, not reason]
    assert told.open == ((f"the sign of a - b is open: {reason}",) if reason else ())
    assert told.verdict == ("cannot tell" if reason else "explains the record")
    told = _assessed(common, [stub(-1), stub(-1, factor=3.0)], 0.5)
    assert told.verdict == "does not explain the record"


@pytest.mark.parametrize(("tabulated", "probability", "verdict"), [(3.098, 0.05, "explains"), (4.94, 0.01, "cannot")])
def test_the_chance_is_that_of_tables_of_f_and_the_law_is_the_likeliest_of_all_steps(
    monkeypatch, agreeing, tabulated, probability, verdict
):
    """F of 3 and 20 degrees of freedom; squares count by the samples for an independent one, here 2."""
    asked = []

    def fitted(record, kinds, **_):
        asked.append([kind.name for kind in kinds])
        first = len(asked) == 1
        law = "one" if first or len(kinds) == 1 else "other"
        return stub(law=law, excess=10.0 if first else 4.0, record=record)

    best = SimpleNamespace(pieces=20.0, measured=np.ones(9), experiment=None)
    common, record = replace(agreeing.common, difference=None), agreeing.steps[0].record
    monkeypatch.setattr(several_steps, "kinds_of", lambda *_: [SimpleNamespace(name=n) for n in ("other", "one")])
    monkeypatch.setattr(several_steps, "identified_as", fitted)
    monkeypatch.setattr(several_steps, "_common", lambda steps: (best, ["a", "b", "D_c"], 2 * 3 * tabulated))
    monkeypatch.setattr(several_steps, "profiled", lambda *_: common)
    found = identify_steps([record] * 2)
    assert asked == [["other", "one"], ["other", "one"], ["one"]]
    assert [each.law.name for each in found.steps] == ["one", "one"]
    assert found.probability == pytest.approx(probability, rel=0.01)
    assert found.common.assessment.verdict.startswith(verdict)


@pytest.mark.slow
def test_a_stiffness_is_shared_only_where_every_step_has_one():
    """Slip weakening behind a spring, then at measured slip."""
    records = [made(samples=80).noisy(0) for made in (synthetic.drawn, synthetic.weakening)]
    found = identify_steps(records, "exponential-slip-weakening", trend="none")
    assert set(found.common.estimates) == {"residual", "drop", "critical_slip"}
    for name, value in synthetic.weakening().truth.items():
        assert found.common.estimates[name].least < value < found.common.estimates[name].most


def test_a_record_is_cut_midway_between_changes_of_rate_and_no_sample_counts_twice():
    made = synthetic.sliding("rate-and-state-slip", synthetic.STEPS).noisy(0)
    parts = cut(made)
    assert [each.name for each in parts] == ["made, step 1", "made, step 2", "made, step 3"]
    assert parts[1].friction.tolist() == made.friction[(made.time >= 27.5) & (made.time < 47.5)].tolist()
    assert [each.origin for each in parts] == pytest.approx([0.0, 27.5, 47.5], abs=0.21)
    assert sum(len(each.time) for each in parts) == len(made.time)
    assert all(each.time[0] == each.load_point[0] == 0 for each in parts)
    numbers = np.arange(len(made.time))
    half = part(replace(made, counts=numbers + 1.0, load_rates=numbers * 2.0), numbers > 9, "half")
    assert (half.counts[0], half.load_rates[0], half.slip, len(half.normal)) == (11.0, 20.0, None, len(numbers) - 10)
    with pytest.raises(RecordError, match=r"must have two changes of rate by over 25 %. Received 1. Name the windows"):
        cut(step(UP, 0))


def test_a_file_with_windows_is_read_once(tmp_path, monkeypatch):
    path = tmp_path / "run.csv"
    path.write_text("\n".join(["time [s], friction", *(f"{t}, {0.6 + 0.001 * (t % 3)}" for t in range(9))]))
    monkeypatch.setattr(record, "read_columns", Mock(side_effect=record.read_columns))
    assert [len(each.time) for each in read_steps(path, "0 s to 2 s, 3 s to 4 s, 5 s to 8 s")] == [3, 2, 4]
    assert record.read_columns.call_count == 1


def test_windows_of_a_file_are_steps(tmp_path):
    path = tmp_path / "run.csv"
    rows = [f"{t}, {2 * t}, {0.6 + 0.001 * (t % 3)}" for t in range(40)]
    path.write_text("\n".join(["time [s], load_point_displacement [um], friction", *rows]))
    first, second = read_steps(path, "0 s to 9 s, 19 um to 40 um")
    assert (first.name, len(first.time), second.origin) == ("run 0 s to 9 s", 10, 10.0)
    assert [len(record.time) for record in read_steps(path, end="9 s")] == [10]
    assert [len(record.time) for record in read_steps(path, "0 s to 9 s, 9 s to 20 s")] == [10, 11]
    with pytest.raises(RecordError, match=r"must not overlap. Received 3 samples of 7 s to 30 s twice"):
        read_steps(path, "0 s to 9 s, 7 s to 30 s")
    with pytest.raises(RecordError, match=r"one unit in all steps. Received 1/m, Pa/m. Use stresses in every step"):
        identify_steps([replace(first, normal_unit="Pa"), second])
    with pytest.raises(RecordError, match=r"must name windows as 0 s to 60 s, 60 s to 120 s. Received '0 s-9 s'"):
        read_steps(path, "0 s-9 s")
    with pytest.raises(RecordError, match=r"--from and --to are for one window. Received them with --steps"):
        read_steps(path, "0 s to 9 s", begin="1 s")
    with pytest.raises(RecordError, match=r"a common fit must have at least 2 records. Received 1. Use identify"):
        identify_steps([first])
