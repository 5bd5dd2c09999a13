"""Fault files in TOML with units: presets, reading, default values, template and schema.

Units are checked and converted to SI here, at the boundary. All errors of a file are collected and
reported together. Default values: radiation damping, and a task like that of the faults in the paper.
"""

import inspect
import json
import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import MISSING, fields, replace
from decimal import ROUND_FLOOR, Context, Decimal
from fractions import Fraction
from math import inf, nextafter
from pathlib import Path
from typing import Any

from quakedesign.discovery import user_code
from quakedesign.errors import ParameterError, ScenarioError, UnknownNameError
from quakedesign.exact import float_below, rational
from quakedesign.fault.friction import friction_law, friction_laws
from quakedesign.fault.friction.base import FrictionLaw
from quakedesign.fault.model import (
    BOXES,
    Disturbance,
    Fault,
    Problems,
    Reference,
    UncertaintyBox,
    acceleration,
    is_ordinary,
    require_name,
    require_plant,
    require_positive,
    uncertainty_box,
)
from quakedesign.fault.units import si_value, units_of
from quakedesign.files import parse_toml, read_text
from quakedesign.text import nearest_name, shown

# ----------------------------------------------------------------------
# Tables of a file with quantities, read entry by entry; whatever is wrong with them is collected.

Reader = Callable[[Any, str, str], float]
"""Value in an SI unit of an entry, with the entry's name for messages."""


class Table:
    """One table of a file.

    Parameters
    ----------
    entries : mapping
        As the file has them.
    problems : Problems
        That collect what is wrong.
    where : str
        Dotted name of the table, empty for the whole file.
    """

    def __init__(self, entries: Mapping[str, Any], problems: Problems, where: str = "") -> None:
        self.entries, self.problems, self.where = entries, problems, where
        self._known: list[str] = []
        self._missing: list[str] = []

    def quantities(
        self, units: Mapping[str, str], *, optional: bool = False, read: Reader = si_value
    ) -> dict[str, float | None]:
        """Values in SI units by name; None for one that is wrong, nothing for an optional one that is not given."""
        quantities: dict[str, float | None] = {}
        for key, unit in units.items():
            if self._given(key, optional):
                quantities[key] = None
                with self.problems.collected():
                    quantities[key] = read(self.entries[key], unit, self._name(key))
            elif not optional:
                quantities[key] = None
        return quantities

    def spelling(self, name: str, symbol: str) -> str:
        """How the file spells an entry: by its name, or by its symbol, as ``Dc`` or ``d_c`` for :math:`d_c`."""
        spelt = [
            key for key in self.entries if key == name or (key not in self._known and _letters(key) == _letters(symbol))
        ]
        with self.problems.collected():
            if len(spelt) > 1:
                raise ScenarioError(
                    f"{self._name(name)} must be given once. Received {' and '.join(spelt)}. Omit one of them."
                )
        return spelt[0] if len(spelt) == 1 else name

    def text(self, key: str, *, optional: bool = False) -> str | None:
        """Text of an entry; None for one that is wrong or not given."""
        return self._of_type(key, str, "a text") if self._given(key, optional) else None

    def table(self, key: str, *, optional: bool = False) -> "Table | None":
        """Table inside this one; None for one that is wrong or not given."""
        entries = self._of_type(key, dict, "a table") if self._given(key, optional) else None
        return None if entries is None else Table(entries, self.problems, self._name(key))

    def name_or_table(self, key: str, default: str) -> "str | Table | None":
        """Text or table of an entry, the default where it is not given; None for a wrong one."""
        value = self._of_type(key, (str, dict), "a name or a table") if self._given(key, True) else default
        return Table(value, self.problems, self._name(key)) if isinstance(value, dict) else value

    def close(self) -> None:
        """Say at once which entries are missing, and which are not known and what they are near to."""
        near = {key: nearest_name(key, self._missing or self._known) for key in self._others()}
        meant = {key for key in self._missing if f" Did you mean {key}?" in near.values()}
        self.say_missing(meant)
        with self.problems.collected():
            if near:
                named = " ".join(f"{self._name(key)} is not a known key.{question}" for key, question in near.items())
                raise ScenarioError(f"{named} Known here are {', '.join(self._known)}.")

    def say_missing(self, but: Collection[str] = ()) -> None:
        """Say which entries are missing."""
        missing = [self._name(key) for key in self._missing if key not in but]
        with self.problems.collected():
            if missing:
                raise ScenarioError(f"{', '.join(missing)} must be given. Received nothing. Compare with a preset.")

    def _others(self) -> list[str]:
        return [key for key in self.entries if key not in self._known]

    def _given(self, key: str, optional: bool = False) -> bool:
        self._known.append(key)
        if key not in self.entries and not optional:
            self._missing.append(key)
        return key in self.entries

    def _of_type(self, key: str, kind: type | tuple[type, ...], what: str) -> Any:
        value = self.entries[key]
        with self.problems.collected():
            if not isinstance(value, kind):
                raise ScenarioError(
                    f"{self._name(key)} must be {what}. Received {shown(value)}. Compare with a preset."
                )
            return value
        return None

    def _name(self, key: str) -> str:
        return f"{self.where}.{key}".strip(".")


