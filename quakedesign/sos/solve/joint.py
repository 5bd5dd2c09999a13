"""Decision variables with which several polynomials lie in their cones, with the largest common margin.

Primal: maximise t with C_o + Σ_j x_j P_oj − t·N_o in the cone of every demand o, and x within bounds. The dual is
solved instead,

    minimise Σ_o L_o(C_o) + Σ_j radius_j·|Σ_o L_o(P_oj)|
    subject to  Σ_o L_o(N_o) = 1,  L_o(g_S·b bᵀ) ⪰ 0,  L_o(m·h) = 0,

with one unknown per monomial; t and x are the multipliers of equations. Each row of `DecisionBounds.rows` adds one
multiplier to the unknowns.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from threading import Lock
from typing import Any

import numpy as np

from quakedesign.sos.exact.polynomial import Exponents, Polynomial, product
from quakedesign.sos.exact.polynomial_statement import Statement, Structure
from quakedesign.sos.solve.conic import Compiled, in_cones
from quakedesign.sos.solve.decide import initial_blocks
from quakedesign.sos.solve.facial_reduction import modulo
from quakedesign.sos.solve.moment import MomentProgram
from quakedesign.sos.solve.rounding import relations

_MOST_CACHED = 32
_cached: dict[tuple[object, ...], "JointProgram"] = {}


@dataclass(frozen=True, kw_only=True)
class Demand:
    """Part Σ_j x_j P_j − t·N of a polynomial that must be in a cone; its constant part is given to `solve`."""

    template: Statement  # Set, degree and multiplier; its polynomial only lists the monomials that may occur
    parts: Sequence[Polynomial]  # P_j
    margin: Polynomial  # N


@dataclass(frozen=True, slots=True, kw_only=True)
class DecisionBounds:
    """Bounds on the decisions x: |x_j| ≤ radius_j, row·x ≤ bound for every row, and Σ_j share_j|x_j| ≤ 1."""

    radii: Sequence[float]  # Ignored for decisions with a share
    rows: Sequence[Sequence[float]] = ()
    bounds: Sequence[float] = ()
    shares: Sequence[float] = ()  # Positive, for the first decisions; none by default


@dataclass(frozen=True, slots=True)
class Proposal:
    """Floating-point solution of a search, without proof."""

    decision: list[float]  # x_j
    margin: float  # Largest t; positive if the decision has a margin


def joint_program(demands: Sequence[Demand]) -> "JointProgram":
    """Cached programme for the structure of the demands."""
    key = len(demands[0].parts), *(d.template.structure for d in demands)
    program = _cached.pop(key, None) or JointProgram(demands)
    if len(_cached) >= _MOST_CACHED:
        _cached.pop(next(iter(_cached)), None)
    return _cached.setdefault(key, program)


class JointProgram:
    """Programme of one structure, compiled once for every kind of bounds and solved for varying coefficients.

    Parameters
    ----------
    demands : sequence of Demand
        Demands with equal numbers of parts.
    """

    def __init__(self, demands: Sequence[Demand]) -> None:
        self._shapes = [shape_of(d.template) for d in demands]
        self._count = len(demands[0].parts)
        self._stated: dict[tuple[int, int], _Stated] = {}

    def solve(
        self, demands: Sequence[Demand], fixed: Sequence[Polynomial] | None = None, limits: DecisionBounds | None = None
    ) -> Proposal | None:
        """Decision with the largest margin for demands of the same structure; None if the solver fails.

        Parameters
        ----------
        fixed : sequence of Polynomial, optional
            C_o, in the monomials of the demand's template; zero by default.
        limits : DecisionBounds, optional
            |x_j| ≤ 1 for all j by default.

        Raises
        ------
        ValueError
            When a monomial is not in the structure.
        """
        within = limits or DecisionBounds(radii=[1.0] * self._count)
        kind = len(within.bounds), len(within.shares)
        if kind not in self._stated:
            self._stated[kind] = _Stated(self._shapes, self._count, *kind)
        values = {
            "costs": self._row(fixed or [{}] * len(demands)),
            "margin": self._row([_times(d, d.margin) for d in demands]),
            "parts": np.array([self._row([_times(d, d.parts[j]) for d in demands]) for j in range(self._count)]),
            "radii": [*[0.0] * kind[1], *within.radii[kind[1] :]],
            "rows": np.reshape(within.rows, (kind[0], self._count)),
            "bounds": within.bounds,
            "shares": within.shares,
        }
        return self._stated[kind].solve(values)

    def _row(self, polynomials: Sequence[Mapping[Exponents, Fraction]]) -> np.ndarray:
        """Concatenated coefficients of one polynomial per demand."""
        return np.concatenate([shape.vector(p) for shape, p in zip(self._shapes, polynomials, strict=True)])


class _Stated:
    """cvxpy programme for one kind of bounds; all its numbers are Parameters."""

    def __init__(self, shapes: Sequence[MomentProgram], count: int, rows: int, shares: int) -> None:
        import cvxpy as cp

        self._lock = Lock()
        size = sum(len(shape.keys) for shape in shapes)
        sizes: dict[str, Any] = {"costs": size, "margin": size, "parts": (count, size), "radii": count}
        sizes |= ({"rows": (rows, count), "bounds": rows} if rows else {}) | ({"shares": shares} if shares else {})
        self.given = {name: cp.Parameter(size, name=name) for name, size in sizes.items()}
        given, moments = self.given, cp.Variable(size, name="moments")
        above, below = cp.Variable(count, name="above"), cp.Variable(count, name="below")
        cost = given["costs"] @ moments + given["radii"] @ (above + below)
        pull, signs = above - below, [above >= 0, below >= 0]
        if rows:
            weights = cp.Variable(rows, name="row_multipliers")
            cost, pull = cost + given["bounds"] @ weights, pull + given["rows"].T @ weights
            signs += [weights >= 0]
        if shares:
            shared = cp.Variable(name="shared")
            most = given["shares"] * shared
            cost, signs = cost + shared, [*signs, shared >= 0, above[:shares] <= most, below[:shares] <= most]
        self.unit, self.link = given["margin"] @ moments == 1, given["parts"] @ moments - pull == 0
        constraints = [self.unit, self.link, *in_cones(shapes, moments), *signs]
        self.compiled = Compiled(cp.Problem(cp.Minimize(cost), constraints))

    def solve(self, values: Mapping[str, object]) -> Proposal | None:
        """Proposal for the values of all Parameters."""
        with self._lock:
            for name, parameter in self.given.items():
                parameter.value = values[name]
            if not self.compiled.solve():
                return None
            return Proposal(self.link.dual_value.tolist(), -float(self.unit.dual_value))


def shape_of(template: Statement) -> MomentProgram:
    """Monomials, blocks and relations of a cone, modulo the equalities; cached and shared, so read-only."""
    return _shape_of(template.structure)


@lru_cache(256)
def _shape_of(structure: Structure) -> MomentProgram:
    template = Statement.of(structure)
    multiples = [r for _, _, r in relations(template)]
    blocks = modulo(initial_blocks(template), multiples)
    rows = [{e: float(c) for e, c in r.items()} for r in multiples]
    return MomentProgram([b.shape() for b in blocks], rows)


def _times(demand: Demand, part: Polynomial) -> Mapping[Exponents, Fraction]:
    one = demand.template.multiplier
    if len(one) == 1 and not any(map(any, one)):
        return part
    return product(len(demand.template.variables), (one, part))
