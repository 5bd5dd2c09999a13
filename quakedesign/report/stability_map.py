"""Where a fault slides stably: stiffness against effective normal stress and against injected pressure."""

from typing import Any

import numpy as np
import sympy as sp

from quakedesign.errors import UnsupportedError
from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.symbolic import plant, state_plant
from quakedesign.symbolic.stability import nucleation_length, stability

_COLOURS = {"stable": "#BFD9EC", "unstable": "#F3C6B2"}
_SIZES = ((1e9, "GPa"), (1e6, "MPa"), (1e3, "kPa"), (1.0, "Pa"))
_GRID = 240


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
    from matplotlib.figure import Figure

    verdict = stability(fault, pressure=pressure, loading_rate=loading_rate, inertia=inertia)
    conditions, boundary, limits = _functions(fault, float(verdict.loading_rate), inertia)
    normal, own = fault.effective_normal_stress, fault.stiffness / fault.area
    critical = float(boundary(normal - pressure))
    top = 2 * max(own, critical if np.isfinite(critical) else own)
    drawing = Figure(figsize=(10, 4.8), layout="constrained", dpi=150)
    left, right = drawing.subplots(1, 2, sharey=True)
    stiffness = np.linspace(top / _GRID, top, _GRID)
    stresses = np.linspace(max(pressure, 0), max(2 * normal, normal + pressure), _GRID + 1)[1:]
    pressures = np.linspace(-normal, normal, _GRID + 1)[:-1]
    name = verdict.outcome.name.lower()
    for axis, across, effective, at in (
        (left, stresses, stresses - pressure, normal),
        (right, pressures, normal - pressures, pressure),
    ):
        _region(axis, across, effective, stiffness, conditions, boundary)
        for limit in limits:
            place = np.interp(limit, *_ascending(effective, across), left=np.nan, right=np.nan)
            axis.axvline(place / _size(normal)[0], color="black", linestyle="--", label="damping limit")
        axis.plot(at / _size(normal)[0], own / _size(top)[0], "ko", markersize=7, label=f"{fault.name}: {name}")
    size, unit = _size(normal)
    left.set_xlabel(f"effective normal stress σ' [{unit}] (p = {pressure / size:.4g} {unit})")
    right.set_xlabel(f"injected pressure p [{unit}] (σ' = {normal / size:.4g} {unit}; p < 0 is withdrawal)")
    left.set_ylabel(f"stiffness per area k/A [{_size(top)[1]}/m]")
    _annotate(left, fault, pressure, float(verdict.loading_rate), critical, top)
    drawing.legend(*_unique(left, right), loc="outside lower center", ncols=4, fontsize=9)
    drawing.suptitle(_title(fault, verdict))
    return drawing


def _title(fault: Fault, verdict: Any) -> str:
    where = f"steady sliding at {float(verdict.loading_rate):.3g} m/s" if verdict.loading_rate else "rest"
    mass = "with inertia" if verdict.inertia else "quasi-dynamic"
    return (
        f"{fault.name}, {fault.friction.name}, about {where}, {mass}: {verdict.outcome.name.lower()}, "
        f"margin {float(verdict.margin[0]):+.3g}"
    )


