"""Export of a sampled controller as C source or as an FMU (FMI 2.0, co-simulation)."""

import io
import os
import platform
import subprocess
import textwrap
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any
from uuid import UUID

import casadi as ca

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import OutputError, ParameterError
from quakedesign.fault import BlockChain, Fault
from quakedesign.fault.model import require_positive
from quakedesign.files import Json, require_writable, temporary_folder, whole_folder, write_whole
from quakedesign.laws import Controller
from quakedesign.loop import Scheme, simulation_scheme
from quakedesign.loop.schemes import scheme_of_run
from quakedesign.loop.schemes.base import Sampled
from quakedesign.simulation.block_run import decided
from quakedesign.simulation.closed_loop import ClosedLoop
from quakedesign.simulation.compiled import c_file, compiler, expanded, shared_library
from quakedesign.simulation.coupled_sliders import planned_per_slip
from quakedesign.simulation.integrators import integrator
from quakedesign.simulation.run_settings import library_versions

# ----------------------------------------------------------------------
# A sampled step of a controller, and the text of its C files.

SOURCE, HEADER = "controller.c", "controller.h"
_WIDTH = 110
_USE = """
Call controller_reset once, and controller_step every CONTROLLER_STEP seconds: it reads CONTROLLER_MEASUREMENTS
numbers{inputs}, updates CONTROLLER_MEMORY numbers, and writes {written} to be held until the next call (zero-order
hold). {limited} The reference of
the fault is computed from the number of calls. The functions keep their state in the memory argument alone,
allocate nothing, and may be called from several threads with different memories. Infinite and NaN
values are not detected: check the measurement and the pressure.
"""
_USE_OF_ONE = {
    "inputs": " and the pressure [Pa] that was applied since the last call",
    "written": "the fluid pressure [Pa]",
    "limited": "If the pump or a valve limits the pressure, pass the applied pressure, which prevents windup as in "
    "simulate --saturation; otherwise pass a null pointer.",
}
_PLAN = "planned pressure"  # key in `facts`, present only for laws of several blocks in slow sliding
_USE_OF_WELLS = {
    "inputs": "",
    "written": "the fluid pressure [Pa] of CONTROLLER_PRESSURES wells{beside}",
    "limited": "{plan}If pump or valve limits act, the law winds up: the proved pressures must be within the limits.",
}
_ADDED = """Add the planned pressure (below) to each, as a continuous function of time: the proof assumes that the
planned pressure reaches the fault unchanged, and that the pressure written here passes through the lag between valve
and fault for which the law is designed. """
_APPLIED_INPUT = " and the pressure [Pa] applied since the last call"
_APPLIED = """
   applied may be a null pointer: the pressure of the last call is then taken as applied (0 before the first call)."""
_COMPILE = "Compile with: cc -std=c99 -O2 -ffp-contract=off -c controller.c, and link with -lm."


@checked_dataclass(frozen=True, kw_only=True)
class ControllerStep:
    """Sampled step of a controller as one function of its measurement and its memory.

    Attributes
    ----------
    function : casadi.Function
        (measurement, applied pressure since the last sample [Pa], memory) → memory, pressure [Pa]. For several blocks
        (measurement, memory) → memory, pressures of the wells [Pa].
    measurement : mapping of str to str
        Unit of every measured signal, in order.
    start : mapping of str to float
        Memory before the first sample, in order, in SI units.
    step : float
        Sampling period T_s [s].
    facts : mapping of str to str
        Provenance: fault, law, gains, scheme, versions.
    remarks : tuple of str
        Sentences at the top of the header.
    """

    function: ca.Function
    measurement: Mapping[str, str]
    start: Mapping[str, float]
    step: float
    facts: Mapping[str, str]
    remarks: tuple[str, ...] = ()

    @property
    def limited(self) -> bool:
        """Whether `function` has the applied pressure as an argument."""
        return bool(self.function.n_in() == 3)

    @property
    def pressures(self) -> tuple[str, ...]:
        """Names of the pressures."""
        count = self.function.size1_out(1)
        return ("pressure",) if self.limited else tuple(f"pressure_{i + 1}" for i in range(count))

    def to_dict(self) -> Json:
        """Return the data of the step, without `function`, in JSON types."""
        return {
            "step": self.step,
            "measurement": dict(self.measurement),
            "memory": dict(self.start),
            "facts": dict(self.facts),
            "remarks": list(self.remarks),
        }


