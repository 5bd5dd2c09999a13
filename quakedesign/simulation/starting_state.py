"""Where a fault with a state starts: in steady sliding, after a hold, or late in its cycle."""

import math
from dataclasses import dataclass
from typing import Any

from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.fault.checks import require_positive
from quakedesign.simulation.slip_events import direct_strength
from quakedesign.simulation.state_run import simulate_state
from quakedesign.simulation.state_trajectory import StateTrajectory
from quakedesign.symbolic import derive

_CYCLES = 3  # the first one depends on its start
_FIRST_LOADS, _MOST_LOADS = 10.0, 1000.0  # by which a strength aσ' is loaded, before a fault is taken to have no cycle
_OLDER = 1.5


@dataclass(frozen=True, slots=True, kw_only=True)
class StartingState:
    """Slip rate and state of friction at the start; the spring is stretched so that the forces are in balance.

    Attributes
    ----------
    slip_rate : float
        [m/s].
    state : tuple of float
        In the units of the law.
    """

    slip_rate: float
    state: tuple[float, ...]


def sliding(fault: Fault, rate: float) -> StartingState:
    """Steady sliding at a rate [m/s]."""
    return StartingState(slip_rate=rate, state=tuple(map(float, fault.friction.steady_state(rate))))


def locked(fault: Fault, rate: float, hold: float, **settings: Any) -> StartingState:
    """A fault that slid steadily at a rate [m/s] until the far end stopped, and has been held so for a time [s].

    `settings` are ``inertia, method, rtol`` of `simulate_state`.

    Raises
    ------
    ParameterError, SimulationError
    """
    require_positive(hold=hold)
    run = simulate_state(fault, [(hold, 0.0)], start_rate=rate, times=[hold], **settings)
    return StartingState(slip_rate=float(run.slip_rate[-1]), state=tuple(map(float, run.states[:, -1])))


def late_in_cycle(fault: Fault, rate: float, share: float, **settings: Any) -> StartingState:
    """A fault loaded at a rate [m/s] when a share of the time between the onsets of two of its events has passed.

    `settings` are ``inertia, method, rtol`` of `simulate_state`.

    Raises
    ------
    ParameterError
        Also for a fault that does not repeat its events.
    SimulationError
    """
    require_positive(loading_rate=rate)
    if not 0 <= share < 1:
        raise ParameterError(
            f"share of the cycle must be at least 0 and less than 1. Received {share!r}. Give 0.9, say."
        )
    if not derive(fault).unstable:
        raise ParameterError(
            f"late in the cycle needs a fault with repeated events. Received {fault.name}, which slides stably. "
            "Start it in steady sliding."
        )
    found = cycles(fault, rate, **settings)
    if len(found.onsets) < _CYCLES:
        raise ParameterError(
            f"late in the cycle needs a fault with repeated events. Received {fault.name}, with {len(found.onsets)} of "
            f"them in {found.time[-1]:.3g} s at {rate:.3g} m/s. Start it in steady sliding."
        )
    before, after = found.onsets[-2:]
    time = float(before + share * (after - before))
    run = simulate_state(
        fault, rate, duration=math.nextafter(time, math.inf), times=[time], **_disturbed(fault, rate), **settings
    )
    return StartingState(slip_rate=float(run.slip_rate[-1]), state=tuple(map(float, run.states[:, -1])))


def cycles(fault: Fault, rate: float, **settings: Any) -> StateTrajectory:
    """A fault loaded at a rate [m/s], near steady sliding at first, until it has repeated its events.

    One that does not ends after a thousand times the load of its direct effect, a stable one after ten. `settings` as
    in `locked`.
    """
    unit = direct_strength(fault) * fault.area / (fault.stiffness * rate)
    loads, most = _FIRST_LOADS, _MOST_LOADS if derive(fault).unstable else _FIRST_LOADS
    while True:
        run = simulate_state(fault, rate, duration=loads * unit, **_disturbed(fault, rate), **settings)
        loads *= 2
        if len(run.onsets) >= _CYCLES or loads > most:
            return run


def disturbed(fault: Fault, rate: float) -> StartingState:
    """Sliding at a rate [m/s] with a state that is older than steady."""
    return StartingState(slip_rate=rate, state=tuple(_OLDER * float(v) for v in fault.friction.steady_state(rate)))


def _disturbed(fault: Fault, rate: float) -> dict[str, Any]:
    start = disturbed(fault, rate)
    return {"start_rate": start.slip_rate, "start_state": start.state}
