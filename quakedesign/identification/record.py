"""Laboratory records: CSV with units, noise estimate, straight parts, and thinning.

Columns are converted to SI when read. Thinning replaces neighbouring samples by their mean where signals
vary slowly.
"""

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import stats

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import RecordError
from quakedesign.fault.units import si_value
from quakedesign.files import read_text
from quakedesign.text import nearest_name, shown

# ----------------------------------------------------------------------
# Records of laboratory experiments: columns with units, read at the boundary into SI.

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
}
"""Every known column and its SI unit."""

_SHEAR = {"shear_stress": "normal_stress", "shear_force": "normal_force"}
_LARGEST_FILE = 1 << 27
_PLAUSIBLE = 0.01, 3.0  # median friction [-]
MOST_SAMPLES = 2_000_000
_HEADING = re.compile(r"\s*(\w[\w \-]*?)\s*(?:\[([^\]]*)\]|\(([^)]*)\))?\s*")
_BETWEEN_WORDS = re.compile(r"[ \-]+")


@checked_dataclass(frozen=True, kw_only=True)
class Record:
    """What was measured, in SI, one value a sample.

    Attributes
    ----------
    name : str
        Of the file.
    time : ndarray
        [s], ascending.
    friction : ndarray
        Shear over normal stress [-].
    load_point : ndarray or None
        Displacement of the load point [m].
    slip : ndarray or None
        [m].
    normal : ndarray
        Effective normal stress [Pa] or force [N]; 1 where only friction is known.
    normal_unit : str
        ``"Pa"``, ``"N"`` or nothing.
    counts : ndarray or None
        Of how many measurements every sample is the mean; of one unless told.
    first_rate : float or None
        Rate of the load point in its steady beginning [m/s]; that of the samples unless told.
    """

    name: str
    time: "np.ndarray"
    friction: "np.ndarray"
    load_point: "np.ndarray | None"
    slip: "np.ndarray | None"
    normal: "np.ndarray"
    normal_unit: str
    counts: "np.ndarray | None" = None
    first_rate: float | None = None

    def __repr__(self) -> str:
        return f"Record({self.name!r}: {self.time.size} samples in {self.time[-1] - self.time[0]:.4g} s)"

    @property
    def stiffness_unit(self) -> str:
        """Unit of a stiffness that goes with the normal stress or force."""
        return f"{self.normal_unit or '1'}/m"


def read_record(path: str | Path, *, normal_stress: float | None = None) -> Record:
    """Record from a CSV file whose first line names columns with units, as ``time [s], shear_stress [MPa]``.

    ``Time (s)`` and ``Shear stress (MPa)`` name the same columns. Lines that begin with ``#`` are remarks.

    Parameters
    ----------
    path : str or Path
    normal_stress : float, optional
        Constant effective normal stress [Pa] where there is no such column.

    Returns
    -------
    Record

    Raises
    ------
    RecordError
        When the file cannot be read, or a column is missing, unknown, or holds something else than numbers.
    UnitError
        For a column whose unit is unknown or of another dimension.
    """
    text = read_text(path, "record", largest=_LARGEST_FILE, refusal=RecordError)
    lines = [(n, line) for n, line in enumerate(text.splitlines(), start=1) if line.strip() and line.strip()[0] != "#"]
    if not lines:
        raise RecordError(f"a record must have a line of headings. Received {path}, which is empty.")
    if len(lines) == 1:
        raise RecordError(f"a record must have samples. Received {path}, which has a line of headings alone.")
    factors = _headings(next(csv.reader([lines[0][1]])))
    if len(lines) - 1 > MOST_SAMPLES:
        raise RecordError(
            f"a record must have at most {MOST_SAMPLES} samples. Received {len(lines) - 1}. Cut out the part that "
            "counts."
        )
    values = _values(lines[1:], list(factors))
    given = {name: column * factor for (name, factor), column in zip(factors.items(), values.T, strict=True)}
    return _record(Path(path).stem, given, normal_stress)


