"""The sampled law that runs, whatever its parameters do in time: one quadratic V and Wirtinger's inequality, exact.

p = −Kx(t_k) is held, and the integrals are sums, ξ⁺ = ξ + T(x1, ξ1)(t_k): lines between the samples, so that for all t

    ẋ = (x2, s·x1 − w·x2 − βb(Kx + δu), x1 + δ1, ξ1 + δ2),   δ = y(t_k) − y(t),   y = (x1, ξ1, Kx).

δ vanishes at every sample and δ' = −ẏ, so that for W > 0 (Liu, Suplin and Fridman 2010, IMA J. Math. Control Inf. 27,
445) ∫δᵀWδ ≤ (2T/π)²∫ẏᵀWẏ over every period of at most T. If P > 0, W > 0 and

    2xᵀPẋ + (2T/π)²ẏᵀWẏ − δᵀWδ < 0   for all (x, δ) ≠ 0 and all vertices of (s, w, β),

the loop is exponentially stable for all measurable s, w, β in the box and all samples at most T apart. The left side is
convex in (s, w, β), so that the vertices suffice.
"""

import math
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from quakedesign.cache import search_once
from quakedesign.rationals import rational
from quakedesign.sos.solve.conic import hand_back, handing_back
from quakedesign.synthesis.linear.plant.problem import LinearProblem, Scales, Vertex
from quakedesign.synthesis.linear.plant.rational_matrices import (
    Matrix,
    Rows,
    congruent,
    definite,
    floats,
    product,
    rounded,
    times,
    total,
    transpose,
)

FOUR_OVER_PI_SQUARED = Fraction(40529, 100000)  # not below (2/π)² = 0.4052847…
BITS = (30, 45, 60)
"""Binary digits to which what a solver proposes is rounded, tried in turn."""
LEAST_MARGIN = 1e-9
"""Of a proposal in its own units; a smaller one is noise of the solver."""
_ZERO, _ONE = Fraction(0), Fraction(1)


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayProof:
    """P and W that prove every sampling period up to the longest one, in SI, exact.

    Attributes
    ----------
    longest : Fraction
        T [s].
    P : Matrix
        4 × 4, in x1, x2, ξ1, ξ2.
    W : Matrix
        3 × 3, in δ1, δ2, δu.
    """

    longest: Fraction
    P: Matrix
    W: Matrix

    def covers(self, step: Fraction) -> bool:
        """Whether it is about a period [s]."""
        return 0 < step <= self.longest

    def forms(self, problem: LinearProblem, gains: Sequence[Fraction]) -> dict[str, Matrix]:
        """Matrices that all have to be positive definite, by name."""
        matrices = {"P": self.P, "W": self.W}
        for n, vertex in enumerate(problem.vertices()):
            matrices[f"v{n}_"] = decrease_form(problem, gains, self.longest, vertex, self.P, self.W)
        return matrices

    def holds(self, problem: LinearProblem, gains: Sequence[Fraction]) -> bool:
        """Whether it proves the loop, exactly."""
        return all(map(definite, self.forms(problem, gains).values()))


def decrease_form(
    problem: LinearProblem, K: Sequence[Fraction], step: Fraction, vertex: Vertex, P: Rows, W: Rows
) -> Matrix:
    """Matrix (7 × 7) of minus the form in (x, δ) at a vertex."""
    motion = _motion(problem, K, vertex)
    rate = (motion[0], motion[2], *product((tuple(K),), motion))
    fall = (*product(P, motion), *((_ZERO,) * 7 for _ in range(3)))
    kept = ((_ZERO,) * 7,) * 4 + tuple((_ZERO,) * 4 + tuple(row) for row in W)
    gained = product(transpose(rate), W, rate)
    return total(times(-1, fall), times(-1, transpose(fall)), times(-FOUR_OVER_PI_SQUARED * step**2, gained), kept)


def _motion(problem: LinearProblem, K: Sequence[Fraction], vertex: Vertex) -> Matrix:
    """ẋ of (x, δ), 4 × 7."""
    first, second, third, fourth = problem.loop(vertex, K)
    push = vertex[0] * problem.sectors.authority
    return (
        (*first, _ZERO, _ZERO, _ZERO),
        (*second, _ZERO, _ZERO, -push),
        (*third, _ONE, _ZERO, _ZERO),
        (*fourth, _ZERO, _ONE, _ZERO),
    )


