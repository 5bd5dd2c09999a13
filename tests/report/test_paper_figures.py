"""The paper's figures: units and origin on every one, bars that are the errors of the runs, one folder or none."""

import csv
import itertools
import re
from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

import quakedesign as qd
from quakedesign.errors import OutputError
from quakedesign.exact import UpperBound
from quakedesign.fault import Reference
from quakedesign.lyapunov import Verdict
from quakedesign.report import Comparison
from quakedesign.report.drawing import band, clock, colour, run_settings, scaled
from quakedesign.report.folder import study_results, write_folder
from quakedesign.report.paper_figures import PAPER, PaperStudy, paper_figures, paper_study
from quakedesign.report.tables import csv_text
from quakedesign.report.terminal import printed_lines
from quakedesign.simulation import Metrics, natural_earthquake
from quakedesign.studies import Entry
from quakedesign.studies.paper import BARS, baseline, printed, relative, table
from quakedesign.synthesis import Design

EVERY = 2001
"""More samples than steps, so that a run keeps all of them."""


def entry(fault, controller, origin):
    design = Design(
        fault=fault,
        name=controller.name,
        verdict=Verdict.UNDECIDED,
        controller=controller,
        certificate=None,
        premises=(),
    )
    run = qd.simulate(fault, controller, samples=EVERY)
    return Entry(label=f"{controller.title} ({origin})", origin=origin, design=design, run=run)


@pytest.fixture(scope="module")
def study(kept):
    """The laboratory fault with a task of 2 s; the published 2-CTA plays the designed one too."""
    fault = qd.load_fault("lab-fault")
    fault = replace(fault, reference=Reference(target_slip=1e-4, operation_time=2.0))
    laws = qd.published("lab-fault")
    entries = [entry(fault, laws[name], "published") for name in ("cta", "elqr")]
    entries.append(entry(fault, laws["cta"], "designed"))
    return paper_study(Comparison(fault=fault, uncontrolled=natural_earthquake(fault), entries=tuple(entries)))


@pytest.mark.slow
def test_the_front_shows_what_was_seen_over_what_is_guaranteed(study):
    """Two made up designs, whose guaranteed slip-rate errors are 200 and 300 µm/s."""
    runs = [e.run for e in study.comparison.entries[:2]]
    front = tuple(
        SimpleNamespace(
            objective=name, run=run, guarantee=SimpleNamespace(claims=SimpleNamespace(slip_rate_error=UpperBound(rate)))
        )
        for name, run, rate in zip(
            ("peak", "tracking, 1.6 times the least slip-rate error"), runs, ("2e-4", "3e-4"), strict=True
        )
    )
    drawing = paper_figures(replace(study, front=front))["peak-against-tracking"]
    assert "peak-against-tracking" not in study.figures()
    for axis, metric in zip(drawing.axes, ("max_slip_error", "max_slip_rate_error"), strict=True):
        across, up = axis.lines[0].get_data()
        assert list(across) == pytest.approx([200, 300])
        seen = [getattr(run.metrics, metric) for run in runs]
        assert np.asarray(up) / up[0] == pytest.approx(np.array(seen) / seen[0])
        assert "µm/s]" in axis.get_xlabel()
        assert [text.get_text() for text in axis.texts] == ["peak", "1.6"]


def caption(drawing):
    """The line below a figure."""
    return drawing.texts[-1].get_text().replace("\n", " ").replace("\N{NO-BREAK SPACE}", " ")


def test_every_figure_of_the_paper_that_shows_a_simulation_is_drawn(study):
    assert set(PAPER) <= set(study.figures())
    assert set(study.figures()) - set(PAPER) == {"overview", "errors", "metrics"}


def test_every_axis_has_a_unit_and_every_figure_says_how_it_was_made(study):
    for name, drawing in study.figures().items():
        for axis in drawing.axes:
            labels = axis.get_xlabel() + axis.get_ylabel()
            assert "[" in labels or not axis.axison, name
        if name != "friction-law":
            made_with = r"scheme continuous, step \d\S* s, method dormand-prince, stick-slip plant"
            assert re.search(made_with, caption(drawing)), name


