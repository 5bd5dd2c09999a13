"""Faults and loops about an equilibrium, as python-control's StateSpace."""

from typing import Any

import numpy as np

from quakedesign.controllers import Controller
from quakedesign.errors import UnsupportedError
from quakedesign.fault import Fault, require_fault
from quakedesign.fault.checks import require_finite
from quakedesign.simulation.interop import to_iosystem

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


def loop_transfer(fault: Fault, controller: Controller, at: float = 0.0) -> Any:
    """Return the transfer function of the loop, opened at the pressure, for Bode plots and margins.

    Parameters
    ----------
    fault : Fault
    controller : Controller
        A linear law, as it is while the fault moves. One of samples has a pressure that is held over its T_s.
    at : float
        Slip [m] about which the fault is linearised.

    Returns
    -------
    control.StateSpace
        L, from the pressure [Pa] at the fault to the pressure that the law asks for, with negative feedback: the
        closed loop is ``control.feedback(L, 1)``; in discrete time for a law of samples.

    Raises
    ------
    UnsupportedError
        For a law that is not linear, or needs more than slip and slip rate.
    ParameterError
        As `to_statespace`.

    Notes
    -----
    What is read off L is about one linear plant; `certify` and `guarantee` are about the whole box.
    """
    import control

    plant, law = to_statespace(fault, at), _linear(to_iosystem(controller.while_moving))
    if law.dt:
        plant = control.sample_system(plant, law.dt, method="zoh")
    return control.ss(-law * plant, name=f"{controller.name} around {fault.name}", inputs=["p"], outputs=["answer"])


def _linear(system: Any) -> Any:
    """StateSpace from slip and slip rate to pressure of a system whose answers are linear, read off unit vectors."""
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
    A, B, C, D = once[:n, :n], once[:n, n : n + 2], once[n:, :n], once[n:, n : n + 2]
    return control.ss(A, B, C, D, system.dt or 0, inputs=["slip", "slip_rate"], outputs=["p"], name=system.name)
