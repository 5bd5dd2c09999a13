"""What is said of a run first: outcome, pressure, and whether that was what its task needs."""

from typing import TYPE_CHECKING

from quakedesign.fault import Fault
from quakedesign.simulation import Trajectory
from quakedesign.simulation.waiting import waiting
from quakedesign.studies.needed_pressure import pressure_extremes, shortfall

if TYPE_CHECKING:
    from quakedesign.studies.comparison import Run

_NEGLIGIBLE = 1e-6
"""Of the larger end of a range of pressures: a smaller end is said to be zero."""
OUTCOME_COLUMNS = ("outcome", "peak rate [m/s]", "of natural")


def run_sentences(run: Trajectory, fault: Fault) -> list[str]:
    """Outcome of a run, and of one that is too short when its event would begin; its pressure, and why too little."""
    extremes = pressure_extremes(run)
    pressure = pressure_sentence(*extremes) if extremes else None
    parts = [outcome_sentence(run), waiting_sentence(run, fault), pressure, shortfall(run, fault)]
    return [part for part in parts if part]


def outcome_sentence(run: Trajectory) -> str:
    """Outcome of a run with its peak slip rate."""
    outcome = run.outcome
    if outcome.peak_slip_rate is None:
        return f"{outcome.kind} at {run.events['diverged']:.4g} s"
    over = f"; its numbers overflow at {run.events['diverged']:.4g} s" if "diverged" in run.events else ""
    opened = f" at {run.events['opening']:.4g} s (p >= σ')" if outcome.kind == "opened" else ""
    return f"{outcome.kind}{opened}: peak slip rate {outcome.peak_slip_rate:.3g} m/s, {_beside_natural(run)}{over}"


def waiting_sentence(run: Trajectory, fault: Fault) -> str | None:
    """When the event of a run without control would begin that ends before; None for other runs."""
    event = waiting(run, fault)
    if event is None:
        return None
    said = f"the fault is unstable, but its event has not begun at {run.time[-1]:.4g} s"
    if event.onset is None:
        return f"{said}: nothing has pushed it forward; without --duration it is nudged"
    return f"{said}: growing by {event.growth:.3g} 1/s it would at about {event.onset:.3g} s"


def outcome_cells(run: "Run | None") -> tuple[str, ...]:
    """Texts under `OUTCOME_COLUMNS`; a dash means not applicable or not known."""
    if run is None:
        return ("–", "–", "–")
    outcome = run.outcome
    peak = "–" if outcome.peak_slip_rate is None else f"{outcome.peak_slip_rate:.2e}"
    return outcome.kind, peak, "–" if outcome.share_of_natural is None else _percent(outcome.share_of_natural)


def pressure_sentence(least: float, largest: float) -> str:
    """Range of a pressure [Pa], and whether it is withdrawal or injection."""
    nothing = _NEGLIGIBLE * max(abs(least), abs(largest))
    shown = (value if abs(value) > nothing else 0.0 for value in (least, largest))
    parts = [f"{value / 1e6 + 0.0:.3g} MPa{_way(value)}" for value in shown]
    return f"pressure from {parts[0]} to {parts[1]}"


def _way(pressure: float) -> str:
    return " (withdrawal)" if pressure < 0 else " (injection)" if pressure > 0 else ""


def _beside_natural(run: Trajectory) -> str:
    share, natural = run.outcome.share_of_natural, run.criterion.natural_peak
    if share is None or natural is None:
        return "and the fault has no natural earthquake"
    return f"{_percent(share)} of the natural earthquake's {natural:.3g} m/s"


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"
