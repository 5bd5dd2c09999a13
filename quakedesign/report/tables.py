"""Tables of a comparison as plain rows, and as CSV."""

import csv
import io
from typing import TYPE_CHECKING

from quakedesign.files import Json

if TYPE_CHECKING:
    from quakedesign.simulation import Trajectory
    from quakedesign.studies.comparison import Compared


# ----------------------------------------------------------------------
# Metrics of a comparison as plain rows, for terminal, page and CSV.

COLUMNS = (
    "controller",
    "slip error [m]",
    "rate error [m/s]",
    "least p [Pa]",
    "largest p [Pa]",
    "RMS of p [Pa]",
    "total variation of p [Pa]",
    "at rest",
)
_METRICS = (
    "max_slip_error",
    "max_slip_rate_error",
    "min_pressure",
    "max_pressure",
    "rms_pressure",
    "pressure_total_variation",
    "time_at_rest_fraction",
)


def rows(comparison: "Compared") -> list[tuple[str, ...]]:
    """One row per controller under `COLUMNS`, narrow enough for 80 columns; a dash means not applicable.

    Largest errors, RMS pressure, total variation of the pressure and fraction of time at rest are evaluated after the
    first quarter of the run, smallest and largest pressure over the whole run.
    """
    return [(e.label, *_cells(e.run)) for e in comparison.entries]


def _cells(run: "Trajectory | None") -> tuple[str, ...]:
    values = {name: getattr(run.metrics, name) if run else None for name in _METRICS}
    return tuple(
        "–" if v is None else f"{v:.2f}" if name == "time_at_rest_fraction" else f"{v + 0.0:.2e}"
        for name, v in values.items()
    )


def csv_text(rows: list[Json]) -> str:
    """Rows as CSV with a header line; inapplicable cells are empty."""
    heads = list(dict.fromkeys(name for row in rows for name in row))
    stream = io.StringIO()
    writer = csv.DictWriter(stream, heads, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()
