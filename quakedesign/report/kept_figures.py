"""Figures kept on the user's disk, see `quakedesign.cache`: found by all that they could show before one is drawn."""

import io
import json
import os
import pickle
from collections.abc import Callable, Mapping
from typing import Any

from markupsafe import Markup

from quakedesign import cache
from quakedesign.report.figure_files import figure_bytes
from quakedesign.report.vector import inline_svg

Drawn = tuple[bytes, Markup]


def drawn_once(draw: Callable[[], Mapping[str, Any]], told: Mapping[str, str], shown: Any) -> dict[str, Drawn]:
    """SVG files of figures by name, and their elements for a page; from the cache if the same were drawn before.

    Parameters
    ----------
    draw : callable
        Gives figures of matplotlib by name, not drawn yet, that depend on what they show alone.
    told : mapping of str to str
        For readers who do not see a figure, by its name.
    shown : Any
        All that is shown, but for how long it took.
    """
    asked = _stated(told, shown) if cache.in_use() else None
    if asked is not None and (kept := cache.recall("figures", asked)) is not None:
        return {name: (vector.encode(), Markup(inside)) for name, (vector, inside) in json.loads(kept).items()}
    drawn = {}
    for name, drawing in draw().items():
        vector = figure_bytes(drawing, "svg", name)
        drawn[name] = vector, inline_svg(vector.decode(), drawing, name, told[name])
    if asked is not None:
        texts = {name: [vector.decode(), inside] for name, (vector, inside) in drawn.items()}
        cache.keep("figures", json.dumps(texts).encode(), asked)
    return drawn


def _stated(told: Mapping[str, str], shown: Any) -> bytes | None:
    """All that drawings depend on: contents, settings and fonts; None if they cannot be told."""
    import matplotlib as mpl
    from matplotlib.font_manager import fontManager

    content = io.BytesIO()
    statement = _Untimed(content)
    statement.fast = True  # what is equal is written the same, be it one value or two
    try:
        fonts = [(font.fname, (file := os.stat(font.fname)).st_size, file.st_mtime_ns) for font in fontManager.ttflist]
        settings = {name: mpl.rcParams[name] for name in mpl.rcParams if name != "backend"}  # which would be loaded
        statement.dump((dict(told), shown, settings, fonts))
    except (pickle.PicklingError, AttributeError, TypeError, OSError, ValueError, RecursionError):
        return None
    return content.getvalue()


class _Untimed(cache.Statement):
    """A value by its fields, without how long it took and how it was computed."""

    def field(self, value: Any, name: str) -> Any:
        given = super().field(value, name)
        if name == "provenance":
            return {k: v for k, v in given.items() if not (k.startswith("backend") or k.endswith("_seconds"))}
        return None if name == "seconds" else given
