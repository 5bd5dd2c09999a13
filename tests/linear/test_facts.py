"""Plain values about a given K."""

import json
from dataclasses import replace

import pytest

import quakedesign as qd
from quakedesign.linear.linear_problem import LinearProblem
from quakedesign.linear.sampled_stability import sampled_stability
from quakedesign.linear.verdict import linear_entries

LAB = qd.load_fault("lab-fault")


def facts_of(controller, step="1e-3"):
    held = sampled_stability(LinearProblem.of(LAB), tuple(controller.gains.values()), step)
    return json.loads(json.dumps(linear_entries(LAB, controller, held)))


@pytest.mark.slow
def test_the_facts_of_the_published_gains_can_be_written_as_json():
    facts = facts_of(qd.published("lab-fault")["elqr"])
    assert facts["held"]["verdict"] == "refuted"
    assert 0.6e-3 < facts["held"]["largest_step"] < 0.7e-3
    assert facts_of(qd.published("lab-fault")["elqr"], step="0.5e-3")["held"]["varying"] == "proved"


def test_a_destabilising_gain_has_facts_too():
    good = qd.published("lab-fault")["elqr"]
    facts = facts_of(replace(good, gains={n: -k for n, k in good.gains.items()}))
    assert facts["held"]["largest_step"] is None
