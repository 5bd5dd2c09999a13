"""The figure of one run."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np

    from quakedesign.simulation.sampled_trajectory import Signal
    from quakedesign.simulation.trajectory import Trajectory

    Beside = tuple[str, np.ndarray | None]

NOTHING = ("", None)
_TIMES = ((2 * 86400.0, 86400.0, "d"), (2 * 3600.0, 3600.0, "h"), (2 * 60.0, 60.0, "min"), (0.0, 1.0, "s"))
_PREFIXES = ((1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def figure(run: "Trajectory", actuation: "Mapping[str, Signal] | None" = None) -> Any:
    """Return a Figure with slip, slip rate and pressure, errors where something is followed, and what an actuator adds.

    The pressure at the well is in the panel of that in the fault.
    """
    from matplotlib.figure import Figure

    further = dict(actuation or {})
    well = further.pop("well_pressure", None)
    panels: list[tuple[str, str, Any, Beside]] = [
        ("slip", "m", run.slip, ("reference", run.reference)),
        ("slip rate", "m/s", run.slip_rate, ("reference", run.reference_rate)),
        ("pressure", "Pa", run.pressure, ("at the well", well[0] if well else None)),
    ]
    if run.slip_error is not None:
        panels += [
            ("slip error", "m", run.slip_error, NOTHING),
            ("slip-rate error", "m/s", run.slip_rate_error, NOTHING),
        ]
    panels += [(title, unit, values, NOTHING) for values, title, unit in further.values()]
    drawing = Figure(figsize=(7, 1.9 * len(panels)), layout="constrained")
    axes = drawing.subplots(len(panels), 1, sharex=True)
    divisor, unit = next((size, name) for least, size, name in _TIMES if run.time[-1] >= least)
    for axis, (title, si_unit, values, beside) in zip(axes, panels, strict=True):
        _panel(axis, run.time / divisor, title, si_unit, values, beside)
    axes[-1].set_xlabel(f"time [{unit}]")
    drawing.suptitle(run.name + _shown(run))
    return drawing


def stress_figure(run: "Trajectory") -> Any:
    """Return a Figure of shear stress against slip (the area under it is the work per area), and of the moment rate."""
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(7, 4.5), layout="constrained")
    above, below = drawing.subplots(2, 1)
    slip, slip_prefix = _prefix(float(abs(run.slip).max()))
    _panel(above, run.slip / slip, "shear stress", "Pa", run.shear_stress, NOTHING)
    above.set_xlabel(f"slip [{slip_prefix}m]")
    divisor, unit = next((size, name) for least, size, name in _TIMES if run.time[-1] >= least)
    below.plot(run.time / divisor, run.moment_rate, linewidth=1)
    below.set_ylabel("moment rate [N m/s]")
    below.set_xlabel(f"time [{unit}]")
    below.grid(visible=True, alpha=0.3)
    drawing.suptitle(run.name + _shown(run))
    return drawing


def _shown(run: "Trajectory") -> str:
    """How much of the run is drawn: what happened in between is in its metrics alone."""
    kept = len(run.time) - 1
    return f"\n{kept} of {run.metrics.steps} steps drawn" if kept < run.metrics.steps else ""


def _panel(axis: Any, time: "np.ndarray", title: str, unit: str, values: Any, beside: "Beside") -> None:
    name, others = beside
    largest = max(float(abs(curve).max()) for curve in (values, others) if curve is not None)
    # No prefix where the unit is a power, which would belong to what is inside of it.
    size, prefix = (1.0, "") if "^" in unit else _prefix(largest)
    if others is not None:
        axis.plot(time, others / size, "--", color="black", linewidth=1, label=name)
    axis.plot(time, values / size, linewidth=1, label="fault", zorder=2.5 if name == "reference" else 1.5)
    if others is not None:
        axis.legend(loc="best")
    axis.set_ylabel(f"{title} [{prefix}{unit.replace('^2', '²').replace('^3', '³')}]")
    axis.grid(visible=True, alpha=0.3)


def _prefix(largest: float) -> tuple[float, str]:
    return next(
        ((size, prefix) for size, prefix in _PREFIXES if largest >= size),
        _PREFIXES[-1] if largest else (1.0, ""),
    )
