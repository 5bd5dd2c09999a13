"""A map of stability: stiffness against effective normal stress and against injected pressure."""

from typing import Any

import numpy as np

from quakedesign.fault import Fault
from quakedesign.report.drawing import figure, scaled
from quakedesign.studies.stability_regions import Plane, StabilityRegions, stability_regions

_COLOURS = {"unstable": "#F3C6B2", "stable": "#BFD9EC"}


def stability_map(fault: Fault, *, pressure: float = 0, loading_rate: float | None = None, inertia: bool = True) -> Any:
    """Draw the stable and the unstable region of a fault, bounded by its symbolic stability conditions.

    The left panel varies the effective normal stress σ' at the given pressure, the right one the pressure p at the
    fault's σ'. Mass, damping and friction are the fault's. The point is the fault; its verdict is exact.

    Parameters
    ----------
    fault : Fault
    pressure : float
        Injected pressure [Pa] at which the fault is marked, below its effective normal stress.
    loading_rate : float, optional
        Slip rate [m/s] of steady sliding; without it the law's ``operating_rate``.
    inertia : bool
        Whether the mass counts.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ParameterError
        When the pressure opens the fault, or the rate is outside of the law's domain.
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
        left.plot(normal / size, regions.critical / high, "kx", label="critical here")
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


def _region(axis: Any, plane: Plane, size: float, stiffness: np.ndarray, high: float) -> None:
    """Colour one panel by what is stable, and draw the critical stiffness and where damping alone decides."""
    across, critical = plane.across / size, np.where(plane.critical > 0, plane.critical, np.nan) / high
    levels = [-0.5, 0.5, 1.5]
    axis.contourf(across, stiffness, plane.stable.astype(float), levels=levels, colors=list(_COLOURS.values()))
    for name, colour in _COLOURS.items():
        if (plane.stable == (name == "stable")).any():
            axis.fill_between([], [], color=colour, label=name)
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
