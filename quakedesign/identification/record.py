"""Laboratory records: columns in SI, noise, and means of neighbouring samples."""

import heapq
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy import ndarray

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import RecordError, UnitError
from quakedesign.fault.units import si_value
from quakedesign.identification.record_file import COLUMNS, columns_by_name, read_columns

_SHEAR = {"shear_stress": "normal_stress", "shear_force": "normal_force"}
_SAME = 0.01  # largest relative difference of two columns of friction
_PLAUSIBLE = 0.01, 3.0  # range of the median friction [-]; outside it a fit takes minutes


@checked_dataclass(frozen=True, kw_only=True)
class Record:
    """Measured signals in SI units, one value per sample.

    Attributes
    ----------
    name : str
        Name of the file.
    time : ndarray
        Times of the samples [s], ascending.
    friction : ndarray
        Shear over normal stress [-].
    load_point : ndarray or None
        Displacement of the load point [m].
    slip : ndarray or None
        Slip of the fault [m].
    normal : ndarray
        Effective normal stress [Pa] or force [N]; 1 where only friction is known.
    normal_unit : str
        ``"Pa"``, ``"N"`` or empty.
    counts : ndarray or None
        Number of measurements that were averaged into each sample, or the weight of the sample; 1 by default.
    load_rates : ndarray or None
        Rates of the load point from each sample on [m/s], where these were recorded in place of its displacement.
    remarks : tuple of str
        Decisions made when the file was read.
    origin : float
        Time of the first sample in its file [s].
    """

    name: str
    time: ndarray
    friction: ndarray
    load_point: ndarray | None
    slip: ndarray | None
    normal: ndarray
    normal_unit: str
    counts: ndarray | None = None
    load_rates: ndarray | None = None
    remarks: tuple[str, ...] = ()
    origin: float = 0.0

    def __repr__(self) -> str:
        return f"Record({self.name!r}: {self.time.size} samples in {self.time[-1] - self.time[0]:.4g} s)"

    @property
    def largest(self) -> float:
        """Largest |friction| [-]."""
        return float(np.max(np.abs(self.friction)))

    @property
    def path(self) -> ndarray | None:
        """Displacement of the load point, or slip where only that was measured [m]."""
        return self.slip if self.load_point is None else self.load_point

    @property
    def stiffness_unit(self) -> str:
        """Unit of a stiffness, by the unit of the normal stress or force."""
        return f"{self.normal_unit or '1'}/m"


def read_record(
    path: str | Path,
    *,
    normal_stress: float | None = None,
    columns: str = "",
    begin: str | None = None,
    end: str | None = None,
) -> Record:
    """Record from a file whose headings name columns with units, such as ``time [s], shear_stress [MPa]``.

    Formats: text with any column separator and decimal points or commas, text and binary files of xlook, and numeric
    MATLAB arrays. ``Time (s)``, ``LP_Disp [mic]`` and ``mu`` name columns as well. The remarks of the record list the
    decisions made when it is read.

    Parameters
    ----------
    path : str or Path
    normal_stress : float, optional
        Constant effective normal stress [Pa] where there is no such column.
    columns : str
        Headings of the columns, such as ``time=Time(s), friction=7``; a number is the position of a heading, and
        ``friction=mu_corr [1]`` gives a unit.
    begin, end : str, optional
        Window, such as ``8110 s`` or ``1600 um``, in the time or load-point displacement of the file.

    Returns
    -------
    Record

    Raises
    ------
    RecordError
        When the file cannot be read, or a column is missing, unknown or not numeric.
    UnitError
        For a column whose unit is unknown or of another dimension.
    """
    return read_windows(path, [(begin, end)], normal_stress=normal_stress, columns=columns)[0]


