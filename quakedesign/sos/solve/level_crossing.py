"""Where a Lyapunov function stops to fall: the lowest such points, in floating point, then rational and exact."""

import warnings
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import numpy as np
from scipy.optimize import fsolve, minimize

from quakedesign.sos.exact.attraction import Attraction
from quakedesign.sos.exact.polynomial import Polynomial, evaluate
from quakedesign.sos.exact.proofs import Point
from quakedesign.sos.solve.arrays import Arrays
from quakedesign.sos.solve.faces import simplest

_SEED = 20240609
_DIRECTIONS, _REFINED, _STARTS = 300, 3, 30  # directions for every state
_NEAR = 1e-3  # distance of a point in a direction in which V never falls
_PRECISE = {"xatol": 1e-12, "fatol": 1e-14, "maxiter": 200}
_TOLERANCES = (1e-3, 1e-7, 1e-12)  # of the fractions that are tried for a point
_BEYOND = (0.0, 1e-10, 1e-7, 1e-4)  # how far a point is moved out, relative


class _Rays:
    """V, and V̇ or another polynomial that becomes positive, along rays from the origin, in powers of the distance."""

    def __init__(self, size: int, lyapunov: Polynomial, rate: Polynomial) -> None:
        self.size = size
        self.lyapunov = Arrays(lyapunov, size)
        self.rate = self.graded(rate)

    def graded(self, polynomial: Polynomial) -> list[Arrays]:
        """Forms of every degree."""
        top = max((sum(e) for e in polynomial), default=0)
        return [Arrays({e: c for e, c in polynomial.items() if sum(e) == k}, self.size) for k in range(top + 1)]

    def crossings(self, directions: Any, parts: list[Arrays]) -> Any:
        """Points, one a row, from which on a polynomial is no longer negative; infinite where it remains so."""
        table = np.array([part.at(directions) for part in parts]).T
        distances = np.array([_first_root(row) for row in table])
        return np.where(
            np.isfinite(distances)[:, None], np.nan_to_num(distances, posinf=0.0)[:, None] * directions, np.inf
        )

    def heights(self, directions: Any) -> Any:
        """V where it stops to fall in every direction; infinite where it never does."""
        points = self.crossings(directions, self.rate)
        finite = np.isfinite(points).all(axis=1)
        return np.where(finite, self.lyapunov.at(np.where(finite[:, None], points, 0.0)), np.inf)

    def height(self, direction: Any) -> float:
        """V where it stops to fall in one direction."""
        return float(self.heights((direction / np.linalg.norm(direction))[None, :])[0])

    def sampled(self) -> Any:
        """Seeded directions, one a row, and those of the axes."""
        random = np.random.default_rng(_SEED).standard_normal((_DIRECTIONS * self.size, self.size))
        return np.concatenate([random / np.linalg.norm(random, axis=1)[:, None], np.eye(self.size), -np.eye(self.size)])

    def lowest(self, directions: Any) -> list[Any]:
        """Directions, refined, in which V stops to fall where it is lowest."""
        heights = self.heights(directions)
        order = np.argsort(heights, kind="stable")[:_REFINED]
        starts = [directions[i] for i in order if np.isfinite(heights[i])]
        return [minimize(self.height, d, method="Nelder-Mead", options=_PRECISE).x for d in starts]


def _first_root(row: Any) -> float:
    """Smallest r > 0 from which on Σ row_k·r^k is not negative; infinite if there is none."""
    used = np.flatnonzero(row)
    if not len(used) or row[used[0]] > 0:
        return _NEAR
    roots = np.roots(row[used[0] :][::-1])
    real = roots.real[(np.abs(roots.imag) < 1e-7 * (1 + np.abs(roots))) & (roots.real > 0)]
    return float(np.min(real, initial=np.inf))


def lowest_crossing(claim: Attraction) -> Point | None:
    """Rational point, not the origin, where V ≤ 0 or V̇ ≥ 0, with the lowest V found; None if none is found."""
    size = len(claim.variables)
    rays = _Rays(size, claim.lyapunov, claim.derivative)
    directions = rays.sampled()
    ends = [rays.crossings((d / np.linalg.norm(d))[None, :], rays.rate)[0] for d in rays.lowest(directions)]
    depth = rays.graded({e: -c for e, c in claim.lyapunov.items()})
    below = rays.crossings(directions, depth)
    ends += list(below[np.isfinite(below).all(axis=1)][:_REFINED])
    candidates = (point for x in ends if np.all(np.isfinite(x)) for point in _rational(claim, x))
    return min(candidates, key=lambda point: evaluate(claim.lyapunov, point.coordinates), default=None)


def lowest_value_on(function: Polynomial, boundary: Polynomial) -> float:
    """Lowest value found of a polynomial where another, negative at the origin, first vanishes along a ray."""
    rays = _Rays(len(next(iter(boundary))), function, boundary)
    return min(map(rays.height, rays.lowest(rays.sampled())), default=0.0)


def _rational(claim: Attraction, x: Any) -> Iterator[Point]:
    """Points near one, or a little beyond it, that refute."""
    for beyond in _BEYOND:
        for tolerance in _TOLERANCES:
            point = Point(coordinates=_fractions(x * (1 + beyond), tolerance))
            if claim.refuted_by(point):
                yield point


def _fractions(x: Any, tolerance: float) -> tuple[Fraction, ...]:
    """Simple fractions near coordinates; those far below the largest are zero."""
    least = 1e-9 * float(np.abs(x).max())
    return tuple(simplest(float(v), tolerance) if abs(v) > least else Fraction(0) for v in x)


def other_equilibrium(claim: Attraction) -> Point | None:
    """Rational point, not the origin, where the field vanishes; None if none is found."""
    size = len(claim.variables)
    field = [Arrays(f, size) for f in claim.field]
    random = np.random.default_rng(_SEED)
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ends = [fsolve(lambda x: [f(x) for f in field], random.standard_normal(size) * 3) for _ in range(_STARTS)]
    for x in ends:
        for tolerance in _TOLERANCES if np.all(np.isfinite(x)) and np.abs(x).max() > 1e-3 else ():
            point = _fractions(x, tolerance)
            if any(point) and not any(evaluate(f, point) for f in claim.field):
                return Point(coordinates=point)
    return None
