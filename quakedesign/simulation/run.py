"""One closed loop from rest over the whole task."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from importlib.metadata import PackageNotFoundError, version
from time import perf_counter
from typing import Any

from quakedesign.controllers import Controller
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.simulation.backend import Backend, prepare
from quakedesign.simulation.closed_loop import ClosedLoop
from quakedesign.simulation.coulomb import CoulombLoop
from quakedesign.simulation.integrators import Integrator, integrator
from quakedesign.simulation.metrics import events, metrics
from quakedesign.simulation.recorder import START, Recorder
from quakedesign.simulation.schemes import simulation_scheme
from quakedesign.simulation.stepping import Advancer, instants, march
from quakedesign.simulation.trajectory import Trajectory

MOST_STEPS = 10**10
_ALMOST_A_STEP = Fraction(1, 10**6)


def simulate(
    fault: Fault,
    controller: Controller | None = None,
    *,
    step: float | None = None,
    scheme: str = "continuous",
    method: str = "dormand-prince",
    duration: float | None = None,
    samples: int = 2000,
    settled_from: float | None = None,
    progress: Callable[[float], None] | None = None,
    compiled: bool | None = None,
    plant: str = "smooth",
) -> Trajectory:
    """Simulate a fault under a controller, from rest, with the fault's own disturbance and reference.

    Parameters
    ----------
    fault : Fault
    controller : Controller, optional
        None: no fluid is injected.
    step : float, optional
        Length of one step [s]; the fault's sampling time unless given.
    scheme : str
        How the law is carried out over a step; see `quakedesign.simulation.schemes`.
    method : str
        Fixed-step integrator; see `quakedesign.simulation.integrators`.
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

    Returns
    -------
    Trajectory
        One that diverges ends there, says so in `events`, and has no metrics.

    Raises
    ------
    ParameterError
        For a step, duration or number of samples that is not positive and finite, or an unknown scheme, method or
        plant.
    SimulationError
        When `compiled` is True and no compiler works.
    """
    fault.require_memoryless("a controlled run")
    setting = Setting.of(fault, step, duration, samples, settled_from)
    recorder = Recorder(loop_class(plant)(fault, controller), simulation_scheme(scheme), setting.step)
    return run(recorder, setting, integrator(method), progress=progress, compiled=compiled)


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


@dataclass(frozen=True, slots=True)
class Setting:
    """How far and how finely to go: times in s, checked."""

    step: float
    steps: int
    samples: int
    settled_from: float

    @classmethod
    def of(
        cls,
        fault: Fault,
        step: float | None,
        duration: float | None,
        samples: int,
        settled_from: float | None,
    ) -> "Setting":
        """Setting from what `simulate` was given; None stands for its defaults."""
        task = fault.reference.operation_time
        length = _positive("duration", task if duration is None else duration)
        pace = _positive("step", fault.sampling_time if step is None else step)
        steps = int(rational(length) / rational(pace) + _ALMOST_A_STEP)
        if not 1 <= steps <= MOST_STEPS:
            raise ParameterError(f"duration must hold 1 to {MOST_STEPS:.0e} steps. Received {steps}. Change the step.")
        if isinstance(samples, bool) or not isinstance(samples, int) or samples < 1:
            raise ParameterError(f"samples must be a whole number of at least 1. Received {samples!r}.")
        start = min(task, length) / 4 if settled_from is None else settled_from
        if not (math.isfinite(start) and start >= 0):
            raise ParameterError(f"settled_from must be a time of at least 0 s. Received {start!r} s.")
        return cls(pace, steps, samples, float(start))


def _positive(name: str, value: float) -> float:
    if not (math.isfinite(value) and value > 0):
        raise ParameterError(f"{name} must be positive and finite. Received {value!r} s.")
    return float(value)


def run(
    recorder: Recorder,
    setting: Setting,
    method: type[Integrator],
    *,
    progress: Callable[[float], None] | None = None,
    compiled: bool | None = None,
) -> Trajectory:
    """Trajectory of a recorder's loop; see `simulate`."""
    began = perf_counter()
    step, observe, signals = _functions(recorder, method)
    backend = prepare(step, compiled)
    ready = perf_counter()
    advancer = Advancer.of(backend, recorder.start(setting.settled_from))
    diverged_at = 2 + recorder.state_size + list(START).index("diverged")
    kept = march(advancer, instants(setting.steps, setting.samples), diverged_at, progress)
    watched = recorder.watched(observe(kept[:, -1]).full().ravel())
    ended = perf_counter()
    if watched["diverged"] >= 0:
        kept = kept[:, kept[0] * setting.step < watched["diverged"]]
    provenance = _provenance(recorder, method, backend) | {
        "preparation_seconds": ready - began,
        "stepping_seconds": ended - ready,
    }
    found = metrics(
        watched,
        controlled=recorder.loop.controller is not None,
        step=setting.step,
        steps=setting.steps,
        settled_from=setting.settled_from,
        seconds=ended - began,
        sticks=recorder.loop.sticks,
    )
    return Trajectory(
        **_columns(recorder, kept, signals),
        metrics=found,
        events=events(watched),
        provenance=provenance,
        integral_units=recorder.loop.controller.integral_units if recorder.loop.controller else (),
        name=f"{recorder.loop.fault.name}, {_law_title(recorder.loop.controller)}{recorder.loop.plant_title}",
    )


def _law_title(controller: Controller | None) -> str:
    return controller.title if controller else "no control"


def _functions(recorder: Recorder, method: type[Integrator]) -> tuple[Any, Any, Any]:
    """CasADi functions of the vector: one step, the watching of one instant, and all signals."""
    import casadi as ca

    before = ca.SX.sym("z", recorder.size)
    watched = recorder.observe(before)
    counter, state = before[0], before[2 : 2 + recorder.state_size]
    moved = recorder.scheme.advance(recorder.loop, method, counter, state, recorder.step)
    after = ca.cse([ca.vertcat(counter + 1, before[1], moved, watched[2 + recorder.state_size :])])
    signals = recorder.signals(before)
    return (
        ca.Function("step", [before], after),
        ca.Function("observe", [before], [watched]),
        ca.Function("signals", [before], list(signals.values()), ["z"], list(signals)),
    )


def _columns(recorder: Recorder, kept: Any, signals: Any) -> dict[str, Any]:
    """Arrays of a trajectory from the kept vectors; without a controller nothing is followed."""
    values = signals.call([kept])
    columns = {name: value.full().ravel() for name, value in zip(signals.name_out(), values, strict=True)}
    if recorder.loop.controller is None:
        columns |= dict.fromkeys(("reference", "reference_rate", "matched_perturbation"))
    return columns | {"integrals": kept[4 : 2 + recorder.state_size]}


def _provenance(recorder: Recorder, method: type[Integrator], backend: Backend) -> dict[str, Any]:
    controller = recorder.loop.controller
    return {
        "fault": recorder.loop.fault.name,
        "controller": controller.name if controller else "none",
        "method": method.name,
        "step": recorder.step,
        "scheme": recorder.scheme.name,
        "plant": recorder.loop.plant_name,
        "backend": backend.name,
        "backend_reason": backend.reason,
    } | library_versions("casadi", "numpy", "quakedesign")


def library_versions(*packages: str) -> dict[str, str]:
    """Installed version of each package, as provenance."""
    return {f"version_{package}": _version(package) for package in packages}


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
