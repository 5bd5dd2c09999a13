"""Adaptive integration of smooth equations with SciPy, CVODES or IDAS, and detection of level crossings.

With CVODES and IDAS the solution is nearly linear within each output interval, so that no earthquake is missed.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import casadi as ca
import numpy as np
import sympy as sp
from scipy.integrate import DenseOutput, OdeSolver, solve_ivp

from quakedesign.errors import ParameterError, SimulationError, require_known
from quakedesign.laws.sampled_controller import law_expressions
from quakedesign.loop import Scheme
from quakedesign.simulation.closed_loop import WORKS, ClosedLoop
from quakedesign.simulation.integrators import (
    AdaptiveIntegrator,
    Flow,
    StoppedError,
    adaptive_integrators,
    require_tolerance,
)
from quakedesign.simulation.recorder import Recorder
from quakedesign.symbolic import SignedPower
from quakedesign.symbolic.signed_power import AbsolutePower

# ----------------------------------------------------------------------
# CVODES and IDAS of CasADi as a solver for SciPy's `solve_ivp`, with nearly linear steps.
#
# A solver that is evaluated only at given times misses an earthquake between two of them. Here each interval is divided
# into pieces, the steps of `solve_ivp`, so short that the value in the middle of a piece is nearly the mean of those at
# its ends. Slopes are not used, since those of a stiff problem are lost in rounding.

AGREEMENT = 0.02
"""Largest error of linear interpolation, relative to the scale of a variable."""
SHARES = np.arange(1, 65) / 64
"""Middle and end of every piece, as fractions of the interval."""
_PIECES, _LONGER = len(SHARES) // 2, 4  # pieces of an interval; factor between the lengths of intervals
_SHORTEST = 1e-15  # length of an interval, relative to the end of the run


class Resolved(OdeSolver):  # type: ignore[misc]
    """SciPy solver that computes the steps of one interval at a time.

    Parameters
    ----------
    fun, t0, y0, t_bound, vectorized
        As in SciPy's `OdeSolver`.
    pieces, whole : Flow
        Solvers over one interval, with output at the fractions `SHARES`, and at the end alone.
    parameters : list of float
        Parameters of `pieces` and `whole`.
    """

    t: float
    y: np.ndarray

    def __init__(
        self, fun: Callable[..., np.ndarray], t0: float, y0: np.ndarray, t_bound: float, vectorized: bool, *,
        pieces: Flow, whole: Flow, parameters: list[float], **_tolerances: Any,
    ) -> None:  # fmt: skip
        super().__init__(fun, t0, y0, t_bound, vectorized)
        self._pieces, self._whole, self._parameters = pieces, whole, parameters
        self._length, self._ahead = t_bound - t0, deque[tuple[float, np.ndarray]]()

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
        """Append the ends of the first nearly linear pieces of an interval; none if the interval is too long."""
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

    def follow(self, start: float, y: np.ndarray, time: float) -> np.ndarray:
        """Value at a time [s] from the value y at time `start` [s]."""
        return self._whole.follow(start, time - start, y, self._parameters)[0][:, -1]


class _Between(DenseOutput):  # type: ignore[misc]
    """Values within a step, computed by the solver; the values at its ends are stored."""

    def __init__(self, solver: Resolved, dense: dict[float, np.ndarray]) -> None:
        super().__init__(solver.t_old, solver.t)
        self._solver, self._ends = solver, dense

    def _call_impl(self, t: np.ndarray) -> np.ndarray:
        return np.array([self._at(float(time)) for time in t]).T if t.ndim else self._at(float(t))

    def _at(self, time: float) -> np.ndarray:
        return self._ends[time] if time in self._ends else self._solver.follow(self.t_old, self._ends[self.t_old], time)


# ----------------------------------------------------------------------
# Integration of smooth differential equations to a tolerance, with detection of crossings of one level.

_FRESH = 1.0  # s; below this time floats already resolve 1e-16 s, so that a new origin of time would not help
Field = Callable[[float, np.ndarray], np.ndarray]
METHODS = {"dop853": "DOP853", "radau": "Radau"}


@dataclass(frozen=True)
class Ramp:
    """Load that is linear in time: its values at the time `start` [s], and their constant rates per second."""

    start: float
    value: tuple[float, ...]
    slope: tuple[float, ...]

    def at(self, time: float) -> list[float]:
        """Load at a time [s]."""
        return [value + slope * (time - self.start) for value, slope in zip(self.value, self.slope, strict=True)]


@dataclass(frozen=True)
class SmoothSolution:
    """Instants [s], shape (n,), values at these, shape (variables, n), and upward level crossings [s]."""

    time: "np.ndarray"
    values: "np.ndarray"
    crossings: "np.ndarray"
    evaluations: int


@dataclass(frozen=True)
class SmoothProblem:
    """y' = f(y, load(t)) in the variables of a CasADi Function (y, load) → f, ∂f/∂y."""

    rates: ca.Function
    scales: "np.ndarray"  # Absolute value of each variable below which its tolerance is absolute
    # Index of the variable whose upward crossings of `level` are detected; for a slice, the largest of its variables
    watched: int | slice
    level: float

    def integrate(
        self, start: "np.ndarray", load: Ramp, times: "np.ndarray", *, every_step: bool, method: str, rtol: float
    ) -> SmoothSolution:
        """Integrate the equations from times[0] to times[-1], with times[0] as origin of time.

        After simulated years the steps of an earthquake are shorter than the resolution of the absolute time in floats.
        If radau stops for this reason, it continues with a new origin of time.

        Parameters
        ----------
        times : ndarray
            Ascending instants [s].
        every_step : bool
            If True, return every accepted step; otherwise the values at `times`.
        method : str
            ``"dop853"`` (explicit, order 8, with dense output of order 7), ``"radau"`` (implicit, order 5, for stiff
            problems, with a step end at each instant), or ``"cvodes"`` or ``"idas"`` (implicit, orders 1 to 5; nearly
            linear pieces replace the accepted steps).
        rtol : float
            Tolerance of one step, relative to variables larger than `scales`, absolute below; with CVODES and IDAS the
            limit is `FLOOR` times `scales`.

        Raises
        ------
        ParameterError
            For an unknown method, or a tolerance outside 1e-13 … 1e-3.
        SimulationError
            If the method stops.
        """
        available = (*METHODS, *adaptive_integrators())
        require_known(method, available, "method")
        require_tolerance(rtol)
        began, clock = float(times[0]), replace(load, start=load.start - float(times[0]))
        solution = self._stepped(start, clock, times - began, every_step=every_step, method=method, rtol=rtol)
        time = np.append(began + solution.time[:-1], times[-1]) if every_step else times
        return replace(solution, time=time, crossings=began + solution.crossings)

    def _stepped(
        self, start: "np.ndarray", load: Ramp, times: "np.ndarray", *, every_step: bool, method: str, rtol: float
    ) -> SmoothSolution:
        whole = every_step or method == "dop853"
        spans = [times] if whole else [times[i : i + 2] for i in range(len(times) - 1)]
        clock, crossing, (field, solver) = 0.0, self._crossing(), self._solver(method, load, rtol)
        pieces: list[tuple[np.ndarray, np.ndarray]] = [(times[:1], start[:, None])]
        crossed: list[np.ndarray] = []
        evaluations, y = 0, start
        for span in spans:
            begin, reached = float(span[0]), False
            while not reached:
                with np.errstate(over="ignore", invalid="ignore"):  # overflow only in rejected trial steps
                    part = solve_ivp(
                        field,
                        (begin - clock, span[-1] - clock),
                        y,
                        t_eval=times if whole and not every_step else None,
                        events=crossing,
                        rtol=rtol,
                        atol=rtol * self.scales,
                        **solver,
                    )
                evaluations, reached = evaluations + part.nfev, part.success
                if not reached and (method != "radau" or part.t[-1] < _FRESH):
                    raise _stopped(method, sum(len(t) for t, _ in pieces) + len(part.t), part.message)
                time, y = clock + part.t, part.y[:, -1]
                crossed.append(clock + part.t_events[0])
                if whole:
                    pieces.append((time[1:], part.y[:, 1:]))
                elif reached:
                    pieces.append((time[-1:], part.y[:, -1:]))
                if not reached:
                    begin = clock = float(time[-1])
                    field, solver = self._solver(method, replace(load, start=load.start - clock), rtol)
        values = np.concatenate([v for _, v in pieces], axis=1)
        return SmoothSolution(np.concatenate([t for t, _ in pieces]), values, np.concatenate(crossed), evaluations)

    def _solver(self, method: str, load: Ramp, rtol: float) -> tuple[Field, dict[str, Any]]:
        """Field, and the arguments of `solve_ivp` for the method."""
        field = _Bound.of(self.rates, 0, load, np.empty(self.rates.size1_in(0))).at
        if method not in adaptive_integrators():
            more = {"jac": self._jacobian(load)} if method == "radau" else {}
            return field, {"method": METHODS[method], **more}
        time, y, size = ca.SX.sym("t"), ca.SX.sym("y", self.rates.size1_in(0)), len(load.value)
        ramp = ca.SX.sym("load", 2 * size + 1)
        now = ramp[:size] + ramp[size : 2 * size] * (time - ramp[2 * size])
        rates = ca.Function("rates", [time, y, ramp], [ca.densify(self.rates(y, now)[0])])
        pieces, whole = (
            adaptive_integrators()[method].flow(rates, self.scales, shares, rtol=rtol) for shares in (SHARES, [1.0])
        )
        lines = [*load.value, *load.slope, load.start]
        return field, {"method": Resolved, "pieces": pieces, "whole": whole, "parameters": lines}

    def _jacobian(self, load: Ramp) -> Field:
        """Jacobian as a function of (t, y)."""
        jacobian = _Bound.of(self.rates, 1, load, np.empty((self.rates.size1_in(0),) * 2))
        return lambda time, y: jacobian.at(time, y).T

    def _crossing(self) -> Callable[[float, np.ndarray], float]:
        def crossing(_: float, y: "np.ndarray") -> float:
            return float(np.max(y[self.watched])) - self.level

        crossing.direction = 1.0  # type: ignore[attr-defined]
        return crossing


