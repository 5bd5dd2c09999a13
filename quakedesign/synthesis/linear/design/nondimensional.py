"""The Riccati design in nondimensional variables: cost, split of W, and the weight that meets a bandwidth."""

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import product
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from quakedesign.certificates.sectors import Sectors
from quakedesign.errors import ParameterError
from quakedesign.synthesis.linear.design.algebraic_riccati import METHOD
from quakedesign.synthesis.linear.plant.problem import LinearProblem, Scales
from quakedesign.synthesis.linear.plant.rational_matrices import Matrix, diagonal, floats

LIGHTEST = -14.0
_HEAVIEST, _ROUNDS = 0.0, 5
COST = diagonal((Fraction(1), Fraction(1, 100), Fraction(1), Fraction(1)))
"""Q0 on x1, x2, ξ1, ξ2."""
Choice = tuple[float, float]
"""R and the split of W."""


class ScaledDesign:
    """The design in nondimensional variables, undone at the end.

    Parameters
    ----------
    problem : LinearProblem
        In SI.
    scales : Scales
    """

    def __init__(self, problem: LinearProblem, scales: Scales) -> None:
        self.outside, self.scales = problem, scales
        self.inside = problem.nondimensional(scales)
        self.A, self.Q0 = (floats(m) for m in (self.inside.nominal(), COST))
        self.B = np.array([[0.0], [1.0], [0.0], [0.0]])
        self.g = tuple(float(g) for g in self.inside.bounds)

    def bound(self, split: float | Fraction) -> Any:
        """W with h² ≤ xᵀWx."""
        return floats(sound_bound(self.inside.bounds, Fraction(split)))

    def solve(self, R: float, split: float | None = None) -> tuple[Any, Any, Any, float]:
        """K, S, E and the split of W for a weight R; the best split unless one is given.

        Raises
        ------
        ParameterError
            When the time scales of the plant lie too far apart.
        """
        import control

        used = self.best_split(R) if split is None else split
        try:
            solution = control.lqr(self.A, self.B, self.Q0 + R * self.bound(used), [[R]], method=METHOD)
        except (np.linalg.LinAlgError, ValueError, control.ControlArgument) as error:
            ranges = self.inside.sectors
            raise ParameterError(
                "the Riccati equation of the fault must be solvable in floating point. Received one that is not "
                f"({error}), with damping {float(max(map(abs, ranges.rate))):.2g} and softening "
                f"{float(max(map(abs, ranges.slip))):.2g} in units of the natural frequency. Check the units of the "
                "damping, the shear modulus and the lengths."
            ) from None
        return (*solution, used)

    def best_split(self, R: float) -> float:
        """Split of W with the smallest trace of S, to six digits; 1/2 where one of the bounds is 0."""
        if min(self.g) == 0:
            return 0.5
        best = minimize_scalar(
            lambda w: self.solve(R, w)[1].trace(), bounds=(0.01, 0.99), method="bounded", options={"xatol": 1e-4}
        )
        return round(float(best.x), 6)

    def gains(self, K: Any) -> list[float]:
        """K in SI."""
        return [float(k) for k in self.scales.gains_outside([Fraction(float(v)) for v in K[0]])]

    def fastest_pole(self, K: Any) -> float:
        """Largest modulus of a pole over the vertices of the uncertainty [rad/s]."""
        return max(abs(pole) for pole in vertex_poles(self.outside.sectors, self.gains(K)))

    def weight_for_pole(self, target: float) -> Choice:
        """R at which the fastest pole has a modulus [rad/s], or the nearest one from 1e-14 to 1; and the split.

        The split of W follows in a few rounds.
        """
        split, root = 0.5, _HEAVIEST
        for _ in range(_ROUNDS):

            def excess(log_weight: float, split: float = split) -> float:
                return math.log(self.fastest_pole(self.solve(10.0**log_weight, split)[0]) / target)

            root = _root(excess, LIGHTEST, _HEAVIEST)
            best = self.best_split(10.0**root)
            if abs(best - split) < 1e-5:
                break
            split = best
        return 10.0**root, split


def sound_bound(bounds: Sequence[Fraction], split: Fraction) -> Matrix:
    """W = diag(g1²/w, g2²/(1−w), 0, 0) with h² ≤ xᵀWx wherever |h| ≤ g1|x1| + g2|x2| (ERRATA 7)."""
    g1, g2 = bounds
    first, second = (g1**2 / split, g2**2 / (1 - split)) if g1 and g2 else (g1**2, g2**2)
    return diagonal((first, second, Fraction(0), Fraction(0)))


def vertex_poles(needed: Sectors, gains: Sequence[float | Fraction]) -> list[complex]:
    """Closed-loop poles [1/s] at all vertices of the uncertainty, for gains in SI."""
    b, poles = float(needed.authority), list[complex]()
    for beta, s, w in product(needed.beta, needed.slip, needed.rate):
        feedback = [-float(beta) * b * float(k) for k in gains]
        row = [feedback[0] + float(s), feedback[1] - float(w), *feedback[2:]]
        poles += [complex(z) for z in np.linalg.eigvals(np.array([[0, 1, 0, 0], row, [1, 0, 0, 0], [0, 0, 1, 0]]))]
    return poles


def _root(excess: Callable[[float], float], low: float, high: float) -> float:
    """Zero of a decreasing function, or the end that is nearest to one."""
    if excess(low) <= 0:
        return low
    if excess(high) >= 0:
        return high
    return float(brentq(excess, low, high, xtol=1e-6))