def read_windows(
    path: str | Path,
    windows: Sequence[tuple[str | None, str | None]],
    *,
    normal_stress: float | None = None,
    columns: str = "",
) -> list[Record]:
    """Records of several windows of a file, which is read once; see `read_record`."""
    given, remarks = columns_by_name(read_columns(path), columns)
    given, repairs = _measured(given)
    records = []
    for window in windows:
        inside, left = _weighted(_window(given, *window))
        _require_sizes(inside)
        friction, normal, unit = _friction(inside, normal_stress)
        load_point, rates, turned = _load_point(inside)
        record = Record(
            name=Path(path).stem,
            time=inside["time"] - inside["time"][0],
            friction=friction,
            load_point=load_point,
            slip=inside.get("slip"),
            normal=normal,
            normal_unit=unit,
            load_rates=rates,
            counts=inside.get("weight"),
            remarks=(*remarks, *repairs, *left, *turned),
            origin=float(inside["time"][0]),
        )
        records.append(record)
    return records


def part(record: Record, inside: ndarray, name: str) -> Record:
    """Record of the samples of a record where `inside` is true; its time and load point start at 0."""
    values: dict[str, Any] = {n: column[inside] for n, column in vars(record).items() if isinstance(column, np.ndarray)}
    begun = float(values["time"][0]) if np.any(inside) else 0.0
    for along in values.keys() & {"time", "load_point"}:
        values[along] = values[along] - values[along][:1]
    return replace(record, name=name, origin=record.origin + begun, **values)


def _weighted(given: dict[str, ndarray]) -> tuple[dict[str, ndarray], list[str]]:
    """Samples of positive weight, with a mean weight of 1, and a remark on the others."""
    if "weight" not in given:
        return given, []
    weight = given["weight"]
    if np.any(weight < 0) or np.sum(weight > 0) < 2:
        raise RecordError(
            f"weight must be positive, or 0 for excluded samples. Received {np.min(weight):.6g} to "
            f"{np.max(weight):.6g}. Write values proportional to 1/variance of friction."
        )
    given = {name: column[weight > 0] for name, column in given.items()}
    lost = f"{int(np.sum(weight == 0))} samples of weight 0 excluded"
    return given | {"weight": given["weight"] / np.mean(given["weight"])}, [lost] * bool(np.any(weight == 0))


def _measured(given: dict[str, ndarray]) -> tuple[dict[str, ndarray], list[str]]:
    """Complete rows, with the mean of rows at the same time, and remarks on both."""
    table, repairs = pd.DataFrame(given), []
    whole = table.dropna()
    if lost := len(table) - len(whole):
        repairs.append(f"{lost} of {len(table)} rows excluded, because a number is missing")
    if whole.empty:
        raise RecordError(
            f"a record must have rows with a number in every column. Received none in {len(table)} rows. Remove the "
            "columns that were not measured."
        )
    time = whole["time"].to_numpy()
    if back := np.flatnonzero(np.diff(time) < 0).tolist():
        raise RecordError(
            f"time must ascend. Received {time[back[0] + 1]:.9g} s after {time[back[0]]:.9g} s. Sort the record, or "
            "cut it where time restarts."
        )
    if (double := int(np.sum(np.diff(time) == 0))) and double < len(time) - 1:
        whole = whole.groupby("time", sort=False, as_index=False).mean()
        repairs.append(f"{double} samples at the time of another: replaced by the mean at this time")
    return {str(name): whole[name].to_numpy() for name in whole}, repairs


def _window(given: dict[str, ndarray], begin: str | None, end: str | None) -> dict[str, ndarray]:
    """Samples between two times or load-point displacements, in the coordinates of the file."""
    inside = np.ones(len(given["time"]), dtype=bool)
    for name, text in (("from", begin), ("to", end)):
        if text is None:
            continue
        try:
            along, at = "time", si_value(text, "s", name)
        except UnitError:
            along, at = "load_point_displacement", si_value(text, "m", f"{name} (a time, or a displacement)")
        if along not in given:
            raise RecordError(f"{name} {text} needs the column {along}. Received {', '.join(given)}. Give a time.")
        moved = given[along] * (-1 if given[along][-1] < given[along][0] else 1)
        inside &= moved >= at if name == "from" else moved <= at
    if not (begin is None and end is None) and inside.sum() < 2:
        time = given["time"]
        raise RecordError(
            f"a window needs two samples. Received from {begin or 'the first'} to {end or 'the last'} in a record from "
            f"{time[0]:.6g} to {time[-1]:.6g} s. Give times or displacements of the file."
        )
    return {name: column[inside] for name, column in given.items()}


