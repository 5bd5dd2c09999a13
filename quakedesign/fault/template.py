"""A fault as a TOML file: one to start from, one that says all that a result rests on, and the schema for editors."""

import inspect
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields
from math import inf, nextafter
from typing import Any

from quakedesign.fault.disturbance import Disturbance, acceleration
from quakedesign.fault.file_reading import DISTURBANCE, OPTIONAL, PLANT, TASK, WIDTHS
from quakedesign.fault.friction import FrictionLaw, friction_law, friction_laws
from quakedesign.fault.parameters import Fault
from quakedesign.fault.reference import Reference
from quakedesign.fault.uncertainty import BOXES, UncertaintyBox
from quakedesign.fault.units import units_of
from quakedesign.rationals import float_below, rational

SCHEMA_NAME = "fault.schema.json"
_EXAMPLES: dict[str, str | float] = {
    "density": "2600 kg/m^3",
    "shear_modulus": "25 GPa",
    "length": "1.5 km",
    "width": "1.5 km",
    "damping": "1e13 kg/s",
    "effective_normal_stress": "25 MPa",
    "target_slip": "5 cm",
    "operation_time": "2 days",
    "ramp": 0.1,
    "sampling_time": "10 ms",
    "constant": "0 m/s^2",
    "amplitude": "1e-4 m/s^2",
    "frequency": "1 rad/s",
    "slip_growth": "0 1/s^2",
    "rate_growth": "0 1/s",
    "residual": 0.45,
    "drop": 0.15,
    "critical_slip": "2 cm",
    "critical_rate": "10 cm/s",
    "reference_coefficient": 0.6,
    "direct_effect": 0.010,
    "evolution_effect": 0.015,
    "reference_rate": "1 um/s",
    "slowest_rate": "1e-12 m/s",
    "fastest_rate": "1 m/s",
}
_WIDTHS_SAID = {"stiffness": "of k/m", "damping": "of η/m", "authority": "of A/m, the area per mass"}
_COME_TO_REST = ("exponential-slip-weakening", "linear-slip-weakening")
_LEFT_OUT = {
    "width": "square if left out",
    "damping": "radiation of shear waves, G A/(2 c_s), if left out",
    "target_slip": "the next rest slip if left out",
    "operation_time": "about as many natural periods as for the paper's faults if left out",
    "ramp": "all of it at a constant rate if left out",
    "sampling_time": "at least ten samples while an error grows e-fold, with a state near D_c/(20 V), if left out",
}


def fault_toml(fault: Fault) -> str:
    """Text of a TOML file that `load_fault` reads as this fault, every number in SI units and nothing left out."""
    named: dict[str, Mapping[str, Any]] = {
        "friction": {"law": _law_name(type(fault.friction))} | _law_values(fault.friction),
        "task": _values(fault.reference, TASK) | {"sampling_time": f"{fault.sampling_time!r} s"},
        "disturbance": _values(fault.disturbance, DISTURBANCE) | _stresses(fault),
        "uncertainty": {key: float(getattr(fault.box, key)) for key in WIDTHS},
    }
    top: dict[str, Any] = {"name": fault.name, "source": fault.source} | _values(fault, PLANT)
    if fault.box == BOXES.get(fault.box.name):
        top["uncertainty"] = fault.box.name
        del named["uncertainty"]
    lines = [*_entries(top)]
    for table, entries in named.items():
        lines += ["", f"[{table}]", *_entries(entries)]
    return "\n".join(lines) + "\n"


def _law_name(law: type[FrictionLaw]) -> str:
    """Name of a law in a file: of one of the user's own, where it is defined."""
    return law.name if law in friction_laws().values() else f"{law.__module__}:{law.__qualname__}"


def _values(part: object, units: Mapping[str, str]) -> dict[str, Any]:
    held = {key: getattr(part, key, None) for key in units}
    return {
        key: (f"{value!r} {units[key]}" if units[key] else value) for key, value in held.items() if value is not None
    }


def _stresses(fault: Fault) -> dict[str, str]:
    """What of the disturbance was given as a stress: the least float that is read as no less."""
    found = {}
    for name in fault.disturbance.stresses:
        size = abs(getattr(fault.disturbance, name))
        stress = nextafter(float_below(rational(size) / fault.exact_authority), 0)
        while acceleration(f"{stress!r} Pa", fault.exact_authority, name)[0] < size:
            stress = nextafter(stress, inf)
        found[name] = f"{stress if getattr(fault.disturbance, name) >= 0 else -stress!r} Pa"
    return found


def _law_values(law: FrictionLaw) -> dict[str, Any]:
    options = {field.name: getattr(law, field.name) for field in fields(law)}  # type: ignore[arg-type]
    return options | _values(law, units_of(type(law)))


def _entries(entries: Mapping[str, Any]) -> Iterator[str]:
    for key, value in entries.items():
        yield f"{key} = {_written(value)}"


