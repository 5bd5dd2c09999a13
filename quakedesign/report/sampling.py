"""A sampling report on a terminal and in a folder."""

import json
from pathlib import Path
from typing import Any

from rich.table import Table

from quakedesign.output import whole_folder, write_whole
from quakedesign.studies.sampling import COLUMNS, FOOTNOTE, OUTCOMES, SamplingReport, order_rows, study_rows

OUTCOME_WIDTHS = (13, 13, 10, 8, 10, 8, 8)
WIDTHS = (13, 13, 8, 8, 8, 8, 5, 8)


def write_sampling(report: SamplingReport, folder: Path) -> dict[str, Any]:
    """Write ``results.json`` and ``figures/*.png`` into a folder that appears whole; return what the former holds.

    Raises
    ------
    OutputError
    """
    found = report.to_dict()
    with whole_folder(folder) as partial:
        (partial / "figures").mkdir()
        for name, drawing in report.figures().items():
            drawing.savefig(partial / "figures" / f"{name}.png", metadata={"Software": None})
        write_whole(partial / "results.json", json.dumps(found, indent=1, allow_nan=False) + "\n")
    return found


def print_sampling(report: SamplingReport, console: Any) -> None:
    """Table of the schemes, and one of every study."""
    console.print(report.fault.name, style="bold", end=", ")
    console.print(f"T_s = {report.fault.sampling_time:g} s")
    console.print(_table(OUTCOMES, [row.outcome_cells() for row in report.rows], OUTCOME_WIDTHS), soft_wrap=False)
    console.print()
    console.print(_table(COLUMNS, [row.cells() for row in report.rows], WIDTHS), soft_wrap=False)
    for row in report.rows:
        if not row.run.outcome.harmless:
            console.print(f"{row.label}, {row.scheme}: {dict(row.run.events)}")
    console.print(FOOTNOTE)
    for name, study in report.studies.items():
        console.print()
        console.print(study.title, style="bold")
        levels = f"largest errors at {study.label} {study.levels[0]:.3g} … {study.levels[-1]:.3g} {study.unit}".rstrip()
        if name == "orders":
            levels = (
                f"error ~ T_s^order for T_s = {study.levels[-1]:.3g} … {study.levels[0]:.3g} s, errors at the latter"
            )
        console.print(levels)
        head, rows = order_rows(study) if name == "orders" else study_rows(study)
        console.print(_table(head, rows, (13,) if name == "orders" else (13, 10)), soft_wrap=False)


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]], widths: tuple[int, ...]) -> Table:
    """Table whose columns of text, the first one or two, have the widths given; so have others as far as given."""
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    texts = min(len(widths), 2)
    for i, column in enumerate(head):
        width = widths[i] if i < len(widths) else None
        table.add_column(column, justify="left" if i < texts else "right", width=width)
    for row in rows:
        table.add_row(*row)
    return table
