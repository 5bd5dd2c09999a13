"""Frequency-domain limits of the e-LQR: margins that no certificate can exceed.

The loop, in continuous time, and its symbols s [1/s²], w [1/s], β [-], b [m²/kg] and K = (k1, …, k4) are those of
`FeedbackLoop`. As s is a slope here, z denotes the Laplace variable [1/s].
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from scipy.optimize import minimize_scalar

from quakedesign.linear.linear_problem import FeedbackLoop, Vertex, characteristic


def slip_limit(loop: FeedbackLoop, rate: Fraction) -> tuple[Fraction, Fraction] | None:
    """Smallest constant s [1/s²] that destabilises the loop for some constant β, and that β; None if β alone does.

    For a constant β and w = `rate` the loop is stable if and only if s is below βbk1 − βbk3/(w + βbk2) − (w +
    βbk2)k4/k3. This is convex in β if w·k2 ≥ 0; else it is concave and least at an end. The value is exact at the β
    returned, an end of the range or a rational next to the least point.
    """
    k1, k2, k3, k4 = loop.gains
    low, high = loop.sectors.beta
    candidates = [low, high]

    def limit(beta: Fraction) -> Fraction | None:
        strength = beta * loop.sectors.authority
        damping = rate + strength * k2
        if min(damping, k3 * strength, k4 * strength) <= 0:
            return None
        return strength * k1 - strength * k3 / damping - damping * k4 / k3

    if any(limit(beta) is None for beta in candidates):
        return None
    square = k3 * rate / (k1 - k2 * k4 / k3) if k1 * k3 > k2 * k4 else Fraction(-1)
    if square >= 0 and k2 > 0:
        inner = Fraction(
            round((float(square) ** 0.5 - float(rate)) / float(loop.sectors.authority * k2) * 2**20), 2**20
        )
        candidates += [inner] if low < inner < high else []
    values = [(value, beta) for beta in candidates if (value := limit(beta)) is not None]
    return min(values)


def circle_limit(loop: FeedbackLoop, beta: Fraction, rate: Fraction, least: Fraction) -> float:
    """Largest s − least [1/s²] that the circle criterion allows for time-varying s ≥ least at a constant β.

    1/max Re G(jω) of G(z) = z²/(characteristic polynomial with s = least): for one sector and a constant β no quadratic
    V does better (Yakubovich, Kalman, Popov). Computed in floating point, without proof.
    """
    a3, a2, a1, a0 = (float(c) for c in characteristic(loop.matrix((beta, least, rate)))[1:])
    scale = max(abs(a3), abs(a2) ** 0.5, abs(a1) ** (1 / 3), abs(a0) ** 0.25)

    def real_part(logarithm: float) -> float:
        z = 1j * 10.0**logarithm * scale
        return float((z**2 / (z**4 + a3 * z**3 + a2 * z**2 + a1 * z + a0)).real)

    grid = np.linspace(-6, 2, 2001)
    place = int(np.argmax([real_part(x) for x in grid]))
    ends = (grid[max(place - 1, 0)], grid[min(place + 1, len(grid) - 1)])
    best = minimize_scalar(lambda x: -real_part(x), bounds=ends, method="bounded", options={"xatol": 1e-10})
    return float(-1 / best.fun) if best.fun < 0 else float("inf")


@dataclass(frozen=True, slots=True, kw_only=True)
class FrequencyFacts:
    """Classical margins (python-control), and norms on a frequency grid, at one vertex of the box."""

    # beta, slip, rate: The vertex: β [-], s [1/s²], w [1/s]
    beta: float
    slip: float
    rate: float
    stable: bool
    gain_margin: float | None  # Smallest factor above 1 on K that destabilises; None if none does
    gain_reduction: float | None  # Largest factor below 1 on K that destabilises; None if none does
    phase_margin: float | None  # Smallest over all crossings [deg]
    delay_margin: float | None  # Smallest dead time in the loop that destabilises [s]
    return_difference: float  # min |1 + L(jω)| [-]; at least 1 for an optimal K
    # disturbance_peak_slip, disturbance_peak_rate: H∞ norms from the disturbance [m/s²] to e1 [s²] and to e2 [s]
    disturbance_peak_slip: float
    disturbance_peak_rate: float


def frequency_properties(loop: FeedbackLoop, corner: Vertex) -> FrequencyFacts:
    """Margins of the loop L(z) = βb(k2z³ + k1z² + k3z + k4)/(z²(z² + wz − s)) and closed-loop norms at a vertex."""
    beta, slip, rate = corner
    k1, k2, k3, k4 = loop.gains
    closed = [float(c) for c in characteristic(loop.matrix(corner))[1:]]
    pace = max(abs(c) ** (1 / n) for n, c in enumerate(closed, start=1) if c)
    scaled = [c / pace**n for n, c in enumerate(closed, start=1)]
    feedback = [float(beta * loop.sectors.authority * k) / pace**n for n, k in enumerate((k2, k1, k3, k4), start=1)]
    plant = [1.0, float(rate) / pace, -float(slip) / pace**2, 0.0, 0.0]
    grid = np.logspace(-7, 3, 20001)
    z = 1j * grid
    gains = _crossings(feedback, plant)
    denominator = np.polyval([1.0, *scaled], z)
    return FrequencyFacts(
        beta=float(beta),
        slip=float(slip),
        rate=float(rate),
        stable=loop.stable(corner),
        gain_margin=min((g for g in gains["gain"] if g > 1), default=None),
        gain_reduction=max((g for g in gains["gain"] if g < 1), default=None),
        phase_margin=min((abs(p) for p in gains["phase"]), default=None),
        delay_margin=min((d / pace for d in gains["delay"]), default=None),
        return_difference=float(np.min(np.abs(denominator / np.polyval(plant, z)))),
        disturbance_peak_slip=float(np.max(np.abs(z**2 / denominator))) / pace**2,
        disturbance_peak_rate=float(np.max(np.abs(z**3 / denominator))) / pace,
    )


def _crossings(feedback: Sequence[float], plant: Sequence[float]) -> dict[str, list[float]]:
    """Gain factors, phases [deg] and scaled delays at which the loop crosses −1; none without feedback."""
    import control

    if not any(feedback):
        return {"gain": [], "phase": [], "delay": []}
    above, below = list(feedback), list(plant)
    while not above[-1] and not below[-1]:  # the gain of an integral is zero: its pole at 0 cancels
        above, below = above[:-1], below[:-1]
    gain, phase, _, _, at_gain, _ = control.stability_margins(control.tf(above, below), returnall=True)
    phases = np.atleast_1d(phase)
    delays = np.deg2rad(np.mod(phases, 360)) / np.atleast_1d(at_gain)
    return {
        "gain": [float(g) for g in np.atleast_1d(gain) if np.isfinite(g) and g > 0],
        "phase": [float((p + 180) % 360 - 180) for p in phases if np.isfinite(p)],
        "delay": [float(d) for d in delays if np.isfinite(d)],
    }