def header_text(exported: ControllerStep) -> str:
    """Text of the C header, with the meaning of every input, output and memory entry."""
    measured = (f"measurement[{i}]: {name} [{unit}]" for i, (name, unit) in enumerate(exported.measurement.items()))
    kept = (f"memory[{i}]: {name}, initial value {value!r}" for i, (name, value) in enumerate(exported.start.items()))
    facts = (f"{name}: {value}" for name, value in exported.facts.items())
    parts = [part for remark in exported.remarks for part in (*_wrapped(remark), "")]
    added = {"beside": ", in addition to the planned pressure,", "plan": _ADDED} if _PLAN in exported.facts else {}
    of_wells = {name: text.format(**{"beside": "", "plan": ""} | added) for name, text in _USE_OF_WELLS.items()}
    lines = [
        *parts,
        "A sampled controller for a fault, in SI units.",
        "",
        *_wrapped(_USE.format(**(_USE_OF_ONE if exported.limited else of_wells))),
        "",
        _COMPILE,
        "",
        *measured,
        *kept,
    ]
    comment = _comment([*lines, "", "Provenance:", *facts])
    sizes = {"step": repr(exported.step), "measurements": len(exported.measurement), "memory": len(exported.start)}
    entries = dict.fromkeys(("applied", "inputs", "about"), "")
    if exported.limited:
        entries = {"applied": "const double* applied, ", "inputs": _APPLIED_INPUT, "about": _APPLIED}
    return comment + c_file(
        "controller.h", **sizes, pressures=len(exported.pressures), limited=int(exported.limited), **entries
    )


def source_text(exported: ControllerStep, header: str) -> str:
    """CasADi's C for the step, followed by the two functions of the header."""
    generator = ca.CodeGenerator("sampled_step.c", {"with_export": False})
    generator.add(exported.function)
    start = ",\n".join(f"    {value!r}" for value in exported.start.values())
    entries = {"applied": "", "given": ""}
    if exported.limited:
        place = list(exported.start).index(HELD)
        entries = {"applied": "const double* applied, ", "given": f"applied ? applied : &memory[{place}], "}
    return generator.dump() + c_file("controller.c", header=header, start=start, **entries, **_sizes(exported.function))


def _sizes(function: ca.Function) -> dict[str, int]:
    sizes = {
        "arguments": function.sz_arg(),
        "results": function.sz_res(),
        "integers": function.sz_iw(),
        "work": function.sz_w(),
    }
    return {name: max(1, size) for name, size in sizes.items()}


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(" ".join(text.split()), _WIDTH)


def _comment(lines: list[str]) -> str:
    """Lines as one C comment; text from the user cannot terminate it."""
    wrapped = [part for line in lines for part in (textwrap.wrap(" ".join(line.split()), _WIDTH) or [""])]
    safe = "\n".join(f" * {line}".rstrip() for line in wrapped).replace("*/", "* /")
    return "/*\n" + safe + "\n */\n"


# ----------------------------------------------------------------------
# A sampled controller as a model unit of the Functional Mock-up Interface 2.0, for co-simulation.

UNIT = "controller.fmu"
_UNITS = {"m": {"m": "1"}, "m/s": {"m": "1", "s": "-1"}, "Pa": {"kg": "1", "m": "-1", "s": "-2"}}
_BEFORE_ZIP = (1980, 1, 1, 0, 0, 0)  # fixed date, so that the bytes are reproducible
_PLATFORMS = {"Linux": ("linux64", "so"), "Darwin": ("darwin64", "dylib")}


def model_unit(exported: ControllerStep) -> tuple[bytes, str]:
    """Bytes of an FMU of a sampled step; and the platform of its binary, or the reason why it has no binary.

    Inputs are the measurement and, for one block, ``applied`` [Pa], the pressure that pump or valve applied since the
    last sample. Unless set, it equals the commanded pressure. Once set after initialisation, it keeps its value: set it
    again before every sample, or the law winds up. The output ``pressure`` [Pa], for several wells ``pressure_1`` and
    so on, is the command of the last sample. Samples are T_s apart, from the start of the experiment. The FMU contains
    the sources, so that any platform can compile them.

    References
    ----------
    Functional Mock-up Interface for Model Exchange and Co-Simulation, version 2.0.4, sections 2.2 and 4.
    """
    interface = c_file("fmu.c")
    plain = {SOURCE: source_text(exported, HEADER), "fmu.c": interface}
    guid = f"{{{UUID(sha256(''.join([header_text(exported), *plain.values()]).encode()).hexdigest()[:32])}}}"
    sources = plain | {HEADER: f'#define CONTROLLER_GUID "{guid}"\n{header_text(exported)}'}
    members: dict[str, bytes] = {"modelDescription.xml": _description(exported, guid)}
    members |= {f"sources/{name}": text.encode() for name, text in sources.items()}
    binary, where = _binary(sources)
    return _zipped(members | binary), where


