"""Parameters of a fault with symbols and units, as rows for people."""

from typing import Any

from markupsafe import Markup

from quakedesign.fault import Fault
from quakedesign.fault.scenario import DISTURBANCE, PLANT, TASK, WIDTHS
from quakedesign.report.mathml import mathml
from quakedesign.report.units import unit_html

_SYMBOLS = {
    "density": r"\rho",
    "shear_modulus": "G",
    "length": "L",
    "damping": r"\eta",
    "effective_normal_stress": r"\sigma'_n",
    "target_slip": "d_{max}",
    "operation_time": "t_{op}",
    "ramp": r"\lambda_r",
    "sampling_time": "T_s",
    "mass": "m",
    "stiffness": "k",
    "specific_stiffness": r"\hat k",
    "specific_damping": r"\hat\eta",
    "authority": r"\hat N",
    "natural_frequency": r"\omega_n",
    "damping_ratio": r"\zeta",
}
_DERIVED = {
    "mass": "kg",
    "stiffness": "N/m",
    "specific_stiffness": "1/s^2",
    "specific_damping": "1/s",
    "authority": "m^2/kg",
    "natural_frequency": "rad/s",
    "damping_ratio": "",
}
Row = tuple[Any, ...]
HEADINGS = ("parameter", "symbol", "value", "unit", "where")


def parameter_rows(fault: Fault) -> list[Row]:
    """One row a parameter under `HEADINGS`: those of the fault file, its uncertainty, and what follows from them."""
    task = {"sampling_time": fault.sampling_time} | _values(fault.reference, TASK)
    friction = fault.friction.quantities()
    symbols = {name: field.metadata["symbol"] for name, field in friction.items()}
    rows = [_row(name, getattr(fault, name), unit, "fault") for name, unit in PLANT.items()]
    rows += [
        _row(name, getattr(fault.friction, name), field.metadata["unit"], "friction", symbols[name])
        for name, field in friction.items()
    ]
    rows += [_row(name, task[name], unit, "task") for name, unit in TASK.items()]
    rows += [_row(name, getattr(fault.disturbance, name), unit, "disturbance") for name, unit in DISTURBANCE.items()]
    rows += [_row(f"half-width of {name}", float(getattr(fault.box, name)), "", "uncertainty", "±") for name in WIDTHS]
    rows += [_row(name, getattr(fault, name), unit, "follows") for name, unit in _DERIVED.items()]
    return [row for row in rows if row[2] is not None]


def _values(part: object, units: dict[str, str]) -> dict[str, float]:
    return {name: getattr(part, name) for name in units if hasattr(part, name)}


def _row(name: str, value: float | None, unit: str, where: str, symbol: str | None = None) -> Row:
    latex = symbol or _SYMBOLS.get(name)
    shown = Markup("") if latex is None else Markup("±") if latex == "±" else mathml(latex, display="inline")
    return (name.replace("_", " "), shown, None if value is None else f"{value:.6g}", unit_html(unit) or "–", where)
