"""One closed loop from rest over the whole task."""

from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import perf_counter
from typing import Any

from quakedesign.controllers import Controller
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault, require_fault
from quakedesign.simulation.actuators import Actuator
from quakedesign.simulation.adaptive import SmoothMarch, require_smooth
from quakedesign.simulation.assembly import trajectory
from quakedesign.simulation.backend import prepare
from quakedesign.simulation.checkpoint import Checkpoint
from quakedesign.simulation.closed_loop import ClosedLoop
from quakedesign.simulation.coulomb import CoulombLoop
from quakedesign.simulation.integrators import AdaptiveIntegrator, Integrator, any_integrator
from quakedesign.simulation.integrators.adaptive import FLOOR
from quakedesign.simulation.loading import Load
from quakedesign.simulation.measurement import Measurement
from quakedesign.simulation.recorder import Recorder
from quakedesign.simulation.schemes import Scheme, simulation_scheme
from quakedesign.simulation.sensing import Sensor
from quakedesign.simulation.setting import Setting
from quakedesign.simulation.stepping import Advancer, instants, march
from quakedesign.simulation.trajectory import Trajectory
from quakedesign.simulation.variation import Variation, names


def simulate(
    fault: Fault,
    controller: Controller | None = None,
    *,
    step: float | None = None,
    scheme: str | Scheme = "continuous",
    method: str = "dormand-prince",
    duration: float | None = None,
    samples: int = 2000,
    settled_from: float | None = None,
    progress: Callable[[float], None] | None = None,
    compiled: bool | None = None,
    plant: str = "smooth",
    load: Load | None = None,
    variation: Variation | None = None,
    rtol: float = 1e-9,
    checkpoint: str | Path | None = None,
    substeps: int = 1,
    actuator: Actuator | None = None,
    measurement: Measurement | Sensor | None = None,
) -> Trajectory:
    """Simulate a fault under a controller, from rest, with the fault's own disturbance and reference.

    Parameters
    ----------
    fault : Fault
    controller : Controller, optional
        None: no fluid is injected.
    step : float, optional
        Length of one step [s]; the fault's sampling time unless given.
    scheme : str or Scheme
        How the law is carried out over a step, by name, or set as wanted; see `quakedesign.simulation.schemes`. All but
        ``"continuous"`` measure and decide once per step and hold the pressure in between.
    method : str
        Integrator with a fixed step, or, for smooth loops, ``"cvodes"`` or ``"idas"`` with a step of its own choice;
        see `quakedesign.simulation.integrators`. The latter answer at every multiple of `step`, where the run is
        watched.
    duration : float, optional
        [s]; the operation time unless given. Whole steps are taken, as many as fit.
    samples : int
        The trajectory keeps about this many instants; metrics are taken from every step.
    settled_from : float, optional
        Time [s] from which errors count; a quarter of the operation time, or of a shorter run.
    progress : callable, optional
        Called with the fraction done [-].
    compiled : bool, optional
        True: machine code or an error. False: CasADi's virtual machine. None: machine code if a C compiler
        works. The digits are the same.
    plant : str
        ``"smooth"``: eq. shift, which holds for slip rates that are not negative. ``"coulomb"``: friction opposes slip
        in both directions and holds the fault at rest (ERRATA 14).
    load : Load, optional
        Drift of the far end and a perturbation, beside the fault's own disturbance.
    variation : Variation, optional
        True parameters other than the nominal ones, within the fault's box. One machine code serves all variations.
    rtol : float
        Tolerance of ``"cvodes"`` and ``"idas"``, 1e-13 … 1e-3; a fixed step has none.
    checkpoint : str or Path, optional
        File that keeps the progress of a long run with a fixed step: an interrupted run goes on from it and ends with
        the digits of an uninterrupted one, which removes it.
    substeps : int
        Steps of the integrator per `step`, for a named scheme that samples.
    actuator : Actuator, optional
        What lies between the pressure that is asked for and that in the fault, for a named scheme that samples.
    measurement : Measurement or Sensor, optional
        Noise of what the controller sees, or a sensor that tells it estimates from the slip alone, for a named scheme
        that samples.

    Returns
    -------
    Trajectory
        A `SampledTrajectory`, which has the signals of the actuator too, where there is one.
        One that diverges ends there, says so in `events`, and has no metrics.

    Raises
    ------
    ParameterError
        For a step, duration or number of samples that is not positive and finite, an unknown scheme, method or plant,
        a variation outside the box, a sensor made for another step, or a loop that is not smooth with a method that
        needs one.
    SimulationError
        When `compiled` is True and no compiler works, when the loop has no finite value at the start, when the method
        cannot go on, or when the checkpoint is that of another run.
    """
    require_fault(fault).require_memoryless("a controlled run")
    setting = Setting.of(fault, step, duration, samples, settled_from)
    if variation:
        variation.require_within(fault)
    factors = variation.values if variation else ()
    loop = loop_class(plant)(fault, controller, load=load or Load(), factors=factors)
    recorder = Recorder(loop, sampled_scheme(scheme, substeps, actuator, measurement), setting.step)
    chosen = any_integrator(method)
    if issubclass(chosen, AdaptiveIntegrator):
        return run_adaptive(recorder, setting, chosen, rtol=rtol, progress=progress, checkpoint=checkpoint)
    return run(recorder, setting, chosen, progress=progress, compiled=compiled, checkpoint=checkpoint)