def _binary(sources: dict[str, str]) -> tuple[dict[str, bytes], str]:
    """Compiled interface on Linux and macOS (x86-64), if a C compiler works; and which binary the FMU contains."""
    if platform.system() not in _PLATFORMS or platform.machine() not in {"x86_64", "AMD64"}:
        return {}, "sources only: no binary of FMI 2.0 is built for this platform"
    name, suffix = _PLATFORMS[platform.system()]
    try:
        with temporary_folder() as folder:
            for file, text in sources.items():
                (folder / file).write_text(text, encoding="utf-8")
            included = "".join(f'#include "{file}"\n' for file in (SOURCE, "fmu.c"))
            data = shared_library(included, Path(folder), compiler()).read_bytes()
    except (OSError, subprocess.SubprocessError) as error:
        return {}, f"sources only: {str(error).splitlines()[0]}"
    return {f"binaries/{name}/controller.{suffix}": data}, name


def _description(exported: ControllerStep, guid: str) -> bytes:
    """``modelDescription.xml``."""
    text = "; ".join(f"{name}: {value}" for name, value in exported.facts.items())
    root = ET.Element("fmiModelDescription", fmiVersion="2.0", modelName="controller", guid=guid)
    root.attrib |= {"description": text, "generationTool": f"quakedesign {exported.facts['version_quakedesign']}"}
    kind = {"modelIdentifier": "controller", "canHandleVariableCommunicationStepSize": "true"}
    kind |= {"canGetAndSetFMUstate": "true", "canNotUseMemoryManagementFunctions": "true"}
    listed = ET.SubElement(ET.SubElement(root, "CoSimulation", kind), "SourceFiles")
    for file in (SOURCE, "fmu.c"):
        ET.SubElement(listed, "File", name=file)
    signals = dict(exported.measurement) | dict.fromkeys([*exported.pressures, *["applied"] * exported.limited], "Pa")
    units = ET.SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(signals.values()):
        ET.SubElement(ET.SubElement(units, "Unit", name=unit), "BaseUnit", _UNITS[unit])
    ET.SubElement(ET.SubElement(root, "LogCategories"), "Category", name="logStatusError")
    ET.SubElement(root, "DefaultExperiment", startTime="0", stepSize=repr(exported.step))
    variables = ET.SubElement(root, "ModelVariables")
    for reference, (name, unit) in enumerate(signals.items()):
        is_output = name in exported.pressures
        variable = {"name": name, "valueReference": str(reference), "variability": "discrete"}
        variable |= {"causality": "output", "initial": "exact"} if is_output else {"causality": "input"}
        ET.SubElement(ET.SubElement(variables, "ScalarVariable", variable), "Real", unit=unit, start="0")
    outputs = ET.SubElement(ET.SubElement(root, "ModelStructure"), "Outputs")
    for place in range(len(exported.pressures)):
        ET.SubElement(outputs, "Unknown", index=str(len(exported.measurement) + place + 1), dependencies="")
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True))


def _zipped(members: dict[str, bytes]) -> bytes:
    written = io.BytesIO()
    with zipfile.ZipFile(written, "w") as archive:
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(name, _BEFORE_ZIP), data, zipfile.ZIP_DEFLATED)
    return written.getvalue()


# ----------------------------------------------------------------------
# A sampled controller as C source for a laboratory computer.

FILES = (HEADER, SOURCE, UNIT)
HELD = "held_0"  # memory entry: the pressure of the last sample
_LISTED_APART = ("gains", "sampling")  # listed separately


