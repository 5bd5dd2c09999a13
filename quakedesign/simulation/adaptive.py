"""Runs of smooth loops to a tolerance, watched at every instant of the grid as if each were a step."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import sympy as sp

from quakedesign.errors import ParameterError, SimulationError
from quakedesign.laws.sampled_controller import law_expressions
from quakedesign.loop import Scheme
from quakedesign.simulation.closed_loop import WORKS, ClosedLoop
from quakedesign.simulation.integrators import AdaptiveIntegrator, Flow, StoppedError
from quakedesign.simulation.recorder import Recorder
from quakedesign.symbolic import SignedPower
from quakedesign.symbolic.signed_power import AbsolutePower

CHUNK = 4096
_FEWER = 16


def require_smooth(recorder: Recorder, method: str) -> None:
    """Refuse a loop whose field jumps or has an infinite slope, where a tolerance means nothing."""
    loop, remedy = recorder.loop, "Use a fixed step: method dormand-prince or rk4."
    said = f"method {method} follows smooth loops only. Received"
    if loop.sticks:
        raise ParameterError(
            f"{said} the plant {loop.plant_name}, whose friction is set-valued. Use the plant printed, or method "
            "dormand-prince or rk4."
        )
    if type(recorder.scheme).rates is Scheme.rates:
        raise ParameterError(f"{said} the scheme {recorder.scheme.name}, which holds the pressure in steps. {remedy}")
    if loop.controller is not None and not _lipschitz(loop):
        raise ParameterError(f"{said} the discontinuous law {loop.controller.name}. {remedy}")


def _lipschitz(loop: ClosedLoop) -> bool:
    """Whether pressure and integral rates of the law have bounded slopes: no sign, no power below one."""
    assert loop.controller is not None
    pressure, rates = law_expressions(loop.controller)
    parts = [node for expression in (pressure, *rates) for node in sp.preorder_traversal(expression)]
    powers = (node for node in parts if isinstance(node, SignedPower | AbsolutePower))
    jumps = any(isinstance(node, sp.sign | sp.Heaviside | sp.Piecewise) for node in parts)
    return not jumps and all(node.args[1] >= 1 for node in powers)


def scales(loop: ClosedLoop) -> list[float]:
    """Size of x1 [m], x2 [m/s] and ξ: target slip and natural period, and 1 s of those for integrals in other units."""
    fault = loop.fault
    slip, pace = fault.reference.target_slip, fault.natural_frequency
    known = {"m s": slip / pace, "m s^2": slip / pace**2}
    units = loop.controller.integral_units if loop.controller else ()
    return [slip, slip * pace, *(known.get(unit, 1.0) for unit in units)]


@dataclass(frozen=True)
class SmoothMarch:
    """One run to a tolerance."""

    recorder: Recorder
    method: type[AdaptiveIntegrator]
    rtol: float

    def run(self, start: list[float], kept: list[int], progress: Callable[[float], None] | None = None) -> "np.ndarray":
        """Vectors at the kept steps, one a column; ends early after the first instant that counts as diverged.

        Raises
        ------
        SimulationError
            When the solver stops although nothing has diverged.
        """
        wanted, vector, found = set(kept), np.array(start), [np.array(start)]
        longest = CHUNK
        while (now := self.recorder.parts(vector)).counter < kept[-1] and now.watched["diverged"] < 0:
            vectors = self._chunk(vector, min(longest, kept[-1] - round(now.counter)))
            longest = min(longest, vectors.shape[1])
            counters = self.recorder.parts(vectors).counter
            found += [column for column, counter in zip(vectors.T, counters, strict=True) if round(counter) in wanted]
            vector = vectors[:, -1]
            if progress:
                progress(counters[-1] / kept[-1])
        if self.recorder.parts(found[-1]).counter != now.counter:
            found.append(vector)
        return np.array(found).T

    def _chunk(self, vector: "np.ndarray", count: int) -> "np.ndarray":
        """Vectors after each of the next steps; where the solver stops, of as many as it can take at once."""
        try:
            return self._pieces[count].vectors(vector)
        except StoppedError as error:
            if count > 1:
                return self._chunk(vector, max(1, count // _FEWER))
            time = self.recorder.parts(vector).counter * self.recorder.step
            raise SimulationError(
                f"{self.method.name} cannot go on after t = {time:.6g} s ({error}). "
                "Loosen rtol, or use a fixed step: method dormand-prince."
            ) from None

    @cached_property
    def _pieces(self) -> "_Pieces":
        return _Pieces(self)


class _Pieces(dict[int, "_Piece"]):
    """Solver and watching of a number of steps, built when first asked for."""

    def __init__(self, march: SmoothMarch) -> None:
        self.march = march

    def __missing__(self, count: int) -> "_Piece":
        self[count] = _Piece.of(self.march, count)
        return self[count]


@dataclass(frozen=True)
class _Piece:
    """A number of steps at once.

    Attributes
    ----------
    watch : casadi.Function
        (first vector, states and works at each instant) → vector at each.
    """

    recorder: Recorder
    flow: Flow
    watch: Any
    count: int

    @classmethod
    def of(cls, march: SmoothMarch, count: int) -> "_Piece":
        """Piece of a march."""
        recorder = march.recorder
        shares = np.arange(1, count + 1) / count
        sizes = scales(recorder.loop)
        flow = march.method.flow(field(recorder), sizes, shares, rtol=march.rtol, quadratures=len(WORKS))
        vector, state = ca.SX.sym("z", recorder.size), ca.SX.sym("state", recorder.state_size)
        done = ca.SX.sym("works", len(WORKS))
        follow = ca.Function("watch", [vector, state, done], [recorder.moved(vector, state, done)])
        return cls(recorder, flow, follow.mapaccum("watch", count), count)

    def vectors(self, vector: "np.ndarray") -> "np.ndarray":
        """Vector after each step, one a column; raises `StoppedError`."""
        recorder, step = self.recorder, self.recorder.step
        factors = [float(factor) for factor in recorder.loop.factors]
        now = recorder.parts(vector)
        states, works = self.flow.follow(now.counter * step, self.count * step, now.state, factors)
        first = recorder.index(WORKS[0])
        done = vector[first : first + len(WORKS), None] + works
        return np.asarray(self.watch(vector, states, done).full())


def field(recorder: Recorder) -> Any:
    """CasADi Function (t [s], state, factors) → its time derivative, works per unit mass and time."""
    time, state = ca.SX.sym("t"), ca.SX.sym("state", recorder.state_size)
    factors = ca.SX.sym("factors", len(recorder.loop.factors))
    loop = recorder.loop.with_factors(tuple(ca.vertsplit(factors)) if recorder.loop.factors else ())
    counter = time / recorder.step
    rates = recorder.scheme.rates(loop, counter, state, recorder.step)
    pressure = recorder.scheme.pressure(loop, counter, state, recorder.step)
    return ca.Function("field", [time, state, factors], [rates, loop.powers(time, state[:2], pressure)])
