"""A law that is told estimates: the sensor, and whether its differentiator can follow."""

import math
from dataclasses import replace

import numpy as np

from quakedesign.certificates.premises import Premise
from quakedesign.controllers import Controller
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.loop.sensing import (
    Averaging,
    Differentiator,
    JointCondition,
    OutputFeedback,
    SlipStage,
    Transducer,
    joint_condition,
)
from quakedesign.loop.sensing.measurement import Measurement
from quakedesign.simulation import simulate

WINDOW = 4000
DEVIATIONS = 4.0  # of normal noise that count as its bound


def sensor(
    step: float,
    noise: Measurement,
    bound: float | None,
    filter_order: int = 0,
    *,
    order: int = 1,
    bandwidth: float = math.inf,
    averaging: int = 1,
    quantum: float = 0.0,
    inner_steps: int = 1,
) -> Measurement | OutputFeedback:
    """What a law is told: exact or noisy states, or estimates from the noisy slip.

    Parameters
    ----------
    step : float
        Sampling period [s].
    noise : Measurement
    bound : float or None
        λ_d [m/s^(n_d + 1)] of a differentiator; None for none.
    filter_order : int
        n_f of it.
    order : int
        n_d of it.
    bandwidth : float
        Of the transducer [Hz].
    averaging : int
        Number of the latest readings whose mean the differentiator gets.
    quantum : float
        Steps in which the transducer reads [m]; 0 for none.
    inner_steps : int
        Of the differentiator for every reading.

    Raises
    ------
    ParameterError
        For noise of a slip rate that is not measured, or for what belongs to a differentiator without one.
    """
    if bound is None:
        given = {
            "differentiator order": order != 1,
            "filter order": filter_order != 0,
            "bandwidth": bandwidth != math.inf,
            "averaging": averaging != 1,
            "quantum of the slip": quantum != 0,
            "number of steps": inner_steps != 1,
        }
        for name in (name for name, there in given.items() if there):
            raise ParameterError(f"the {name} belongs to a differentiator. Received no bound. Give both or neither.")
        return noise
    if noise.rate_noise:
        raise ParameterError(
            "with a differentiator the slip alone is measured. "
            f"Received rate noise {noise.rate_noise:g} m/s. Leave it out."
        )
    transducer = Transducer(deviation=noise.slip_noise, bandwidth=bandwidth, quantum=quantum, seed=noise.seed)
    stages: list[SlipStage] = [transducer] if transducer.start or quantum else []
    stages += [Averaging(samples=averaging)] if averaging != 1 else []
    differentiator = Differentiator(
        bound=bound, step=step, order=order, filter_order=filter_order, inner_steps=inner_steps
    )
    return OutputFeedback(stages=tuple(stages), differentiator=differentiator)


def differentiator_premise(fault: Fault, law: Controller, seen: OutputFeedback, *, scheme: str = "explicit") -> Premise:
    """Whether λ_d exceeds what slip and law ask of it, jointly with the sampling period (ERRATA 21).

    The largest |x1''| comes from a run with exact states over 4000 sampling periods. The condition is sufficient for
    the differentiator to follow, not necessary for the loop to work. Where that run diverges, nothing is certified.
    With n_d of 2 or more a bound of the next derivative is needed, which no held pressure has: the requirement is
    infinite.
    """
    differentiator = seen.differentiator
    noise = max((DEVIATIONS * s.deviation for s in seen.stages if isinstance(s, Transducer)), default=0.0)
    reached, diverged = largest_acceleration(fault, law, scheme=scheme, step=differentiator.step)
    condition = joint_condition(fault, law, differentiator, acceleration=reached, noise=noise)
    premise = Premise(
        name="differentiator",
        required=condition.required,
        certified=condition.certified,
        unit=f"m/s^{differentiator.order + 1}",
        measured=True,
        note=_note(differentiator.order, reached, condition),
    )
    if diverged is None:
        return premise
    said = (
        f"the loop with exact states diverges at {diverged:.4g} s, so that no λ_d is enough; until then {premise.note}"
    )
    return replace(premise, certified=0.0, proved=False, note=said)


def _note(order: int, reached: float, condition: JointCondition) -> str:
    if order > 1:
        return f"no λ_d bounds derivative {order + 1} of the slip: its derivative 2 jumps wherever a held pressure does"
    return (
        f"λ_d against |x1''| <= {reached:.3g} m/s² with exact states and what the errors of the estimates, "
        f"{condition.slip_error:.2g} m and {condition.rate_error:.2g} m/s, add to it through the law"
    )


def largest_acceleration(fault: Fault, law: Controller, *, scheme: str, step: float) -> tuple[float, float | None]:
    """Largest |Δx2|/T_s [m/s²] of the sampled loop with exact states over 4000 sampling periods.

    The second entry is the time [s] of its divergence, after which nothing counts, or None.
    """
    window = min(WINDOW * step, fault.reference.operation_time)
    run = simulate(fault, law, scheme=scheme, step=step, duration=window, samples=WINDOW)
    steps = np.abs(np.diff(run.slip_rate)) / np.diff(run.time)
    return float(np.max(steps, initial=0.0)), run.events.get("diverged")