_SIZES = {"m": (1e-12, 1e6), "m/s": (1e-15, 1e4), "Pa": (1e-6, 1e15), "N": (1e-6, 1e15)}
_DURATION, _PERIOD = (1e-6, 1e12), (1e-9, 1e12)


def _require_sizes(given: dict[str, ndarray]) -> None:
    """Reject values outside the range of experiments, often due to a wrong unit, on which the solvers fail."""
    time = given["time"]
    if len(time) < 2:
        return
    lasting = float(np.ptp(time))
    sizes = [("the duration", lasting, _DURATION, "s"), ("a sampling period", np.min(np.diff(time)), _PERIOD, "s")]
    for name, column in given.items():
        unit = COLUMNS[name]
        if unit == "m":
            sizes.append((f"the range of {name}", np.ptp(column), _SIZES["m"], "m"))
            sizes.append((f"the mean rate of {name}", np.ptp(column) / lasting, _SIZES["m/s"], "m/s"))
        elif unit in _SIZES:
            sizes.append((f"the largest {name}", np.max(np.abs(column)), _SIZES[unit], unit))
    for what, size, (least, largest), unit in sizes:
        if size and not least <= size <= largest:
            raise RecordError(
                f"{what} must be from {least:g} to {largest:g} {unit}. Received {size:.3g} {unit}. Check the units."
            )


def _friction(given: dict[str, ndarray], stress: float | None) -> tuple[ndarray, ndarray, str]:
    """Friction coefficient, normal stress or force, and the unit of the latter."""
    names = [name for name in ("friction", *_SHEAR) if name in given]
    for shear, across in _SHEAR.items():
        if {"friction", shear, across} <= given.keys():
            difference = np.median(np.abs(given["friction"] * given[across] - given[shear]))
            if difference <= _SAME * np.median(np.abs(given[shear])):  # the same data twice
                names = [name for name in names if name != "friction"]
    if len(names) != 1:
        raise RecordError(
            "a record must have exactly one column friction, shear_stress or shear_force. Received "
            f"{', '.join(names) or 'none'}."
        )
    measured = names[0]
    across = _SHEAR.get(measured) or next((n for n in _SHEAR.values() if n in given), "normal_stress")
    if across in given and stress is not None:
        raise RecordError(f"the normal stress must be given once. Received it as a number and as column {across}.")
    if across in given:
        normal, unit = given[across], COLUMNS[across]
    elif stress is not None and across == "normal_stress":
        normal, unit = np.full_like(given[measured], stress), "Pa"
    elif measured == "friction":
        normal, unit = np.ones_like(given[measured]), ""
    else:
        remedy = " or a constant normal stress" if across == "normal_stress" else ""
        mixed = set(_SHEAR.values()) & set(given)
        then = "Divide the force by the sliding area." if mixed else "Add it."
        raise RecordError(f"{measured} needs the column {across}{remedy}. Received {', '.join(given)}. {then}")
    if np.any(normal <= 0):
        raise RecordError(f"{across} must be positive. Received {np.min(normal):.6g} {unit}. Compression is positive.")
    friction = given[measured] / (1 if measured == "friction" else normal)
    if (middle := float(np.median(friction))) <= 0:
        raise RecordError(f"{measured} must be positive. Received a median friction of {middle:.3g}. Change its sign.")
    least, largest = _PLAUSIBLE
    if not least <= middle <= largest:
        by = "column" if measured == "friction" else f"units of {measured} and {across}, or of --normal-stress"
        raise RecordError(
            f"friction must have a median from {least:g} to {largest:g}. Received {middle:.3g}. Check the {by}."
        )
    return friction, normal, unit


