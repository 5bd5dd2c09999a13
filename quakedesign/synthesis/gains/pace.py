"""How fast V̇ ≤ −κV^{n/m} settles a loop, and the linear forms w ≈ V^{1/m} that make the search for κ a programme."""

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import sympy as sp
from scipy.optimize import nnls

from quakedesign.certificates import Loop
from quakedesign.certificates.loop_expressions import unit_ranges
from quakedesign.certificates.obligations import Obligation, Obligations, degree, power_sum
from quakedesign.certificates.witnesses import statement_of
from quakedesign.sos import Polynomial
from quakedesign.sos.solve.joint import Demand, joint_program
from quakedesign.symbolic.terms import Term
from quakedesign.synthesis.gains.linearised_program import Pace
from quakedesign.synthesis.lyapunov.balancing import exponents_of, lifted_scale, scaled

_POINTS, _SEED = 400, 5


def box(loop: Loop, units: Mapping[str, sp.Expr]) -> tuple[float, ...]:
    """Largest u_i where all errors are at most L̄ in size, for x_i = ±u_i^{r_i}.

    Parameters
    ----------
    loop : Loop
    units : mapping of str to Expr
        Error that one unit of a state stands for, see `LoopField.units`.
    """
    bound, known = loop.uncertain["d"][1], unit_ranges(loop, units)
    return tuple(float(bound / known[state][0]) ** (1 / weight) for state, weight in loop.states.items())


def on_box(lyapunov: Sequence[Term], states: Mapping[str, int], sizes: Sequence[float]) -> float:
    """Σ |α_j|·|monomial_j| at the far corner of a box: V is at most that within."""
    return sum(abs(float(term.coefficient)) * _at(exponents_of(term, states), sizes) for term in lyapunov)


def _at(exponents: Sequence[int], sizes: Sequence[float]) -> float:
    value = 1.0
    for size, e in zip(sizes, exponents, strict=True):
        value *= size**e
    return value


def rounded(lyapunov: Sequence[Term], bits: int, divisor: float = 1.0) -> tuple[Term, ...]:
    """V divided by a number, every coefficient with so many binary digits."""
    terms = []
    for term in lyapunov:
        value = float(term.coefficient) / divisor
        grid = Fraction(2) ** (bits - math.floor(math.log2(abs(value))))
        terms.append(Term(round(Fraction(value) * grid) / grid, term.parameters, term.factors))
    return tuple(terms)


def degrees_of(obligations: Obligations) -> tuple[int, int]:
    """m and n, of V and V̇."""
    m = degree([p for _, p in obligations.function()], "V")
    return m, degree([one.polynomial for _, one in obligations.decrease("")], "V̇")


def pace_of(loop: Loop, lyapunov: tuple[Term, ...], speed: float, power: int) -> Pace:
    """Pace at which a V ≤ 1 of a degree settles within T = 1/speed, κ = speed·m/(m−n); for loops that settle, n < m.

    w is fitted to V^{1/m} on every cell for a V nearby, of whatever degree.
    """
    obligations = Obligations(loop, lyapunov)
    m, n = degrees_of(obligations)
    forms = {cell.name: _form(obligations.potential(cell.signs), m) for cell in obligations.sign_cells()}
    return Pace(rate=speed * power / (m - n), degrees=(power, power + n - m), forms=forms)


def least_margins(loop: Loop, lyapunov: tuple[Term, ...], scale: Sequence[Fraction]) -> tuple[float, float]:
    """Largest t with V ≥ tΣu_i^m and t with −V̇ ≥ tΣu_i^n that the solver finds, not above what the cone allows."""
    obligations = Obligations(loop, lyapunov)
    function = [Obligation(name, p) for name, p in obligations.function()]
    decrease = [one for _, one in obligations.decrease("")]
    positive, falling = (
        min(_margin(one, loop, scale) for one in {one.key: one for one in part}.values())
        for part in (function, decrease)
    )
    return positive, falling


def _margin(one: Obligation, loop: Loop, scale: Sequence[Fraction]) -> float:
    whole = lifted_scale(one.equalities, scale)
    moved = scaled(one.polynomial, whole)
    size = max(map(abs, moved.values()))
    power = degree([one.polynomial], "a form")
    margin = power_sum(len(loop.states), power, len(whole))
    conditions = (tuple(scaled(p, whole) for p in group) for group in (one.equalities, one.inequalities))
    support = Obligation("", dict.fromkeys((*moved, *margin), Fraction(1)), *conditions)
    parts = [{e: c / size for e, c in moved.items()}]
    demand = Demand(template=statement_of(support, loop.domain), parts=parts, margin=margin)
    proposal = joint_program([demand]).solve([demand])
    return 0.0 if proposal is None else max(0.0, proposal.margin) * float(size * min(1 / r**power for r in scale))


def fastest(loop: Loop, lyapunov: tuple[Term, ...]) -> float:
    """Smallest −V̇/V^{n/m} over sampled points: an estimate of κ from above."""
    obligations = Obligations(loop, lyapunov)
    m = degree([p for _, p in obligations.function()], "V")
    found = [np.inf]
    for cell, one in obligations.decrease(""):
        potential = obligations.potential(cell.signs)
        points = _points(potential, m)
        values = np.maximum(_values(potential, points), 1e-300)
        whole, kept = _lifted(points, one)
        rates = _values(one.polynomial, whole) / values ** (degree([one.polynomial], "V̇") / m)
        found.append(float(rates[kept].min(initial=np.inf)))
    return min(found)


def _lifted(points: Any, one: Obligation) -> Any:
    """Points with the variables of nested powers, and which of them are in the cell."""
    kept = np.full(len(points), True)
    for equality in one.equalities:
        position = points.shape[1]
        power = max(e[position] for e in equality)
        zero = np.zeros((len(points), max(len(e) for e in equality) - position))
        (sign,) = (float(c) for e, c in equality.items() if e[position])
        value = -sign * _values(equality, np.hstack([points, zero]))
        kept &= value >= 0
        points = np.hstack([points, np.maximum(value, 0)[:, None] ** (1 / power)])
    for inequality in one.inequalities:
        kept &= _values(inequality, points) >= 0
    return points, kept


def _form(potential: Polynomial, m: int) -> dict[tuple[int, ...], float]:
    """Linear form with coefficients ≥ 0 next to the m-th root of a form, in the mean of the squared shares."""
    points = _points(potential, m)
    wanted = np.maximum(_values(potential, points), 1e-300) ** (1 / m)
    coefficients, _ = nnls(points / wanted[:, None], np.ones(len(points)))
    least = 1e-3 * coefficients.max()
    size = len(coefficients)
    return {tuple(int(i == j) for j in range(size)): max(float(c), least) for i, c in enumerate(coefficients)}


def _points(potential: Polynomial, m: int) -> Any:
    """Directions spread over a cell (k × n), every variable in the unit in which V is one on its axis."""
    size = len(next(iter(potential)))
    corners = [abs(float(potential.get(tuple(m * (i == j) for j in range(size)), 0))) for i in range(size)]
    units = np.array([c ** (-1 / m) if c > 0 else 1.0 for c in corners])
    rng = np.random.default_rng(_SEED)
    return rng.dirichlet(np.full(size, 0.5), _POINTS) * units


def _values(polynomial: Polynomial, points: Any) -> Any:
    exponents = np.array(list(polynomial), dtype=float)
    coefficients = np.array([float(c) for c in polynomial.values()])
    return np.prod(points[:, None, :] ** exponents[None, :, :], axis=2) @ coefficients
