"""Adaptive runs of smooth loops, with metrics at every point of the grid."""

from collections.abc import Callable
from functools import cache, partial
from typing import Any

import casadi as ca
import numpy as np
import sympy as sp

from quakedesign.errors import ParameterError, SimulationError
from quakedesign.laws.sampled_controller import law_expressions
from quakedesign.loop import Scheme
from quakedesign.simulation.closed_loop import WORKS, ClosedLoop
from quakedesign.simulation.integrators import AdaptiveIntegrator, StoppedError
from quakedesign.simulation.recorder import Recorder
from quakedesign.symbolic import SignedPower
from quakedesign.symbolic.signed_power import AbsolutePower

CHUNK = 4096
_FEWER = 16


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
    known = {"m s": slip / pace, "m s^2": slip / pace**2}
    units = loop.controller.integral_units if loop.controller else ()
    return [slip, slip * pace, *(known.get(unit, 1.0) for unit in units)]


def smooth_march(
    recorder: Recorder,
    method: type[AdaptiveIntegrator],
    rtol: float,
    start: list[float],
    kept: list[int],
    progress: Callable[[float], None] | None = None,
) -> "np.ndarray":
    """Vectors at the step numbers `kept`, one per column, until the first step at which the run has diverged.

    Raises
    ------
    SimulationError
        If the solver stops without divergence.
    """
    pieces = cache(partial(_piece, recorder, method, rtol))
    wanted, vector, found, longest = set(kept), np.array(start), [np.array(start)], CHUNK
    while (now := recorder.parts(vector)).counter < kept[-1] and now.watched["diverged"] < 0:
        count, vectors = min(longest, kept[-1] - round(now.counter)), None
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
        found += [column for column, counter in zip(vectors.T, counters, strict=True) if round(counter) in wanted]
        vector = vectors[:, -1]
        if progress:
            progress(counters[-1] / kept[-1])
    if recorder.parts(found[-1]).counter != now.counter:
        found.append(vector)
    return np.array(found).T


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
