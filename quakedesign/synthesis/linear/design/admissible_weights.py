"""For which Q and R the guarantee of the Riccati design holds, and the smallest gain among them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from quakedesign.errors import ParameterError
from quakedesign.synthesis.linear.design.nondimensional import sound_bound
from quakedesign.synthesis.linear.plant.problem import LinearProblem
from quakedesign.synthesis.linear.plant.rational_matrices import (
    Matrix,
    definite,
    inverse,
    product,
    times,
    total,
    transpose,
)

_SHARE = Fraction(999_999, 1_000_000)


@dataclass(frozen=True, slots=True, kw_only=True)
class RiccatiBounds:
    """The set of R for which K(Q, R) is guaranteed over the box, for one shape of Q: every 0 < R ≤ `weight`.

    Attributes
    ----------
    weight : Fraction
        Certified: Q − R·W is positive definite for it, exactly; within 1e-6 of the limit.
    split : Fraction
        w of the W for which it is.
    limit : float
        Where no W is left, 1/(g1²/d1 + g2²/d2) with the largest diagonal d below the part of Q on (x1, x2).
    """

    weight: Fraction
    split: Fraction
    limit: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SmallestGain:
    """Infimum of the gain over every Q0 > 0 and R > 0 of the guaranteed set; reached as Q0/R → 0, with k3, k4 → 0.

    Attributes
    ----------
    slip, rate : float
        k1 [Pa/m] and k2 [Pa·s/m] of the smallest gain in natural units, k1² + (ω_nk2)².
    split : float
        Its w.
    least_slip : float
        Infimum of k1 alone [Pa/m], for w → 1; k2 grows without bound there if g2 > 0.
    least_rate : float
        Infimum of k2 alone [Pa·s/m].
    """

    slip: float
    rate: float
    split: float
    least_slip: float
    least_rate: float


def guaranteed(problem: LinearProblem, Q: Sequence[Sequence[Fraction]], R: Fraction, split: Fraction) -> bool:
    """Whether Q ≥ Q0 + R·W for a positive definite Q0, exactly: then K(Q, R) is guaranteed over the whole box."""
    return R > 0 and definite(total(Q, times(-R, sound_bound(problem.bounds, split))))


def riccati_bounds(problem: LinearProblem, Q: Sequence[Sequence[Fraction]]) -> RiccatiBounds:
    """All R for which the guarantee holds with a given Q.

    Parameters
    ----------
    problem : LinearProblem
    Q : matrix (4 × 4) of Fraction
        Positive definite, in the units of the problem.

    Raises
    ------
    ParameterError
        When Q is not positive definite, or nothing is uncertain (every R will do).
    """
    if not definite(Q):
        raise ParameterError("Q must be positive definite. Received another matrix. Start from a positive diagonal.")
    g1, g2 = problem.bounds
    if not g1 and not g2:
        raise ParameterError(
            "every R holds where nothing is uncertain. Bounds g1, g2 that are not both 0 are expected."
        )
    limit, share = _largest_weight(_slip_part(Q), g1, g2)
    split = share if g1 and g2 else Fraction(1, 2)
    return RiccatiBounds(weight=limit * _SHARE, split=split, limit=float(limit))


def riccati_inequality(problem: LinearProblem, Q: Sequence[Sequence[Fraction]]) -> Any:
    """The matrix inequality whose closed form is `riccati_bounds`, as a cvxpy problem to solve or to extend.

    Its value is the largest R with Q ≥ R·W for some split w. With s1 = R/w and s2 = R/(1 − w) both conditions are
    linear: Q ≥ diag(g1²s1, g2²s2, 0, 0), and diag(s1, s2) ≥ R·11ᵀ, which is R ≤ 1/(1/s1 + 1/s2).

    Parameters
    ----------
    problem : LinearProblem
    Q : matrix (4 × 4) of Fraction
        In the units of the problem.

    Returns
    -------
    cvxpy.Problem
        In the variables `weight` (R) and `parts` (s1, s2).
    """
    import cvxpy as cp
    import numpy as np

    weight, parts = cp.Variable(name="weight"), cp.Variable(2, name="parts")
    bounds = np.vstack([np.diag([float(g) ** 2 for g in problem.bounds]), np.zeros((2, 2))])
    room = np.array([[float(v) for v in row] for row in Q]) - cp.diag(bounds @ parts)
    return cp.Problem(cp.Maximize(weight), [room >> 0, cp.diag(parts) - weight * np.ones((2, 2)) >> 0])


def _slip_part(Q: Sequence[Sequence[Fraction]]) -> Matrix:
    """Schur complement of Q on (x1, x2): what is left of it for the best ξ."""
    corner, lower = [row[:2] for row in Q[:2]], [row[2:] for row in Q[2:]]
    side = [row[2:] for row in Q[:2]]
    return total(corner, times(-1, product(side, inverse(lower), transpose(side))))


def _largest_weight(part: Matrix, g1: Fraction, g2: Fraction) -> tuple[Fraction, Fraction]:
    """1/(g1²/d1 + g2²/d2), as large as [[a, c], [c, b]] ≥ diag(d1, d2) allows, and the share of the first part.

    On the edge (a − d1)(b − d2) = c² the sum is least where g1(b − d2)/d2 = g2|c|/d1, and alike for the other.
    """
    (a, c), (_, b) = part
    first, second, both = g1**2 * b, g2**2 * a, g1 * g2 * abs(c)
    whole = first + second + 2 * both
    return (a * b - c * c) / whole, (first + both) / whole


def limiting_gains(problem: LinearProblem, split: float) -> tuple[float, float]:
    """k1 [Pa/m] and k2 [Pa·s/m] as Q0/R → 0: the Riccati equation of the plant alone with Q = R·W, in closed form.

    b·k1 = −k̂ + √(k̂² + b²w1), b·k2 = −η̂ + √(η̂² + b²w2 + 2b·k1), w1 and w2 the entries of W.
    """
    k, eta, b = float(problem.stiffness), float(problem.damping), float(problem.sectors.authority)
    W = sound_bound(problem.bounds, Fraction(split))
    first = -k + math.sqrt(k**2 + b**2 * float(W[0][0]))
    second = -eta + math.sqrt(eta**2 + b**2 * float(W[1][1]) + 2 * first)
    return first / b, second / b


def smallest_gain(problem: LinearProblem) -> SmallestGain:
    """Infimum of the gain over the guaranteed set.

    Parameters
    ----------
    problem : LinearProblem
        In SI.
    """
    from scipy.optimize import minimize_scalar

    g1, g2 = problem.bounds
    pace = math.sqrt(abs(float(problem.stiffness))) or 1.0

    def size(split: float) -> float:
        k1, k2 = limiting_gains(problem, split)
        return math.hypot(k1, pace * k2)

    split = 0.5
    if g1 and g2:
        split = float(minimize_scalar(size, bounds=(1e-6, 1 - 1e-6), method="bounded", options={"xatol": 1e-9}).x)
    k1, k2 = limiting_gains(problem, split)
    ends: list[Any] = [limiting_gains(problem, w) for w in ((1 - 1e-12, 1e-12) if g1 and g2 else (0.5, 0.5))]
    return SmallestGain(slip=k1, rate=k2, split=split, least_slip=ends[0][0], least_rate=_least_rate(problem, ends))


def _least_rate(problem: LinearProblem, ends: Sequence[tuple[float, float]]) -> float:
    from scipy.optimize import minimize_scalar

    if not all(problem.bounds):
        return ends[0][1]
    found = minimize_scalar(lambda w: limiting_gains(problem, w)[1], bounds=(1e-9, 1 - 1e-9), method="bounded")
    return float(found.fun)
