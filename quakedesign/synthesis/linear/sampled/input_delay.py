"""A held loop whose parameters vary in time, also inside a period: one quadratic V and Wirtinger's inequality, exact.

Between samples u = −K(x + e) with Ke = δ, δ = K(x(t_k) − x(t)), δ(t_k) = 0 and δ' = −Kẋ, so that (Liu, Suplin and
Fridman 2010, IMA J. Math. Control Inf. 27, 445) ∫δ² ≤ (2T/π)²∫(Kẋ)² over every period of at most T. If P > 0 and λ > 0
satisfy

    2xᵀPẋ + λ[(2T/π)²(Kẋ)² − δ²] < 0   for all (x, δ) ≠ 0 and all vertices,   ẋ = A(s, w)x − βb·B(Kx + δ),

the loop is exponentially stable for all measurable s, w, β in the box and all sampling instants at most T apart. The
left side is convex in (s, w, β), so that the vertices suffice. ξ' = (x1, ξ1) holds at all times.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from quakedesign.certificates import Verdict
from quakedesign.rationals import rational
from quakedesign.synthesis.linear.plant.problem import LinearProblem, Vertex
from quakedesign.synthesis.linear.plant.rational_matrices import (
    Matrix,
    definite,
    diagonal,
    lyapunov,
    outer,
    rounded,
    times,
    total,
)
from quakedesign.synthesis.linear.sampled.stability import largest_step

FOUR_OVER_PI_SQUARED = Fraction(40529, 100000)  # not below (2/π)² = 0.4052847…
_BITS = (30, 45, 60)
CLAIM = "p held for at most T, parameters varying in time anywhere in the box, also inside a period"


@dataclass(frozen=True, slots=True, kw_only=True)
class VaryingVerdict:
    """Verdict on the held loop with parameters that vary in time.

    Attributes
    ----------
    verdict : Verdict
        PROVED or UNDECIDED.
    step : Fraction
        Longest sampling period T [s]; shorter ones are covered.
    P : Matrix or None
        In SI, exact.
    multiplier : Fraction or None
        λ.
    claim : str
    """

    verdict: Verdict
    step: Fraction
    P: Matrix | None = None
    multiplier: Fraction | None = None
    claim: str = CLAIM


def varying_verdict(problem: LinearProblem, gains: Sequence[Fraction], step: float | str | Fraction) -> VaryingVerdict:
    """Search P and λ by a semidefinite program, round them, and decide every vertex exactly.

    Parameters
    ----------
    problem : LinearProblem
        In SI.
    gains : sequence of 4 Fraction
    step : number or text
        T [s].
    """
    period = rational(step, "step")
    scales = problem.scales()
    inside, K = problem.nondimensional(scales), scales.gains_inside(gains)
    length = period / scales.time
    proposal = _propose(inside, K, length) if any(K) else None
    for bits in _BITS if proposal else ():
        P, weight = _rounded(proposal, bits)
        if varying_proof(inside, K, length, P, weight):
            return VaryingVerdict(
                verdict=Verdict.PROVED,
                step=period,
                P=scales.form_outside(P),
                multiplier=weight / (scales.pressure**2 * scales.time),
            )
    return VaryingVerdict(verdict=Verdict.UNDECIDED, step=period)


def varying_proof(
    problem: LinearProblem, gains: Sequence[Fraction], step: Fraction, P: Matrix, multiplier: Fraction
) -> bool:
    """Whether P and λ prove the held loop, exactly, at every vertex."""
    return (
        multiplier > 0
        and definite(P)
        and all(definite(decrease_form(problem, gains, step, v, P, multiplier)) for v in problem.vertices())
    )


def decrease_form(
    problem: LinearProblem, K: Sequence[Fraction], step: Fraction, vertex: Vertex, P: Matrix, weight: Fraction
) -> Matrix:
    """Matrix (5 × 5) of minus the form in (x, δ) at a vertex, for P and λ in the units of the problem."""
    return total(_first(problem, K, vertex, P), times(weight, _second(problem, K, step, vertex)))


def _first(problem: LinearProblem, K: Sequence[Fraction], vertex: Vertex, P: Matrix) -> Matrix:
    """−2xᵀPẋ in (x, δ)."""
    held = lyapunov(problem.loop(vertex, K), P)
    push = vertex[0] * problem.sectors.authority
    side = [push * row[1] for row in P]  # PB·βb
    rows = [(*(-v for v in row), c) for row, c in zip(held, side, strict=True)]
    return (*rows, (*side, Fraction(0)))


def _second(problem: LinearProblem, K: Sequence[Fraction], step: Fraction, vertex: Vertex) -> Matrix:
    """δ² − (2T/π)²(Kẋ)² in (x, δ)."""
    loop, push = problem.loop(vertex, K), vertex[0] * problem.sectors.authority
    rate = [sum((k * row[j] for k, row in zip(K, loop, strict=True)), Fraction(0)) for j in range(4)]
    rate.append(-push * K[1])
    zero = Fraction(0)
    return total(
        diagonal((zero, zero, zero, zero, Fraction(1))), times(-FOUR_OVER_PI_SQUARED * step**2, outer(rate, rate))
    )


def _propose(problem: LinearProblem, K: Sequence[Fraction], step: Fraction) -> Any:
    """P and λ with the largest margin, in states scaled by the slowest and fastest parts of the loop."""
    import cvxpy as cp
    import numpy as np

    units = _balance(problem, K)
    P, weight, margin = cp.Variable((4, 4), symmetric=True), cp.Variable(), cp.Variable()
    constraints = [P >> np.eye(4) * 1e-6, weight >= 1e-9, cp.trace(P) <= 1, margin <= 1]
    size = float(sum(abs(k * u) for k, u in zip(K, units, strict=True)))
    pace = max(float(np.abs(_scaled_loop(problem, K, v, units)).max()) for v in problem.vertices())
    for vertex in problem.vertices():
        A = _scaled_loop(problem, K, vertex, units)
        push = float(vertex[0] * problem.sectors.authority) * size / float(units[1])
        B = np.zeros((4, 1))
        B[1] = push
        k = np.array([float(v * u) for v, u in zip(K, units, strict=True)]) / size
        rate = np.append(k @ A, -push * k[1]).reshape(5, 1)
        first = cp.bmat([[-(A.T @ P + P @ A), P @ B], [B.T @ P, np.zeros((1, 1))]]) / pace
        second = np.diag([0, 0, 0, 0, 1.0]) - float(FOUR_OVER_PI_SQUARED * step**2) * rate @ rate.T
        constraints.append(first + weight * second - margin * np.eye(5) >> 0)
    program = cp.Problem(cp.Maximize(margin), constraints)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # an inaccurate proposal is decided exactly like any other
            program.solve(solver=cp.CLARABEL)
    except cp.SolverError:
        return None
    if P.value is None or weight.value is None or margin.value is None or float(margin.value) <= 0:
        return None
    outside = np.array([float(1 / u) for u in units])
    return P.value * outside[:, None] * outside[None, :], float(weight.value) * pace / size**2


def _scaled_loop(problem: LinearProblem, K: Sequence[Fraction], vertex: Vertex, units: Sequence[Fraction]) -> Any:
    import numpy as np

    loop = np.array([[float(v) for v in row] for row in problem.loop(vertex, K)])
    return loop / np.array([[float(u)] for u in units]) * np.array([float(u) for u in units])


def _balance(problem: LinearProblem, K: Sequence[Fraction]) -> tuple[Fraction, ...]:
    """Powers of two for x2, ξ1, ξ2 from the gains: k2x2, k3ξ1 and k4ξ2 as large as k1x1."""
    import math

    def near(value: float) -> Fraction:
        return Fraction(2) ** round(math.log2(value))

    first = max(abs(float(K[0])), 1e-12)
    return tuple(near(first / max(abs(float(k)), 1e-12)) for k in K)


def _rounded(proposal: Any, bits: int) -> tuple[Matrix, Fraction]:
    P, weight = proposal
    return rounded(P, bits), Fraction(weight)


def largest_varying_step(problem: LinearProblem, gains: Sequence[Fraction], *, tolerance: float = 0.01) -> Fraction:
    """Longest period [s] proved for parameters that vary in time, by bisection; 0 where none is.

    Never above the largest period for constant parameters.
    """
    constant = largest_step(problem, gains)
    if constant is None:
        return Fraction(0)
    low, high = Fraction(0), constant.proved
    while high - low > Fraction(tolerance) * high:
        middle = (low + high) / 2
        proved = varying_verdict(problem, gains, middle).verdict is Verdict.PROVED
        low, high = (middle, high) if proved else (low, middle)
        if high < constant.proved / 1000:
            return Fraction(0)
    return low
