"""Parameters of a fault with symbols and units, as rows for people."""

from collections.abc import Iterable, Iterator
from dataclasses import fields
from typing import Any

from markupsafe import Markup

from quakedesign.fault import Fault
from quakedesign.fault.file_reading import DISTURBANCE, PLANT, TASK, WIDTHS
from quakedesign.report.html_text import unit_html
from quakedesign.report.mathml import mathml

_DERIVED = {
    "mass": ("m", "kg"),
    "stiffness": ("k", "N/m"),
    "specific_stiffness": (r"\hat k", "1/s^2"),
    "specific_damping": (r"\hat\eta", "1/s"),
    "authority": (r"\hat N", "m^2/kg"),
    "natural_frequency": (r"\omega_n", "rad/s"),
    "damping_ratio": (r"\zeta", ""),
}
_STEP = "sampling_time"
Row = tuple[Any, ...]
HEADINGS = ("parameter", "symbol", "value", "unit", "where")


def parameter_rows(fault: Fault) -> list[Row]:
    """One row a parameter under `HEADINGS`: those of the fault file, its uncertainty, and what follows from them.

    No disturbance of friction with a state: what pushes such a fault is the stress of its guarantee.
    """
    rows = [
        *_told(fault, PLANT, "fault"),
        *_told(fault.friction, fault.friction.quantities(), "friction"),
        *_told(fault.reference, [name for name in TASK if name != _STEP], "task"),
        *_told(fault, [_STEP], "task"),
        *([] if fault.friction.state_names else _told(fault.disturbance, DISTURBANCE, "disturbance")),
    ]
    rows += [_row(f"half-width of {name}", float(getattr(fault.box, name)), "", "uncertainty", "±") for name in WIDTHS]
    rows += [_row(name, getattr(fault, name), unit, "follows", symbol) for name, (symbol, unit) in _DERIVED.items()]
    return [row for row in rows if row[2] is not None]


def _told(part: Any, names: Iterable[str], where: str) -> Iterator[Row]:
    """Rows of the fields of a dataclass with these names."""
    known = {each.name: each.metadata for each in fields(part)}
    for name in names:
        yield _row(name, getattr(part, name), known[name]["unit"], where, known[name].get("symbol"))


def _row(name: str, value: float | None, unit: str, where: str, symbol: str | None = None) -> Row:
    shown = Markup("") if symbol is None else Markup("±") if symbol == "±" else mathml(symbol, display="inline")
    return (name.replace("_", " "), shown, None if value is None else f"{value:.6g}", unit_html(unit) or "–", where)
