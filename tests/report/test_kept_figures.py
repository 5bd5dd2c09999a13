"""Figures kept on a disk: the same bytes as drawn, for the same that is shown, settings and words alone."""

import subprocess
import sys
from dataclasses import replace

import matplotlib as mpl
import pytest
from matplotlib.figure import Figure
from thinned import few

from quakedesign import cache
from quakedesign.fault import load_fault
from quakedesign.report import drawing as kept_figures
from quakedesign.report.drawing import cached_figures
from quakedesign.simulation import simulate


@pytest.fixture
def drawn(tmp_path, monkeypatch):
    """Names of the figures that were really drawn, with an empty cache."""
    monkeypatch.setenv(cache.PLACE, str(tmp_path / "kept"))
    names, draw = [], kept_figures.figure_bytes

    def counted(drawing, kind, name):
        names.append(name)
        return draw(drawing, kind, name)

    monkeypatch.setattr(kept_figures, "figure_bytes", counted)
    return names


def figures(shown, names=("one",)):
    """Of a value, how they are drawn."""

    def draw():
        made = {name: Figure(layout="constrained") for name in names}
        for drawing in made.values():
            upper, lower = drawing.subplots(2, 1, sharex=True)
            upper.plot([0.0, 1.0, 2.0], [1.0, 2.0, 3.0], label=str(shown)[:9])
            upper.legend()
            lower.semilogy([0.0, 1.0], [1e-6, 1e-3], "--")
        return made

    return draw


def once(shown=3.0, told="told", name="one"):
    return cached_figures(figures(shown, (name,)), {name: told}, shown)


def test_the_same_figure_is_drawn_once_and_has_the_bytes_of_its_drawing(drawn, monkeypatch):
    first, second = once(), once()
    assert first == second
    assert drawn == ["one"]
    monkeypatch.setenv(cache.PLACE, "off")
    assert once() == first
    assert drawn == ["one", "one"]


CHANGES = [{"shown": 3.0 + 1e-9}, {"told": "said"}, {"name": "two"}]


@few("changed", CHANGES, ids=[next(iter(change)) for change in CHANGES], every=3)
def test_what_shows_something_else_is_drawn(drawn, changed):
    once()
    once(**changed)
    assert len(drawn) == 2


@pytest.mark.slow
def test_how_long_it_took_and_how_it_was_computed_is_not_shown(drawn):
    run = simulate(load_fault("lab-fault"), duration=0.01, samples=5)
    for seconds, backend, step in ((1.0, "compiled", 1), (2.0, "virtual-machine", 1), (2.0, "compiled", 2)):
        told = {"backend": backend, "backend_reason": backend, "stepping_seconds": seconds, "step": step}
        once((replace(run, provenance=told, metrics=replace(run.metrics, seconds=seconds)),))
    assert len(drawn) == 2


def test_values_that_are_one_and_equal_ones_are_the_same(drawn):
    one = [1.5]
    once((one, one))
    once(([1.5], [1.5]))
    assert len(drawn) == 1


@pytest.mark.slow
def test_other_settings_are_drawn(drawn):
    once()
    with mpl.rc_context({"path.simplify": False}):
        once()
    assert len(drawn) == 2


@pytest.mark.slow
def test_other_fonts_are_drawn(drawn, monkeypatch):
    from matplotlib.font_manager import fontManager

    once()
    monkeypatch.setattr(fontManager, "ttflist", fontManager.ttflist[1:])
    once()
    assert len(drawn) == 2


def test_what_cannot_be_told_is_drawn_each_time(drawn):
    for _ in range(2):
        once(lambda: "no text says what this is")
    endless = []
    endless.append(endless)
    for _ in range(2):
        once(endless)
    assert len(drawn) == 4


@pytest.mark.slow
def test_what_draws_is_not_loaded_for_what_is_kept():
    code = "import sys; from quakedesign.report.drawing import _stated; _stated({}, 1); print(*sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert "matplotlib.font_manager" in found
    assert not {"matplotlib.figure", "matplotlib.pyplot"} & set(found)
