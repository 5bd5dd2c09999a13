"""Fault descriptions: TOML files with unit strings, checked at the boundary and turned into `Fault`."""

from collections.abc import Mapping
from dataclasses import MISSING, fields, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from quakedesign.discovery import user_code
from quakedesign.errors import ParameterError, ScenarioError
from quakedesign.fault.checks import Problems, is_ordinary, require_name, require_positive
from quakedesign.fault.defaults import completed
from quakedesign.fault.disturbance import Disturbance, acceleration
from quakedesign.fault.friction import friction_law
from quakedesign.fault.parameters import Fault, require_plant
from quakedesign.fault.reference import Reference
from quakedesign.fault.sources import LARGEST_FILE, source_text
from quakedesign.fault.tables import Table
from quakedesign.fault.uncertainty import UncertaintyBox, uncertainty_box
from quakedesign.fault.units import si_value, units_of
from quakedesign.input import parse_toml
from quakedesign.rationals import rational

PLANT = units_of(Fault)
TASK = units_of(Reference) | {"sampling_time": PLANT.pop("sampling_time")}
DISTURBANCE = units_of(Disturbance)
WIDTHS = ("stiffness", "damping", "authority")
OPTIONAL = ("damping", "width")  # of the plant
_NO_SOURCE = "no source given"
_UNDISTURBED = "no disturbance, so that no guarantee covers one"
_STILL = (
    "frequency 0 of the disturbance, so that its sine is 0 in every run; guarantees are for any course of its size. "
    "Give a frequency to see one"
)


def load_fault(
    source: str | Path, *, box: str | None = None, disturbance: str | None = None, allow_code: bool = False
) -> Fault:
    """Fault from a preset's name or the path of a TOML file.

    Parameters
    ----------
    source : str or Path
        ``"real-fault"``, ``"lab-fault"``, or a path that ends in ``.toml``.
    box : str, optional
        Name of an uncertainty box that replaces the one in the file.
    disturbance : str, optional
        Amplitude in place of the file's: an acceleration, or a shear stress on the fault, such as ``"35 kPa"``, that
        its own area and mass make one.
    allow_code : bool
        Whether the file may name a friction law ``module:Class`` of the user's own, whose module is imported and run.

    Returns
    -------
    Fault
        In SI units.

    Raises
    ------
    UnknownNameError
        For a preset or box that does not exist.
    ScenarioError
        For a file that cannot be read, is not TOML, or lacks or adds a key.
    UnitError, ParameterError
        For a wrong unit or an unphysical value.
    """
    fault = parse_fault(source_text(source), str(source), allow_code=allow_code)
    fault = fault.with_box(box) if box else fault
    if disturbance is None:
        return fault
    if fault.friction.state_names:
        raise ParameterError(
            f"a disturbance of friction with a state is a stress of its own. Received {disturbance!r}. Give --stress."
        )
    amplitude, stressed = acceleration(disturbance, fault.exact_authority, "disturbance")
    stresses = {*fault.disturbance.stresses} - {"amplitude"} | ({"amplitude"} if stressed else set())
    changed = replace(fault.disturbance, amplitude=amplitude, stresses=tuple(sorted(stresses)))
    return fault.with_disturbance(changed)


def parse_fault(text: str, name: str, *, allow_code: bool = False) -> Fault:
    """Fault from the text of a TOML file; `name` names it in messages, all errors in one. See `load_fault`."""
    if len(text) > LARGEST_FILE:
        raise ScenarioError(f"{name}: a fault file must be at most 64 KiB. Received {len(text)} characters.")
    try:
        raw = parse_toml(text)
    except ValueError as error:
        raise ScenarioError(f"{name} is not valid TOML: {error}. Compare with a preset.") from None
    problems = Problems()
    fault: Fault = _fault(Table(raw, problems), problems, allow_code)
    problems.refuse(name)
    return fault