def sampled_scheme(
    scheme: str | Scheme,
    substeps: int = 1,
    actuator: Actuator | None = None,
    measurement: Measurement | Sensor | None = None,
) -> Scheme:
    """Scheme with what lies around the controller, as `simulate` takes it.

    An actuator without stages and a measurement without noise are none, which every scheme takes.

    Raises
    ------
    ParameterError
        For an unknown name, for settings that the scheme does not have, or that are given beside a scheme.
    """
    settings: dict[str, Any] = {"substeps": substeps} if substeps != 1 else {}
    settings |= {"actuator": actuator} if actuator is not None and actuator.stages else {}
    settings |= {"measurement": measurement} if measurement is not None and measurement.noisy else {}
    if isinstance(scheme, str):
        return simulation_scheme(scheme, **settings)
    if settings:
        raise ParameterError(
            f"a scheme that is no name has its own {', '.join(settings)}. Received both. Set them in the scheme."
        )
    return scheme


def loop_class(plant: str) -> type[ClosedLoop]:
    """Closed loop with a named plant.

    Raises
    ------
    ParameterError
        When there is none of that name.
    """
    found = {kind.plant_name: kind for kind in (ClosedLoop, CoulombLoop)}
    if plant not in found:
        raise ParameterError(f"plant must be one of {', '.join(found)}. Received {plant!r}.")
    return found[plant]


def run(
    recorder: Recorder,
    setting: Setting,
    method: type[Integrator],
    *,
    progress: Callable[[float], None] | None = None,
    compiled: bool | None = None,
    checkpoint: str | Path | None = None,
) -> Trajectory:
    """Trajectory of a recorder's loop with a fixed step; see `simulate`."""
    began = perf_counter()
    step, start = _step(recorder, method), recorder.start(setting.settled_from)
    backend = prepare(step, compiled)
    ready = perf_counter()
    wanted = instants(setting.steps, setting.samples)
    file = Checkpoint.of(checkpoint, step, start, wanted) if checkpoint else None
    kept = march(Advancer.of(backend, start), wanted, recorder.index("diverged"), progress, file)
    told = {"backend": backend.name, "backend_reason": backend.reason}
    return trajectory(recorder, setting, kept, _provenance(recorder, method) | told, (began, ready))


def run_adaptive(
    recorder: Recorder,
    setting: Setting,
    method: type[AdaptiveIntegrator],
    *,
    rtol: float,
    progress: Callable[[float], None] | None = None,
    checkpoint: str | Path | None = None,
) -> Trajectory:
    """Trajectory of a recorder's loop to a tolerance; see `simulate`."""
    if checkpoint:
        raise ParameterError(f"a checkpoint needs a fixed step. Received method {method.name}. Use dormand-prince.")
    require_smooth(recorder, method.name)
    began = perf_counter()
    smooth = SmoothMarch(recorder, method, rtol)
    kept = smooth.run(recorder.start(setting.settled_from), instants(setting.steps, setting.samples), progress)
    told = {"backend": "sundials", "rtol": rtol, "floor": FLOOR}
    return trajectory(recorder, setting, kept, _provenance(recorder, method) | told, (began, began))


def _step(recorder: Recorder, method: type[Integrator]) -> Any:
    """CasADi Function of the vector: one step."""
    import casadi as ca

    before = ca.SX.sym("z", recorder.size)
    return ca.Function("step", [before], [recorder.advance(before, method)])


def _provenance(recorder: Recorder, method: type[Integrator] | type[AdaptiveIntegrator]) -> dict[str, Any]:
    controller, load = recorder.loop.controller, recorder.loop.load
    varied = {f"variation_{name}": value for name, value in zip(names(), recorder.loop.factors, strict=False)}
    pushed: dict[str, Any] = {"drift": load.drift} if load.drift else {}
    pushed |= {} if load.perturbation is None else {"perturbation": str(load.perturbation)}
    return (
        {
            "fault": recorder.loop.fault.name,
            "controller": controller.name if controller else "none",
            "method": method.name,
            "step": recorder.step,
            "scheme": recorder.scheme.name,
            "plant": recorder.loop.plant_name,
        }
        | recorder.scheme.settings
        | varied
        | pushed
        | library_versions("casadi", "numpy", "quakedesign")
    )


def library_versions(*packages: str) -> dict[str, str]:
    """Installed version of each package, as provenance."""
    return {f"version_{package}": _version(package) for package in packages}


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