def _letters(symbol: str) -> str:
    """Letters and digits of a symbol, in small letters."""
    return re.sub(r"[^a-z0-9]", "", symbol.lower())


# ----------------------------------------------------------------------
# Where descriptions of faults come from: presets, and files of the user.

LARGEST_FILE = 1 << 16
"""Bytes; reading a key of many dots takes the square of its length."""
_PRESETS = Path(__file__).parent / "presets"


def presets() -> list[str]:
    """Names of the faults that come with the package."""
    return sorted(path.stem for path in _PRESETS.glob("*.toml"))


def require_source(source: str) -> str:
    """Name of a preset or of a file."""
    if source not in presets() and Path(source).suffix != ".toml":
        raise UnknownNameError(
            f"fault must be a preset ({', '.join(presets())}) or the path of a .toml file. Received {source!r}."
            + nearest_name(source, presets())
        )
    return source


def source_text(source: str | Path) -> str:
    """Text of a preset or file."""
    if require_source(str(source)) in presets():
        return (_PRESETS / f"{source}.toml").read_text(encoding="utf-8")
    return read_text(source, "fault file", largest=LARGEST_FILE, refusal=ScenarioError)


# ----------------------------------------------------------------------
# What a file may leave out: damping from physics, a task like that of the paper's faults.

PERIODS = 4.6e5
"""ω_n times the operation time [-] of both faults of Table I."""
SAMPLES = 10.0
"""Samples while the fastest of an error and of a free oscillation grows or turns by one."""
AGEINGS = 20.0
"""Samples in D_c/V, few enough to be summed in a proof of slow sliding at V and many enough to control it."""
_STEP = "sampling time"
_SHARE = 1000  # of the operation time, which a sampling time must not exceed


def radiation_damping(density: float, shear_modulus: float, area: float) -> float:
    """GA/(2c_s) [kg/s]: what plane shear waves carry away from both sides of a sliding patch.

    Parameters
    ----------
    density : float
        ρ [kg/m³].
    shear_modulus : float
        G [Pa].
    area : float
        A [m²].

    Notes
    -----
    Rice (1993), J. Geophys. Res. 98(B6), 9885; c_s = √(G/ρ) is the speed of shear waves.
    """
    return area * math.sqrt(density * shear_modulus) / 2


def sliding_step(law: FrictionLaw, task: Reference) -> float:
    """T_s [s] near which slow sliding at the mean rate V of a task has a guarantee: D_c/(20 V), rounded down.

    Parameters
    ----------
    law : FrictionLaw
        With a state.
    """
    ageing = float(min(law.steady_state(mean_rate(task))))
    return _cut(min(ageing / AGEINGS, task.operation_time / _SHARE), digits=2)


def mean_rate(task: Reference) -> float:
    """V [m/s], the target slip over the operation time."""
    return task.target_slip / task.operation_time


