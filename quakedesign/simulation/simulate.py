"""Simulation of one closed loop from rest over the whole task."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from quakedesign.errors import ParameterError, UnknownNameError, require_known
from quakedesign.fault import Fault, require_fault
from quakedesign.fault.equilibrium import by_equilibrium
from quakedesign.fault.model import require_nonnegative
from quakedesign.laws import Controller
from quakedesign.loop import Actuator, Scheme
from quakedesign.loop.schemes import own_way
from quakedesign.loop.sensing import Sensor, Transducer
from quakedesign.simulation.closed_loop import Load, Variation
from quakedesign.simulation.earthquake import natural_peak
from quakedesign.simulation.integrators import AdaptiveIntegrator, any_integrator, require_tolerance
from quakedesign.simulation.recorder import Recorder
from quakedesign.simulation.run_settings import (
    RunSetting,
    by_no_clock,
    loop_class,
    own_path,
    run,
    run_adaptive,
    sampled_scheme,
)
from quakedesign.simulation.slow_sliding import PLANTS, simulate_sliding
from quakedesign.simulation.state_plant import PressurePath, SlidingVariation, Tide
from quakedesign.simulation.stick_slip import disturbed, simulate_state
from quakedesign.simulation.trajectory import OutcomeCriterion, Trajectory

_METHOD, _RTOL, _SAMPLES = "dormand-prince", 1e-9, 2000


def simulate(
    fault: Fault,
    controller: Controller | None = None,
    *,
    step: float | None = None,
    scheme: str | Scheme | None = None,
    method: str = _METHOD,
    duration: float | None = None,
    samples: int = _SAMPLES,
    settled_from: float | None = None,
    progress: Callable[[float], None] | None = None,
    compiled: bool | None = None,
    plant: str | None = None,
    load: Load | None = None,
    variation: Variation | SlidingVariation | None = None,
    rtol: float = _RTOL,
    checkpoint: str | Path | None = None,
    substeps: int = 1,
    actuator: Actuator | None = None,
    measurement: Sensor | Transducer | None = None,
    initial_slip: float = 0.0,
    initial_slip_rate: float = 0.0,
    tide: Tide | None = None,
) -> Trajectory:
    """Simulate a fault under a controller, from rest by default, with the fault's own disturbance and reference.

    A fault whose friction has a state starts in steady sliding at the mean rate of its task and is held there by a law
    of samples that is told the slip alone, as `design` gives it, in its own scheme and step; of what stands below it
    takes the parameters up to `progress`, plant, variation, actuator, measurement (a transducer) and tide.

    Parameters
    ----------
    fault : Fault
    controller : Controller, optional
        None: no fluid is injected. Friction with a state is then loaded at its operating rate from near steady sliding,
        and takes `duration`, `samples`, `method` and `plant` alone; `simulate_state` has other loading and pressures.
    step : float, optional
        Length of one step [s]; that of a law of samples, or the fault's sampling time, unless given.
    scheme : str or Scheme, optional
        How the law is carried out over a step, by name, or set as wanted; see `quakedesign.loop.schemes`. All but
        ``"continuous"`` measure and decide once per step and hold the pressure in between. Unless given, that of a law
        of samples, which has no other, and ``"continuous"`` for others.
    method : str
        Integrator with a fixed step, or, for the printed plant, ``"cvodes"`` or ``"idas"`` with an adaptive step;
        see `quakedesign.simulation.integrators`. The latter answer at every multiple of `step`, where the run is
        watched. Friction with a state is stiff between samples: ``"cvodes"`` unless ``"idas"``.
    duration : float, optional
        [s]; the operation time unless given. Whole steps are taken, as many as fit.
    samples : int
        The trajectory keeps about this many instants; metrics are taken from every step.
    settled_from : float, optional
        Time [s] from which errors count; a quarter of the operation time, or of a shorter run.
    progress : callable, optional
        Called with the fraction done [-].
    compiled : bool, optional
        True: machine code or an error. False: CasADi's virtual machine. None: machine code if the run
        is long enough to be worth it and a C compiler works. The digits are the same.
    plant : str, optional
        ``"stick-slip"``: friction holds the fault at rest, and it never slips backward (ERRATA 14). ``"printed"``: eq.
        shift, continued to negative slip rates as in the paper. Of friction with a state, which never rests,
        ``"smooth"`` or ``"quasi-dynamic"``, without inertia. The first of each unless given.
    load : Load, optional
        Drift of the far end and a perturbation, beside the fault's own disturbance.
    variation : Variation or SlidingVariation, optional
        True parameters other than the nominal ones, within the fault's box. One machine code serves all variations.
        The latter of friction with a state.
    rtol : float
        Tolerance of ``"cvodes"`` and ``"idas"``, 1e-13 … 1e-3; a fixed step has none.
    checkpoint : str or Path, optional
        File that keeps the progress of a long run with a fixed step: an interrupted run goes on from it and ends with
        the digits of an uninterrupted one, which removes it.
    substeps : int
        Steps of the integrator per `step`, for a named scheme that samples.
    actuator : Actuator, optional
        What lies between the pressure that is asked for and that in the fault, for a named scheme that samples. Unless
        given, the delay, lag and rock for which a law of samples is designed, with the substeps that they need; an
        `Actuator` without stages brings the pressure to the fault at once. Of friction with a state stages that act
        once a sample, then a lag, rock, or both; those two which the law is designed for unless given.
    measurement : Measurement, Sensor or Transducer, optional
        Noise of what the controller sees, or a sensor that tells it estimates from the slip alone, for a named scheme
        that samples. Of friction with a state the transducer that the slip is read with.
    initial_slip, initial_slip_rate : float
        x1 [m] and x2 [m/s] at the start, zero or positive. The reference starts at zero all the same.
    tide : Tide, optional
        Shear stress on a fault whose friction has a state; none unless given.

    Returns
    -------
    Trajectory
        A `LoopTrajectory`; a `SlidingRun` of friction with a state, and a `StateTrajectory` without a controller.
        One that diverges ends there, says so in `events`, and has no metrics.

    Raises
    ------
    ParameterError
        For a step, duration or number of samples that is not positive and finite, an unknown scheme, method or plant,
        an initial state that is negative, a variation outside the box, a sensor made for another step, or a loop that
        is not smooth with a method that needs one.
    SimulationError
        When `compiled` is True and no compiler works, when the loop has no finite value at the start, when the method
        cannot go on, or when the checkpoint is that of another run.
    """

    def slid(fault: Fault) -> Trajectory:
        moved = plant or next(iter(PLANTS))
        require_known(moved, PLANTS, "plant of a fault with a state", UnknownNameError)
        wrong = {
            "compiled": compiled is not None,
            "load": load is not None,
            "variation": isinstance(variation, Variation),
            "rtol": rtol != _RTOL,
            "checkpoint": checkpoint is not None,
            "substeps": substeps != 1,
            "measurement": not isinstance(measurement, Transducer | None),
            "initial_slip": bool(initial_slip),
            "initial_slip_rate": bool(initial_slip_rate),
        }
        if controller is None:
            wrong |= {
                "step": step is not None,
                "scheme": scheme is not None,
                "settled_from": settled_from is not None,
                "variation": variation is not None,
                "actuator": actuator is not None,
                "measurement": measurement is not None,
                "tide": tide is not None,
            }
        refused = [name for name, given in wrong.items() if given]
        if controller is None:
            return _uncontrolled(fault, moved, method, duration, samples, refused)
        law, path = _sampled_law(fault, controller, actuator, refused)
        own_way(controller, scheme, step)
        return simulate_sliding(
            fault,
            law.of_slip,
            law.sampling.step,
            lag=path.lag,
            diffusion=path.diffusion,
            stages=path.stages,
            transducer=measurement if isinstance(measurement, Transducer) else None,
            variation=variation if isinstance(variation, SlidingVariation) else None,
            tide=tide,
            inertia=PLANTS[moved],
            method="cvodes" if method == _METHOD else method,
            duration=duration,
            samples=samples,
            settled_from=settled_from,
            progress=progress or (lambda _: None),
        )

    def stepped(fault: Fault) -> Trajectory:
        if tide is not None or isinstance(variation, SlidingVariation) or isinstance(measurement, Transducer):
            raise ParameterError(
                "a tide, a sliding variation and a transducer alone need friction with a state. Received "
                f"{fault.friction.name}. Give a load, a variation or a measurement."
            )
        require_tolerance(rtol)
        way, period, own = own_way(controller, scheme, step, "continuous")
        period, own = by_no_clock(controller, way, period, own)
        setting = RunSetting.of(fault, period, duration, samples, settled_from)
        if variation:
            variation.require_within(fault)
        factors = variation.values if variation else ()
        criterion = OutcomeCriterion.of(fault, natural_peak(fault))
        loop = loop_class(plant)(fault, controller, load=load or Load(), factors=factors)
        require_nonnegative(initial_slip=initial_slip, initial_slip_rate=initial_slip_rate)
        path, parts = own_path(controller, actuator, substeps) if isinstance(way, str) else (actuator, substeps)
        carried = sampled_scheme(way, parts, path, measurement, **own)
        recorder = Recorder(loop, carried, setting.step, (float(initial_slip), float(initial_slip_rate)))
        chosen = any_integrator(method)
        if issubclass(chosen, AdaptiveIntegrator):
            return run_adaptive(
                recorder, setting, chosen, criterion, rtol=rtol, progress=progress, checkpoint=checkpoint
            )
        return run(recorder, setting, chosen, criterion, progress=progress, compiled=compiled, checkpoint=checkpoint)

    return by_equilibrium(rest=stepped, sliding=slid)(require_fault(fault))


def _uncontrolled(
    fault: Fault, plant: str, method: str, duration: float | None, samples: int, refused: list[str]
) -> Trajectory:
    """Loaded at the operating rate of its friction, near steady sliding at first, under no pressure."""
    if refused:
        raise ParameterError(
            f"an uncontrolled fault whose friction has a state has a duration, samples, a method and a plant. Received "
            f"{', '.join(refused)}. Omit them, or use simulate_state for other loading, pressure and starting states."
        )
    whole = fault.reference.operation_time if duration is None else duration
    rate = fault.friction.operating_rate
    return simulate_state(
        fault,
        rate,
        duration=whole,
        **disturbed(fault, rate).settings,
        inertia=PLANTS[plant],
        method="radau" if method == _METHOD else method,
        times=None if samples == _SAMPLES else np.linspace(0, whole, samples),
    )


_OF_SLIDING = ("duration", "samples", "settled_from", "progress", "variation", "tide")


def _sampled_law(
    fault: Fault, controller: Controller, actuator: Actuator | None, refused: list[str]
) -> tuple[Any, PressurePath]:
    """Law of samples that measures the slip alone, with its path; refuses arguments that slow sliding does not have."""
    if controller.of_slip is None or controller.sampling is None or refused:
        raise ParameterError(
            f"friction with a state is held by a law of samples, as design gives it, with {', '.join(_OF_SLIDING)} (a "
            f"SlidingVariation), method, plant, actuator and a Transducer as measurement. Received "
            f"{', '.join(refused) or repr(controller)} with {fault.friction.name}."
        )
    return controller, PressurePath.of(controller.sampling, actuator)
