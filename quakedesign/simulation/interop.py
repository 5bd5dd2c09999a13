"""Plants, laws and loops as CasADi functions and python-control systems.

The second chapter linearises about an equilibrium: state space, loop transfer function and stability margins.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import brentq, minimize_scalar

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, UnsupportedError, require_known
from quakedesign.fault import Fault, require_fault
from quakedesign.fault.model import require_finite
from quakedesign.laws import Controller, Sampling
from quakedesign.laws.sampled_controller import integral_symbols, law_expressions, r, r_acceleration, r_rate
from quakedesign.loop import Actuator, Delay, simulation_scheme
from quakedesign.loop.discrete_law import DiscreteLaw
from quakedesign.loop.loop_setup import IDEAL, LoopSetup, Quantity
from quakedesign.loop.schemes.base import control_step
from quakedesign.plant import uncertain_plant
from quakedesign.simulation.closed_loop import ClosedLoop, acceleration_with_parameters, casadi_function
from quakedesign.symbolic import plant
from quakedesign.symbolic.casadi_printer import to_numpy
from quakedesign.text import nearest_name, shown

# ----------------------------------------------------------------------
# The same plant and laws as CasADi Functions and as python-control systems.

_LAW_INPUTS = ("slip", "slip_rate", "r", "r_rate")


def to_casadi(fault: Fault, controller: Controller | None = None, *, parameters: Sequence[str] = ()) -> Any:
    """Return a CasADi Function of a fault, or of its closed loop.

    Parameters
    ----------
    fault : Fault
    controller : Controller, optional
    parameters : sequence of str, optional
        Free parameters of a fault without a controller: density [kg/m³], shear_modulus [Pa], damping [kg/s],
        effective_normal_stress [Pa] or a friction parameter such as ``critical_slip`` [m]. They form an additional
        input of the Function, for sensitivities and estimation.

    Returns
    -------
    casadi.Function
        Without a controller: (t [s], x = [x1 m, x2 m/s], p [Pa]) → dx, with `parameters` as a last input in their
        order. With one: (t [s], x = [x1, x2, ξ…]) → dx, p [Pa], h [m/s²], reference = [r m, r' m/s, r'' m/s²].

    Raises
    ------
    UnsupportedError
        For a sampled law.
    ParameterError
        For an unknown or repeated parameter, or for any parameter if a controller is given or friction has a state.
    """
    if parameters:
        return _free_plant(fault, controller, tuple(parameters))
    if controller is not None and controller.sampling_time is not None:
        raise UnsupportedError("a sampled law has no closed loop in continuous time. Use simulate, or export the law.")
    loop = ClosedLoop(fault, controller)
    if controller is None:
        return loop.plant
    time, state = ca.SX.sym("t"), ca.SX.sym("x", 2 + len(loop.integrals))
    reference = loop.reference(time)
    pressure, integral_rates = loop.law(state[:2], state[2:], reference)
    rates = ca.vertcat(loop.plant(time, state[:2], pressure), integral_rates)
    h, _ = loop.perturbation(time, state[:2], reference)
    return ca.Function(
        "closed_loop", [time, state], [rates, pressure, h, reference], ["t", "x"], ["dx", "p", "h", "reference"]
    )


def _free_plant(fault: Fault, controller: Controller | None, names: tuple[str, ...]) -> Any:
    """CasADi Function (t, x, p, parameters) → dx."""
    fault.require_memoryless("free parameters")
    available = (*plant.PARAMETERS, *fault.friction.quantities())
    if controller is not None:
        raise ParameterError(
            f"parameters apply only without a controller. Received the controller {controller.name}. Omit it."
        )
    for name in names:
        if name not in available or names.count(name) > 1:
            raise ParameterError(
                f"parameters must be distinct names out of {', '.join(available)}. Received {name!r}"
                f"{', twice' * (name in available)}.{'' if name in available else nearest_name(name, available)}"
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
        inputs ``slip`` [m], ``slip_rate`` [m/s], ``r`` [m], ``r_rate`` [m/s] and, with feed-forward of r'',
        ``r_acceleration`` [m/s²]; and the output ``p`` [Pa].

    Returns
    -------
    control.NonlinearIOSystem
        Nonlinear system, in discrete time with ``dt`` = T_s for a sampled law. `linearize` of a fault uses exact
        derivatives; at rest, those for forward slip.

    Raises
    ------
    ParameterError
        If `subject` is neither a fault nor a controller.
    UnsupportedError
        For a sampled law whose scheme uses the input gain of the fault or future values of the reference.
    """
    if isinstance(subject, Fault):
        return _fault_system(subject)
    if isinstance(subject, Controller):
        return _controller_system(subject)
    raise ParameterError(f"a Fault or a Controller is needed. Received {type(subject).__name__}.")


def _fault_system(fault: Fault) -> Any:
    import control

    field: Any = ClosedLoop(fault).plant
    inputs = [ca.SX.sym("t"), ca.SX.sym("x", 2), ca.SX.sym("p")]
    slopes: Any = ca.Function("slopes", inputs, [ca.jacobian(field(*inputs), v) for v in inputs[1:]])

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
    inputs = dict(zip(_LAW_INPUTS, (plant.x1, plant.x2, r, r_rate), strict=True))
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
    """Discrete-time system of a sampled law; states: of the law, memory of the scheme, and previous pressure."""
    import control

    scheme: Any = simulation_scheme(sampling.scheme, **{name: float(value) for name, value in sampling.settings})
    stepped, unknown = control_step(scheme.__class__, DiscreteLaw.of(controller, 0.0)), ca.SX.sym("unknown")
    own = [symbol.name for symbol in integral_symbols(controller)]
    names = [*own, *(f"memory_{i}" for i in range(len(scheme.initial_memory))), "held"]
    state, seen = ca.SX.sym("state", len(names)), ca.SX.sym("seen", len(_LAW_INPUTS))
    signals = [
        seen[:2],
        seen[:2] - seen[2:],
        *[unknown] * 3,
        float(sampling.step),
        scheme.authority or unknown,
        state[-1],
    ]
    numbers = ca.DM(stepped.numbers)
    pressure, after, memory, _ = stepped.function(
        ca.vertcat(*signals), state[: len(own)], numbers, state[len(own) : -1]
    )
    later = ca.vertcat(after, memory, pressure)
    if ca.depends_on(later, unknown):  # r'', future values of r and r', or B0
        raise UnsupportedError(
            "without the fault, the input gain and future values of the reference are unknown. Received a law whose "
            f"scheme, {sampling}, uses them. Use simulate, or export the law."
        )
    used = [i for i in range(len(names)) if ca.depends_on(later, state[i]) and not ca.is_equal(later[i], state[i])]
    fixed = [i for i in range(len(names)) if i not in used]
    starts = ca.DM([*[0.0] * len(own), *scheme.initial_memory, 0.0])
    later, pressure = ca.substitute([later[used], pressure], [state[fixed]], [ca.SX(starts[fixed])])
    step = ca.Function("step", [state[used], seen], [later, pressure])
    return control.NonlinearIOSystem(
        lambda t, x, u, _: step(x, u)[0].full().ravel(),
        lambda t, x, u, _: step(x, u)[1].full().ravel(),
        dt=float(sampling.step),
        name=controller.name,
        inputs=list(_LAW_INPUTS),
        outputs=["p"],
        states=[names[i] for i in used],
    )


# ----------------------------------------------------------------------
# Faults and loops about an equilibrium, as python-control's StateSpace.

_GAINS = np.exp(np.linspace(0, math.log(1e4), 1000)[1:])  # gain factors at which stability is tested
_FREQUENCIES = 5000
_LINEAR = 1e-9  # relative tolerance of the linearity test, 2 f(x) = f(2 x)


def resting_pressure(fault: Fault, slip: float) -> float:
    """Pressure [Pa] that keeps the nominal fault at rest at a slip [m] without disturbance (eq. shift at rest).

    Raises
    ------
    ParameterError
        For friction with a state.
    """
    fault.require_memoryless("a pressure at rest")
    law = fault.friction.exact()
    start, there = (float(law.extended(at, 0)) for at in (0, slip))
    load = start * fault.effective_normal_stress - fault.stiffness / fault.area * slip
    return fault.effective_normal_stress - load / there


def to_statespace(
    fault: Fault,
    at: float = 0.0,
    setup: LoopSetup = IDEAL,
    *,
    vertex: Sequence[str] = (),
    disturbance: bool = False,
    **given: Quantity | None,
) -> Any:
    """State space of a fault linearised about rest at a given slip, in series with the loop setup.

    Parameters
    ----------
    fault : Fault
    at : float
        Slip [m] of the equilibrium; the pressure is that of `resting_pressure`.
    setup : LoopSetup
        Step, delay, lag and diffusion path. With a step the plant is in discrete time, with a zero-order hold of the
        pressure; a delay needs a step.
    vertex : sequence of str, optional
        ``"low"``, ``"middle"`` or ``"high"`` for the slope in slip s, the damping w and the input gain, such as
        ``("high", "low", "high")``: a vertex of the ranges of `guarantee`, in place of the linearisation at a slip.
    disturbance : bool
        Add the disturbing acceleration [m/s²] as an input, constant over a step.
    **given : str, float or Fraction
        Fields of `LoopSetup` that replace those of `setup`, such as ``step="184 ms"``.

    Returns
    -------
    control.StateSpace
        In deviations from equilibrium: inputs ``p`` [Pa] and, if requested, ``disturbance`` [m/s²]; outputs and first
        states ``slip`` [m] and ``slip_rate`` [m/s]. At a kink of friction, the derivative for forward slip.

    Raises
    ------
    ParameterError
        For friction with a state, a slip that is not finite, a delay without a step, other fields of the loop setup, or
        a vertex that is not three ends of ranges.
    """
    import control

    require_finite(at=at)
    pressure = resting_pressure(require_fault(fault), at)
    setup = setup.with_given(**given)
    if unknown := setup.given().keys() - {"step", "delay", "lag", "diffusion"}:
        raise ParameterError(
            f"to_statespace takes only step, delay, lag and diffusion of the loop setup. Received "
            f"{', '.join(sorted(unknown))}. Omit these arguments."
        )
    if setup.delay and setup.step is None:
        raise ParameterError("delay requires discrete time. Received a delay without a step. Give step.")
    if vertex:
        A, B = _vertex(fault, tuple(vertex))
    else:
        linear = to_iosystem(fault).linearize([at, 0.0], [pressure])
        A, B = linear.A, linear.B
    seen, disturbances = ["slip", "slip_rate"], ["disturbance"] * disturbance
    before = Sampling(step=setup.step or Fraction(1), lag=setup.lag, diffusion=setup.diffusion)
    path = _linear(_flow_system(Actuator.meant_for(before)), ("p",))
    n = path.nstates
    A = np.block([[A, B @ path.C], [np.zeros((n, 2)), path.A]])
    B = np.column_stack([np.vstack([B @ path.D, path.B]), np.eye(2 + n)[:, [1] * disturbance]])
    states = [*seen, *(f"path{i + 1}" for i in range(n))]
    plant = control.ss(
        A, B, np.eye(2, 2 + n), np.zeros((2, B.shape[1])), name=fault.name, inputs=["p", *disturbances], outputs=seen,
        states=states,
    )  # fmt: skip
    return plant if setup.step is None else _discretised(plant, setup.step, setup.delay)


_ENDS = ("low", "middle", "high")


def _vertex(fault: Fault, ends: tuple[str, ...]) -> tuple[Any, Any]:
    """A and B at the given ends of the ranges of s, w and input gain."""
    if len(ends) != 3:
        raise ParameterError(
            "vertex must be three of low, middle and high, for slope, damping and input gain. "
            f"Received {len(ends)}: {', '.join(map(str, ends))}."
        )
    uncertain = uncertain_plant(fault)
    chosen = []
    for end, (low, high) in zip(ends, (uncertain.slip_chord, uncertain.rate_chord, uncertain.beta), strict=True):
        require_known(end, _ENDS, "end of a range")
        chosen.append(float((low, (low + high) / 2, high)[_ENDS.index(end)]))
    s, w, beta = chosen
    return np.array([[0.0, 1.0], [s, -w]]), np.array([[0.0], [beta * float(uncertain.authority)]])


def loop_transfer(fault: Fault, controller: Controller, at: float = 0.0, *, actuator: Actuator | None = None) -> Any:
    """Return the transfer function of the loop, opened at the commanded pressure, for Bode plots and margins.

    Parameters
    ----------
    fault : Fault
    controller : Controller
        A linear law, in the form that applies while the fault slips. A sampled law has a zero-order hold over T_s.
    at : float
        Slip [m] about which the fault is linearised.
    actuator : Actuator, optional
        Delay, lag and diffusion path between law and fault, as part of L. By default those for which a sampled law is
        designed; pass an `Actuator` without stages for none.

    Returns
    -------
    control.StateSpace
        L, from the pressure [Pa] at the actuator's input to the pressure commanded by the law, for negative feedback:
        the closed loop is ``control.feedback(L, 1)``. In discrete time for a sampled law.

    Raises
    ------
    UnsupportedError
        For a law that is not linear, or needs more than slip and slip rate; for a stage that is not linear, or that
        acts once per sample although the law is in continuous time.
    ParameterError
        As `to_statespace`.

    Notes
    -----
    Results from L hold for one linear plant only; `certify` and `guarantee` cover the whole uncertainty box.
    """
    import control

    law = _linear(to_iosystem(controller.while_moving), ("slip", "slip_rate"))
    late, flowing = _delay_and_stages(controller, actuator)
    plant, before = to_statespace(fault, at), _linear(_flow_system(flowing), ("p",))
    plant = plant * before if before.nstates else plant  # an actuator without states has gain 1
    if controller.sampling is not None:
        plant = _discretised(plant, controller.sampling.step, late)
    return control.ss(-law * plant, name=f"{controller.name} around {fault.name}", inputs=["p"], outputs=["commanded"])


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class LoopMargins:
    """Stability margins of one linear loop.

    Attributes
    ----------
    stable : bool
        Whether the closed loop is stable; if not, the values below are not margins.
    gain_reduction : float or None
        Largest factor below 1 on L at which stability changes [-]; None if there is none down to 1e-4.
    gain_margin : float or None
        Smallest factor above 1 on L at which stability changes [-]; None if there is none up to 1e4.
    phase_margin : float or None
        Smallest phase margin over all gain crossover frequencies [deg]; None if there is no crossover.
    modulus_margin : float
        min |1 + L| over all frequencies [-]: distance of the Nyquist curve from −1.
    """

    stable: bool
    gain_reduction: float | None
    gain_margin: float | None
    phase_margin: float | None
    modulus_margin: float


def loop_margins(loop: Any) -> LoopMargins:
    """Upper and lower gain margins, phase margin and modulus margin of a loop of `loop_transfer`.

    A discrete-time loop may lose stability at half the sampling frequency, z = −1, which
    ``control.stability_margins`` omits. Gain factors from 1e-4 to 1e4 are tested.

    Parameters
    ----------
    loop : control.StateSpace or control.TransferFunction
        L, with one input and one output and negative feedback.

    Raises
    ------
    ParameterError
        For another type, or for more than one input or output.
    """
    import control

    if not isinstance(loop, control.StateSpace | control.TransferFunction):
        raise ParameterError(
            f"loop must be a StateSpace or TransferFunction of python-control, as from loop_transfer. "
            f"Received {shown(loop)}."
        )
    if (loop.ninputs, loop.noutputs) != (1, 1):
        raise ParameterError(
            f"loop must have one input and one output. Received {loop.ninputs} and {loop.noutputs}. Select loop[i, j]."
        )

    def stable(factor: float) -> bool:
        poles = control.feedback(factor * loop, 1).poles()
        return bool(np.all(np.abs(poles) < 1) if loop.dt else np.all(poles.real < 0))

    response = _FrequencyResponse.of(loop)
    return LoopMargins(
        stable=stable(1.0),
        gain_reduction=_edge(stable, 1 / _GAINS),
        gain_margin=_edge(stable, _GAINS),
        phase_margin=response.phase_margin,
        modulus_margin=response.modulus_margin,
    )


def _edge(stable: Callable[[float], bool], factors: "np.ndarray") -> float | None:
    """First factor at which stability differs from that at factor 1, to 1e-12 relative; None if there is none."""
    nominal, inside = stable(1.0), 1.0
    for outside in factors:
        if stable(outside) != nominal:
            while abs(outside / inside - 1) > 1e-12:
                middle = math.sqrt(inside * outside)
                inside, outside = (middle, outside) if stable(middle) == nominal else (inside, middle)
            return float(outside)
        inside = outside
    return None


@dataclass(frozen=True)
class _FrequencyResponse:
    """L on the stability boundary s = jω or z = e^{jω}, ω ≤ π, on a grid of x = ln ω."""

    loop: Any
    grid: "np.ndarray"

    @classmethod
    def of(cls, loop: Any) -> "_FrequencyResponse":
        """Frequency response from far below the poles and zeros to far above them."""
        roots = np.concatenate([loop.poles(), loop.zeros()])
        sizes = np.abs(np.log(roots[np.abs(roots) > 1e-12]) if loop.dt else roots)
        logs = np.log(sizes[sizes > 1e-9 * np.max(sizes, initial=1.0)])
        ends = (np.min(logs, initial=0.0) - 7, math.log(math.pi) if loop.dt else np.max(logs, initial=0.0) + 7)
        return cls(loop, np.linspace(*ends, _FREQUENCIES))

    def at(self, x: Any) -> Any:
        """L at given x = ln ω."""
        return self.loop(np.exp(1j * np.exp(x)) if self.loop.dt else 1j * np.exp(x))

    @property
    def modulus_margin(self) -> float:
        """min |1 + L| [-]."""
        distances = np.abs(1 + self.at(self.grid))
        least = int(np.argmin(distances))
        ends = self.grid[max(least - 1, 0)], self.grid[min(least + 1, len(distances) - 1)]
        inside = minimize_scalar(lambda x: abs(1 + self.at(x)), bounds=ends, method="bounded", options={"xatol": 1e-10})
        return float(min(distances[least], inside.fun))

    @property
    def phase_margin(self) -> float | None:
        """Least angle [deg] between L and −1 where |L| is 1."""
        sizes = np.log(np.abs(self.at(self.grid)))
        spans = [(self.grid[i], self.grid[i + 1]) for i in np.flatnonzero(np.diff(np.sign(sizes))).tolist()]
        crossings = [brentq(lambda x: math.log(abs(self.at(x))), *span, xtol=1e-13) for span in spans]
        return min((abs(float(np.degrees(np.angle(-self.at(x))))) for x in crossings), default=None)


def _delay_and_stages(controller: Controller, actuator: Actuator | None) -> tuple[Fraction, Actuator]:
    """Delay [s] and continuous-time stages between a law and its fault."""
    own = controller.sampling
    if actuator is None:
        meant = Actuator() if own is None else Actuator.meant_for(replace(own, delay=Fraction(0)))
        return Fraction(0) if own is None else own.delay, meant
    late = [stage for stage in actuator.sampled if isinstance(stage, Delay) and not stage.jitter and own]
    if others := [stage.name for stage in actuator.sampled if stage not in late]:
        raise UnsupportedError(
            "a loop transfer function can contain a lag, a diffusion path and, for a sampled law, a delay without "
            f"jitter. Received {', '.join(others)}. Omit these stages, or use simulate."
        )
    periods = sum((stage.samples + Fraction(stage.part) for stage in late), Fraction(0))
    return periods * (own.step if own else 0), Actuator(stages=actuator.flowing)


def _flow_system(actuator: Actuator) -> Any:
    """Continuous-time stages from the zero-order hold's pressure ``p`` to the pressure in the fault."""
    import control

    numbers: list[Any] = [value for stage in actuator.flowing for value in stage.numbers]

    def flow(x: Any, u: Any) -> Any:
        return actuator.flow(numbers, list(x), u[0])

    return control.NonlinearIOSystem(
        lambda t, x, u, _: np.array(flow(x, u)[0]),
        lambda t, x, u, _: np.array([flow(x, u)[1]]),
        dt=0,
        name="actuator",
        inputs=["p"],
        outputs=["fault"],
        states=len(actuator.flow_start),
    )


def _discretised(plant: Any, step: Fraction, delay: Fraction) -> Any:
    """A plant sampled every step [s], with a zero-order hold of the pressure over a step after a delay [s].

    Exact: with a delay of m + f steps the pressure of m + 1 samples ago acts for f steps, then that of m samples ago.
    The delayed pressures are further states. Other inputs of the plant are constant over a step.
    """
    import control

    whole, part = divmod(delay, step)
    n, waiting = plant.nstates, int(whole) + (part > 0)
    early, late = (control.sample_system(plant, float(time), method="zoh") for time in (part or step, step - part))
    arriving = np.zeros((n, waiting + 1))  # effect of the present pressure, of that one sample ago, and so on
    arriving[:, int(whole)] = late.B[:, 0]
    A, B = np.zeros((n + waiting, n + waiting)), np.zeros((n + waiting, 1))
    A[:n, :n] = late.A
    if part:
        A[:n, :n], arriving[:, waiting] = late.A @ early.A, late.A @ early.B[:, 0]
    A[:n, n:], B[:n] = arriving[:, 1:], arriving[:, :1]
    A[n + 1 :, n:-1], B[n : n + 1] = np.eye(max(waiting - 1, 0)), 1.0
    C = np.column_stack([plant.C, np.zeros((plant.noutputs, waiting))])
    whole_step = control.sample_system(plant, float(step), method="zoh")
    B = np.column_stack([B, np.vstack([whole_step.B[:, 1:], np.zeros((waiting, plant.ninputs - 1))])])
    return control.ss(A, B, C, plant.D, float(step), inputs=plant.input_labels, outputs=plant.output_labels)


def _linear(system: Any, names: tuple[str, ...]) -> Any:
    """StateSpace of a linear system from its first inputs, given by name, to its outputs, found from unit vectors."""
    import control

    n, seen = system.nstates, system.ninputs

    def dynamics_and_outputs(z: Any) -> Any:
        return np.concatenate([system.dynamics(0.0, z[:n], z[n:]), system.output(0.0, z[:n], z[n:])])

    rest = dynamics_and_outputs(np.zeros(n + seen))
    units = np.eye(n + seen)
    once, twice = (
        np.column_stack([dynamics_and_outputs(factor * unit) - rest for unit in units]) for factor in (1.0, 2.0)
    )
    mixed = dynamics_and_outputs(units.sum(axis=0)) - rest
    size = np.abs(once).sum()
    straight = (
        np.abs(twice - 2 * once).max() <= _LINEAR * size and np.abs(mixed - once.sum(axis=1)).max() <= _LINEAR * size
    )
    if not straight:
        raise UnsupportedError(
            f"a loop transfer function needs a linear law and linear stages. Received {system.name}. Use simulate."
        )
    A, B, C, D = once[:n, :n], once[:n, n : n + len(names)], once[n:, :n], once[n:, n : n + len(names)]
    return control.ss(A, B, C, D, system.dt or 0, inputs=list(names), outputs=system.output_labels, name=system.name)
