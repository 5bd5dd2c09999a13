"""Quantiles and worst samples, with divergence and failures among them."""

import math

import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.laws import published
from quakedesign.simulation.campaign import Campaign, SampleResult, campaign_problem
from quakedesign.simulation.campaign.campaign_result import LEVELS, Failure, figure
from quakedesign.simulation.campaign.space import Worst

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
    import json

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
    with pytest.raises(ParameterError, match="metric must be one of none"):
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
    worst = Worst(metric=metric, value=3.0, sample=samples[1], index=1, looked_at=samples)
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
    with pytest.raises(ParameterError, match="index must be"):
        campaign([1.0]).trajectory(index)