def test_letters_can_be_read_in_print(study):
    for drawing in study.figures().values():
        shown = [t for axis in drawing.axes for t in (axis.xaxis.label, axis.yaxis.label, axis.title) if t.get_text()]
        assert {t.get_fontsize() for t in shown} == {8}
        assert drawing.get_figwidth() == pytest.approx(7.16)  # two columns of a journal page [in]


def test_nothing_below_a_figure_overlaps(study):
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    for name in ("states", "errors", "friction-coefficient"):
        drawing = study.figures()[name]
        canvas = FigureCanvasAgg(drawing)
        canvas.draw()
        renderer, told, (legend,) = canvas.get_renderer(), drawing.texts[-1], drawing.legends
        axes = min(axis.get_tightbbox(renderer).y0 for axis in drawing.axes)
        assert told.get_window_extent(renderer).y1 <= legend.get_window_extent(renderer).y0
        assert legend.get_window_extent(renderer).y1 <= axes
        assert told.get_window_extent(renderer).x0 >= 0


def lab(rgb):
    """CIE L*a*b* (D65) of linear RGB."""
    matrix = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    x, y, z = np.cbrt(np.array(matrix) @ np.clip(rgb, 0, 1) / [0.9505, 1, 1.089])
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


SEEN = {
    "all": np.eye(3),
    # Machado, Oliveira and Fernandes 2009, severity 1
    "no red": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "no green": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "no blue": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}


@pytest.mark.parametrize("vision", SEEN)
def test_laws_are_told_apart_with_every_common_kind_of_colour_vision(vision):
    shown = [
        lab(SEEN[vision] @ np.array([(int(colour(name)[i : i + 2], 16) / 255) ** 2.2 for i in (1, 3, 5)]))
        for name in ("cta", "dia", "elqr")
    ]
    # 2.3 is just noticeable
    assert all(np.linalg.norm(a - b) > 15 for a, b in itertools.combinations(shown, 2))


def test_a_law_has_the_same_colour_in_every_figure(study):
    from matplotlib.colors import same_color

    found = []
    for name in ("errors", "friction-coefficient"):
        found += [line.get_color() for line in study.figures()[name].axes[0].lines if "CTA" in line.get_label()]
    found += [axis.collections[0].get_facecolor()[0][:3] for axis in study.figures()["pressure"].axes[:1]]
    assert len(found) == 5
    assert all(same_color(shade, colour("cta")) for shade in found)


def test_bars_are_the_errors_of_the_runs_over_those_of_the_published_linear_law(study):
    first, basis = study.comparison.entries[0].run, study.comparison.entries[1].run
    late = first.time > 0.5

    def figures_of(run):
        slip, rate = run.slip_error[late], run.slip_rate_error[late]
        power = np.sqrt(np.mean(run.pressure[late] ** 2))
        return np.mean(slip**2), np.mean(rate**2), abs(slip).max(), abs(rate).max(), power

    assert len(first.time) == 2001
    expected = [own / other for own, other in zip(figures_of(first), figures_of(basis), strict=True)]
    assert [relative(first, basis)[name] for name in BARS] == pytest.approx(expected, rel=1e-6)
    panels = study.figures()["errors-and-power"].axes[:5]
    drawn = [axis.patches[0].get_x() + axis.patches[0].get_width() for axis in panels]
    assert drawn == pytest.approx(expected, rel=1e-6)
    assert [axis.get_title() for axis in panels] == list(BARS.values())


def test_the_designed_linear_law_is_the_basis_only_where_none_is_published(study):
    linear = study.comparison.entries[1]
    own = replace(linear, origin="designed", label="own")
    assert baseline(replace(study.comparison, entries=(own, linear))) is linear
    assert baseline(replace(study.comparison, entries=(own,))) is own
    assert baseline(replace(study.comparison, entries=study.comparison.entries[:1])) is None


def test_without_a_linear_law_there_are_no_bars_and_without_runs_no_closed_loop(study):
    lonely = replace(study, comparison=replace(study.comparison, entries=study.comparison.entries[:1]))
    assert "errors-and-power" not in paper_figures(lonely)
    nothing = PaperStudy(comparison=replace(study.comparison, entries=()), induced=study.induced, close_ups={})
    assert set(paper_figures(nothing)) == {"friction-law", "earthquakes", "uncontrolled"}