def delay_proof(problem: LinearProblem, gains: Sequence[Fraction], step: float | str | Fraction) -> DelayProof | None:
    """Search P and W by a semidefinite program, round them, and decide every vertex exactly; None: not found.

    Parameters
    ----------
    problem : LinearProblem
        In SI.
    gains : sequence of 4 Fraction
    step : number or text
        T [s].
    """
    period, scales = rational(step, "step"), problem.scales()
    inside, K = problem.nondimensional(scales), scales.gains_inside(gains)
    question = inside, K, period / scales.time
    proposal = proposed(_propose, *question) if any(K) else []
    for bits in BITS if proposal else ():
        P, W = (rounded(matrix, bits) for matrix in proposal)
        proof = DelayProof(longest=period, P=scales.form_outside(P), W=_weight_outside(W, scales))
        if proof.holds(problem, gains):
            return proof
    return None


def proposed(programme: Callable[..., list[Any]], *question: Any) -> list[Any]:
    """What a programme proposes, or has proposed before; it is solved where somebody waits for it."""
    if handing_back():
        return programme(*question)
    return list(search_once(lambda: programme(*question), programme.__module__, *question))


def _weight_outside(W: Rows, scales: Scales) -> Matrix:
    """W in SI: units of x1, ξ1, p, and of the time in V'."""
    units = (scales.states[0], scales.states[2], scales.pressure)
    return times(1 / scales.time, congruent(W, [1 / u for u in units]))


def _propose(problem: LinearProblem, K: Sequence[Fraction], step: Fraction) -> list[Any]:
    """P and W with the largest margin, in units in which all parts of the law are as large."""
    import cvxpy as cp

    units = balanced_units(K)
    outer = (units[0], units[2], law_unit(K, units))
    P, W, margin = cp.Variable((4, 4), symmetric=True), cp.Variable((3, 3), symmetric=True), cp.Variable()
    constraints = [P >> np.eye(4) * 1e-6, W >> np.eye(3) * 1e-9, cp.trace(P) <= 1, margin <= 1]
    for vertex in problem.vertices():
        motion = _motion(problem, K, vertex)
        rate = (motion[0], motion[2], *product((tuple(K),), motion))
        A, R = scaled(motion, units, (*units, *outer)), scaled(rate, outer, (*units, *outer))
        fall = np.vstack([np.eye(4), np.zeros((3, 4))]) @ P @ A
        kept = np.hstack([np.zeros((3, 4)), np.eye(3)])
        gained = float(FOUR_OVER_PI_SQUARED * step**2) * R.T @ W @ R
        constraints.append(kept.T @ W @ kept - fall - fall.T - gained - margin * np.eye(7) >> 0)
    if not solved(cp.Problem(cp.Maximize(margin), constraints), margin):
        return []
    return [
        (np.asarray(value) * np.outer(1 / floats, 1 / floats)).tolist()
        for value, floats in ((P.value, np.array(units, dtype=float)), (W.value, np.array(outer, dtype=float)))
    ]


def solved(program: Any, margin: Any) -> bool:
    """Whether a solver proposes something with a margin; where it breaks down, once more with firmer factorisations."""
    import cvxpy as cp

    hand_back(program)
    for settings in ({}, {"static_regularization_constant": 1e-7}):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # an inaccurate proposal is decided exactly like any other
                program.solve(solver=cp.CLARABEL, **settings)
        except cp.SolverError:
            continue
        return margin.value is not None and float(margin.value) > LEAST_MARGIN
    return False


def scaled(matrix: Rows, rows: Iterable[Fraction], columns: Iterable[Fraction]) -> Any:
    """Matrix in other units of its rows and columns, in floating point."""
    across = np.array([float(u) for u in columns]) / np.array([[float(u)] for u in rows])
    return floats(matrix) * across


def balanced_units(K: Sequence[Fraction]) -> tuple[Fraction, ...]:
    """Powers of two for x1, x2, ξ1, ξ2 in which k1x1, k2x2, k3ξ1 and k4ξ2 are as large."""
    first = max(abs(float(K[0])), 1e-12)
    return tuple(Fraction(2) ** round(math.log2(first / max(abs(float(k)), 1e-12))) for k in K)


def law_unit(K: Sequence[Fraction], units: Sequence[Fraction]) -> Fraction:
    """Unit of p = −Kx in those of its states."""
    return max(abs(k * u) for k, u in zip(K, units, strict=True))
