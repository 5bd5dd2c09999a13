"""Points of semialgebraic sets in floating point: minima, interior and boundary, zeros.

Points are candidates for a negative value or a rational zero, which exact code checks. The first chapter evaluates
polynomials and their derivatives as arrays.
"""

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import chain, islice, product

import numpy as np
from scipy.optimize import linprog, minimize

from quakedesign.sos.exact.polynomial import Polynomial, degree, evaluate
from quakedesign.sos.exact.polynomial_statement import Statement
from quakedesign.sos.exact.proofs import Point, holds
from quakedesign.sos.solve.facial_reduction import simplest

# ----------------------------------------------------------------------
# A polynomial as floating-point arrays, for its values and derivatives; without proof.


class Arrays:
    """A polynomial as arrays, for values and gradients at many points."""

    def __init__(self, polynomial: Polynomial, variables: int) -> None:
        self.exponents = np.array(list(polynomial), dtype=np.int64).reshape(-1, variables)
        self.coefficients = np.array([float(c) for c in polynomial.values()])
        self._slopes = self.exponents.T * self.coefficients
        self._lower = np.maximum(self.exponents - np.eye(variables, dtype=np.int64)[:, None], 0)

    def __call__(self, x: np.ndarray) -> float:
        """Value at a point."""
        return float(self.coefficients @ np.prod(np.asarray(x) ** self.exponents, axis=1))

    def at(self, points: np.ndarray) -> np.ndarray:
        """Values at points, one point per row."""
        return np.asarray(np.prod(points[:, None, :] ** self.exponents[None, :, :], axis=2) @ self.coefficients)

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Gradient at a point."""
        return np.asarray((self._slopes * np.prod(np.asarray(x) ** self._lower, axis=2)).sum(axis=1))

    def hessian(self, x: np.ndarray) -> np.ndarray:
        """Matrix of second derivatives at a point."""
        x, size = np.asarray(x), len(x)
        result = np.zeros((size, size))
        for i in range(size):
            for j in range(i, size):
                factor = self.exponents[:, i] * (self.exponents[:, j] - (i == j)) * self.coefficients
                lower = self.exponents.copy()
                lower[:, i] -= 1
                lower[:, j] -= 1
                result[i, j] = result[j, i] = factor @ np.prod(x[None, :] ** np.maximum(lower, 0), axis=1)
        return result


# ----------------------------------------------------------------------
# Points in the interior and on the boundary of a set of inequalities, and directions from the boundary inwards.

_SEED = 20240608
_SAMPLES, _RETAINED = 4000, 12
_SPREADS = (0.1, 0.3, 1.0, 3.0)  # scaled variables are about one
_HALVINGS = 40
_NEAR = 1e-3  # distance within which a constraint counts as active
_VIOLATION = 1e-6  # relative violation up to which a point counts as inside the set


def _polynomial(statement: Statement) -> Arrays:
    return Arrays(statement.polynomial, len(statement.variables))


def violation(statement: Statement, points: np.ndarray) -> np.ndarray:
    """Largest relative violation of the inequalities at points (one per row); zero inside the set."""
    worst, size = np.zeros(len(points)), len(statement.variables)
    for g in statement.inequalities:
        scale = Arrays({e: abs(c) for e, c in g.items()}, size).at(np.abs(points))
        worst = np.maximum(worst, -Arrays(g, size).at(points) / np.maximum(scale, 1e-300))
    return worst


def by_value(statement: Statement, candidates: Sequence[Sequence[float]]) -> list[Sequence[float]]:
    """Candidates sorted by polynomial value over (1 + max|x_i|)^degree, those in the set first."""
    if not candidates:
        return []
    points = np.array(candidates, dtype=float)
    grown = (1 + np.abs(points).max(axis=1)) ** max(degree(statement.polynomial), 1)
    outside = violation(statement, points) > _VIOLATION
    order = np.lexsort((_polynomial(statement).at(points) / grown, outside))
    return [candidates[i] for i in order]


def lowest_samples(statement: Statement) -> list[list[float]]:
    """Points of the set, inside and on the boundary, at which the polynomial is lowest among seeded samples.

    A sample outside is moved to the boundary, along the segment to a sample inside. The result is empty with
    equalities, or if no sample lies inside the set.
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
        inside = (violation(statement, start + middle * (outer - start)) <= 0)[:, None]
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    pool = np.concatenate([inner, start + low * (outer - start)])
    order = np.argsort(_polynomial(statement).at(pool), kind="stable")
    return [[*map(float, point)] for point in pool[order[:_RETAINED]]]


