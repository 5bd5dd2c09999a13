"""Figures of a comparison: one idea each, axes with units."""

from typing import TYPE_CHECKING, Any

import numpy as np

from quakedesign.report.closed_loop_figures import pressure, states
from quakedesign.report.drawing import (
    NATURAL,
    SMALL,
    band,
    bar_look,
    clock,
    figure,
    finish,
    known,
    length,
    runs_of,
    scaled,
    style,
    with_diverged,
)
from quakedesign.report.state_figures import state_figures
from quakedesign.studies.state_runs import StateRun

if TYPE_CHECKING:
    from quakedesign.studies.comparison import Compared, Run


def figures(comparison: "Compared") -> dict[str, Any]:
    """Figures by name: ``uncontrolled``, ``states``, ``pressure``, ``errors``, ``metrics``; others with a state."""
    if isinstance(comparison.uncontrolled, StateRun):
        return state_figures(comparison, comparison.uncontrolled)
    drawn = {"uncontrolled": uncontrolled(comparison)}
    if runs_of(comparison.entries):
        drawn |= {
            "states": states(comparison),
            "pressure": pressure(comparison),
            "errors": errors(comparison),
            "metrics": metrics(comparison),
        }
    return drawn


def uncontrolled(comparison: "Compared") -> Any:
    """Slip and slip rate of the natural earthquake, and where the statics let it rest."""
    run, fault = comparison.uncontrolled, comparison.fault
    drawing, ((slip,), (rate,)) = figure(2, 3.2)
    size, unit = length(float(run.slip.max()))
    last = end(run)
    divisor, name = clock(last)
    slip.set_xlim(-0.03 * last / divisor, last / divisor)
    slip.plot(run.time / divisor, run.slip / size, color=NATURAL)
    slip.axhline(fault.rest_slip / size, color="grey", linestyle=":", label="next rest slip (statics)")
    slip.set_ylabel(f"slip [{unit}]")
    slip.legend(loc="lower right", fontsize=SMALL)
    rate.plot(run.time / divisor, run.slip_rate, color=NATURAL)
    rate.set_ylabel("slip rate [m/s]")
    rate.set_xlabel(f"time [{name}]")
    event = f"magnitude {fault.magnitude:.2f}" if fault.seismic_moment > 0 else "no earthquake"
    return finish(drawing, f"{fault.name} without control: {event}", [run])


def end(*runs: "Run") -> float:
    """Time [s] until which earthquakes are shown: somewhat longer than the last takes to complete its slip."""
    settled = [run.time[int(np.argmax(np.abs(run.slip) >= 0.995 * np.abs(run.slip).max()))] for run in runs]
    return float(min(1.4 * max(settled), min(run.time[-1] for run in runs))) or float(runs[0].time[-1])


def errors(comparison: "Compared") -> Any:
    """Size of both tracking errors over time, as envelopes."""
    drawing, ((slip,), (rate,)) = figure(2, 3.9)
    runs = runs_of(comparison.entries)
    divisor, unit = clock(max(float(run.time[-1]) for _, run in runs))
    for entry, run in runs:
        for axis, values in ((slip, run.slip_error), (rate, run.slip_rate_error)):
            middle, _, largest = band(run.time / divisor, np.abs(known(values)))
            axis.plot(middle, np.maximum(largest, 1e-300), **style(entry))
    for axis, label in ((slip, "|slip error| [m]"), (rate, "|slip-rate error| [m/s]")):
        axis.set_yscale("log")
        axis.set_ylabel(label)
    rate.set_xlabel(f"time [{unit}]")
    made = [run for _, run in runs]
    title = f"{comparison.fault.name}: tracking errors"
    return finish(drawing, title, made, with_diverged(comparison.entries, "largest of 40 kept samples"), legend=slip)


_SHOWN = {
    "max_slip_error": "max |slip error|",
    "max_slip_rate_error": "max |slip-rate error|",
    "rms_pressure": "RMS pressure",
    "pressure_total_variation": "total variation of pressure",
}


def metrics(comparison: "Compared") -> Any:
    """Bars of four metrics in their units."""
    from matplotlib.ticker import NullFormatter

    drawing, axes = figure(2, 3.7, columns=2, sharey=True)
    settled = [(e, run) for e, run in runs_of(comparison.entries) if run.metrics.max_slip_error is not None]
    for axis, (name, title) in zip(axes.ravel(), _SHOWN.items(), strict=True):
        values = [getattr(run.metrics, name) for _, run in settled]
        unit = settled[0][1].metrics.unit(name) if settled else "-"
        size, unit = scaled(max(values), unit) if unit == "Pa" and any(values) else (1.0, unit)
        values = [value / size for value in values]
        for place, ((entry, _), value) in enumerate(zip(settled, values, strict=True)):
            axis.barh(place, value, **bar_look(entry))
            axis.annotate(f" {value:.3g}", (value, place), va="center", fontsize=SMALL - 1)
        axis.set_yticks(range(len(settled)), [e.label for e, _ in settled])
        axis.set_xlabel(f"{title} [{unit}]")
        if name != "rms_pressure" and min(values, default=0) > 0:
            axis.set_xscale("log")
            axis.xaxis.set_minor_formatter(NullFormatter())
            axis.set_xlim(min(values) / 3, max(values) * 10)
        else:
            axis.set_xlim(right=max(values, default=1) * 1.3 or 1)
    axes[0, 0].invert_yaxis()
    title = f"{comparison.fault.name}: comparison after a quarter of the task"
    return finish(drawing, title, [run for _, run in settled], with_diverged(comparison.entries))