def test_a_run_that_diverged_is_named_below_every_figure_in_closed_loop_and_not_drawn(study):
    last = study.comparison.entries[-1]
    empty = Metrics(settled_from=0.5, steps=10, seconds=0.0)
    broken = replace(last, label="broken", run=replace(last.run, metrics=empty, events={"diverged": 1.0}))
    compared = replace(study.comparison, entries=(*study.comparison.entries[:2], broken))
    drawn = paper_figures(replace(study, comparison=compared))
    labels = [text.get_text() for text in drawn["errors-and-power"].axes[0].get_yticklabels()]
    assert labels == ["2-CTA (published)", "e-LQR (published)"]
    assert table(compared)[-1]["mise_slip_over_elqr"] is None
    closed = ("states", "pressure", "errors", "metrics", "friction-coefficient", "errors-and-power")
    assert all("broken diverges at 1 s and is not drawn" in caption(drawn[name]) for name in closed)
    assert all("broken" not in axis.get_title() for name in closed for axis in drawn[name].axes)


def test_the_induced_earthquake_is_larger_faster_and_ends_where_the_statics_say(study):
    from scipy.optimize import brentq

    fault, natural, induced = study.comparison.fault, study.comparison.uncontrolled, study.induced
    assert induced.pressure == pytest.approx(0.1 * fault.effective_normal_stress)

    def force(slip):
        friction = 0.4 + 0.17 * np.exp(-slip / 2.5e-3)
        return 0.57 * 1e5 - friction * (1e5 - 1e4) - 225.5e3 / 0.1 * slip

    assert induced.slip[-1] == pytest.approx(brentq(force, 5e-3, 2e-2), rel=1e-4)
    assert induced.slip[-1] > natural.slip[-1]
    assert induced.metrics.peak_slip_rate > 1.5 * natural.metrics.peak_slip_rate


def test_close_ups_keep_every_step_of_the_start(study):
    close = study.close_ups["2-CTA (published)"]
    whole = study.comparison.entries[0].run
    count = len(close.time)
    assert count == int(16 * 2 * np.pi / study.comparison.fault.natural_frequency / 1e-3) + 1
    assert np.array_equal(close.pressure, whole.pressure[:count])


def test_a_band_holds_every_value():
    values = np.sin(np.arange(101.0))
    middle, low, high = band(np.arange(101.0), values, 20)
    assert list(middle) == [9.5, 29.5, 49.5, 69.5, 90.0]
    assert (low.min(), high.max()) == (values.min(), values.max())
    assert (low[-1], high[-1]) == (values[80:].min(), values[80:].max())
    few = band(np.arange(3.0), values[:3], 20)
    assert [list(v) for v in few] == [[1.0], [values[0]], [values[2]]]


def test_units_suit_the_values():
    assert scaled(5e6, "Pa") == (1e6, "MPa")
    assert scaled(2e-5, "s") == (1e-6, "µs")
    assert [clock(t)[1] for t in (1.0, 3600.0, 663012.0, 5e9)] == ["s", "min", "h", "years"]


def test_every_way_in_which_runs_were_made_is_named_once(study):
    run = study.comparison.entries[0].run
    other = replace(run, provenance={**run.provenance, "scheme": "implicit"})
    assert run_settings([run, run]) == "scheme continuous, step 0.001 s, method dormand-prince, stick-slip plant"
    assert run_settings([run, run, other]).split("; ") == [
        "scheme continuous",
        "scheme implicit",
        "all runs: step 0.001 s, method dormand-prince, stick-slip plant",
    ]


def test_a_caption_says_which_controller_ran_in_which_scheme(study):
    first, second, third = study.comparison.entries
    other = replace(third.run, provenance={**third.run.provenance, "scheme": "implicit", "step": 0.002})
    assert run_settings([(first, first.run), (second, second.run), (third, other)]).split("; ") == [
        "2-CTA (published), e-LQR (published): scheme continuous, step 0.001 s",
        "2-CTA (designed): scheme implicit, step 0.002 s",
        "all runs: method dormand-prince, stick-slip plant",
    ]


