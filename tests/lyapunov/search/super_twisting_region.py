"""The exact gains for which super-twisting rejects |d| ≤ L, in closed form, and runs against the worst disturbance.

s' = β(−k1⌈s⌋^½ + ξ), ξ' = −k2⌈s⌋⁰ + d. With s = z², dt = 2z dτ/β and z ≥ 0 every half turn is linear: z' = −k1z + ξ,
ξ' = −2z(k2 − d)/β, and (k2 − d)/β stays within [(k2 − L)/b_M, (k2 + L)/b_m] = [c, C]/2. The slope q = ξ/z obeys
q' = −(q² − k1q + 2(k2 − d)/β), so that the outermost course has c while z grows (q > k1) and C while it shrinks. There
ξ² − k1ξz + cz² decays at the rate k1 in τ, and τ is an arcus tangent of q: a half turn takes ξ from 1 to −ρ with
ρ² = (C/c)·exp(−k1(I(c) + J(C))), and the loop is stable exactly when ρ < 1. If k1² ≥ 4C the slow eigenvector
of the shrinking phase stops the turn: ρ = 0. Known from Seeber and Horn (2018), Necessary and sufficient stability
criterion for the super-twisting algorithm, VSS 2018; derived here anew and for an uncertain β as well.
"""

import math

import numpy as np


def contraction(k1, k2, L, low=1.0, high=1.0):
    """Worst ratio ρ of successive |ξ| at s = 0; infinite where the integral can be held."""
    if k1 <= 0 or k2 <= L:
        return math.inf
    half, slow, fast = k1 / 2, 2 * (k2 - L) / high, 2 * (k2 + L) / low
    if fast <= half**2:
        return 0.0
    width = math.sqrt(fast - half**2)
    shrinking = (math.pi / 2 + math.atan(half / width)) / width
    if slow > half**2:
        width = math.sqrt(slow - half**2)
        growing = (math.pi / 2 - math.atan(half / width)) / width
    elif slow == half**2:
        growing = 1 / half
    else:
        width = math.sqrt(half**2 - slow)
        growing = math.log((half + width) / (half - width)) / (2 * width)
    return math.sqrt(fast / slow * math.exp(-k1 * (growing + shrinking)))


def stable(k1, k2, L, low=1.0, high=1.0):
    return contraction(k1, k2, L, low, high) < 1


def half_turn(k1, k2, disturbance, beta=lambda z, xi: 1.0):
    """|ξ| at the next s = 0 from ξ = 1, for d and β as functions of (√s, ξ); 0 if it never returns."""
    from scipy.integrate import solve_ivp

    def rate(_, y):
        z, xi = y
        return [-k1 * z + xi, -2 * z * (k2 - disturbance(z, xi)) / beta(z, xi)]

    def back(_, y):
        return y[0]

    def growth_ends(_, y):
        return y[1] - k1 * y[0]

    # the disturbance may jump where growth ends: two smooth pieces
    growth_ends.terminal, growth_ends.direction = True, -1
    back.terminal, back.direction = True, -1
    options = {"rtol": 1e-11, "atol": 1e-13}
    top = solve_ivp(rate, (0, 200), (0.0, 1.0), events=growth_ends, **options).y[:, -1] * (1, 1 - 1e-12)
    down = solve_ivp(rate, (0, 200 / k1), top, events=back, **options)
    return -down.y[1, -1] if down.t_events[0].size else 0.0


def half_turn_in_time(k1, k2, disturbance, steps=200_000):
    """The same by explicit midpoint steps of the law itself, in s and ξ, for d as a function of (√s, ξ)."""
    s, xi = 0.0, 1.0
    for _ in range(steps):
        h = 2e-4 * (math.sqrt(abs(s)) + abs(xi))
        z = math.sqrt(s)
        half_s, half_xi = s + h / 2 * (xi - k1 * z), xi + h / 2 * (disturbance(z, xi) - k2)
        z = math.sqrt(max(half_s, 0.0))
        s, xi = s + h * (half_xi - k1 * z), xi + h * (disturbance(z, half_xi) - k2)
        if s <= 0:
            return -xi
    return 0.0


def worst(k1, L):
    """Disturbance of the outermost course."""
    return lambda z, xi: L if xi > k1 * z else -L


def grid():
    """The 400 points k1 ∈ [0.3, 4], k2 ∈ [1.02, 4] as exact texts."""
    from fractions import Fraction

    first = [Fraction(3, 10) + Fraction(37, 10) * i / 19 for i in range(20)]
    second = [Fraction(102, 100) + Fraction(298, 100) * i / 19 for i in range(20)]
    return [(a, b) for a in first for b in second]


def random_disturbance(L, rng):
    """A fixed pattern of jumps between −L and L over the slope of the course."""
    edges, ends = np.sort(rng.normal(size=6) * 3), rng.choice((-L, L), size=7)
    return lambda z, xi: float(ends[np.searchsorted(edges, xi / max(z, 1e-300))])
