"""Natural earthquake of an uncontrolled fault, and runs that end before their event.

For a run that ends before its event, the onset is extrapolated with the growth rate of the unstable eigenvalue.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from math import log, pi
from typing import Any

from quakedesign.errors import ParameterError, SimulationError
from quakedesign.fault import Disturbance, Fault
from quakedesign.files import Json
from quakedesign.loop import simulation_scheme
from quakedesign.simulation.integrators import integrator
from quakedesign.simulation.recorder import Recorder
from quakedesign.simulation.run_settings import RunSetting, loop_class, run
from quakedesign.simulation.trajectory import EARTHQUAKE_SHARE, LoopTrajectory, OutcomeCriterion, Trajectory
from quakedesign.symbolic import derive

# ----------------------------------------------------------------------
# Natural earthquake.

NUDGE = 1e-9  # relative to the largest friction drop: far above rounding errors, too small to affect the peak
FOLDINGS = 90
PERIODS = 100
ENDING = 30, 10  # e-foldings and natural periods: least duration if the growth rate is far above the natural frequency
FINENESS = 2e-3  # largest step, in units of 1/ω_n; a step across a kink of friction has an error of second order
STILL = 1e3  # least ratio of the peak to the slip rate due to `NUDGE` alone; below it no instability has developed

_PEAKS: dict[Fault, float | None] = {}
_MOST_PEAKS = 64


def natural_earthquake(
    fault: Fault,
    pressure: float = 0.0,
    *,
    progress: Callable[[float], None] | None = None,
    compiled: bool | None = None,
    plant: str | None = None,
) -> LoopTrajectory:
    """Simulate an uncontrolled fault under constant pressure.

    An unstable fault is set in motion by a constant acceleration, 1e-9 times that of the largest friction drop. Healing
    is set to zero, since this acceleration cannot release a healed fault. Acceleration and step are so small that the
    first six digits of the peak slip rate do not depend on them.

    Parameters
    ----------
    fault : Fault
        Its own disturbance is ignored.
    pressure : float
        Fluid pressure [Pa] for t ≥ 0: 0 for a natural earthquake, positive for an induced one.
    progress, compiled, plant
        As in `simulate`.

    Returns
    -------
    LoopTrajectory
        Over 90 e-foldings of the unstable eigenvalue, or 30 e-foldings and 10 natural periods if that is longer. For a
        stable fault, which stays at rest at pressure 0, over 100 natural periods. The step is at most 2e-3/ω_n. The
        only metrics are `peak_slip_rate`, `settled_from`, `steps`, `seconds` and `time_at_rest_fraction` (stick–slip).

    Raises
    ------
    ParameterError
        For friction with a state, or if |pressure| is not below the effective normal stress.
    SimulationError
        If the pressure is 0 and the fault is unstable but does not move.
    """
    fault.require_memoryless("the natural earthquake")
    if not abs(pressure) < fault.effective_normal_stress:
        raise ParameterError(
            f"pressure must be below the effective normal stress ({fault.effective_normal_stress!r} Pa) in absolute "
            f"value. Received {pressure!r} Pa. Reduce it."
        )
    growth = derive(fault).eigenvalues[0].real
    nudge = event_nudge(fault) if growth > 0 else 0.0
    law: Any = fault.friction  # without healing, since the nudge is too small for a release
    released = replace(fault, friction=replace(law, healing=0.0)) if law.rest_excess else fault
    nudged = released.with_disturbance(Disturbance(constant=nudge))
    step = min(fault.sampling_time, FINENESS / fault.natural_frequency)
    period = 2 * pi / fault.natural_frequency
    length = max(FOLDINGS / growth, ENDING[0] / growth + ENDING[1] * period) if growth > 0 else PERIODS * period
    setting = RunSetting.of(nudged, step, length, 2000, 0.0)
    recorder = Recorder(loop_class(plant)(nudged, None, pressure), simulation_scheme("continuous"), step)
    criterion = OutcomeCriterion.of(fault, natural_peak(fault) if pressure else None)
    earthquake = run(recorder, setting, integrator("dormand-prince"), criterion, progress=progress, compiled=compiled)
    if pressure:
        return earthquake
    natural = earthquake if growth <= 0 else _with_peak(earthquake, fault, growth)
    if recorder.loop.sticks:
        _PEAKS[_alone(fault)] = natural.criterion.natural_peak
        if len(_PEAKS) > _MOST_PEAKS:
            del _PEAKS[next(iter(_PEAKS))]
    return natural


def _with_peak(earthquake: LoopTrajectory, fault: Fault, growth: float) -> LoopTrajectory:
    """Run with its peak as criterion. Raises if only the small acceleration causes the peak."""
    peak = earthquake.metrics.peak_slip_rate  # None if the run diverges
    if peak is not None and peak <= STILL * event_nudge(fault) / growth:
        raise SimulationError(
            f"{fault.name} is unstable (eigenvalue {growth:.4g} 1/s), but it stays at rest in simulation: the peak is "
            f"{peak!r} m/s. The friction drop may be lost in rounding: check the parameters of the friction law."
        )
    return replace(earthquake, criterion=OutcomeCriterion.of(fault, peak))


def natural_peak(fault: Fault) -> float | None:
    """Peak slip rate [m/s] of the uncontrolled fault; None for a stable fault. The last 64 results are cached."""
    alone = _alone(fault)
    if alone not in _PEAKS:
        natural_earthquake(alone, compiled=False)
    return _PEAKS[alone]


def _alone(fault: Fault) -> Fault:
    """Fault reduced to the properties on which its natural earthquake depends."""
    longest = min(fault.reference.operation_time, 1e4 * fault.sampling_time)  # the result does not depend on the task
    task = replace(fault.reference, operation_time=longest)
    return replace(fault, reference=task).with_disturbance(Disturbance()).with_box("paper")


def event_nudge(fault: Fault) -> float:
    """Initiating acceleration [m/s²], 1e-9 times that of the largest friction drop."""
    low, high = fault.friction.bounds
    return NUDGE * (high - low) * fault.authority * fault.effective_normal_stress


# ----------------------------------------------------------------------
# Uncontrolled runs of unstable faults that end before the earthquake begins.

BEGUN_SHARE = 0.01
"""Fraction of the natural peak above which the slip rate no longer grows exponentially."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PendingEvent:
    """Expected event that has not begun by the end of the run."""

    growth: float  # Real part of the unstable eigenvalue [1/s]
    # Time [s] at which the slip rate would reach 10 % of the natural peak if it grew at `growth` after the end of the
    # run; None if the fault has not slipped forward
    onset: float | None

    def to_dict(self) -> Json:
        """Plain values in SI units."""
        return asdict(self)


def waiting(run: Trajectory, fault: Fault) -> PendingEvent | None:
    """Event that has not begun in an uncontrolled run; None if it has begun, or if none is expected."""
    natural, reached = run.natural_peak, run.outcome.share_of_natural
    if run.provenance["controller"] != "none" or natural is None or reached is None or reached >= BEGUN_SHARE:
        return None
    growth = derive(fault).eigenvalues[0].real
    speed = max(float(run.slip_rate[-1]), growth * float(run.slip[-1]))
    onset = float(run.time[-1]) + log(EARTHQUAKE_SHARE * natural / speed) / growth if speed > 0 else None
    return PendingEvent(growth=growth, onset=onset)
