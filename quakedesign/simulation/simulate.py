"""Simulation of one closed loop; by default over the operation time, with the fault at rest initially."""

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
from quakedesign.loop.schemes import scheme_of_run
from quakedesign.loop.sensing import Sensor, Transducer
from quakedesign.simulation.closed_loop import Load, Variation
from quakedesign.simulation.earthquake import natural_peak
from quakedesign.simulation.integrators import RTOL, AdaptiveIntegrator, any_integrator, require_tolerance
from quakedesign.simulation.recorder import Recorder
from quakedesign.simulation.run_settings import (
    RunSetting,
    designed_path,
    loop_class,
    run,
    run_adaptive,
    sampled_scheme,
    with_aperiodic_clock,
)
from quakedesign.simulation.slow_sliding import PLANTS, simulate_sliding
from quakedesign.simulation.state_plant import PressurePath, SlidingVariation, Tide
from quakedesign.simulation.stick_slip import disturbed, simulate_state
from quakedesign.simulation.trajectory import OutcomeCriterion, Trajectory

_METHOD, _SAMPLES = "dormand-prince", 2000


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
    rtol: float = RTOL,
    checkpoint: str | Path | None = None,
    substeps: int = 1,
    actuator: Actuator | None = None,
    measurement: Sensor | Transducer | None = None,
    initial_slip: float = 0.0,
    initial_slip_rate: float = 0.0,
    tide: Tide | None = None,
) -> Trajectory:
    """Simulate a fault under a controller, with the fault's disturbance and reference; initially at rest by default.

    A fault with a friction state is initially in steady sliding at the first rate of its reference. It needs a sampled
    law that measures the slip alone, such as one from `design`. Only the parameters up to `progress`, and `plant`,
    `variation`, `actuator`, `measurement` (a `Transducer`) and `tide` apply; scheme and step are those of the law.

    Parameters
    ----------
    fault : Fault
    controller : Controller, optional
        None: no fluid is injected. A fault with a friction state is then loaded at its `operating_rate` from near
        steady sliding, and only `duration`, `samples`, `method` and `plant` apply; for others see `simulate_state`.
    step : float, optional
        Length of one step [s]; by default T_s of a sampled law, else of the fault.
    scheme : str or Scheme, optional
        Discretisation of the law, by name or as an instance, see `quakedesign.loop.schemes`. All but ``"continuous"``
        sample once per step, with a zero-order hold of the pressure. A sampled law can be run only with the scheme of
        its design; for other laws the default is ``"continuous"``.
    method : str
        Integrator with a fixed step, or, for the printed plant, ``"cvodes"`` or ``"idas"`` with an adaptive step; see
        `quakedesign.simulation.integrators`. The latter return the state at every multiple of `step`, where the run is
        recorded. Friction with a state is stiff: under a controller ``"cvodes"`` (default) or ``"idas"``; without one
        ``"radau"`` is the default.
    duration : float, optional
        [s]; the operation time unless given. Rounded down to whole steps, or up in controlled slow sliding.
    samples : int
        Approximate number of stored instants; metrics are computed from every step. For an uncontrolled fault with a
        friction state: number of equidistant instants, from which metrics are computed; if 2000, every solver step.
    settled_from : float, optional
        Time [s] from which errors are evaluated; by default a quarter of the shorter of operation time and duration.
    progress : callable, optional
        Called with the completed fraction of the run [-].
    compiled : bool, optional
        True: machine code or an error. False: CasADi's virtual machine. None: machine code for a long run if a C
        compiler works. Results are bitwise the same.
    plant : str, optional
        ``"stick-slip"``: friction holds the fault at rest, and it never slips backward (ERRATA 14). ``"printed"``: the
        paper's plant without stick, eq. shift continued to negative slip rates. With a friction state, which never
        rests: ``"smooth"`` or ``"quasi-dynamic"`` (without inertia). The first of each pair is the default.
    load : Load, optional
        Drift of the far end of the spring and a perturbation, in addition to the disturbance of the fault.
    variation : Variation or SlidingVariation, optional
        Ratios of the true to the nominal parameters, within the fault's box; `SlidingVariation` for friction with a
        state. All variations use the same compiled code.
    rtol : float
        Tolerance of ``"cvodes"`` and ``"idas"``, 1e-13 … 1e-3; not used with a fixed step.
    checkpoint : str or Path, optional
        File for the state of a long run with a fixed step. An interrupted run continues from it, with bitwise the same
        result; a finished run removes it.
    substeps : int
        Steps of the integrator per `step`, for a named sampled scheme.
    actuator : Actuator, optional
        Path from commanded pressure to fault pressure, for a named sampled scheme. By default the delay, lag and
        diffusion path for which a sampled law is designed, with the substeps that they need; with an `Actuator` without
        stages the pressure acts at once. With a friction state: stages that act once per sample, then a lag, a
        diffusion path or both. If the actuator has neither of these, the lag and diffusion path of the design apply.
    measurement : Measurement, Sensor or Transducer, optional
        Measurement noise, or a sensor that estimates signals from the slip alone, for a named sampled scheme. With a
        friction state: the transducer of the slip.
    initial_slip, initial_slip_rate : float
        Initial x1 [m] and x2 [m/s], not negative. The reference r is 0 at t = 0 in any case.
    tide : Tide, optional
        Shear stress on a fault whose friction has a state; none unless given.

    Returns
    -------
    Trajectory
        A `LoopTrajectory`; with a friction state a `SlidingRun`, or a `StateTrajectory` without a controller. A run
        that diverges ends there, with the time in `events` and with no metric but, at most, the peak slip rate.

    Raises
    ------
    ParameterError
        For a step, duration or number of samples that is not positive and finite, an unknown scheme, method or plant,
        an initial state that is negative, a variation outside the box, a sensor made for another step, an adaptive step
        with a checkpoint or a loop that is not smooth, or an argument that does not apply to the fault.
    SimulationError
        When `compiled` is True and no compiler works, when the loop has no finite value at the start, when the method
        fails, or when the checkpoint is that of another run.
    """

    def slid(fault: Fault) -> Trajectory:
        plant_name = plant or next(iter(PLANTS))
        require_known(plant_name, PLANTS, "plant of a fault with a state", UnknownNameError)
        wrong = {
            "compiled": compiled is not None,
            "load": load is not None,
            "variation": isinstance(variation, Variation),
            "rtol": rtol != RTOL,
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
        inapplicable = [name for name, given in wrong.items() if given]
        if controller is None:
            return _uncontrolled(fault, plant_name, method, duration, samples, inapplicable)
        law, path = _sampled_law(fault, controller, actuator, inapplicable)
        scheme_of_run(controller, scheme, step)
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
            inertia=PLANTS[plant_name],
            method="cvodes" if method == _METHOD else method,
            duration=duration,
            samples=samples,
            settled_from=settled_from,
            progress=progress or (lambda _: None),
        )

    def stepped(fault: Fault) -> Trajectory:
        if tide is not None or isinstance(variation, SlidingVariation) or isinstance(measurement, Transducer):
            raise ParameterError(
                "tide, SlidingVariation and Transducer apply only to friction with a state. Received "
                f"{fault.friction.name}. Use Load, Variation and Measurement instead."
            )
        require_tolerance(rtol)
        way, period, own = scheme_of_run(controller, scheme, step, "continuous")
        period, own = with_aperiodic_clock(controller, way, period, own)
        setting = RunSetting.of(fault, period, duration, samples, settled_from)
        if variation:
            variation.require_within(fault)
        factors = variation.values if variation else ()
        criterion = OutcomeCriterion.of(fault, natural_peak(fault))
        loop = loop_class(plant)(fault, controller, load=load or Load(), factors=factors)
        require_nonnegative(initial_slip=initial_slip, initial_slip_rate=initial_slip_rate)
        path, parts = designed_path(controller, actuator, substeps) if isinstance(way, str) else (actuator, substeps)
        chosen_scheme = sampled_scheme(way, parts, path, measurement, **own)
        recorder = Recorder(loop, chosen_scheme, setting.step, (float(initial_slip), float(initial_slip_rate)))
        chosen = any_integrator(method)
        if issubclass(chosen, AdaptiveIntegrator):
            return run_adaptive(
                recorder, setting, chosen, criterion, rtol=rtol, progress=progress, checkpoint=checkpoint
            )
        return run(recorder, setting, chosen, criterion, progress=progress, compiled=compiled, checkpoint=checkpoint)

    return by_equilibrium(rest=stepped, sliding=slid)(require_fault(fault))


def _uncontrolled(
    fault: Fault, plant: str, method: str, duration: float | None, samples: int, inapplicable: list[str]
) -> Trajectory:
    """Run without pressure, loaded at the operating rate of the friction, from near steady sliding."""
    if inapplicable:
        raise ParameterError(
            f"an uncontrolled fault with a friction state takes only duration, samples, method and plant. Received "
            f"{', '.join(inapplicable)}. Omit them, or use simulate_state for other loading, pressures and states."
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
    fault: Fault, controller: Controller, actuator: Actuator | None, inapplicable: list[str]
) -> tuple[Any, PressurePath]:
    """Sampled law of the slip alone, with its path; rejects arguments that do not apply to slow sliding."""
    if controller.of_slip is None or controller.sampling is None or inapplicable:
        raise ParameterError(
            "a fault with a friction state needs a sampled law that measures slip alone, as from design; it accepts "
            f"{', '.join(_OF_SLIDING)}, method, plant, actuator and measurement (a Transducer). "
            f"Received {', '.join(inapplicable) or repr(controller)} with {fault.friction.name}."
        )
    return controller, PressurePath.of(controller.sampling, actuator)