def controller_step(
    fault: Fault,
    controller: Controller,
    *,
    step: float | None = None,
    scheme: str | Scheme | None = None,
    remarks: tuple[str, ...] = (),
) -> ControllerStep:
    """Sampled step of a controller, as in `simulate` with the same scheme, but without noise.

    Parameters
    ----------
    fault : Fault
        Gives the reference, and the input gain if the scheme needs it.
    controller : Controller
    step : float, optional
        T_s [s]; by default that of a sampled law, or else the fault's sampling time.
    scheme : str or Scheme, optional
        A sampled scheme; by default that of a sampled law, or else ``explicit``. Of its measurement only the part that
        runs in software is exported. The inputs of the step are the slip and, if it is used, the slip rate.
    remarks : tuple of str
        Further sentences at the top of the header, after those on T_s and on the stages between controller and fault.

    Raises
    ------
    ParameterError
        For a scheme without sampling, an actuator with dynamics between samples, or a step that is not positive or
        differs from that of the sensor.
    """
    fault.require_memoryless("a controller in C")
    scheme, step, own = scheme_of_run(controller, scheme, step)
    period = fault.sampling_time if step is None else step
    require_positive(step=period)
    chosen = _software(simulation_scheme(scheme, **own) if isinstance(scheme, str) else scheme)
    loop, measurement = ClosedLoop(fault, controller), {"slip": "m", "slip_rate": "m/s"}
    both = _function(loop, chosen, float(period), 2)[0]
    if not any(1 in both.jac_sparsity(output, 0).get_col() for output in range(both.n_out())):
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
    """Write a controller's sampled step as ``controller.c`` and ``controller.h`` into a folder, all files or none.

    The C code has no dynamic memory and no static state, needs the standard mathematics library only, and equals
    `ControllerStep.function` bitwise when compiled with ``-ffp-contract=off``.

    Parameters
    ----------
    fault, controller
        As in `controller_step`.
    folder : str or Path
        New folder in an existing one.
    step, scheme, remarks
        As in `controller_step`; step [s].
    fmu : bool
        Also write ``controller.fmu``: the same step for co-simulation with FMI 2.0, with the sources and, on Linux and
        macOS (x86-64) with a C compiler, a binary.
    force : bool
        Replace a folder that contains an earlier export and nothing else.

    Returns
    -------
    ControllerStep

    Raises
    ------
    ParameterError
        As `controller_step`.
    OutputError
        If the folder exists and `force` is False, contains other files than an export, or cannot be written.
    """
    require_free(Path(folder), force)
    exported = controller_step(fault, controller, step=step, scheme=scheme, remarks=remarks)
    return write_step(exported, folder, fmu=fmu, force=force)


def write_step(
    exported: ControllerStep, folder: str | Path, *, fmu: bool = False, force: bool = False
) -> ControllerStep:
    """Write the files of a sampled step; folder, fmu, force and errors as in `export_controller`."""
    target = Path(folder)
    require_free(target, force)
    contents: dict[str, str | bytes] = {HEADER: header_text(exported), SOURCE: source_text(exported, HEADER)}
    if fmu:
        contents[UNIT], platform = model_unit(exported)
        exported = replace(exported, facts={**exported.facts, "fmu": platform})
    with whole_folder(target) as partial:
        for name, content in contents.items():
            write_whole(partial / name, content)
    return exported


def block_step(chain: BlockChain, law: Any, *, remarks: tuple[str, ...] = ()) -> ControllerStep:
    """Sampled step of a law for several blocks, as in `simulate_blocks` or `simulate_sampled_blocks`.

    Parameters
    ----------
    chain : BlockChain
        Gives the reference, and the weights of the averages of measurements that the law uses.
    law : MatrixLaw
        Law without delay, such as the law that a guarantee returns.
    remarks : tuple of str
        Sentences at the top of the header.

    """
    N, states = len(chain.blocks), [f"state_{i + 1}" for i in range(len(law.update))]
    measured = (("slip", "m"),) if chain.has_state else (("slip", "m"), ("slip_rate", "m/s"))
    measurement, memory = ca.SX.sym("measurement", len(measured) * N), ca.SX.sym("memory", 1 + len(states))
    count, z = ca.vertsplit(memory, [0, 1, 1 + len(states)])
    pressures, later = decided(chain, law, count, measurement[:N], measurement[N:], z)
    outputs = ca.cse([ca.vertcat(count + 1, later), ca.densify(pressures)])
    facts = {"fault": chain.name, "blocks": str(N), "wells [m]": _text(chain.wells)}
    if chain.has_state:
        task, course = chain.fault.reference, "d((1 - c)t/T + c s^3(10 - 15s + 6s^2)), s = min(t/T, 1)"
        values = f"d = {task.target_slip!r} m, T = {task.operation_time!r} s, c = {task.ramp or 0.0!r}"
        facts |= {_PLAN: f"{planned_per_slip(chain)!r} Pa/m times r(t), r = {course}, {values}"}
    return ControllerStep(
        function=expanded(ca.Function("sampled_step", [measurement, memory], outputs)),
        measurement={f"{name}_{i + 1}": unit for name, unit in measured for i in range(N)},
        start=dict.fromkeys(["sample", *states], 0.0),
        step=float(law.step),
        facts=facts | library_versions("quakedesign", "casadi"),
        remarks=remarks,
    )


