"""One sample of the filtering differentiator, discretised in three ways.

With y = (w_1 … w_nf, z_0 … z_nd), N = n_d + n_f + 1 entries, and a slip x the differentiator is, in continuous time,

    y_j' = −λ̃_(N−j) λ_d^(j/N) ⌈s⌋^((N−j)/N) + y_(j+1) − [j = n_f]·x,    y_(N+1) = 0,

where s is y_1, or z_0 − x without a filter (n_f = 0); its estimates are z_0 … z_nd.

- ``euler``: forward Euler.
- ``homogeneous``: forward Euler with the further Taylor terms T²/2·z_(i+2) + … of every z_i; without them z_i settles
  at x^(i) + T/2·x^(i+1), 0 < i < n_d, which is off by the order of T whatever n_d. Livne and Levant (2014), Automatica
  50, 2040; Levant and Livne (2020), European Journal of Control 55, 33.
- ``implicit``: backward Euler with the latest reading. All y_j⁺ follow from s⁺, and for s⁺ they leave
  s⁺ + Σ_j T^j λ̃_(N−j) λ_d^(j/N) ⌈s⁺⌋^((N−j)/N) ∋ b with a known b. The left-hand side rises, so the solution is
  unique and has the sign of b. With |s⁺| = λ_d·(qT)^N it is the root q ≥ 0 of the polynomial
  q^N + Σ_j λ̃_(N−j) q^(N−j) = |b|/(λ_d·T^N) if the right-hand side exceeds λ̃_0, and s⁺ = 0 otherwise. The polynomial is
  convex and rises for q > 0, so that Newton's method falls monotonically from any bound above the root. Mojallizadeh,
  Brogliato and Acary (2021), Int. J. Robust Nonlinear Control 31, 7679.

In the implicit sliding mode z_i = ∇^i x/T^i, which lags: the i-th derivative is (−ln(1 − ∇))^i x/T^i, and the terms of
that up to ∇^nd x are a combination of z_i … z_nd. `lag_free` has its coefficients i!/j!·|S1(j, i)|; with them the
estimates have the accuracy T^(nd+1−i) of the continuous differentiator. For n_f = 0 this is the proper implicit
discretisation of Seeber (2024), arXiv:2404.02770.
"""

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import casadi as ca

NEWTON_STEPS = 8


def explicit_step(
    gains: Sequence[Any], step: Any, state: Sequence[Any], slip: Any, filters: int, taylor: bool
) -> list[Any]:
    """y after one sample (SX); the gains are T·λ̃_(N−j)·λ_d^(j/N), j = 1 … N."""
    size = len(state)
    distance = state[0] if filters else state[0] - slip
    root = _root(ca.fabs(distance), size)
    after = []
    for j, (value, gain) in enumerate(zip(state, gains, strict=True), start=1):
        drift = state[j] if j < size else ca.SX(0)
        drift = drift - slip if j == filters else drift
        moved = value + step * drift - gain * ca.sign(distance) * _whole_power(root, size - j)
        after.append(moved + _taylor(step, state[j + 1 :]) if taylor and j > filters else moved)
    return after


def implicit_step(
    gains: Sequence[Any], scale: Any, table: Sequence[float], step: Any, state: Sequence[Any], slip: Any, filters: int
) -> list[Any]:
    """y after one sample (SX); the gains are λ̃_(N−j)·λ_d·T^(N−j+1), j = 1 … N, and the scale is λ_d·T^N."""
    size = len(state)
    ahead = state[-1]
    for value in reversed(state[:-1]):
        ahead = value + step * ahead
    ahead = (ahead - _whole_power(step, filters) * slip) / scale
    root, share = _solve(ca.fabs(ahead), table)
    push = [_whole_power(root, size - j) for j in range(1, size)] + [share]
    after: list[Any] = []
    following = ca.SX(0)
    for j in range(size, 0, -1):
        drift = following - slip if j == filters else following
        following = state[j - 1] + step * drift - gains[j - 1] * ca.sign(ahead) * push[j - 1]
        after.insert(0, following)
    return after


def lag_free(order: int) -> tuple[tuple[Fraction, ...], ...]:
    """Row i has the coefficients of T^(j−i)·z_j, j = i … order, in the estimate of derivative i."""
    rows = []
    for i in range(order + 1):
        shares = (Fraction(math.factorial(i) * _stirling(j, i), math.factorial(j)) for j in range(i, order + 1))
        rows.append(tuple(shares))
    return tuple(rows)


def _solve(target: Any, table: Sequence[float]) -> tuple[Any, Any]:
    """q of the polynomial, and the selection of |⌈s⁺⌋⁰| from [0, 1]."""
    size, (jump, *rest) = len(table), table
    excess = ca.fmax(target - jump, 0)
    rising = [*rest, 1.0]  # of q, q² … q^N
    root = _root(excess, size)
    for power, weight in enumerate(rest, start=1):
        root = ca.fmin(root, _root(excess / weight, power))
    for _ in range(NEWTON_STEPS):
        value, slope = ca.SX(rising[-1]), ca.SX(0)
        for weight in reversed(rising[:-1]):
            slope = slope * root + value
            value = value * root + weight
        slope = slope * root + value
        root = root - (value * root - excess) / slope
    return root, ca.fmin(target / jump, 1)


def _root(value: Any, degree: int) -> Any:
    """Root of a number that is not negative; square roots are correctly rounded."""
    return value if degree == 1 else ca.sqrt(value) if degree == 2 else value ** (1.0 / degree)


def _whole_power(value: Any, exponent: int) -> Any:
    product: Any = 1.0
    for _ in range(exponent):
        product = product * value
    return product


def _taylor(step: Any, later: Sequence[Any]) -> Any:
    """T²/2·z_(i+2) + T³/6·z_(i+3) + …."""
    total: Any = 0.0
    for degree in range(len(later) + 1, 1, -1):
        total = (total + later[degree - 2]) * step / degree
    return total * step


def _stirling(j: int, i: int) -> int:
    """Unsigned Stirling number of the first kind."""
    row = [1]
    for k in range(j):
        row = [(row[m - 1] if m else 0) + k * (row[m] if m < len(row) else 0) for m in range(len(row) + 1)]
    return row[i] if i < len(row) else 0
