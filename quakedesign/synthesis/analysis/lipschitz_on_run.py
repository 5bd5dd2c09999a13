"""How finely a loop must be sampled for its premise on |h'| to hold on the run itself."""

from quakedesign.certificates.premises import Premise
from quakedesign.controllers import Controller
from quakedesign.fault import Fault
from quakedesign.simulation import Trajectory, simulate

_WINDOW = 4000
_FINEST = 1000.0
_HALVINGS = 6


def on_trajectory(lipschitz: float, run: Trajectory) -> Premise | None:
    """Largest |Δh/Δt| of a run against the certified bound; None for a run that diverged."""
    measured = run.metrics.max_h_rate
    if measured is None:
        return None
    return Premise(
        name="on_trajectory",
        required=measured,
        certified=lipschitz,
        unit="m/s^3",
        measured=True,
        note=f"largest |Δh/Δt| of the run, scheme {run.provenance['scheme']}, step {run.provenance['step']:g} s",
    )


def largest_sampling_time(fault: Fault, controller: Controller, lipschitz: float) -> float | None:
    """Largest T_s [s] for which a run stays inside |Δh/Δt| ≤ lipschitz, by bisection on a window of 4000 T_s.

    Measured on the first part of the task only, so an indication; None when even a thousandth of T_s does not do.
    """
    window = min(_WINDOW * fault.sampling_time, fault.reference.operation_time)

    def holds(step: float) -> bool:
        run = simulate(fault, controller, step=step, duration=window, samples=2)
        rate = run.metrics.max_h_rate
        return rate is not None and rate <= lipschitz

    high = fault.sampling_time
    if holds(high):
        return high
    low = high / 4
    while not holds(low):
        high, low = low, low / 4
        if low < fault.sampling_time / _FINEST:
            return None
    for _ in range(_HALVINGS):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if holds(middle) else (low, middle)
    return float(f"{low * 0.995:.2g}")
