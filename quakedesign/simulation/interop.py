"""The same plant and laws as CasADi Functions and as python-control systems."""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from quakedesign.controllers import Controller, Sampling
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.fault import Fault
from quakedesign.loop.law_expressions import integral_symbols, law_expressions, r, r_acceleration, r_rate
from quakedesign.loop.schemes import simulation_scheme
from quakedesign.loop.steps.control_step import control_step
from quakedesign.loop.steps.discrete_law import Law
from quakedesign.simulation.closed_loop import ClosedLoop, acceleration_with_parameters, casadi_function
from quakedesign.symbolic import plant
from quakedesign.symbolic.casadi_printer import to_numpy
from quakedesign.text import nearest_name

_SEEN = ("slip", "slip_rate", "r", "r_rate")


def to_casadi(fault: Fault, controller: Controller | None = None, *, parameters: Sequence[str] = ()) -> Any:
    """Return a CasADi Function of a fault, or of its closed loop.

    Parameters
    ----------
    fault : Fault
    controller : Controller, optional
    parameters : sequence of str, optional
        Of a fault without a controller: density [kg/m³], shear_modulus [Pa], damping [kg/s], effective_normal_stress
        [Pa] or a quantity of its friction, such as ``critical_slip`` [m], that shall be free. They become one more
        input, for sensitivities and estimation.

    Returns
    -------
    casadi.Function
        Without a controller: (t [s], x = [x1 m, x2 m/s], p [Pa]) → dx, with `parameters` as a last input in their
        order. With one: (t, x = [x1, x2, ξ…]) → dx, p, h [unit of ν], reference = [r m, r' m/s, r'' m/s²].

    Raises
    ------
    UnsupportedError
        For a law of samples.
    ParameterError
        For a parameter that the fault has not, twice the same, or any beside a controller.
    """
    if parameters:
        return _free_plant(fault, controller, tuple(parameters))
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


def _free_plant(fault: Fault, controller: Controller | None, names: tuple[str, ...]) -> Any:
    """CasADi Function (t, x, p, parameters) → dx."""
    fault.require_memoryless("free parameters")
    known = (*plant.PARAMETERS, *fault.friction.quantities())
    if controller is not None:
        raise ParameterError("free parameters are those of a fault without a controller. Received one. Leave it out.")
    for name in names:
        if name not in known or names.count(name) > 1:
            raise ParameterError(
                f"parameters must be different ones of {', '.join(known)}. Received {name!r}"
                f"{', twice' if name in known else ''}.{nearest_name(name, known) if name not in known else ''}"
            )
    acceleration, symbols = acceleration_with_parameters(fault, names)
    inputs = {"t": [plant.t], "x": [plant.x1, plant.x2], "p": [plant.p], "parameters": symbols}
    return casadi_function("plant", inputs, {"dx": [plant.x2, acceleration]}, ClosedLoop(fault).shaking)


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
    import control

    field = ClosedLoop(fault).plant
    inputs = [ca.SX.sym("t"), ca.SX.sym("x", 2), ca.SX.sym("p")]
    slopes = ca.Function("slopes", inputs, [ca.jacobian(field(*inputs), v) for v in inputs[1:]])

    class FaultSystem(control.NonlinearIOSystem):  # type: ignore[misc]
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

    if controller.sampling is not None:
        return _sampled_system(controller, controller.sampling)
    symbols = integral_symbols(controller)
    pressure, rates = law_expressions(controller)
    inputs = dict(zip(_SEEN, (plant.x1, plant.x2, r, r_rate), strict=True))
    if pressure.has(r_acceleration):
        inputs["r_acceleration"] = r_acceleration

    def values(expressions: Any, x: Any, u: Any) -> Any:
        given = dict(zip((*inputs.values(), *symbols), (*u, *x), strict=True))
        return np.array([float(value) for value in to_numpy(expressions, given)])

    return control.NonlinearIOSystem(
        lambda t, x, u, _: values(rates, x, u),
        lambda t, x, u, _: values([pressure], x, u),
        dt=0,
        name=controller.name,
        inputs=list(inputs),
        outputs=["p"],
        states=[symbol.name for symbol in symbols],
    )


def _sampled_system(controller: Controller, sampling: Sampling) -> Any:
    """One step of the law's own scheme; states are the law's, and what the scheme keeps from one sample to the next."""
    import control

    scheme: Any = simulation_scheme(sampling.scheme, **{name: float(value) for name, value in sampling.settings})
    found, unknown = control_step(scheme.__class__, Law.of(controller, 0.0)), ca.SX.sym("unknown")
    own = [symbol.name for symbol in integral_symbols(controller)]
    names = [*own, *(f"memory_{i}" for i in range(len(scheme.starts))), "held"]
    state, seen = ca.SX.sym("state", len(names)), ca.SX.sym("seen", len(_SEEN))
    signals = [
        seen[:2],
        seen[:2] - seen[2:],
        *[unknown] * 3,
        float(sampling.step),
        scheme.authority or unknown,
        state[-1],
    ]
    numbers = ca.DM(found.numbers)
    pressure, after, kept, _ = found.function(ca.vertcat(*signals), state[: len(own)], numbers, state[len(own) : -1])
    later = ca.vertcat(after, kept, pressure)
    if ca.depends_on(later, unknown):  # r'', what r and r' will be, or B0
        raise UnsupportedError(
            "a system without a fault knows neither its input gain nor what comes next. Received a law for the scheme "
            f"{sampling}, which asks for them. Use simulate, or export it."
        )
    used = [i for i in range(len(names)) if ca.depends_on(later, state[i]) and not ca.is_equal(later[i], state[i])]
    fixed = [i for i in range(len(names)) if i not in used]
    starts = ca.DM([*[0.0] * len(own), *scheme.starts, 0.0])
    later, pressure = ca.substitute([later[used], pressure], [state[fixed]], [ca.SX(starts[fixed])])
    step = ca.Function("step", [state[used], seen], [later, pressure])
    return control.NonlinearIOSystem(
        lambda t, x, u, _: step(x, u)[0].full().ravel(),
        lambda t, x, u, _: step(x, u)[1].full().ravel(),
        dt=float(sampling.step),
        name=controller.name,
        inputs=list(_SEEN),
        outputs=["p"],
        states=[names[i] for i in used],
    )
