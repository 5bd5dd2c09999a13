"""Laboratory files: text of any dialect, xlook's text and binary formats, MATLAB arrays.

A file becomes columns with its own names, units and numbers, which `quakedesign.identification.record` interprets.
"""

import csv
import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy import ndarray
from scipy.io import loadmat, whosmat
from scipy.io.matlab import MatReadError

from quakedesign.errors import RecordError, UnitError
from quakedesign.fault.units import si_value
from quakedesign.files import read_bytes
from quakedesign.text import nearest_name, shown

_LARGEST_FILE = 1 << 28
MOST_SAMPLES = 2_000_000
_COMMENTS = ("#", "%")
_NUMBER = r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eEdD][+-]?\d+)?"
_MISSING = {"", "nan", "na", "n/a", "-", "--", "null", "none", "inf", "+inf", "-inf"}
_CELL = re.compile(rf"{_NUMBER}|\d{{1,4}}[-/.]\d{{1,2}}[-/.]\d{{1,4}}.*")
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eEdD][+-]?\d+)?")
_HEADING = re.compile(r"\s*(.*?)\s*(?:\[([^\]]*)\]|\(([^()]*)\))?\s*")
_BLANK_HEADING = re.compile(r"[^\s\[(]+(?:\s*(?:\[[^\]]*\]|\([^)]*\)))?")
_PREAMBLE = 200  # largest number of lines before the first number
_HEADERS = {16: 1380, 32: 2724}  # size of xlook's header [byte], by the number of channels
_XLOOK_TEXT = "number of records"
_ARRAYS = {f"{sign}int{size}" for sign in ("", "u") for size in (8, 16, 32, 64)} | {"double", "single"}
_MOST_NUMBERS = 16 * MOST_SAMPLES
_UNIT_WORDS = {"", *"s sec ms min h m mm um µm μm mic micron microns nm cm Pa kPa MPa Mpa GPa N kN MN - 1 Hz".split()}
_UNIT_WORDS |= {f"{each}/{time}" for each in "m mm um µm mic micron microns nm".split() for time in ("s", "sec")}
"""Words that a line of units may contain."""


@dataclass(frozen=True, kw_only=True)
class Column:
    """One column, as in the file."""

    heading: str  # name and unit, as in the file
    name: str
    unit: str | None
    values: ndarray  # NaN where the file has no number


def read_columns(path: str | Path) -> list[Column]:
    """Columns of a file, of equal length; `RecordError` for an unknown format or lines that misfit the headings."""
    data = read_bytes(path, "record", largest=_LARGEST_FILE, refusal=RecordError)
    if data.startswith(b"MATLAB 5.0"):
        columns = _matlab(data, path)
    elif (offset := _xlook_offset(data)) is not None:
        columns = _xlook_binary(data, *offset)
    else:
        columns = _text(_decoded(data, path), path)
    if len(columns[0].values) > MOST_SAMPLES:
        raise RecordError(
            f"a record must have at most {MOST_SAMPLES} samples. Received {len(columns[0].values)}. Extract the "
            "relevant part."
        )
    return columns


def heading(text: str) -> Column:
    """Name and unit of a heading, such as ``Time (s)``, ``tau [MPa]``, ``disp_um``."""
    text = " ".join(text.split())
    name, square, rounded = _HEADING.fullmatch(text).groups()  # type: ignore[union-attr]
    return Column(heading=text, name=name, unit=rounded if square is None else square, values=np.empty(0))


