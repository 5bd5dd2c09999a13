"""Theorem 2 of the paper as printed and as corrected: inverse optimality of a gain K.

Optimality of K for a Q that covers the uncertainty is proved or refuted exactly (Kalman 1964, J. Basic
Eng. 86, 51; P proposed by spectral factorisation, Anderson 1967, SIAM J. Control 5, 171). Further
chapters: printed against sound premise (ERRATA 6, 7), and state feedback against error feedback about a
moving reference (ERRATA 28, 29).
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import sympy as sp
from flint import arb
from scipy.optimize import minimize_scalar

from quakedesign.exact import end_of, exact_text, fraction_of, rational
from quakedesign.fault import Fault
from quakedesign.guarantees.exact.norms import ball, identity, matrix
from quakedesign.laws.elqr import FEEDBACKS
from quakedesign.linear.linear_problem import (
    FeedbackLoop,
    LinearProblem,
    Matrix,
    ProblemScales,
    Vertex,
    characteristic,
    definite,
    diagonal,
    hurwitz,
    loop_matrix,
    lyapunov,
    outer,
    times,
    total,
    trace_of_product,
)
from quakedesign.lyapunov import Verdict
from quakedesign.lyapunov.exact.perturbation_bounds import least_authority, plant_ranges, rest_pressure
from quakedesign.symbolic import plant
from quakedesign.symbolic.friction_bounds import friction_bounds

# ----------------------------------------------------------------------
# The question of inverse optimality in exact numbers: what a proof and a refutation must satisfy.

FREE = ((0, 0), (0, 2), (0, 3), (2, 2), (2, 3), (3, 3))
NOTHING = diagonal((Fraction(0),) * 4)


@dataclass(frozen=True, slots=True)
class TheoremProblem:
    """A, K and the bound in nondimensional numbers; B = (0, 1, 0, 0)ᵀ."""

    inside: LinearProblem
    K: tuple[Fraction, ...]
    printed: tuple[Fraction, Fraction] | None

    def P(self, free: Sequence[Fraction]) -> Matrix:
        """Symmetric matrix with second column K and six free entries."""
        rows = [[Fraction(0)] * 4 for _ in range(4)]
        for i, k in enumerate(self.K):
            rows[i][1] = rows[1][i] = k
        for (i, j), v in zip(FREE, free, strict=True):
            rows[i][j] = rows[j][i] = v
        return tuple(tuple(row) for row in rows)

    def F(self, P: Matrix, D: Matrix) -> Matrix:
        """−(AᵀP + PA) + KᵀK − D."""
        return total(times(-1, lyapunov(self.inside.nominal(), P)), outer(self.K, self.K), times(-1, D))

    @property
    def fixed_bound(self) -> Matrix | None:
        """D, where it is not free: the printed one, or with a g that is zero."""
        g1, g2 = self.printed or self.inside.bounds
        if self.printed is not None:
            return outer((g1, g2, Fraction(0), Fraction(0)), (g1, g2, Fraction(0), Fraction(0)))
        return None if g1 and g2 else diagonal((g1**2, g2**2, Fraction(0), Fraction(0)))

    def covers(self, D: Matrix) -> bool:
        """Whether h² ≤ xᵀDx for every |h| ≤ g1|x1| + g2|x2| (sound), or D is the printed one."""
        if self.fixed_bound is not None:
            return D == self.fixed_bound
        g1, g2 = self.inside.bounds
        return D[0][0] > 0 and D[1][1] > 0 and g1**2 / D[0][0] + g2**2 / D[1][1] <= 1


def moment_matrix(z: Sequence[Fraction]) -> Matrix:
    """Z of four moments, for which tr(Z(AᵀP + PA)) does not depend on the free entries of P."""
    z1, z2, z3, z4 = z
    o = Fraction(0)
    return (z1, o, o, -z3), (o, z2, -z1, o), (o, -z1, z3, o), (-z3, o, o, z4)


def refutes(question: TheoremProblem, z: Sequence[Fraction]) -> bool:
    """Whether moments prove that no P exists, exactly: Z ≥ 0, not 0, and tr(Z F) ≤ 0 for every admissible D."""
    z1, z2, z3, z4 = z
    if min(z) < 0 or not any(z) or z2 * z3 < z1**2 or z1 * z4 < z3**2:
        return False
    Z = moment_matrix(z)
    D = question.fixed_bound
    value = trace_of_product(Z, question.F(question.P((Fraction(0),) * 6), D or NOTHING))
    if D is not None:
        return value <= 0
    g1, g2 = question.inside.bounds
    root = end_of(ball(z1 * z2).sqrt().lower())
    least = g1**2 * z1 + g2**2 * z2 + 2 * g1 * g2 * max(root, Fraction(0))
    return value - least <= 0  # min of a1z1 + a2z2 over the admissible D is (g1√z1 + g2√z2)²


# ----------------------------------------------------------------------
# Proposals for inverse optimality: P by spectral factorisation, refuting signals by a grid; decided elsewhere.
#
# With X = ω² the question is whether a cubic π(X), the return difference |1 + L|² − 1 times |den|² less what D and Q0
# ask for, is positive for X ≥ 0. If it is, π(−z²) − ε(…) = ℓ(z)ℓ(−z) with ℓ stable, and P is what makes
# F(P) = LᵀL + εE, L the coefficients of ℓ, E a diagonal, hence positive definite
# (Anderson 1967, SIAM J. Control 5, 171).

_DIGITS = 80
_GRID = (-8, 8, 3201)


def propose(question: TheoremProblem) -> tuple[list[Fraction], Fraction] | None:
    """Six free entries of P and the split of D with about the largest margin; None without a positive margin."""
    split = _best_split(question)
    start = question.F(question.P((Fraction(0),) * 6), bound_of(question, split))
    sizes = [max(abs(v), Fraction(1, 10**40)) for v in _moments(start)]
    share = _margin(question, split, sizes)
    if share <= 0:
        return None
    extra = diagonal([Fraction(share / 2) * v for v in sizes])
    factor = _factor(_moments(total(start, tuple(tuple(-v for v in row) for row in extra))))
    if factor is None:
        return None
    return _entries(start, factor, extra), split


def bound_of(question: TheoremProblem, split: Fraction) -> Matrix:
    """D: the fixed one, or diag(g1²/w, g2²/(1−w), 0, 0)."""
    if question.fixed_bound is not None:
        return question.fixed_bound
    g1, g2 = question.inside.bounds
    return diagonal((g1**2 / split, g2**2 / (1 - split), Fraction(0), Fraction(0)))


def _moments(F: Matrix) -> tuple[Fraction, ...]:
    """Coefficients of z1 = X², z2 = X³, z3 = X, z4 = 1 in tr(Z F), whatever the free entries of P."""
    return F[0][0] - 2 * F[1][2], F[1][1], F[2][2] - 2 * F[0][3], F[3][3]


def _signals() -> tuple[Any, Any]:
    """X and the four moments of single frequencies (4 × n)."""
    X = np.logspace(*_GRID)
    return X, np.array([X**2, X**3, X, np.ones_like(X)])


def _margin(question: TheoremProblem, split: Fraction, sizes: Sequence[Fraction]) -> float:
    """Least of π(X) over Σ sizes·(X², X³, X, 1), on a grid and at both ends."""
    _, z = _signals()
    moments = _moments(question.F(question.P((Fraction(0),) * 6), bound_of(question, split)))
    inner = np.array([float(v) for v in moments]) @ z / (np.array([float(v) for v in sizes]) @ z)
    return min(float(inner.min()), *(float(moments[n] / sizes[n]) for n in (1, 3)))


def _best_split(question: TheoremProblem) -> Fraction:
    """Split with the largest margin; the margin is concave in it."""
    if question.fixed_bound is not None:
        return Fraction(1, 2)

    sizes = [max(k * k, Fraction(1, 10**40)) for k in question.K]

    def split(logit: float) -> Fraction:
        return Fraction(round(2**40 / (1 + math.exp(-logit))), 2**40)

    best = minimize_scalar(
        lambda v: -_margin(question, split(v), sizes), bounds=(-20, 20), method="bounded", options={"xatol": 1e-7}
    )
    return split(float(best.x))


def _factor(moments: Sequence[Fraction]) -> list[Fraction] | None:
    """L = (l2, l3, l1, l0) with π(−z²) = ℓ(z)ℓ(−z), ℓ = l3z³ + l2z² + l1z + l0 stable; None without such a factor."""
    with mpmath.workdps(_DIGITS):
        square, cube, line, constant = (mpmath.mpf(v.numerator) / v.denominator for v in moments)
        if cube <= 0 or constant <= 0:
            return None
        try:
            roots = mpmath.polyroots([cube, square, line, constant], maxsteps=500, extraprec=300)
        except mpmath.NoConvergence:
            return None
        stable = [-mpmath.sqrt(-X) for X in roots]
        polynomial = [mpmath.sqrt(cube)]
        for root in stable:
            longer = [*polynomial, mpmath.mpc(0)]
            polynomial = [c - (root * polynomial[n - 1] if n else 0) for n, c in enumerate(longer)]
        l3, l2, l1, l0 = (_exactly(mpmath.re(c)) for c in polynomial)
    return [l2, l3, l1, l0]


def _exactly(value: Any) -> Fraction:
    """Rational value of an mpmath number."""
    sign, mantissa, exponent, _ = value._mpf_
    return (-1 if sign else 1) * Fraction(int(mantissa)) * Fraction(2) ** int(exponent)


def _entries(start: Matrix, L: Sequence[Fraction], extra: Matrix) -> list[Fraction]:
    """Free entries of P that make F(P) = LᵀL + extra, in the order of `FREE`."""
    left = [[s - a * b - e for s, b, e in zip(r, L, x, strict=True)] for a, r, x in zip(L, start, extra, strict=True)]
    p13, p34 = left[0][0] / 2, left[2][2] / 2
    p14 = left[1][3]
    return [left[0][1], p13, p14, left[0][2] - p14, p34, left[2][3]]


def near(value: float | Fraction, bits: int) -> Fraction:
    """Nearest number with a given number of binary digits; 0 if not finite."""
    if not math.isfinite(value) or value == 0:
        return Fraction(0)
    unit = Fraction(2) ** (math.floor(math.log2(abs(float(value)))) - bits)
    return round(Fraction(value) / unit) * unit


def candidates(question: TheoremProblem) -> Iterator[tuple[Fraction, ...]]:
    """Moments of single frequencies, then of two, most promising first."""
    start = question.F(question.P((Fraction(0),) * 6), question.fixed_bound or NOTHING)
    slopes = np.array([float(v) for v in _moments(start)])
    g = [0.0, 0.0] if question.fixed_bound is not None else [float(v) for v in question.inside.bounds]
    X, z = _signals()
    z = z / (np.abs(slopes)[:, None] * z).sum(axis=0)
    value = slopes @ z - (g[0] * np.sqrt(z[0]) + g[1] * np.sqrt(z[1])) ** 2
    yield from (
        (Fraction(0), Fraction(1), Fraction(0), Fraction(0)),
        (Fraction(0), Fraction(0), Fraction(0), Fraction(1)),
    )
    best = int(np.argmin(value))
    yield _frequency(X[best])
    if question.fixed_bound is None and g[0] and g[1]:
        yield from _pairs(slopes, g, X, z)


def _frequency(square: float, weight: Fraction = Fraction(1)) -> tuple[Fraction, ...]:
    X = near(float(square), 20)
    return tuple(weight * X**n for n in (2, 3, 1, 0))


def _pairs(slopes: Any, g: Sequence[float], X: Any, z: Any) -> Iterator[tuple[Fraction, ...]]:
    """Two frequencies whose admissible splits do not overlap: slower ones need more for slip, faster ones for rate."""
    coarse = slice(None, None, 20)
    X, z = X[coarse], z[:, coarse]
    best: tuple[float, int, int, float] = (np.inf, 0, 0, 0.0)
    linear, first, second = slopes @ z, z[0], z[1]
    for share in np.linspace(0.02, 0.98, 49).tolist():
        mixed = share * linear[:, None] + (1 - share) * linear[None, :]
        one = share * first[:, None] + (1 - share) * first[None, :]
        two = share * second[:, None] + (1 - share) * second[None, :]
        value = mixed - (g[0] * np.sqrt(one) + g[1] * np.sqrt(two)) ** 2
        first_place, second_place = divmod(int(np.argmin(value)), value.shape[1])
        best = min(best, (float(value.min()), first_place, second_place, float(share)))
    _, i, j, share = best
    pair = [_frequency(X[n], near(float(part * z[3, n]), 20)) for n, part in ((i, share), (j, 1 - share))]
    yield tuple(a + b for a, b in zip(*pair, strict=True))


# ----------------------------------------------------------------------
# Whether a given K is optimal for a Q that covers the uncertainty: decided exactly, either way.
#
# K is optimal for some Q ≥ Q0 + R·D if and only if a P exists with PB = R·Kᵀ and
#
#     F(P) = −(AᵀP + PA) + R·KᵀK − R·D − Q0 ≥ 0,
#
# and the loop A − BK is stable; P is then the solution of the Riccati equation with Q = F(P) + R·D + Q0 (Kalman 1964,
# J. Basic Eng. 86, 51). Dividing by R leaves one question about K. In the nondimensional states B = (0, 1, 0, 0)ᵀ
# fixes
# the second column of P and leaves six entries free. D = diag(a1, a2, 0, 0) with g1²/a1 + g2²/a2 ≤ 1 for the sound
# bound of ERRATA 7, D = GᵀG for the printed one.
#
# The other way round: a matrix Z ≥ 0 for which tr(Z F(P)) does not depend on P has the pattern of the four moments
# ∫|x1|²ω^{2n}, n = −2 … 1, of a signal (x1, jωx1, x1/jω, −x1/ω²). If tr(Z F) ≤ 0 for all admissible D, no P exists.
# Such a Z is a combination of frequencies at which the return difference is too small.

_BITS = (30, 60, 120, 200)


@dataclass(frozen=True, slots=True, kw_only=True)
class InverseOptimality:
    """Verdict on a K with its proof, in nondimensional states and pressure.

    Attributes
    ----------
    verdict : Verdict
        PROVED: K is optimal for a Q ≥ Q0 + R·D; REFUTED: for none; UNDECIDED: too close to tell.
    P : Matrix or None
        Solution of the Riccati equation that has K, for R = 1.
    bound : Matrix or None
        D for which it holds.
    Q0 : Matrix or None
        What is left of Q, positive definite.
    moments : tuple of Fraction or None
        z1, z2, z3, z4 of the refuting Z = [[z1, ., ., −z3], [., z2, −z1, .], [., −z1, z3, .], [−z3, ., ., z4]].
    scales : ProblemScales
    reason : str
    """

    verdict: Verdict
    P: Matrix | None = None
    bound: Matrix | None = None
    Q0: Matrix | None = None
    moments: tuple[Fraction, ...] | None = None
    scales: ProblemScales
    reason: str = ""

    @property
    def frequency(self) -> float | None:
        """Mean angular frequency [rad/s] of the refuting signal, √(z2/z1)."""
        if not self.moments or not self.moments[0]:
            return None
        return float(float(self.moments[1] / self.moments[0]) ** 0.5) / float(self.scales.time)

    def to_dict(self) -> dict[str, Any]:
        """Plain values; matrices as texts p/q."""
        return {
            "verdict": str(self.verdict),
            "reason": self.reason,
            "P": [[exact_text(v) for v in row] for row in self.P] if self.P else None,
            "frequency": self.frequency,
        }


def inverse_optimality(
    problem: LinearProblem,
    gains: Sequence[Fraction],
    *,
    printed: Sequence[Fraction] | None = None,
) -> InverseOptimality:
    """Decide whether K is optimal for a Q that covers the uncertainty.

    Parameters
    ----------
    problem : LinearProblem
        In SI.
    gains : sequence of 4 Fraction
        K in SI, exact.
    printed : (Fraction, Fraction), optional
        Row G [Pa/m, Pa·s/m] of the printed test, D = GᵀG; without it the sound bound of the problem.

    Returns
    -------
    InverseOptimality
    """
    scales = problem.scales()
    inside = problem.nondimensional(scales)
    K = scales.gains_inside(gains)
    row = None if printed is None else (printed[0] * scales.slip / scales.pressure,
                                        printed[1] * scales.states[1] / scales.pressure)  # fmt: skip
    question = TheoremProblem(inside, K, row)
    loop = inside.loop((Fraction(1), -inside.stiffness, inside.damping), K)
    if not hurwitz(characteristic(loop)):
        reason = "the nominal loop is not asymptotically stable (Routh, exact)"
        return InverseOptimality(verdict=Verdict.REFUTED, scales=scales, reason=reason)
    return _proof(question, scales) or _refutation(question, scales) or InverseOptimality(
        verdict=Verdict.UNDECIDED, scales=scales, reason="neither a P nor a refuting signal was found"
    )  # fmt: skip


def _proof(question: TheoremProblem, scales: ProblemScales) -> InverseOptimality | None:
    proposal = propose(question)
    if proposal is None:
        return None
    entries, split = proposal
    for bits in _BITS:
        P = question.P([near(v, bits) for v in entries])
        D = bound_of(question, split)
        left = question.F(P, D)
        if question.covers(D) and definite(left) and definite(P):
            return InverseOptimality(
                verdict=Verdict.PROVED, P=P, bound=D, Q0=left, scales=scales,
                reason="P, Q0 positive definite, exactly",
            )  # fmt: skip
    return None


def _refutation(question: TheoremProblem, scales: ProblemScales) -> InverseOptimality | None:
    for z in candidates(question):
        if refutes(question, z):
            return InverseOptimality(
                verdict=Verdict.REFUTED, moments=z, scales=scales,
                reason="a signal at which the return difference does not cover the bound, exactly",
            )  # fmt: skip
    return None


# ----------------------------------------------------------------------
# The premise of Theorem 2 as printed and as it must be, side by side.
#
# The printed test asks whether K is optimal for a Q ≥ Q0 + R·GᵀG with the printed row G, the sound one whether it is
# for
# a Q ≥ Q0 + R·W (ERRATA 6, 7). Neither looks at a pole: a K that the printed test accepts may leave an unstable plant
# in
# the box.

Range = tuple[Fraction, Fraction]


@dataclass(frozen=True, slots=True, kw_only=True)
class BothTests:
    """Results of the printed and the sound test for one K.

    Attributes
    ----------
    printed, sound : InverseOptimality
    unstable_at : (Fraction, Fraction, Fraction) or None
        A vertex (β, s [1/s²], w [1/s]) of the box at which the loop is not asymptotically stable, exactly (Routh).
    growth : Fraction or None
        Rigorous lower bound on the factor by which a switched plant of the box grows a period; above 1 a refutation.
    """

    printed: InverseOptimality
    sound: InverseOptimality
    unstable_at: Vertex | None
    growth: Fraction | None = None

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "printed": self.printed.to_dict(),
            "sound": self.sound.to_dict(),
            "unstable_at": [float(v) for v in self.unstable_at] if self.unstable_at else None,
            "growth": float(self.growth) if self.growth else None,
        }

    def table(self) -> str:
        """Markdown table of both tests and of what the plant does."""
        fate = "stable at every constant vertex"
        if self.unstable_at:
            fate = "unstable at β = {:.4g}, s = {:.4g}, w = {:.4g}".format(*map(float, self.unstable_at))
        elif self.growth and self.growth > 1:
            fate += f", but a switched plant grows {float(self.growth):.4g}-fold a period"
        return (
            "| test | verdict |\n|---|---|\n"
            f"| printed, Q ≥ Q0 + R·GᵀG | {self.printed.verdict} |\n"
            f"| sound, Q ≥ Q0 + R·W | {self.sound.verdict} |\n"
            f"| the loop itself | {fate} |\n"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Switching:
    """A periodic plant of a box: vertices and how long each lasts [s]."""

    vertices: tuple[Vertex, ...]
    durations: tuple[Fraction, ...]


def printed_row(fault: Fault) -> Range:
    """G of eq. lipschitz2 as printed: μ_x1σ'ΔN̂ in place of μ_x1(σ'N̂)_max, no friction in the second entry."""
    ranges, values = plant_ranges(fault), plant.plant_values(fault)

    def spread(symbol: Any) -> Fraction:
        nominal = fraction_of(values[symbol])
        return max(ranges[symbol][1] - nominal, nominal - ranges[symbol][0])

    weakening, stress = friction_bounds(fault.friction).slip_slope, ranges[plant.sigma][1]
    b, growth = least_authority(fault), fault.disturbance
    first = spread(plant.k_hat) + weakening * stress * spread(plant.N_hat) + abs(rational(growth.slip_growth))
    return first / b, (spread(plant.eta_hat) + abs(rational(growth.rate_growth))) / b


def both_tests(
    problem: LinearProblem, gains: Sequence[Fraction], printed: Range, switching: Switching | None = None
) -> BothTests:
    """Judge one K by the printed and by the sound test, and look at the loop itself.

    Parameters
    ----------
    problem : LinearProblem
    gains : sequence of 4 Fraction
        K, in the units of the problem.
    printed : (Fraction, Fraction)
        G as printed, see `printed_row`.
    switching : Switching, optional
        A plant of the box that changes in time.
    """
    return BothTests(
        printed=inverse_optimality(problem, gains, printed=printed),
        sound=inverse_optimality(problem, gains),
        unstable_at=FeedbackLoop(gains=gains, sectors=problem.sectors).unstable_vertex(),
        growth=switched_growth(problem, gains, switching) if switching else None,
    )


def switched_growth(problem: LinearProblem, gains: Sequence[Fraction], switching: Switching) -> Fraction:
    """Rigorous lower bound on the spectral radius of one period, in ball arithmetic.

    |trace Mⁿ| ≤ 4ϱⁿ bounds the spectral radius ϱ of the 4 × 4 period M from below.
    """
    period = identity(4)
    for vertex, duration in zip(switching.vertices, switching.durations, strict=True):
        loop = loop_matrix(vertex, problem.sectors.authority, gains)
        period = (matrix(loop) * ball(duration)).exp() * period
    power, best, n = period, Fraction(0), 1
    for _ in range(7):
        power, n = power * power, 2 * n
        best = max(best, end_of(((abs(power.trace()) / 4) ** (arb(1) / n)).lower()))
    return best


# ----------------------------------------------------------------------
# Feedback of the state as printed against feedback of the error (ERRATA 28, 29): one loop, two ways to a reference.
#
# About a constant reference both are one loop. With s, w the chords of slip and slip rate and β the control
# coefficient,
# a moving reference leaves Δ(z)·e1 = −N(z)·r, Δ(z) = z⁴ + (w + βb k2)z³ + (βb k1 − s)z² + βb k3 z + βb k4 and
#
#     error feedback: N = z²(z² + wz − s),      state feedback: N = z²(z² + (w + βb k2)z + βb k1 − s),
#
# so that the error behind a slow reference is r̈ times −s/(βb k4), or (βb k1 − s)/(βb k4).


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedbackComparison:
    """What one kind of feedback costs on the task of a fault.

    Attributes
    ----------
    feedback : str
        ``"error"`` or ``"state"``.
    lag : float
        Largest |e1| [m] behind the reference by its acceleration alone, over the vertices of the box; the curvature of
        p*(r) comes on top of it for both (ERRATA 28).
    largest_term : float
        Largest of the terms of Kx [Pa] at rest at the target slip.
    pressure : float
        Largest |p*| [Pa] that they add up to.
    """

    feedback: str
    lag: float
    largest_term: float
    pressure: float


def compare_feedback(fault: Fault, gains: Sequence[Fraction]) -> tuple[FeedbackComparison, ...]:
    """Both kinds of feedback with one K on the task of a fault.

    Parameters
    ----------
    fault : Fault
    gains : sequence of 4 Fraction
        K in SI, k4 not 0.
    """
    problem, target = LinearProblem.of(fault), rational(fault.reference.target_slip)
    rest = max(abs(float(p)) for p in rest_pressure(fault, (Fraction(0), target), nominal=True, pieces=200))
    bend = largest_reference_acceleration(fault)
    comparisons = []
    for feedback in FEEDBACKS:
        offset = float(gains[0]) * float(target) if feedback == "state" else 0.0
        lag = max(abs(lag_coefficient(problem, gains, vertex, feedback)) for vertex in problem.vertices()) * bend
        comparisons.append(
            FeedbackComparison(
                feedback=feedback,
                lag=lag,
                largest_term=rest + abs(offset),
                pressure=rest,
            )
        )
    return tuple(comparisons)


def lag_coefficient(problem: LinearProblem, gains: Sequence[Fraction], vertex: Vertex, feedback: str) -> float:
    """−e1/r̈ [s²] behind a slow reference at a vertex (β, s, w)."""
    beta, s, _ = vertex
    push = beta * problem.sectors.authority
    stiff = -s + (push * gains[0] if feedback == "state" else 0)
    return float(stiff / (push * gains[3]))


def largest_reference_acceleration(fault: Fault) -> float:
    """Rigorous to rounding: max |r̈| [m/s²] of the reference, from the zeros of its third derivative."""
    stage = sp.Symbol("s", nonnegative=True)
    shape = fault.reference.shape(stage)
    bend, turns = sp.diff(shape, stage, 2), sp.solve(sp.diff(shape, stage, 3), stage)
    ends = [*(root for root in turns if root.is_real and 0 <= root <= 1), sp.Integer(0), sp.Integer(1)]
    peak = max(abs(float(bend.subs(stage, end))) for end in ends)
    return peak * fault.reference.target_slip / fault.reference.operation_time**2
