"""Proposals for inverse optimality: P by spectral factorisation, refuting signals by a grid; decided elsewhere.

With X = ω² the question is whether a cubic π(X), the return difference |1 + L|² − 1 times |den|² less what D and Q0
ask for, is positive for X ≥ 0. If it is, π(−z²) − ε(…) = ℓ(z)ℓ(−z) with ℓ stable, and P is what makes
F(P) = LᵀL + εE, L the coefficients of ℓ, E a diagonal, hence positive definite
(Anderson 1967, SIAM J. Control 5, 171).
"""

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
from scipy.optimize import minimize_scalar

from quakedesign.synthesis.linear.analysis.inverse_optimality_problem import NOTHING, Question
from quakedesign.synthesis.linear.plant.rational_matrices import Matrix, diagonal, total

_DIGITS = 80
_GRID = (-8, 8, 3201)


def propose(question: Question) -> tuple[list[Fraction], Fraction] | None:
    """Six free entries of P and the split of D with about the largest margin; None where no margin is seen."""
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


def bound_of(question: Question, split: Fraction) -> Matrix:
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


def _margin(question: Question, split: Fraction, sizes: Sequence[Fraction]) -> float:
    """Least of π(X) over Σ sizes·(X², X³, X, 1), on a grid and at both ends."""
    _, z = _signals()
    moments = _moments(question.F(question.P((Fraction(0),) * 6), bound_of(question, split)))
    inner = np.array([float(v) for v in moments]) @ z / (np.array([float(v) for v in sizes]) @ z)
    return min(float(inner.min()), *(float(moments[n] / sizes[n]) for n in (1, 3)))


def _best_split(question: Question) -> Fraction:
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
    """Nearest number of a given count of binary digits; 0 for what is not finite."""
    if not math.isfinite(value) or value == 0:
        return Fraction(0)
    unit = Fraction(2) ** (math.floor(math.log2(abs(float(value)))) - bits)
    return round(Fraction(value) / unit) * unit


def candidates(question: Question) -> Iterator[tuple[Fraction, ...]]:
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
