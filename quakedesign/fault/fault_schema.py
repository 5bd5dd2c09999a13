"""JSON Schema of fault files and a commented template, from the same entries."""

import inspect
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from quakedesign.fault.block_chain import BLOCK, DIFFUSION, WELL
from quakedesign.fault.entries import FileEntry, Table, entries_of
from quakedesign.fault.fault_toml import DISTURBANCE, PLANT, TASK, TEXTS, WIDTHS, written
from quakedesign.fault.friction import friction_law, friction_laws
from quakedesign.fault.friction.base import FrictionLaw
from quakedesign.fault.friction.weakening import SlipWeakening
from quakedesign.fault.model import BOXES, Fault, Problems, Reference, UncertaintyBox
from quakedesign.files import Json

SCHEMA_NAME = "fault.schema.json"


def template(law: str = "exponential-slip-weakening", *, name: str = "my-fault", schema: bool = False) -> str:
    """Text of a commented TOML file as a template.

    Parameters
    ----------
    law : str
        Friction law.
    name : str
        Name of the fault.
    schema : bool
        Whether the first line names the schema file in the same folder, for editors.

    Raises
    ------
    UnknownNameError
        For an unknown friction law.
    """
    friction = friction_law(law)
    task = {key: entry for key, entry in TASK.items() if key not in friction.equilibrium.messages}
    if needs_target := not _comes_to_rest(_example(friction)):
        task["target_slip"] = replace(task["target_slip"], required=True)
    lines = [f"#:schema ./{SCHEMA_NAME}"] if schema else []
    lines += [
        "# A fault for quakedesign. Every number is an example: replace each, with its unit. Lines that begin with #",
        "# are optional. `quakedesign fault FILE` shows the derived quantities of the fault and the default values.",
        f"name = {written(name)}",
        '# source = "where the numbers come from"',
        *_lines(PLANT),
        "",
        "# What is uncertain besides friction: paper (nothing) or ten-percent (stiffness, damping and authority), or a",
        "# table [uncertainty] as at the end of this file.",
        '# uncertainty = "paper"',
        "",
        f"[friction]  # {_first_paragraph(friction)}",
        '# A user-defined law, "module:Class", runs its code: such a file is read only with --allow-code.',
        f"law = {written(law)}  # or {', '.join(sorted(set(friction_laws()) - {law}))}",
        *_lines(entries_of(friction)),
        "",
        f"{'' if needs_target else '# '}[task]  # reference: target slip and its duration",
        *_lines(task),
        "",
        "# [disturbance]  # unmeasured acceleration; guarantees hold up to this bound",
        *_lines(DISTURBANCE),
        "",
        "# [uncertainty]  # half-widths relative to the numbers above, from 0 to below 1; default 0",
        *_lines(WIDTHS),
    ]
    return "\n".join(lines) + "\n"


def _example(friction: type[FrictionLaw]) -> Fault:
    """Fault with the required examples of the template and a placeholder task."""
    values = [
        Table({key: entry.example for key, entry in entries.items() if entry.required}, Problems()).read(entries)
        for entries in (PLANT, entries_of(friction))
    ]
    idle = {"damping": 0.0, "reference": Reference(target_slip=1.0, operation_time=1.0), "sampling_time": 1e-3}
    return Fault(name="example", source="", friction=friction(**values[1]), **values[0] | idle)


def _comes_to_rest(fault: Fault) -> bool:
    """Whether the rest slip is positive; slip weakening is steepest at slip 0, so its slope there is sufficient."""
    if isinstance(fault.friction, SlipWeakening):
        weakening = fault.authority * fault.effective_normal_stress * fault.friction.slip_slope
        return weakening > fault.specific_stiffness
    return fault.rest_slip > 0


def _lines(entries: Mapping[str, FileEntry]) -> Iterator[str]:
    """Line of each quantity with its example and description; the line of an optional quantity is a comment."""
    for key, entry in entries.items():
        if entry.unit is not None:
            comment = entry.description.split("; ")[0].rstrip(".")
            if entry.default_text and not entry.required:
                comment += f"; default: {entry.default_text}"
            yield f"{'' if entry.required else '# '}{key} = {written(entry.example)}{comment and f'  # {comment}'}"


def _first_paragraph(kind: type) -> str:
    return (inspect.getdoc(kind) or "").split("\n\n")[0].replace("\n", " ")


def fault_schema() -> Json:
    """JSON Schema (draft 2020-12) of fault files, for editors that complete and check TOML."""
    friction = {"oneOf": [_law_schema(law) for _, law in sorted(friction_laws().items())]}
    box = [{"enum": sorted(BOXES)}, _table(WIDTHS)]
    schema = _table(
        TEXTS | PLANT,
        uncertainty={"oneOf": box, "description": _first_paragraph(UncertaintyBox)},
        friction=friction,
        task=_table(TASK),
        disturbance=_table(DISTURBANCE),
        block={
            "type": "array",
            "description": "tables [[block]], in order along the fault; friction and stress default to the fault's",
            "items": _table(BLOCK, friction=friction),
        },
        well={"type": "array", "description": "tables [[well]], in order along the fault", "items": _table(WELL)},
        diffusivity=_property(DIFFUSION["diffusivity"]),
    )
    schema["required"].append("friction")
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "fault of quakedesign"} | schema


def _table(entries: Mapping[str, FileEntry], **tables: Any) -> Json:
    """Schema of a table of these entries and of tables inside it."""
    properties = {name: _property(entry) for name, entry in entries.items()} | tables
    return _object(properties, [name for name, entry in entries.items() if entry.required])


def _object(properties: Json, required: list[str]) -> Json:
    return {"type": "object", "additionalProperties": False, "required": required, "properties": properties}


def _property(entry: FileEntry) -> Json:
    if entry.unit is None:
        return {"type": "string", "description": entry.description}
    kind = "string" if entry.unit else ["number", "string"]
    return {"type": kind, "description": entry.description, "examples": [entry.example]}


def _law_schema(law: type[FrictionLaw]) -> Json:
    """Schema of a friction table, with the parameters under their names or symbols."""
    entries = entries_of(law)
    properties = {"law": {"const": law.name, "description": _first_paragraph(law)}} | _table(entries)["properties"]
    spelt = {entry.symbol_pattern: entry for entry in entries.values() if entry.symbol}
    return _object(properties, ["law"]) | {
        "patternProperties": {pattern: properties[entry.name] for pattern, entry in spelt.items()},
        "allOf": [
            {"anyOf": [{"required": [entry.name]}, {"not": {"propertyNames": {"not": {"pattern": pattern}}}}]}
            for pattern, entry in spelt.items()
            if entry.required
        ],
    }
