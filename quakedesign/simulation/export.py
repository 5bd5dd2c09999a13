"""A sampled controller as C, for the computer of a laboratory."""

import os
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import casadi as ca

from quakedesign.controllers import Controller
from quakedesign.errors import OutputError, ParameterError
from quakedesign.fault import Fault
from quakedesign.fault.checks import require_positive
from quakedesign.loop.schemes import Scheme, own_way, simulation_scheme
from quakedesign.loop.steps.sampled import Sampled
from quakedesign.output import require_room, whole_folder, write_whole
from quakedesign.simulation.c_source import HEADER, SOURCE, ControllerStep, header_text, source_text
from quakedesign.simulation.closed_loop import ClosedLoop
from quakedesign.simulation.fmu import UNIT, model_unit
from quakedesign.simulation.instructions import expanded
from quakedesign.simulation.integrators import integrator
from quakedesign.simulation.run import library_versions

FILES = (HEADER, SOURCE, UNIT)
HELD = "held_0"  # of the memory: the pressure of the sample before
_TOLD = ("gains", "sampling")  # in other words


def controller_step(
    fault: Fault,
    controller: Controller,
    *,
    step: float | None = None,
    scheme: str | Scheme | None = None,
    remarks: tuple[str, ...] = (),
) -> ControllerStep:
    """Sampled step of a controller, built from that of `simulate` with the same scheme, without noise.

    Parameters
    ----------
    fault : Fault
        For its reference, and its input gain where the scheme needs one.
    controller : Controller
    step : float, optional
        T_s [s]; that of a law of samples, or the fault's sampling time, unless given.
    scheme : str or Scheme, optional
        One that samples; that of a law of samples, or ``explicit``, unless given. Of its measurement the part that runs
        on the controller is kept: with a `Sensor` the slip is measured alone, else slip and slip rate, if the step uses
        it.
    remarks : tuple of str
        Further sentences to be said first, after what is said of the T_s and of what stands behind the law.

    Returns
    -------
    ControllerStep

    Raises
    ------
    ParameterError
        For a scheme that does not sample, an actuator with a motion of its own, or a step that is not positive or not
        that of the sensor.
    """
    fault.require_memoryless("a controller in C")
    scheme, step, own = own_way(controller, scheme, step)
    period = fault.sampling_time if step is None else step
    require_positive(step=period)
    chosen = _software(simulation_scheme(scheme, **own) if isinstance(scheme, str) else scheme)
    loop, measurement = ClosedLoop(fault, controller), {"slip": "m", "slip_rate": "m/s"}
    if chosen.measurement.of_slip_alone or not _uses_rate(_function(loop, chosen, float(period), 2)[0]):
        measurement.pop("slip_rate")
    function, start = _function(loop, chosen, float(period), len(measurement))
    facts = _facts(fault, controller, chosen)
    return ControllerStep(
        function=expanded(function),
        measurement=measurement,
        start=start,
        step=float(period),
        facts=facts,
        remarks=(*_remarks(fault, controller), *remarks),
    )


def export_controller(
    fault: Fault,
    controller: Controller,
    folder: str | Path,
    *,
    step: float | None = None,
    scheme: str | Scheme | None = None,
    remarks: tuple[str, ...] = (),
    fmu: bool = False,
    force: bool = False,
) -> ControllerStep:
    """Write a controller's sampled step as ``controller.c`` and ``controller.h`` into a folder that appears whole.

    The C has no dynamic memory and no state of its own, needs the standard mathematics library only, and gives the
    digits of `ControllerStep.function` when compiled with ``-ffp-contract=off``.

    Parameters
    ----------
    fault, controller
        As in `controller_step`.
    folder : str or Path
        New folder in an existing one.
    step, scheme, remarks
        As in `controller_step`; step [s].
    fmu : bool
        Write ``controller.fmu`` beside them: the same step for co-simulation with FMI 2.0, with a binary for this
        platform where a C compiler works, and the sources.
    force : bool
        Replace a folder that holds an earlier export and nothing else.

    Returns
    -------
    ControllerStep

    Raises
    ------
    ParameterError
        As `controller_step`.
    OutputError
        When the folder exists, or cannot be written.
    """
    target = Path(folder)
    _require_free(target, force)
    exported = controller_step(fault, controller, step=step, scheme=scheme, remarks=remarks)
    contents: dict[str, str | bytes] = {HEADER: header_text(exported), SOURCE: source_text(exported, HEADER)}
    if fmu:
        contents[UNIT], platform = model_unit(exported)
        exported = replace(exported, facts={**exported.facts, "fmu": platform})
    with whole_folder(target) as partial:
        for name, content in contents.items():
            write_whole(partial / name, content)
    return exported


def _require_free(folder: Path, force: bool) -> None:
    if os.path.exists(folder) and not force:
        raise OutputError(
            f"the folder of an export must be new. Received {folder}, which exists. Give --force to replace it."
        )
    if os.path.exists(folder) and not (folder.is_dir() and {f.name for f in folder.iterdir()} <= set(FILES)):
        raise OutputError(f"only a folder with {', '.join(FILES)} is replaced. Received {folder}. Choose another.")
    require_room(folder)


