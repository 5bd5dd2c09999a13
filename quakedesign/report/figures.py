"""Figures of a comparison: one idea each, axes with units."""

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from quakedesign.report.comparison import Comparison, Entry
    from quakedesign.simulation import Trajectory

_COLOURS = {"cta": "#0072B2", "dia": "#009E73", "elqr": "#D55E00"}
_STYLES = {"published": (0, (4, 2)), "designed": "solid"}


def figures(comparison: "Comparison") -> dict[str, Any]:
    """Figures by name: ``uncontrolled``, ``states``, ``pressure``, ``errors``, ``metrics``."""
    drawn = {"uncontrolled": _uncontrolled(comparison)}
    if any(e.run is not None for e in comparison.entries):
        drawn |= {
            "states": _states(comparison),
            "pressure": _pressure(comparison),
            "errors": _errors(comparison),
            "metrics": _metrics(comparison),
        }
    return drawn


def _figure(rows: int, height: float, columns: int = 1) -> tuple[Any, Any]:
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(8, height), layout="constrained", dpi=150)
    axes = drawing.subplots(rows, columns, sharex=columns == 1, squeeze=False).ravel()
    for axis in axes:
        axis.grid(visible=True, alpha=0.3)
    return drawing, axes


def _runs(comparison: "Comparison") -> "list[tuple[Entry, Trajectory]]":
    return [(e, e.run) for e in comparison.entries if e.run is not None]


def _known(values: np.ndarray | None) -> np.ndarray:
    """Values of a controlled run, which always has a reference."""
    assert values is not None
    return values


def _style(entry: "Entry") -> dict[str, Any]:
    return {
        "color": _COLOURS.get(entry.design.name, "#555555"),
        "linestyle": _STYLES[entry.origin],
        "linewidth": 1.4 if entry.origin == "designed" else 1.1,
        "label": entry.label,
    }


def _hours(values: np.ndarray) -> np.ndarray:
    return values / 3600


def _length(largest: float) -> tuple[float, str]:
    return (1e-3, "mm") if largest < 0.1 else (1.0, "m")


def _uncontrolled(comparison: "Comparison") -> Any:
    run, fault = comparison.uncontrolled, comparison.fault
    drawing, (slip, rate) = _figure(2, 4.6)
    size, unit = _length(float(run.slip.max()))
    slip.plot(run.time, run.slip / size, color="black")
    slip.axhline(fault.rest_slip / size, color="grey", linestyle=":", label="next rest slip (statics)")
    slip.set_ylabel(f"slip [{unit}]")
    slip.legend(loc="lower right")
    rate.plot(run.time, run.slip_rate, color="black")
    rate.set_ylabel("slip rate [m/s]")
    rate.set_xlabel("time [s]")
    drawing.suptitle(f"{fault.name} without control: magnitude {fault.magnitude:.2f}")
    return drawing


def _states(comparison: "Comparison") -> Any:
    drawing, (slip, rate) = _figure(2, 5.6)
    runs = _runs(comparison)
    first = runs[0][1]
    hours, reference, reference_rate = _hours(first.time), _known(first.reference), np.abs(_known(first.reference_rate))
    size, unit = _length(float(reference.max()))
    for entry, run in runs:
        slip.plot(_hours(run.time), run.slip / size, **_style(entry))
        rate.plot(*_envelope(_hours(run.time), np.abs(run.slip_rate)), **_style(entry))
    slip.plot(hours, reference / size, color="black", linestyle=":", label="reference")
    peak = comparison.uncontrolled.metrics.peak_slip_rate
    if peak:
        rate.axhline(peak, color="black", linestyle="--", label="uncontrolled peak")
    rate.plot(hours, reference_rate, color="black", linestyle=":", label="reference")
    rate.set_yscale("log")
    rate.set_ylim(bottom=float(reference_rate.max()) * 1e-2)
    slip.set_ylabel(f"slip [{unit}]")
    rate.set_ylabel("|slip rate| [m/s]")
    rate.set_xlabel("time [h]")
    drawing.legend(*rate.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    drawing.suptitle(f"{comparison.fault.name}: states in closed loop (slip rate: largest of every 40 samples)")
    return drawing


def _pressure(comparison: "Comparison") -> Any:
    runs = _runs(comparison)
    drawing, axes = _figure(len(runs), 1.1 + 1.25 * len(runs))
    size, unit = (1e6, "MPa") if comparison.fault.effective_normal_stress > 1e6 else (1e3, "kPa")
    for axis, (entry, run) in zip(axes, runs, strict=True):
        axis.plot(
            _hours(run.time),
            run.pressure / size,
            **_style(entry) | {"linestyle": "solid", "linewidth": 0.6},
        )
        axis.set_title(entry.label, fontsize=9)
        axis.set_ylabel(f"p [{unit}]")
    axes[-1].set_xlabel("time [h]")
    drawing.suptitle(f"{comparison.fault.name}: fluid pressure")
    return drawing


def _errors(comparison: "Comparison") -> Any:
    drawing, (slip, rate) = _figure(2, 6)
    for entry, run in _runs(comparison):
        for axis, values in ((slip, run.slip_error), (rate, run.slip_rate_error)):
            time, envelope = _envelope(_hours(run.time), np.abs(_known(values)))
            axis.plot(time, envelope, **_style(entry))
    for axis, label in ((slip, "|slip error| [m]"), (rate, "|slip-rate error| [m/s]")):
        axis.set_yscale("log")
        axis.set_ylabel(label)
    rate.set_xlabel("time [h]")
    drawing.legend(*slip.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8)
    drawing.suptitle(f"{comparison.fault.name}: tracking errors (largest of every 40 samples)")
    return drawing


def _envelope(time: np.ndarray, values: np.ndarray, width: int = 40) -> tuple[np.ndarray, np.ndarray]:
    count = len(values) // width
    largest = values[: count * width].reshape(count, width).max(axis=1)
    return time[: count * width].reshape(count, width).mean(axis=1), np.maximum(largest, 1e-300)


def _metrics(comparison: "Comparison") -> Any:
    shown = {
        "max_slip_error": "max |slip error| [m]",
        "max_slip_rate_error": "max |slip-rate error| [m/s]",
        "rms_pressure": "RMS pressure [Pa]",
        "pressure_total_variation": "total variation of pressure [Pa]",
    }
    drawing, axes = _figure(2, 6.5, columns=2)
    settled = [(e, run.metrics) for e, run in _runs(comparison) if run.metrics.max_slip_error is not None]
    entries = [e for e, _ in settled]
    for axis, (name, label) in zip(axes, shown.items(), strict=True):
        values = [getattr(figures, name) for _, figures in settled]
        bars = axis.barh(range(len(entries)), values, color=[_COLOURS.get(e.design.name, "#555555") for e in entries])
        for bar, entry in zip(bars, entries, strict=True):
            bar.set_alpha(0.45 if entry.origin == "published" else 1.0)
        axis.bar_label(bars, [f"{v:.2e}" for v in values], fontsize=7, padding=2)
        axis.set_yticks(range(len(entries)), [e.label for e in entries], fontsize=7)
        axis.invert_yaxis()
        axis.set_xlabel(label)
        if name != "rms_pressure" and min(values, default=1) > 0:
            axis.set_xscale("log")
            axis.set_xlim(right=max(values) * 30)
        else:
            axis.set_xlim(right=max(values, default=1) * 1.35)
    drawing.suptitle(f"{comparison.fault.name}: comparison after a quarter of the task")
    return drawing
