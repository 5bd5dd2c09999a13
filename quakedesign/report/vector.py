"""Figures as SVG inside a page: small, with colours that follow the page, and what a pointer needs to read values."""

import json
import re
from typing import Any

from markupsafe import Markup, escape

_INKS = {"#000000": "var(--ink)", "#444444": "var(--soft)", "#b0b0b0": "var(--line)", "#cccccc": "var(--line)"}
"""Colours of frames, letters and grids; those of the curves stay."""
_PAPER = "#ffffff"


def inline_svg(drawn: str, drawing: Any, name: str, told: str) -> Markup:
    """SVG element of a figure, with names of its own, that tells what it shows.

    Parameters
    ----------
    drawn : str
        SVG file of the figure.
    drawing : matplotlib.figure.Figure
    name : str
        Unique in its page.
    told : str
        For readers who do not see it.
    """
    body = drawn[drawn.index("<defs>", drawn.index("</metadata>") if "</metadata>" in drawn else 0) :]
    width, height = (72 * float(size) for size in drawing.get_size_inches())
    head = f'<svg viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{escape(told)}" '
    return Markup(f'{head}data-axes="{escape(json.dumps(_axes(drawing, height)))}">{_tightened(body, name)}')


def _tightened(body: str, name: str) -> str:
    """Two decimals of a point [1/72 in], colours of the page, names that no other figure has, no line breaks."""
    body = re.sub(r"<g id=\"figure_1\">\s*<g id=\"patch_1\">.*?</g>", '<g id="figure_1">', body, count=1, flags=re.S)
    body = re.sub(r"<[^>]*>", lambda tag: re.sub(r"-?\d+\.\d{3,}", _shorter, tag[0]), body)
    for colour, ink in _INKS.items():
        body = body.replace(colour, ink)
    body = re.sub(rf"fill: {_PAPER}", "fill: var(--paper)", body)
    body = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", body)
    return re.sub(r"\s*\n\s*", "\n", body)


def _shorter(number: re.Match[str]) -> str:
    return f"{float(number[0]):.2f}".rstrip("0").rstrip(".")


def _axes(drawing: Any, height: float) -> list[dict[str, Any]]:
    """Place in the picture and scales of every axis that carries labels."""
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
    """Ends of a side on its own scale, and what it takes to come back from there to values."""
    transform = axis.get_transform()
    low, high = (float(v) for v in transform.transform(axis.get_view_interval()))
    side = {"label": label, "scale": axis.get_scale(), "low": low, "high": high}
    if side["scale"] != "symlog":
        return side
    (bend,) = transform.transform([transform.linthresh]) / transform.linthresh
    return side | {"linear": float(transform.linthresh), "bend": float(bend)}
