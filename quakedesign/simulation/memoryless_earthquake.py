"""What happens without control."""

from collections.abc import Callable
from dataclasses import replace
from math import pi

from quakedesign.errors import ParameterError, SimulationError
from quakedesign.fault import Disturbance, Fault
from quakedesign.loop.schemes import simulation_scheme
from quakedesign.simulation.integrators import integrator
from quakedesign.simulation.outcome import OutcomeCriterion
from quakedesign.simulation.recorder import Recorder
from quakedesign.simulation.run import loop_class, run
from quakedesign.simulation.setting import Setting
from quakedesign.simulation.trajectory import Trajectory
from quakedesign.symbolic import derive

NUDGE = 1e-9  # of the largest change of friction: far above rounding, far below what the peak depends on
FOLDINGS = 90
PERIODS = 100
ENDING = 30, 10  # e-foldings and natural periods, of a fault that grows much faster than it swings
FINENESS = 2e-3  # a step passes a kink of friction with an error of its square
STILL = 1e3  # times the slip rate that the nudge alone gives: less is no growth

_PEAKS: dict[Fault, float | None] = {}
_MOST_PEAKS = 64


def natural_earthquake(
    fault: Fault,
    pressure: float = 0.0,
    *,
    progress: Callable[[float], None] | None = None,
    compiled: bool | None = None,
    plant: str = "smooth",
) -> Trajectory:
    """Let an uncontrolled fault go, under a constant pressure and, if it is unstable, a tiny constant acceleration.

    The acceleration is a share of 1e-9 of the largest change of friction, and the step so short, that the peak of the
    slip rate depends on neither of them in its first six digits.

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
        Over 90 e-foldings of the unstable eigenvalue, or 30 of them and 10 natural periods if that is longer, or 100
        natural periods of a stable fault, which stays at rest; steps of at most 2e-3/ω_n. Of the metrics only
        `peak_slip_rate`, `steps` and `seconds` are given.

    Raises
    ------
    ParameterError
        For a pressure that is not below the effective normal stress.
    SimulationError
        When the fault is unstable and yet does not move.
    """
    fault.require_memoryless("the natural earthquake")
    if not abs(pressure) < fault.effective_normal_stress:
        raise ParameterError(
            f"pressure must be below the effective normal stress ({fault.effective_normal_stress!r} Pa) in size. "
            f"Received {pressure!r} Pa."
        )
    growth = derive(fault).eigenvalues[0].real
    nudge = _nudge(fault) if growth > 0 else 0.0
    nudged = fault.with_disturbance(Disturbance(constant=nudge))
    step = min(fault.sampling_time, FINENESS / fault.natural_frequency)
    setting = Setting.of(nudged, step, _duration(fault, growth), 2000, 0.0)
    recorder = Recorder(loop_class(plant)(nudged, None, pressure), simulation_scheme("continuous"), step)
    criterion = OutcomeCriterion.of(fault, natural_peak(fault) if pressure else None)
    earthquake = run(recorder, setting, integrator("dormand-prince"), criterion, progress=progress, compiled=compiled)
    if pressure:
        return earthquake
    natural = earthquake if growth <= 0 else _with_peak(earthquake, fault, growth)
    if plant == "smooth":
        _PEAKS[_alone(fault)] = natural.criterion.natural_peak
        if len(_PEAKS) > _MOST_PEAKS:
            del _PEAKS[next(iter(_PEAKS))]
    return natural


def _with_peak(earthquake: Trajectory, fault: Fault, growth: float) -> Trajectory:
    """Event of an unstable fault that is the measure of others, if it moves more than by the nudge alone."""
    peak = earthquake.metrics.peak_slip_rate  # none where the run diverges
    if peak is not None and peak <= STILL * _nudge(fault) / growth:
        raise SimulationError(
            f"{fault.name} is unstable (eigenvalue {growth:.4g} 1/s), but its simulation does not move: its peak is "
            f"{peak!r} m/s. Rounding may drown its friction; check the numbers of the law."
        )
    return replace(earthquake, criterion=OutcomeCriterion.of(fault, peak))


def natural_peak(fault: Fault) -> float | None:
    """Largest slip rate [m/s] of a fault without control; None for a stable one. Computed once for every fault."""
    alone = _alone(fault)
    if alone not in _PEAKS:
        natural_earthquake(alone, compiled=False)
    return _PEAKS[alone]


def _alone(fault: Fault) -> Fault:
    """Fault without what its natural earthquake does not depend on."""
    return fault.with_disturbance(Disturbance()).with_box("paper")


def _nudge(fault: Fault) -> float:
    """Acceleration [m/s²] that is small beside the forces of an event."""
    low, high = fault.friction.bounds
    return NUDGE * (high - low) * fault.authority * fault.effective_normal_stress


def _duration(fault: Fault, growth: float) -> float:
    """Time [s] in which an instability has grown from nothing and ended."""
    period = 2 * pi / fault.natural_frequency
    if growth <= 0:
        return PERIODS * period
    return max(FOLDINGS / growth, ENDING[0] / growth + ENDING[1] * period)
