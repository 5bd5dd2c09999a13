"""Comparisons: headlines say what holds and what does not; figures and pages have units."""

import io
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import pytest

import quakedesign as qd
from quakedesign.cli.app import console
from quakedesign.errors import OutputError
from quakedesign.exact import UpperBound
from quakedesign.fault import Reference
from quakedesign.lyapunov import Verdict
from quakedesign.lyapunov.exact.premises import Premise
from quakedesign.report import Comparison, headline
from quakedesign.report.figures import metrics, overview
from quakedesign.report.folder import write_folder
from quakedesign.report.sentences import remarks
from quakedesign.report.tables import COLUMNS, rows
from quakedesign.report.terminal import print_comparison
from quakedesign.studies import Entry
from quakedesign.synthesis import Design


@pytest.fixture(scope="module")
def comparison(kept):
    """The laboratory fault with a task of 20 s, so that all runs are short."""
    fault = qd.load_fault("lab-fault")
    fault = replace(fault, reference=Reference(target_slip=fault.reference.target_slip, operation_time=20.0))

    def undecided(fault, law):
        return Design(
            fault=fault, name=law.name, verdict=Verdict.UNDECIDED, controller=law, certificate=None, premises=()
        )

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("quakedesign.studies.comparison.assess", undecided)  # verdicts on them are another test's
        for name in ("longest_step", "longest_delay"):  # and so is how far other designs go
            patch.setattr(f"quakedesign.guarantees.search.default_designs.{name}", lambda *_, **__: None)
        yield qd.compare(fault, [qd.design(fault, "elqr", plant="printed")])


def test_all_controllers_of_the_paper_and_all_designs_are_compared(comparison):
    labels = [e.label for e in comparison.entries]
    assert labels == [
        "2-CTA (published)",
        "2-DIA (published)",
        "e-LQR (published)",
        "e-LQR (designed)",
    ]


def test_every_row_of_the_table_fits_its_columns(comparison):
    found = rows(comparison)
    assert len(found) == 4
    assert {len(row) for row in found} == {len(COLUMNS)}


def test_every_axis_of_every_figure_has_a_label_with_a_unit(comparison):
    figures = comparison.figures()
    assert set(figures) == {"overview", "uncontrolled", "states", "pressure", "errors", "metrics"}
    for name, figure in figures.items():
        for axis in figure.axes:
            labelled = axis.get_ylabel() if name != "metrics" else axis.get_xlabel()
            assert "[" in labelled, name
        assert any("[" in axis.get_xlabel() for axis in figure.axes)


def test_bars_of_nearly_equal_values_name_no_crowded_parts_of_a_decade(comparison):
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    runs = [entry for entry in comparison.entries if entry.run is not None]
    equal = replace(runs[0].run.metrics, pressure_total_variation=4.98e6, max_slip_error=2e-8)
    entries = [replace(entry, run=replace(entry.run, metrics=equal)) for entry in runs]
    drawn = metrics(SimpleNamespace(fault=comparison.fault, entries=entries))
    FigureCanvasAgg(drawn).draw()
    for axis in drawn.axes:
        assert not any(tick.label1.get_text() for tick in axis.xaxis.get_minor_ticks())


@pytest.mark.slow
def test_no_tick_label_covers_another_and_no_text_leaves_its_figure(comparison):
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    for name, figure in comparison.figures().items():
        FigureCanvasAgg(figure).draw()
        for side in (side for axis in figure.axes for side in (axis.xaxis, axis.yaxis)):
            low, high = side.get_view_interval()
            ticks = sorted((*side.get_major_ticks(), *side.get_minor_ticks()), key=lambda tick: tick.get_loc())
            shown = [tick.label1 for tick in ticks if low <= tick.get_loc() <= high]
            boxes = [label.get_window_extent() for label in shown if label.get_visible() and label.get_text()]
            assert not any(one.overlaps(other) for one, other in pairwise(boxes)), (name, side.axes.get_title())
        for text in (*figure.texts, figure._suptitle):
            box = text.get_window_extent()
            assert figure.bbox.x0 <= box.x0 <= box.x1 <= figure.bbox.x1, (name, text.get_text())


def test_the_folder_appears_whole_and_is_not_overwritten(comparison, tmp_path, monkeypatch):
    out = tmp_path / "results"
    write_folder(comparison, out, force=False)
    assert (out / "results.json").is_file()
    assert len(list((out / "figures").iterdir())) == 6
    with pytest.raises(OutputError, match="--force"):
        write_folder(comparison, out, force=False)
    monkeypatch.setenv("QUAKEDESIGN_CACHE", "off")  # figures are kept for what they show, whoever draws them
    monkeypatch.setattr(Comparison, "figures", lambda _: {})
    write_folder(comparison, out, force=True)
    assert list((out / "figures").iterdir()) == []
    assert [p.name for p in tmp_path.iterdir()] == ["results"]


