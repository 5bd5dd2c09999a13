"""Whether a sampled e-LQR is stable over a whole box, and up to which sampling period (ERRATA 22).

p is held over every period, parameters are constant anywhere in the box, which is cut up in ball arithmetic.
"""

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import count
from typing import Any

import numpy as np
from flint import ctx

from quakedesign.bounds import LowerBound
from quakedesign.certificates import Verdict
from quakedesign.certificates.guarantee.ball_matrices import ball
from quakedesign.errors import ParameterError
from quakedesign.rationals import rational
from quakedesign.synthesis.linear.plant.problem import LinearProblem, Vertex
from quakedesign.synthesis.linear.plant.rational_matrices import floats
from quakedesign.synthesis.linear.sampled.zero_order_hold import (
    coefficients,
    conditions,
    held_matrix,
    interval,
    require_integration,
)

Range = tuple[Fraction, Fraction]
_DOUBLINGS, _CELLS = 24, 4000
_TOLERANCE = 0.01  # relative width at which the bisection stops
_BITS = (53, 400)
_SHARES = tuple(Fraction(n, 100) for n in (100, 98, 95, 90, 80, 60, 40, 20, 5))


@dataclass(frozen=True, slots=True, kw_only=True)
class HoldVerdict:
    """Stability of the sampled loop for every constant (β, s, w) of a box.

    Attributes
    ----------
    verdict : Verdict
        REFUTED: not asymptotically stable at `witness`, in ball arithmetic.
    witness : (Fraction, Fraction, Fraction) or None
        β, s [1/s²], w [1/s].
    """

    verdict: Verdict
    witness: Vertex | None


def hold_verdict(
    problem: LinearProblem,
    gains: Sequence[Fraction],
    step: float | str | Fraction | tuple[Fraction, Fraction],
    *,
    integration: str = "exact",
    cells: int = 4000,
) -> HoldVerdict:
    """Decide the sampled loop over the whole box.

    Parameters
    ----------
    problem : LinearProblem
    gains : sequence of 4 Fraction
    step : number, text, or (Fraction, Fraction)
        T_s [s]; a range for all periods in it, from 0 if wanted (0 is the continuous loop).
    integration : str
        Of ξ, ``"exact"`` or ``"euler"``.
    cells : int
        Largest number of cells; UNDECIDED beyond.

    Raises
    ------
    ParameterError
        For a period that is not positive, or an unknown integration.
    """
    require_integration(integration)
    steps = step if isinstance(step, tuple) else (rational(step, "step"),) * 2
    if steps[1] <= 0 or not 0 <= steps[0] <= steps[1]:
        raise ParameterError(f"step must be positive. Received {[float(v) for v in steps]} s. Give it in seconds.")
    scales = problem.scales()
    inside, t = problem.nondimensional(scales), scales.time
    task = _Task(inside, scales.gains_inside(gains), integration)
    box = ((steps[0] / t, steps[1] / t), inside.sectors.beta, inside.sectors.slip, inside.sectors.rate)
    verdict, witness = task.decide(box, cells)
    if witness is not None:
        witness = (witness[0], witness[1] / t**2, witness[2] / t)
    return HoldVerdict(verdict=verdict, witness=witness)


Cell = tuple[Range, ...]


@dataclass(frozen=True, slots=True)
class _Task:
    """Loop, gains and integration, nondimensional."""

    inside: LinearProblem
    gains: tuple[Fraction, ...]
    integration: str

    def conditions(self, cell: Cell) -> tuple[Any, ...]:
        T, beta, s, w = (interval(*ends) for ends in cell)
        push = [ball(k * self.inside.sectors.authority) for k in self.gains]
        return conditions(T, coefficients(T, beta, s, w, push, self.integration))

    def decide(self, box: Cell, limit: int) -> tuple[Verdict, Vertex | None]:
        """Verdict and witness, from at most so many cells."""
        if not self.gains[3]:  # then z = 1 is a pole, whatever the plant
            return Verdict.REFUTED, self.inside.vertices()[0]
        for vertex in self.inside.vertices():
            if self._unstable((box[0][1], *vertex)):
                return Verdict.REFUTED, vertex
        order = count()
        heap = [(0.0, next(order), box)]
        for _ in range(limit):
            if not heap:
                return Verdict.PROVED, None
            _, _, cell = heapq.heappop(heap)
            if all(v > 0 for v in self.conditions(cell)):
                continue
            middle = tuple((a + b) / 2 for a, b in cell)
            if self._unstable(middle):
                return Verdict.REFUTED, (middle[1], middle[2], middle[3])
            for part in self._halves(cell):
                heapq.heappush(heap, (-max(_widths(part, box)), next(order), part))
        return (Verdict.UNDECIDED if heap else Verdict.PROVED), None

    def _unstable(self, point: Sequence[Fraction]) -> bool:
        """Whether a condition is surely violated at a point, with more digits where the plant grows far in a period."""
        for bits in _BITS:
            with ctx.workprec(bits):
                conditions = self.conditions(tuple((v, v) for v in point))
                if any(v < 0 for v in conditions[:5]):
                    return True
                if all(v > 0 for v in conditions[:5]) and not conditions[5].contains(0):
                    return bool(conditions[5] < 0)
        return False

    def _halves(self, cell: Cell) -> list[Cell]:
        """Halves along the range to which the last condition is most sensitive."""
        middle = [(a + b) / 2 for a, b in cell]
        best, largest = 0, -1.0
        for i, (low, high) in enumerate(cell):
            if low == high:
                continue
            values = self.conditions(tuple(cell[j] if j == i else (m, m) for j, m in enumerate(middle)))
            spread = max(float(v.rad()) / max(float(abs(v.mid())), 1e-300) for v in values)
            if spread > largest:
                best, largest = i, spread
        low, high = cell[best]
        if low == high:
            return [cell]
        return [(*cell[:best], ends, *cell[best + 1 :]) for ends in ((low, middle[best]), (middle[best], high))]


