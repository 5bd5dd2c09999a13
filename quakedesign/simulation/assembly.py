"""From the vectors that a run kept to the trajectory that it returns."""

from functools import partial
from time import perf_counter
from typing import Any

import casadi as ca

from quakedesign.controllers import Controller
from quakedesign.errors import SimulationError
from quakedesign.fault import fault_toml
from quakedesign.simulation.actuated_trajectory import SampledTrajectory
from quakedesign.simulation.metrics import events, metrics
from quakedesign.simulation.outcome import OutcomeCriterion
from quakedesign.simulation.recorder import Recorder
from quakedesign.simulation.setting import Setting
from quakedesign.simulation.trajectory import Trajectory


def trajectory(
    recorder: Recorder,
    setting: Setting,
    kept: Any,
    criterion: OutcomeCriterion,
    provenance: dict[str, Any],
    began: tuple[float, float],
) -> Trajectory:
    """Trajectory from the kept vectors, of which those before a divergence are shown.

    Parameters
    ----------
    recorder : Recorder
    setting : Setting
    kept : ndarray
        Vectors of the recorder, shape (their length, number of instants).
    criterion : OutcomeCriterion
    provenance : dict
    began : tuple of float
        Readings of the clock when the work and when the stepping began [s].

    Raises
    ------
    SimulationError
        When nothing is finite, not even the start.
    """
    observe, signals = _watchers(recorder)
    end = observe(kept[:, -1]).full().ravel()
    watched, ended = recorder.watched(end), perf_counter()
    if watched["diverged"] >= 0:
        kept = kept[:, kept[0] * setting.step < watched["diverged"]]
    if not kept.size:
        raise SimulationError(
            "the loop must have finite values at the start. Received values that are not. Check gains and disturbance."
        )
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
    columns = _columns(recorder, kept, signals)
    described = recorder.scheme.described
    further = {name: (columns.pop(name), *said) for name, said in described.items()}
    kind = partial(SampledTrajectory, actuation=further) if further else Trajectory
    return kind(
        **columns,
        moment_per_slip=loop.fault.shear_modulus * loop.fault.area,
        metrics=measured,
        energy=None if watched["diverged"] >= 0 else recorder.energy(end),
        events=events(watched),
        criterion=criterion,
        provenance=provenance | took | {"scenario": fault_toml(loop.fault)},
        integral_units=loop.controller.integral_units if loop.controller else (),
        name=f"{loop.fault.name}, {_law_title(loop.controller)}{loop.plant_title}",
    )


def _law_title(controller: Controller | None) -> str:
    return controller.title if controller else "no control"


def _watchers(recorder: Recorder) -> tuple[Any, Any]:
    """CasADi Functions of the vector: the watching of one instant, and all signals."""
    vector = ca.SX.sym("z", recorder.size)
    signals = recorder.signals(vector)
    return (
        ca.Function("observe", [vector], [recorder.observe(vector)]),
        ca.Function("signals", [vector], list(signals.values()), ["z"], list(signals)),
    )


def _columns(recorder: Recorder, kept: Any, signals: Any) -> dict[str, Any]:
    """Arrays of a trajectory from the kept vectors; without a controller nothing is followed."""
    values = signals.call([kept])
    columns = {name: value.full().ravel() for name, value in zip(signals.name_out(), values, strict=True)}
    if recorder.loop.controller is None:
        columns |= dict.fromkeys(("reference", "reference_rate", "matched_perturbation"))
    return columns | {"integrals": kept[4 : 4 + len(recorder.loop.integrals)]}
