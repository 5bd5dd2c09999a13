"""Columns of a record by name: headings that laboratories use, their units, and names that the user assigns."""

import re
from collections.abc import Sequence
from dataclasses import replace

from numpy import ndarray

from quakedesign.errors import RecordError, UnitError
from quakedesign.fault.units import si_value
from quakedesign.identification.record_file import Column, heading
from quakedesign.text import nearest_name, shown

COLUMNS = {
    "time": "s",
    "load_point_displacement": "m",
    "load_point_rate": "m/s",
    "shear_stress": "Pa",
    "shear_force": "N",
    "friction": "",
    "normal_stress": "Pa",
    "normal_force": "N",
    "slip": "m",
    "weight": "",
}
"""SI unit of every column that a record may have."""

_NAMES = {
    "time": "t elapsedtime seconds",
    "load_point_displacement": "displ disp displacement loadpoint loadpointdisp lpdisp lpdisplacement lpd xlp "
    "sheardisplacement sheardisp",
    "load_point_rate": "loadpointvelocity lpvelocity lpvel velocity vel vlp loadingrate loadingvelocity",
    "shear_stress": "tau shear shrstress shearstr",
    "shear_force": "shrforce",
    "friction": "mu frictioncoefficient coefficientoffriction frictioncoeff cof",
    "normal_stress": "sigman sigma sigmaneff norstress normalstr sn effnormalstress effectivenormalstress effnorstress",
    "normal_force": "norforce",
}
_MEANT = {name.replace("_", ""): name for name in COLUMNS} | {
    other: name for name, others in _NAMES.items() for other in others.split()
}
"""Column of each name that laboratories use, in lower case without punctuation."""
_UNITS = {"mic": "um", "micron": "um", "microns": "um", "sec": "s", "secs": "s", "seconds": "s"}
_UNITS |= {"MPA": "MPa", "Mpa": "MPa", "mpa": "MPa", "KPa": "kPa", "kpa": "kPa", "Pascal": "Pa"}
_COUNTS = {"bit", "bits", "volt", "volts", "V", "mV", "counts"}


def columns_by_name(columns: Sequence[Column], wanted: str) -> tuple[dict[str, ndarray], list[str]]:
    """Columns in SI units by name, and remarks on how their headings were read."""
    given: dict[str, ndarray] = {}
    headings: dict[str, str] = {}
    named = _wanted(columns, wanted)
    unknown: list[Column] = []
    for column in columns:
        name, column = named.get(column.heading, (_meant(column.name), column))
        name = name if name or column.unit else _meant(column.name.rpartition("_")[0])
        if not name:
            unknown.append(column)
        elif name in given:
            raise RecordError(
                f"a column must occur once. Received {name} twice: {headings[name]} and {column.heading}. Choose one "
                f"by --columns '{name}={column.heading}', or remove one."
            )
        else:
            given[name], headings[name] = column.values * _factor(name, column), column.heading
    if not given and all(column.heading.isdigit() for column in columns):
        raise RecordError(
            f"a record must begin with a line of headings. Received {len(columns)} columns of numbers alone. Write "
            "names and units above, or give them: --columns 'time=1 [s], load_point_displacement=2 [um], "
            "shear_stress=3 [MPa], normal_stress=4 [MPa]'."
        )
    for column in unknown:
        near = nearest_name(column.name.lower().replace(" ", "_"), COLUMNS)
        if near and near.split()[-1].strip("?") not in given:
            raise RecordError(
                f"a column must be one of {', '.join(COLUMNS)}. Received {shown(column.name)}.{near} Other headings "
                f"are assigned by --columns 'time={column.name} [s], …'."
            )
    left = ", ".join(shown(column.heading) for column in unknown)
    if "time" not in given:
        others, example = (f", and unknown: {left}", unknown[0].name) if unknown else ("", "1")
        raise RecordError(
            f"a record must have the column time. Received {', '.join(given) or 'none'}{others}. Add time [s], or name "
            f"it: --columns 'time={example} [s]'."
        )
    remarks = [f"{headings[n]} is read as {n}" for n in given if _squeezed(heading(headings[n]).name) != _squeezed(n)]
    return given, [*remarks, *([f"not read: {left}"] if unknown else [])]


def _squeezed(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _meant(name: str) -> str:
    return _MEANT.get(_squeezed(name), "")


def _wanted(columns: Sequence[Column], wanted: str) -> dict[str, tuple[str, Column]]:
    """Names that the user assigns to headings, with the columns in the units given."""
    by_name = {place: column for i, column in enumerate(columns, start=1) for place in (str(i), column.name)}
    by_name |= {column.heading: column for column in columns}
    named: dict[str, tuple[str, Column]] = {}
    for part in filter(None, (each.strip() for each in re.split(r",(?![^\[(]*[\])])", wanted))):
        name, _, text = (each.strip() for each in part.partition("="))
        if name not in COLUMNS or not text:
            raise RecordError(
                f"--columns must assign headings, as time=Time(s), to {', '.join(COLUMNS)}. Received {shown(part)}."
                f"{nearest_name(name, COLUMNS) if text else ' Write an equals sign.'}"
            )
        head = heading(text)
        column = by_name.get(text) or by_name.get(head.heading) or by_name.get(head.name)
        if column is None:
            near = nearest_name(head.name, by_name) or f" Write one of {', '.join(shown(c.heading) for c in columns)}."
            raise RecordError(f"--columns must name a heading of the file. Received {shown(text)}.{near}")
        named[column.heading] = name, replace(column, unit=column.unit if head.unit is None else head.unit)
    chosen = {name for name, _ in named.values()}
    return {c.heading: ("", c) for c in columns if _meant(c.name) in chosen} | named


def _factor(name: str, column: Column) -> float:
    """SI value of one unit of a column."""
    unit, wanted = column.unit, COLUMNS[name]
    if unit is None and wanted and "_" in column.name:
        unit = column.name.rpartition("_")[2]
    plain = unit is None or unit.strip() in ("", "-", "1", ".")
    if plain and wanted and (unit is not None or column.unit is None):
        raise RecordError(
            f"column {name} must have its unit in brackets. Received {shown(column.heading)}. Write {name} [{wanted}], "
            f"say, or give it: --columns '{name}={column.heading} [{wanted}]'."
        )
    if plain:
        return 1.0
    written = re.sub(r"[^\W\d_]+", lambda word: _UNITS.get(word[0], word[0]), unit.replace("μ", "µ"))  # type: ignore[union-attr]
    if written.strip().lower() in _COUNTS:
        raise RecordError(
            f"column {name} must be in units of {wanted or 'friction'}. Received {shown(column.heading)}, readings of "
            f"an instrument. Calibrate it first, or give the size of one: --columns '{name}={column.name} "
            f"[{ {'m': '0.0765 um', 'Pa': '0.0016 MPa', 's': '0.1 ms'}.get(wanted, '0.001') }]'."
        )
    try:
        return si_value(
            written if re.match(r"\s*[\d.]+(e[+-]?\d+)? ", written) else f"1 {written}", wanted, f"column {name}"
        )
    except UnitError as wrong:
        if column.unit is not None:
            raise
        raise RecordError(
            f"column {name} must have its unit in brackets. Received {shown(column.heading)}: {wrong}"
        ) from None