def _ascending(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    order = np.argsort(first)
    return first[order], second[order]


def _functions(fault: Fault, rate: float, inertia: bool) -> tuple[Any, Any, list[float]]:
    """What bounds the regions, from the symbolic conditions.

    The conditions as functions of effective stress [Pa] and stiffness per area [Pa/m], the critical stiffness as
    function of effective stress, and the effective stresses at which a condition without stiffness is zero.
    """
    law = fault.friction
    at = sp.Rational(str(rational(rate)))
    values = {s: v for s, v in plant.plant_values(fault).items() if s not in (plant.k_hat, plant.sigma)}
    slopes = state_plant.slopes(law.exact(), at)
    stress, per_area = state_plant.effective_stress, sp.Symbol("K", positive=True)
    per_stiffness = {plant.k_hat: per_area * values[plant.N_hat]}
    numeric = [
        c.subs(slopes).subs(values).subs(per_stiffness)
        for c in state_plant.stability_conditions(law.state_names, inertia=inertia)
    ]
    conditions = [sp.lambdify((stress, per_area), sp.N(c)) for c in numeric]
    fixed = [sp.Poly(c, stress) for c in numeric if stress in c.free_symbols and per_area not in c.free_symbols]
    limits = [float(sp.re(r)) for c in fixed for r in c.nroots() if sp.im(r) == 0 and sp.re(r) > 0]
    try:
        critical = state_plant.critical_stiffness(law.symbolic(), inertia=inertia) / plant.N_hat
    except UnsupportedError:
        return conditions, lambda s: np.full(np.shape(s), np.nan), limits
    known = {**law.values(), **values, state_plant.loading_rate: at, plant.sigma: stress, plant.p: 0}
    function = sp.lambdify(stress, sp.N(critical.subs(known)))
    return conditions, lambda s: function(s) + 0 * np.asarray(s, dtype=float), limits


def _region(
    axis: Any, across: np.ndarray, effective: np.ndarray, stiffness: np.ndarray, conditions: Any, boundary: Any
) -> None:
    """Colour one panel by the sign of the worst condition, and draw the critical stiffness."""
    wide, high = _size(np.abs(across).max() / 2)[0], _size(stiffness.max())[0]
    S, K = np.meshgrid(effective, stiffness)
    stable = np.min([np.sign(c(S, K) + 0 * S) for c in conditions], axis=0) > 0
    axis.contourf(
        across / wide, stiffness / high, stable.astype(float), levels=[-0.5, 0.5, 1.5],
        colors=[_COLOURS["unstable"], _COLOURS["stable"]],
    )  # fmt: skip
    for name, place in (("unstable", False), ("stable", True)):
        if (stable == place).any():
            axis.fill_between([], [], color=_COLOURS[name], label=name)
    curve = boundary(effective)
    if np.isfinite(curve).any() and (curve > 0).any():
        axis.plot(across / wide, np.where(curve > 0, curve, np.nan) / high, color="black", label="critical stiffness")
    axis.set_xlim(across.min() / wide, across.max() / wide)
    axis.set_ylim(stiffness.min() / high, stiffness.max() / high)


def _annotate(axis: Any, fault: Fault, pressure: float, rate: float, critical: float, top: float) -> None:
    if not (np.isfinite(critical) and critical > 0):
        said = "no critical stiffness"
    else:
        length = nucleation_length(fault, pressure=pressure, loading_rate=rate or None)
        size, unit = _size(critical)
        said = (
            f"critical stiffness per area {critical / size:.4g} {unit}/m\n"
            f"nucleation length {_metres(length)}\nfault length {_metres(fault.side)}"
        )
        wide = _size(fault.effective_normal_stress)[0]
        axis.plot(fault.effective_normal_stress / wide, critical / _size(top)[0], "kx", label="critical here")
    axis.text(
        0.03, 0.97, said, transform=axis.transAxes, va="top", fontsize=9,
        bbox={"boxstyle": "round", "facecolor": "white", "alpha": 0.85, "edgecolor": "#999999"},
    )  # fmt: skip


def _metres(length: float) -> str:
    for size, unit in ((1e3, "km"), (1.0, "m"), (1e-3, "mm")):
        if length >= size:
            return f"{length / size:.4g} {unit}"
    return f"{length:.3g} m"


def _size(largest: float) -> tuple[float, str]:
    return next(((s, u) for s, u in _SIZES if largest >= s), _SIZES[-1])


def _unique(*axes: Any) -> tuple[list[Any], list[str]]:
    """Legend entries of several axes, each label once."""
    found: dict[str, Any] = {}
    for axis in axes:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    return list(found.values()), list(found)
