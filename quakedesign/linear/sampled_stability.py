"""Stability of the sampled e-LQR under zero-order hold with time-varying parameters.

Chapters: Wirtinger inequality with one quadratic V (Liu, Suplin and Fridman 2010, IMA J. Math. Control Inf. 27, 445);
clock-dependent V in Bernstein form; poles at constant parameters in ball arithmetic, which refute a sampling period;
the longest proved sampling period; all results for one K.
"""

import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite
from typing import Any

import numpy as np
from flint import acb, acb_mat, arb_mat, ctx

from quakedesign.cache import search_once
from quakedesign.exact import LowerBound, UpperBound, rational
from quakedesign.fault.model import require_positive
from quakedesign.files import Json
from quakedesign.guarantees.exact.norms import matrix
from quakedesign.linear.linear_problem import (
    LinearProblem,
    Matrix,
    Rows,
    Vertex,
    congruent,
    definite,
    floats,
    lyapunov,
    matrix_product,
    rounded,
    times,
    total,
    transpose,
)
from quakedesign.lyapunov import Verdict
from quakedesign.sos.solve.conic import collecting, record

# ----------------------------------------------------------------------
# The sampled law with arbitrarily time-varying parameters: one quadratic V and Wirtinger's inequality, exact.
#
# p = −Kx(t_k) is constant over a period, and the integrals are sums, ξ⁺ = ξ + T(x1, ξ1)(t_k), interpolated linearly
# between samples, so that for all t
#
#     ẋ = (x2, s·x1 − w·x2 − βb(Kx + δu), x1 + δ1, ξ1 + δ2),   δ = y(t_k) − y(t),   y = (x1, ξ1, Kx).
#
# δ vanishes at every sample and δ' = −ẏ, so that for W > 0 (Liu, Suplin and Fridman 2010, IMA J. Math. Control Inf. 27,
# 445) ∫δᵀWδ ≤ (2T/π)²∫ẏᵀWẏ over every period of at most T. If P > 0, W > 0 and
#
#     2xᵀPẋ + (2T/π)²ẏᵀWẏ − δᵀWδ < 0   for all (x, δ) ≠ 0 and all vertices of (s, w, β),
#
# the loop is exponentially stable for all measurable s, w, β in the box and all samples at most T apart. The left side
# is convex in (s, w, β), so that the vertices suffice.

FOUR_OVER_PI_SQUARED = Fraction(40529, 100000)  # not below (2/π)² = 0.4052847…
BITS = (30, 45, 60)
"""Binary digits to which proposals of a solver are rounded, tried in turn."""
LEAST_MARGIN = 1e-9
"""Least margin of a proposal, in its own units; a smaller margin is solver noise."""
_ZERO, _ONE = Fraction(0), Fraction(1)


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayProof:
    """P and W that prove stability for every sampling period up to the longest one, in SI, exact."""

    longest: Fraction  # T [s]
    P: Matrix  # 4 × 4, in x1, x2, ξ1, ξ2
    W: Matrix  # 3 × 3, in δ1, δ2, δu

    def covers(self, step: Fraction) -> bool:
        """Whether the proof covers a period [s]."""
        return 0 < step <= self.longest

    def forms(self, problem: LinearProblem, gains: Sequence[Fraction]) -> dict[str, Matrix]:
        """Matrices that must all be positive definite, by name."""
        matrices = {"P": self.P, "W": self.W}
        for n, vertex in enumerate(problem.vertices()):
            matrices[f"v{n}_"] = decrease_form(problem, gains, self.longest, vertex, self.P, self.W)
        return matrices

    def holds(self, problem: LinearProblem, gains: Sequence[Fraction]) -> bool:
        """Whether the matrices prove stability of the loop, exactly."""
        return all(map(definite, self.forms(problem, gains).values()))


def decrease_form(
    problem: LinearProblem, K: Sequence[Fraction], step: Fraction, vertex: Vertex, P: Rows, W: Rows
) -> Matrix:
    """Matrix (7 × 7) of minus the form in (x, δ) at a vertex."""
    motion = _motion(problem, K, vertex)
    rate = (motion[0], motion[2], *matrix_product((tuple(K),), motion))
    fall = (*matrix_product(P, motion), *((_ZERO,) * 7 for _ in range(3)))
    corner = ((_ZERO,) * 7,) * 4 + tuple((_ZERO,) * 4 + tuple(row) for row in W)
    rate_term = matrix_product(transpose(rate), W, rate)
    return total(times(-1, fall), times(-1, transpose(fall)), times(-FOUR_OVER_PI_SQUARED * step**2, rate_term), corner)


