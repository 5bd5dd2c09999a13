"""Poles of the sampled law that runs, p held over a period and integrals summed, at constant parameters, in balls.

A corner of the box with a pole outside the unit circle refutes a sampling period for the whole box. Inside the box
constant parameters may be worse than at its corners: what is not refuted here is not proved either.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from flint import acb_mat, arb_mat, ctx

from quakedesign.certificates.guarantee.ball_matrices import matrix
from quakedesign.rationals import rational
from quakedesign.synthesis.linear.plant.problem import LinearProblem, Vertex
from quakedesign.synthesis.linear.plant.rational_matrices import floats, times

_DOUBLINGS = 24
_TOLERANCE = 0.01  # relative width at which the bisection stops
_BITS = (100, 2000)  # the second for a plant that grows far within a period
_ZERO, _ONE = Fraction(0), Fraction(1)


def poles(problem: LinearProblem, gains: Sequence[Fraction], step: Fraction, vertex: Vertex) -> list[Any]:
    """Eigenvalues of one period in x1, x2, ξ1, ξ2 at constant (β, s, w), as complex balls; not finite if not isolated.

    Parameters
    ----------
    problem : LinearProblem
        In units in which its numbers are near 1.
    gains : sequence of 4 Fraction
    step : Fraction
        T_s.
    vertex : (Fraction, Fraction, Fraction)
        β, s, w.
    """
    beta, s, w = vertex
    flow = ((_ZERO, _ONE, _ZERO), (s, -w, beta * problem.sectors.authority), (_ZERO,) * 3)
    start = ((_ONE, _ZERO, _ZERO, _ZERO), (_ZERO, _ONE, _ZERO, _ZERO), tuple(-k for k in gains))
    sums = ((step, _ZERO, _ONE, _ZERO), (_ZERO, _ZERO, step, _ONE))
    values = list[Any]()
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
    """What the poles at the corners of the box tell about sampling periods.

    Attributes
    ----------
    problem : LinearProblem
        In SI.
    gains : sequence of 4 Fraction
    """

    problem: LinearProblem
    gains: Sequence[Fraction]

    def at(self, step: Fraction) -> dict[Vertex, list[Any]]:
        """Poles by corner (β, s [1/s²], w [1/s]) at a period [s]."""
        scales = self.problem.scales()
        inside, push = self.problem.nondimensional(scales), scales.gains_inside(self.gains)
        return {
            corner: poles(inside, push, step / scales.time, scaled)
            for corner, scaled in zip(self.problem.vertices(), inside.vertices(), strict=True)
        }

    def unstable(self, step: Fraction) -> Vertex | None:
        """Corner at which a period [s] is surely not asymptotically stable; None where none was found."""
        if not self.gains[3]:  # then z = 1 is a pole, whatever the plant
            return self.problem.vertices()[0]
        return next((corner for corner, found in self.at(step).items() if any(abs(z) > 1 for z in found)), None)

    def radius(self, step: Fraction) -> float:
        """Spectral radius of a period [s], largest over the corners, measured."""
        return max(float(abs(z).mid()) for found in self.at(step).values() for z in found)

    def limit(self) -> tuple[Fraction, Fraction | None] | None:
        """Longest period [s] that the corners allow, nearly, and a longer one that they refute.

        Returns
        -------
        (Fraction, Fraction or None) or None
            The second is None where none was refuted, up to four million times the fastest pole's time; None when
            all periods are refuted.
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
