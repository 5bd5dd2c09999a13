"""Fault descriptions: TOML files with unit strings, checked at the boundary and turned into `Fault`."""

import tomllib
from dataclasses import MISSING, fields
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from quakedesign.errors import QuakedesignError, ScenarioError, UnknownNameError
from quakedesign.fault.disturbance import Disturbance
from quakedesign.fault.friction import friction_law
from quakedesign.fault.parameters import Fault
from quakedesign.fault.reference import Reference
from quakedesign.fault.uncertainty import UncertaintyBox, uncertainty_box
from quakedesign.fault.units import si_value
from quakedesign.rationals import rational

_LARGEST_FILE = 1 << 20
_BRANCHES = {"str", "float", "int", "Spread"}  # names that pydantic adds for the members of a union


def presets() -> list[str]:
    """Names of the faults that come with the package."""
    folder = files("quakedesign.fault") / "presets"
    return sorted(p.name.removesuffix(".toml") for p in folder.iterdir() if p.name.endswith(".toml"))


def load_fault(source: str | Path, *, box: str | None = None) -> Fault:
    """Fault from a preset's name or the path of a TOML file.

    Parameters
    ----------
    source : str or Path
        ``"real-fault"``, ``"lab-fault"``, or a path that ends in ``.toml``.
    box : str, optional
        Name of an uncertainty box that replaces the one in the file.

    Returns
    -------
    Fault
        In SI units.

    Raises
    ------
    UnknownNameError
        For a preset or box that does not exist.
    ScenarioError
        For a file that cannot be read, is not TOML, or lacks or adds a key.
    UnitError, ParameterError
        For a wrong unit or an unphysical value.
    """
    fault = parse_fault(_read(source), str(source))
    return fault.with_box(box) if box else fault


def _read(source: str | Path) -> str:
    if str(source) in presets():
        return (files("quakedesign.fault") / "presets" / f"{source}.toml").read_text(encoding="utf-8")
    path = Path(source)
    if path.suffix != ".toml":
        raise UnknownNameError(
            f"fault must be a preset ({', '.join(presets())}) or the path of a .toml file. Received {str(source)!r}."
        )
    try:
        large = path.stat().st_size > _LARGEST_FILE
        text = "" if large else path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "its name or its text is not UTF-8"
        raise ScenarioError(f"fault file cannot be read: {path}: {reason}. Give a readable TOML file.") from None
    if large:
        raise ScenarioError(
            f"a fault file must be at most 1 MiB. Received {path}, which is larger. Give a smaller one."
        )
    return text


def parse_fault(text: str, name: str) -> Fault:
    """Fault from the text of a TOML file; `name` names it in messages. Raises as `load_fault`."""
    try:
        raw = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise ScenarioError(f"{name} is not valid TOML: {error}. Compare with a preset.") from None
    return _build(_validated(raw, name), name)


@cache
def _model() -> Any:
    from typing import Annotated

    from pydantic import BaseModel, ConfigDict, Field

    class Strict(BaseModel):
        model_config = ConfigDict(extra="forbid", strict=True)

    class Task(Strict):
        target_slip: str
        operation_time: str
        sampling_time: str

    class Shaking(Strict):
        constant: str = "0 m/s^2"
        amplitude: str = "0 m/s^2"
        frequency: str = "0 rad/s"
        slip_growth: str = "0 1/s^2"
        rate_growth: str = "0 1/s"

    class Spread(Strict):
        stiffness: str | float = 0.0
        damping: str | float = 0.0
        authority: str | float = 0.0

    class Scenario(Strict):
        name: Annotated[str, Field(pattern=r"^[\w][\w .+-]{0,59}$")]
        source: str
        density: str
        shear_modulus: str
        length: str
        damping: str
        effective_normal_stress: str
        friction: dict[str, str | float | int]
        task: Task
        disturbance: Shaking = Shaking()
        uncertainty: str | Spread = "paper"

    return Scenario


def _validated(raw: dict[str, Any], name: str) -> Any:
    from pydantic import ValidationError

    try:
        return _model().model_validate(raw)
    except ValidationError as error:
        deepest = max(error.errors(), key=lambda item: len(item["loc"]))
        where = ".".join(str(part) for part in deepest["loc"] if part not in _BRANCHES)
        said = {
            "missing": f"{where} must be given. Received nothing",
            "extra_forbidden": f"{where} is not a known key",
            "string_pattern_mismatch": f"{where} must be of at most 60 letters, digits, spaces and _ . + -, beginning "
            f"with a letter or digit. Received {str(deepest['input'])[:60]!r}",
        }
        wrong = f"{where} has the wrong type. Received {str(deepest['input'])[:60]!r}"
        raise ScenarioError(
            f"{name}: {said.get(deepest['type'], wrong)}. Every quantity is a text with a unit; compare with a preset."
        ) from None


def _build(scenario: Any, name: str) -> Fault:
    try:
        return Fault(
            name=scenario.name,
            source=scenario.source,
            density=si_value(scenario.density, "kg/m^3", "density"),
            shear_modulus=si_value(scenario.shear_modulus, "Pa", "shear_modulus"),
            length=si_value(scenario.length, "m", "length"),
            damping=si_value(scenario.damping, "kg/s", "damping"),
            effective_normal_stress=si_value(scenario.effective_normal_stress, "Pa", "effective_normal_stress"),
            friction=_friction(dict(scenario.friction)),
            reference=Reference(
                target_slip=si_value(scenario.task.target_slip, "m", "task.target_slip"),
                operation_time=si_value(scenario.task.operation_time, "s", "task.operation_time"),
            ),
            sampling_time=si_value(scenario.task.sampling_time, "s", "task.sampling_time"),
            disturbance=_disturbance(scenario.disturbance),
            box=_box(scenario.uncertainty),
        )
    except QuakedesignError as error:
        raise type(error)(f"{name}: {error}") from None


def _friction(entries: dict[str, Any]):
    if not isinstance(entries.get("law"), str):
        raise ScenarioError('friction.law must name a friction law. Received none. Add law = "…".')
    law = friction_law(entries.pop("law"))
    units = {name: f.metadata["unit"] for name, f in law.quantities().items()}
    expected = [f.name for f in fields(law)]  # type: ignore[arg-type]
    needed = {f.name for f in fields(law) if f.default is MISSING}  # type: ignore[arg-type]
    if not needed <= set(entries) <= set(expected):
        raise ScenarioError(
            f"friction must have exactly the parameters {', '.join(expected)} of {law.name}. "
            f"Received {', '.join(entries) or 'none'}."
        )
    read = {key: si_value(entries[key], unit, f"friction.{key}") for key, unit in units.items() if key in entries}
    return law(**entries | read)


def _disturbance(entries: Any) -> Disturbance:
    units = {
        "constant": "m/s^2",
        "amplitude": "m/s^2",
        "frequency": "rad/s",
        "slip_growth": "1/s^2",
        "rate_growth": "1/s",
    }
    return Disturbance(**{k: si_value(getattr(entries, k), u, f"disturbance.{k}") for k, u in units.items()})


def _box(entries: Any) -> UncertaintyBox:
    if isinstance(entries, str):
        return uncertainty_box(entries)
    widths = {
        k: rational(si_value(getattr(entries, k), "", f"uncertainty.{k}"), f"uncertainty.{k}")
        for k in ("stiffness", "damping", "authority")
    }
    return UncertaintyBox(name="own", **widths)
