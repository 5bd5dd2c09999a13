"""States and pressure in closed loop: a row for every control law, published gains beside designed ones."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from quakedesign.report.drawing import (
    ORIGINS,
    SMALL,
    band,
    clock,
    colour,
    figure,
    finish,
    known,
    length,
    named,
    runs_of,
    scaled,
    style,
    with_diverged,
)

if TYPE_CHECKING:
    from quakedesign.simulation import Trajectory
    from quakedesign.studies.comparison import Compared, Entry

_INSET = (0.16, 0.66, 0.82, 0.31)
_ROOM = 0.9  # for the insets above the data, over the height of the data


def grid(comparison: "Compared") -> tuple[list[str], list[str], dict[tuple[str, str], "Entry"]]:
    """Laws and origins that have a run, in order, and the entry of each pair."""
    found = {(e.design.name, e.origin): e for e, _ in runs_of(comparison.entries)}
    laws = list(dict.fromkeys(name for name, _ in found))
    return laws, [o for o in ORIGINS if any(origin == o for _, origin in found)], found


def states(comparison: "Compared") -> Any:
    """Slip of all laws in the first row, below it the band of the slip rate of each law.

    The rate is on a scale that is linear below the largest reference rate and logarithmic beyond it.
    """
    laws, origins, found = grid(comparison)
    rows = 1 + len(laws)
    drawing, axes = figure(rows, 0.95 + 1.1 * rows, len(origins), sharex=True, sharey="row")
    runs = [run for _, run in runs_of(comparison.entries)]
    divisor, unit = clock(max(float(run.time[-1]) for run in runs))
    size, name = length(float(known(runs[0].reference).max()))
    for column, origin in enumerate(origins):
        _slips(axes[0, column], comparison, origin, (divisor, size))
        axes[0, column].set_ylabel(f"slip [{name}]")
        for row, law in enumerate(laws, 1):
            entry = found.get((law, origin))
            if entry is None:
                drawing.delaxes(axes[row, column])
                continue
            _rate(axes[row, column], entry, comparison, divisor)
        _time_below(axes[:, column], drawing, unit)
    note = "slip rate: band between the extremes of 40 kept samples, logarithmic beyond the largest reference rate"
    rates = [axis for axis in drawing.axes if axis not in axes[0]]
    return finish(
        drawing,
        f"{comparison.fault.name}: states in closed loop",
        runs,
        with_diverged(comparison.entries, note),
        legend=rates[0],
    )


def _slips(axis: Any, comparison: "Compared", origin: str, sizes: tuple[float, float]) -> None:
    """Curves that lie on each other, each narrower than the one below it."""
    divisor, size = sizes
    runs = runs_of(comparison.of(origin))
    for place, (entry, run) in enumerate(runs):
        width = 1.5 * (len(runs) - place)
        look = style(entry) | {"linewidth": width, "linestyle": "solid", "label": entry.design.title}
        axis.plot(run.time / divisor, run.slip / size, **look)
    axis.plot(runs[0][1].time / divisor, known(runs[0][1].reference) / size, color="black", linestyle=":", linewidth=1)
    axis.legend(loc="lower right", fontsize=SMALL - 1)
    named(axis, f"{origin} gains")


def _rate(axis: Any, entry: "Entry", comparison: "Compared", divisor: float) -> None:
    run = entry.run
    assert run is not None
    reference, peak = known(run.reference_rate), comparison.uncontrolled.metrics.peak_slip_rate
    middle, low, high = band(run.time / divisor, run.slip_rate)
    axis.fill_between(middle, low, high, color=colour(entry.design.name), alpha=0.6, linewidth=0.4)
    axis.plot(run.time / divisor, reference, color="black", linestyle=":", linewidth=1, label="reference")
    if peak:
        axis.axhline(peak, color="black", linestyle="--", linewidth=0.9, label="peak of the natural earthquake")
    axis.set_yscale("symlog", linthresh=_power_of_ten(float(np.abs(reference).max())))
    axis.yaxis.set_major_locator(_decades(axis))
    named(axis, entry.label)
    axis.set_ylabel("slip rate [m/s]")


def _power_of_ten(value: float) -> float:
    return float(10.0 ** np.ceil(np.log10(value)))


def _decades(axis: Any) -> Any:
    """Ticks at zero and at every other power of ten beyond the linear part, or further apart: at most five."""
    from matplotlib.ticker import FixedLocator

    last = int(np.floor(np.log10(max(np.abs(axis.get_ylim())))))
    first = int(np.log10(axis.yaxis.get_transform().linthresh)) + 1
    powers = [10.0**power for power in range(last, first - 1, -max(2, (last - first) // 2 + 1))] or [10.0**first]
    return FixedLocator([*(-power for power in powers), 0.0, *powers])


def _time_below(column: Any, drawing: Any, unit: str) -> None:
    """Label the lowest axis of a column that is drawn, and the ticks of all."""
    drawn = [axis for axis in column if axis in drawing.axes]
    for axis in drawn:
        axis.tick_params(labelleft=True)
    lowest = drawn[-1]
    lowest.set_xlabel(f"time [{unit}]")
    lowest.tick_params(labelbottom=True)


def pressure(comparison: "Compared", close_ups: "Mapping[str, Trajectory] | None" = None) -> Any:
    """Fluid pressure of every run as the band that it fills; with close-ups, each has an inset with every step.

    Parameters
    ----------
    comparison : Compared
    close_ups : mapping of str to Trajectory, optional
        Short runs by label of the entry.
    """
    laws, origins, found = grid(comparison)
    drawing, axes = figure(
        len(laws), 0.9 + (2.1 if close_ups else 1.15) * len(laws), len(origins), sharex=True, sharey=True
    )
    runs = [run for _, run in runs_of(comparison.entries)]
    divisor, unit = clock(max(float(run.time[-1]) for run in runs))
    size, name = scaled(comparison.fault.effective_normal_stress / 10, "Pa")
    for column, origin in enumerate(origins):
        for row, law in enumerate(laws):
            entry = found.get((law, origin))
            if entry is None or entry.run is None:
                drawing.delaxes(axes[row, column])
                continue
            axis, shade = axes[row, column], colour(law)
            middle, low, high = band(entry.run.time / divisor, entry.run.pressure / size, 10)
            axis.fill_between(middle, low, high, color=shade, linewidth=0.8)
            named(axis, entry.label)
            axis.set_ylabel(f"pressure [{name}]")
            if close_ups and entry.label in close_ups:
                _inset(axis, close_ups[entry.label], shade)
        _time_below(axes[:, column], drawing, unit)
    if close_ups:
        low, high = drawing.axes[0].get_ylim()
        drawing.axes[0].set_ylim(low, high + _ROOM * (high - low))
    note = "bands between the extremes of 10 kept samples" + (
        "; insets: Δp about its mean, every step" if close_ups else ""
    )
    return finish(drawing, f"{comparison.fault.name}: fluid pressure", runs, with_diverged(comparison.entries, note))


def _inset(axis: Any, run: "Trajectory", shade: str) -> None:
    """The last quarter of a short run, about its mean, in an inset with its own units."""
    late = slice(-(len(run.time) // 4 or 1), None)
    time, values = run.time[late], run.pressure[late] - run.pressure[late].mean()
    size, name = scaled(float(np.abs(values).max()) or 1.0, "Pa")
    step, unit = scaled(float(time[-1] - time[0]) / 2 or 1.0, "s")
    small = axis.inset_axes(_INSET)
    small.set_zorder(5)
    small.plot((time - time[0]) / step, values / size, color=shade, linewidth=0.7)
    small.set_ylabel(f"Δp [{name}]", fontsize=SMALL - 2, labelpad=1)
    small.set_xlabel(f"time after {time[0]:.4g} s [{unit}]", fontsize=SMALL - 2, labelpad=1)
    small.tick_params(labelsize=SMALL - 2, pad=1)
    small.margins(x=0)
