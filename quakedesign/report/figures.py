"""Figures of a comparison: states, pressure, errors, metrics, stability map, cycles.

Cycles and slow sliding are for friction with a state. Published and designed gains appear in one figure.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from quakedesign.fault import Fault
from quakedesign.report.drawing import (
    INDUCED,
    NATURAL,
    ORIGINS,
    PROVED,
    SMALL,
    band,
    bar_look,
    clock,
    colour,
    figure,
    finish,
    length,
    named,
    present,
    runs_of,
    scaled,
    style,
    with_diverged,
)
from quakedesign.studies.fault_facts import Plane, StabilityRegions, stability_regions
from quakedesign.text import quantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import Locator

    from quakedesign.simulation import Trajectory
    from quakedesign.studies.comparison import Compared, Entry


# ----------------------------------------------------------------------
# States and pressure in closed loop: a row for every control law, columns for designed and published gains.

_INSET = (0.16, 0.66, 0.82, 0.31)
_ROOM = 0.9  # space for insets above the data, relative to the height of the data


def grid(comparison: "Compared") -> tuple[list[str], list[str], dict[tuple[str, str], "Entry"]]:
    """Laws and origins with a run, in order, and the entry of each pair."""
    entries = {(e.design.name, e.origin): e for e, _ in runs_of(comparison.entries)}
    laws = list(dict.fromkeys(name for name, _ in entries))
    return laws, [o for o in ORIGINS if any(origin == o for _, origin in entries)], entries


def states(comparison: "Compared") -> "Figure":
    """Slip of all laws in the first row; below it, the slip rate of each law as a band.

    The scale of the rate is linear up to the power of ten at or above the largest reference rate, and then logarithmic.
    """
    laws, origins, by_law = grid(comparison)
    rows = 1 + len(laws)
    drawing, axes = figure(rows, 0.95 + 1.1 * rows, len(origins), sharex=True, sharey="row")
    runs = runs_of(comparison.entries)
    divisor, unit = clock(max(float(run.time[-1]) for _, run in runs))
    size, name = length(float(present(runs[0][1].reference).max()))
    for column, origin in enumerate(origins):
        _slips(axes[0, column], comparison, origin, (divisor, size))
        axes[0, column].set_ylabel(f"slip [{name}]")
        for row, law in enumerate(laws, 1):
            entry = by_law.get((law, origin))
            if entry is None:
                drawing.delaxes(axes[row, column])
                continue
            _rate(axes[row, column], entry, comparison, divisor)
        _time_below(axes[:, column], drawing, unit)
    note = "slip rate: band between the extremes of every 40 stored samples; linear scale near 0, then logarithmic"
    rates = [axis for axis in drawing.axes if axis not in axes[0]]
    return finish(
        drawing,
        f"{comparison.fault.name}: states in closed loop",
        runs,
        with_diverged(comparison.entries, note),
        legend=rates[0],
    )


def _slips(axis: "Axes", comparison: "Compared", origin: str, sizes: tuple[float, float]) -> None:
    """Draw overlapping slip curves, each narrower than the one below it."""
    divisor, size = sizes
    runs = runs_of(comparison.of(origin))
    for place, (entry, run) in enumerate(runs):
        width = 1.5 * (len(runs) - place)
        look = style(entry) | {"linewidth": width, "linestyle": "solid", "label": entry.design.title}
        axis.plot(run.time / divisor, run.slip / size, **look)
    axis.plot(runs[0][1].time / divisor, present(runs[0][1].reference) / size, color="black", ls=":", lw=1)
    axis.legend(loc="lower right", fontsize=SMALL - 1)
    named(axis, f"{' and '.join(dict.fromkeys(entry.kind for entry, _ in runs))} gains")


def _rate(axis: "Axes", entry: "Entry", comparison: "Compared", divisor: float) -> None:
    run = entry.run
    assert run is not None
    reference, peak = present(run.reference_rate), comparison.uncontrolled.metrics.peak_slip_rate
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


def _decades(axis: Any) -> "Locator":
    """At most five ticks: zero, and powers of ten beyond the linear part, at least two decades apart."""
    from matplotlib.ticker import FixedLocator

    last = int(np.floor(np.log10(max(np.abs(axis.get_ylim())))))
    first = int(np.log10(axis.yaxis.get_transform().linthresh)) + 1
    powers = [10.0**power for power in range(last, first - 1, -max(2, (last - first) // 2 + 1))] or [10.0**first]
    return FixedLocator([*(-power for power in powers), 0.0, *powers])


def _time_below(column: "Iterable[Axes]", drawing: "Figure", unit: str) -> None:
    """Label the lowest drawn axis of a column, and the ticks of all its axes."""
    drawn = [axis for axis in column if axis in drawing.axes]
    for axis in drawn:
        axis.tick_params(labelleft=True)
    lowest = drawn[-1]
    lowest.set_xlabel(f"time [{unit}]")
    lowest.tick_params(labelbottom=True)


def pressure(comparison: "Compared", close_ups: "Mapping[str, Trajectory] | None" = None) -> "Figure":
    """Fluid pressure of every run as a band; with close-ups, each axis has an inset with every step.

    Parameters
    ----------
    close_ups : mapping of str to Trajectory, optional
        Short runs by label of the entry.
    """
    laws, origins, by_law = grid(comparison)
    drawing, axes = figure(
        len(laws), 0.9 + (2.1 if close_ups else 1.15) * len(laws), len(origins), sharex=True, sharey=True
    )
    runs = runs_of(comparison.entries)
    divisor, unit = clock(max(float(run.time[-1]) for _, run in runs))
    size, name = scaled(comparison.fault.effective_normal_stress / 10, "Pa")
    for column, origin in enumerate(origins):
        for row, law in enumerate(laws):
            entry = by_law.get((law, origin))
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
        bottom, top = drawing.axes[0].get_ylim()
        drawing.axes[0].set_ylim(bottom, top + _ROOM * (top - bottom))
    note = "bands between the extremes of every 10 stored samples" + (
        "; insets: Δp about its mean, every step" if close_ups else ""
    )
    return finish(drawing, f"{comparison.fault.name}: fluid pressure", runs, with_diverged(comparison.entries, note))


def _inset(axis: "Axes", run: "Trajectory", shade: str) -> None:
    """Draw the pressure of the last quarter of a short run, minus its mean, in an inset with its own units."""
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


# ----------------------------------------------------------------------
# Figures of faults whose friction has a state: their cycle, and controlled slow sliding.

_BANDS = 600  # about the largest number of bands of a run: more are invisible, and make a file of many megabytes
_PER_BAND = 16  # smallest number of instants of a band: four sampling periods


def state_figures(comparison: "Compared") -> "dict[str, Figure]":
    """Figures ``cycle``, if computed, and ``slow-sliding`` and ``sliding-errors`` of the first law with a run."""
    drawn = {} if comparison.uncontrolled.failed else {"cycle": cycle(comparison)}
    for one in runs_of(comparison.entries)[:1]:
        drawn |= {"slow-sliding": slow_sliding(*one), "sliding-errors": errors(*one)}
    return drawn


def cycle(comparison: "Compared") -> "Figure":
    """Slip and slip rate without control."""
    run, fault = comparison.uncontrolled, comparison.fault
    drawing, ((slip,), (rate,)) = figure(2, 3.6)
    size, unit = length(float(run.slip.max()))
    divisor, passing = clock(float(run.time[-1]))
    slip.plot(run.time / divisor, run.slip / size, color=NATURAL)
    slip.set_ylabel(f"slip [{unit}]")
    rate.semilogy(run.time / divisor, run.slip_rate, color=NATURAL)
    rate.axhline(fault.friction.operating_rate, color="grey", linestyle=":", label="loading rate")
    rate.set_ylabel("slip rate [m/s]")
    rate.set_xlabel(f"time [{passing}]")
    moved = "with inertia" if run.provenance["plant"] == "smooth" else run.provenance["plant"]
    made = f"method {run.provenance['method']}, tolerance {run.provenance['rtol']:g}, {moved}"
    return finish(drawing, f"{fault.name} without control", [], made, legend=rate)


def slow_sliding(entry: "Entry", run: "Trajectory") -> "Figure":
    """Slip, slip rate, pressure and friction state of a run of controlled slow sliding."""
    fault, shade = entry.design.fault, colour(entry.design.name)
    drawing, ((slip,), (rate,), (pressure,), (state,)) = figure(4, 6.6)
    divisor, unit = clock(float(run.time[-1]))
    time, speed = run.time / divisor, present(run.reference_rate)
    size, name = length(float(run.slip.max()))
    slip.plot(time, run.slip / size, color=shade, linewidth=2.5)
    slip.plot(time, present(run.reference) / size, color="black", linestyle=":", linewidth=1, label="reference")
    slip.set_ylabel(f"slip [{name}]")
    first = float(speed[0])
    _filled(rate, time, run.slip_rate / first, shade)
    rate.plot(time, speed / first, color="black", linestyle=":", linewidth=1, label="reference")
    if entry.proof is not None:
        bound = float(entry.proof.peak_slip_rate) / first
        rate.axhline(bound, color=PROVED, linestyle=(0, (10, 3)), label="proved upper bound")
    rate.set_ylabel("slip rate / V [-]")
    largest, pascal = scaled(float(np.abs(run.pressure).max()) or 1.0, "Pa")
    _filled(pressure, time, run.pressure / largest, shade)
    pressure.set_ylabel(f"pressure [{pascal}]")
    (steady,) = map(float, fault.friction.steady_state(first))
    _filled(state, time, run.signals()["theta"][0] / steady, shade)
    state.set_ylabel("state / steady [-]")
    state.set_ylim(min(state.get_ylim()[0], 0.99), max(state.get_ylim()[1], 1.01))
    state.set_xlabel(f"time [{unit}]")
    shaken = f"shear stress up to {float(np.abs(run.signals()['stress'][0]).max()) / 1e3:.3g} kPa"
    note = f"V = {first:.4g} m/s; bands between the extremes of {_width(run.time)} instants; {shaken}"
    return finish(drawing, f"{fault.name}: controlled slow sliding", [run], note, legend=rate)


def errors(entry: "Entry", run: "Trajectory") -> "Figure":
    """Slip and slip rate minus their references."""
    drawing, axes = figure(2, 3.6)
    divisor, unit = clock(float(run.time[-1]))
    shown = ((present(run.slip_error), "m", "slip error"), (present(run.slip_rate_error), "m/s", "slip-rate error"))
    for (axis,), (values, si, name) in zip(axes, shown, strict=True):
        size, scale = scaled(float(np.abs(values).max()) or 1.0, si)
        _filled(axis, run.time / divisor, values / size, colour(entry.design.name))
        axis.set_ylabel(f"{name} [{scale}]")
    axes[1, 0].set_xlabel(f"time [{unit}]")
    note = f"bands between the extremes of {_width(run.time)} instants"
    return finish(drawing, f"{entry.design.fault.name}: tracking errors", [run], note)


def _filled(axis: "Axes", time: "np.ndarray", values: "np.ndarray", shade: str) -> None:
    middle, low, high = band(time, values, _width(time))
    axis.fill_between(middle, low, high, color=shade, linewidth=0.8)


def _width(time: "np.ndarray") -> int:
    """Number of instants in a band."""
    return max(_PER_BAND, len(time) // _BANDS)


# ----------------------------------------------------------------------
# Figures of a comparison: one idea each, axes with units.


def figures(comparison: "Compared") -> "dict[str, Figure]":
    """Figures by name.

    ``overview``, ``uncontrolled``, ``states``, ``pressure``, ``errors``, ``metrics``; with a state ``overview``,
    ``cycle``, ``slow-sliding``, ``sliding-errors``.
    """
    if comparison.uncontrolled.cycle is not None:
        return overviews(comparison) | state_figures(comparison)
    drawn = overviews(comparison) | {"uncontrolled": uncontrolled(comparison)}
    if runs_of(comparison.entries):
        drawn |= {
            "states": states(comparison),
            "pressure": pressure(comparison),
            "errors": error_figure(comparison),
            "metrics": metrics(comparison),
        }
    return drawn


def overviews(comparison: "Compared") -> "dict[str, Figure]":
    """``overview``, if there are both a natural earthquake and a controlled run."""
    failed = comparison.uncontrolled.failed
    return {} if failed or not runs_of(comparison.of("designed")) else {"overview": overview(comparison)}


def overview(comparison: "Compared") -> "Figure":
    """Slip rate and slip with and without control over logarithmic time, with the proved bound and limits."""
    free = comparison.uncontrolled
    best, own = min(
        runs_of(comparison.of("designed")),
        key=lambda pair: float(pair[0].proof.peak_slip_rate) if pair[0].proof else np.inf,
    )
    drawing, ((rate,), (slip,)) = figure(2, 5.0, height_ratios=(3, 2))
    floor = 1e-3 * float(present(own.reference_rate).max())
    speed = np.abs(free.slip_rate)
    moves = free.time[int(np.argmax(speed > 2 * max(floor, float(speed[0]))))]
    rate.plot(free.time, np.where(speed > floor, speed, np.nan), color=NATURAL, label="without control")
    ran = [*runs_of(comparison.of("published")), (best, own)]
    for entry, run in ran:
        middle, values = _largest(run.time, np.abs(run.slip_rate))
        look = style(entry) | {"linewidth": 1.8 if entry is best else 0.9}
        rate.plot(middle, np.where(values > floor, values, np.nan), **look)
    last = max(float(run.time[-1]) for run in (free, own))
    first = min(float(own.time[1]), max(0.1 * moves, 1e-9 * last))
    levels = list(_levels(best))
    over = float(free.time[np.flatnonzero(speed > floor)[-1]]) if speed.max() > floor else last
    place = over if over < np.sqrt(first * last) else first  # next to the natural earthquake, if there is space
    top = free.time[int(np.argmax(speed > speed.max() / 2))]  # time of the first earthquake
    left = top > np.sqrt(first * last)
    look = {"xytext": (-8 if left else 8, -4), "textcoords": "offset points", "fontsize": SMALL}
    text = f"without control: {quantity(float(speed.max()), 'm/s')}"
    rate.annotate(text, (top, float(speed.max())), ha="right" if left else "left", **look)
    for number, (value, text, line, shade) in enumerate(levels):
        rate.axhline(value, color=shade, linestyle=line, linewidth=1.2, label=text)
        look = {"color": shade, "fontsize": SMALL, "textcoords": "offset points", "va": "top" if number else "bottom"}
        near = (place, min(level[0] for level in levels) if number else value)
        rate.annotate(text, near, xytext=(5, 10 - 11 * number if number else 1), **look)
    rate.tick_params(labelbottom=True)
    size, unit = length(max(float(present(own.reference).max()), float(free.slip.max())))
    slip.plot(free.time, free.slip / size, color=NATURAL)
    slip.plot(own.time, own.slip / size, **(style(best) | {"linewidth": 2.4}))
    slip.plot(own.time, present(own.reference) / size, color="black", linestyle=":", linewidth=1, label="reference")
    slip.legend(loc="upper left", fontsize=SMALL)
    rate.set(yscale="log", ylabel="slip rate [m/s]", ylim=(floor, 3 * max(float(speed.max()), floor)))
    slip.set_ylabel(f"slip [{unit}]")
    slip.set(xscale="log", xlabel="time [s]", xlim=(first, last))
    note = f"largest value in each 1/25 of a decade; gaps: slip rate below {floor:.1g} m/s, or at rest"
    title = f"{comparison.fault.name}: with and without control"
    return finish(drawing, title, ran, with_diverged(comparison.entries, note), legend=rate)


def _levels(entry: "Entry") -> "Iterator[tuple[float, str, Any, str]]":
    """Proved slip-rate bound, worst case found, and performance limit, as far as available.

    On the plant without stick the last two are slip-rate errors.
    """
    if entry.proof is None or entry.guarantee is None:
        return
    peak = entry.proof.peak_slip_rate
    yield float(peak), f"proved: at most {peak.quantity('m/s')}", (0, (10, 3)), PROVED
    of, seen = " of slip-rate error" * bool(entry.proof.scope), entry.guarantee.worst
    if seen is not None:
        worst = (seen.slip_rate_error if entry.proof.scope else seen.peak_slip_rate) or 0.0
        yield worst, f"worst case{of} found: {quantity(worst, 'm/s')}", "dotted", INDUCED
    least = entry.guarantee.least_slip_rate
    if least is not None:
        yield float(least), f"performance limit{of}: {least.quantity('m/s')}", "dashdot", "#777777"


def _largest(time: "np.ndarray", values: "np.ndarray") -> "tuple[np.ndarray, np.ndarray]":
    """Time and largest value of each twenty-fifth of a decade."""
    inside = time > 0
    steps = np.floor(25 * np.log10(time[inside])).astype(int)
    starts = np.flatnonzero(np.diff(steps, prepend=steps[0] - 1))
    return time[inside][starts], np.maximum.reduceat(values[inside], starts)


def uncontrolled(comparison: "Compared") -> "Figure":
    """Slip and slip rate of the natural earthquake, and the slip of the next static equilibrium."""
    run, fault = comparison.uncontrolled, comparison.fault
    drawing, ((slip,), (rate,)) = figure(2, 3.2)
    size, unit = length(float(run.slip.max()))
    last = end(run)
    divisor, name = clock(last)
    slip.set_xlim(-0.03 * last / divisor, last / divisor)
    slip.plot(run.time / divisor, run.slip / size, color=NATURAL)
    slip.axhline(fault.rest_slip / size, color="grey", linestyle=":", label="slip of the next static equilibrium")
    slip.set_ylabel(f"slip [{unit}]")
    slip.legend(loc="lower right", fontsize=SMALL)
    rate.plot(run.time / divisor, run.slip_rate, color=NATURAL)
    rate.set_ylabel("slip rate [m/s]")
    rate.set_xlabel(f"time [{name}]")
    event = f"magnitude {fault.magnitude:.2f}" if fault.seismic_moment > 0 else "no earthquake"
    return finish(drawing, f"{fault.name} without control: {event}", [run])


def end(*runs: "Trajectory") -> float:
    """End [s] of the time axis of earthquakes: at most 1.4 times the time at which 99.5 % of the slip is reached."""
    settled = [run.time[int(np.argmax(np.abs(run.slip) >= 0.995 * np.abs(run.slip).max()))] for run in runs]
    return float(min(1.4 * max(settled), min(run.time[-1] for run in runs))) or float(runs[0].time[-1])


def error_figure(comparison: "Compared") -> "Figure":
    """Envelopes of the absolute values of both tracking errors over time."""
    drawing, ((slip,), (rate,)) = figure(2, 3.9)
    runs = runs_of(comparison.entries)
    divisor, unit = clock(max(float(run.time[-1]) for _, run in runs))
    for entry, run in runs:
        for axis, values in ((slip, run.slip_error), (rate, run.slip_rate_error)):
            middle, _, largest = band(run.time / divisor, np.abs(present(values)))
            axis.plot(middle, np.maximum(largest, 1e-300), **style(entry))
    _proved_bounds(slip, rate, [entry for entry, _ in runs])
    for axis, label in ((slip, "|slip error| [m]"), (rate, "|slip-rate error| [m/s]")):
        axis.set_yscale("log")
        axis.set_ylabel(label)
    rate.set_xlabel(f"time [{unit}]")
    title = f"{comparison.fault.name}: tracking errors"
    return finish(
        drawing, title, runs, with_diverged(comparison.entries, "largest value of every 40 stored samples"), legend=slip
    )


def _proved_bounds(slip: "Axes", rate: "Axes", entries: "Sequence[Entry]") -> None:
    """Lines at the proved bounds of both errors; laws with the same bounds share a line."""
    bounds: dict[tuple[float, float], tuple[str, str]] = {}
    for entry in entries:
        proof = entry.proof
        if proof is not None and proof.slip_rate_error is not None:
            label = f"proved {proof.scope}".rstrip()
            ends = float(proof.bounds["slip_error"]), float(proof.slip_rate_error)
            bounds.setdefault(ends, (colour(entry.design.name), label))
    named = set[str]()
    for (of_slip, of_rate), (shade, label) in bounds.items():
        slip.axhline(of_slip, color=shade, linestyle=":", linewidth=1.4, label="" if label in named else label)
        rate.axhline(of_rate, color=shade, linestyle=":", linewidth=1.4)
        named.add(label)


_SHOWN = {
    "max_slip_error": "max |slip error|",
    "max_slip_rate_error": "max |slip-rate error|",
    "rms_pressure": "RMS pressure",
    "pressure_total_variation": "total variation of pressure",
}


def metrics(comparison: "Compared") -> "Figure":
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
    title = f"{comparison.fault.name}: metrics after the first quarter of the run"
    return finish(drawing, title, settled, with_diverged(comparison.entries))


# ----------------------------------------------------------------------
# A map of stability: stiffness against effective normal stress and against injected pressure.

_COLOURS = {"unstable": "#F3C6B2", "stable": "#BFD9EC"}


def stability_map(
    fault: Fault, *, pressure: float = 0, loading_rate: float | None = None, inertia: bool = True
) -> "Figure":
    """Stable and unstable regions of a fault, whose boundaries are its symbolic stability conditions.

    The left panel varies the effective normal stress σ' at the given pressure, the right panel the pressure p at the
    fault's σ'. Mass, damping and friction are the fault's. The marker is the fault, whose verdict is exact.

    Parameters
    ----------
    fault : Fault
    pressure : float
        Injected pressure [Pa] at which the fault is marked, below its effective normal stress.
    loading_rate : float, optional
        Slip rate [m/s] of steady sliding; by default the law's ``operating_rate``.
    inertia : bool
        Whether inertia is included.

    Raises
    ------
    ParameterError
        When the pressure opens the fault, or the rate is outside the law's domain.
    """
    regions = stability_regions(fault, pressure=pressure, loading_rate=loading_rate, inertia=inertia)
    drawing, ((left, right),) = figure(1, 3.6, 2, sharey=True)
    normal, outcome = fault.effective_normal_stress, regions.verdict.outcome.name.lower()
    (size, unit), (high, stiff) = scaled(normal, "Pa"), scaled(regions.stiffness.max(), "Pa")
    for axis, plane in ((left, regions.over_stress), (right, regions.over_pressure)):
        _region(axis, plane, size, regions.stiffness / high, high)
        axis.plot(plane.own / size, regions.own / high, "ko", markersize=7, label=f"{fault.name}: {outcome}")
    left.set_xlabel(f"effective normal stress σ' [{unit}] (p = {pressure / size:.4g} {unit})")
    right.set_xlabel(f"injected pressure p [{unit}] (σ' = {normal / size:.4g} {unit}; p < 0 is withdrawal)")
    left.set_ylabel(f"stiffness per area k/A [{stiff}/m]")
    if regions.nucleation_length is not None:
        left.plot(normal / size, regions.critical / high, "kx", label="critical stiffness at this σ'")
    box = {"boxstyle": "round", "facecolor": "white", "alpha": 0.85, "edgecolor": "#999999"}
    left.text(0.03, 0.97, _critical(regions, fault), transform=left.transAxes, va="top", fontsize=8, bbox=box)
    once = {
        name: handle for axis in (left, right) for handle, name in zip(*axis.get_legend_handles_labels(), strict=True)
    }
    drawing.legend(once.values(), once.keys(), loc="outside lower center", ncols=3, fontsize=8)
    rate, mass = float(regions.verdict.loading_rate), "with inertia" if inertia else "quasi-dynamic"
    about = f"steady sliding at {rate:.3g} m/s" if rate else "rest"
    drawing.suptitle(
        f"{fault.name}, {fault.friction.name}, about {about}, {mass}: {outcome}, "
        f"margin {float(regions.verdict.margin[0]):+.3g}",
        fontsize=10,
    )
    return drawing


def _region(axis: "Axes", plane: Plane, size: float, stiffness: np.ndarray, high: float) -> None:
    """Colour both regions of a panel; draw the critical stiffness and the damping limits."""
    across, critical = plane.across / size, np.where(plane.critical > 0, plane.critical, np.nan) / high
    levels = [-0.5, 0.5, 1.5]
    axis.contourf(across, stiffness, plane.stable.astype(float), levels=levels, colors=list(_COLOURS.values()))
    for name, shade in _COLOURS.items():
        if (plane.stable == (name == "stable")).any():
            axis.fill_between([], [], color=shade, label=name)
    if np.isfinite(critical).any():
        axis.plot(across, critical, color="black", label="critical stiffness")
    for limit in plane.limits:
        axis.axvline(limit / size, color="black", linestyle="--", label="damping limit")
    axis.set(xlim=(np.min(across), np.max(across)), ylim=(np.min(stiffness), np.max(stiffness)))


def _critical(regions: StabilityRegions, fault: Fault) -> str:
    if regions.nucleation_length is None:
        return "no critical stiffness"
    (size, unit), (metres, metre) = scaled(regions.critical, "Pa"), scaled(regions.nucleation_length, "m")
    side, km = scaled(fault.side, "m")
    return (
        f"critical stiffness per area {regions.critical / size:.4g} {unit}/m\n"
        f"nucleation length {regions.nucleation_length / metres:.4g} {metre}\n"
        f"fault length {fault.side / side:.4g} {km}"
    )
