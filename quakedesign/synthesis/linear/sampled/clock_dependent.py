"""The sampled law that runs, with a V that depends on the clock: longer periods than one V for all phases can prove.

Within a period, z = (x1, x2, q1, q2, p) moves by x1' = x2, x2' = s·x1 − w·x2 + βb·p while p and the sums
q = ξ(t_{k+1}), known since t_k, wait; at its end z⁺ = Jz: p⁺ = −K(x1, x2, q), q⁺ = q + T(x1, q1). V = zᵀP(θ)z with the
phase θ = t/T and P(θ) = Σ B_i(θ)P_i, Bernstein polynomials of degree D. By degree elevation of P' the loop is
exponentially stable if

    i(P_i − P_{i−1}) + (D − i)(P_{i+1} − P_i) + T(AᵀP_i + P_iA) < 0   for all i,   JᵀP_0J < P_D,   P_0 > 0

at all vertices of (s, w, β), for all measurable s, w, β in the box. The first is affine in T and the second convex, so
that the two ends of a range of periods prove every period in it, also one that changes from sample to sample.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from quakedesign.synthesis.linear.plant.problem import LinearProblem, Vertex
from quakedesign.synthesis.linear.plant.rational_matrices import (
    Matrix,
    Rows,
    congruent,
    definite,
    lyapunov,
    product,
    rounded,
    times,
    total,
    transpose,
)
from quakedesign.synthesis.linear.sampled.input_delay import BITS, balanced_units, law_unit, proposed, scaled, solved

DEGREE = 8
"""Of P(θ): 4 reaches a longest period 2 % shorter, 12 one that is 0.5 % longer."""
_ZERO, _ONE = Fraction(0), Fraction(1)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockProof:
    """P_0 … P_D that prove every sampling period of a range, in SI, exact.

    Attributes
    ----------
    shortest, longest : Fraction
        T [s].
    P : tuple of Matrix
        5 × 5 each, in x1, x2, q1, q2, p.
    """

    shortest: Fraction
    longest: Fraction
    P: tuple[Matrix, ...]

    def covers(self, step: Fraction) -> bool:
        """Whether it is about a period [s]."""
        return 0 < self.shortest <= step <= self.longest

    def forms(self, problem: LinearProblem, gains: Sequence[Fraction]) -> dict[str, Matrix]:
        """Matrices that all have to be positive definite, by name."""
        matrices = {"P": self.P[0]}
        for m, step in enumerate(dict.fromkeys((self.shortest, self.longest))):
            matrices[f"j{m}_"] = total(self.P[-1], times(-1, _after(_jump(gains, step), self.P[0])))
            for n, vertex in enumerate(problem.vertices()):
                flow = _flow(problem, vertex)
                for i, fall in enumerate(_changes(self.P)):
                    moved = times(step, lyapunov(flow, self.P[i]))
                    matrices[f"v{m}_{n}_{i}_"] = times(-1, total(fall, moved))
        return matrices

    def holds(self, problem: LinearProblem, gains: Sequence[Fraction]) -> bool:
        """Whether it proves the loop, exactly."""
        return 0 < self.shortest <= self.longest and all(map(definite, self.forms(problem, gains).values()))


def _changes(P: Sequence[Any]) -> Iterator[Any]:
    """Bernstein coefficients of P', of the degree of P; also of cvxpy's expressions."""
    last = len(P) - 1
    for i in range(last + 1):
        before = [(P[i], i), (P[i - 1], -i)] if i else []
        after = [(P[i + 1], last - i), (P[i], i - last)] if i < last else []
        yield _sum([*before, *after])


def _sum(parts: Sequence[tuple[Any, int]]) -> Any:
    if isinstance(parts[0][0], tuple):
        return total(*(times(factor, matrix) for matrix, factor in parts))
    return sum(factor * matrix for matrix, factor in parts)


def _after(jump: Matrix, P: Rows) -> Matrix:
    return product(transpose(jump), P, jump)


def _flow(problem: LinearProblem, vertex: Vertex) -> Matrix:
    """A of ż = Az at (β, s, w)."""
    beta, s, w = vertex
    rest = (_ZERO,) * 5
    return (
        (_ZERO, _ONE, _ZERO, _ZERO, _ZERO),
        (s, -w, _ZERO, _ZERO, beta * problem.sectors.authority),
        rest, rest, rest,
    )  # fmt: skip


def _jump(K: Sequence[Fraction], step: Fraction) -> Matrix:
    """J of z⁺ = Jz."""
    return (
        (_ONE, _ZERO, _ZERO, _ZERO, _ZERO),
        (_ZERO, _ONE, _ZERO, _ZERO, _ZERO),
        (step, _ZERO, _ONE, _ZERO, _ZERO),
        (_ZERO, _ZERO, step, _ONE, _ZERO),
        (*(-k for k in K), _ZERO),
    )


def clock_proof(
    problem: LinearProblem, gains: Sequence[Fraction], steps: tuple[Fraction, Fraction], *, degree: int = DEGREE
) -> ClockProof | None:
    """Search P_0 … P_D by a semidefinite program, round them, and decide every form exactly; None: not found.

    Parameters
    ----------
    problem : LinearProblem
        In SI.
    gains : sequence of 4 Fraction
    steps : (Fraction, Fraction)
        Shortest and longest T [s].
    degree : int
        D.
    """
    scales = problem.scales()
    inside, K = problem.nondimensional(scales), scales.gains_inside(gains)
    lengths = tuple(dict.fromkeys(step / scales.time for step in steps))
    question = inside, K, lengths, degree
    proposal = proposed(_propose, *question) if any(K) else []
    outside = [1 / u for u in (*scales.states, scales.pressure)]
    for bits in BITS if proposal else ():
        P = tuple(congruent(rounded(matrix, bits), outside) for matrix in proposal)
        proof = ClockProof(shortest=steps[0], longest=steps[1], P=P)
        if proof.holds(problem, gains):
            return proof
    return None


def _propose(problem: LinearProblem, K: Sequence[Fraction], lengths: Sequence[Fraction], degree: int) -> list[Any]:
    """P_0 … P_D with the largest margin, in units in which all parts of the law are as large."""
    import cvxpy as cp

    own = balanced_units(K)
    units = (*own, law_unit(K, own))
    P, margin = [cp.Variable((5, 5), symmetric=True) for _ in range(degree + 1)], cp.Variable()
    room = margin * np.eye(5)
    constraints = [P[0] >> 1e-6 * np.eye(5), cp.trace(P[0]) <= 1, margin <= 1]
    for length in lengths:
        jump = scaled(_jump(K, length), units, units)
        constraints.append(P[degree] - jump.T @ P[0] @ jump - room >> 0)
        for vertex in problem.vertices():
            A = float(length) * scaled(_flow(problem, vertex), units, units)
            falls = zip(_changes(P), P, strict=True)
            constraints += [-(fall + A.T @ matrix + matrix @ A) - room >> 0 for fall, matrix in falls]
    if not solved(cp.Problem(cp.Maximize(margin), constraints), margin):
        return []
    inverse = 1 / np.array(units, dtype=float)
    return [(np.asarray(matrix.value) * np.outer(inverse, inverse)).tolist() for matrix in P]
