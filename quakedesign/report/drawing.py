"""What all figures share: size, colours, units, and the line that says how the runs were made."""

from collections.abc import Iterable, Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from quakedesign.controllers import control_laws

if TYPE_CHECKING:
    from quakedesign.simulation import Trajectory
    from quakedesign.studies.comparison import Entry, Run

WIDTH = 7.16  # two columns of a printed page [in]
SMALL = 8  # size of letters [pt], still readable in print
NATURAL, INDUCED = "#000000", "#CC79A7"
ORIGINS = {"published": (0, (4, 2)), "designed": "solid"}
"""Line style of every origin, in the order in which they stand side by side."""
PALE = 0.45
_NOTE = 115  # of the smallest letters in a line of the width of a figure
_LINE = 0.125  # height of a line of the smallest letters [in]
_PALETTE = ("#0072B2", "#009E73", "#D55E00", "#E69F00", "#56B4E9", "#777777")
_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"), (1e-12, "p"))
_YEAR = 31_557_600.0
_TIMES = ((2 * _YEAR, _YEAR, "years"), (2 * 3600.0, 3600.0, "h"), (10 * 60.0, 60.0, "min"), (0.0, 1.0, "s"))


def colour(name: str) -> str:
    """Colour of a control law, the same in every figure.

    From the palette of Okabe and Ito (https://jfly.uni-koeln.de/color/): told apart with every common colour vision.
    """
    known = sorted(control_laws())
    return _PALETTE[min(known.index(name), len(_PALETTE) - 1)] if name in known else _PALETTE[-1]


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


def figure(rows: int, height: float, columns: int = 1, *, sharex: Any = None, **more: Any) -> tuple[Any, Any]:
    """Figure at printing size and its axes, shape (rows, columns); x is shared in a single column unless told."""
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(WIDTH, height), layout="constrained", dpi=200)
    shared = columns == 1 if sharex is None else sharex
    axes = drawing.subplots(rows, columns, sharex=shared, squeeze=False, **more)
    for axis in axes.ravel():
        axis.grid(visible=True, alpha=0.3, linewidth=0.5)
        axis.tick_params(which="both", labelsize=SMALL)
        for text in (axis.xaxis.label, axis.yaxis.label):
            text.set_fontsize(SMALL)
    return drawing, axes


def finish(drawing: Any, title: str, runs: Sequence["Run"], note: str = "", *, legend: Any = None) -> Any:
    """Give a figure its title above, and below the legend of one axis (three columns) and how the runs were made."""
    drawing.suptitle(title, fontsize=SMALL + 2)
    whole = "; ".join(part for part in (note, made(runs)) if part).replace(" s,", "\N{NO-BREAK SPACE}s,")
    told = wrap(whole, _NOTE, break_on_hyphens=False)
    height, bottom = drawing.get_figheight(), 0.05 + _LINE * len(told)
    drawing.text(0.5, 0.03 / height, "\n".join(told), ha="center", va="bottom", fontsize=SMALL - 1, color="#444444")
    if legend is not None:
        handles, labels = legend.get_legend_handles_labels()
        place = (0.5, bottom / height)
        drawing.legend(
            handles, labels, loc="lower center", bbox_to_anchor=place, ncols=3, fontsize=SMALL, frameon=False
        )
        bottom += 0.08 + 0.17 * -(-len(labels) // 3)
    drawing.get_layout_engine().set(rect=(0, bottom / height, 1, 1 - bottom / height), w_pad=0.08)
    return drawing


def named(axis: Any, title: str) -> None:
    """Give one axis its title."""
    axis.set_title(title, fontsize=SMALL)


def made(runs: Iterable["Run"]) -> str:
    """Scheme, step, method and plant of runs, every distinct combination once."""
    told = [
        f"scheme {p['scheme']}, step {p['step']:.4g} s, method {p['method']}, {p['plant']} plant"
        for p in (run.provenance for run in runs)
    ]
    return "; ".join(dict.fromkeys(told))


def scaled(largest: float, unit: str) -> tuple[float, str]:
    """Size and name of the unit with a prefix that suits a largest value; ``(1e6, "MPa")`` for 5e6 Pa."""
    size, prefix = next(((s, p) for s, p in _PREFIXES if largest >= s), (1.0, ""))
    return size, prefix + unit


def length(largest: float) -> tuple[float, str]:
    """Millimetres below 0.1 m, else metres."""
    return (1e-3, "mm") if largest < 0.1 else (1.0, "m")


def clock(last: float) -> tuple[float, str]:
    """Size [s] and name of the unit of time that suits a run that ends at `last` s."""
    return next((size, unit) for least, size, unit in _TIMES if last >= least)


def band(time: np.ndarray, values: np.ndarray, width: int = 40) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Middle time, smallest and largest value of every `width` samples; what is left over belongs to the last."""
    starts = np.arange(max(len(values) // width, 1)) * width
    ends = np.append(starts[1:], len(values)) - 1
    low, high = (extreme.reduceat(values, starts) for extreme in (np.minimum, np.maximum))
    return (time[starts] + time[ends]) / 2, low, high


def runs_of(entries: Iterable["Entry"]) -> "list[tuple[Entry, Trajectory]]":
    """Entries that have a run which did not diverge, with it."""
    return [(e, e.run) for e in entries if e.run is not None and "diverged" not in e.run.events]


def with_diverged(entries: "Iterable[Entry]", note: str = "") -> str:
    """Note that also names the runs which diverged: their last values would leave no room for all others."""
    found = [(e.label, e.run.events["diverged"]) for e in entries if e.run and "diverged" in e.run.events]
    told = [f"{label} diverges at {time:.3g} s and is not drawn" for label, time in found]
    return "; ".join([*([note] if note else []), *told])


def known(values: np.ndarray | None) -> np.ndarray:
    """Values of a controlled run, which always has a reference."""
    assert values is not None
    return values
