"""Trajectories of adaptive integrators resolved in time: points with nearly straight lines between, and crossings.

A solver that answers only where it is asked passes over an earthquake between two questions. Here intervals are taken
so short that in the middle of each of their pieces the value is nearly the mean of its ends. Slopes are not used: those
of a stiff problem are lost in rounding.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from quakedesign.errors import SimulationError
from quakedesign.simulation.integrators import AdaptiveIntegrator
from quakedesign.simulation.integrators.adaptive import Flow, StoppedError

if TYPE_CHECKING:
    Point = tuple[float, np.ndarray]

AGREEMENT = 0.02
PIECES = 32
_LONGER = 4
_SHORTEST = 1e-15


@dataclass(frozen=True)
class Resolution:
    """y' = f(t, y) under constant parameters, followed by one integrator.

    Attributes
    ----------
    scales : ndarray
        Size of each variable, of which a straight line may miss the share `AGREEMENT`.
    parameters : sequence of float
    whole, pieces : Flow
        Over an interval, with its end, or with the middle and the end of every piece.
    """

    scales: "np.ndarray"
    parameters: Sequence[float]
    whole: Flow
    pieces: Flow

    @classmethod
    def of(
        cls,
        method: type[AdaptiveIntegrator],
        rates: Any,
        scales: "np.ndarray",
        parameters: Sequence[float],
        rtol: float,
    ) -> "Resolution":
        """Resolution by one integrator; raises `ParameterError` for a tolerance that it does not take."""
        divided = [number / (2 * PIECES) for number in range(1, 2 * PIECES + 1)]
        flows = (method.flow(rates, scales, shares, rtol=rtol) for shares in ([1.0], divided))
        return cls(scales, parameters, *flows)

    def points(self, start: "Point", end: float) -> "list[Point]":
        """Times [s] and values from a point to a time, the start left out, dense enough for straight lines between.

        Raises
        ------
        SimulationError
            When the solver stops, as when a value grows without bound.
        """
        found, now, length = list["Point"](), start, end - start[0]
        while now[0] < end:
            length = min(length, end - now[0])
            ahead = self._ahead(now, length, end)
            found += ahead
            now = found[-1] if found else now
            if len(ahead) == PIECES:
                length *= _LONGER
            elif len(ahead) < PIECES // _LONGER:
                length /= _LONGER
        return found

    def _ahead(self, start: "Point", length: float, end: float) -> "list[Point]":
        """Points of the first pieces of an interval that are nearly straight; none if it is too long."""
        time, y = start
        try:
            values = self._follow(self.pieces, time, length, y)
        except SimulationError:
            if length < _SHORTEST * end:
                raise
            return []
        found, before = list["Point"](), start
        for number in range(PIECES):
            last = end if number == PIECES - 1 and time + length >= end else time + (number + 1) / PIECES * length
            after = (last, values[:, 2 * number + 1])
            bend = abs(values[:, 2 * number] - 0.5 * (before[1] + after[1]))
            if length >= _SHORTEST * end and any(bend > AGREEMENT * self.scales):
                break
            found.append(after)
            before = after
        return found

    def crossings(self, points: "Sequence[Point]", watched: int, level: float) -> list[float]:
        """Times [s] at which one variable rises through a level, by bisection and secants on the solver itself."""
        times = []
        for (time, y), (later, after) in pairwise(points):
            if y[watched] < level <= after[watched]:
                times.append(self._crossing((time, y), later, watched, level))
        return times

    def _crossing(self, start: "Point", later: float, watched: int, level: float) -> float:
        from scipy.optimize import brentq

        time, y = start

        def missing(share: float) -> float:
            value = y if share == 0 else self._follow(self.whole, time, share, y)[:, -1]
            return float(value[watched] - level)

        whole = later - time
        # A new start may meet the level a rounding after the interval.
        return later if missing(whole) < 0 else time + brentq(missing, 0.0, whole, xtol=1e-15 * later, rtol=1e-15)

    def _follow(self, flow: Flow, time: float, length: float, y: "np.ndarray") -> "np.ndarray":
        try:
            return flow.follow(time, length, y, self.parameters)[0]
        except StoppedError as error:
            raise SimulationError(
                f"the integration stopped between t = {time:.6g} s and {time + length:.6g} s: {error}. "
                "Check that the slip rate stays finite, or loosen rtol."
            ) from None