def require_free(folder: Path, force: bool) -> None:
    """Raise if the folder exists; with `force`, only if it contains files other than those of an export."""
    if os.path.exists(folder) and not force:
        raise OutputError(
            f"the folder of an export must be new. Received {folder}, which exists. Give --force to replace it."
        )
    if os.path.exists(folder) and not (folder.is_dir() and {f.name for f in folder.iterdir()} <= set(FILES)):
        raise OutputError(
            f"only a folder with no files but {', '.join(FILES)} is replaced. Received {folder}. Choose another."
        )
    require_writable(folder)


def _software(scheme: Scheme) -> Sampled:
    """Scheme without noise, transducer and substeps; rejects a scheme that a controller cannot execute."""
    if not isinstance(scheme, Sampled):
        raise ParameterError(f"export needs a sampled scheme. Received {scheme.name}. Use explicit.")
    if scheme.actuator.flowing:
        names = ", ".join(stage.name for stage in scheme.actuator.flowing)
        raise ParameterError(
            f"a stage with continuous-time dynamics is part of the plant and is not exported. Received {names}. "
            "Remove it from the scheme."
        )
    return replace(scheme, measurement=scheme.measurement.software, substeps=1)


def _function(loop: ClosedLoop, scheme: Sampled, step: float, measured: int) -> tuple[ca.Function, dict[str, float]]:
    """CasADi Function of the step, and its initial memory; constant entries are inserted as numbers."""
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
    change, *before = entries if count else (ca.SX(0),)
    commanded, own[names.index(HELD)] = own[names.index(HELD)], applied
    for i in range(count):  # anti-windup; in simulation `Sampled` knows the limit and does this within the sample
        own[i] = ca.if_else((commanded - applied) * change > 0, before[i], own[i])
    state = ca.vertcat(measurement, ca.SX(2 - measured, 1), *own)
    moved = _after(loop, scheme, counter, state, step)
    later = [counter + 1, *(moved[i] for i, c in enumerate(changing) if c)]
    later += [scheme.integral_effect(loop, counter, state, step), *own[:count]] if count else []
    outputs = ca.cse([ca.vertcat(*later), scheme.pressure(loop, counter, state, step)])
    return ca.Function("sampled_step", [measurement, applied, memory], outputs), start


def _after(loop: ClosedLoop, scheme: Sampled, counter: ca.SX, state: ca.SX, step: float) -> ca.SX:
    """Integral states and memory at the next sample; they do not depend on the plant's motion until then."""
    return scheme.advance(loop, integrator("rk4"), counter, state, step)[2:]


def _remarks(fault: Fault, controller: Controller) -> tuple[str, ...]:
    """Limits of use of a sampled law: another T_s, a fault at rest, and the stages between law and fault."""
    own = controller.sampling
    path = {"a delay of": own.delay, "a lag of": own.lag, "a diffusion path of L^2/D =": own.diffusion} if own else {}
    between = ", ".join(f"{what} {float(time):g} s" for what, time in path.items() if time)
    behind = f"designed for {between} between controller and fault: the output is the pressure commanded to the valve"
    by_a_clock = (
        f"to be called periodically, once every {float(own.step):.6g} s, since the reference is computed from the "
        "number of calls; the guarantee for aperiodic sampling covers periodic sampling"
        if own and own.longest
        else ""
    )
    limits = (controller.other_step(fault), controller.warning_at_rest)
    return tuple(filter(None, (*limits, behind if between else "", by_a_clock)))


def _facts(fault: Fault, controller: Controller, scheme: Sampled) -> dict[str, str]:
    gains = {f"gain {n}": f"{v} {controller.gain_units[n]}" for n, v in controller.gains.items()}
    rest = {f.name: _text(getattr(controller, f.name)) for f in fields(controller) if f.name not in _LISTED_APART}
    entries = {"fault": fault.name, "law": controller.title, "source": controller.source, **gains, **rest}
    entries |= {"scheme": scheme.name} | {name: str(value) for name, value in scheme.settings.items()}
    return entries | library_versions("quakedesign", "casadi")


def _text(value: object) -> str:
    """Text of a value: exact numbers as p/q, dataclasses by their fields that are not empty."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_text, value))}]"
    if not is_dataclass(value):
        return str(value)
    values = {f.name: getattr(value, f.name) for f in fields(value)}
    return ", ".join(f"{name} {_text(part)}" for name, part in values.items() if part not in (None, ()))
