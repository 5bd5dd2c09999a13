"""The table of a comparison, as plain rows for every medium."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from quakedesign.report.comparison import Comparison
    from quakedesign.simulation import Trajectory

COLUMNS = (
    "controller",
    "verdict",
    "max slip error [m]",
    "max rate error [m/s]",
    "RMS pressure [Pa]",
    "pressure variation [Pa]",
    "peak slip rate [m/s]",
    "reverse slip [-]",
)
_METRICS = (
    "max_slip_error",
    "max_slip_rate_error",
    "rms_pressure",
    "pressure_total_variation",
    "peak_slip_rate",
    "reverse_slip_fraction",
)


def rows(comparison: "Comparison") -> list[tuple[str, ...]]:
    """One row a controller under `COLUMNS`; errors count after a quarter of the task, a dash means not applicable."""
    runs: list[tuple[str, str, Trajectory | None]] = [("uncontrolled", "", comparison.uncontrolled)]
    runs += [(e.label, str(e.design.verdict), e.run) for e in comparison.entries]
    found = []
    for label, verdict, run in runs:
        values = [getattr(run.metrics, name) if run else None for name in _METRICS]
        found.append((label, verdict, *("–" if v is None else f"{v:.3g}" for v in values)))
    return found