def _written(value: Any) -> str:
    """Text or number as TOML has it."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(float(value))


def template(law: str = "exponential-slip-weakening", *, name: str = "my-fault", schema: bool = False) -> str:
    """Text of a commented TOML file to start from.

    Parameters
    ----------
    law : str
        Friction law.
    name : str
        Of the fault.
    schema : bool
        Whether its first line names the schema beside it, for editors.

    Raises
    ------
    UnknownNameError
        For another law.
    """
    friction = friction_law(law)
    asks = set() if law in _COME_TO_REST else {"target_slip"}
    task = {key: unit for key, unit in TASK.items() if friction.state_names or key != "ramp"}
    lines = [f"#:schema ./{SCHEMA_NAME}"] if schema else []
    lines += [
        "# A fault for quakedesign. Every number is an example: put in your own, each with its unit. What begins with",
        "# a # may be left out. `quakedesign fault FILE` shows what follows from it and what was assumed.",
        f"name = {_written(name)}",
        '# source = "where the numbers come from"',
        *_asked(PLANT, _described(Fault), OPTIONAL),
        "",
        "# What is uncertain besides friction: paper (nothing) or ten-percent (stiffness, damping and authority), or a",
        "# table [uncertainty] of your own, see the end.",
        '# uncertainty = "paper"',
        "",
        f"[friction]  # {_first(friction)}",
        '# A law of your own, "module:Class", runs its code: such a file is read with --allow-code alone.',
        f"law = {_written(law)}  # or {', '.join(sorted(set(friction_laws()) - {law}))}",
        *_asked(units_of(friction), _described(friction), _optional(friction)),
        "",
        f"{'' if asks else '# '}[task]  # what the fault shall do: slip slowly from rest to rest",
        *_asked(task, _task_described(), set(TASK) - asks),
        "",
        "# [disturbance]  # acceleration that nobody measures; the bound that guarantees are for",
        *_asked(DISTURBANCE, _described(Disturbance), DISTURBANCE),
        "",
        "# [uncertainty]  # half-widths relative to the numbers above, from 0 up to 1, each 0 if left out",
        *(f"# {key} = 0.1  # {said}" for key, said in _WIDTHS_SAID.items()),
    ]
    return "\n".join(lines) + "\n"


def _asked(units: Mapping[str, str], said: Mapping[str, str], optional: Any) -> Iterator[str]:
    for key in units:
        left = f"; {_LEFT_OUT[key]}" if key in _LEFT_OUT and key in optional else ""
        mark = "# " if key in optional else ""
        yield f"{mark}{key} = {_written(_example(key, units[key]))}  # {said[key].split('; ')[0].rstrip('.')}{left}"


def _example(key: str, unit: str) -> str | float:
    return _EXAMPLES.get(key, f"1 {unit}" if unit else 0.1)


def _task_described() -> dict[str, str]:
    return _described(Reference) | {"sampling_time": _described(Fault)["sampling_time"]}


def _first(law: type[FrictionLaw]) -> str:
    return (inspect.getdoc(law) or "").split("\n\n")[0].replace("\n", " ")


def _optional(law: type[FrictionLaw]) -> set[str]:
    return {field.name for field in fields(law) if field.default is not MISSING}  # type: ignore[arg-type]


def _described(kind: type) -> dict[str, str]:
    """What the docstring of a class and of those that it derives from say of its attributes, by name."""
    from docstring_parser import DocstringStyle, parse

    said: dict[str, str] = {}
    for of in reversed(kind.__mro__):
        for entry in parse(inspect.cleandoc(of.__doc__ or ""), DocstringStyle.NUMPYDOC).params:
            for name in entry.arg_name.split(", "):
                said[name] = " ".join((entry.description or "").split())
    return said


def fault_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of fault files, for editors that complete and check TOML."""
    said = _described(Fault)
    widths = {key: {"type": "number", "description": said} for key, said in _WIDTHS_SAID.items()}
    properties = {
        "name": {"type": "string", "description": "letters, digits, spaces and _ . -"},
        "source": {"type": "string", "description": said["source"]},
        **_quantities(PLANT, said),
        "uncertainty": {
            "oneOf": [{"enum": sorted(BOXES)}, _table(widths, ())],
            "description": _first_line(UncertaintyBox),
        },
        "friction": {"oneOf": [_law_schema(law) for _, law in sorted(friction_laws().items())]},
        "task": _table(_quantities(TASK, _task_described()), ()),
        "disturbance": _table(_quantities(DISTURBANCE, _described(Disturbance)), ()),
    }
    required = ("name", *(key for key in PLANT if key not in OPTIONAL), "friction")
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "fault of quakedesign",
        **_table(properties, required),
    }


def _first_line(kind: type) -> str:
    return (inspect.getdoc(kind) or "").splitlines()[0]


def _table(properties: Mapping[str, Any], required: Any) -> dict[str, Any]:
    return {
        "type": "object",
        "additionalProperties": False,
        "required": list(required),
        "properties": dict(properties),
    }


def _quantities(units: Mapping[str, str], said: Mapping[str, str]) -> dict[str, Any]:
    return {
        key: {
            "type": "string" if unit else ["number", "string"],
            "description": said[key],
            "examples": [_example(key, unit)],
        }
        for key, unit in units.items()
    }


def _law_schema(law: type[FrictionLaw]) -> dict[str, Any]:
    units, said = units_of(law), _described(law)
    options = {field.name for field in fields(law)} - set(units)  # type: ignore[arg-type]
    properties = {
        "law": {"const": law.name, "description": _first(law)},
        **_quantities(units, said),
        **{key: {"type": "string", "description": said.get(key, "")} for key in sorted(options)},
    }
    schema = _table(properties, ("law",))
    schema["patternProperties"] = {
        _pattern(law.quantities()[key].metadata["symbol"]): entry for key, entry in properties.items() if key in units
    }
    schema["allOf"] = [_one_of(law, key) for key in units if key not in _optional(law)]
    return schema


def _pattern(symbol: str) -> str:
    """Pattern of the spellings of a symbol, as `Table.spelling` reads them."""
    letters = re.sub(r"[^a-z0-9]", "", symbol.lower())
    return "^_?" + "_?".join(f"[{c}{c.upper()}]" if c.isalpha() else c for c in letters) + "_?$"


def _one_of(law: type[FrictionLaw], key: str) -> dict[str, Any]:
    """That a parameter is given, by name or symbol."""
    pattern = _pattern(law.quantities()[key].metadata["symbol"])
    return {"anyOf": [{"required": [key]}, {"not": {"propertyNames": {"not": {"pattern": pattern}}}}]}
