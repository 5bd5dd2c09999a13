"""A sampled controller as a model unit of the Functional Mock-up Interface 2.0, for co-simulation."""

import io
import platform
import subprocess
import xml.etree.ElementTree as ET
import zipfile
from hashlib import sha256
from pathlib import Path
from uuid import UUID

from quakedesign.simulation.backend import compiler, shared_library
from quakedesign.simulation.c_files import c_file
from quakedesign.simulation.c_source import HEADER, SOURCE, ControllerStep, header_text, source_text
from quakedesign.temporary import temporary_folder

UNIT = "controller.fmu"
_UNITS = {"m": {"m": "1"}, "m/s": {"m": "1", "s": "-1"}, "Pa": {"kg": "1", "m": "-1", "s": "-2"}}
_BEFORE_ZIP = (1980, 1, 1, 0, 0, 0)  # the same bytes whenever it is written
_PLATFORMS = {"Linux": ("linux64", "so"), "Darwin": ("darwin64", "dylib")}


def model_unit(exported: ControllerStep) -> tuple[bytes, str]:
    """Bytes of an FMU of a sampled step, and for which platform it holds a binary or why for none.

    Inputs are the measurement, the output ``pressure`` [Pa] is what is held since the last sample; the samples lie
    T_s apart from the start of the experiment. The sources lie inside, so that any platform can compile them.

    Parameters
    ----------
    exported : ControllerStep

    Returns
    -------
    tuple of bytes and str

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
    """Compiled interface of this platform, where a compiler works."""
    if platform.system() not in _PLATFORMS or platform.machine() not in {"x86_64", "AMD64"}:
        return {}, "sources only: this platform has no name in FMI 2.0 that is built here"
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
    told = "; ".join(f"{name}: {value}" for name, value in exported.facts.items())
    root = ET.Element("fmiModelDescription", fmiVersion="2.0", modelName="controller", guid=guid)
    root.attrib |= {"description": told, "generationTool": f"quakedesign {exported.facts['version_quakedesign']}"}
    kind = {"modelIdentifier": "controller", "canHandleVariableCommunicationStepSize": "true"}
    kind |= {"canGetAndSetFMUstate": "true", "canNotUseMemoryManagementFunctions": "true"}
    listed = ET.SubElement(ET.SubElement(root, "CoSimulation", kind), "SourceFiles")
    for file in (SOURCE, "fmu.c"):
        ET.SubElement(listed, "File", name=file)
    signals = dict(exported.measurement) | {"pressure": "Pa"}
    units = ET.SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(signals.values()):
        ET.SubElement(ET.SubElement(units, "Unit", name=unit), "BaseUnit", _UNITS[unit])
    ET.SubElement(ET.SubElement(root, "LogCategories"), "Category", name="logStatusError")
    ET.SubElement(root, "DefaultExperiment", startTime="0", stepSize=repr(exported.step))
    variables = ET.SubElement(root, "ModelVariables")
    for reference, (name, unit) in enumerate(signals.items()):
        is_output = name == "pressure"
        variable = {"name": name, "valueReference": str(reference), "variability": "discrete"}
        variable |= {"causality": "output", "initial": "exact"} if is_output else {"causality": "input"}
        ET.SubElement(ET.SubElement(variables, "ScalarVariable", variable), "Real", unit=unit, start="0")
    outputs = ET.SubElement(ET.SubElement(root, "ModelStructure"), "Outputs")
    ET.SubElement(outputs, "Unknown", index=str(len(signals)), dependencies="")
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True))


def _zipped(members: dict[str, bytes]) -> bytes:
    written = io.BytesIO()
    with zipfile.ZipFile(written, "w") as archive:
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(name, _BEFORE_ZIP), data, zipfile.ZIP_DEFLATED)
    return written.getvalue()