@dataclass(frozen=True)
class _Bound:
    """One output of a CasADi Function, evaluated through its buffers, which must stay alive with it."""

    load: Ramp
    state: "np.ndarray"
    given: "np.ndarray"
    result: "np.ndarray"
    evaluate: Callable[[], None]
    owners: tuple[Any, ...]

    @classmethod
    def of(cls, function: ca.Function, index: int, load: Ramp, result: "np.ndarray") -> "_Bound":
        kind: Any = ca.SX if function.is_a("SXFunction") else ca.MX
        inputs = [kind.sym("y", function.size1_in(0)), kind.sym("load", len(load.value))]
        dense: Any = ca.Function("dense", inputs, [ca.densify(function.call(inputs)[index])])
        state, given = np.empty(function.size1_in(0)), np.empty(len(load.value))
        buffer, evaluate = dense.buffer()
        buffer.set_arg(0, state.data)
        buffer.set_arg(1, given.data)
        buffer.set_res(0, result.data)
        return cls(load, state, given, result, evaluate, (dense, buffer))

    def at(self, time: float, y: "np.ndarray") -> "np.ndarray":
        """Result at a time [s] and a state; a matrix is transposed, since CasADi stores it by columns."""
        self.state[:] = y
        self.given[:] = self.load.at(time)
        self.evaluate()
        return self.result.copy()


