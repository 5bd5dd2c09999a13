"""What a fault with a state did without control: nucleation, event and arrest, and how often."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from quakedesign.fault import Fault
from quakedesign.fault.parameters import magnitude
from quakedesign.simulation.outcome import EARTHQUAKE_SHARE, Outcome
from quakedesign.simulation.state_trajectory import StateTrajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipEvent:
    """One event of a fault, as far as the run shows it.

    Attributes
    ----------
    nucleation : float or None
        Time [s] at which the slip rate last rose through the loading rate before the onset; None if it began above.
    onset : float
        Time [s] at which it rises through the `onset_rate` of the run.
    arrest : float or None
        Time [s] at which it falls below that again; None where the run ends before, as are the three last ones then.
    peak_slip_rate : float
        [m/s].
    slip : float or None
        From onset to arrest [m].
    moment : float or None
        GA times that slip [N·m].
    magnitude : float or None
        M_w of that moment [-].
    """

    nucleation: float | None
    onset: float
    arrest: float | None
    peak_slip_rate: float
    slip: float | None
    moment: float | None
    magnitude: float | None


def slip_events(fault: Fault, run: StateTrajectory, loading_rate: float) -> tuple[SlipEvent, ...]:
    """Every event of a run of a fault that was loaded at a rate [m/s] and returned at every step."""
    slips, arrests = run.event_slips, run.arrests
    ends = [*map(float, arrests), *[None] * (len(run.onsets) - len(arrests))]
    return tuple(
        _event(fault, run, loading_rate, float(onset), end, float(slips[i]) if i < len(slips) else None)
        for i, (onset, end) in enumerate(zip(run.onsets, ends, strict=True))
    )


def last_cycle(events: Sequence[SlipEvent]) -> dict[str, float | None]:
    """Recurrence interval [s], slip [m] and magnitude of the last one that is complete; None for none."""
    intervals = [later.onset - event.onset for event, later in pairwise(events)]
    whole = [event for event in events if event.arrest is not None]
    return {
        "recurrence_interval": intervals[-1] if intervals else None,
        "slip": whole[-1].slip if whole else None,
        "magnitude": whole[-1].magnitude if whole else None,
    }


def _event(
    fault: Fault, run: StateTrajectory, loading_rate: float, onset: float, arrest: float | None, slip: float | None
) -> SlipEvent:
    during = (run.time >= onset) & (run.time <= (np.inf if arrest is None else arrest))
    moment = None if slip is None else fault.moment_of(slip)
    return SlipEvent(
        nucleation=_last_rise(run, loading_rate, onset),
        onset=onset,
        arrest=arrest,
        peak_slip_rate=float(np.max(run.slip_rate[during], initial=run.onset_rate)),
        slip=slip,
        moment=moment,
        magnitude=None if moment is None else magnitude(moment),
    )


def _last_rise(run: StateTrajectory, rate: float, before: float) -> float | None:
    """Last time [s] before another at which the slip rate rises through a rate, by straight lines in its logarithm."""
    if rate <= 0:
        return None
    ahead = np.log(run.slip_rate[run.time <= before]) - np.log(rate)
    rises = np.flatnonzero((ahead[:-1] < 0) & (ahead[1:] >= 0))
    if not len(rises):
        return None
    i = rises[-1]
    return float(run.time[i] + (run.time[i + 1] - run.time[i]) * ahead[i] / (ahead[i] - ahead[i + 1]))


def direct_strength(fault: Fault) -> float:
    """aσ' [Pa]: what the strength of steady sliding gains at once when the slip rate grows e-fold."""
    law = fault.friction
    rate, state = law.operating_rate, law.steady_state(law.operating_rate)
    gain = law.coefficient(0, math.e * rate, *state) - law.coefficient(0, rate, *state)
    return float(gain) * fault.effective_normal_stress


def dynamic_rate(fault: Fault) -> float:
    """aσ'A/(η + √(km)) [m/s]: where damping and inertia take as much stress as the direct effect gives."""
    resisting = fault.damping + fault.mass * fault.natural_frequency
    return direct_strength(fault) * fault.area / resisting


def cycle_outcome(fault: Fault, run: StateTrajectory) -> Outcome:
    """``earthquake`` where a tenth of the `dynamic_rate` is reached, ``slow slip`` with an event, or else ``creep``."""
    peak = float(np.max(run.slip_rate))
    fast = peak >= EARTHQUAKE_SHARE * dynamic_rate(fault)
    kind = "earthquake" if fast else "slow slip" if peak >= run.onset_rate else "creep"
    return Outcome(kind=kind, peak_slip_rate=peak, share_of_natural=None)
