"""Settings of a run, integration with a fixed or adaptive step, and the resulting trajectory."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import perf_counter
from typing import Any

import casadi as ca
import numpy as np

from quakedesign.errors import ParameterError, SimulationError, require_known, require_whole
from quakedesign.exact import rational
from quakedesign.fault import Fault, fault_toml
from quakedesign.files import Json
from quakedesign.laws import Controller
from quakedesign.loop import Actuator, Scheme, simulation_scheme
from quakedesign.loop.schemes.base import MOST_SUBSTEPS, AperiodicClock
from quakedesign.loop.sensing import Sensor
from quakedesign.simulation import stepping
from quakedesign.simulation.closed_loop import ClosedLoop, names
from quakedesign.simulation.compiled import STEP, prepare
from quakedesign.simulation.integrators import FLOOR, AdaptiveIntegrator, Integrator
from quakedesign.simulation.recorder import Recorder, events, metrics
from quakedesign.simulation.smooth_integration import require_smooth, smooth_march
from quakedesign.simulation.stepping import Advancer, Checkpoint, instants, march
from quakedesign.simulation.stick_slip_plant import StickSlipLoop
from quakedesign.simulation.trajectory import LoopTrajectory, OutcomeCriterion

# ----------------------------------------------------------------------
# Duration, step and output of a run.

MOST_STEPS = 10**10
_ALMOST_A_STEP = Fraction(1, 10**6)


@dataclass(frozen=True, slots=True)
class RunSetting:
    """Validated settings: step [s], number of steps, number of stored samples, time from which errors count [s]."""

    step: float
    steps: int
    samples: int
    settled_from: float

    @classmethod
    def of(
        cls, fault: Fault, step: float | None, duration: float | None, samples: int, settled_from: float | None
    ) -> "RunSetting":
        """Settings from the arguments of `simulate`, which lists the errors; None selects the default."""
        task = fault.reference.operation_time
        length = _positive("duration", task if duration is None else duration)
        pace = _positive("step", fault.sampling_time if step is None else step)
        steps = int(rational(length) / rational(pace) + _ALMOST_A_STEP)
        if not 1 <= steps <= MOST_STEPS:
            raise ParameterError(f"duration must be 1 to {MOST_STEPS:.0e} steps. Received {steps}. Change the step.")
        require_whole(1, samples=samples)
        start = min(task, length) / 4 if settled_from is None else settled_from
        if not 0 <= start < length:
            raise ParameterError(
                f"settled_from must be at least 0 s and less than the duration of {length!r} s. Received {start!r} s."
            )
        return cls(pace, steps, samples, float(start))


def _positive(name: str, value: float) -> float:
    if not (math.isfinite(value) and value > 0):
        raise ParameterError(f"{name} must be positive and finite. Received {value!r} s.")
    return float(value)


# ----------------------------------------------------------------------
# Trajectory from the stored vectors of a run.


def trajectory(
    recorder: Recorder,
    setting: RunSetting,
    vectors: np.ndarray,
    criterion: OutcomeCriterion,
    provenance: Json,
    began: tuple[float, float],
) -> LoopTrajectory:
    """Trajectory from the stored vectors before a divergence.

    Parameters
    ----------
    vectors : ndarray
        Vectors of the recorder, shape (length of a vector, number of instants).
    began : tuple of float
        Clock times [s] at the start of the preparation and of the stepping.

    Raises
    ------
    SimulationError
        If the initial values are not finite.
    """
    vector = ca.SX.sym("z", recorder.size)
    named = recorder.signals(vector)
    observe = ca.Function("observe", [vector], [recorder.observe(vector)])
    end = observe(vectors[:, -1]).full().ravel()
    watched, ended = recorder.watched(end), perf_counter()
    if watched["diverged"] >= 0:
        vectors = vectors[:, vectors[0] * setting.step < watched["diverged"]]
    if not vectors.size:
        raise SimulationError("the initial values of the loop are infinite or undefined: check the gains and the load")
    took = {"preparation_seconds": began[1] - began[0], "stepping_seconds": ended - began[1]}
    loop = recorder.loop
    measured = metrics(
        watched,
        controlled=loop.controller is not None,
        step=setting.step,
        steps=setting.steps,
        settled_from=setting.settled_from,
        seconds=ended - began[0],
        sticks=loop.sticks,
        further=recorder.scheme.described,
    )
    values = ca.Function("signals", [vector], list(named.values())).call([vectors])
    columns: dict[str, Any] = {name: value.full().ravel() for name, value in zip(named, values, strict=True)}
    if loop.controller is None:  # there is no reference to track
        columns |= dict.fromkeys(("reference", "reference_rate", "matched_perturbation"))
    columns["integrals"] = vectors[4 : 4 + len(loop.integrals)]
    described = recorder.scheme.described
    further = {name: (columns.pop(name), *description) for name, description in described.items()}
    return LoopTrajectory(
        **columns,
        actuation=further,
        moment_per_slip=loop.fault.shear_modulus * loop.fault.area,
        metrics=measured,
        energy=None if watched["diverged"] >= 0 else recorder.energy(end),
        events=events(watched),
        criterion=criterion,
        provenance=provenance | took | {"scenario": fault_toml(loop.fault)},
        integral_units=loop.controller.integral_units if loop.controller else (),
        name=f"{loop.fault.name}, {loop.controller.title if loop.controller else 'no control'}{loop.plant_title}",
    )


# ----------------------------------------------------------------------
# Run of a recorder's loop with a fixed step, or with an adaptive step to a tolerance.


def sampled_scheme(
    scheme: str | Scheme,
    substeps: int = 1,
    actuator: Actuator | None = None,
    measurement: Sensor | None = None,
    **numbers: Any,
) -> Scheme:
    """Scheme with its actuator and measurement, from the arguments of `simulate`.

    An actuator without stages and a measurement without noise are ignored, so that every scheme accepts them. `numbers`
    are the settings that a sampled law prescribes for its scheme, see `scheme_of_run`.

    Raises
    ------
    ParameterError
        For an unknown name, for settings that the scheme does not have, or for settings in addition to a `Scheme`.
    """
    settings: dict[str, Any] = numbers | ({"substeps": substeps} if substeps != 1 else {})
    settings |= {"actuator": actuator} if actuator is not None and actuator.stages else {}
    settings |= {"measurement": measurement} if measurement is not None and measurement.noisy else {}
    if isinstance(scheme, str):
        return simulation_scheme(scheme, **settings)
    if settings:
        raise ParameterError(
            f"a Scheme contains its settings. Received also {', '.join(settings)}. Set these in the scheme."
        )
    return scheme


def designed_path(
    controller: Controller | None, actuator: Actuator | None, substeps: int = 1
) -> tuple[Actuator | None, int]:
    """Actuator and substeps of a named scheme: the given actuator, else that for which a sampled law is designed."""
    sampling = controller.sampling if controller else None
    if actuator is not None or sampling is None:
        return actuator, substeps
    meant = Actuator.meant_for(sampling)
    return meant, max(substeps, min(meant.substeps(float(sampling.step)), MOST_SUBSTEPS))


def with_aperiodic_clock(
    controller: Controller | None, scheme: str | Scheme, step: float | None, numbers: dict[str, Any]
) -> tuple[float | None, dict[str, Any]]:
    """Step [s] and scheme settings of a run, adapted to the clock of aperiodic sampling.

    For aperiodic sampling `step` [s] is the shortest interval; the run uses an integer fraction of it. A `Scheme` keeps
    its clock; without a clock it samples periodically.
    """
    sampling = controller.sampling if controller else None
    clock = getattr(scheme, "clock", None)
    if sampling is None or step is None or not (sampling.longest or clock):
        return step, numbers
    if isinstance(scheme, str):
        clock = AperiodicClock.of(sampling.step, sampling.longest)
        numbers = numbers | {"clock": clock}
    return (step / clock.shortest if clock else step), numbers


STICK_SLIP, PRINTED = StickSlipLoop.plant_name, ClosedLoop.plant_name
_LOOPS: dict[str, type[ClosedLoop]] = {STICK_SLIP: StickSlipLoop, PRINTED: ClosedLoop}
_EARLIER = {"coulomb": STICK_SLIP, "smooth": PRINTED}  # names of version 0.3


def loop_class(plant: str | None) -> type[ClosedLoop]:
    """Closed loop with a named plant; the stick–slip plant for None.

    Raises
    ------
    ParameterError
        For an unknown name.
    """
    name = STICK_SLIP if plant is None else _EARLIER.get(plant, plant)
    require_known(name, _LOOPS, "plant")
    return _LOOPS[name]


def run(
    recorder: Recorder,
    setting: RunSetting,
    method: type[Integrator],
    criterion: OutcomeCriterion,
    *,
    progress: Callable[[float], None] | None = None,
    compiled: bool | None = None,
    checkpoint: str | Path | None = None,
) -> LoopTrajectory:
    """Trajectory of a recorder's loop with a fixed step; see `simulate`."""
    began = perf_counter()
    step, start = _step(recorder, method), recorder.start(setting.settled_from)
    stored = instants(setting.steps, setting.samples)
    file = Checkpoint.of(checkpoint, step, start, stored) if checkpoint else None
    steps = setting.steps * recorder.scheme.settings.get("substeps", 1)
    key = stepping.run_key(step, start, stored, compiled, steps)
    if file is None and (cached := stepping.recall_run(key)) is not None:
        (vectors, reported), ready = cached, perf_counter()
    else:
        backend = prepare(step, compiled, steps)
        ready = perf_counter()
        vectors = march(Advancer.of(backend, start), stored, recorder.index("diverged"), progress, file)
        reported = {"backend": backend.name, "backend_reason": backend.reason}
        stepping.store_run(key, vectors, reported)
    return trajectory(recorder, setting, vectors, criterion, _provenance(recorder, method) | reported, (began, ready))


