"""What the figures of the paper need beside a comparison: the induced earthquake, and a closer look at every law."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import pi

import numpy as np

from quakedesign.fault import Fault
from quakedesign.simulation import Trajectory, natural_earthquake, simulate
from quakedesign.simulation.closed_loop import ClosedLoop
from quakedesign.studies import FrontPoint, objective_front
from quakedesign.studies.comparison import Compared

INDUCING_SHARE = 0.1
"""Constant pressure over σ'_n of the induced earthquake: 5 MPa on the paper's fault at 50 MPa."""
PERIODS = 16
"""Length of a close-up in natural periods."""


@dataclass(frozen=True, kw_only=True)
class PaperRuns:
    """Runs of all figures.

    Attributes
    ----------
    comparison : Compared
    induced : Trajectory or None
        Without control, under a constant pressure of a tenth of the effective normal stress; None for friction with a
        state, which has none of the short runs.
    close_ups : mapping of str to Trajectory
        By label of the entry: its first `PERIODS` natural periods with every step kept.
    front : tuple of FrontPoint
        Peak against tracking, where a law of samples was designed.
    """

    comparison: Compared
    induced: Trajectory | None
    close_ups: Mapping[str, Trajectory]
    front: tuple[FrontPoint, ...] = ()


def paper_runs(comparison: Compared, *, progress: Callable[[str, float], None] | None = None) -> PaperRuns:
    """Make the short runs that the figures of the paper need beside a comparison.

    Parameters
    ----------
    comparison : Compared
    progress : callable, optional
        Called with what is being done and the fraction done [-].

    Returns
    -------
    PaperRuns
    """
    tell, fault = progress or (lambda _what, _done: None), comparison.fault
    if fault.friction.state_names:
        return PaperRuns(comparison=comparison, induced=None, close_ups={})
    tell("induced earthquake", 0.0)
    induced = natural_earthquake(fault, INDUCING_SHARE * fault.effective_normal_stress)
    length = min(PERIODS * 2 * pi / fault.natural_frequency, fault.reference.operation_time)
    close_ups = {}
    for entry in comparison.entries:
        if entry.run is not None:
            tell(f"{entry.label}: close-up", 0.0)
            step = entry.run.provenance["step"]
            close_ups[entry.label] = simulate(
                fault,
                entry.design.controller,
                scheme=entry.run.provenance["scheme"],
                duration=max(length, step),
                step=step,
                samples=int(length / step) + 1,
            )
    laws = [entry.design.controller for entry in comparison.of("designed")]
    tell("peak against tracking", 0.0)
    steps = [law.sampling.step for law in laws if law and law.sampling and law.lipschitz_limit is None]
    front = objective_front(fault, steps[0]) if steps else ()
    return PaperRuns(comparison=comparison, induced=induced, close_ups=close_ups, front=front)


def friction_curve(fault: Fault, largest: float, points: int = 400) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Slips [m] up to the largest, the friction coefficient at rest there, and how the spring unloads from the first.

    Both curves [-] have shape (points,); the fault is unstable where friction falls faster than the spring unloads.
    """
    slips, coefficient = np.linspace(0, largest, points), ClosedLoop(fault).friction
    values = np.array([float(coefficient([slip, 0])) for slip in slips])
    unloading = fault.specific_stiffness / (fault.authority * fault.effective_normal_stress)
    return slips, values, values[0] - unloading * slips