def _motion(problem: LinearProblem, K: Sequence[Fraction], vertex: Vertex) -> Matrix:
    """ẋ of (x, δ), 4 × 7."""
    first, second, third, fourth = problem.loop(vertex, K)
    gain = vertex[0] * problem.sectors.authority
    return (
        (*first, _ZERO, _ZERO, _ZERO),
        (*second, _ZERO, _ZERO, -gain),
        (*third, _ONE, _ZERO, _ZERO),
        (*fourth, _ZERO, _ONE, _ZERO),
    )


def delay_proof(problem: LinearProblem, gains: Sequence[Fraction], step: float | str | Fraction) -> DelayProof | None:
    """Search for P and W by a semidefinite program, round them, and decide every vertex exactly; None on failure.

    Parameters
    ----------
    problem : LinearProblem
        In SI.
    step : number or text
        T [s].
    """
    period, scales = rational(step, "step"), problem.scales()
    inside, K = problem.nondimensional(scales), scales.gains_inside(gains)
    arguments = inside, K, period / scales.time
    proposal = proposed(_propose, *arguments) if any(K) else []
    for bits in BITS if proposal else ():
        P, W = (rounded(matrix, bits) for matrix in proposal)
        units = (scales.states[0], scales.states[2], scales.pressure)  # of x1, ξ1 and p, in which W is
        proof = DelayProof(
            longest=period, P=scales.form_outside(P), W=times(1 / scales.time, congruent(W, [1 / u for u in units]))
        )
        if proof.holds(problem, gains):
            return proof
    return None


def proposed(programme: Callable[..., list[Rows]], *arguments: object) -> list[Rows]:
    """Solution proposed by a programme, from the cache; solved anew in a block `conic.stated_problems`."""
    if collecting():
        return programme(*arguments)
    return list(search_once(lambda: programme(*arguments), programme.__module__, *arguments))


def _propose(problem: LinearProblem, K: Sequence[Fraction], step: Fraction) -> list[Rows]:
    """P and W with the largest margin, in units in which all parts of the law have equal size."""
    import cvxpy as cp

    units = balanced_units(K)
    outer = (units[0], units[2], law_unit(K, units))
    P, W, margin = cp.Variable((4, 4), symmetric=True), cp.Variable((3, 3), symmetric=True), cp.Variable()
    constraints = [P >> np.eye(4) * 1e-6, W >> np.eye(3) * 1e-9, cp.trace(P) <= 1, margin <= 1]
    for vertex in problem.vertices():
        motion = _motion(problem, K, vertex)
        rate = (motion[0], motion[2], *matrix_product((tuple(K),), motion))
        A, R = scaled(motion, units, (*units, *outer)), scaled(rate, outer, (*units, *outer))
        fall = np.vstack([np.eye(4), np.zeros((3, 4))]) @ P @ A
        selection = np.hstack([np.zeros((3, 4)), np.eye(3)])
        rate_term = float(FOUR_OVER_PI_SQUARED * step**2) * R.T @ W @ R
        constraints.append(selection.T @ W @ selection - fall - fall.T - rate_term - margin * np.eye(7) >> 0)
    if not solved(cp.Problem(cp.Maximize(margin), constraints), margin):
        return []
    return [
        (np.asarray(value) * np.outer(1 / floats, 1 / floats)).tolist()
        for value, floats in ((P.value, np.array(units, dtype=float)), (W.value, np.array(outer, dtype=float)))
    ]


def solved(program: Any, margin: Any) -> bool:
    """Whether a solver finds a solution with a margin; after a breakdown, retried with stronger regularisation."""
    import cvxpy as cp

    record(program)
    for settings in ({}, {"static_regularization_constant": 1e-7}):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # inaccurate proposals are verified exactly, too
                program.solve(solver=cp.CLARABEL, **settings)
        except cp.SolverError:
            continue
        return margin.value is not None and float(margin.value) > LEAST_MARGIN
    return False


