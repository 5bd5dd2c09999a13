"""CVODES and IDAS of CasADi as a solver of SciPy's `solve_ivp`, whose steps are nearly straight lines.

A solver that answers only where it is asked passes over an earthquake between two questions. Here intervals are taken
so short that in the middle of each of their pieces, the steps, the value is nearly the mean of its ends. Slopes are not
used: those of a stiff problem are lost in rounding.
"""

from collections import deque
from typing import Any

import numpy as np
from scipy.integrate import DenseOutput, OdeSolver

from quakedesign.simulation.integrators.adaptive import Flow, StoppedError

AGREEMENT = 0.02
"""Share of the size of a variable that a straight line may miss."""
SHARES = np.arange(1, 65) / 64
"""Middle and end of every piece of an interval."""
_PIECES, _LONGER = len(SHARES) // 2, 4
_SHORTEST = 1e-15


class Resolved(OdeSolver):  # type: ignore[misc]
    """Steps of an interval at a time.

    Parameters
    ----------
    fun, t0, y0, t_bound, vectorized
        As of SciPy's `OdeSolver`.
    pieces, whole : Flow
        Over an interval, at `SHARES` of it, and with its end alone.
    parameters : list of float
        Of both.
    """

    t: float
    y: Any

    def __init__(
        self, fun: Any, t0: float, y0: Any, t_bound: float, vectorized: bool, *,
        pieces: Flow, whole: Flow, parameters: list[float], **_tolerances: Any,
    ) -> None:  # fmt: skip
        super().__init__(fun, t0, y0, t_bound, vectorized)
        self._pieces, self._whole, self._parameters = pieces, whole, parameters
        self._length, self._ahead = t_bound - t0, deque[tuple[float, Any]]()

    def _step_impl(self) -> tuple[bool, str | None]:
        try:
            while not self._ahead:
                self._look_ahead()
        except StoppedError as error:
            return False, f"{error} after t = {self.t:.6g} s."
        self._before = self.y
        self.t, self.y = self._ahead.popleft()
        return True, None

    def _look_ahead(self) -> None:
        """Points of the first pieces of an interval that are nearly straight; none if it is too long."""
        length = self._length = min(self._length, self.t_bound - self.t)
        shortest = length < _SHORTEST * self.t_bound
        try:
            values = self._pieces.follow(self.t, length, self.y, self._parameters)[0].T
        except StoppedError:
            if shortest:
                raise
            values = np.full((len(SHARES), self.n), np.nan)
        before = self.y
        for share, middle, after in zip(SHARES[1::2], values[::2], values[1::2], strict=True):
            straight = np.all(abs(middle - 0.5 * (before + after)) <= AGREEMENT * self._pieces.scales)
            if not (straight or shortest):
                break
            last = share == 1 and self.t + length >= self.t_bound
            self._ahead.append((self.t_bound if last else self.t + share * length, after))
            before = after
        if len(self._ahead) == _PIECES:
            self._length *= _LONGER
        elif len(self._ahead) < _PIECES // _LONGER:
            self._length /= _LONGER
        self.nfev += _PIECES

    def _dense_output_impl(self) -> "_Between":
        return _Between(self, {self.t_old: self._before, self.t: self.y})

    def follow(self, start: float, y: Any, time: float) -> Any:
        """Value at a time [s] from that at another."""
        return self._whole.follow(start, time - start, y, self._parameters)[0][:, -1]


class _Between(DenseOutput):  # type: ignore[misc]
    """Values within a step, of the solver itself; its ends are as they are known."""

    def __init__(self, solver: Resolved, known: dict[float, Any]) -> None:
        super().__init__(solver.t_old, solver.t)
        self._solver, self._known = solver, known

    def _call_impl(self, t: Any) -> Any:
        return np.array([self._at(float(time)) for time in t]).T if t.ndim else self._at(float(t))

    def _at(self, time: float) -> Any:
        return (
            self._known[time] if time in self._known else self._solver.follow(self.t_old, self._known[self.t_old], time)
        )