def beyond_rates(law: FrictionLaw, rate: float, *, source: str = "") -> str:
    """That a slip rate [m/s] lies outside the working range of a law, as one sentence; empty for one inside.

    The range is that of slowest_rate and fastest_rate, unless another `source` of it is named.
    """
    slowest, fastest = law.working_rates
    if slowest <= rate <= fastest:
        return ""
    return (
        f"V = {rate:.3g} m/s is {'below' if rate < slowest else 'above'} the rates "
        f"{source or 'for which friction is known'}, {slowest:.2g} to {fastest:.2g} m/s"
        f"{'' if source else ' (slowest_rate, fastest_rate)'}: a, b and D_c are extrapolated"
    )


def step_assumed(fault: Fault) -> bool:
    """Whether the T_s of a fault was filled in, so that another friction has another."""
    return any(said.startswith(_STEP) for said in fault.assumed)


def completed(parts: Mapping[str, Any], task: Mapping[str, float], said: tuple[str, ...] = ()) -> Fault:
    """Fault of what a file has, the rest filled in and told in `Fault.assumed`.

    Parameters
    ----------
    parts : mapping
        Arguments of `Fault`, those of the task and perhaps the damping excepted.
    task : mapping
        target_slip [m], operation_time [s], ramp [-], sampling_time [s], as far as given.
    said : tuple of str
        What was assumed before.

    Raises
    ------
    ScenarioError
        For a task that has to be given.
    ParameterError
        For an unphysical value.
    """
    assumed = list(said)
    longest = task.get("operation_time", math.inf)
    trial = {
        "damping": 0.0,
        **parts,
        "reference": Reference(target_slip=1.0, operation_time=1.0),
        "sampling_time": 1e-3,
    }
    fault = Fault(**trial)
    if "damping" not in parts:
        damping = _cut(radiation_damping(fault.density, fault.shear_modulus, fault.area))
        assumed.append(f"damping {damping:g} kg/s, the radiation of shear waves, G A/(2 c_s), rounded down")
        fault = Fault(**trial | {"damping": damping})
    target = task.get("target_slip") or _target(fault, assumed)
    if "operation_time" not in task:
        longest = _cut(PERIODS / fault.natural_frequency)
        assumed.append(f"operation time {longest:g} s, about as many natural periods as for the paper's faults")
    reference = Reference(target_slip=target, operation_time=longest, ramp=task.get("ramp"))
    step = task.get("sampling_time") or _step(fault, reference, assumed)
    return Fault(
        **dict(parts) | {"damping": fault.damping, "reference": reference, "sampling_time": step},
        assumed=tuple(assumed),
    )


def _why_stable(fault: Fault) -> str:
    weakens = fault.authority * fault.effective_normal_stress * fault.friction.slip_slope
    return (
        f"a stable fault has none (per m of slip its spring unloads by {fault.specific_stiffness:.3g} m/s^2, friction "
        f"by at most {weakens:.3g} m/s^2 under {fault.effective_normal_stress:.4g} Pa; check units)"
    )


def _target(fault: Fault, assumed: list[str]) -> float:
    slip = fault.rest_slip
    if not slip > 0:
        why = "friction with a state has none" if math.isnan(slip) else _why_stable(fault)
        raise ScenarioError(
            f"task.target_slip must be given, because its default is the next rest slip, and {why}. "
            "Received nothing. Add [task] with target_slip."
        )
    target = _cut(slip)
    assumed.append(f"target slip {target:g} m, the next rest slip rounded down")
    return target


def _step(fault: Fault, task: Reference, assumed: list[str]) -> float:
    if fault.friction.state_names:
        step = sliding_step(fault.friction, task)
        assumed.append(f"{_STEP} {step:g} s, near D_c/({AGEINGS:g} V) in slow sliding at the task's mean rate V")
        return step
    pace = max(fault.natural_frequency, _growth(fault))
    step = _cut(min(1 / (SAMPLES * pace), task.operation_time / _SHARE), digits=2)
    assumed.append(
        f"{_STEP} {step:g} s, at least {SAMPLES:g} samples while an error grows e-fold or oscillates by 1 rad"
    )
    return step