def _fault(table: Table, problems: Problems, allow_code: bool) -> Any:
    """Fault of a whole file; there are problems where it is None."""
    parts: dict[str, Any] = {"name": table.text("name"), "source": _NO_SOURCE}
    if "source" in table.entries:
        parts["source"] = table.text("source")
    for key, unit in PLANT.items():
        parts |= table.quantities({key: unit}, optional=key in OPTIONAL)
    parts["friction"] = _friction(table.table("friction"), problems, allow_code)
    task = _task(table.table("task", optional=True), problems)
    parts["disturbance"] = _disturbance(table.table("disturbance", optional=True), problems, _authority(parts))
    parts["box"] = _box(table, problems)
    table.close()
    given = {key: value for key, value in parts.items() if value is not None}
    whole = task if given == parts else None
    with problems.collected():
        if whole is not None:
            return completed(parts, whole, _assumed(parts, table))
        require_plant(**{key: given[key] for key in PLANT if key in given})
    with problems.collected():
        if whole is None and "name" in given:
            require_name(given["name"])
    return None


def _friction(table: Table | None, problems: Problems, allow_code: bool) -> Any:
    name = table.text("law") if table else None
    if table is None or name is None:
        if table:
            table.say_missing()
        return None
    with problems.collected(), user_code():
        law = friction_law(name, in_file=True, allow_code=allow_code)
        quantities = law.quantities()
        optional = {f.name for f in fields(law) if f.default is not MISSING}  # type: ignore[arg-type]
        read: dict[str, Any] = {}
        for field in fields(law):  # type: ignore[arg-type]
            if field.name in quantities:
                key = table.spelling(field.name, field.metadata["symbol"])
                value = table.quantities({key: field.metadata["unit"]}, optional=field.name in optional)
                read |= dict.fromkeys([field.name] if value else [], value.get(key))
            elif field.name not in optional or field.name in table.entries:
                read[field.name] = table.text(field.name)
        table.close()
        return None if None in read.values() else law(**read)
    return None


def _task(table: Table | None, problems: Problems) -> dict[str, float] | None:
    """What a file says of the task; None where that is wrong."""
    if table is None:
        return {}
    read = table.quantities(TASK, optional=True)
    table.close()
    with problems.collected():
        require_positive("", **{key: value for key, value in read.items() if value is not None})
        return {key: value for key, value in read.items() if value is not None} if None not in read.values() else None
    return None


def _authority(parts: Mapping[str, Any]) -> Fraction:
    """A/m [m²/kg]; of a plant that is wrong, and refused for it, any."""
    density, *sides = (parts.get(name) for name in ("density", "length", "width"))
    told = [value for value in (density, *sides) if value is not None]
    if density is None or len(told) == 1 or not all(map(is_ordinary, told)):
        return Fraction(1)
    return 1 / (rational(density) * rational(min(told[1:])))


def _assumed(parts: Mapping[str, Any], table: Table) -> tuple[str, ...]:
    """What a file leaves open of its disturbance, for friction without a state."""
    if parts["friction"].state_names:
        return ()
    if "disturbance" not in table.entries:
        return (_UNDISTURBED,)
    told = parts["disturbance"]
    return (_STILL,) if told.amplitude and not (told.frequency or told.constant) else ()


def _disturbance(table: Table | None, problems: Problems, authority: Fraction) -> Disturbance | None:
    stresses = []

    def value(quantity: Any, unit: str, name: str) -> float:
        if unit != "m/s^2":
            return si_value(quantity, unit, name)
        size, stressed = acceleration(quantity, authority, name)
        stresses.extend([name.rpartition(".")[2]] if stressed else [])
        return size

    read: dict[str, Any] = {**table.quantities(DISTURBANCE, optional=True, read=value)} if table else {}
    if table:
        table.close()
    with problems.collected():
        return None if None in read.values() else Disturbance(**read, stresses=tuple(sorted(stresses)))
    return None


def _box(parent: Table, problems: Problems) -> UncertaintyBox | None:
    """Named box, or one of the file's own."""
    given = parent.name_or_table("uncertainty", "paper")
    if not isinstance(given, Table):
        with problems.collected():
            return None if given is None else uncertainty_box(given)
        return None
    read = given.quantities(dict.fromkeys(WIDTHS, ""), optional=True)
    given.close()
    with problems.collected():
        widths = {key: rational(value, f"uncertainty.{key}") for key, value in read.items() if value is not None}
        return None if None in read.values() else UncertaintyBox(name="own", **widths)
    return None