def _headings(cells: Sequence[str]) -> dict[str, float]:
    """SI value of one unit of every column, by name."""
    if all(_number(cell) is not None for cell in cells):
        raise RecordError(
            f"a record must begin with a line of headings. Received {shown(','.join(cells))}, numbers alone. Write the "
            "columns with their units above, as in time [s], load_point_displacement [um], shear_stress [MPa], "
            "normal_stress [MPa]."
        )
    headings: dict[str, float] = {}
    for cell in cells:
        match = _HEADING.fullmatch(cell)
        said, *units = match.groups() if match else (cell.strip(), None)
        name, unit = _BETWEEN_WORDS.sub("_", said).lower(), next((u for u in units if u is not None), None)
        if name not in COLUMNS:
            raise RecordError(f"a column must be one of {', '.join(COLUMNS)}. Received {shown(said)}.{_remedy(name)}")
        if name in headings:
            raise RecordError(f"a column must be there once. Received {name} twice. Remove one.")
        if unit is None and COLUMNS[name]:
            raise RecordError(
                f"column {name} must have its unit in brackets. Received {shown(cell.strip())}. "
                f"Write {name} [{COLUMNS[name]}], say."
            )
        plain = not unit or unit.strip() in ("-", "1")
        headings[name] = 1.0 if plain and not COLUMNS[name] else si_value(f"1 {unit}", COLUMNS[name], f"column {name}")
    return headings


def _remedy(name: str) -> str:
    if any(sign in name for sign in ";\t"):
        return " Put commas between columns."
    return nearest_name(name, COLUMNS) or " Remove it, or rename it."


def _values(lines: Sequence[tuple[int, str]], names: Sequence[str]) -> "np.ndarray":
    """Numbers of all lines, shape (samples, columns)."""
    try:
        values = np.loadtxt([line for _, line in lines], delimiter=",", comments=None, ndmin=2)
    except ValueError:
        values = np.empty((0, 0))
    if values.shape == (len(lines), len(names)) and np.all(np.isfinite(values)):
        return values
    return np.array([_row(number, line, names) for number, line in lines])


def _row(number: int, line: str, names: Sequence[str]) -> list[float]:
    """Numbers of one line, or what is wrong with it."""
    cells = line.split(",")
    if len(cells) != len(names):
        raise RecordError(f"line {number} must hold {len(names)} values. Received {len(cells)}.")
    values = []
    for name, cell in zip(names, cells, strict=True):
        value = _number(cell)
        if value is None or not math.isfinite(value):
            raise RecordError(
                f"line {number} must hold a finite number in column {name}. Received {shown(cell.strip())}. Remove "
                "lines without measurement."
            )
        values.append(value)
    return values


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


def _record(name: str, given: dict[str, "np.ndarray"], normal_stress: float | None) -> Record:
    if "time" not in given:
        raise RecordError(f"a record must have the column time. Received {', '.join(given)}. Add time [s].")
    time = given["time"]
    if late := np.flatnonzero(np.diff(time) <= 0).tolist():
        raise RecordError(
            f"time must ascend. Received {time[late[0] + 1]:.9g} s after {time[late[0]]:.9g} s. Sort the record."
        )
    _require_sizes(given)
    friction, normal, unit = _friction(given, normal_stress)
    return Record(
        name=name,
        time=time - time[0] if len(time) else time,
        friction=friction,
        load_point=_load_point(given),
        slip=given.get("slip"),
        normal=normal,
        normal_unit=unit,
    )


_DURATION, _PERIOD, _DISTANCE, _RATE = (1e-6, 1e12), (1e-9, 1e12), (1e-12, 1e6), (1e-15, 1e4)
_SIZES = {"m/s": _RATE, "Pa": (1e-6, 1e15), "N": (1e-6, 1e15)}


def _require_sizes(given: dict[str, "np.ndarray"]) -> None:
    """Refuse sizes that no experiment has, as of a wrong unit: solvers of the fit fail on them.

    Raises
    ------
    RecordError
    """
    time = given["time"]
    if len(time) < 2:
        return
    lasting = float(np.ptp(time))
    sizes = [("the duration", lasting, _DURATION, "s"), ("a sampling period", np.min(np.diff(time)), _PERIOD, "s")]
    for name, column in given.items():
        if COLUMNS[name] == "m":
            sizes.append((f"the range of {name}", np.ptp(column), _DISTANCE, "m"))
            sizes.append((f"the mean rate of {name}", np.ptp(column) / lasting, _RATE, "m/s"))
        elif COLUMNS[name] in _SIZES:
            sizes.append((f"the largest {name}", np.max(np.abs(column)), _SIZES[COLUMNS[name]], COLUMNS[name]))
    for what, size, (least, largest), unit in sizes:
        if size and not least <= size <= largest:
            raise RecordError(
                f"{what} must be from {least:g} to {largest:g} {unit}. Received {size:.3g} {unit}. Check the units."
            )