def _growth(fault: Fault) -> float:
    """Largest real pole [1/s] without pressure, friction as steep as it can be; others turn faster than they grow."""
    push, law = fault.authority * fault.effective_normal_stress, fault.friction
    damping = fault.specific_damping - push * law.rate_slope
    stiffness = fault.specific_stiffness - push * law.slip_slope
    return (math.sqrt(max(damping**2 - 4 * stiffness, 0)) - damping) / 2


def _cut(value: float, digits: int = 3) -> float:
    """Rounded down to so many digits."""
    return float(Context(prec=digits, rounding=ROUND_FLOOR).create_decimal(Decimal(value)))


# ----------------------------------------------------------------------
# Fault descriptions: TOML files with unit strings, checked at the boundary and turned into `Fault`.

PLANT = units_of(Fault)
TASK = units_of(Reference) | {"sampling_time": PLANT.pop("sampling_time")}
DISTURBANCE = units_of(Disturbance)
WIDTHS = ("stiffness", "damping", "authority")
OPTIONAL = ("damping", "width")  # of the plant
_NO_SOURCE = "no source given"
_UNDISTURBED = "no disturbance, so that no guarantee covers one: give amplitude in [disturbance], such as '2 kPa'"
_STILL = (
    "frequency 0 of the disturbance, so that its sine is 0 in every run; guarantees are for any course of its size. "
    "Give a frequency to see one"
)


