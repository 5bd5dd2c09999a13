"""Faults and loops about an equilibrium, as python-control's StateSpace."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from quakedesign.controllers import Controller
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.fault import Fault, require_fault
from quakedesign.fault.checks import require_finite
from quakedesign.loop.actuators import Actuator, Delay
from quakedesign.simulation.interop import to_iosystem
from quakedesign.text import shown

_GAINS = np.exp(np.linspace(0, math.log(1e4), 1000)[1:])  # factors among which the end of stability is looked for
_FREQUENCIES = 5000
_LINEAR = 1e-9  # relative difference of twice the answer and the answer to twice


def resting_pressure(fault: Fault, slip: float) -> float:
    """Pressure [Pa] at which the nominal fault rests at a slip [m] without disturbance (eq. shift at rest).

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


def to_statespace(fault: Fault, at: float = 0.0) -> Any:
    """Return the fault linearised about rest at a slip, held there by pressure.

    Parameters
    ----------
    fault : Fault
    at : float
        Slip [m] of the equilibrium; the pressure is that of `resting_pressure`.

    Returns
    -------
    control.StateSpace
        Of deviations: input ``p`` [Pa], outputs and states ``slip`` [m] and ``slip_rate`` [m/s]; on the side of
        forward slip where friction has a kink.

    Raises
    ------
    ParameterError
        For friction with a state, or a slip that is no number.
    """
    import control

    require_finite(at=at)
    pressure = resting_pressure(require_fault(fault), at)
    linear = to_iosystem(fault).linearize([at, 0.0], [pressure])
    seen = ["slip", "slip_rate"]
    return control.ss(linear, name=fault.name, inputs=["p"], outputs=seen, states=seen)


def loop_transfer(fault: Fault, controller: Controller, at: float = 0.0, *, actuator: Actuator | None = None) -> Any:
    """Return the transfer function of the loop, opened at the pressure, for Bode plots and margins.

    Parameters
    ----------
    fault : Fault
    controller : Controller
        A linear law, as it is while the fault moves. One of samples has a pressure that is held over its T_s.
    at : float
        Slip [m] about which the fault is linearised.
    actuator : Actuator, optional
        A delay, lag and rock between law and fault, which are in L; those for which a law of samples is designed unless
        given, and none of them for an `Actuator` without stages.

    Returns
    -------
    control.StateSpace
        L, from the pressure [Pa] that enters the actuator to the pressure that the law asks for, with negative
        feedback: the closed loop is ``control.feedback(L, 1)``; in discrete time for a law of samples.

    Raises
    ------
    UnsupportedError
        For a law that is not linear, or needs more than slip and slip rate; for a stage that is not linear, or acts
        once per sample around a law in continuous time.
    ParameterError
        As `to_statespace`.

    Notes
    -----
    What is read off L is about one linear plant; `certify` and `guarantee` are about the whole box.
    """
    import control

    law = _linear(to_iosystem(controller.while_moving), ("slip", "slip_rate"))
    late, flowing = _between(controller, actuator)
    plant = _series(to_statespace(fault, at), _linear(_flow_system(flowing), ("p",)))
    if controller.sampling is not None:
        plant = _held(plant, controller.sampling.step, late)
    return control.ss(-law * plant, name=f"{controller.name} around {fault.name}", inputs=["p"], outputs=["answer"])


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopMargins:
    """How far one linear loop is from instability.

    Attributes
    ----------
    stable : bool
        Of the closed loop; without it no number is a margin.
    gain_reduction : float or None
        Largest factor below 1 on L that destabilises [-], or of an unstable loop stabilises; None if none does.
    gain_margin : float or None
        Smallest factor above 1 on L that does [-]; None if none does.
    phase_margin : float or None
        Smallest over all crossings [deg].
    modulus_margin : float
        min |1 + L| over all frequencies [-]: distance of the Nyquist curve from −1.
    """

    stable: bool
    gain_reduction: float | None
    gain_margin: float | None
    phase_margin: float | None
    modulus_margin: float


