"""Units, numbers and sentences as HTML."""

import re

from markupsafe import Markup, escape

from quakedesign.text import visible

_SIGNS = (("&lt;=", "≤"), ("&gt;=", "≥"), ("T_s", "T<sub>s</sub>"))


def unit_html(unit: str) -> Markup:
    """``Pa s/m^2`` with a raised exponent and dots between factors; nothing for a pure number."""
    return Markup("") if unit in ("", "-") else _set(unit.replace(" ", "·"))


def typeset(text: object) -> object:
    """A sentence of a program as people set it: signs, raised exponents, powers of ten; markup stays as it is."""
    return _set(text) if isinstance(text, str) and not isinstance(text, Markup) else text


def _set(text: str) -> Markup:
    said = str(escape(visible(text)))
    for written, shown in _SIGNS:
        said = said.replace(written, shown)
    said = re.sub(r"\^(?:\(([-\d/]+)\)|(-?\d+))", lambda power: f"<sup>{power[1] or power[2]}</sup>", said)
    said = re.sub(r"(?<![\w.])(-?\d+(?:\.\d+)?)e([-+]\d+)\b", _power_of_ten, said)
    return Markup(re.sub(r"(?<![\w<>./^;])-(?=\d)", "−", said))


def _power_of_ten(number: re.Match[str]) -> str:
    power = str(int(number[2])).replace("-", "−")
    return f"{number[1]}·10<sup>{power}</sup>"