def _decoded(data: bytes, path: str | Path) -> str:
    """Text of bytes: UTF-8, UTF-16 with its byte-order mark, or Latin-1, used by older instruments for µ."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    if "\0" in text[:1000]:
        raise RecordError(
            f"a record must be text, xlook's binary or a MATLAB file of version 5 to 7. Received {path}, which is "
            "none of them. Export it as CSV."
        )
    return text


def _text(text: str, path: str | Path) -> list[Column]:
    lines = text[: 1 << 20].splitlines()
    if not any(line.strip() and line.strip()[0] not in _COMMENTS for line in lines):
        raise RecordError(f"a record must have a line of headings. Received {path}, which is empty.")
    if lines[0].strip().startswith(_XLOOK_TEXT):
        return _xlook_text(text)
    first = next((i for i, line in enumerate(lines[:_PREAMBLE]) if _numbers(line)), None)
    if first is None:
        raise RecordError(f"a record must have samples. Received {path}, which has no line of numbers.")
    sign = _separator(lines[first])
    columns = _headings(lines[:first], len(_cells(lines[first], sign)), sign)
    table = _table(text, first, sign, columns, lines[first])
    return [
        replace(column, values=_values(table[i], column, text, first)) for i, column in enumerate(columns) if i in table
    ]


def _numbers(line: str) -> bool:
    """Whether a line has at least two numbers or dates, among them the first cell that is not empty."""
    if not line.strip() or line.strip()[0] in _COMMENTS:
        return False
    cells = [cell.strip() for cell in _cells(line, _separator(line))]
    numeric = [_CELL.fullmatch(cell) is not None for cell in cells if cell.lower() not in _MISSING]
    return sum(numeric) > 1 and numeric[0]


def _separator(line: str) -> str:
    """Separator of the columns of a line of numbers; a pattern of blanks if there is no other."""
    return next((sign for sign in (";", "\t", ",") if sign in line.strip()), r"\s+")


def _cells(line: str, sign: str) -> list[str]:
    cells = line.split() if sign == r"\s+" else next(csv.reader([line], delimiter=sign), [])
    return cells[:-1] if len(cells) > 1 and not cells[-1].strip() else cells


def _headings(before: list[str], count: int, sign: str) -> list[Column]:
    """Names and units of the columns, from the lines before the first numbers; without headings, numbers as names.

    A line of units may follow the headings, and headings may be a comment line, as NumPy writes them.
    """
    parts = [line.strip() for line in before if line.strip()]
    plain = [line for line in parts if line[0] not in _COMMENTS]
    lines = plain or [line.lstrip("".join(_COMMENTS)) for line in parts[-1:]]
    split = [_heading_cells(line, sign) for line in lines[-2:]]
    if not split or (not plain and len(split[-1]) != count):
        return [Column(heading=str(i), name=str(i), unit=None, values=np.empty(0)) for i in range(1, count + 1)]
    *above, last = split
    if above and len(above[0]) == len(last) and all(cell.strip(" []().") in _UNIT_WORDS for cell in last):
        named = [heading(f"{name} [{unit.strip(' []()')}]") for name, unit in zip(above[0], last, strict=True)]
    else:
        named = [heading(cell) for cell in last]
    if len(named) != count and {len(named), count} != {count, count - 1}:
        _reject_count(named, count, sign)
    return named


def _heading_cells(line: str, sign: str) -> list[str]:
    """Cells of a line of headings, whose separator may differ from that of the numbers below."""
    own = sign if sign == r"\s+" or sign in line else _separator(line)
    cells = _BLANK_HEADING.findall(line) if own == r"\s+" else _cells(line, own)
    return [cell.strip() for cell in cells]


def _reject_count(named: list[Column], count: int, sign: str) -> None:
    if sign == "," and len(named) < count <= 2 * len(named):
        raise RecordError(
            f"a line must have {len(named)} values, one for each column. Received {count}: commas separate the columns "
            "and are decimal signs. Separate the columns by semicolons, or write decimal points."
        )
    raise RecordError(
        f"a line must have {len(named)} values, one for each column. Received {count} under the headings "
        f"{shown(', '.join(column.heading for column in named))}. Write one heading without blanks for each column."
    )


def _table(text: str, first: int, sign: str, columns: list[Column], line: str) -> pd.DataFrame:
    """Numbers of a text by the index of their column."""
    cells = _cells(line, sign)
    comma = sign != "," and any(_DECIMAL_COMMA.fullmatch(cell.strip()) for cell in cells)
    try:
        table = pd.read_csv(
            io.StringIO(text),
            sep=sign,
            header=None,
            skiprows=first,
            comment="#",
            decimal="," if comma else ".",
            skipinitialspace=True,
            na_values=["-", "--", "inf", "-inf"],
            engine="c",
            low_memory=False,
        )
    except (pd.errors.ParserError, ValueError) as error:
        match = re.search(r"Expected (\d+) fields in line (\d+), saw (\d+)", str(error))
        what = (
            f"line {int(match[2])} must have {match[1]} values. Received {match[3]}. Complete or remove it."
            if match
            else "all lines must have the same number of values. Complete or remove those that do not."
        )
        raise RecordError(what) from None
    if len(columns) == len(cells) - 1:  # row numbers without a heading, such as xlook's, come first
        table = table.drop(columns=0)
        table.columns = range(table.shape[1])
    return table


def _values(cells: pd.Series, column: Column, text: str, first: int) -> ndarray:
    """Numbers of one column; NaN where nothing was measured. Any other text is rejected."""
    if pd.api.types.is_numeric_dtype(cells):
        values: ndarray = cells.to_numpy(dtype=float, copy=True)
        values[~np.isfinite(values)] = np.nan
        return values
    texts = cells.astype(str).str.strip()
    texts = texts.where(~texts.str.lower().isin(_MISSING), "nan")
    if _is_date(texts.iloc[0]):
        dates = pd.to_datetime(texts, format="ISO8601", errors="coerce")
        if dates.notna().all():
            return np.asarray((dates - dates.iloc[0]).dt.total_seconds().to_numpy(dtype=float))
    numbers = pd.to_numeric(texts.str.replace(r"(?<=[\d.])[dD](?=[+-]?\d)", "e", regex=True), errors="coerce")
    wrong = (numbers.isna() & (texts != "nan")).to_numpy().nonzero()[0]
    if len(wrong):
        cell, numbered = texts.iloc[int(wrong[0])], enumerate(text.splitlines(), start=1)
        rows = [i for i, line in numbered if i > first and line.strip() and line.strip()[0] != "#"]
        raise RecordError(
            f"line {rows[int(wrong[0])]} must have a number in column {column.name}. Received {shown(cell)}."
            f"{_remedy(cell)}"
        )
    return np.asarray(numbers.to_numpy(dtype=float))


def _is_date(cell: str) -> bool:
    return _CELL.fullmatch(cell) is not None and not re.fullmatch(_NUMBER, cell)


def _remedy(cell: str) -> str:
    if _is_date(cell):
        return " Write seconds, or dates as 2024-03-05 10:00:00.1."
    if re.fullmatch(r"[+-]?\d+,\d+", cell):
        return " Write decimal points, or decimal commas in every number."
    return " Correct it, or leave it empty where nothing was measured."


def _xlook_text(text: str) -> list[Column]:
    """Output of xlook's command `type`: a count; numbers, names, units and lengths of the columns; then rows."""
    lines = text.splitlines()
    names, units = (lines[i].split() if len(lines) > i else [] for i in (2, 3))
    if len(names) != len(units) or len(lines) < 6:
        raise RecordError(
            f"xlook's text must have as many units as columns. Received {len(units)} for {len(names)}. Write names "
            "and units without blanks."
        )
    table = pd.read_csv(io.StringIO(text), sep=r"\s+", header=None, skiprows=5, engine="c")
    columns = [heading(f"{name} [{unit}]") for name, unit in zip(names, units, strict=True)]
    if table.shape[1] != len(columns) + 1:
        _reject_count(columns, table.shape[1] - 1, r"\s+")
    return [replace(column, values=_values(table[i], column, text, 5)) for i, column in enumerate(columns, start=1)]


