"""Integration of smooth differential equations to a tolerance, with crossings of one level found on the way."""

from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from quakedesign.errors import SimulationError, require_known
from quakedesign.simulation.integrators import adaptive_integrators
from quakedesign.simulation.integrators.adaptive import require_tolerance
from quakedesign.simulation.resolution import SHARES, Resolved

METHODS = {"dop853": "DOP853", "radau": "Radau"}


@dataclass(frozen=True)
class Ramp:
    """Load with a value at the time `start` [s] and a constant slope [1/s]."""

    start: float
    value: tuple[float, ...]
    slope: tuple[float, ...]

    def at(self, time: float) -> list[float]:
        """Load at a time [s]."""
        return [value + slope * (time - self.start) for value, slope in zip(self.value, self.slope, strict=True)]


@dataclass(frozen=True)
class Solution:
    """Instants [s], shape (n,); values there, shape (variables, n); instants at which the level was crossed [s]."""

    time: "np.ndarray"
    values: "np.ndarray"
    crossings: "np.ndarray"
    evaluations: int


@dataclass(frozen=True)
class Problem:
    """y' = f(y, load(t)) in the variables of a CasADi Function (y, load) → f, ∂f/∂y.

    Attributes
    ----------
    rates : casadi.Function
    scales : ndarray
        Size of each variable below which its error counts absolutely.
    watched : int
        Index of the variable whose upward crossings of `level` are found.
    level : float
    """

    rates: Any
    scales: "np.ndarray"
    watched: int
    level: float

    def integrate(
        self, start: "np.ndarray", load: Ramp, times: "np.ndarray", *, every_step: bool, method: str, rtol: float
    ) -> Solution:
        """Follow the equations from times[0] to times[-1], with a clock that starts with them.

        After years the steps of an earthquake are shorter than what floats of the absolute time can tell apart.

        Parameters
        ----------
        start : ndarray
        load : Ramp
        times : ndarray
            Ascending instants [s].
        every_step : bool
            Return the accepted steps of the method; otherwise the values at `times`.
        method : str
            ``"dop853"`` (explicit, order 8; its interpolant of order 7 serves the instants) or ``"radau"`` (implicit,
            order 5, for stiff problems; it stops at each instant), or ``"cvodes"`` or ``"idas"`` (implicit, orders 1 to
            5; points as close as a cubic needs take the place of accepted steps).
        rtol : float
            Tolerance of one step, relative beyond `scales`.

        Raises
        ------
        ParameterError
            For an unknown method, or a tolerance outside 1e-13 … 1e-3.
        SimulationError
            When the method cannot go on.
        """
        _check(method, rtol)
        began, clock = float(times[0]), replace(load, start=load.start - float(times[0]))
        solution = self._stepped(start, clock, times - began, every_step=every_step, method=method, rtol=rtol)
        time = np.append(began + solution.time[:-1], times[-1]) if every_step else times
        return replace(solution, time=time, crossings=began + solution.crossings)

    def _stepped(
        self, start: "np.ndarray", load: Ramp, times: "np.ndarray", *, every_step: bool, method: str, rtol: float
    ) -> Solution:
        field, crossing, solver = self._field(load), self._crossing(), self._solver(method, load, rtol)
        spans = [times] if every_step or method == "dop853" else [times[i : i + 2] for i in range(len(times) - 1)]
        pieces: list[tuple[np.ndarray, np.ndarray]] = []
        crossed: list[np.ndarray] = []
        evaluations, y = 0, start
        for span in spans:
            part = _solve(
                field,
                (span[0], span[-1]),
                y,
                t_eval=None if every_step else span,
                events=crossing,
                rtol=rtol,
                atol=rtol * self.scales,
                **solver,
            )
            pieces.append((part.t, part.y) if not pieces else (part.t[1:], part.y[:, 1:]))
            crossed.append(part.t_events[0])
            evaluations += part.nfev
            y = part.y[:, -1]
        values = np.concatenate([v for _, v in pieces], axis=1)
        return Solution(np.concatenate([t for t, _ in pieces]), values, np.concatenate(crossed), evaluations)

    def _solver(self, method: str, load: Ramp, rtol: float) -> dict[str, Any]:
        """Solver of SciPy, and what it takes beside field, instants and tolerances."""
        if method not in adaptive_integrators():
            more = {"jac": self._jacobian(load)} if method == "radau" else {}
            return {"method": METHODS[method], **more}
        time, y, size = ca.SX.sym("t"), ca.SX.sym("y", self.rates.size1_in(0)), len(load.value)
        pushed = ca.SX.sym("load", 2 * size + 1)
        now = pushed[:size] + pushed[size : 2 * size] * (time - pushed[2 * size])
        rates = ca.Function("rates", [time, y, pushed], [ca.densify(self.rates(y, now)[0])])
        pieces, whole = (
            adaptive_integrators()[method].flow(rates, self.scales, shares, rtol=rtol) for shares in (SHARES, [1.0])
        )
        told = [*load.value, *load.slope, load.start]
        return {"method": Resolved, "pieces": pieces, "whole": whole, "parameters": told}

    def _field(self, load: Ramp) -> Any:
        """Field as a function of (t, y)."""
        return _Bound.of(self.rates, 0, load, np.empty(self.rates.size1_in(0))).at

    def _jacobian(self, load: Ramp) -> Any:
        """Jacobian as a function of (t, y)."""
        jacobian = _Bound.of(self.rates, 1, load, np.empty((self.rates.size1_in(0),) * 2))
        return lambda time, y: jacobian.at(time, y).T

    def _crossing(self) -> Any:
        def crossing(_: float, y: "np.ndarray") -> float:
            return float(y[self.watched]) - self.level

        crossing.direction = 1.0  # type: ignore[attr-defined]
        return crossing


@dataclass(frozen=True)
class _Bound:
    """One output of a CasADi Function, evaluated through its buffers, which must live as long."""

    load: Ramp
    state: "np.ndarray"
    given: "np.ndarray"
    result: "np.ndarray"
    evaluate: Any
    owners: tuple[Any, ...]

    @classmethod
    def of(cls, function: Any, index: int, load: Ramp, result: "np.ndarray") -> "_Bound":
        inputs = [ca.SX.sym("y", function.size1_in(0)), ca.SX.sym("load", len(load.value))]
        dense: Any = ca.Function("dense", inputs, [ca.densify(function(*inputs)[index])])
        state, given = np.empty(function.size1_in(0)), np.empty(len(load.value))
        buffer, evaluate = dense.buffer()
        buffer.set_arg(0, state.data)
        buffer.set_arg(1, given.data)
        buffer.set_res(0, result.data)
        return cls(load, state, given, result, evaluate, (dense, buffer))

    def at(self, time: float, y: "np.ndarray") -> "np.ndarray":
        """Result at a time [s] and a state; a matrix comes out transposed, as CasADi stores columns first."""
        self.state[:] = y
        self.given[:] = self.load.at(time)
        self.evaluate()
        return self.result.copy()


def _solve(*arguments: Any, **options: Any) -> Any:
    with np.errstate(over="ignore", invalid="ignore"):  # of trial steps that are too long, and rejected for it
        part = solve_ivp(*arguments, **options)
    if not part.success:
        raise SimulationError(
            f"the integration stopped after {len(part.t)} points: {part.message} "
            "Check that the slip rate stays finite, or loosen rtol."
        )
    return part


def _check(method: str, rtol: float) -> None:
    known = (*METHODS, *adaptive_integrators())
    require_known(method, known, "method")
    require_tolerance(rtol)
