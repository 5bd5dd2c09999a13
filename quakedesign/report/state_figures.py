"""Figures of faults whose friction has a state: their cycle, and how they are held in slow sliding."""

from typing import TYPE_CHECKING, Any

import numpy as np

from quakedesign.report.drawing import NATURAL, band, clock, colour, figure, finish, known, length, scaled
from quakedesign.simulation.slow_sliding import SlidingRun

if TYPE_CHECKING:
    from quakedesign.studies.comparison import Compared, Entry
    from quakedesign.studies.state_runs import StateRun

_BANDS = 600  # of a run at most: more are not seen, and make a file of many megabytes
_PER_BAND = 16  # instants at least, four periods


def state_figures(comparison: "Compared", natural: "StateRun") -> dict[str, Any]:
    """``cycle``, where it is known, and ``slow-sliding`` and ``sliding-errors`` of the first law that ran."""
    held = next(((e, e.run) for e in comparison.entries if isinstance(e.run, SlidingRun)), None)
    drawn = {} if natural.failed else {"cycle": cycle(comparison, natural)}
    return drawn if held is None else drawn | {"slow-sliding": slow_sliding(*held), "sliding-errors": errors(*held)}


def cycle(comparison: "Compared", natural: "StateRun") -> Any:
    """Slip and slip rate without control."""
    run, name = natural.trajectory, comparison.fault.name
    drawing, ((slip,), (rate,)) = figure(2, 3.6)
    size, unit = length(float(run.slip.max()))
    divisor, passing = clock(float(run.time[-1]))
    slip.plot(run.time / divisor, run.slip / size, color=NATURAL)
    slip.set_ylabel(f"slip [{unit}]")
    rate.semilogy(run.time / divisor, run.slip_rate, color=NATURAL)
    rate.axhline(natural.loading_rate, color="grey", linestyle=":", label="loading rate")
    rate.set_ylabel("slip rate [m/s]")
    rate.set_xlabel(f"time [{passing}]")
    moved = "with inertia" if natural.provenance["plant"] == "smooth" else natural.provenance["plant"]
    made = f"method {run.provenance['method']}, tolerance {run.provenance['rtol']:g}, {moved}"
    return finish(drawing, f"{name} without control", [], made, legend=rate)


def slow_sliding(entry: "Entry", run: SlidingRun) -> Any:
    """Slip, slip rate, pressure and state of a law that holds slow sliding."""
    fault, shade = entry.design.fault, colour(entry.design.name)
    drawing, ((slip,), (rate,), (pressure,), (state,)) = figure(4, 6.6)
    divisor, unit = clock(float(run.time[-1]))
    time, speed = run.time / divisor, known(run.reference_rate)
    size, name = length(float(run.slip.max()))
    slip.plot(time, run.slip / size, color=shade, linewidth=2.5)
    slip.plot(time, known(run.reference) / size, color="black", linestyle=":", linewidth=1, label="reference")
    slip.set_ylabel(f"slip [{name}]")
    first = float(speed[0])
    _filled(rate, time, run.slip_rate / first, shade)
    rate.plot(time, speed / first, color="black", linestyle=":", linewidth=1, label="reference")
    if entry.guaranteed is not None:
        never = float(entry.guaranteed.peak_slip_rate) / first
        rate.axhline(never, color="black", linestyle="--", label="never exceeded, proved")
    rate.set_ylabel("slip rate / V [-]")
    largest, pascal = scaled(float(np.abs(run.pressure).max()) or 1.0, "Pa")
    _filled(pressure, time, run.pressure / largest, shade)
    pressure.set_ylabel(f"pressure [{pascal}]")
    (steady,) = map(float, fault.friction.steady_state(first))
    _filled(state, time, run.theta / steady, shade)
    state.set_ylabel("state / steady [-]")
    state.set_ylim(min(state.get_ylim()[0], 0.99), max(state.get_ylim()[1], 1.01))
    state.set_xlabel(f"time [{unit}]")
    shaken = f"shear stress up to {float(np.abs(run.stress).max()) / 1e3:.3g} kPa"
    note = f"V = {first:.4g} m/s; bands between the extremes of {_width(run.time)} instants; {shaken}"
    return finish(drawing, f"{fault.name} held in slow sliding", [run], note, legend=rate)


def errors(entry: "Entry", run: SlidingRun) -> Any:
    """Slip and slip rate less their references."""
    drawing, axes = figure(2, 3.6)
    divisor, unit = clock(float(run.time[-1]))
    shown = ((known(run.slip_error), "m", "slip error"), (known(run.slip_rate_error), "m/s", "slip-rate error"))
    for (axis,), (values, si, name) in zip(axes, shown, strict=True):
        size, scale = scaled(float(np.abs(values).max()) or 1.0, si)
        _filled(axis, run.time / divisor, values / size, colour(entry.design.name))
        axis.set_ylabel(f"{name} [{scale}]")
    axes[1, 0].set_xlabel(f"time [{unit}]")
    note = f"bands between the extremes of {_width(run.time)} instants"
    return finish(drawing, f"{entry.design.fault.name}: tracking errors", [run], note)


def _filled(axis: Any, time: "np.ndarray", values: "np.ndarray", shade: str) -> None:
    middle, low, high = band(time, values, _width(time))
    axis.fill_between(middle, low, high, color=shade, linewidth=0.8)


def _width(time: "np.ndarray") -> int:
    """Instants of a band."""
    return max(_PER_BAND, len(time) // _BANDS)