def _stopped(method: str, points: int, reason: str) -> SimulationError:
    other = "cvodes" if method in METHODS else "radau"
    return SimulationError(
        f"the integration with {method} stopped after {points} points: {reason} Check that the slip rate stays finite, "
        f"or use another method: --method {other}."
    )


# ----------------------------------------------------------------------
# Adaptive runs of smooth loops, with metrics at every point of the grid.

CHUNK = 4096  # largest number of steps per call of the solver
_FEWER = 16  # divisor of this number after the solver stops


def require_smooth(recorder: Recorder, method: str) -> None:
    """Reject a loop with a discontinuous or non-Lipschitz right-hand side, for which error control is not valid."""
    loop, remedy = recorder.loop, "Use a fixed step: method dormand-prince or rk4."
    text = f"method {method} requires a smooth loop. Received"
    if loop.sticks:
        raise ParameterError(
            f"{text} the plant {loop.plant_name}, whose friction is set-valued at rest. Use plant='printed', or "
            "method dormand-prince or rk4."
        )
    if type(recorder.scheme).rates is Scheme.rates:
        raise ParameterError(f"{text} the scheme {recorder.scheme.name}, with zero-order hold. {remedy}")
    if loop.controller is not None and not _lipschitz(loop):
        raise ParameterError(f"{text} the discontinuous law {loop.controller.name}. {remedy}")


