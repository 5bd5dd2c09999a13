"""What happens without control."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

from quakedesign.errors import ParameterError
from quakedesign.fault import Disturbance, Fault
from quakedesign.simulation.integrators import integrator
from quakedesign.simulation.outcome import OutcomeCriterion
from quakedesign.simulation.recorder import Recorder
from quakedesign.simulation.run import Setting, loop_class, run
from quakedesign.simulation.schemes import simulation_scheme
from quakedesign.simulation.trajectory import Trajectory
from quakedesign.symbolic import derive

NUDGE = 3.2e-15
FOLDINGS = 90
PERIODS = 100
FINENESS = 0.02


def natural_earthquake(
    fault: Fault,
    pressure: float = 0.0,
    *,
    progress: Callable[[float], None] | None = None,
    compiled: bool | None = None,
    plant: str = "smooth",
) -> Trajectory:
    """Let an uncontrolled fault go, under a constant acceleration of 3.2e-15 m/s² and a constant pressure.

    Parameters
    ----------
    fault : Fault
        Its own disturbance is replaced.
    pressure : float
        Fluid pressure [Pa] from t = 0 on: 0 for a natural, positive for an induced earthquake.
    progress, compiled, plant
        As in `simulate`.

    Returns
    -------
    Trajectory
        Over 90 e-foldings of the unstable eigenvalue, or 100 natural periods of a stable fault; steps of at most
        0.02/ω_n. Of the metrics only `peak_slip_rate`, `steps` and `seconds` are given.

    Raises
    ------
    ParameterError
        For a pressure that is not below the effective normal stress.
    """
    fault.require_memoryless("the natural earthquake")
    if not abs(pressure) < fault.effective_normal_stress:
        raise ParameterError(
            f"pressure must be below the effective normal stress ({fault.effective_normal_stress!r} Pa) in size. "
            f"Received {pressure!r} Pa."
        )
    nudged = fault.with_disturbance(Disturbance(constant=NUDGE))
    step = min(fault.sampling_time, FINENESS / fault.natural_frequency)
    setting = Setting.of(nudged, step, _duration(fault), 2000, 0.0)
    recorder = Recorder(loop_class(plant)(nudged, None, pressure), simulation_scheme("continuous"), step)
    criterion = OutcomeCriterion.of(fault, natural_peak(fault) if pressure else None)
    found = run(recorder, setting, integrator("dormand-prince"), criterion, progress=progress, compiled=compiled)
    if pressure or not derive(fault).unstable:
        return found
    return replace(found, criterion=OutcomeCriterion.of(fault, found.metrics.peak_slip_rate))


def natural_peak(fault: Fault) -> float | None:
    """Largest slip rate [m/s] of a fault without control; None for a stable one. Computed once for every fault."""
    return _peak(fault.with_disturbance(Disturbance()).with_box("paper"))


@lru_cache(maxsize=64)
def _peak(fault: Fault) -> float | None:
    return natural_earthquake(fault, compiled=False).criterion.natural_peak


def _duration(fault: Fault) -> float:
    """Time [s] in which an instability has grown from nothing and ended."""
    from math import pi

    growth = derive(fault).eigenvalues[0].real
    return FOLDINGS / growth if growth > 0 else PERIODS * 2 * pi / fault.natural_frequency