def _software(scheme: Scheme) -> Sampled:
    """Scheme without noise, transducer and substeps; refuses what no controller can carry out."""
    if not isinstance(scheme, Sampled):
        raise ParameterError(f"a controller is exported with a scheme that samples. Received {scheme.name}.")
    if scheme.actuator.flowing:
        names = ", ".join(stage.name for stage in scheme.actuator.flowing)
        raise ParameterError(f"what moves between samples belongs to the plant. Received {names}. Leave it out.")
    return replace(scheme, measurement=scheme.measurement.software, substeps=1)


def _function(loop: ClosedLoop, scheme: Sampled, step: float, measured: int) -> tuple[Any, dict[str, float]]:
    """CasADi Function of the step, and the memory at the start; what never changes is written into the function."""
    numbers = scheme.memory(loop, step)
    names = [str(symbol) for symbol in loop.integrals] + list(numbers)
    values = [0.0] * len(loop.integrals) + list(numbers.values())
    free = [ca.SX.sym(name) for name in names]
    after = _after(loop, scheme, ca.SX.sym("sample"), ca.vertcat(ca.SX.sym("x", 2), *free), step)
    changing = [names[i] == HELD or not ca.is_equal(after[i], symbol) for i, symbol in enumerate(free)]
    start = {"sample": 0.0} | {n: v for n, v, c in zip(names, values, changing, strict=True) if c}
    count = len(loop.integrals)
    winding = {"push": 0.0} | {f"before_{name}": 0.0 for name in names[:count]} if count else {}
    start |= winding
    memory, measurement = ca.SX.sym("memory", len(start)), ca.SX.sym("measurement", measured)
    applied, entries = ca.SX.sym("applied"), iter(ca.vertsplit(memory))
    counter = next(entries)
    own = [next(entries) if c else ca.SX(v) for v, c in zip(values, changing, strict=True)]
    push, *before = entries if count else (ca.SX(0),)
    asked, own[names.index(HELD)] = own[names.index(HELD)], applied
    for i in range(count):  # as `Sampled` does at the sample itself, where it knows the limit
        own[i] = ca.if_else((asked - applied) * push > 0, before[i], own[i])
    state = ca.vertcat(measurement, ca.SX(2 - measured, 1), *own)
    moved = _after(loop, scheme, counter, state, step)
    later = [counter + 1, *(moved[i] for i, c in enumerate(changing) if c)]
    later += [scheme.push(loop, counter, state, step), *own[:count]] if count else []
    outputs = ca.cse([ca.vertcat(*later), scheme.pressure(loop, counter, state, step)])
    return ca.Function("sampled_step", [measurement, applied, memory], outputs), start


def _uses_rate(function: Any) -> bool:
    """Whether any output depends on the second measurement."""
    return any(1 in function.jac_sparsity(output, 0).get_col() for output in range(function.n_out()))


def _after(loop: ClosedLoop, scheme: Sampled, counter: Any, state: Any, step: float) -> Any:
    """Integral states and memory at the next sample; they do not depend on how the plant moves meanwhile."""
    return scheme.advance(loop, integrator("rk4"), counter, state, step)[2:]


def _remarks(fault: Fault, controller: Controller) -> tuple[str, ...]:
    """That a law of samples is for another T_s than the fault's, and behind what its pressure is meant to act."""
    own = controller.sampling
    path = {"a delay of": own.delay, "a lag of": own.lag, "rock of L^2/D =": own.diffusion} if own else {}
    between = ", ".join(f"{what} {float(time):g} s" for what, time in path.items() if time)
    behind = f"designed for {between} between its answer and the fault: the pressure is that to ask of the valve"
    by_a_clock = (
        f"to be called by a clock, once every {float(own.step):.6g} s, since the reference counts the calls: a case of "
        "what is proved of samples by no clock"
        if own and own.longest
        else ""
    )
    return tuple(filter(None, (controller.other_step(fault), behind if between else "", by_a_clock)))


def _facts(fault: Fault, controller: Controller, scheme: Sampled) -> dict[str, str]:
    gains = {f"gain {n}": f"{v} {controller.gain_units[n]}" for n, v in controller.gains.items()}
    rest = {f.name: _text(getattr(controller, f.name)) for f in fields(controller) if f.name not in _TOLD}
    facts = {"fault": fault.name, "law": controller.title, "source": controller.source, **gains, **rest}
    facts |= {"scheme": scheme.name} | {name: str(value) for name, value in scheme.settings.items()}
    return facts | library_versions("quakedesign", "casadi")


def _text(value: Any) -> str:
    """Exact numbers as p/q, values by their fields that hold something."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_text, value))}]"
    if not is_dataclass(value):
        return str(value)
    held = {f.name: getattr(value, f.name) for f in fields(value)}
    return ", ".join(f"{name} {_text(part)}" for name, part in held.items() if part not in (None, ()))
