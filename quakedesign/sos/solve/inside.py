"""Points inside a set of inequalities and on its boundary, and the way from its boundary towards the inside."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from scipy.optimize import linprog

from quakedesign.sos.exact.polynomial import degree
from quakedesign.sos.exact.statement import Statement
from quakedesign.sos.solve.arrays import Arrays

_SEED = 20240608
_SAMPLES, _KEPT = 4000, 12
_SPREADS = (0.1, 0.3, 1.0, 3.0)  # scaled variables are about one
_HALVINGS = 40
_NEAR = 1e-3  # distance from which on a constraint does not count as active
_VIOLATION = 1e-6  # relative, up to which a point is taken to be one of the set


def _polynomial(statement: Statement) -> Arrays:
    return Arrays(statement.polynomial, len(statement.variables))


def violation(statement: Statement, points: Any) -> Any:
    """Largest relative violation of the inequalities at points (one a row); zero inside."""
    worst, size = np.zeros(len(points)), len(statement.variables)
    for g in statement.inequalities:
        scale = Arrays({e: abs(c) for e, c in g.items()}, size).at(np.abs(points))
        worst = np.maximum(worst, -Arrays(g, size).at(points) / np.maximum(scale, 1e-300))
    return worst


def by_value(statement: Statement, candidates: Sequence[Sequence[float]]) -> list[Sequence[float]]:
    """Candidates by the polynomial's value over their size, those of the set before all others."""
    if not candidates:
        return []
    points = np.array(candidates, dtype=float)
    grown = (1 + np.abs(points).max(axis=1)) ** max(degree(statement.polynomial), 1)
    outside = violation(statement, points) > _VIOLATION
    order = np.lexsort((_polynomial(statement).at(points) / grown, outside))
    return [candidates[i] for i in order]


def lowest_samples(statement: Statement) -> list[list[float]]:
    """Points of the set, inside and on the boundary, at which the polynomial is lowest among seeded samples.

    A sample outside is moved along the segment to one inside until it is on the boundary. None are found for a set that
    is thin, such as one with equalities.
    """
    if statement.equalities:
        return []
    random = np.random.default_rng(_SEED)
    points = random.standard_normal((_SAMPLES, len(statement.variables)))
    points *= random.choice(_SPREADS, size=(_SAMPLES, 1))
    within = violation(statement, points) <= 0
    inner, outer = points[within], points[~within]
    if not len(inner):
        return []
    start = inner[random.integers(len(inner), size=len(outer))]
    low, high = np.zeros((len(outer), 1)), np.ones((len(outer), 1))
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        held = (violation(statement, start + middle * (outer - start)) <= 0)[:, None]
        low, high = np.where(held, middle, low), np.where(held, high, middle)
    pool = np.concatenate([inner, start + low * (outer - start)])
    order = np.argsort(_polynomial(statement).at(pool), kind="stable")
    return [[*map(float, point)] for point in pool[order[:_KEPT]]]


def inwards(statement: Statement, x: Sequence[float]) -> Iterator[tuple[list[float], float]]:
    """Points strictly inside at which the polynomial is negative, from far to near, with their distance from x.

    They lie in the direction that increases all active constraints the fastest; none where no direction does.
    """
    point = np.asarray(x, dtype=float)
    direction = _into(statement, point)
    if direction is None:
        return
    polynomial, limits = _polynomial(statement), [Arrays(g, len(point)) for g in statement.inequalities]
    for n in range(_HALVINGS):
        step = 0.3 / 2**n
        moved = point + step * direction
        if polynomial(moved) < 0 and all(g(moved) > 0 for g in limits):
            yield moved.tolist(), step


def _into(statement: Statement, point: Any) -> Any:
    """Direction, of largest coordinate at most 1, along which the slowest active constraint grows the fastest."""
    rows = []
    for g in (Arrays(g, len(point)) for g in statement.inequalities):
        slope = g.gradient(point)
        size = float(np.abs(slope).sum())
        if size > 0 and g(point) < _NEAR * size:
            rows.append(slope / size)
    if not rows:
        return np.zeros(len(point))
    active = np.array(rows)
    cost = np.append(np.zeros(len(point)), -1.0)
    bounds = [*[(-1, 1)] * len(point), (0, 1)]
    answer = linprog(cost, A_ub=np.c_[-active, np.ones(len(rows))], b_ub=np.zeros(len(rows)), bounds=bounds)
    return answer.x[:-1] if answer.status == 0 and answer.x[-1] > 1e-9 else None
