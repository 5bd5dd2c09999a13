"""Several steps of one experiment: windows, the common fit and its test, against simulations of SciPy's."""

import importlib.util
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from quakedesign.errors import RecordError
from quakedesign.identification.several_steps import cut, identify_steps, read_steps
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
    assert said.startswith("one set of parameters does not explain all steps (chance")
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
    assert "All together: one set of parameters explains all steps (chance" in text
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


def test_a_record_is_cut_midway_between_changes_of_rate_and_no_sample_counts_twice():
    made = synthetic.sliding("rate-and-state-slip", synthetic.STEPS).noisy(0)
    parts = cut(made)
    assert [part.name for part in parts] == ["made, step 1", "made, step 2", "made, step 3"]
    assert [part.origin for part in parts] == pytest.approx([0.0, 27.5, 47.5], abs=0.21)
    assert sum(len(part.time) for part in parts) == len(made.time)
    assert all(part.time[0] == part.load_point[0] == 0 for part in parts)
    with pytest.raises(RecordError, match=r"must have two changes of rate by a quarter. Received 1. Name the windows"):
        cut(step(UP, 0))


def test_windows_of_a_file_are_steps(tmp_path):
    path = tmp_path / "run.csv"
    rows = [f"{t}, {2 * t}, {0.6 + 0.001 * (t % 3)}" for t in range(40)]
    path.write_text("\n".join(["time [s], load_point_displacement [um], friction", *rows]))
    first, second = read_steps(path, "0 s to 9 s, 19 um to 40 um")
    assert (first.name, len(first.time), second.origin) == ("run 0 s to 9 s", 10, 10.0)
    assert [len(record.time) for record in read_steps(path, end="9 s")] == [10]
    with pytest.raises(RecordError, match=r"must name windows as 0 s to 60 s, 60 s to 120 s. Received '0 s-9 s'"):
        read_steps(path, "0 s-9 s")
    with pytest.raises(RecordError, match=r"--from and --to are for one window. Received them beside --steps"):
        read_steps(path, "0 s to 9 s", begin="1 s")
    with pytest.raises(RecordError, match=r"several steps must be at least 2. Received 1. Use identify for one"):
        identify_steps([first])
