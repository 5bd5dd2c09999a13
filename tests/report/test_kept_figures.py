"""Figures kept on a disk: the same bytes as drawn, for the same contents, settings and words alone."""

import matplotlib as mpl
import pytest
from matplotlib.figure import Figure

from quakedesign import cache
from quakedesign.report import kept_figures
from quakedesign.report.kept_figures import drawn_once


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


def figure(last=3.0, label="slip [m]", width=2.0):
    made = Figure(layout="constrained")
    upper, lower = made.subplots(2, 1, sharex=True)
    upper.plot([0.0, 1.0, 2.0], [1.0, 2.0, last], linewidth=width, label=label)
    upper.legend()
    lower.semilogy([0.0, 1.0], [1e-6, 1e-3], "--")
    lower.set_xlabel("time [s]")
    return made


def test_the_same_figure_is_drawn_once_and_has_the_bytes_of_its_drawing(drawn, monkeypatch):
    first, second = (drawn_once(figure(), "one", "told") for _ in range(2))
    assert first == second
    assert drawn == ["one"]
    monkeypatch.setenv(cache.PLACE, "off")
    assert drawn_once(figure(), "one", "told") == first
    assert drawn == ["one", "one"]


CHANGES = [{"last": 3.0 + 1e-9}, {"label": "slip [mm]"}, {"width": 2.5}]


@pytest.mark.parametrize("changed", CHANGES, ids=[next(iter(change)) for change in CHANGES])
def test_another_figure_is_drawn(drawn, changed):
    for made in (figure(), figure(**changed)):
        drawn_once(made, "one", "told")
    assert len(drawn) == 2


def test_other_names_words_and_settings_are_drawn(drawn):
    for name, told in (("one", "told"), ("two", "told"), ("one", "said")):
        drawn_once(figure(), name, told)
    with mpl.rc_context({"path.simplify": False}):
        drawn_once(figure(), "one", "told")
    assert drawn == ["one", "two", "one", "one"]


def test_other_fonts_are_drawn(drawn, monkeypatch):
    from matplotlib.font_manager import fontManager

    drawn_once(figure(), "one", "told")
    monkeypatch.setattr(fontManager, "ttflist", fontManager.ttflist[1:])
    drawn_once(figure(), "one", "told")
    assert len(drawn) == 2


def test_what_cannot_be_told_is_drawn_each_time(drawn):
    for _ in range(2):
        made = figure()
        made.told = lambda: "no text says what this is"
        drawn_once(made, "one", "told")
    assert len(drawn) == 2
