"""Where a fault slides stably: regions of stiffness, effective normal stress and injected pressure."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from quakedesign.errors import UnsupportedError
from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.symbolic import plant, state_plant
from quakedesign.symbolic.stability import StabilityVerdict, nucleation_length, stability

_GRID = 240

Function = Callable[..., Any]


@dataclass(frozen=True, kw_only=True)
class Plane:
    """Stiffness against one quantity that sets the effective stress under pressure.

    Attributes
    ----------
    across : numpy.ndarray
        That quantity [Pa], shape (points,).
    stable : numpy.ndarray of bool
        Shape (stiffnesses, points).
    critical : numpy.ndarray
        Critical stiffness per area [Pa/m], shape (points,); nan where there is none.
    limits : tuple of float
        Where the damping alone decides [Pa]; nan outside of the plane.
    own : float
        Where the fault is [Pa].
    """

    across: np.ndarray
    stable: np.ndarray
    critical: np.ndarray
    limits: tuple[float, ...]
    own: float


@dataclass(frozen=True, kw_only=True)
class StabilityRegions:
    """Stable and unstable regions of a fault; its own verdict is exact.

    Attributes
    ----------
    verdict : StabilityVerdict
        Of the fault itself.
    stiffness : numpy.ndarray
        Stiffnesses per area of both planes [Pa/m].
    own : float
        That of the fault [Pa/m].
    critical : float
        Critical stiffness per area at the fault's effective stress [Pa/m]; not positive or nan where there is none.
    nucleation_length : float or None
        [m]; None without a critical stiffness.
    over_stress, over_pressure : Plane
        The effective normal stress σ' varies at the given pressure, or the pressure at the fault's σ'.
    """

    verdict: StabilityVerdict
    stiffness: np.ndarray
    own: float
    critical: float
    nucleation_length: float | None
    over_stress: Plane
    over_pressure: Plane


def stability_regions(fault: Fault, *, pressure: float, loading_rate: float | None, inertia: bool) -> StabilityRegions:
    """Regions from the symbolic stability conditions; the arguments and errors are those of `stability`."""
    verdict = stability(fault, pressure=pressure, loading_rate=loading_rate, inertia=inertia)
    rate = float(verdict.loading_rate)
    conditions, boundary, limits = _functions(fault, rate, inertia)
    normal, own = fault.effective_normal_stress, fault.stiffness / fault.area
    critical = float(boundary(normal - pressure))
    top = 2 * max(own, critical if np.isfinite(critical) else own)
    stiffness = np.linspace(top / _GRID, top, _GRID)
    stresses = np.linspace(max(pressure, 0), max(2 * normal, normal + pressure), _GRID + 1)[1:]
    pressures = np.linspace(-normal, normal, _GRID + 1)[:-1]

    def plane(across: np.ndarray, effective: np.ndarray, at: float) -> Plane:
        S, K = np.meshgrid(effective, stiffness)
        order = np.argsort(effective)
        places = (np.interp(x, effective[order], across[order], left=np.nan, right=np.nan) for x in limits)
        return Plane(
            across=across,
            stable=np.min([np.sign(c(S, K) + 0 * S) for c in conditions], axis=0) > 0,
            critical=boundary(effective),
            limits=tuple(map(float, places)),
            own=at,
        )

    return StabilityRegions(
        verdict=verdict,
        stiffness=stiffness,
        own=own,
        critical=critical,
        nucleation_length=nucleation_length(fault, pressure=pressure, loading_rate=rate or None)
        if 0 < critical < np.inf
        else None,
        over_stress=plane(stresses, stresses - pressure, normal),
        over_pressure=plane(pressures, normal - pressures, pressure),
    )


def _functions(fault: Fault, rate: float, inertia: bool) -> tuple[list[Function], Function, list[float]]:
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