def scaled(matrix: Rows, rows: Iterable[Fraction], columns: Iterable[Fraction]) -> np.ndarray:
    """Matrix in other units of its rows and columns, in floating point."""
    across = np.array([float(u) for u in columns]) / np.array([[float(u)] for u in rows])
    return np.asarray(floats(matrix) * across)


def balanced_units(K: Sequence[Fraction]) -> tuple[Fraction, ...]:
    """Powers of two for x1, x2, ξ1, ξ2 in which k1x1, k2x2, k3ξ1 and k4ξ2 have equal size."""
    first = max(abs(float(K[0])), 1e-12)
    return tuple(Fraction(2) ** round(math.log2(first / max(abs(float(k)), 1e-12))) for k in K)


def law_unit(K: Sequence[Fraction], units: Sequence[Fraction]) -> Fraction:
    """Unit of p = −Kx that follows from the units of the states."""
    return max(abs(k * u) for k, u in zip(K, units, strict=True))


# ----------------------------------------------------------------------
# The sampled law with a clock-dependent V, which proves stability for longer periods than one V for all phases.
#
# Within a period, z = (x1, x2, q1, q2, p) moves by x1' = x2, x2' = s·x1 − w·x2 + βb·p while p and the sums q =
# ξ(t_{k+1}), known since t_k, are constant; at its end z⁺ = Jz: p⁺ = −K(x1, x2, q), q⁺ = q + T(x1, q1). V = zᵀP(θ)z
# with the phase θ = t/T and P(θ) = Σ B_i(θ)P_i, Bernstein polynomials of degree D. By degree elevation of P' the loop
# is exponentially stable if
#
#     i(P_i − P_{i−1}) + (D − i)(P_{i+1} − P_i) + T(AᵀP_i + P_iA) < 0   for all i,   JᵀP_0J < P_D,   P_0 > 0
#
# at all vertices of (s, w, β), for all measurable s, w, β in the box. The first is affine in T and the second convex,
# so that the ends of a range of periods prove every period in it, also periods that vary from sample to sample.

DEGREE = 8
"""Degree of P(θ): with 4 the longest period is 2 % shorter, with 12 it is 0.5 % longer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockProof:
    """P_0 … P_D that prove stability for every sampling period of a range, in SI, exact."""

    # shortest, longest: T [s]
    shortest: Fraction
    longest: Fraction
    P: tuple[Matrix, ...]  # 5 × 5 each, in x1, x2, q1, q2, p

    def covers(self, step: Fraction) -> bool:
        """Whether the proof covers a period [s]."""
        return 0 < self.shortest <= step <= self.longest

    def forms(self, problem: LinearProblem, gains: Sequence[Fraction]) -> dict[str, Matrix]:
        """Matrices that must all be positive definite, by name."""
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
        """Whether the matrices prove stability of the loop, exactly."""
        return 0 < self.shortest <= self.longest and all(map(definite, self.forms(problem, gains).values()))


def _changes(P: Sequence[Any]) -> Iterator[Any]:
    """Bernstein coefficients of P', raised to the degree of P; entries of P may be cvxpy expressions."""
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
    return matrix_product(transpose(jump), P, jump)


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
    """Search for P_0 … P_D by a semidefinite program, round them, and decide every form exactly; None on failure.

    Parameters
    ----------
    problem : LinearProblem
        In SI.
    steps : (Fraction, Fraction)
        Shortest and longest T [s].
    degree : int
        D.
    """
    scales = problem.scales()
    inside, K = problem.nondimensional(scales), scales.gains_inside(gains)
    lengths = tuple(dict.fromkeys(step / scales.time for step in steps))
    arguments = inside, K, lengths, degree
    proposal = proposed(_propose_clock_dependent, *arguments) if any(K) else []
    outside = [1 / u for u in (*scales.states, scales.pressure)]
    for bits in BITS if proposal else ():
        P = tuple(congruent(rounded(matrix, bits), outside) for matrix in proposal)
        proof = ClockProof(shortest=steps[0], longest=steps[1], P=P)
        if proof.holds(problem, gains):
            return proof
    return None


