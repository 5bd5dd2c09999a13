"""The figure of one run."""

from collections.abc import Sequence
from typing import Any

Panel = tuple[str, str, Any, tuple[str, Any]]
"""Name, SI unit and values of a signal, and name and values of one that is drawn beside it."""
NOTHING = ("", None)
_TIMES = ((2 * 86400.0, 86400.0, "d"), (2 * 3600.0, 3600.0, "h"), (2 * 60.0, 60.0, "min"), (0.0, 1.0, "s"))
_PREFIXES = ((1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def figure(title: str, time: Any, panels: Sequence[Panel]) -> Any:
    """Return a Figure of signals over time [s], one panel each."""
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(7, 1.9 * len(panels)), layout="constrained")
    axes = drawing.subplots(len(panels), 1, sharex=True)
    divisor, unit = next((size, name) for least, size, name in _TIMES if time[-1] >= least)
    for axis, (name, si_unit, values, beside) in zip(axes, panels, strict=True):
        _panel(axis, time / divisor, name, si_unit, values, beside)
    axes[-1].set_xlabel(f"time [{unit}]")
    drawing.suptitle(title)
    return drawing


def stress_figure(title: str, time: Any, slip: Any, shear_stress: Any, moment_rate: Any) -> Any:
    """Return a Figure of shear stress against slip (the area under it is the work per area), and of the moment rate."""
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(7, 4.5), layout="constrained")
    above, below = drawing.subplots(2, 1)
    size, prefix = _prefix(float(abs(slip).max()))
    _panel(above, slip / size, "shear stress", "Pa", shear_stress, NOTHING)
    above.set_xlabel(f"slip [{prefix}m]")
    divisor, unit = next((size, name) for least, size, name in _TIMES if time[-1] >= least)
    below.plot(time / divisor, moment_rate, linewidth=1)
    below.set_ylabel("moment rate [N m/s]")
    below.set_xlabel(f"time [{unit}]")
    below.grid(visible=True, alpha=0.3)
    drawing.suptitle(title)
    return drawing


def _panel(axis: Any, time: Any, title: str, unit: str, values: Any, beside: tuple[str, Any]) -> None:
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