def load_fault(
    source: str | Path, *, box: str | None = None, disturbance: str | None = None, allow_code: bool = False
) -> Fault:
    """Fault from a preset's name or the path of a TOML file.

    Parameters
    ----------
    source : str or Path
        ``"real-fault"``, ``"lab-fault"``, or a path that ends in ``.toml``.
    box : str, optional
        Name of an uncertainty box that replaces the one in the file.
    disturbance : str, optional
        Amplitude in place of the file's: an acceleration, or a shear stress on the fault, such as ``"35 kPa"``, that
        its own area and mass make one.
    allow_code : bool
        Whether the file may name a friction law ``module:Class`` of the user's own, whose module is imported and run.

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
    fault = parse_fault(source_text(source), str(source), allow_code=allow_code)
    fault = fault.with_box(box) if box else fault
    if disturbance is None:
        return fault
    if fault.friction.state_names:
        raise ParameterError(
            f"a disturbance of friction with a state is a stress of its own. Received {disturbance!r}. Give --stress."
        )
    amplitude, stressed = acceleration(disturbance, fault.exact_authority, "disturbance")
    stresses = {*fault.disturbance.stresses} - {"amplitude"} | ({"amplitude"} if stressed else set())
    changed = replace(fault.disturbance, amplitude=amplitude, stresses=tuple(sorted(stresses)))
    return fault.with_disturbance(changed)


def parse_fault(text: str, name: str, *, allow_code: bool = False) -> Fault:
    """Fault from the text of a TOML file; `name` names it in messages, all errors in one. See `load_fault`."""
    if len(text) > LARGEST_FILE:
        raise ScenarioError(f"{name}: a fault file must be at most 64 KiB. Received {len(text)} characters.")
    try:
        raw = parse_toml(text)
    except ValueError as error:
        remedy = "Values with a unit are in quotes, such as length = '5 km'."
        raise ScenarioError(f"{name} is not valid TOML: {error}. {remedy}") from None
    if {"block", "well"} & set(raw):
        raise ScenarioError(
            f"{name} must have no [[block]] and [[well]] tables here. Received a fault of several blocks. Use the "
            "commands fault, design, guarantee, compare, simulate, export or limits (Python: quakedesign.load_chain)."
        )
    problems = Problems()
    fault: Fault = fault_of_tables(Table(raw, problems), problems, allow_code)
    problems.refuse(name)
    return fault


def fault_of_tables(table: Table, problems: Problems, allow_code: bool) -> Any:
    """Fault of a whole file; there are problems where it is None."""
    parts: dict[str, Any] = {"name": table.text("name"), "source": _NO_SOURCE}
    for key in ("source", "poor_fit"):
        text = table.text(key, optional=True)
        parts |= {key: text} if key in table.entries else {}
    for key, unit in PLANT.items():
        parts |= table.quantities({key: unit}, optional=key in OPTIONAL)
    parts["friction"] = read_friction(table.table("friction"), problems, allow_code)
    task = _task(table.table("task", optional=True), problems)
    parts["disturbance"] = _disturbance(table.table("disturbance", optional=True), problems, _authority(parts))
    parts["box"] = _box(table, problems)
    table.close()
    given = {key: value for key, value in parts.items() if value is not None}
    whole = task if given == parts else None
    with problems.collected():
        if whole is not None:
            return completed(parts, whole, _assumed(parts, table))
        require_plant(**{key: given[key] for key in PLANT if key in given})
    with problems.collected():
        if whole is None and "name" in given:
            require_name(given["name"])
    return None


def read_friction(table: Table | None, problems: Problems, allow_code: bool) -> Any:
    """Friction law of a table; None for one that is wrong."""
    name = table.text("law") if table else None
    if table is None or name is None:
        if table:
            table.say_missing()
        return None
    with problems.collected(), user_code():
        law = friction_law(name, in_file=True, allow_code=allow_code)
        quantities = law.quantities()
        optional = {f.name for f in fields(law) if f.default is not MISSING}  # type: ignore[arg-type]
        read: dict[str, Any] = {}
        for field in fields(law):  # type: ignore[arg-type]
            if field.name in quantities:
                key = table.spelling(field.name, field.metadata["symbol"])
                value = table.quantities({key: field.metadata["unit"]}, optional=field.name in optional)
                read |= dict.fromkeys([field.name] if value else [], value.get(key))
            elif "unit" in field.metadata:
                read |= table.quantities({field.name: field.metadata["unit"]}, optional=field.name in optional)
            else:
                text = table.text(field.name, optional=field.name in optional)
                read |= {field.name: text} if field.name not in optional or field.name in table.entries else {}
        table.close()
        return None if None in read.values() else law(**read)
    return None


def _task(table: Table | None, problems: Problems) -> dict[str, float] | None:
    """What a file says of the task; None where that is wrong."""
    if table is None:
        return {}
    read = table.quantities(TASK, optional=True)
    table.close()
    with problems.collected():
        require_positive("", **{key: value for key, value in read.items() if value is not None})
        return {key: value for key, value in read.items() if value is not None} if None not in read.values() else None
    return None


def _authority(parts: Mapping[str, Any]) -> Fraction:
    """A/m [m²/kg]; of a plant that is wrong, and refused for it, any."""
    density, *sides = (parts.get(name) for name in ("density", "length", "width"))
    told = [value for value in (density, *sides) if value is not None]
    if density is None or len(told) == 1 or not all(map(is_ordinary, told)):
        return Fraction(1)
    return 1 / (rational(density) * rational(min(told[1:])))


def _assumed(parts: Mapping[str, Any], table: Table) -> tuple[str, ...]:
    """What a file leaves open of its disturbance, for friction without a state."""
    if parts["friction"].state_names:
        return ()
    if "disturbance" not in table.entries:
        return (_UNDISTURBED,)
    told = parts["disturbance"]
    return (_STILL,) if told.amplitude and not (told.frequency or told.constant) else ()


def _disturbance(table: Table | None, problems: Problems, authority: Fraction) -> Disturbance | None:
    stresses = []

    def value(quantity: Any, unit: str, name: str) -> float:
        if unit != "m/s^2":
            return si_value(quantity, unit, name)
        size, stressed = acceleration(quantity, authority, name)
        stresses.extend([name.rpartition(".")[2]] if stressed else [])
        return size

    read: dict[str, Any] = {**table.quantities(DISTURBANCE, optional=True, read=value)} if table else {}
    if table:
        table.close()
    with problems.collected():
        return None if None in read.values() else Disturbance(**read, stresses=tuple(sorted(stresses)))
    return None


def _box(parent: Table, problems: Problems) -> UncertaintyBox | None:
    """Named box, or one of the file's own."""
    given = parent.name_or_table("uncertainty", "paper")
    if not isinstance(given, Table):
        with problems.collected():
            return None if given is None else uncertainty_box(given)
        return None
    read = given.quantities(dict.fromkeys(WIDTHS, ""), optional=True)
    given.close()
    with problems.collected():
        widths = {key: rational(value, f"uncertainty.{key}") for key, value in read.items() if value is not None}
        return None if None in read.values() else UncertaintyBox(name="own", **widths)
    return None


