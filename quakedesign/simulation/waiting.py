"""Uncontrolled runs of unstable faults that end before the earthquake begins."""

from dataclasses import asdict, dataclass
from math import log
from typing import Any

from quakedesign.fault import Fault
from quakedesign.simulation.outcome import EARTHQUAKE_SHARE
from quakedesign.simulation.trajectory import Trajectory
from quakedesign.symbolic import derive

BEGUN_SHARE = 0.01
"""Of the natural peak: a slip rate beyond it is no mere growth from rest any more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Waiting:
    """An event that has not begun.

    Attributes
    ----------
    growth : float
        Real part of the unstable eigenvalue [1/s].
    onset : float or None
        Time [s] at which the slip rate would reach 10 % of the natural peak, by growth at that rate from where the run
        ends; None for a fault that has not moved forward.
    """

    growth: float
    onset: float | None

    def to_dict(self) -> dict[str, Any]:
        """Plain values, SI."""
        return asdict(self)


def waiting(run: Trajectory, fault: Fault) -> Waiting | None:
    """What a run without control waits for; None where the event has begun, or there is none to come."""
    natural, reached = run.criterion.natural_peak, run.outcome.share_of_natural
    if run.provenance["controller"] != "none" or natural is None or reached is None or reached >= BEGUN_SHARE:
        return None
    growth = derive(fault).eigenvalues[0].real
    speed = max(float(run.slip_rate[-1]), growth * float(run.slip[-1]))
    onset = float(run.time[-1]) + log(EARTHQUAKE_SHARE * natural / speed) / growth if speed > 0 else None
    return Waiting(growth=growth, onset=onset)
