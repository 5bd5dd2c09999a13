"""Map of certified gains as a figure, a table and a folder, with screened and proved points."""

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from quakedesign.files import Json, whole_folder, write_whole
from quakedesign.laws import LoopField, law
from quakedesign.lyapunov.maps.gain_map import GainMap, Place
from quakedesign.report.drawing import SMALL, WIDTH, write_figures, write_results
from quakedesign.report.tables import csv_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_FAILED = "#D55E00"


def gain_map_figure(drawn: GainMap) -> "Figure":
    """Figure of a map: shades are levels screened in floating point, markers are points with exact proofs."""
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.figure import Figure

    levels = len(drawn.sheet.levels)
    figure = Figure(figsize=(WIDTH, 5.4), layout="constrained", dpi=200)
    axis = figure.subplots()
    first, second = (np.array([float(v) for v in values]) for values in drawn.sheet.axes)
    screened = np.array([[drawn.screened[i, j] for i in range(len(first))] for j in range(len(second))])
    shades = ListedColormap(["#FFFFFF", *_shades(levels)])
    axis.pcolormesh(
        _borders(first),
        _borders(second),
        screened,
        cmap=shades,
        norm=BoundaryNorm(np.arange(levels + 2) - 0.5, levels + 1),
    )
    for name, borders in (("x", first), ("y", second)):
        if borders[0] > 0:
            getattr(axis, f"set_{name}scale")("log")
    handles = [
        _patch(shade, f"screened: L̄ = {_number(v)}")
        for shade, v in zip(_shades(levels), drawn.sheet.levels, strict=True)
    ]
    handles += _markers(axis, drawn, first, second)
    _ticks(axis, first, second)
    axis.set_xlabel(_label(drawn, 0))
    axis.set_ylabel(_label(drawn, 1))
    axis.tick_params(which="both", labelsize=SMALL)
    axis.set_title(_title(drawn), fontsize=SMALL + 1)
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=SMALL, frameon=False)
    return figure


def _label(drawn: GainMap, which: int) -> str:
    name = drawn.sheet.over[which]
    unit = gain_map_units(drawn).get(name)
    return f"{name} [{unit}]" if unit else name


def _shades(count: int) -> list[Any]:
    """Pale blues, darker for higher levels."""
    from matplotlib import colormaps

    return [colormaps["Blues"](0.18 + 0.5 * k / max(count - 1, 1)) for k in range(count)]


def _patch(shade: Any, label: str) -> Any:
    from matplotlib.patches import Patch

    return Patch(facecolor=shade, edgecolor="#999999", linewidth=0.5, label=label)


def _markers(axis: "Axes", drawn: GainMap, first: np.ndarray, second: np.ndarray) -> list[Any]:
    """Draw markers of all points for which a proof was tried; return their legend entries."""
    looks: dict[str, dict[str, Any]] = {
        "edge": {"marker": "s", "s": 5, "color": "black", "label": "proved, at the edge of a level"},
        "interior": {"marker": "o", "s": 7, "facecolors": "none", "edgecolors": "black", "linewidths": 0.5,
                     "label": "proved, inside (drawn at random)"},
        "failed": {"marker": "x", "s": 12, "color": _FAILED, "linewidths": 0.8,
                   "label": "screened, not proved there"},
    }  # fmt: skip
    handles = []
    for kind, look in looks.items():
        places = [p for p in drawn.proved if _kind(drawn, p) == kind]
        if places:
            x, y = first[[i for i, _ in places]], second[[j for _, j in places]]
            handles.append(axis.scatter(x, y, zorder=3, **look))
    return handles


def _kind(drawn: GainMap, place: Place) -> str:
    return "failed" if drawn.proved[place] < drawn.screened[place] else drawn.role(place)


def _borders(values: np.ndarray) -> np.ndarray:
    """Cell boundaries between values with equal steps or equal ratios."""
    if values[0] > 0:
        return np.asarray(np.exp(_borders_of(np.log(values))))
    return _borders_of(values)


def _borders_of(values: np.ndarray) -> np.ndarray:
    middle = (values[1:] + values[:-1]) / 2
    return np.concatenate([[2 * values[0] - middle[0]], middle, [2 * values[-1] - middle[-1]]])