def inwards(statement: Statement, x: Sequence[float]) -> Iterator[tuple[list[float], float]]:
    """Points strictly inside the set where the polynomial is negative, each with its step from x; largest step first.

    In the direction of these steps, whose coordinates are at most 1, the slowest active constraint increases fastest.
    Without an active constraint the points are x itself. Without such a direction there are no points.
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


def _into(statement: Statement, point: np.ndarray) -> np.ndarray | None:
    """Direction in which the slowest active constraint increases fastest, with coordinates of at most 1."""
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


# ----------------------------------------------------------------------
# Local minima of a polynomial on its set, as candidates for a negative point and for rational zeros.

_POINT_SEED, _STARTS = 20240607, 24
_FAR = 1e6  # distance beyond which a minimum counts as infinite
_SIMPLE = (Fraction(0), Fraction(1), Fraction(-1), Fraction(1, 2), Fraction(2))


def polished_zeros(statement: Statement, candidates: Sequence[Sequence[float]]) -> list[list[float]]:
    """Distinct candidates where the polynomial nearly vanishes, refined by Newton steps on its gradient."""
    p = Arrays(statement.polynomial, len(statement.variables))
    zeros: list[list[float]] = []
    for x in candidates:
        near = np.asarray(x, dtype=float)
        if abs(p(near)) > 1e-9 * (1 + np.abs(near).max()) ** degree(statement.polynomial):
            continue
        for _ in range(6):
            near = near - np.linalg.lstsq(p.hessian(near), p.gradient(near), rcond=1e-7)[0]
        if np.all(np.isfinite(near)) and all(np.abs(near - z).max() > 1e-6 for z in zeros):
            zeros.append(near.tolist())
    return zeros


def local_minima(statement: Statement, hints: Sequence[Sequence[float]] = ()) -> Iterator[list[float]]:
    """Candidates for local minima of the polynomial on the set, in floating point, from seeded starts.

    Minima at infinity are returned as far points; on constrained sets the lowest samples come first.

    On ℝⁿ and orthants the homogenised polynomial is minimised on the sphere (x_i = v_i² where x_i ≥ 0); with other
    constraints SLSQP works in the variables themselves.
    """
    if statement.dense:
        yield from _on_sphere(statement, hints)
    else:
        yield from _constrained(statement, hints)


def _on_sphere(statement: Statement, hints: Sequence[Sequence[float]]) -> Iterator[list[float]]:
    size = len(statement.variables)
    p = statement.polynomial
    top = degree(p)
    homogeneous = all(sum(e) == top for e in p)
    square = [
        any(g.keys() == {tuple(int(i == j) for j in range(size))} for g in statement.inequalities) for i in range(size)
    ]
    lift = {(*(2 * x if s else x for x, s in zip(e, square, strict=True)), 2 * (top - sum(e))): c for e, c in p.items()}
    form = Arrays(lift, size + 1)

    def value(v: np.ndarray) -> tuple[float, np.ndarray]:
        full = np.append(v, 1.0) if homogeneous else v
        x = _state(full[:-1], square)
        level = float(x @ x) + (0.0 if homogeneous else full[-1] ** 4)
        gradient = form.gradient(full)
        grown = np.where(square, 4 * np.abs(full[:-1]) ** 3 * np.sign(full[:-1]), 2 * full[:-1])
        if not homogeneous:
            grown = np.append(grown, 4 * full[-1] ** 3)
        gradient = gradient[:-1] if homogeneous else gradient
        number = form(full)
        scale = level ** (top / 2)
        return number / scale, gradient / scale - number / scale * (top / 2) * grown / level

    random = np.random.default_rng(_POINT_SEED)
    begin = [*(_lifted(h, square, homogeneous) for h in hints)]
    count = size if homogeneous else size + 1
    begin += [random.standard_normal(count) for _ in range(_STARTS)]
    for v in begin:
        if not float(np.linalg.norm(v)) > 0:
            continue
        answer = minimize(value, np.asarray(v) / np.linalg.norm(v), jac=True, method="BFGS", options={"gtol": 1e-10})
        x = _state(answer.x[:size], square)
        last = 1.0 if homogeneous else float(answer.x[-1]) ** 2
        if homogeneous:
            yield (x / np.abs(x).max()).tolist()
        elif last > 1e-9 * np.abs(x).max():
            yield (x / last).tolist()
        else:
            for far in (1e1, 1e2, 1e4):
                yield (x / np.abs(x).max() * far).tolist()


def _state(v: np.ndarray, square: list[bool]) -> np.ndarray:
    return np.where(square, v**2, v)


def _lifted(hint: Sequence[float], square: list[bool], homogeneous: bool) -> np.ndarray:
    x = np.where(square, np.sqrt(np.abs(hint)), hint)
    return x if homogeneous else np.append(x, 1.0)


def _constrained(statement: Statement, hints: Sequence[Sequence[float]]) -> Iterator[list[float]]:
    size = len(statement.variables)
    p = Arrays(statement.polynomial, size)
    limits = [("ineq", Arrays(g, size)) for g in statement.inequalities]
    limits += [("eq", Arrays(h, size)) for h in statement.equalities]
    constraints = [{"type": kind, "fun": g, "jac": g.gradient} for kind, g in limits]
    random = np.random.default_rng(_POINT_SEED)
    lowest = lowest_samples(statement)
    yield from lowest
    begin = [
        *map(np.asarray, (*hints, *lowest)),
        *(random.standard_normal(size) * s for s in (0.3, 1.0, 3.0) for _ in range(_STARTS // 3)),
    ]
    for v in begin:
        try:
            with np.errstate(all="ignore"):
                answer = minimize(
                    p,
                    v,
                    jac=p.gradient,
                    method="SLSQP",
                    constraints=constraints,
                    options={"ftol": 1e-14, "maxiter": 200},
                )
        except (ValueError, FloatingPointError, OverflowError):
            continue
        largest = float(np.abs(answer.x).max())
        if largest < _FAR:
            yield answer.x.tolist()
        elif np.isfinite(largest):
            yield from ((answer.x / largest * far).tolist() for far in (1e1, 1e2, 1e4))


def negative_point(
    statement: Statement, candidates: Sequence[Sequence[float]], scale: Sequence[Fraction]
) -> Point | None:
    """Rational point of the set where the polynomial is negative, with small denominators; None if none is found."""
    for x in by_value(statement, candidates)[:12]:
        for coordinates in chain(_near(statement, x, scale), _inside(statement, x, scale)):
            point = Point(coordinates=coordinates)
            if holds(statement, point):
                return point
    return None


def _inside(statement: Statement, x: Sequence[float], scale: Sequence[Fraction]) -> Iterator[tuple[Fraction, ...]]:
    """Rational points of the interior near a boundary point, with rounding errors below their distance from it."""
    if statement.inequalities and not statement.equalities:
        for moved, distance in inwards(statement, x):
            size = max(1e-2, *map(abs, moved))
            yield from (rationalised(moved, scale, distance / size / share) for share in (2, 8, 32))


def _near(statement: Statement, x: Sequence[float], scale: Sequence[Fraction]) -> Iterator[tuple[Fraction, ...]]:
    """Rational points near a point, simple ones first; on the set if possible."""
    for tolerance in (0.3, 0.1, 1e-2, 1e-4, 1e-7, 1e-10, 1e-14):
        near = rationalised(x, scale, tolerance)
        yield near
        if len(statement.equalities) == 1 and degree(statement.equalities[0]) <= 2:
            yield from on_quadric(statement.equalities[0], near, scale)
        for factor in (1 - tolerance, 1 + tolerance) if statement.inequalities and tolerance < 0.1 else ():
            yield rationalised([factor * v for v in x], scale, tolerance / 10)


def on_quadric(
    equality: Polynomial, near: Sequence[Fraction], scale: Sequence[Fraction]
) -> Iterator[tuple[Fraction, ...]]:
    """Rational points of a quadric near a given point: second intersections of lines through known rational points."""
    size = len(near)
    simple = (tuple(v / s for v, s in zip(p, scale, strict=True)) for p in product(_SIMPLE, repeat=size))
    seeds = (p for p in islice(simple, 5000) if evaluate(equality, p) == 0)
    for seed in islice(seeds, 3):
        step = [b - a for a, b in zip(seed, near, strict=True)]
        at = [evaluate(equality, [a + k * d for a, d in zip(seed, step, strict=True)]) for k in (1, -1)]
        slope, bend = (at[0] - at[1]) / 2, (at[0] + at[1]) / 2
        if bend and slope:
            yield tuple(a - slope / bend * d for a, d in zip(seed, step, strict=True))


def rational_zeros(
    statement: Statement, candidates: Sequence[Sequence[float]], scale: Sequence[Fraction]
) -> list[tuple[Fraction, ...]]:
    """Distinct rational points of the set, near the candidates, where the polynomial vanishes exactly."""
    points = dict[tuple[Fraction, ...], None]()
    for x in candidates:
        for lead in _leads(statement, x):
            for tolerance in (1e-3, 1e-5, 1e-7):
                point = rationalised([v / lead for v in x] if lead else list(x), scale, tolerance)
                if any(point) and _vanishes(statement, point):
                    points[point] = None
                    break
            else:
                continue
            break
    return list(points)


def _vanishes(statement: Statement, point: tuple[Fraction, ...]) -> bool:
    return (
        evaluate(statement.polynomial, point) == 0
        and all(evaluate(g, point) >= 0 for g in statement.inequalities)
        and all(evaluate(h, point) == 0 for h in statement.equalities)
    )


def _leads(statement: Statement, x: Sequence[float]) -> list[float]:
    """Coordinates by which a point is divided, as the zeros of a form are rays; 0 for no division."""
    top = degree(statement.polynomial)
    if statement.equalities or any(sum(e) != top for e in statement.polynomial):
        return [0.0]
    size = max(map(abs, x))
    return [abs(v) for v in x if abs(v) > 1e-3 * size]


def rationalised(x: Sequence[float], scale: Sequence[Fraction], tolerance: float) -> tuple[Fraction, ...]:
    """Point whose products with `scale` are simplest fractions; tolerance relative to the largest coordinate of x."""
    size = max(1e-2, *map(abs, x))  # scaled variables are about one
    return tuple(
        Fraction(0) if abs(v) <= tolerance * size else simplest(v * float(s), tolerance * min(1.0, size / abs(v))) / s
        for v, s in zip(x, scale, strict=True)
    )