def loop_margins(loop: Any) -> LoopMargins:
    """Return the margins of a loop as `loop_transfer` gives it, to either side.

    Stability of a loop in discrete time may be lost at half the sampling frequency, z = −1, where
    ``control.stability_margins`` does not look. Factors from 1e-4 to 1e4 are tried.

    Parameters
    ----------
    loop : control.StateSpace or control.TransferFunction
        L, with one input and one output and negative feedback.

    Raises
    ------
    ParameterError
        For anything else, such as a loop with more than one input or output.
    """
    import control

    if not isinstance(loop, control.StateSpace | control.TransferFunction):
        raise ParameterError(
            f"loop must be a StateSpace or TransferFunction of python-control. Received {shown(loop)}. "
            "Use loop_transfer."
        )
    if (loop.ninputs, loop.noutputs) != (1, 1):
        raise ParameterError(
            f"loop must have one input and one output. Received {loop.ninputs} and {loop.noutputs}. Choose one of each."
        )

    def stable(factor: float) -> bool:
        poles = control.feedback(factor * loop, 1).poles()
        return bool(np.all(np.abs(poles) < 1) if loop.dt else np.all(poles.real < 0))

    answers = _Answers.of(loop)
    return LoopMargins(
        stable=stable(1.0),
        gain_reduction=_edge(stable, 1 / _GAINS),
        gain_margin=_edge(stable, _GAINS),
        phase_margin=answers.phase_margin,
        modulus_margin=answers.modulus_margin,
    )


def _edge(stable: Callable[[float], bool], factors: "np.ndarray") -> float | None:
    """First factor where what is true of 1 is not, to one part in 10¹²; None if there is none."""
    at_once, inside = stable(1.0), 1.0
    for outside in factors:
        if stable(outside) != at_once:
            while abs(outside / inside - 1) > 1e-12:
                middle = math.sqrt(inside * outside)
                inside, outside = (middle, outside) if stable(middle) == at_once else (inside, middle)
            return float(outside)
        inside = outside
    return None


@dataclass(frozen=True)
class _Answers:
    """L along the edge of stability: x = ln ω of jω, or of e^{jω} up to half the sampling frequency."""

    loop: Any
    places: "np.ndarray"

    @classmethod
    def of(cls, loop: Any) -> "_Answers":
        """From frequencies far below its poles and zeros to far above."""
        roots = np.concatenate([loop.poles(), loop.zeros()])
        known = np.abs(np.log(roots[np.abs(roots) > 1e-12]) if loop.dt else roots)
        known = np.log(known[known > 1e-9 * np.max(known, initial=1.0)])
        ends = np.min(known, initial=0.0) - 7, math.log(math.pi) if loop.dt else np.max(known, initial=0.0) + 7
        return cls(loop, np.linspace(*ends, _FREQUENCIES))

    def at(self, places: Any) -> Any:
        """L there."""
        return self.loop(np.exp(1j * np.exp(places)) if self.loop.dt else 1j * np.exp(places))

    @property
    def modulus_margin(self) -> float:
        """min |1 + L| [-]."""
        found = np.abs(1 + self.at(self.places))
        least = int(np.argmin(found))
        ends = self.places[max(least - 1, 0)], self.places[min(least + 1, len(found) - 1)]
        inside = minimize_scalar(lambda x: abs(1 + self.at(x)), bounds=ends, method="bounded", options={"xatol": 1e-10})
        return float(min(found[least], inside.fun))

    @property
    def phase_margin(self) -> float | None:
        """Least angle [deg] between L and −1 where |L| is 1."""
        sizes = np.log(np.abs(self.at(self.places)))
        spans = [(self.places[i], self.places[i + 1]) for i in np.flatnonzero(np.diff(np.sign(sizes))).tolist()]
        crossings = [brentq(lambda x: math.log(abs(self.at(x))), *span, xtol=1e-13) for span in spans]
        return min((abs(float(np.degrees(np.angle(-self.at(x))))) for x in crossings), default=None)


