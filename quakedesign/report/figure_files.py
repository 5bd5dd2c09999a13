"""Figures as files that journals accept: letters of 8 pt to 9 pt, fonts embedded, no date, at the width of a page."""

import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from quakedesign.output import write_whole

Format = Literal["svg", "pdf", "png"]
FORMATS: tuple[Format, ...] = ("svg", "pdf", "png")
DEFAULT: tuple[Format, ...] = ("svg",)
_STYLE: dict[str, Any] = {"svg.fonttype": "none", "pdf.fonttype": 42, "ps.fonttype": 42}
"""Letters stay letters: as such in SVG, as TrueType, which journals ask for, in PDF."""
_UNDATED: dict[str, dict[str, Any]] = {
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    "png": {"Software": None},
}


def figure_bytes(drawing: Any, kind: str, name: str) -> bytes:
    """Contents of a file with a figure, the same for the same figure.

    Parameters
    ----------
    drawing : matplotlib.figure.Figure
    kind : str
        One of `FORMATS`.
    name : str
        Makes the names inside an SVG.
    """
    import matplotlib as mpl

    stream = io.BytesIO()
    style: Any = _STYLE | {"svg.hashsalt": name}
    with mpl.rc_context(style):
        _lay_out(drawing)
        drawing.savefig(stream, format=kind, metadata=_UNDATED[kind])
    return stream.getvalue()


def _lay_out(drawing: Any) -> None:
    """Place what is in a figure, for good: `savefig` would draw all of it once more for that, in every format."""
    if (engine := drawing.get_layout_engine()) is not None:
        engine.execute(drawing)
        drawing.set_layout_engine(None)


def write_figures(folder: Path, drawn: Mapping[str, Any], formats: Sequence[str]) -> None:
    """Write figures, each by its name, in every format into a folder that exists."""
    for name, drawing in drawn.items():
        for kind in formats:
            (folder / f"{name}.{kind}").write_bytes(figure_bytes(drawing, kind, name))


def write_results(folder: Path, facts: Mapping[str, Any]) -> None:
    """Write ``results.json`` into a folder that exists."""
    write_whole(folder / "results.json", json.dumps(facts, indent=1, allow_nan=False) + "\n")


def file_names(name: str, formats: Sequence[str]) -> str:
    """Of one figure, as a message lists them."""
    return ", ".join(f"{name}.{kind}" for kind in formats)
