"""Style of figures, figure files for journals, inline SVG, and cached figures."""

import io
import json
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from markupsafe import Markup, escape

from quakedesign import cache
from quakedesign.files import write_whole
from quakedesign.laws import control_laws

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from quakedesign.simulation import Trajectory
    from quakedesign.studies.comparison import Entry

    Shown: TypeAlias = Trajectory | tuple[Entry, Trajectory]


# ----------------------------------------------------------------------
# Common style of all figures: size, colours, units, and the line with the settings of the runs.

WIDTH = 7.16  # width of two columns of a printed page [in]
SMALL = 8  # font size [pt], still readable in print
NATURAL, INDUCED, PROVED = "#000000", "#CC79A7", "#000000"
ORIGINS = {"published": (0, (4, 2)), "designed": "solid"}
"""Line style of every origin, in the order of the bars."""
PALE = 0.45
_NOTE = 115  # characters of the smallest font in a line across a figure
_LINE = 0.125  # line height of the smallest font [in]
_PALETTE = ("#0072B2", "#009E73", "#D55E00", "#E69F00", "#56B4E9", "#777777")
_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"), (1e-12, "p"))
_YEAR = 31_557_600.0
_TIMES = ((2 * _YEAR, _YEAR, "years"), (2 * 3600.0, 3600.0, "h"), (10 * 60.0, 60.0, "min"), (0.0, 1.0, "s"))


def colour(name: str) -> str:
    """Colour of a control law, the same in every figure.

    From the palette of Okabe and Ito (https://jfly.uni-koeln.de/color/), which suits all common types of colour vision.
    """
    names = sorted(control_laws())
    return _PALETTE[min(names.index(name), len(_PALETTE) - 1)] if name in names else _PALETTE[-1]


def style(entry: "Entry") -> dict[str, Any]:
    """Colour by law, line style by origin, and the label."""
    return {
        "color": colour(entry.design.name),
        "linestyle": ORIGINS[entry.origin],
        "linewidth": 1.4 if entry.origin == "designed" else 1.1,
        "label": entry.label,
    }


def bar_look(entry: "Entry") -> dict[str, Any]:
    """Colour by law; published gains pale and hatched."""
    pale = {"alpha": PALE, "hatch": "////"} if entry.origin == "published" else {}
    return {"color": colour(entry.design.name), "edgecolor": "black", **pale}


def figure(
    rows: int, height: float, columns: int = 1, *, sharex: Any = None, mosaic: Any = None, **more: Any
) -> "tuple[Figure, Any]":
    """Figure in print size, `height` [in], and its axes: an array (rows, columns), or a dictionary for a mosaic.

    x is shared in a single column by default.
    """
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(WIDTH, height), layout="constrained", dpi=200)
    if mosaic is not None:
        axes = drawing.subplot_mosaic(mosaic, **more)
        dressed = list(axes.values())
    else:
        shared = columns == 1 if sharex is None else sharex
        axes = drawing.subplots(rows, columns, sharex=shared, squeeze=False, **more)
        dressed = axes.ravel()
    for axis in dressed:
        axis.grid(visible=True, alpha=0.3, linewidth=0.5)
        axis.tick_params(which="both", labelsize=SMALL)
        for text in (axis.xaxis.label, axis.yaxis.label):
            text.set_fontsize(SMALL)
    return drawing, axes


