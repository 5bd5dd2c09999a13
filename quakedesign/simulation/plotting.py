"""The figure of one run."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

    from quakedesign.simulation.trajectory import Trajectory

_TIMES = ((2 * 86400.0, 86400.0, "d"), (2 * 3600.0, 3600.0, "h"), (2 * 60.0, 60.0, "min"), (0.0, 1.0, "s"))
_PREFIXES = ((1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def figure(run: "Trajectory") -> Any:
    """Return a Figure with slip, slip rate and pressure, and errors where something is followed."""
    from matplotlib.figure import Figure

    panels: list[tuple[str, str, Any, Any]] = [
        ("slip", "m", run.slip, run.reference),
        ("slip rate", "m/s", run.slip_rate, run.reference_rate),
        ("pressure", "Pa", run.pressure, None),
    ]
    if run.slip_error is not None:
        panels += [
            ("slip error", "m", run.slip_error, None),
            ("slip-rate error", "m/s", run.slip_rate_error, None),
        ]
    drawing = Figure(figsize=(7, 1.9 * len(panels)), layout="constrained")
    axes = drawing.subplots(len(panels), 1, sharex=True)
    divisor, unit = next((size, name) for least, size, name in _TIMES if run.time[-1] >= least)
    for axis, (title, si_unit, values, followed) in zip(axes, panels, strict=True):
        _panel(axis, run.time / divisor, title, si_unit, values, followed)
    axes[-1].set_xlabel(f"time [{unit}]")
    drawing.suptitle(run.name)
    return drawing


def stress_figure(run: "Trajectory") -> Any:
    """Return a Figure of shear stress against slip (the area under it is the work per area), and of the moment rate."""
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(7, 4.5), layout="constrained")
    above, below = drawing.subplots(2, 1)
    slip, slip_prefix = _prefix(float(abs(run.slip).max()))
    _panel(above, run.slip / slip, "shear stress", "Pa", run.shear_stress, None)
    above.set_xlabel(f"slip [{slip_prefix}m]")
    divisor, unit = next((size, name) for least, size, name in _TIMES if run.time[-1] >= least)
    below.plot(run.time / divisor, run.moment_rate, linewidth=1)
    below.set_ylabel("moment rate [N m/s]")
    below.set_xlabel(f"time [{unit}]")
    below.grid(visible=True, alpha=0.3)
    drawing.suptitle(run.name)
    return drawing


def _panel(axis: Any, time: "np.ndarray", title: str, unit: str, values: Any, followed: Any) -> None:
    size, prefix = _prefix(float(abs(values).max()))
    axis.plot(time, values / size, linewidth=1, label="run")
    if followed is not None:
        axis.plot(time, followed / size, "--", color="black", linewidth=1, label="reference")
        axis.legend(loc="best")
    axis.set_ylabel(f"{title} [{prefix}{unit}]")
    axis.grid(visible=True, alpha=0.3)


def _prefix(largest: float) -> tuple[float, str]:
    return next(
        ((size, prefix) for size, prefix in _PREFIXES if largest >= size),
        _PREFIXES[-1] if largest else (1.0, ""),
    )
