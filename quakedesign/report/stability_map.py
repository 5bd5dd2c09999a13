"""A map of stability: stiffness against effective normal stress and against injected pressure."""

from typing import Any

import numpy as np

from quakedesign.fault import Fault
from quakedesign.report.drawing import scaled
from quakedesign.studies.stability_regions import Plane, StabilityRegions, stability_regions
from quakedesign.symbolic.stability import StabilityVerdict

_COLOURS = {"stable": "#BFD9EC", "unstable": "#F3C6B2"}


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
    return _drawn(stability_regions(fault, pressure=pressure, loading_rate=loading_rate, inertia=inertia))


def _drawn(regions: StabilityRegions) -> Any:
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(10, 4.8), layout="constrained", dpi=150)
    left, right = drawing.subplots(1, 2, sharey=True)
    normal = regions.fault.effective_normal_stress
    (size, unit), (high, stiff) = scaled(normal, "Pa"), scaled(regions.stiffness.max(), "Pa")
    label = f"{regions.fault.name}: {regions.verdict.outcome.name.lower()}"
    for axis, plane in ((left, regions.over_stress), (right, regions.over_pressure)):
        _region(axis, plane, regions.stiffness)
        for limit in plane.limits:
            axis.axvline(limit / size, color="black", linestyle="--", label="damping limit")
        axis.plot(plane.own / size, regions.own / high, "ko", markersize=7, label=label)
    left.set_xlabel(f"effective normal stress σ' [{unit}] (p = {regions.pressure / size:.4g} {unit})")
    right.set_xlabel(f"injected pressure p [{unit}] (σ' = {normal / size:.4g} {unit}; p < 0 is withdrawal)")
    left.set_ylabel(f"stiffness per area k/A [{stiff}/m]")
    _annotate(left, regions)
    once = {label: handle for axis in (left, right) for handle, label in _legend(axis)}
    drawing.legend(once.values(), once.keys(), loc="outside lower center", ncols=4, fontsize=9)
    drawing.suptitle(_title(regions.fault, regions.verdict))
    return drawing


def _title(fault: Fault, verdict: StabilityVerdict) -> str:
    where = f"steady sliding at {float(verdict.loading_rate):.3g} m/s" if verdict.loading_rate else "rest"
    mass = "with inertia" if verdict.inertia else "quasi-dynamic"
    return (
        f"{fault.name}, {fault.friction.name}, about {where}, {mass}: {verdict.outcome.name.lower()}, "
        f"margin {float(verdict.margin[0]):+.3g}"
    )


def _region(axis: Any, plane: Plane, stiffness: np.ndarray) -> None:
    """Colour one panel by what is stable, and draw the critical stiffness."""
    across, stable, curve = plane.across, plane.stable, plane.critical
    wide, high = scaled(np.abs(across).max() / 2, "Pa")[0], scaled(stiffness.max(), "Pa")[0]
    axis.contourf(
        across / wide, stiffness / high, stable.astype(float), levels=[-0.5, 0.5, 1.5],
        colors=[_COLOURS["unstable"], _COLOURS["stable"]],
    )  # fmt: skip
    for name, place in (("unstable", False), ("stable", True)):
        if (stable == place).any():
            axis.fill_between([], [], color=_COLOURS[name], label=name)
    if np.isfinite(curve).any() and (curve > 0).any():
        axis.plot(across / wide, np.where(curve > 0, curve, np.nan) / high, color="black", label="critical stiffness")
    axis.set_xlim(across.min() / wide, across.max() / wide)
    axis.set_ylim(stiffness.min() / high, stiffness.max() / high)


def _annotate(axis: Any, regions: StabilityRegions) -> None:
    said = "no critical stiffness"
    if regions.nucleation_length is not None:
        size, unit = scaled(regions.critical, "Pa")
        said = (
            f"critical stiffness per area {regions.critical / size:.4g} {unit}/m\n"
            f"nucleation length {_metres(regions.nucleation_length)}\nfault length {_metres(regions.fault.side)}"
        )
        wide, high = scaled(regions.over_stress.own, "Pa")[0], scaled(regions.stiffness.max(), "Pa")[0]
        axis.plot(regions.over_stress.own / wide, regions.critical / high, "kx", label="critical here")
    axis.text(
        0.03, 0.97, said, transform=axis.transAxes, va="top", fontsize=9,
        bbox={"boxstyle": "round", "facecolor": "white", "alpha": 0.85, "edgecolor": "#999999"},
    )  # fmt: skip


def _metres(length: float) -> str:
    size, unit = scaled(length, "m")
    return f"{length / size:.4g} {unit}"


def _legend(axis: Any) -> Any:
    return zip(*axis.get_legend_handles_labels(), strict=True)