def _friction(given: dict[str, "np.ndarray"], stress: float | None) -> "tuple[np.ndarray, np.ndarray, str]":
    """Friction coefficient, what is normal to it, and the unit of that."""
    measured = _one_of(given, ("friction", *_SHEAR), "friction, shear_stress or shear_force")
    across = _SHEAR.get(measured) or next((n for n in _SHEAR.values() if n in given), "normal_stress")
    if across in given and stress is not None:
        raise RecordError(f"the normal stress must be given once. Received it beside the column {across}.")
    if across in given:
        normal, unit = given[across], COLUMNS[across]
    elif stress is not None and across == "normal_stress":
        normal, unit = np.full_like(given[measured], stress), "Pa"
    elif measured == "friction":
        normal, unit = np.ones_like(given[measured]), ""
    else:
        remedy = " or a constant normal stress" if across == "normal_stress" else ""
        mixed = set(_SHEAR.values()) & set(given)
        then = "Divide the force by the area that slides." if mixed else "Add it."
        raise RecordError(f"{measured} needs the column {across}{remedy}. Received {', '.join(given)}. {then}")
    if np.any(normal <= 0):
        raise RecordError(f"{across} must be positive. Received {np.min(normal):.6g} {unit}. Compression is positive.")
    friction = given[measured] / (1 if measured == "friction" else normal)
    _require_plausible(friction, measured, across)
    return friction, normal, unit


def _require_plausible(friction: "np.ndarray", measured: str, across: str) -> None:
    """Refuse a friction that no rock has, which costs minutes of a fit, with its likely cause.

    Raises
    ------
    RecordError
    """
    middle = float(np.median(friction))
    least, largest = _PLAUSIBLE
    if middle <= 0:
        raise RecordError(
            f"{measured} must be positive. Received a median of {middle:.3g} of friction. Change its sign."
        )
    if not least <= middle <= largest:
        by = "column" if measured == "friction" else f"units of {measured} and {across}, of --normal-stress too"
        raise RecordError(
            f"friction must have a median from {least:g} to {largest:g}. Received {middle:.3g}. Check the {by}."
        )


def _load_point(given: dict[str, "np.ndarray"]) -> "np.ndarray | None":
    """Displacement [m] since the first sample, of a rate by the rule of trapezoids."""
    names = [name for name in ("load_point_displacement", "load_point_rate") if name in given]
    if not names:
        return None
    column = given[_one_of(given, ("load_point_displacement", "load_point_rate"), "load_point_displacement or _rate")]
    if names == ["load_point_displacement"]:
        since_first: np.ndarray = column - column[0]
        return since_first
    moved = np.diff(given["time"]) * (column[1:] + column[:-1]) / 2
    whole: np.ndarray = np.concatenate([[0.0], np.cumsum(moved)])
    return whole


def _one_of(given: dict[str, "np.ndarray"], names: Sequence[str], what: str) -> str:
    found = [name for name in names if name in given]
    if len(found) != 1:
        raise RecordError(f"a record must have exactly one column {what}. Received {', '.join(found) or 'none'}.")
    return found[0]


# ----------------------------------------------------------------------
# Straight parts of what was measured: its noise from sample to sample, and how far a line goes through it.

FAR_OFF = 4.0  # deviations of a displacement that no noise explains
_FIRST = 20  # samples
_BENDS = 2  # among the first samples, which a change of rate alone may have
_MEDIAN = 0.6745  # of the size of a normal deviate


def scatter(time: "np.ndarray", values: "np.ndarray") -> float:
    """Standard deviation of noise from sample to sample: the median distance from the line between both neighbours."""
    if len(time) < 3:
        return 0.0
    share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    off = values[1:-1] - (1 - share) * values[:-2] - share * values[2:]
    return float(np.median(np.abs(off) / np.sqrt(1 + share**2 + (1 - share) ** 2))) / _MEDIAN


def reading_step(values: "np.ndarray") -> float:
    """Step in which values are read, if the first ones stay now and then, or bend often by it; else next to nothing."""
    levels, first = np.unique(values), np.diff(values[:_FIRST])
    step = float(np.min(np.diff(levels))) if len(levels) > 1 else 0.0
    read_in_steps = np.any(first == 0) or np.sum(np.abs(np.diff(first)) > step / 2) > _BENDS
    return step if read_in_steps else 1e-9 * float(np.ptp(values))


def straight_beginning(time: "np.ndarray", values: "np.ndarray", allowed: float) -> int:
    """Samples from the first on that lie within `allowed` of their line, at least two."""

    def straight(count: int) -> bool:
        t, x = time[:count] - np.mean(time[:count]), values[:count] - np.mean(values[:count])
        return bool(np.max(np.abs(x - t * (t @ x) / (t @ t))) <= allowed)

    good, bad = 2, 4
    while bad <= len(time) and straight(bad):
        good, bad = bad, 2 * bad
    bad = min(bad, len(time) + 1)
    while bad - good > 1:
        count = (good + bad) // 2
        good, bad = (count, bad) if straight(count) else (good, count)
    return min(good, len(time))