def _ticks(axis: "Axes", first: np.ndarray, second: np.ndarray) -> None:
    """Set plain numbers on logarithmic axes."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for which, values in ((axis.xaxis, first), (axis.yaxis, second)):
        if values[0] > 0:
            dense = (1, 2, 3, 5, 7) if values[-1] / values[0] < 30 else (1, 2, 5)
            which.set_major_locator(LogLocator(subs=dense))
            which.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
            which.set_minor_formatter(NullFormatter())


def _title(drawn: GainMap) -> str:
    loop = drawn.sheet.loop
    fixed = ", ".join(f"{n} = {_number(v)}" for n, v in loop.gains.items() if n not in drawn.sheet.over)
    ranges = "".join(f", {n} from {_number(a)} to {_number(b)}" for n, (a, b) in loop.uncertain.items() if n != "d")
    return f"{loop.law}: {fixed}{ranges}; V of degree {drawn.sheet.degree}"


def _number(value: Any) -> str:
    return f"{float(value):.5g}"


def gain_map_rows(drawn: GainMap) -> list[dict[str, str]]:
    """One row per point: gains, necessary limit of the bound L̄ on |h'|, levels, role, certificate file."""
    rows = []
    first, second = drawn.sheet.axes
    names = drawn.sheet.over
    for i, x in enumerate(first):
        for j, y in enumerate(second):
            limit = drawn.limits[i, j]
            tried = drawn.proved.get((i, j))
            rows.append(
                {
                    names[0]: str(x),
                    names[1]: str(y),
                    "limit": "" if limit is None else str(limit),
                    "screened_lipschitz": _level(drawn, drawn.screened[i, j]),
                    "proved_lipschitz": "" if tried is None else _level(drawn, tried),
                    "tried": "" if tried is None else drawn.role((i, j)),
                    "certificate": _file((i, j)) if (i, j) in drawn.certificates else "",
                }
            )
    return rows


def _level(drawn: GainMap, count: int) -> str:
    return str(drawn.sheet.levels[count - 1]) if count else ""


def _file(place: Place) -> str:
    return f"certificates/{place[0]}-{place[1]}.json"


def gain_map_units(drawn: GainMap) -> dict[str, str]:
    """Units of the gains; empty for a `LoopField`, whose gains have no declared units."""
    subject = drawn.sheet.subject
    if isinstance(subject, LoopField):
        return {}
    model = law(subject) if isinstance(subject, str) else subject
    return dict(model.gain_units)


def gain_map_values(drawn: GainMap) -> Json:
    """JSON-able numbers of a map; exact quantities are strings."""
    sheet, top = drawn.sheet, len(drawn.sheet.levels)
    return {
        "law": sheet.loop.law,
        "over": list(sheet.over),
        "ranges": {n: [str(axis[0]), str(axis[-1])] for n, axis in zip(sheet.over, sheet.axes, strict=True)},
        "gains": {n: str(v) for n, v in sheet.loop.gains.items() if n not in sheet.over},
        "gain_range": [str(v) for v in sheet.loop.uncertain.get("beta", ())],
        "degree": sheet.degree,
        "units": gain_map_units(drawn),
        "points": len(drawn.screened),
        "screened": drawn.counts(1)["screened"],
        "proved": drawn.counts(1)["proved"],
        "tried": len(drawn.proved),
        "levels": [{"lipschitz": str(sheet.levels[k]), **drawn.counts(k + 1)} for k in range(top)],
        "solves": drawn.solves,
        "seconds": dict(drawn.seconds),
        "versions": {name: version(name) for name in ("quakedesign", "clarabel", "python-flint")},
    }


def gain_map_lines(drawn: GainMap) -> list[str]:
    """The numbers of a map as lines of text."""
    lines = [f"{_title(drawn)}: {len(drawn.screened)} points, {drawn.solves} solves"]
    for k, bound in enumerate(drawn.sheet.levels, 1):
        level = drawn.counts(k)
        lines.append(
            f"|h'| <= {_number(bound)}: {level['screened']} points screened (floating point), {level['proved']} proved "
            f"exactly, among them {level['edge_proved']} of the {level['edge']} at the edge"
        )
    return lines


def write_gain_map(drawn: GainMap, folder: Path, formats: Sequence[str] = ("png",)) -> Json:
    """Write the figure ``map``, ``map.csv``, ``results.json`` and all certificates into a folder, whole or not at all.

    Returns
    -------
    dict
        Content of ``results.json``.
    """
    values = gain_map_values(drawn)
    with whole_folder(folder) as partial:
        (partial / "certificates").mkdir()
        for place, text in drawn.certificates.items():
            write_whole(partial / _file(place), text)
        write_figures(partial, {"map": gain_map_figure(drawn)}, formats)
        write_whole(partial / "map.csv", csv_text(gain_map_rows(drawn)))
        write_results(partial, values)
    return values