def test_the_table_has_a_row_a_run_and_reads_back(study):
    rows = table(study.comparison, {"induced": study.induced})
    assert [row["run"] for row in rows] == [
        "uncontrolled",
        "induced",
        "2-CTA (published)",
        "e-LQR (published)",
        "2-CTA (designed)",
    ]
    assert rows[3]["mise_slip_over_elqr"] == rows[3]["rms_pressure_over_elqr"] == 1
    assert {f.name for f in fields(Metrics)} | {"scheme", "step", "method", "plant"} <= set(rows[0])
    read = list(csv.DictReader(csv_text(rows).splitlines()))
    assert [float(row["peak_slip_rate"]) for row in read] == [row["peak_slip_rate"] for row in rows]
    assert read[0]["max_slip_error"] == ""


def test_numbers_of_the_paper_are_set_beside_those_found(study):
    assert printed(study.comparison) == []
    as_real = replace(study.comparison, fault=replace(study.comparison.fault, name="real-fault"))
    rows = printed(as_real)
    assert [row["run"] for row in rows] == ["uncontrolled", "published cta", "published elqr"]
    assert rows[1]["found"] == study.comparison.entries[0].run.metrics.max_slip_rate_error
    assert all(row["ratio"] == row["found"] / row["printed"] for row in rows)
    missing = printed(replace(as_real, entries=()))
    assert [row["found"] is None for row in missing] == [False, True, True]
    assert len(printed_lines(missing)) == 5
    assert "no run" in printed_lines(missing)[-1]


def on_plant(study, plant):
    """The same runs as if they were on this plant, under the name of the real fault."""
    comparison = study.comparison

    def moved(run):
        return replace(run, provenance={**run.provenance, "plant": plant})

    entries = tuple(replace(e, run=moved(e.run)) for e in comparison.entries)
    fault = replace(comparison.fault, name="real-fault")
    return replace(comparison, fault=fault, entries=entries, uncontrolled=moved(comparison.uncontrolled))


def test_a_note_about_runs_on_the_plant_without_stick_is_told_for_such_runs_alone(study):
    """The published 2-CTA chatters through zero on the paper's plant alone, which 5.8e-3 m/s was counted on."""
    told = {p: "\n".join(printed_lines(printed(on_plant(study, p)))) for p in ("stick-slip", "printed")}
    assert "5.8e-3" in told["printed"]
    assert "5.8e-3" not in told["stick-slip"]
    assert "--plant printed" in told["stick-slip"]
    assert "--plant printed" not in told["printed"]


def test_the_laboratory_fault_has_no_printed_numbers_for_a_reason():
    assert "figures 9 to 12 show experiments" in "\n".join(printed_lines([], "lab-fault"))
    assert printed_lines([], "my-fault") == []


@pytest.mark.slow
def test_the_folder_holds_figures_and_numbers_and_appears_whole(study, tmp_path, monkeypatch):
    out = tmp_path / "results"
    found = write_folder(study.comparison, out, force=False, study=study)
    assert found == study_results(study)
    assert {p.name for p in (out / "figures").iterdir()} == {f"{name}.svg" for name in study.figures()}
    assert {p.name for p in out.iterdir()} == {
        "certificates",
        "fault.toml",
        "figures",
        "numbers.csv",
        "report.html",
        "results.json",
    }
    assert found["figures"]["earthquakes"] == {"file": "figures/earthquakes.svg", "paper": "figure 3"}
    with pytest.raises(OutputError, match="--force"):
        write_folder(study.comparison, out, force=False, study=study)
    monkeypatch.setattr("quakedesign.report.folder.csv_text", lambda _rows: 1 / 0)
    small = PaperStudy(comparison=replace(study.comparison, entries=()), induced=study.induced, close_ups={})
    with pytest.raises(ZeroDivisionError):
        write_folder(small.comparison, tmp_path / "other", force=False, study=small)
    assert [p.name for p in tmp_path.iterdir()] == ["results"]
