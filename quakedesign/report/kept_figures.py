"""Figures kept on the user's disk, see `quakedesign.cache`: their contents say how they look before they are drawn."""

import io
import json
import os
import pickle
from typing import Any

from markupsafe import Markup

from quakedesign import cache
from quakedesign.report.figure_files import figure_bytes
from quakedesign.report.vector import inline_svg


def drawn_once(drawing: Any, name: str, told: str) -> tuple[bytes, Markup]:
    """SVG file of a figure, and the element for a page; from the cache if the same figure was drawn before.

    Parameters
    ----------
    drawing : matplotlib.figure.Figure
        Not drawn yet.
    name : str
        Unique in its page.
    told : str
        For readers who do not see it.
    """
    asked = _stated(drawing, name, told) if cache.in_use() else None
    if asked is not None and (kept := cache.recall("figure", asked)) is not None:
        vector, inside = json.loads(kept)
        return vector.encode(), Markup(inside)
    vector = figure_bytes(drawing, "svg", name).decode()
    inside = inline_svg(vector, drawing, name, told)
    if asked is not None:
        cache.keep("figure", json.dumps([vector, inside]).encode(), asked)
    return vector.encode(), inside


def _stated(drawing: Any, name: str, told: str) -> bytes | None:
    """All that a drawing depends on: its contents, the settings and the fonts; None if they cannot be told."""
    import matplotlib as mpl
    from matplotlib.font_manager import fontManager

    content = io.BytesIO()
    try:
        fonts = [(font.fname, (file := os.stat(font.fname)).st_size, file.st_mtime_ns) for font in fontManager.ttflist]
        _statement(content).dump((name, told, dict(mpl.rcParams), fonts, drawing))
    except (pickle.PicklingError, AttributeError, TypeError, OSError):
        return None
    return content.getvalue()


def _statement(content: io.BytesIO) -> pickle.Pickler:
    from matplotlib.transforms import TransformNode

    class Statement(pickle.Pickler):
        """Transforms name those that follow them by their place in memory, which says nothing."""

        def reducer_override(self, value: Any) -> Any:
            if not isinstance(value, TransformNode):
                return NotImplemented
            state: Any = value.__getstate__()
            return type(value), (), state | {"_parents": list(state["_parents"].values())}

    return Statement(content)
