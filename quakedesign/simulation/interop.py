"""The same plant and laws as CasADi Functions and as python-control systems."""

from typing import Any

from quakedesign.controllers import Controller
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.fault import Fault
from quakedesign.loop.law_expressions import integral_symbols, law_expressions, r, r_acceleration, r_rate
from quakedesign.simulation.closed_loop import ClosedLoop
from quakedesign.symbolic import plant
from quakedesign.symbolic.casadi_printer import to_numpy


def to_casadi(fault: Fault, controller: Controller | None = None) -> Any:
    """Return a CasADi Function of a fault, or of its closed loop.

    Parameters
    ----------
    fault : Fault
    controller : Controller, optional

    Returns
    -------
    casadi.Function
        Without a controller: (t [s], x = [x1 m, x2 m/s], p [Pa]) → dx. With one:
        (t, x = [x1, x2, ξ…]) → dx, p, h [unit of ν], reference = [r m, r' m/s, r'' m/s²].

    Raises
    ------
    UnsupportedError
        For a law of samples.
    """
    import casadi as ca

    if controller is not None and controller.sampling_time is not None:
        raise UnsupportedError("a law of samples has no loop in continuous time. Use simulate, or export it.")
    loop = ClosedLoop(fault, controller)
    if controller is None:
        return loop.plant
    time, state = ca.SX.sym("t"), ca.SX.sym("x", 2 + len(loop.integrals))
    reference = loop.reference(time)
    pressure, integral_rates = loop.law(state[:2], state[2:], reference)
    rates = ca.vertcat(loop.plant(time, state[:2], pressure), integral_rates)
    h, _ = loop.perturbation(time, state[:2], reference)
    return ca.Function(
        "closed_loop",
        [time, state],
        [rates, pressure, h, reference],
        ["t", "x"],
        ["dx", "p", "h", "reference"],
    )


def to_iosystem(subject: Fault | Controller) -> Any:
    """Return a python-control system with named signals.

    Parameters
    ----------
    subject : Fault or Controller
        A fault has the input ``p`` [Pa] and the outputs ``slip`` [m] and ``slip_rate`` [m/s]. A controller has the
        inputs ``slip``, ``slip_rate``, ``r`` [m] and ``r_rate`` [m/s], with feed-forward of it also ``r_acceleration``
        [m/s²], and the output ``p``.

    Returns
    -------
    control.NonlinearIOSystem
        That of a fault is linearised by derivatives instead of differences, at rest on the side of forward slip.

    Raises
    ------
    ParameterError
        For anything else.

    Notes
    -----
    The system of a law of samples is one in discrete time, with ``dt`` its T_s.
    """
    if isinstance(subject, Fault):
        return _fault_system(subject)
    if isinstance(subject, Controller):
        return _controller_system(subject)
    raise ParameterError(f"a Fault or a Controller is needed. Received {type(subject).__name__}.")


def _fault_system(fault: Fault) -> Any:
    import casadi as ca
    import control

    field = ClosedLoop(fault).plant
    inputs = [ca.SX.sym("t"), ca.SX.sym("x", 2), ca.SX.sym("p")]
    slopes = ca.Function("slopes", inputs, [ca.jacobian(field(*inputs), v) for v in inputs[1:]])

    class FaultSystem(control.NonlinearIOSystem):
        def linearize(self, x0: Any, u0: Any = None, t: float = 0, *arguments: Any, **options: Any) -> Any:
            if isinstance(x0, control.OperatingPoint):
                x0, u0 = x0.states, x0.inputs if u0 is None else u0
            linear = super().linearize(x0, u0, t, *arguments, **options)
            exact = slopes(t, x0, 0 if u0 is None else u0)
            linear.A[:], linear.B[:] = (part.full() for part in exact)
            return linear

    return FaultSystem(
        lambda t, x, u, _: field(t, x, u[0]).full().ravel(),
        lambda t, x, u, _: x,
        name=fault.name,
        inputs=["p"],
        outputs=["slip", "slip_rate"],
        states=["slip", "slip_rate"],
    )


def _controller_system(controller: Controller) -> Any:
    import control
    import numpy as np

    symbols = integral_symbols(controller)
    pressure, rates = law_expressions(controller)
    inputs = {"slip": plant.x1, "slip_rate": plant.x2, "r": r, "r_rate": r_rate}
    if pressure.has(r_acceleration):
        inputs["r_acceleration"] = r_acceleration

    def values(expressions: Any, x: Any, u: Any) -> Any:
        given = dict(zip((*inputs.values(), *symbols), (*u, *x), strict=True))
        return np.array([float(value) for value in to_numpy(expressions, given)])

    def later(x: Any, u: Any) -> Any:
        found = values(rates, x, u)
        return found if controller.sampling_time is None else x + controller.sampling_time * found

    return control.NonlinearIOSystem(
        lambda t, x, u, _: later(x, u),
        lambda t, x, u, _: values([pressure], x, u),
        dt=controller.sampling_time or 0,
        name=controller.name,
        inputs=list(inputs),
        outputs=["p"],
        states=[symbol.name for symbol in symbols],
    )