def _load_point(given: dict[str, ndarray]) -> tuple[ndarray | None, ndarray | None, list[str]]:
    """Displacement [m] since the first sample, forward positive; recorded rates [m/s] or None; remarks on signs.

    A recorded rate is the commanded rate from its sample on, a piecewise constant function.
    """
    for name in ("load_point_displacement", "load_point_rate"):
        if name in given:
            column, displaced = given[name], name == "load_point_displacement"
            backward = float(column[-1] - column[0] if displaced else np.sum(column)) < 0
            column = -column if backward else column
            moved = column - column[0]
            if not displaced:
                moved = np.concatenate([[0.0], np.cumsum(np.diff(given["time"]) * column[:-1])])
            return moved, None if displaced else column, [f"{name} runs backward: its sign is changed"] * backward
    return None, None, []


FAR_OFF = 4.0  # standard deviations of a displacement that noise does not explain
_FIRST = 20  # samples in the test for quantised readings
_BENDS = 2  # bends among the first samples that a change of rate alone may cause
_MEDIAN, _NINETIETH = 0.6745, 1.645  # median and 90th percentile of |normal deviate|
MOST_PLAIN = 500  # samples up to which a record is not thinned
MOST_MEANS = 300
_MOST_CURVED = 8000  # means, where friction bends far beyond its noise
_SHARE = 0.5  # longest window, relative to the time since the last change of rate
_PARTS = 8  # least number of windows of a piece, and number of means of a window
_CURVED = 5.0  # standard deviations of a bend that noise does not explain
_FAR_CURVED = 100.0  # bend above which windows are halved even beyond `MOST_MEANS`
_SPIKE, _MOST_SPIKES = 8.0, 20  # deviations from both neighbours; more such samples are no outliers
_BENT = np.array([[1.0, -1.0, -1.0, 1.0], [1.0, -3.0, 3.0, -1.0]]).T  # of quarters: a bend, and a step in the middle
_FLOOR = 1e-4  # of the range of friction: resolution that no machine reaches


def scatter(time: ndarray, values: ndarray) -> float:
    """Standard deviation of white noise, from the distances of samples to the line between both neighbours.

    The larger of the values from their median and their 90th percentile: the median is small for quantised readings.
    """
    if len(time) < 3:
        return 0.0
    share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    distances = values[1:-1] - (1 - share) * values[:-2] - share * values[2:]
    sizes = np.abs(distances) / np.sqrt(1 + share**2 + (1 - share) ** 2)
    return float(np.max(np.percentile(sizes, (50, 90)) / (_MEDIAN, _NINETIETH)))


def reading_step(values: ndarray) -> float:
    """Resolution of quantised values; otherwise 1e-9 of the range.

    Values are quantised if some of the first repeat, or if the increments of the first change often.
    """
    levels, first = np.unique(values), np.diff(values[:_FIRST])
    step = float(np.min(np.diff(levels))) if len(levels) > 1 else 0.0
    quantised = np.any(first == 0) or np.sum(np.abs(np.diff(first)) > step / 2) > _BENDS
    return step if quantised else 1e-9 * float(np.ptp(values))


