"""The table of a comparison, as plain rows for every medium."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from quakedesign.report.comparison import Comparison, Entry
    from quakedesign.simulation import Trajectory

COLUMNS = (
    "controller",
    "verdict",
    "slip error [m]",
    "rate error [m/s]",
    "RMS of p [Pa]",
    "path of p [Pa]",
    "peak rate [m/s]",
    "back slip",
)
_METRICS = (
    "max_slip_error",
    "max_slip_rate_error",
    "rms_pressure",
    "pressure_total_variation",
    "peak_slip_rate",
    "reverse_slip_fraction",
)


FOOTNOTE = "* a premise of the proof does not hold for this task or run; see the headline"


def _verdict(entry: "Entry") -> str:
    broken = str(entry.design.verdict) == "proved" and not all(p.holds for p in entry.design.premises)
    return f"{entry.design.verdict}{'*' if broken else ''}"


def rows(comparison: "Comparison") -> list[tuple[str, ...]]:
    """One row a controller under `COLUMNS`, narrow enough for 80 columns; a dash means not applicable.

    Largest errors, RMS and total variation (path) of the pressure and the share of reverse slip count after a quarter
    of the task, the peak slip rate over all of it.
    """
    runs: list[tuple[str, str, Trajectory | None]] = [("uncontrolled", "", comparison.uncontrolled)]
    runs += [(e.label, _verdict(e), e.run) for e in comparison.entries]
    found = []
    for label, verdict, run in runs:
        values = {name: getattr(run.metrics, name) if run else None for name in _METRICS}
        found.append(
            (
                label,
                verdict,
                *(
                    "–" if v is None else f"{v:.2f}" if name == "reverse_slip_fraction" else f"{v:.2e}"
                    for name, v in values.items()
                ),
            )
        )
    return found
