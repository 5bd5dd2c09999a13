"""The smallest gain of all Riccati designs that are guaranteed over the uncertainty."""

import math
from dataclasses import dataclass
from fractions import Fraction

from scipy.optimize import minimize_scalar

from quakedesign.synthesis.linear.design.nondimensional import sound_bound
from quakedesign.synthesis.linear.plant.problem import LinearProblem


@dataclass(frozen=True, slots=True, kw_only=True)
class SmallestGain:
    """Infimum of the gain over every Q0 > 0 and R > 0 of the guaranteed set; reached as Q0/R → 0, with k3, k4 → 0.

    Attributes
    ----------
    slip, rate : float
        k1 [Pa/m] and k2 [Pa·s/m] of the smallest gain in natural units, k1² + (ω_nk2)².
    split : float
        Its w.
    """

    slip: float
    rate: float
    split: float


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
    g1, g2 = problem.bounds
    pace = math.sqrt(abs(float(problem.stiffness))) or 1.0

    def size(split: float) -> float:
        k1, k2 = limiting_gains(problem, split)
        return math.hypot(k1, pace * k2)

    split = 0.5
    if g1 and g2:
        split = float(minimize_scalar(size, bounds=(1e-6, 1 - 1e-6), method="bounded", options={"xatol": 1e-9}).x)
    k1, k2 = limiting_gains(problem, split)
    return SmallestGain(slip=k1, rate=k2, split=split)