# ----------------------------------------------------------------------
# A fault as a TOML file: one to start from, one that says all that a result rests on, and the schema for editors.

SCHEMA_NAME = "fault.schema.json"
_EXAMPLES: dict[str, str | float] = {
    "density": "2600 kg/m^3",
    "shear_modulus": "25 GPa",
    "length": "1.5 km",
    "width": "1.5 km",
    "damping": "1e13 kg/s",
    "effective_normal_stress": "25 MPa",
    "target_slip": "5 cm",
    "operation_time": "2 days",
    "ramp": 0.1,
    "sampling_time": "10 ms",
    "constant": "0 m/s^2",
    "amplitude": "1e-4 m/s^2",
    "frequency": "1 rad/s",
    "slip_growth": "0 1/s^2",
    "rate_growth": "0 1/s",
    "residual": 0.45,
    "healing": 0.0001,
    "drop": 0.15,
    "critical_slip": "2 cm",
    "critical_rate": "10 cm/s",
    "reference_coefficient": 0.6,
    "direct_effect": 0.010,
    "evolution_effect": 0.015,
    "reference_rate": "1 um/s",
    "slowest_rate": "1e-12 m/s",
    "fastest_rate": "1 m/s",
}
_WIDTHS_SAID = {"stiffness": "of k/m", "damping": "of η/m", "authority": "of A/m, the area per mass"}
_COME_TO_REST = ("exponential-slip-weakening", "linear-slip-weakening")
_LEFT_OUT = {
    "healing": "0 if left out",
    "width": "square if left out",
    "damping": "radiation of shear waves, G A/(2 c_s), if left out",
    "target_slip": "the next rest slip if left out",
    "operation_time": "about as many natural periods as for the paper's faults if left out",
    "ramp": "all of it at a constant rate if left out",
    "sampling_time": "at least ten samples while an error grows e-fold, with a state near D_c/(20 V), if left out",
}


def fault_toml(fault: Fault) -> str:
    """Text of a TOML file that `load_fault` reads as this fault, every number in SI units and nothing left out."""
    law = type(fault.friction)
    named: dict[str, Mapping[str, Any]] = {
        "friction": {"law": (law.name if law in friction_laws().values() else f"{law.__module__}:{law.__qualname__}")}
        | _law_values(fault.friction),
        "task": _values(fault.reference, TASK) | {"sampling_time": f"{fault.sampling_time!r} s"},
        "disturbance": _values(fault.disturbance, DISTURBANCE) | _stresses(fault),
        "uncertainty": {key: float(getattr(fault.box, key)) for key in WIDTHS},
    }
    top: dict[str, Any] = {"name": fault.name, "source": fault.source} | _values(fault, PLANT)
    if fault.poor_fit:
        top["poor_fit"] = fault.poor_fit
    if fault.box == BOXES.get(fault.box.name):
        top["uncertainty"] = fault.box.name
        del named["uncertainty"]
    lines = [*_entries(top)]
    for table, entries in named.items():
        lines += ["", f"[{table}]", *_entries(entries)]
    return "\n".join(lines) + "\n"


def _values(part: object, units: Mapping[str, str]) -> dict[str, Any]:
    held = {key: getattr(part, key, None) for key in units}
    return {
        key: (f"{value!r} {units[key]}" if units[key] else value) for key, value in held.items() if value is not None
    }


def _stresses(fault: Fault) -> dict[str, str]:
    """What of the disturbance was given as a stress: the least float that is read as no less."""
    found = {}
    for name in fault.disturbance.stresses:
        size = abs(getattr(fault.disturbance, name))
        stress = nextafter(float_below(rational(size) / fault.exact_authority), 0)
        while acceleration(f"{stress!r} Pa", fault.exact_authority, name)[0] < size:
            stress = nextafter(stress, inf)
        found[name] = f"{stress if getattr(fault.disturbance, name) >= 0 else -stress!r} Pa"
    return found


