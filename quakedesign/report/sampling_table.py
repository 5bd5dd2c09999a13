"""Sampling study on a terminal and in a folder."""

from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path

from rich.console import Console
from rich.table import Table

from quakedesign.files import Json, whole_folder
from quakedesign.report.drawing import write_figures, write_results
from quakedesign.report.terminal import table
from quakedesign.simulation import Study
from quakedesign.simulation.sensitivity import QUANTITIES
from quakedesign.studies.comparison import pressure_extremes
from quakedesign.studies.sampling import SamplingReport, SchemeRow

OUTCOME_WIDTHS = (13, 13, 10, 8, 10, 8, 8)
WIDTHS = (13, 13, 8, 8, 8, 8, 5, 8)
_CELLS = {
    "max_slip_error": (1, ".2e"),
    "max_slip_rate_error": (1, ".2e"),
    "rms_pressure": (1e6, ".3g"),
    "pressure_total_variation": (1e9, ".3g"),
    "time_at_rest_fraction": (1, ".2f"),
}
OUTCOMES = ("law", "scheme", "outcome", "peak rate [m/s]", "of natural peak", "min p [MPa]", "max p [MPa]")
COLUMNS = (
    "law",
    "scheme",
    "slip error [m]",
    "rate error [m/s]",
    "RMS p [MPa]",
    "Σ|Δp| [GPa]",
    "at rest",
    "on tra- jectory",
)
FOOTNOTE = (
    "On trajectory: largest |Δh/Δt| of the perturbation h, divided by the bound of the certificate (λ·L̄); a dash: no "
    "certificate, a law that needs none (e-LQR), or a run that diverged. Certificates are for continuous time: none "
    "covers the errors of a scheme, and the compensated scheme has an estimate in place of the law's integral state."
)


def write_sampling(report: SamplingReport, folder: Path, formats: Sequence[str] = ("png",)) -> Json:
    """Write ``results.json`` and a folder ``figures`` into a folder, whole or not at all; return the results."""
    values = report.to_dict()
    with whole_folder(folder) as partial:
        (partial / "figures").mkdir()
        write_figures(partial / "figures", report.figures(), formats)
        write_results(partial, values)
    return values


def print_sampling(report: SamplingReport, console: Console) -> None:
    """Print two tables of the schemes (outcomes, metrics), and one table per study."""
    console.print(report.fault.name, style="bold", end=", ")
    console.print(f"T_s = {report.fault.sampling_time:g} s, plant without stick")
    console.print(_table(OUTCOMES, [row_outcome(row) for row in report.rows], OUTCOME_WIDTHS), soft_wrap=False)
    console.print()
    console.print(_table(COLUMNS, [row_cells(row) for row in report.rows], WIDTHS), soft_wrap=False)
    for row in report.rows:
        if not row.run.outcome.harmless:
            events = ", ".join(f"{name.replace('_', ' ')} at {t:.4g} s" for name, t in row.run.events.items())
            console.print(f"{row.label}, {row.scheme}, first occurrences: {events}")
    console.print(FOOTNOTE)
    for name, study in report.studies.items():
        console.print()
        console.print(study.title, style="bold")
        levels = (
            f"largest errors for {study.label} = {study.levels[0]:.3g} … {study.levels[-1]:.3g} {study.unit}".rstrip()
        )
        if name == "orders":
            levels = (
                f"error ~ T_s^order for T_s = {study.levels[-1]:.3g} … {study.levels[0]:.3g} s, errors at the latter"
            )
        console.print(levels)
        head, rows = order_rows(study) if name == "orders" else study_rows(study)
        console.print(_table(head, rows, (13,) if name == "orders" else (13, 10)), soft_wrap=False)


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]], widths: tuple[int, ...]) -> Table:
    """Table with given widths of the leading columns; at most the first two columns are left-aligned text."""
    sides = "l" * min(len(widths), 2) + "r" * len(head)
    return table(zip_longest(head, widths, sides[: len(head)]), rows)


def row_outcome(row: SchemeRow) -> tuple[str, ...]:
    """Cells of one run under `OUTCOMES`; a dash: diverged or, for the share, no natural earthquake."""
    extremes, outcome = pressure_extremes(row.run), row.run.outcome
    peak = "–" if outcome.peak_slip_rate is None else f"{outcome.peak_slip_rate:.2e}"
    share = "–" if outcome.share_of_natural is None else f"{100 * outcome.share_of_natural:.3g} %"
    pressures = (f"{p / 1e6 + 0.0:.3g}" for p in extremes) if extremes else ("–", "–")
    return (row.label, row.scheme, outcome.kind, peak, share, *pressures)


def row_cells(row: SchemeRow) -> tuple[str, ...]:
    """Cells of one run under `COLUMNS`; a dash means not applicable or diverged."""
    metrics = row.run.metrics
    values = ((getattr(metrics, name), unit, form) for name, (unit, form) in _CELLS.items())
    texts = ("–" if value is None else format(value / unit, form) for value, unit, form in values)
    ratio = row.premise.ratio if row.premise else None
    return (row.label, row.scheme, *texts, "–" if ratio is None else f"{ratio:.3g}")


def study_rows(study: Study) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Heading and rows of a study as strings: one row per scheme and quantity, with the errors at every level."""
    head = ("scheme", "error", *(f"{level:.2g}" for level in study.levels))
    rows = [
        (scheme, _quantity(name), *(f"{v:.1e}" for v in values))
        for scheme, errors in study.errors.items()
        for name, values in errors.items()
    ]
    return head, rows


def order_rows(study: Study) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Heading and rows of convergence orders as strings: one row per scheme, and its errors at the longest T_s."""
    exponents = study.orders()
    names = list(next(iter(study.errors.values())))
    head = ("scheme", *(f"order of {QUANTITIES[n][0].removeprefix('max ')}" for n in names), *map(_quantity, names))
    rows = []
    for scheme, errors in study.errors.items():
        powers = (exponents[scheme][n] for n in names)
        largest = (f"{errors[n][0]:.1e}" for n in names)
        rows.append((scheme, *("–" if power is None else f"{power:.2f}" for power in powers), *largest))
    return head, rows


def _quantity(name: str) -> str:
    label, unit = QUANTITIES[name]
    return f"{label.removeprefix('max ')} [{unit}]"