def thinned(record: Record, begins: ndarray | None = None, *, follow: bool = False) -> Record:
    """Record of means of neighbouring samples, with the number of samples of each; a short record is unchanged.

    `begins` are times at which the rate of loading changes [s]; `follow` says whether it changes in between as well.

    After every change of the rate of loading, a window lasts at most half of the time since then, and at most an eighth
    of the time until the next change. A window over which friction, slip or normal load bends by more than its noise
    explains is halved, the most curved first, until the windows, of eight means each, give `MOST_MEANS`, so that a bend
    hidden by noise changes a mean by a twentieth of its noise. Samples at and just after a step are not averaged.
    """
    count = len(record.time)
    if count <= MOST_PLAIN:
        return record
    starts = np.unique(np.searchsorted(record.time, [record.time[0], *([] if begins is None else begins)]))
    windows = _edges(record.time, np.append(starts[starts < count], count))
    # an outlier, far from both neighbours, must not be lost in a mean
    changes, noise = np.diff(record.friction) ** 2, scatter(record.time, record.friction)
    far = 1 + np.flatnonzero(np.minimum(changes[:-1], changes[1:]) > (_SPIKE * noise) ** 2)
    far = far if len(far) <= _MOST_SPIKES else far[:0]
    edges = _halved(record, np.unique([*windows, *far, *(far + 1)]), follow)
    weights = np.ones(count, dtype=int) if record.counts is None else record.counts
    counts = np.add.reduceat(weights, edges[:-1])

    means: dict[str, Any] = {
        name: values[0] + np.add.reduceat(weights * (values - values[0]), edges[:-1]) / counts
        for name in ("time", "friction", "normal", "load_point", "slip")
        if (values := getattr(record, name)) is not None
    }
    return replace(record, load_rates=None, counts=counts, **means)


def _edges(time: ndarray, starts: ndarray) -> ndarray:
    """First samples of all windows, and the end."""
    edges = [0]
    for begin, end in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True):
        at, longest = begin + 1, (time[end - 1] - time[begin]) / _PARTS
        while at < end:
            edges.append(at)
            until = time[at] + min(_SHARE * (time[at] - time[begin]), longest)
            at += max(1, int(np.searchsorted(time[at:end], until, side="right")))
        edges.append(end)
    return np.unique(edges)


def _halved(record: Record, edges: ndarray, follow: bool) -> ndarray:
    """First samples of all means, and the end: windows halved where a column bends, the most curved first."""
    time = record.time
    columns = []
    followed = ((record.load_point, 1e-3),) if follow else ()
    for values, least in ((record.friction, _FLOOR), (record.slip, 1e-3), (record.normal, 1e-3), *followed):
        if values is not None and np.ptp(values) > 0:
            noise = max(scatter(time, values) + reading_step(values) / 3, least * float(np.ptp(values)))
            columns.append(np.concatenate([[0.0], np.cumsum((values - values[0]) / noise)]))

    def bend(begin: int, end: int) -> float:
        """Bend or step of the quarter means, in standard deviations; of two or three samples the largest change."""
        if end - begin < 2:
            return 0.0
        if end - begin < 4:
            changes = [np.max(np.abs(np.diff(sums[begin : end + 1], 2))) for sums in columns]
            return float(max(changes, default=0.0)) / 2**0.5
        cuts = np.linspace(begin, end, 5).astype(int)
        each = (end - begin) / 4
        quarters = np.array([np.diff(sums[cuts]) / np.diff(cuts) for sums in columns])
        sizes = np.abs(quarters @ _BENT) / np.sqrt(np.sum(_BENT**2, axis=0) / each)
        return float(np.max(sizes, initial=0.0))

    heap = [(-bend(begin, end), begin, end) for begin, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)]
    heapq.heapify(heap)
    means = sum(min(_PARTS, end - begin) for _, begin, end in heap)
    while heap and -heap[0][0] > (_CURVED if means < MOST_MEANS else _FAR_CURVED) and means < _MOST_CURVED:
        _, begin, end = heapq.heappop(heap)
        middle = (begin + end) // 2
        for part in ((begin, middle), (middle, end)):
            heapq.heappush(heap, (-bend(*part), *part))
            means += min(_PARTS, part[1] - part[0])
        means -= min(_PARTS, end - begin)
    parts = [np.linspace(begin, end, min(_PARTS, end - begin), endpoint=False).astype(int) for _, begin, end in heap]
    return np.append(np.sort(np.concatenate(parts)), len(time))