def _lipschitz(loop: ClosedLoop) -> bool:
    """Whether the pressure and the integral rates of the law are Lipschitz: no sign function, no exponent below 1."""
    assert loop.controller is not None
    pressure, rates = law_expressions(loop.controller)
    parts = [node for expression in (pressure, *rates) for node in sp.preorder_traversal(expression)]
    powers = (node for node in parts if isinstance(node, SignedPower | AbsolutePower))
    jumps = any(isinstance(node, sp.sign | sp.Heaviside | sp.Piecewise) for node in parts)
    return not jumps and all(node.args[1] >= 1 for node in powers)


def scales(loop: ClosedLoop) -> list[float]:
    """Scales of x1 [m], x2 [m/s] and ξ, from target slip and natural frequency; 1 for integrals in other units."""
    fault = loop.fault
    slip, pace = fault.reference.target_slip, fault.natural_frequency
    converted = {"m s": slip / pace, "m s^2": slip / pace**2}
    units = loop.controller.integral_units if loop.controller else ()
    return [slip, slip * pace, *(converted.get(unit, 1.0) for unit in units)]


def smooth_march(
    recorder: Recorder,
    method: type[AdaptiveIntegrator],
    rtol: float,
    start: list[float],
    instants: list[int],
    progress: Callable[[float], None] | None = None,
) -> "np.ndarray":
    """Vectors at the step numbers `instants`, one per column, until the first step at which the run has diverged.

    Raises
    ------
    SimulationError
        If the solver stops without divergence.
    """
    pieces = cache(partial(_piece, recorder, method, rtol))
    stored, vector, columns, longest = set(instants), np.array(start), [np.array(start)], CHUNK
    while (now := recorder.parts(vector)).counter < instants[-1] and now.watched["diverged"] < 0:
        count, vectors = min(longest, instants[-1] - round(now.counter)), None
        while vectors is None:  # if the solver stops, retry with fewer steps
            try:
                vectors = pieces(count)(vector)
            except StoppedError as error:
                if count == 1:
                    raise SimulationError(
                        f"{method.name} stopped at t = {now.counter * recorder.step:.6g} s ({error}). "
                        "Increase rtol, or use a fixed step: method dormand-prince."
                    ) from None
                count = max(1, count // _FEWER)
        longest = min(longest, count)
        counters = recorder.parts(vectors).counter
        columns += [column for column, counter in zip(vectors.T, counters, strict=True) if round(counter) in stored]
        vector = vectors[:, -1]
        if progress:
            progress(counters[-1] / instants[-1])
    if recorder.parts(columns[-1]).counter != now.counter:
        columns.append(vector)
    return np.array(columns).T


def _piece(
    recorder: Recorder, method: type[AdaptiveIntegrator], rtol: float, count: int
) -> Callable[["np.ndarray"], "np.ndarray"]:
    """Function that maps a vector to the next `count` vectors, one per column. May raise `StoppedError`."""
    shares, works = np.arange(1, count + 1) / count, len(WORKS)
    flow = method.flow(field(recorder), scales(recorder.loop), shares, rtol=rtol, quadratures=works)
    symbols = [ca.SX.sym(n, size) for n, size in (("z", recorder.size), ("y", recorder.state_size), ("w", works))]
    watch = ca.Function("watch", symbols, [recorder.moved(*symbols)]).mapaccum("watch", count)
    factors, first, step = [float(factor) for factor in recorder.loop.factors], recorder.index(WORKS[0]), recorder.step

    def vectors(vector: "np.ndarray") -> "np.ndarray":
        now = recorder.parts(vector)
        states, done = flow.follow(now.counter * step, count * step, now.state, factors)
        return np.asarray(watch(vector, states, vector[first : first + works, None] + done).full())

    return vectors


def field(recorder: Recorder) -> ca.Function:
    """CasADi Function (t [s], state, factors) → time derivative of the state, integrands of `ClosedLoop.powers`."""
    time, state = ca.SX.sym("t"), ca.SX.sym("state", recorder.state_size)
    factors = ca.SX.sym("factors", len(recorder.loop.factors))
    loop = recorder.loop.with_factors(tuple(ca.vertsplit(factors)) if recorder.loop.factors else ())
    counter = time / recorder.step
    rates: Any = recorder.scheme.rates(loop, counter, state, recorder.step)
    pressure = recorder.scheme.pressure(loop, counter, state, recorder.step)
    return ca.Function("field", [time, state, factors], [rates, loop.powers(time, state[:2], pressure)])
