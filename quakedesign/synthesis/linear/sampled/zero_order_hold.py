"""The loop with p held over a sampling period T: its characteristic polynomial without cancellation, in any arithmetic.

In the states x1, T·x2, ξ1/T, ξ2/T² and with z = 1 + d the hold needs four numbers of the plant x1'' = s·x1 − w·x1' + u:
its impulse response g after one period and the iterated integrals Γ = ∫g, Θ = ∫Γ, Ψ = ∫Θ, time in T. Then

    p(d) = d⁴ + Tγ3 d³ + T²γ2 d² + T³γ1 d + T⁴γ0

with γ_i that tend to the coefficients of the continuous loop as T → 0. It is stable if and only if p(2v/(1 − v)), in
units of T for v the quartic of `conditions`, is Hurwitz: the Schur–Cohn condition (Jury 1964, Theory and Application
of the z-Transform Method, ch. 3) for d in place of z, without the digits that z = 1 + d loses when T is short.
"""

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from flint import arb, arb_mat
from scipy.linalg import expm

from quakedesign.certificates.guarantee.ball_matrices import ball
from quakedesign.errors import require_known

INTEGRATIONS = ("exact", "euler")


def interval(low: Fraction, high: Fraction) -> Any:
    """Ball that contains an interval."""
    return ball(low).union(ball(high)) if low != high else ball(low)


def response(sigma: Any, omega: Any) -> tuple[Any, Any, Any, Any]:
    """Impulse response g of g'' = σg − ωg' after a unit of time, and its three iterated integrals (balls)."""
    o, one = arb(0), arb(1)
    chain = [[-omega, sigma, o, o, o]] + [[one if j == i else o for j in range(5)] for i in range(4)]
    column = arb_mat(chain).exp().tolist()
    return column[1][0], column[2][0], column[3][0], column[4][0]


def require_integration(integration: str) -> None:
    """Refuse an unknown way to integrate ξ.

    Raises
    ------
    ParameterError
    """
    require_known(integration, INTEGRATIONS, "integration")


def coefficients(T: Any, beta: Any, s: Any, w: Any, push: Sequence[Any], integration: str = "exact") -> tuple[Any, ...]:
    """γ0, γ1, γ2, γ3 of the held loop (balls).

    Parameters
    ----------
    T, beta, s, w : arb
        Period, control coefficient, chords of slip and slip rate.
    push : sequence of 4 arb
        b·K.
    integration : str
        ``"exact"``: ξ' = (x1, ξ1) holds at all times; ``"euler"``: ξ⁺ = ξ + T(x1, ξ1) of the samples.
    """
    sigma, omega = s * T * T, w * T
    g, G, H, J = response(sigma, omega)
    k1, k2, k3, k4 = (beta * k for k in push)
    slope = w * g - 2 * s * T * G  # (2 − trace of the plant's period)/T
    n10 = (omega * g - sigma * G) * G + g * g
    if integration == "euler":
        return k4 * n10, k3 * n10 + k4 * T * G, (k1 - s) * n10 + k3 * T * G, slope + k1 * T * G + k2 * g
    n31 = (g + omega * G) * G + G * g + H * slope * T
    n42 = H + (G + omega * H) * G + H * g + J * slope * T
    return (
        k4 * n10,
        k3 * n10 + k4 * T * (n31 + n10 / 2),
        (k1 - s) * n10 + k3 * T * n31 + k4 * T * T * n42,
        slope + k1 * T * G + k2 * g + k3 * T * T * H + k4 * T**3 * J,
    )


def conditions(T: Any, gamma: Sequence[Any]) -> tuple[Any, ...]:
    """Numbers that are all positive if and only if the held loop is asymptotically stable."""
    g0, g1, g2, g3 = gamma
    h0, h1 = g0, 2 * g1 - 4 * T * g0
    h2 = 4 * g2 - 6 * T * g1 + 6 * T * T * g0
    h3 = 8 * g3 - 8 * T * g2 + 6 * T * T * g1 - 4 * T**3 * g0
    h4 = 16 - 8 * T * g3 + 4 * T * T * g2 - 2 * T**3 * g1 + T**4 * g0
    return h0, h1, h2, h3, h4, h1 * (h3 * h2 - h4 * h1) - h3 * h3 * h0


def held_matrix(step: float, beta: float, s: float, w: float, push: Sequence[float], integration: str = "exact") -> Any:
    """Matrix (4 × 4) of one period in x1, x2, ξ1, ξ2, in floating point, for display and design.

    Parameters
    ----------
    push : sequence of 4 float
        b·K.
    """
    F, G = held_plant(step, s, w, integration)
    return F - beta * np.outer(G, push)


def held_plant(step: float, s: float, w: float, integration: str = "exact") -> tuple[Any, Any]:
    """F (4 × 4) and G (4) of x⁺ = Fx + G·u for an acceleration u held over a step [s]."""
    chain = np.zeros((5, 5))
    chain[0, 1], chain[1, :2], chain[1, 4], chain[2, 0], chain[3, 2] = 1, (s, -w), 1, 1, 1
    if integration == "euler":
        chain[2:4] = 0
    whole = expm(chain * step)
    if integration == "euler":
        whole[2, 0] = whole[3, 2] = step
    return whole[:4, :4], whole[:4, 4]
