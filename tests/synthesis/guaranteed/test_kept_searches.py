"""Searches from the disk: their finding saves time, and only time."""

from fractions import Fraction

import pytest

from quakedesign import cache
from quakedesign.certificates import Verdict
from quakedesign.certificates.guarantee import Guarantee, NoGuarantee, task_of
from quakedesign.fault import load_fault
from quakedesign.synthesis.guaranteed import adversary, design

STEP = Fraction("0.184")


@pytest.fixture(scope="module")
def task():
    return task_of(load_fault("real-fault"))


def test_what_a_search_proposes_is_decided_each_time(task, monkeypatch):
    """A search that is told to have found nonsense, and to have found it good."""

    def told(_search, *question):
        return [-1.0, question[-2]]

    monkeypatch.setattr(design, "search_once", told)
    found, _ = design.first_held(task, STEP)
    assert isinstance(found, Guarantee)
    assert found.check() is Verdict.PROVED
    monkeypatch.setattr(design, "search_once", lambda _search, *question: [-1.0, [-3.0 for _ in question[-2]]])
    found, _ = design.first_held(task, STEP)
    assert isinstance(found, NoGuarantee) or found.check() is Verdict.PROVED


def test_a_design_is_searched_once(task, tmp_path, monkeypatch):
    monkeypatch.setenv(cache.PLACE, str(tmp_path / "kept"))
    first = design.first_held(task, STEP)[0]
    monkeypatch.setattr(design, "_search", None)
    assert design.first_held(task, STEP)[0] == first
    with pytest.raises(TypeError):
        design.first_held(task, STEP / 2)
    worst = adversary.worst_found(first)
    monkeypatch.setattr(adversary, "_searched", None)
    assert adversary.worst_found(first) == worst
    with pytest.raises(TypeError):
        adversary.worst_found(first, sticks=True)