def _between(controller: Controller, actuator: Actuator | None) -> tuple[Fraction, Actuator]:
    """Delay [s] and flowing stages between a law and its fault."""
    own = controller.sampling
    if actuator is None:
        meant = Actuator() if own is None else Actuator.meant_for(replace(own, delay=Fraction(0)))
        return Fraction(0) if own is None else own.delay, meant
    late = [stage for stage in actuator.sampled if isinstance(stage, Delay) and not stage.jitter and own]
    if others := [stage.name for stage in actuator.sampled if stage not in late]:
        raise UnsupportedError(
            "a loop transfer function has a lag, rock and, for a law of samples, a delay without jitter. Received "
            f"{', '.join(others)}. Leave them out, or simulate."
        )
    periods = sum((stage.samples + Fraction(stage.part) for stage in late), Fraction(0))
    return periods * (own.step if own else 0), Actuator(stages=actuator.flowing)


def _flow_system(actuator: Actuator) -> Any:
    """Flowing stages from the pressure that is held, ``p``, to that in the fault."""
    import control

    numbers = [value for stage in actuator.flowing for value in stage.numbers]

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


def _series(plant: Any, before: Any) -> Any:
    """A plant behind another, or alone behind one that lets everything pass at once."""
    return plant * before if before.nstates else plant


def _held(plant: Any, step: Fraction, delay: Fraction) -> Any:
    """A plant as it is seen every step [s] under a pressure that is held as long, from a delay [s] later on.

    Exact: with the delay m + f steps the held pressure of m + 1 samples ago acts for f steps, then that of m ago. Those
    that wait are further states.
    """
    import control

    whole, part = divmod(delay, step)
    n, waiting = plant.nstates, int(whole) + (part > 0)
    early, late = (control.sample_system(plant, float(time), method="zoh") for time in (part or step, step - part))
    arriving = np.zeros((n, waiting + 1))  # of the pressure of now, of one sample ago, and so on
    arriving[:, int(whole)] = late.B[:, 0]
    A, B = np.zeros((n + waiting, n + waiting)), np.zeros((n + waiting, 1))
    A[:n, :n] = late.A
    if part:
        A[:n, :n], arriving[:, waiting] = late.A @ early.A, late.A @ early.B[:, 0]
    A[:n, n:], B[:n] = arriving[:, 1:], arriving[:, :1]
    A[n + 1 :, n:-1], B[n : n + 1] = np.eye(max(waiting - 1, 0)), 1.0
    C = np.column_stack([plant.C, np.zeros((plant.noutputs, waiting))])
    return control.ss(A, B, C, plant.D, float(step), inputs=["p"], outputs=plant.output_labels)


def _linear(system: Any, names: tuple[str, ...]) -> Any:
    """StateSpace from the first inputs, named, to pressure of a system whose answers are linear, read off unit vectors.

    Raises
    ------
    UnsupportedError
    """
    import control

    n, seen = system.nstates, system.ninputs

    def answer(z: Any) -> Any:
        return np.concatenate([system.dynamics(0.0, z[:n], z[n:]), system.output(0.0, z[:n], z[n:])])

    rest = answer(np.zeros(n + seen))
    units = np.eye(n + seen)
    once, twice = (np.column_stack([answer(factor * unit) - rest for unit in units]) for factor in (1.0, 2.0))
    mixed = answer(units.sum(axis=0)) - rest
    size = np.abs(once).sum()
    straight = (
        np.abs(twice - 2 * once).max() <= _LINEAR * size and np.abs(mixed - once.sum(axis=1)).max() <= _LINEAR * size
    )
    if not straight:
        raise UnsupportedError(f"a loop transfer function needs a linear law. Received {system.name}. Simulate it.")
    A, B, C, D = once[:n, :n], once[:n, n : n + len(names)], once[n:, :n], once[n:, n : n + len(names)]
    return control.ss(A, B, C, D, system.dt or 0, inputs=list(names), outputs=system.output_labels, name=system.name)
