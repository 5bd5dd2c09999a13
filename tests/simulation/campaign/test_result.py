"""Quantiles and worst samples, with divergence and failures among them."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.laws import published
from quakedesign.simulation.campaign import Campaign, SampleResult, campaign_problem
from quakedesign.simulation.campaign.campaign_result import LEVELS, Failure, figure, metric_names, severity
from quakedesign.simulation.campaign.space import WorstSample

PROBLEM = campaign_problem(load_fault("lab-fault"), published("lab-fault")["elqr"], duration=0.1)
RANDOM = np.random.default_rng(0)


def result(value):
    if value is None:
        return SampleResult(figures={}, events={"diverged": 0.1})
    return SampleResult(figures={"max_slip_error": value, "min_pressure": -value}, events={})


def campaign(values, **more):
    found = [None if value is math.nan else result(value) for value in values]
    return Campaign(problem=PROBLEM, results=tuple(found), **more)


@pytest.mark.parametrize("count", [1, 2, 19, 20, 100])
def test_quantiles_are_those_of_the_inverse_distribution_function(count):
    values = RANDOM.lognormal(size=count).tolist()
    found = campaign(values).quantiles()
    oracle = np.quantile(values, LEVELS, method="inverted_cdf")
    assert list(found["max_slip_error"].values()) == oracle.tolist()
    assert list(found["min_pressure"].values()) == (-oracle).tolist()


def test_diverged_samples_are_the_worst_and_quantiles_say_so():
    found = campaign([3.0, None, 1.0, math.nan, 2.0])
    assert found.worst("max_slip_error") == found.worst("min_pressure") == [1, 0, 4, 2]
    levels = found.quantiles((0.5, 0.75, 1.0))
    assert levels["max_slip_error"] == {"0.5": 2.0, "0.75": 3.0, "1": None}
    assert levels["min_pressure"] == {"0.5": -2.0, "0.75": -3.0, "1": None}
    assert found.events["diverged"] == [1]
    told = found.to_dict()["worst"]["max_slip_error"][0]
    assert (told["index"], told["value"], told["sample"]) == (1, None, PROBLEM.sample(1).numbers)


def test_the_answer_has_the_promised_keys_and_is_json():
    failure = Failure(samples=("3",), reason="a worker died")
    answer = campaign([3.0, None, 1.0, math.nan], failures=(failure,), resumed=2).to_dict()
    assert {"samples", "worst", "quantiles", "failures", "resumed"} <= set(answer)
    assert json.loads(json.dumps(answer, allow_nan=False))["failures"] == [
        {"samples": ["3"], "reason": "a worker died"}
    ]
    assert (answer["samples"], answer["resumed"]) == (4, 2)


def test_nothing_but_divergence():
    found = campaign([None, None])
    assert found.to_dict()["quantiles"] == {}
    assert found.to_dict()["events"]["diverged"]["count"] == 2
    with pytest.raises(ParameterError, match="has no value, since all runs diverged"):
        found.values("max_slip_error")
    assert found.plot().axes


def test_the_table_has_units_and_all_samples():
    table = campaign([3.0, None, 1.0, math.nan]).to_pandas()
    assert table["max_slip_error [m]"].tolist()[:3] == [3.0, math.inf, 1.0]
    assert math.isnan(table["max_slip_error [m]"][3])
    assert table["phase [rad]"][2] == PROBLEM.sample(2).numbers["phase"]


def test_the_figure_shows_the_share_of_all_samples():
    axis = campaign([1.0, 2.0, None, 100.0]).plot().axes[0]
    heights = axis.lines[0].get_ydata()
    assert heights.tolist() == [0.25, 0.5, 0.75]
    assert axis.get_xscale() == "log"
    assert "[m]" in axis.get_xlabel()


def test_the_figure_marks_the_quantiles_of_all_samples():
    values = RANDOM.lognormal(size=40).tolist()
    marks = [line.get_xdata()[0] for line in campaign(values).plot().axes[0].lines[1:]]
    assert marks == np.quantile(values, (0.05, 0.5, 0.95), method="inverted_cdf").tolist()
    assert len(campaign([1.0, None]).plot().axes[0].lines) == 3  # of 0.95 there is no value to mark


@pytest.mark.parametrize("levels", [(-0.1,), (0.5, 1.1), (math.nan,), (math.inf,)])
def test_a_level_is_a_share(levels):
    with pytest.raises(ParameterError, match=r"level of a quantile must be between 0 and 1"):
        campaign([1.0, 2.0]).quantiles(levels)


def test_as_many_of_the_worst_as_wanted():
    found = campaign([float(i) for i in range(9)])
    assert found.worst("max_slip_error") == [8, 7, 6, 5, 4]
    assert found.worst("max_slip_error", 2) == [8, 7]


def test_a_metric_counts_where_the_run_has_ended_in_time():
    early = SampleResult(figures={"peak_slip_rate": 3.0}, events={"diverged": 0.1})
    whole = SampleResult(figures={"max_slip_error": 1.0}, events={})
    assert metric_names([early]) == ()
    assert metric_names([early, whole]) == ("max_slip_error",)
    table = [(early, "peak_slip_rate"), (whole, "peak_slip_rate"), (early, "max_slip_error"), (whole, "max_slip_error")]
    assert [severity(*entry) for entry in table] == [math.inf, math.inf, math.inf, 1.0]


def test_a_metric_that_there_is_not():
    with pytest.raises(ParameterError, match="has no value, since all runs diverged"):
        campaign([None]).values("max_slip_error")
    for wrong in (campaign([1.0, None]).values, campaign([1.0, None]).worst):
        with pytest.raises(ParameterError, match=r"metric must be one of max_slip_error, min_pressure\. Received 'spe"):
            wrong("speed")


def test_a_campaign_is_shown_without_its_samples():
    assert repr(campaign([1.0])).startswith("Campaign(failures=()")


@pytest.mark.parametrize(("count", "places"), [(0, 3), (1, 3), (3, 3), (4, 6), (6, 6), (7, 9)])
def test_a_figure_has_rows_of_three_and_hides_what_is_left(count, places):
    axes = figure("title", "caption", {f"{i} [m]": (np.array([1.0, 2.0]), {}) for i in range(count)}).axes
    assert (len(axes), sum(axis.get_visible() for axis in axes)) == (places, count)


def test_a_campaign_has_resumed_nothing_unless_told():
    found = campaign([1.0])
    assert (found.to_dict()["resumed"], found.seconds, found.to_dict()["search"]) == (0, 0.0, None)


@pytest.mark.parametrize(("metric", "sign"), [("max_slip_error", 1), ("min_pressure", -1)])
def test_what_the_search_found_is_told_with_its_sign(metric, sign):
    samples = PROBLEM.sample(0), PROBLEM.sample(1)
    worst = WorstSample(metric=metric, value=3.0, sample=samples[1], index=1, looked_at=samples)
    told = campaign([1.0], search=worst).to_dict()["search"]
    assert (told["value"], told["index"], told["looked_at"]) == (3.0 * sign, "search-1", 2)
    assert told["sample"] == samples[1].numbers


def test_every_sample_has_its_outcome_and_five_are_named():
    found = campaign([None] * 7 + [math.nan])
    told = found.to_dict()
    assert [outcome and outcome.kind for outcome in found.outcomes] == ["diverged"] * 7 + [None]
    assert {kind: len(which) for kind, which in found.kinds.items() if which} == {"diverged": 7}
    assert told["outcomes"]["diverged"] == told["events"]["diverged"] == {"count": 7, "first": [0, 1, 2, 3, 4]}


@pytest.mark.parametrize("index", ["7", "search-0", "search-x"])
def test_a_sample_of_the_search_that_there_is_not(index):
    with pytest.raises(ParameterError, match="index must be a whole number, since there was no search"):
        campaign([1.0]).trajectory(index)


def test_a_sample_is_run_again_by_its_index(monkeypatch):
    monkeypatch.setattr(type(PROBLEM), "trajectory", lambda _, sample, samples: (sample, samples))
    looked_at = tuple(PROBLEM.sample(i) for i in (5, 6))
    found = campaign(
        [1.0], search=WorstSample(metric="x", value=3.0, sample=looked_at[1], index=1, looked_at=looked_at)
    )
    assert found.trajectory(3) == (PROBLEM.sample(3), 2000)
    assert [found.trajectory(f"search-{i}", 20) for i in (0, 1)] == [(sample, 20) for sample in looked_at]
    for index in ("1", "search-2", "search--1", "search-"):
        with pytest.raises(ParameterError, match=r"or search-0 … search-1\. Received"):
            found.trajectory(index)


def test_the_table_of_one_sample_has_outcomes_and_dimensionless_metrics():
    found = Campaign(problem=PROBLEM, results=(SampleResult(figures={"time_at_rest_fraction": 0.5}, events={}),))
    table = found.to_pandas()
    assert table["time_at_rest_fraction [-]"].tolist() == [0.5]
    outcomes = campaign([None, math.nan]).to_pandas()["outcome [-]"]
    assert outcomes[0] == "diverged"
    assert outcomes.isna().tolist() == [False, True]


def test_files_of_a_campaign_are_json_a_table_and_figures(tmp_path, monkeypatch):
    found = campaign([1.0, None])
    found.save(tmp_path, figures={"own.svg": b"drawn"})
    assert {path.name for path in tmp_path.iterdir()} == {"results.json", "samples.csv", "own.svg"}
    text = (tmp_path / "results.json").read_text()
    assert json.loads(text) == found.to_dict()
    assert text.endswith("}\n")
    assert (tmp_path / "own.svg").read_bytes() == b"drawn"
    monkeypatch.setattr(Campaign, "plot", lambda _: Figure())
    found.save(str(tmp_path))
    assert (tmp_path / "distribution.png").read_bytes().startswith(b"\x89PNG")


def test_what_json_cannot_hold_is_not_written(tmp_path, monkeypatch):
    monkeypatch.setattr(Campaign, "to_dict", lambda _: {"samples": math.nan})
    with pytest.raises(ValueError, match="not JSON compliant"):
        campaign([1.0]).save(tmp_path, figures={})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("values", "scale"),
    [
        ([math.inf, math.nan], "linear"),
        ([0.0, 31.0], "linear"),
        ([-1.0, 40.0], "linear"),
        ([1.0, 30.0], "linear"),
        ([2.0, 50.0], "linear"),
        ([1.0, 20.0], "linear"),
        ([1.0, 31.0], "log"),
        ([0.01, 0.45], "log"),
    ],
)
def test_positive_values_of_more_than_a_decade_and_a_half_have_a_logarithmic_axis(values, scale):
    axis = figure("title", "caption", {"x [m]": (np.array(values), {})}).axes[0]
    assert axis.get_xscale() == scale


@pytest.mark.parametrize(("size", "power"), [(0.02, "\N{MINUS SIGN}2"), (0.2, None), (2e3, None), (2e4, "4")])
def test_very_small_and_very_large_numbers_share_their_power_of_ten(size, power):
    axis = figure("title", "caption", {"x [m]": (size * np.linspace(1, 3, 9), {})}).axes[0]
    shown = axis.xaxis.get_major_formatter()
    shown.set_locs(axis.get_xticks())
    assert shown.get_offset() == "" if power is None else f"10^{{{power}}}" in shown.get_offset()


@pytest.mark.parametrize("end", [0.9, 1.0, 1.3, 2.0, 5.0, 9.0])
def test_an_axis_has_four_ticks_at_most(end):
    axis = figure("title", "caption", {"x [m]": (np.linspace(0, end, 9), {})}).axes[0]
    low, high = axis.get_xlim()
    assert sum(low <= tick <= high for tick in axis.get_xticks()) <= 4


def test_a_panel_says_what_it_shows_and_where_its_marks_lie():
    values, marks = np.linspace(0, 10, 11), {0.05: 0.5, 0.5: 5.0, 0.95: 9.5, 1.0: None}
    drawn = figure("law", "scheme", {f"{i} [m]": (values, marks) for i in range(4)})
    axis = drawn.axes[0]
    assert (drawn.get_suptitle(), drawn.get_supxlabel()) == ("law", "scheme")
    assert [axis.get_ylabel() for axis in drawn.axes[:4]] == ["share of samples [-]", "", "", "share of samples [-]"]
    assert axis.get_shared_y_axes().joined(axis, drawn.axes[3])
    assert axis.xaxis.get_gridlines()[0].get_visible()
    low, high = axis.get_ylim()
    assert low == 0
    assert 1 < high < 1.1
    assert [(text.get_text(), text.xy) for text in axis.texts] == [
        ("5 %", (0.5, 0.05)),
        ("50 %", (5.0, 0.5)),
        ("95 %", (9.5, 0.95)),
    ]
    assert [text.get_ha() for text in axis.texts] == ["left", "left", "right"]  # away from the ends of the axis
    assert [np.sign(text.xyann[0]) for text in axis.texts] == [1, 1, -1]  # and clear of the line
    assert figure("", "", {}).get_size_inches()[1] < drawn.get_size_inches()[1]


def test_the_share_of_one_sample_is_all():
    assert figure("", "", {"x [m]": (np.array([3.0]), {})}).axes[0].lines[0].get_ydata().tolist() == [1.0]


@pytest.mark.parametrize(("law", "title"), [(PROBLEM.controller, "e-LQR"), (None, "no control")])
def test_the_figure_names_the_law_and_what_diverges(law, title):
    found = replace(campaign([0.5, None]), problem=replace(PROBLEM, controller=law))
    drawn = found.plot()
    assert drawn.get_suptitle().endswith("2 samples, 1 diverge")
    assert title in drawn.get_suptitle()
    bare = Campaign(problem=PROBLEM, results=(SampleResult(figures={"rms_pressure": 1.0}, events={}),))
    assert bare.plot().axes[0].get_xlabel() == "rms pressure [Pa]"