def test_a_failure_while_writing_leaves_nothing_behind(comparison, tmp_path, monkeypatch):
    monkeypatch.setattr(Comparison, "figures", lambda _: {})
    monkeypatch.setattr("quakedesign.report.folder.page_html", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_folder(comparison, tmp_path / "results", force=False)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_without_results_is_never_replaced(comparison, tmp_path):
    (tmp_path / "precious").mkdir()
    with pytest.raises(OutputError, match="only a folder with results"):
        write_folder(comparison, tmp_path / "precious", force=True)


FAULT = qd.load_fault("lab-fault")
CONTROLLER = qd.published("lab-fault")["cta"]


def entry(verdict, *premises, controller=CONTROLLER, **more):
    design = Design(
        fault=FAULT, name="cta", verdict=verdict, controller=controller, certificate=None, premises=tuple(premises)
    )
    return Entry(label="x", origin="designed", design=design, run=None, **more)


def test_a_broken_premise_is_said_with_its_factor():
    chatter = Premise(name="on_trajectory", required=5.75, certified=1.0, unit="m/s^3", measured=True)
    said = headline(entry(Verdict.PROVED, chatter, largest_step=0.012))
    assert said == (
        "proved in continuous time; in this run |h'| is 5.75 times as large as the proof allows; "
        "the run satisfies the proved bound on |h'| for T_s up to about 0.012 s"
    )


def test_when_all_premises_hold_it_says_so():
    fine = Premise(name="along_reference", required=0.5, certified=1.0, unit="m/s^3")
    assert headline(entry(Verdict.PROVED, fine)) == "proved in continuous time; every premise holds"


def test_no_gains_with_a_proof_is_undecided():
    assert headline(entry(Verdict.UNDECIDED, controller=None)).startswith("undecided")


def test_an_unstable_step_is_shouted():
    assert "UNSTABLE at the step used" in headline(entry(Verdict.PROVED, growth_per_step=1.2))


@pytest.mark.parametrize("length", [3, 91, 92, 163, 164, 500])
@pytest.mark.parametrize("controller", [CONTROLLER, None])
def test_a_headline_has_at_most_two_hundred_characters_and_loses_no_sentence(length, controller):
    told = entry(Verdict.UNDECIDED, controller=controller, growth_per_step=1.2)
    told = replace(told, design=replace(told.design, details={"reason": "x" * length}))
    first, rest = headline(told), remarks(told)
    told = "; ".join([first, *rest])
    assert told.startswith("undecided: xxx" if length <= 100 - len("undecided: ") else "undecided; xxx")
    assert told.count("x") == length
    assert told.endswith("UNSTABLE at the step used" if controller else "x")
    assert len(first) <= 200
    assert bool(rest) is (len(told) > 200)


def test_a_brief_account_leaves_out_what_holds_and_says_once_what_is_the_same(comparison):
    whole, brief = io.StringIO(), io.StringIO()
    print_comparison(comparison, console(file=whole, width=80))
    print_comparison(comparison, console(file=brief, width=80), whole=False)
    assert len(brief.getvalue().splitlines()) <= 40
    assert max(map(len, brief.getvalue().splitlines())) <= 80
    entries = (*comparison.of("designed"), *comparison.of("published"))
    assert any(p.holds for entry in entries for p in entry.design.premises)
    shared = {line for entry in entries if entry.guarantee for line in entry.guarantee.limit_lines()}
    assert shared
    whole, brief = (" ".join(out.getvalue().split()) for out in (whole, brief))
    assert " holds: required" in whole
    assert " holds: required" not in brief
    assert all(brief.count(line) == 1 for line in shared)
    assert all(f"{float(v):.6g}" in whole for entry in entries for v in entry.design.gains.values())
    failing = [p for entry in entries for p in entry.design.conditions if not p.holds]
    assert all(f"premise {p.name}" in whole for p in failing)


def test_the_overview_has_lines_at_the_proved_bound_the_worst_case_and_the_limit(comparison):
    (designed,) = comparison.of("designed")
    rate, slip = comparison.figures()["overview"].axes
    levels = {line.get_label(): line.get_ydata()[0] for line in rate.lines if len(set(line.get_ydata())) == 1}
    answer = designed.guarantee
    bounds = [value for label, value in levels.items() if "proved" in label]
    assert bounds == [float(answer.proof.peak_slip_rate)]
    worst = [v for label, v in levels.items() if "worst case of slip-rate error" in label]
    assert worst == [answer.worst.slip_rate_error]
    limits = [v for label, v in levels.items() if "performance limit of slip-rate error" in label]
    assert limits == [float(answer.limit.slip_rate_error)]
    assert rate.get_yscale() == slip.get_xscale() == "log"
    run = next(line for line in rate.lines if line.get_label() == designed.label)
    assert max(v for v in run.get_ydata() if v == v) == pytest.approx(abs(designed.run.slip_rate).max())
    (free,) = (line for line in rate.lines if line.get_label() == "without control")
    assert max(v for v in free.get_ydata() if v == v) == abs(comparison.uncontrolled.slip_rate).max()


def test_the_overview_is_of_the_design_with_the_smallest_proved_bound(comparison):
    (best,) = comparison.of("designed")
    claims = replace(best.guarantee.proof.claims, peak_slip_rate=UpperBound(1))
    answer = replace(best.guarantee, proof=replace(best.guarantee.proof, claims=claims))
    worse = replace(best, label="worse", guarantee=answer)
    both = Comparison(fault=comparison.fault, uncontrolled=comparison.uncontrolled, entries=(worse, best))
    lines = {line.get_label(): line for line in overview(both).axes[0].lines}
    assert best.label in lines
    assert "worse" not in lines
    (proved,) = (line for label, line in lines.items() if label.startswith("proved"))
    looks = [(line.get_color(), line.get_linestyle()) for line in lines.values()]
    assert looks.count((proved.get_color(), proved.get_linestyle())) == 1  # no other curve looks like it