def _widths(cell: Cell, box: Cell) -> list[float]:
    return [float((b - a) / (d - c)) if d > c else 0.0 for (a, b), (c, d) in zip(cell, box, strict=True)]


def largest_radius(problem: LinearProblem, gains: Sequence[Fraction], step: float, integration: str = "exact") -> float:
    """Largest spectral radius of a period over the vertices of the box, in floating point."""
    push = [float(problem.sectors.authority * k) for k in gains]
    radii = []
    for beta, s, w in problem.vertices():
        matrix = held_matrix(step, float(beta), float(s), float(w), push, integration)
        radii.append(float(np.abs(np.linalg.eigvals(matrix)).max()) if np.isfinite(matrix).all() else math.inf)
    return max(radii)


@dataclass(frozen=True, slots=True, kw_only=True)
class LargestStep:
    """How long a sampling period may be.

    Attributes
    ----------
    proved : LowerBound
        Every period in (0, proved] is stable over the whole box [s].
    refuted : Fraction or None
        A longer one that is not [s]; None where none was found, up to four million times the fastest pole's time.
    """

    proved: LowerBound
    refuted: Fraction | None


def largest_step(
    problem: LinearProblem, gains: Sequence[Fraction], *, integration: str = "exact"
) -> LargestStep | None:
    """Largest admissible sampling period: bisection on verdicts, then one proof for all shorter periods.

    Returns
    -------
    LargestStep or None
        None when the continuous loop itself is not stable over the box, or no range of periods was proved.
    """

    def judged(step: Fraction) -> Verdict:
        return hold_verdict(problem, gains, step, integration=integration).verdict

    high, verdict = _first_refuted(problem, gains, judged)
    refuted = high if verdict is Verdict.REFUTED else None
    low, first = high, high
    while verdict is not Verdict.PROVED:
        low, high = low / 2, low
        if low < first / 2**12:
            return None
        verdict = judged(low)
    while high / low > 1 + _TOLERANCE:
        middle = (low + high) / 2
        verdict = judged(middle)
        low, high = (middle, high) if verdict is Verdict.PROVED else (low, middle)
        refuted = middle if verdict is Verdict.REFUTED else refuted
    return _all_shorter(problem, gains, integration, low, refuted)


def _all_shorter(
    problem: LinearProblem, gains: Sequence[Fraction], integration: str, longest: Fraction, refuted: Fraction | None
) -> LargestStep | None:
    """One proof for all periods up to the longest one, or up to a share of it where that takes too many cells."""
    for share in _SHARES:
        step = longest * share
        verdict = hold_verdict(problem, gains, (Fraction(0), step), integration=integration, cells=_CELLS)
        if verdict.verdict is Verdict.PROVED:
            return LargestStep(proved=LowerBound(step), refuted=refuted)
    return None


def _first_refuted(problem: LinearProblem, gains: Sequence[Fraction], judged: Any) -> tuple[Fraction, Verdict]:
    """Period that is refuted, twice one that is not, from the fastest pole of the vertices on; or the longest tried."""
    loops = (floats(problem.loop(vertex, gains)) for vertex in problem.vertices())
    fastest = max(float(np.abs(np.linalg.eigvals(loop)).max()) for loop in loops)
    step = rational(f"{0.5 / fastest:.3e}")
    for _ in range(_DOUBLINGS):
        verdict = judged(step)
        if verdict is Verdict.REFUTED:
            break
        step *= 2
    return (step, verdict) if verdict is Verdict.REFUTED else (step / 2, verdict)