def _propose_clock_dependent(
    problem: LinearProblem, K: Sequence[Fraction], lengths: Sequence[Fraction], degree: int
) -> list[Rows]:
    """P_0 … P_D with the largest margin, in units in which all parts of the law have equal size."""
    import cvxpy as cp

    own = balanced_units(K)
    units = (*own, law_unit(K, own))
    P, margin = [cp.Variable((5, 5), symmetric=True) for _ in range(degree + 1)], cp.Variable()
    slack = margin * np.eye(5)
    constraints = [P[0] >> 1e-6 * np.eye(5), cp.trace(P[0]) <= 1, margin <= 1]
    for length in lengths:
        jump = scaled(_jump(K, length), units, units)
        constraints.append(P[degree] - jump.T @ P[0] @ jump - slack >> 0)
        for vertex in problem.vertices():
            A = float(length) * scaled(_flow(problem, vertex), units, units)
            falls = zip(_changes(P), P, strict=True)
            constraints += [-(fall + A.T @ matrix + matrix @ A) - slack >> 0 for fall, matrix in falls]
    if not solved(cp.Problem(cp.Maximize(margin), constraints), margin):
        return []
    inverse = 1 / np.array(units, dtype=float)
    return [(np.asarray(matrix.value) * np.outer(inverse, inverse)).tolist() for matrix in P]


# ----------------------------------------------------------------------
# Poles of the sampled law, with zero-order hold and summed integrals, at constant parameters, in balls.
#
# A corner of the box with a pole outside the unit circle refutes a sampling period for the whole box. Inside the box
# constant parameters may be worse than at its corners: a period that is not refuted here is not thereby proved.

_DOUBLINGS = 24
_TOLERANCE = 0.01  # relative width at which the bisection stops
_BITS = (100, 2000)  # the second for a plant with large growth within a period


def poles(problem: LinearProblem, gains: Sequence[Fraction], step: Fraction, vertex: Vertex) -> list[acb]:
    """Eigenvalues of one period in x1, x2, ξ1, ξ2 at constant (β, s, w), as complex balls; not finite if not isolated.

    Parameters
    ----------
    problem : LinearProblem
        In units in which its numbers are near 1.
    step : Fraction
        T_s, in the unit of time of `problem`.
    vertex : (Fraction, Fraction, Fraction)
        β, s, w, in the units of `problem`.
    """
    beta, s, w = vertex
    flow = ((_ZERO, _ONE, _ZERO), (s, -w, beta * problem.sectors.authority), (_ZERO,) * 3)
    start = ((_ONE, _ZERO, _ZERO, _ZERO), (_ZERO, _ONE, _ZERO, _ZERO), tuple(-k for k in gains))
    sums = ((step, _ZERO, _ONE, _ZERO), (_ZERO, _ZERO, step, _ONE))
    values = list[acb]()
    for bits in _BITS:
        with ctx.workprec(bits):
            moved = (matrix(times(step, flow)).exp() * matrix(start)).tolist()
            period = acb_mat(arb_mat([*moved[:2], *matrix(sums).tolist()]))
            values = list(period.eig(multiple=True, nonstop=True))
        if all(z.is_finite() for z in values):
            break
    return values


