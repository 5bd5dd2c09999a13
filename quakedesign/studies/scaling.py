"""Gains scaled from one fault to another, for the command ``scale``."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from quakedesign.exact import rational
from quakedesign.fault import Fault, load_fault
from quakedesign.fault.similarity import TOLERANCE, GroupComparison, Radical, Scales, similarity
from quakedesign.files import Json
from quakedesign.laws import Controller, control_law
from quakedesign.laws import published as published_controllers
from quakedesign.laws.gain_scaling import (
    UNROUNDED,
    Form,
    ScaledGains,
    agrees,
    carry,
    exact,
    law_dimensions,
    printed_gains,
)
from quakedesign.lyapunov.exact.perturbation_bounds import least_authority
from quakedesign.studies.single_runs import choice

SCALED = {
    "slip": ("λ_δ", "slip_m"),
    "time": ("λ_t", "s"),
    "pressure": ("λ_p", "Pa"),
    "slip_rate": ("λ_v", "slip_m/s"),
    "friction": ("λ_μ", "slip_m/normal_m"),
    "length": ("λ_L", "fault_m"),
    "density": ("λ_ρ", "kg/fault_m^3"),
    "shear_modulus": ("λ_G", "shear_Pa*fault_m/slip_m"),
    "damping": ("λ_η", "shear_N/(slip_m/s)"),
    "seismic_moment": ("λ_M0", "shear_N*fault_m"),
}
"""Symbol and unit of each quantity whose scale factor is reported."""


def scale_answer(
    source: Fault | str | Path,
    target: Fault | str | Path,
    controller_name: str,
    gains: str | Sequence[str] = "published",
    *,
    clock: str | None = None,
) -> dict[str, Any]:
    """Gains of a controller scaled from one fault to another, with scale factors and differences of the faults.

    Published gains have the divisor μ0N̂0, as in the paper; given gains have the divisor μ_res·N̂_min of the source,
    and the results that of the target.

    Parameters
    ----------
    source, target : Fault, str or Path
        Faults, names of presets or paths.
    controller_name : str
    gains : str or sequence of str
        ``"published"``, or the gains in order (λ = 1).
    clock : str, optional
        Source of the time scale, as in `similarity`.

    Returns
    -------
    dict
        JSON-able. Rational numbers are exact texts, irrational ones decimals with 12 significant digits.

    Raises
    ------
    UnknownNameError, ParameterError
        For an unknown controller or fault, missing published gains, or invalid gains.
    """
    start, end = (f if isinstance(f, Fault) else load_fault(f) for f in (source, target))
    names = (gains,) if isinstance(gains, str) else tuple(gains)
    law = choice(start, controller_name, names).controller
    own = names != ("published",) and law.divisor is not None
    relation = similarity(start, end, clock=clock)
    carried = carry(law, relation.scales, divisor=least_authority(end) if own else None)
    output = "pressure·divisor" if own else "pressure"
    options: dict[str, Any] = {"feedback": law.feedback} if hasattr(law, "feedback") else {}
    if law.divisor is not None:
        options = {"scale": law.scale, "source_divisor": law.divisor, "divisor": carried.law.divisor}
    return {
        "from": start.name,
        "to": end.name,
        "controller": law.name,
        "title": law.title,
        "gains": _texts(carried.gains),
        "gains_decimal": {name: float(gain) for name, gain in carried.gains.items()},
        "source_gains": _texts(exact(law).gains),
        "exponents": {name: _product_text(form, output) for name, form in law_dimensions(law).gains.items()},
        **{name: value if name == "feedback" else str(value) for name, value in options.items()},
        "integrals": _texts(carried.integrals),
        "scale_factors": {name: relation.scales.of(unit).text() for name, (_, unit) in SCALED.items()},
        "fixed_by": list(relation.repeating),
        "similar": relation.similar(),
        "tolerance": str(TOLERANCE),
        "differing": [_group(c) for c in relation.differing],
        "violations": [c.group.name for c in relation.violations()],
        "unmatched": list(relation.unmatched),
        "published": _published(end, carried),
        "unrounded": _unrounded(start, end, law, relation.scales) if names == ("published",) else None,
    }


def _texts(values: Mapping[str, Radical]) -> dict[str, str]:
    return {name: value.text() for name, value in values.items()}


def _product_text(form: Form, output: str) -> str:
    words = {"output": f"({output})" if "·" in output else output}
    powers = [(words.get(base, base), form[base]) for base in ("output", "slip", "time") if base in form]
    return "·".join(word if power == 1 else f"{word}^({power})" for word, power in powers) or "1"


def _group(comparison: GroupComparison) -> Json:
    return {
        "group": comparison.group.name,
        "formula": comparison.group.formula,
        "source": comparison.source.text(),
        "target": comparison.target.text(),
        "ratio": None if comparison.ratio is None else float(comparison.ratio),
    }


def _published(target: Fault, carried: ScaledGains) -> Json | None:
    """Printed gains of the target, if they exist for the same λ and divisor."""
    printed = published_controllers(target.name).get(carried.law.name)
    if printed is None or any(
        getattr(printed, option, None) != getattr(carried.law, option, None) for option in ("scale", "divisor")
    ):
        return None
    return {
        name: {
            "printed": text,
            "agrees": agrees(carried.gains[name], text),
            "deviation": float(carried.gains[name] / rational(text)) - 1 if rational(text) else None,
        }
        for name, text in printed_gains(target.name, carried.law.name).items()
    }


def _unrounded(source: Fault, target: Fault, law: Controller, scales: Scales) -> Json | None:
    """Scaled gains from the unrounded gains of the paper (ERRATA 25), if these are known."""
    values = UNROUNDED.get((source.name, law.name))
    if values is None:
        return None
    first = control_law(law.name).from_values(values)
    carried = carry(first, scales)
    return {
        "source_gains": _texts(exact(first).gains),
        "gains": _texts(carried.gains),
        "published": _published(target, carried),
    }