def _xlook_offset(data: bytes) -> tuple[int, int, str] | None:
    """Header size [byte], number of channels and number type of an xlook binary file; None for another file."""
    if len(data) < min(_HEADERS.values()):
        return None
    records, channels = (int.from_bytes(data[i : i + 4], "big") for i in (20, 24))
    for most, size in _HEADERS.items():
        for width, kind in ((4, ">f4"), (8, "<f8")):
            if 0 < channels <= most and records > 0 and len(data) == size + width * records * channels:
                return size, channels, kind
    return None


def _xlook_binary(data: bytes, size: int, channels: int, kind: str) -> list[Column]:
    """Columns of big-endian floats, or of doubles in the byte order of the machine."""
    table = np.frombuffer(data[size:], dtype=kind)
    if kind == "<f8" and not np.all(np.abs(table) < 1e30):
        table = np.frombuffer(data[size:], dtype=">f8")
    table = table.astype(float).reshape(channels, -1)
    if b"bits" in data[36 : 36 + 84 * channels]:
        raise RecordError(
            "xlook's binary must contain a reduced record. Received raw readings, in bits. Run its reduction (the file "
            "that ends in _r) in xlook and write the record as text, or as binary again."
        )
    words = [data[36 + 84 * i : 36 + 84 * i + 26] for i in range(channels)]
    headings = [[part.split(b"\0")[0].decode("latin-1").strip() for part in (word[:13], word[13:])] for word in words]
    return [replace(heading(f"{name} [{unit}]"), values=row) for (name, unit), row in zip(headings, table, strict=True)]


def _matlab(data: bytes, path: str | Path) -> list[Column]:
    """Numeric arrays of a MATLAB file; the columns of a matrix are named by their numbers."""
    try:
        listed = whosmat(io.BytesIO(data))
        kinds = {name: shape for name, shape, kind in listed if kind in _ARRAYS}
        if sum(math.prod(shape) for shape in kinds.values()) > _MOST_NUMBERS:
            raise ValueError(f"more than {_MOST_NUMBERS} numbers")
        content = loadmat(io.BytesIO(data), squeeze_me=True, variable_names=list(kinds))
    except (MatReadError, NotImplementedError, ValueError, TypeError, OSError) as error:
        raise RecordError(f"a MATLAB file must be readable. Received {path}: {error}. Save it with -v7.") from None
    arrays = {n: value for n, value in content.items() if isinstance(value, np.ndarray) and value.dtype.kind in "iuf"}
    long = max((value.shape[0] for value in arrays.values() if value.ndim), default=0)
    if long < 2:
        raise RecordError(
            f"a MATLAB file must contain numeric arrays of equal length. Received {path} with "
            f"{', '.join(name for name, *_ in listed) or 'nothing'}. Save the columns as vectors."
        )
    vectors = []
    for name, value in arrays.items():
        if value.shape == (long,):
            vectors.append(replace(heading(name), values=value.astype(float)))
        elif value.ndim == 2 and value.shape[0] == long:
            columns = enumerate(value.T.astype(float), start=len(vectors) + 1)
            vectors += [replace(heading(str(i)), values=column) for i, column in columns]
    return vectors


# ----------------------------------------------------------------------
# Columns of a record by name: headings that laboratories use, their units, and names that the user assigns.

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
    """Columns in SI units by name, and remarks on headings; `RecordError` for missing, double or unclear headings."""
    given: dict[str, ndarray] = {}
    headings: dict[str, str] = {}
    named = _assigned(columns, wanted)
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


def _assigned(columns: Sequence[Column], wanted: str) -> dict[str, tuple[str, Column]]:
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
            f"an instrument. Calibrate it first, or give the size of one count: --columns '{name}={column.name} "
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