def _law_values(law: FrictionLaw) -> dict[str, Any]:
    options = {field.name: getattr(law, field.name) for field in fields(law)}  # type: ignore[arg-type]
    found = options | _values(law, units_of(type(law)))
    return {name: value for name, value in found.items() if name != "healing" or value}


def _entries(entries: Mapping[str, Any]) -> Iterator[str]:
    for key, value in entries.items():
        yield f"{key} = {_written(value)}"


def _written(value: Any) -> str:
    """Text or number as TOML has it."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(float(value))


def template(law: str = "exponential-slip-weakening", *, name: str = "my-fault", schema: bool = False) -> str:
    """Text of a commented TOML file to start from.

    Parameters
    ----------
    law : str
        Friction law.
    name : str
        Of the fault.
    schema : bool
        Whether its first line names the schema beside it, for editors.

    Raises
    ------
    UnknownNameError
        For another law.
    """
    friction = friction_law(law)
    asks = set() if law in _COME_TO_REST else {"target_slip"}
    task = {key: unit for key, unit in TASK.items() if friction.state_names or key != "ramp"}
    lines = [f"#:schema ./{SCHEMA_NAME}"] if schema else []
    lines += [
        "# A fault for quakedesign. Every number is an example: put in your own, each with its unit. What begins with",
        "# a # may be left out. `quakedesign fault FILE` shows what follows from it and what was assumed.",
        f"name = {_written(name)}",
        '# source = "where the numbers come from"',
        *_asked(PLANT, _described(Fault), OPTIONAL),
        "",
        "# What is uncertain besides friction: paper (nothing) or ten-percent (stiffness, damping and authority), or a",
        "# table [uncertainty] of your own, see the end.",
        '# uncertainty = "paper"',
        "",
        f"[friction]  # {_first(friction)}",
        '# A law of your own, "module:Class", runs its code: such a file is read with --allow-code alone.',
        f"law = {_written(law)}  # or {', '.join(sorted(set(friction_laws()) - {law}))}",
        *_asked(units_of(friction), _described(friction), _optional(friction)),
        "",
        f"{'' if asks else '# '}[task]  # what the fault shall do: slip slowly from rest to rest",
        *_asked(task, _task_described(), set(TASK) - asks),
        "",
        "# [disturbance]  # acceleration that nobody measures; the bound that guarantees are for",
        *_asked(DISTURBANCE, _described(Disturbance), DISTURBANCE),
        "",
        "# [uncertainty]  # half-widths relative to the numbers above, from 0 up to 1, each 0 if left out",
        *(f"# {key} = 0.1  # {said}" for key, said in _WIDTHS_SAID.items()),
    ]
    return "\n".join(lines) + "\n"


def _asked(units: Mapping[str, str], said: Mapping[str, str], optional: Any) -> Iterator[str]:
    for key in units:
        left = f"; {_LEFT_OUT[key]}" if key in _LEFT_OUT and key in optional else ""
        mark = "# " if key in optional else ""
        comment = f"{said.get(key, '').split('; ')[0].rstrip('.')}{left}"
        yield f"{mark}{key} = {_written(_example(key, units[key]))}{comment and f'  # {comment}'}"


def _example(key: str, unit: str) -> str | float:
    return _EXAMPLES.get(key, f"1 {unit}" if unit else 0.1)


def _task_described() -> dict[str, str]:
    return _described(Reference) | {"sampling_time": _described(Fault)["sampling_time"]}


def _first(law: type[FrictionLaw]) -> str:
    return (inspect.getdoc(law) or "").split("\n\n")[0].replace("\n", " ")


def _optional(law: type[FrictionLaw]) -> set[str]:
    return {field.name for field in fields(law) if field.default is not MISSING}  # type: ignore[arg-type]


def _described(kind: type) -> dict[str, str]:
    """What the docstring of a class and of those that it derives from say of its attributes, by name."""
    from docstring_parser import DocstringStyle, parse

    said: dict[str, str] = {}
    for of in reversed(kind.__mro__):
        for entry in parse(inspect.cleandoc(of.__doc__ or ""), DocstringStyle.NUMPYDOC).params:
            for name in entry.arg_name.split(", "):
                said[name] = " ".join((entry.description or "").split())
    return said


def fault_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of fault files, for editors that complete and check TOML."""
    said = _described(Fault)
    widths = {
        key: {"type": ["number", "string"], "description": said, "examples": [0.1]}
        for key, said in _WIDTHS_SAID.items()
    }
    properties = {
        "name": {"type": "string", "description": "letters, digits, spaces and _ . -"},
        "source": {"type": "string", "description": said["source"]},
        "poor_fit": {"type": "string", "description": said["poor_fit"]},
        **_quantities(PLANT, said),
        "uncertainty": {
            "oneOf": [{"enum": sorted(BOXES)}, _table(widths, ())],
            "description": (inspect.getdoc(UncertaintyBox) or "").splitlines()[0],
        },
        "friction": {"oneOf": [_law_schema(law) for _, law in sorted(friction_laws().items())]},
        "task": _table(_quantities(TASK, _task_described()), ()),
        "disturbance": _table(_quantities(DISTURBANCE, _described(Disturbance)), ()),
    }
    own = {key: properties[key] for key in ("length", "effective_normal_stress", "friction")}
    place = {"type": "string", "description": "along the fault", "examples": ["1 km"]}
    for key, items, needed, text in (
        ("block", own, "length", "tables [[block]], in a row; friction and stress are the fault's unless given"),
        ("well", {"position": place}, "position", "tables [[well]], from one end of the row"),
    ):
        properties[key] = {"type": "array", "description": text, "items": _table(items, (needed,))}
    properties["diffusivity"] = {
        "type": "string",
        "description": "of the pressure along a fault of several blocks [m²/s]; steady pressure unless given",
        "examples": ["1e6 m^2/s"],
    }
    required = ("name", *(key for key in PLANT if key not in OPTIONAL), "friction")
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "fault of quakedesign",
        **_table(properties, required),
    }