def finish(drawing: "Figure", title: str, runs: Sequence["Shown"], note: str = "", *, legend: Any = None) -> "Figure":
    """Add the title above a figure, and the note, the run settings and the legend of one axis below it."""
    drawing.suptitle(title, fontsize=SMALL + 2)
    whole = "; ".join(part for part in (note, run_settings(runs)) if part).replace(" s,", "\N{NO-BREAK SPACE}s,")
    rows = wrap(whole, _NOTE, break_on_hyphens=False)
    height, bottom = drawing.get_figheight(), 0.05 + _LINE * len(rows)
    drawing.text(0.5, 0.03 / height, "\n".join(rows), ha="center", va="bottom", fontsize=SMALL - 1, color="#444444")
    if legend is not None:
        handles, labels = legend.get_legend_handles_labels()
        place = (0.5, bottom / height)
        drawing.legend(
            handles, labels, loc="lower center", bbox_to_anchor=place, ncols=3, fontsize=SMALL, frameon=False
        )
        bottom += 0.08 + 0.17 * -(-len(labels) // 3)
    layout: Any = drawing.get_layout_engine()
    layout.set(rect=(0, bottom / height, 1, 1 - bottom / height), w_pad=0.08)
    return drawing


def named(axis: "Axes", title: str) -> None:
    """Set the title of one axis."""
    axis.set_title(title, fontsize=SMALL)


def run_settings(runs: Iterable["Shown"]) -> str:
    """Scheme, step, method and plant of runs: first the settings that differ, by entry, then the common ones."""
    ways: dict[tuple[str, ...], list[str]] = {}
    for shown in runs:
        label, run = (shown[0].label, shown[1]) if isinstance(shown, tuple) else ("", shown)
        p = run.provenance
        way = (f"scheme {p['scheme']}", f"step {p['step']:.4g} s", f"method {p['method']}", f"{p['plant']} plant")
        ways.setdefault(way, []).append(label)
    if len(ways) < 2:
        return "".join(", ".join(way) for way in ways)
    shared = [part for part in next(iter(ways)) if all(part in way for way in ways)]
    own = [(", ".join(filter(None, dict.fromkeys(who))), way) for way, who in ways.items()]
    lines = [": ".join(filter(None, (who, ", ".join(p for p in way if p not in shared)))) for who, way in own]
    return "; ".join([*lines, *(["all runs: " + ", ".join(shared)] if shared else [])])


def scaled(largest: float, unit: str) -> tuple[float, str]:
    """Factor and prefixed unit for a largest value, such as ``(1e6, "MPa")`` for 5e6 Pa."""
    size, prefix = next(((s, p) for s, p in _PREFIXES if largest >= s), (1.0, ""))
    return size, prefix + unit


def length(largest: float) -> tuple[float, str]:
    """Size [m] and name of the unit of length: millimetres below 0.1 m, else metres."""
    return (1e-3, "mm") if largest < 0.1 else (1.0, "m")


def clock(last: float) -> tuple[float, str]:
    """Size [s] and name of the unit of time for a run that ends at `last` s."""
    return next((size, unit) for least, size, unit in _TIMES if last >= least)


def band(time: np.ndarray, values: np.ndarray, width: int = 40) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean time, smallest and largest value of every `width` samples; remaining samples belong to the last band."""
    starts = np.arange(max(len(values) // width, 1)) * width
    ends = np.append(starts[1:], len(values)) - 1
    low, high = (extreme.reduceat(values, starts) for extreme in (np.minimum, np.maximum))
    return (time[starts] + time[ends]) / 2, low, high


def runs_of(entries: Iterable["Entry"]) -> "list[tuple[Entry, Trajectory]]":
    """Entries with a run that did not diverge, and this run."""
    return [(e, e.run) for e in entries if e.run is not None and "diverged" not in e.run.events]


def with_diverged(entries: "Iterable[Entry]", note: str = "") -> str:
    """Note that also names the diverged runs, which are not drawn, as they would determine the scale."""
    diverged = [(e.label, e.run.events["diverged"]) for e in entries if e.run and "diverged" in e.run.events]
    lines = [f"{label} diverges at {time:.3g} s and is not drawn" for label, time in diverged]
    return "; ".join([*([note] if note else []), *lines])


def present(values: np.ndarray | None) -> np.ndarray:
    """Values of a controlled run, which always has a reference."""
    assert values is not None
    return values


# ----------------------------------------------------------------------
# Figures as files that journals accept: fonts of 6 pt to 10 pt, embedded, no date, page width.

Format = Literal["svg", "pdf", "png"]
FORMATS: tuple[Format, ...] = ("svg", "pdf", "png")
DEFAULT: tuple[Format, ...] = ("svg",)
_STYLE: dict[str, Any] = {"svg.fonttype": "none", "pdf.fonttype": 42, "ps.fonttype": 42}
"""Text is stored as text in SVG, and as TrueType fonts, which journals require, in PDF."""
_UNDATED: dict[str, dict[str, Any]] = {
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    "png": {"Software": None},
}


def figure_bytes(drawing: "Figure", kind: str, name: str) -> bytes:
    """Contents of a file with a figure, the same for the same figure.

    Parameters
    ----------
    kind : str
        One of `FORMATS`.
    name : str
        Seed of the identifiers inside an SVG.
    """
    import matplotlib as mpl

    stream = io.BytesIO()
    style: Any = _STYLE | {"svg.hashsalt": name}
    with mpl.rc_context(style):
        # computed once; `savefig` would repeat the layout in every format
        if (engine := drawing.get_layout_engine()) is not None:
            engine.execute(drawing)
            drawing.set_layout_engine(None)
        drawing.savefig(stream, format=kind, metadata=_UNDATED[kind])
    return stream.getvalue()


def write_figures(folder: Path, drawn: Mapping[str, Any], formats: Sequence[str]) -> None:
    """Write figures, named by their keys, in every format into an existing folder."""
    for name, drawing in drawn.items():
        for kind in formats:
            (folder / f"{name}.{kind}").write_bytes(figure_bytes(drawing, kind, name))


def write_results(folder: Path, values: Mapping[str, Any]) -> None:
    """Write ``results.json`` into an existing folder."""
    write_whole(folder / "results.json", json.dumps(values, indent=1, allow_nan=False) + "\n")


def file_names(name: str, formats: Sequence[str]) -> str:
    """File names of one figure, as listed in a message."""
    return ", ".join(f"{name}.{kind}" for kind in formats)


# ----------------------------------------------------------------------
# Figures as SVG inside a page: compact, in the colours of the page, with axis data for reading values with the pointer.

_INKS = {"#000000": "var(--ink)", "#444444": "var(--soft)", "#b0b0b0": "var(--line)", "#cccccc": "var(--line)"}
"""Page colours of frames, text and grids; curves keep their colours."""
_PAPER = "#ffffff"


def inline_svg(drawn: str, drawing: "Figure", name: str, description: str) -> Markup:
    """SVG element of a figure, with unique identifiers and a description.

    Parameters
    ----------
    drawn : str
        SVG file of the figure.
    name : str
        Unique in its page.
    description : str
        Text alternative of the figure.
    """
    body = drawn[drawn.index("<defs>", drawn.index("</metadata>") if "</metadata>" in drawn else 0) :]
    width, height = (72 * float(size) for size in drawing.get_size_inches())
    head = f'<svg viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{escape(description)}" '
    return Markup(f'{head}data-axes="{escape(json.dumps(_axes(drawing, height)))}">{_compact(body, name)}')


def _compact(body: str, name: str) -> str:
    """Compact SVG: two decimals of a point [1/72 in], colours of the page, unique identifiers, no indentation."""
    body = re.sub(r"<g id=\"figure_1\">\s*<g id=\"patch_1\">.*?</g>", '<g id="figure_1">', body, count=1, flags=re.S)
    body = re.sub(r"<[^>]*>", lambda tag: re.sub(r"-?\d+\.\d{3,}", _shorter, tag[0]), body)
    for colour, ink in _INKS.items():
        body = body.replace(colour, ink)
    body = re.sub(rf"fill: {_PAPER}", "fill: var(--paper)", body)
    body = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", body)
    return re.sub(r"\s*\n\s*", "\n", body)


def _shorter(number: re.Match[str]) -> str:
    return f"{float(number[0]):.2f}".rstrip("0").rstrip(".")


def _axes(drawing: "Figure", height: float) -> list[dict[str, Any]]:
    """Position in the picture and scales of every axis."""
    axes = []
    for axis in drawing.axes:
        low, high = axis.get_window_extent().get_points() * 72 / drawing.dpi
        box = [float(v) for v in (low[0], height - high[1], high[0], height - low[1])]
        siblings = axis.get_shared_x_axes().get_siblings(axis)
        across = next((label for other in siblings if (label := other.get_xlabel())), "x")
        sides = {"x": _side(axis.xaxis, across), "y": _side(axis.yaxis, axis.get_ylabel())}
        axes.append({"box": [round(v, 2) for v in box], **sides})
    return axes


def _side(axis: Any, label: str) -> dict[str, Any]:
    """Label, scale and transformed limits of an axis, with the parameters of the inverse transformation."""
    transform = axis.get_transform()
    low, high = (float(v) for v in transform.transform(axis.get_view_interval()))
    side = {"label": label, "scale": axis.get_scale(), "low": low, "high": high}
    if side["scale"] != "symlog":
        return side
    (bend,) = transform.transform([transform.linthresh]) / transform.linthresh
    return side | {"linear": float(transform.linthresh), "bend": float(bend)}


# ----------------------------------------------------------------------
# Figures in the user's cache, see `quakedesign.cache`: the key is all data that they may show.

Drawn = tuple[bytes, Markup]


def cached_figures(draw: Callable[[], Mapping[str, Any]], alt: Mapping[str, str], shown: Any) -> dict[str, Drawn]:
    """SVG files of figures by name, and their elements for a page; from the cache if the same were drawn before.

    Parameters
    ----------
    draw : callable
        Returns matplotlib figures by name, which depend only on `shown`.
    alt : mapping of str to str
        Text alternatives of the figures, by name.
    shown : Any
        All data that the figures show; durations of computations are ignored.
    """

    def texts() -> bytes:
        drawn = {name: (drawing, figure_bytes(drawing, "svg", name).decode()) for name, drawing in draw().items()}
        return json.dumps({n: [v, inline_svg(v, drawing, n, alt[n])] for n, (drawing, v) in drawn.items()}).encode()

    statement = _stated(alt, shown) if cache.in_use() else None
    vectors = texts() if statement is None else cache.once("figures", texts, statement)
    return {name: (vector.encode(), Markup(inside)) for name, (vector, inside) in json.loads(vectors).items()}


def _stated(alt: Mapping[str, str], shown: Any) -> bytes | None:
    """Cache key of figures from data, settings and fonts; None if one of these is not readable or serialisable."""
    import matplotlib as mpl
    from matplotlib.font_manager import fontManager

    try:
        fonts = [(font.fname, (file := os.stat(font.fname)).st_size, file.st_mtime_ns) for font in fontManager.ttflist]
    except OSError:
        return None
    # reading rcParams["backend"] would load a backend
    settings = {name: mpl.rcParams[name] for name in mpl.rcParams if name != "backend"}
    return cache.stated((dict(alt), shown, settings, fonts), _Untimed)


class _Untimed(cache.CachedStatement):
    """Serialised value without the durations and backends of its computation."""

    def __init__(self, content: io.BytesIO) -> None:
        super().__init__(content)
        self.fast = True  # equal values are written equally, whether or not they are the same object

    def field(self, value: Any, name: str) -> Any:
        stated = super().field(value, name)
        if name == "provenance":
            return {k: v for k, v in stated.items() if not (k.startswith("backend") or k.endswith("_seconds"))}
        return None if name == "seconds" else stated
