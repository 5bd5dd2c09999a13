"""Peak against tracking: what a design for the loop that runs gains in one by giving up the other."""

from dataclasses import dataclass
from fractions import Fraction
from math import pi

from quakedesign.certificates.guarantee import Guarantee, task_of
from quakedesign.fault import Fault
from quakedesign.simulation import Trajectory, simulate
from quakedesign.synthesis.guaranteed import design_held

ROOMS = (1.2, 1.4, 1.6, 2.2)
"""What tracking may spend of the smallest certified slip-rate error; 1.6 is that of the default."""
_PERIODS = 32  # natural periods of a run; errors count in its second half


@dataclass(frozen=True, slots=True, kw_only=True)
class FrontPoint:
    """One design.

    Attributes
    ----------
    objective : str
        ``peak``, or ``tracking`` with its room.
    guarantee : Guarantee
    run : Trajectory
        Under the fault's own disturbance, from rest.
    """

    objective: str
    guarantee: Guarantee
    run: Trajectory


def objective_front(fault: Fault, step: Fraction) -> tuple[FrontPoint, ...]:
    """Designs from the smallest certified peak to the best tracking, with a guarantee each.

    Parameters
    ----------
    fault : Fault
    step : Fraction
        T_s [s].
    """
    task = task_of(fault)
    designs = {"peak": design_held(task, step, objective="peak")}
    designs |= {f"tracking, {room:g} times the peak": design_held(task, step, room=room) for room in ROOMS}
    length = min(_PERIODS * 2 * pi / fault.natural_frequency, fault.reference.operation_time)
    return tuple(
        FrontPoint(
            objective=name,
            guarantee=claim,
            run=simulate(fault, claim.controller, duration=max(length, float(step)), settled_from=length / 2),
        )
        for name, claim in designs.items()
        if isinstance(claim, Guarantee)
    )