def _table(properties: Mapping[str, Any], required: Any) -> dict[str, Any]:
    return {
        "type": "object",
        "additionalProperties": False,
        "required": list(required),
        "properties": dict(properties),
    }


def _quantities(units: Mapping[str, str], said: Mapping[str, str]) -> dict[str, Any]:
    return {
        key: {
            "type": "string" if unit else ["number", "string"],
            "description": said.get(key, ""),
            "examples": [_example(key, unit)],
        }
        for key, unit in units.items()
    }


def _law_schema(law: type[FrictionLaw]) -> dict[str, Any]:
    units, said = units_of(law), _described(law)
    options = {field.name for field in fields(law)} - set(units)  # type: ignore[arg-type]
    properties = {
        "law": {"const": law.name, "description": _first(law)},
        **_quantities(units, said),
        **{key: {"type": "string", "description": said.get(key, "")} for key in sorted(options)},
    }
    schema = _table(properties, ("law",))
    schema["patternProperties"] = {
        _pattern(field.metadata["symbol"]): properties[key] for key, field in law.quantities().items()
    }
    schema["allOf"] = [_one_of(law, key) for key in units if key not in _optional(law)]
    return schema


def _pattern(symbol: str) -> str:
    """Pattern of the spellings of a symbol, as `Table.spelling` reads them."""
    letters = re.sub(r"[^a-z0-9]", "", symbol.lower())
    return "^_?" + "_?".join(f"[{c}{c.upper()}]" if c.isalpha() else c for c in letters) + "_?$"


def _one_of(law: type[FrictionLaw], key: str) -> dict[str, Any]:
    """That a parameter is given, by name or symbol."""
    pattern = _pattern(law.quantities()[key].metadata["symbol"])
    return {"anyOf": [{"required": [key]}, {"not": {"propertyNames": {"not": {"pattern": pattern}}}}]}