def run_adaptive(
    recorder: Recorder,
    setting: RunSetting,
    method: type[AdaptiveIntegrator],
    criterion: OutcomeCriterion,
    *,
    rtol: float,
    progress: Callable[[float], None] | None = None,
    checkpoint: str | Path | None = None,
) -> LoopTrajectory:
    """Trajectory of a recorder's loop with an adaptive step, without a checkpoint; see `simulate`."""
    if checkpoint:
        raise ParameterError(f"a checkpoint needs a fixed step. Received method {method.name}. Use dormand-prince.")
    require_smooth(recorder, method.name)
    began = perf_counter()
    start, stored = recorder.start(setting.settled_from), instants(setting.steps, setting.samples)
    vectors = smooth_march(recorder, method, rtol, start, stored, progress)
    entries = {"backend": "sundials", "rtol": rtol, "floor": FLOOR}
    return trajectory(recorder, setting, vectors, criterion, _provenance(recorder, method) | entries, (began, began))


def _step(recorder: Recorder, method: type[Integrator]) -> ca.Function:
    """CasADi Function that advances the vector by one step."""
    before = ca.SX.sym("z", recorder.size)
    return ca.Function(STEP, [before], [recorder.advance(before, method)])


def _provenance(recorder: Recorder, method: type[Integrator] | type[AdaptiveIntegrator]) -> Json:
    controller, load = recorder.loop.controller, recorder.loop.load
    varied = {f"variation_{name}": value for name, value in zip(names(), recorder.loop.factors, strict=False)}
    loading: Json = {"drift": load.drift} if load.drift else {}
    loading |= {} if load.perturbation is None else {"perturbation": str(load.perturbation)}
    clock = getattr(recorder.scheme, "clock", None)
    if clock:
        loading |= {f"{end}_interval": getattr(clock, end) * recorder.step for end in ("shortest", "longest")}
    starts = zip(("initial_slip", "initial_slip_rate"), recorder.initial, strict=True)
    loading |= {name: value for name, value in starts if value}
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
        | loading
        | library_versions("casadi", "numpy", "quakedesign")
    )


def library_versions(*packages: str) -> dict[str, str]:
    """Installed version of each package, for the provenance."""
    return {f"version_{package}": _version(package) for package in packages}


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
