"""Searches from the disk: their finding saves time, and only time."""

from fractions import Fraction

import pytest

from quakedesign import cache
from quakedesign.fault import load_fault
from quakedesign.guarantees import NoProof, TrackingProof
from quakedesign.guarantees.search import linear_design as design
from quakedesign.guarantees.search import linear_design as longest_times
from quakedesign.guarantees.search import worst_case as adversary
from quakedesign.lyapunov import Verdict
from quakedesign.plant import uncertain_plant

STEP = Fraction("0.184")


@pytest.fixture(scope="module")
def task():
    return uncertain_plant(load_fault("real-fault"))


def test_what_a_search_proposes_is_decided_each_time(task, monkeypatch):
    """A search that is told to have found nonsense, and to have found it good."""

    def told(_search, *question):
        return [-1.0, question[-2]]

    monkeypatch.setattr(design, "search_once", told)
    longest = longest_times.longest_step(task)
    assert longest is None or longest.guarantee.check() is Verdict.PROVED
    found = design.design_sampled_law(task, STEP)
    assert isinstance(found, TrackingProof)
    assert found.check() is Verdict.PROVED
    monkeypatch.setattr(design, "search_once", lambda _search, *question: [-1.0, [-3.0 for _ in question[-2]]])
    assert longest_times.longest_step(task) is None
    found = design.design_sampled_law(task, STEP)
    assert isinstance(found, NoProof) or found.check() is Verdict.PROVED


@pytest.mark.slow
def test_a_design_is_searched_once(task, tmp_path, monkeypatch):
    monkeypatch.setenv(cache.PLACE, str(tmp_path / "kept"))
    first = design.design_sampled_law(task, STEP)
    near = design.closest(task, STEP)
    monkeypatch.setattr(design, "_search", None)
    again = design.design_sampled_law(task, STEP)
    assert design.closest(task, STEP).sampled_loop == near.sampled_loop
    assert (again, again.rest_limit) == (first, first.rest_limit)
    assert again.sampled_loop.law.applied == first.sampled_loop.law.applied != ()
    with pytest.raises(TypeError):
        design.closest(task, STEP / 2)
    worst = adversary.worst_tracking(first)
    monkeypatch.setattr(adversary, "_searched", None)
    assert adversary.worst_tracking(first) == worst
    with pytest.raises(TypeError):
        adversary.worst_tracking(first, sticks=True)
