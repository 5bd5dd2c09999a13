"""A recorder's loop, run with a fixed step or to a tolerance."""

from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import perf_counter
from typing import Any

import casadi as ca

from quakedesign.controllers import Controller
from quakedesign.errors import ParameterError, require_known
from quakedesign.loop.actuators import Actuator
from quakedesign.loop.schemes import Scheme, simulation_scheme
from quakedesign.loop.sensing import Sensor
from quakedesign.loop.steps.no_clock import NoClock
from quakedesign.loop.steps.sampled import MOST_SUBSTEPS
from quakedesign.simulation import kept_runs
from quakedesign.simulation.adaptive import SmoothMarch, require_smooth
from quakedesign.simulation.assembly import trajectory
from quakedesign.simulation.backend import STEP, prepare
from quakedesign.simulation.checkpoint import Checkpoint
from quakedesign.simulation.closed_loop import ClosedLoop
from quakedesign.simulation.coulomb import CoulombLoop
from quakedesign.simulation.integrators import AdaptiveIntegrator, Integrator
from quakedesign.simulation.integrators.adaptive import FLOOR
from quakedesign.simulation.outcome import OutcomeCriterion
from quakedesign.simulation.recorder import Recorder
from quakedesign.simulation.setting import Setting
from quakedesign.simulation.stepping import Advancer, instants, march
from quakedesign.simulation.trajectory import Trajectory
from quakedesign.simulation.variation import names


def sampled_scheme(
    scheme: str | Scheme,
    substeps: int = 1,
    actuator: Actuator | None = None,
    measurement: Sensor | None = None,
    **numbers: Any,
) -> Scheme:
    """Scheme with what lies around the controller, as `simulate` takes it.

    An actuator without stages and a measurement without noise are none, which every scheme takes. The numbers are those
    that a law of samples has for its scheme, see `own_way`.

    Raises
    ------
    ParameterError
        For an unknown name, for settings that the scheme does not have, or that are given beside a scheme.
    """
    settings: dict[str, Any] = numbers | ({"substeps": substeps} if substeps != 1 else {})
    settings |= {"actuator": actuator} if actuator is not None and actuator.stages else {}
    settings |= {"measurement": measurement} if measurement is not None and measurement.noisy else {}
    if isinstance(scheme, str):
        return simulation_scheme(scheme, **settings)
    if settings:
        raise ParameterError(
            f"a scheme that is no name has its own {', '.join(settings)}. Received both. Set them in the scheme."
        )
    return scheme


def own_path(
    controller: Controller | None, actuator: Actuator | None, substeps: int = 1
) -> tuple[Actuator | None, int]:
    """Actuator and substeps of a named scheme: as told, else what a law of samples is for, and what it needs."""
    sampling = controller.sampling if controller else None
    if actuator is not None or sampling is None:
        return actuator, substeps
    meant = Actuator.meant_for(sampling)
    return meant, max(substeps, min(meant.substeps(float(sampling.step)), MOST_SUBSTEPS))


def by_no_clock(
    controller: Controller | None, scheme: str | Scheme, step: float | None, numbers: dict[str, Any]
) -> tuple[float | None, dict[str, Any]]:
    """Step [s] and numbers of a run; of a law whose samples follow no clock a part of the shortest interval, and those.

    A scheme that is no name has its own intervals, or a clock.
    """
    sampling = controller.sampling if controller else None
    clock = getattr(scheme, "clock", None)
    if sampling is None or step is None or not (sampling.longest or clock):
        return step, numbers
    if isinstance(scheme, str):
        clock = NoClock.of(sampling.step, sampling.longest)
        numbers = numbers | {"clock": clock}
    return (step / clock.shortest if clock else step), numbers


def loop_class(plant: str) -> type[ClosedLoop]:
    """Closed loop with a named plant.

    Raises
    ------
    ParameterError
        When there is none of that name.
    """
    classes = {kind.plant_name: kind for kind in (ClosedLoop, CoulombLoop)}
    require_known(plant, classes, "plant")
    return classes[plant]


def run(
    recorder: Recorder,
    setting: Setting,
    method: type[Integrator],
    criterion: OutcomeCriterion,
    *,
    progress: Callable[[float], None] | None = None,
    compiled: bool | None = None,
    checkpoint: str | Path | None = None,
) -> Trajectory:
    """Trajectory of a recorder's loop with a fixed step; see `simulate`."""
    began = perf_counter()
    step, start = _step(recorder, method), recorder.start(setting.settled_from)
    wanted = instants(setting.steps, setting.samples)
    file = Checkpoint.of(checkpoint, step, start, wanted) if checkpoint else None
    steps = setting.steps * recorder.scheme.settings.get("substeps", 1)
    known = kept_runs.Question.of(step, start, wanted, compiled, steps)
    if file is None and (answer := known.recall()) is not None:
        kept, told, ready = answer.vectors, answer.told, perf_counter()
    else:
        backend = prepare(step, compiled, steps)
        ready = perf_counter()
        kept = march(Advancer.of(backend, start), wanted, recorder.index("diverged"), progress, file)
        told = {"backend": backend.name, "backend_reason": backend.reason}
        known.keep(kept_runs.Answer(kept, told))
    return trajectory(recorder, setting, kept, criterion, _provenance(recorder, method) | told, (began, ready))


def run_adaptive(
    recorder: Recorder,
    setting: Setting,
    method: type[AdaptiveIntegrator],
    criterion: OutcomeCriterion,
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
    return trajectory(recorder, setting, kept, criterion, _provenance(recorder, method) | told, (began, began))


def _step(recorder: Recorder, method: type[Integrator]) -> Any:
    """CasADi Function of the vector: one step."""
    before = ca.SX.sym("z", recorder.size)
    return ca.Function(STEP, [before], [recorder.advance(before, method)])


def _provenance(recorder: Recorder, method: type[Integrator] | type[AdaptiveIntegrator]) -> dict[str, Any]:
    controller, load = recorder.loop.controller, recorder.loop.load
    varied = {f"variation_{name}": value for name, value in zip(names(), recorder.loop.factors, strict=False)}
    pushed: dict[str, Any] = {"drift": load.drift} if load.drift else {}
    pushed |= {} if load.perturbation is None else {"perturbation": str(load.perturbation)}
    clock = getattr(recorder.scheme, "clock", None)
    if clock:
        pushed |= {f"{end}_interval": getattr(clock, end) * recorder.step for end in ("shortest", "longest")}
    starts = zip(("initial_slip", "initial_slip_rate"), recorder.initial, strict=True)
    pushed |= {name: value for name, value in starts if value}
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