def first_rate(time: "np.ndarray", position: "np.ndarray") -> float:
    """Rate [m/s] of a position that moves steadily at first: of the longest beginning that is a line but for noise."""
    allowed = FAR_OFF * scatter(time, position) + reading_step(position)
    count = straight_beginning(time, position, allowed)
    return float(np.polyfit(time[:count], position[:count], 1)[0])


# ----------------------------------------------------------------------
# Long records as means of neighbouring samples, over times that are short against everything that changes.

MOST_PLAIN = 3000  # samples that are taken as they are
MOST_MEANS = 20000
_SHARE = 0.1  # of the time to the nearest bend, that a mean is taken over
_MOST_COUNT = 2500  # samples of a mean, whose noise would otherwise be less than what a bend adds
_ACCIDENT = 0.05  # chance that noise alone makes a bend somewhere in a column
_FRICTION_FLOOR = 1e-4  # of its range, and of a normal load: what no machine measures
_NORMAL_FLOOR = 1e-5
_STEEPEST = 1e4  # of friction over any displacement [1/m]: machines and D_c of laboratories are softer and longer


def thinned(record: Record) -> Record:
    """A record with means in place of samples, and how many samples each stands for; short ones as they are.

    Friction, load point, slip and normal load are cut into pieces in which each is a line but for its noise. A mean is
    taken over at most a tenth of the time to the nearer end of its piece, thus over a twentieth of the piece at most:
    steps and what follows them keep their samples. Where a piece bends by as much as its noise hides, 5 deviations,
    the mean over a time then differs from friction at the mean time by 0.004 deviations of a sample, which is a fifth
    of the noise of the mean of 2500, the most that there are.

    Parameters
    ----------
    record : Record

    Raises
    ------
    RecordError
        When too many means are left.
    """
    if len(record.time) <= MOST_PLAIN:
        return record
    edges = _edges(record.time, _bends(record))
    if len(edges) - 1 > MOST_MEANS:
        raise RecordError(
            f"a record must have at most {MOST_MEANS} samples or means over times in which nothing bends. Received "
            f"{len(record.time)} samples, which need {len(edges) - 1}. Cut out the part that counts."
        )
    counts = np.diff(edges)

    def means(values: "np.ndarray") -> "np.ndarray":
        found: np.ndarray = values[0] + np.add.reduceat(values - values[0], edges[:-1]) / counts
        return found

    return replace(
        record,
        time=means(record.time),
        friction=means(record.friction),
        load_point=None if record.load_point is None else means(record.load_point),
        slip=None if record.slip is None else means(record.slip),
        normal=means(record.normal),
        counts=counts,
        first_rate=None if record.load_point is None else first_rate(record.time, record.load_point),
    )


def _bends(record: Record) -> "np.ndarray":
    """Samples at which a column leaves its line by more than its noise, with the first and the end."""
    friction = max(_noise(record.time, record.friction), _FRICTION_FLOOR * float(np.ptp(record.friction)))
    columns = [(record.friction, friction), (record.normal, _NORMAL_FLOOR * float(np.max(record.normal)))]
    columns += [(moved, friction / _STEEPEST) for moved in (record.load_point, record.slip) if moved is not None]
    bends = {0, len(record.time)}
    for values, floor in columns:
        allowed, begin = max(_noise(record.time, values), floor), 0
        while begin < len(record.time):
            begin += straight_beginning(record.time[begin:], values[begin:], allowed)
            bends.add(begin)
    return np.array(sorted(bends))


def _noise(time: "np.ndarray", values: "np.ndarray") -> float:
    """What noise and steps of reading add to a line at most, but for a small chance."""
    return float(stats.norm.isf(_ACCIDENT / 2 / len(time))) * scatter(time, values) + reading_step(values)


def _edges(time: "np.ndarray", bends: "np.ndarray") -> "np.ndarray":
    """First samples of all means, and the end; nothing bends at the ends of a record, whose first sample stays."""
    edges = [0, 1]
    for begin, end in zip(bends[:-1].tolist(), bends[1:].tolist(), strict=True):
        first = time[begin] if begin > 0 else -np.inf
        last = time[end - 1] if end < len(time) else np.inf
        longest, at = _SHARE / 2 * (time[end - 1] - time[begin]), max(begin, 1)
        while at < end:
            before, after = _SHARE * (time[at] - first), _SHARE * (last - time[at]) / (1 + _SHARE)
            until = time[at] + min(before, after, longest)
            ahead = time[at : min(at + _MOST_COUNT, end)]
            at += max(1, int(np.searchsorted(ahead, until, side="right")))
            edges.append(at)
    return np.array(edges)