@dataclass(frozen=True, slots=True)
class HeldPoles:
    """Sampling periods that the poles at the corners of the box allow or refute."""

    problem: LinearProblem  # In SI
    gains: Sequence[Fraction]

    def at(self, step: Fraction) -> dict[Vertex, list[acb]]:
        """Poles by corner (β, s [1/s²], w [1/s]) at a period [s]."""
        scales = self.problem.scales()
        inside, feedback = self.problem.nondimensional(scales), scales.gains_inside(self.gains)
        return {
            corner: poles(inside, feedback, step / scales.time, scaled)
            for corner, scaled in zip(self.problem.vertices(), inside.vertices(), strict=True)
        }

    def unstable(self, step: Fraction) -> Vertex | None:
        """Corner at which the loop is proved not asymptotically stable for a period [s]; None if there is none."""
        if not self.gains[3]:  # then z = 1 is a pole for every plant
            return self.problem.vertices()[0]
        return next((corner for corner, poles in self.at(step).items() if any(abs(z) > 1 for z in poles)), None)

    def radius(self, step: Fraction) -> float:
        """Spectral radius of the map over a period [s], largest over the corners; floating point, not proved."""
        return max(float(abs(z).mid()) for poles in self.at(step).values() for z in poles)

    def limit(self) -> tuple[Fraction, Fraction | None] | None:
        """Nearly the longest period [s] that the corners allow, and a longer one that they refute.

        Returns
        -------
        (Fraction, Fraction or None) or None
            The second is None if no longer period was refuted, up to eight million times 1/|λ| of the fastest pole λ.
            The whole result is None if all periods tried are refuted.
        """
        loops = (floats(self.problem.loop(vertex, self.gains)) for vertex in self.problem.vertices())
        first = low = rational(f"{0.5 / max(float(np.abs(np.linalg.eigvals(loop)).max()) for loop in loops):.3e}")
        for _ in range(_DOUBLINGS):
            if self.unstable(2 * low):
                break
            low *= 2
        else:
            return low, None
        high = 2 * low
        while self.unstable(low):
            low, high = low / 2, low
            if low < first / 2**12:
                return None
        while high / low > 1 + _TOLERANCE:
            middle = (low + high) / 2
            low, high = (low, middle) if self.unstable(middle) else (middle, high)
        return low, high


# ----------------------------------------------------------------------
# Longest proved sampling period of the law with summed integrals and arbitrarily varying parameters.
#
# The integrals are summed over the samples as in the scheme ``explicit``; β, s and w are measurable in time, anywhere
# in their ranges over the box, also inside a period.

_SHARES = tuple(Fraction(n, 100) for n in (99, 98, 96, 93, 88, 80))
"""Shares of the limit at the corners up to which a clock-dependent V is tried; degree 8 reaches 98 or 99 %."""
_DEGREES = (DEGREE, 2 * DEGREE)
"""Degrees tried for one period: 8 is too low if the state without control doubles within the period."""
_VARYING_TOLERANCE = Fraction(1, 50)
"""Relative width at which the bisection for one V stops."""
HoldProof = DelayProof | ClockProof


@dataclass(frozen=True, slots=True, kw_only=True)
class VaryingVerdict:
    """Verdict on the sampled law at one sampling period."""

    verdict: Verdict  # REFUTED: not asymptotically stable with the constant parameters of `witness`
    step: Fraction  # T [s]
    proof: HoldProof | None = None
    witness: Vertex | None = None  # β, s [1/s²], w [1/s]


@dataclass(frozen=True, slots=True, kw_only=True)
class LargestVaryingStep:
    """Longest proved sampling period of the sampled law, and a longer refuted one."""

    proved: LowerBound  # Every period in (0, proved] is stable [s]
    # A longer one, unstable for constant parameters of the box [s]; undecided in between
    refuted: UpperBound | None
    proofs: tuple[HoldProof, ...]  # These cover every period up to `proved`

    def proof_at(self, step: Fraction) -> HoldProof | None:
        """Proof that covers a period [s]."""
        return next((proof for proof in self.proofs if proof.covers(step)), None)


def varying_verdict(
    problem: LinearProblem,
    gains: Sequence[Fraction],
    step: float | str | Fraction,
    *,
    longest: LargestVaryingStep | None = None,
) -> VaryingVerdict:
    """Prove stability of the sampled law at a sampling period, or refute it with constant parameters.

    Parameters
    ----------
    problem : LinearProblem
        In SI.
    step : number or text
        T [s].
    longest : LargestVaryingStep, optional
        Existing result for these gains.
    """
    period = rational(step, "step")
    witness = HeldPoles(problem, gains).unstable(period)
    if witness is not None:
        return VaryingVerdict(verdict=Verdict.REFUTED, step=period, witness=witness)
    proof: HoldProof | None = longest.proof_at(period) if longest else delay_proof(problem, gains, period)
    for degree in () if proof else _DEGREES:
        proof = proof or clock_proof(problem, gains, (period, period), degree=degree)
    return VaryingVerdict(verdict=Verdict.PROVED if proof else Verdict.UNDECIDED, step=period, proof=proof)


