"""A law that is told estimates: the sensor, and whether its differentiator can follow."""

from quakedesign.certificates.premises import Premise
from quakedesign.controllers import Controller
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.simulation import simulate
from quakedesign.simulation.measurement import Measurement
from quakedesign.simulation.sensing import Differentiator, OutputFeedback, Transducer, joint_condition

WINDOW = 4000
DEVIATIONS = 4.0  # of normal noise that count as its bound


def sensor(step: float, noise: Measurement, bound: float | None, filter_order: int) -> Measurement | OutputFeedback:
    """What a law is told: exact or noisy states, or estimates from the noisy slip.

    Parameters
    ----------
    step : float
        Sampling period [s].
    noise : Measurement
    bound : float or None
        λ_d [m/s²] of a differentiator with n_d = 1; None for none.
    filter_order : int
        n_f of it.

    Raises
    ------
    ParameterError
        For noise of a slip rate that is not measured, or a filter without a differentiator.
    """
    if bound is None:
        if filter_order:
            raise ParameterError("a filter order belongs to a differentiator. Received no bound. Give both or neither.")
        return noise
    if noise.rate_noise:
        raise ParameterError(
            "with a differentiator the slip alone is measured. "
            f"Received rate noise {noise.rate_noise:g} m/s. Leave it out."
        )
    hardware = (Transducer(deviation=noise.slip_noise, seed=noise.seed),) if noise.noisy else ()
    differentiator = Differentiator(bound=bound, step=step, order=1, filter_order=filter_order)
    return OutputFeedback(stages=hardware, differentiator=differentiator)


def differentiator_premise(fault: Fault, law: Controller, seen: OutputFeedback, *, scheme: str = "explicit") -> Premise:
    """Whether λ_d exceeds what slip and law ask of it, jointly with the sampling period (ERRATA 21).

    The largest |x1''| comes from a run with exact states over 4000 sampling periods, n_d must be 1. The condition is
    sufficient for the differentiator to follow, not necessary for the loop to work.
    """
    differentiator = seen.differentiator
    noise = max((DEVIATIONS * s.deviation for s in seen.stages if isinstance(s, Transducer)), default=0.0)
    reached = largest_acceleration(fault, law, scheme=scheme, step=differentiator.step)
    found = joint_condition(fault, law, differentiator, acceleration=reached, noise=noise)
    return Premise(
        name="differentiator",
        required=found.required,
        certified=found.certified,
        unit="m/s^2",
        measured=True,
        note=f"λ_d against |x1''| <= {reached:.3g} m/s² with exact states and what the errors of the estimates, "
        f"{found.slip_error:.2g} m and {found.rate_error:.2g} m/s, add to it through the law",
    )


def largest_acceleration(fault: Fault, law: Controller, *, scheme: str, step: float) -> float:
    """Largest |Δx2|/T_s [m/s²] of the sampled loop with exact states over 4000 sampling periods."""
    import numpy as np

    window = min(WINDOW * step, fault.reference.operation_time)
    run = simulate(fault, law, scheme=scheme, step=step, duration=window, samples=WINDOW)
    return float(np.max(np.abs(np.diff(run.slip_rate)) / np.diff(run.time)))