def largest_varying_step(problem: LinearProblem, gains: Sequence[Fraction]) -> LargestVaryingStep | None:
    """Longest sampling period up to which the sampled law is proved.

    One V for all phases covers short periods, by bisection; then clock-dependent V cover further ranges, towards the
    longest period that constant parameters at the corners allow. Periods have four digits.

    Parameters
    ----------
    problem : LinearProblem
        In SI.

    Returns
    -------
    LargestVaryingStep or None
        None when no range of periods was proved.
    """
    corners = HeldPoles(problem, gains)
    longest, refuted = corners.limit() or (None, None)
    first = _longest_delay(problem, gains, longest) if longest else None
    if longest is None or first is None:
        return None
    proofs: list[HoldProof] = [first]
    while more := _further(problem, gains, proofs[-1].longest, longest):
        proofs.append(more)
    return LargestVaryingStep(
        proved=LowerBound(proofs[-1].longest),
        refuted=_refuted(corners, refuted) if refuted is not None else None,
        proofs=tuple(proofs),
    )


def _longest_delay(problem: LinearProblem, gains: Sequence[Fraction], most: Fraction) -> DelayProof | None:
    low, high, best = Fraction(0), most, None
    while high - low > _VARYING_TOLERANCE * high and high > most / 1000:
        middle = _short((low + high) / 2)
        proof = delay_proof(problem, gains, middle)
        low, high, best = (middle, high, proof) if proof else (low, middle, best)
    return best


def _further(problem: LinearProblem, gains: Sequence[Fraction], low: Fraction, limit: Fraction) -> ClockProof | None:
    """Proof from a period on, as far towards the limit at the corners as possible."""
    for share in _SHARES:
        high = _short(share * limit)
        proof = clock_proof(problem, gains, (low, high)) if high > low else None
        if proof is not None:
            return proof
    return None


def _refuted(corners: HeldPoles, step: Fraction) -> UpperBound:
    """Refuted period, rounded up to four digits if that period is refuted too."""
    longer = Fraction(f"{UpperBound(step):.4g}")
    return UpperBound(longer if corners.unstable(longer) else step)


def _short(step: Fraction) -> Fraction:
    """Period rounded down to four digits."""
    return Fraction(f"{LowerBound(step):.4g}")


# ----------------------------------------------------------------------
# All results for a gain K with zero-order hold over a sampling period.


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledStability:
    """Results for a gain K with zero-order hold over a sampling period."""

    verdict_at_step: VaryingVerdict  # Verdict with summed integrals and any time history of the parameters
    longest: LargestVaryingStep | None  # Longest proved period
    radius: float  # Spectral radius of a period, largest over the vertices, in floating point

    @property
    def step(self) -> Fraction:
        """T_s [s]."""
        return self.verdict_at_step.step

    @property
    def largest_step(self) -> LowerBound | None:
        """Every period up to this one is proved for the sampled law [s]."""
        return self.longest.proved if self.longest else None

    @property
    def refuted_step(self) -> UpperBound | None:
        """Longer period, unstable for constant parameters [s]; undecided in between."""
        return self.longest.refuted if self.longest else None

    def to_dict(self) -> Json:
        """Plain values, SI; proved periods are floats rounded down."""
        refuted, witness = self.refuted_step, self.verdict_at_step.witness
        return {
            "step": float(self.step),
            "verdict": str(self.verdict_at_step.verdict),
            "varying": str(self.verdict_at_step.verdict),
            "radius": self.radius if isfinite(self.radius) else None,
            "witness": [float(v) for v in witness] if witness else None,
            "largest_step": _number(self.largest_step),
            "refuted_step": _number(refuted),
        }


def _number(bound: LowerBound | UpperBound | None) -> float | None:
    return None if bound is None else float(bound)


def sampled_stability(
    problem: LinearProblem, gains: Sequence[Fraction], step: float | str | Fraction
) -> SampledStability:
    """Decide stability for a gain K at a sampling period [s], with the longest proved period.

    Parameters
    ----------
    problem : LinearProblem
        In SI.
    step : number or text
        T_s [s].

    Raises
    ------
    ParameterError
        For a period that is not positive.
    """
    period = rational(step, "step")
    require_positive("Give it in seconds.", step=period)
    longest = largest_varying_step(problem, gains)
    return SampledStability(
        verdict_at_step=varying_verdict(problem, gains, period, longest=longest),
        longest=longest,
        radius=HeldPoles(problem, gains).radius(period),
    )
