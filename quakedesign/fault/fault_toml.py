"""Fault files in TOML with units: presets, reading, default values, writing.

Units are checked and converted to SI here, at the boundary. All errors of a file are collected and reported together.
Default values: radiation damping, and a task like that of the faults in the paper.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from decimal import ROUND_FLOOR, Context, Decimal
from fractions import Fraction
from math import inf, nextafter
from pathlib import Path

from quakedesign.discovery import user_code
from quakedesign.errors import ScenarioError, UnknownNameError
from quakedesign.exact import float_below, rational
from quakedesign.fault.entries import FileEntry, Table, entries_of
from quakedesign.fault.equilibrium import by_equilibrium
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
    require_all,
    require_name,
    require_plant,
    require_positive,
    uncertainty_box,
)
from quakedesign.fault.units import si_value
from quakedesign.files import Json, parse_toml, read_text
from quakedesign.text import nearest_name

# ----------------------------------------------------------------------
# Sources of faults: presets and files of the user.

LARGEST_FILE = 1 << 16
"""Largest file [byte] and text [characters]; the time to parse a dotted key grows with the square of its length."""
_PRESETS = Path(__file__).parent / "presets"


def presets() -> list[str]:
    """Names of the presets of the package."""
    return sorted(path.stem for path in _PRESETS.glob("*.toml"))


def require_source(source: str) -> str:
    """Return the name of a preset or the path of a .toml file; raise `UnknownNameError` for any other text."""
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
# Default values: damping from physics, a task like that of the paper's faults.

PERIODS = 4.6e5
"""ω_n times the operation time [-] of both faults of Table I."""
SAMPLES = 10.0
"""Samples per e-folding time of an error, or per radian of the free oscillation if that is faster."""
SAMPLES_PER_STATE_TIME = 20.0
"""Samples per d_c/V in slow sliding at a rate V: enough for control, and few enough to evaluate the sums of a proof."""
_STEP = "sampling time"
_SHARE = 1000  # smallest ratio of operation time to sampling time


def radiation_damping(density: float, shear_modulus: float, area: float) -> float:
    """GA/(2c_s) [kg/s]: damping by plane shear waves radiated from both sides of a sliding patch.

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
    """Default T_s [s] for slow sliding at the mean rate V of a task: d_c/(20 V), at most t_op/1000, rounded down.

    Parameters
    ----------
    law : FrictionLaw
        Friction law with a state.
    task : Reference
        Task with the mean rate V and the operation time t_op.
    """
    ageing = float(min(law.steady_state(mean_rate(task))))
    return _cut(min(ageing / SAMPLES_PER_STATE_TIME, task.operation_time / _SHARE), digits=2)


def mean_rate(task: Reference) -> float:
    """V [m/s], the target slip over the operation time."""
    return task.target_slip / task.operation_time


def rate_out_of_range(law: FrictionLaw, rate: float, *, source: str = "") -> str:
    """Statement that a slip rate [m/s] is outside the working range of a law; empty for a rate inside.

    The range is from slowest_rate to fastest_rate; the text names its origin `source`, if given.
    """
    slowest, fastest = law.working_rates
    if slowest <= rate <= fastest:
        return ""
    return (
        f"V = {rate:.3g} m/s is {'below' if rate < slowest else 'above'} the rates "
        f"{source or 'of the working range'}, {slowest:.2g} to {fastest:.2g} m/s"
        f"{'' if source else ' (slowest_rate, fastest_rate)'}: a, b and D_c are extrapolated"
    )


def step_assumed(fault: Fault) -> bool:
    """Whether the T_s of a fault is a default value, which depends on its friction."""
    return any(text.startswith(_STEP) for text in fault.assumed)


def completed(parts: Json, task: Mapping[str, float], remarks: tuple[str, ...] = ()) -> Fault:
    """Fault from the entries of a file, with default values that `Fault.assumed` lists.

    Parameters
    ----------
    parts : mapping
        Arguments of `Fault` without those of the task; the damping is optional.
    task : mapping
        target_slip [m], operation_time [s], ramp [-], sampling_time [s]; all are optional.
    remarks : tuple of str
        Remarks that precede the default values in `Fault.assumed`.

    Raises
    ------
    ScenarioError
        For a missing target slip that has no default.
    ParameterError
        For an unphysical value.
    """
    assumed = list(remarks)
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
        f"a stable fault has none (per m of slip its spring unloads by {fault.specific_stiffness:.3g} m/s^2, while "
        f"friction weakens by at most {weakens:.3g} m/s^2 under {fault.effective_normal_stress:.4g} Pa; check units)"
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


def _step_of_sliding(fault: Fault, task: Reference, assumed: list[str]) -> float:
    step = sliding_step(fault.friction, task)
    assumed.append(
        f"{_STEP} {step:g} s, at most D_c/({SAMPLES_PER_STATE_TIME:g} V) in slow sliding at the task's mean rate V"
    )
    return step


def _step_at_rest(fault: Fault, task: Reference, assumed: list[str]) -> float:
    pace = max(fault.natural_frequency, _growth(fault))
    step = _cut(min(1 / (SAMPLES * pace), task.operation_time / _SHARE), digits=2)
    assumed.append(
        f"{_STEP} {step:g} s, at least {SAMPLES:g} samples while an error grows e-fold or oscillates by 1 rad"
    )
    return step


_step = by_equilibrium(rest=_step_at_rest, sliding=_step_of_sliding)


def _growth(fault: Fault) -> float:
    """Largest real part [1/s] of the poles without pressure, for the steepest fall of friction."""
    load, law = fault.authority * fault.effective_normal_stress, fault.friction
    damping = fault.specific_damping - load * law.rate_slope
    stiffness = fault.specific_stiffness - load * law.slip_slope
    return (math.sqrt(max(damping**2 - 4 * stiffness, 0)) - damping) / 2


def _cut(value: float, digits: int = 3) -> float:
    """Value rounded down to `digits` significant digits."""
    return float(Context(prec=digits, rounding=ROUND_FLOOR).create_decimal(Decimal(value)))


# ----------------------------------------------------------------------
# Fault descriptions: TOML files with unit strings, checked at the boundary and turned into `Fault`.

PLANT = entries_of(Fault)
TEXTS = {name: PLANT.pop(name) for name in ("name", "source", "poor_fit")}
TASK = entries_of(Reference) | {"sampling_time": PLANT.pop("sampling_time")}
DISTURBANCE = entries_of(Disturbance)
WIDTHS = entries_of(UncertaintyBox)
del WIDTHS["name"]
_UNDISTURBED = "no disturbance; for guarantees that cover one, give amplitude in [disturbance], such as '2 kPa'"
_STILL = (
    "the disturbance has frequency 0, so its sine is 0 in every run; guarantees cover every disturbance within the "
    "amplitude. Give a frequency to simulate a sine"
)


def load_fault(
    source: str | Path, *, box: str | None = None, disturbance: str | None = None, allow_code: bool = False
) -> Fault:
    """Fault from a preset's name or the path of a TOML file.

    Parameters
    ----------
    source : str or Path
        Name of a preset, such as ``"real-fault"``, or a path that ends in ``.toml``.
    box : str, optional
        Name of an uncertainty box that replaces the one in the file.
    disturbance : str, optional
        Amplitude in place of the file's: an acceleration, or a shear stress on the fault, such as ``"35 kPa"``, which
        is converted with the area and mass of the fault.
    allow_code : bool
        Whether the file may name a user-defined friction law ``module:Class``, whose module is imported and run.

    Returns
    -------
    Fault
        In SI units.

    Raises
    ------
    UnknownNameError
        For a preset, box or friction law that does not exist, or a user-defined law without `allow_code`.
    ScenarioError
        For a file that cannot be read, is not TOML, lacks a required key, has an unknown one, or has several blocks.
    UnitError, ParameterError
        For a wrong unit, an unphysical value, or a `disturbance` for friction with a state.
    """
    fault = parse_fault(source_text(source), str(source), allow_code=allow_code)
    fault = fault.with_box(box) if box else fault
    if disturbance is None:
        return fault
    fault.friction.require(disturbance=disturbance)
    amplitude, stressed = acceleration(disturbance, fault.exact_authority, "disturbance")
    stresses = {*fault.disturbance.stresses} - {"amplitude"} | ({"amplitude"} if stressed else set())
    changed = replace(fault.disturbance, amplitude=amplitude, stresses=tuple(sorted(stresses)))
    return fault.with_disturbance(changed)


def parse_fault(text: str, name: str, *, allow_code: bool = False) -> Fault:
    """Fault from the text of a TOML file, called `name` in messages; see `load_fault`."""
    if len(text) > LARGEST_FILE:
        raise ScenarioError(
            f"{name}: a fault file must have at most {LARGEST_FILE} characters. Received {len(text)}. Shorten it."
        )
    try:
        raw = parse_toml(text)
    except ValueError as error:
        remedy = "Put values with a unit in quotes, such as length = '5 km'."
        raise ScenarioError(f"{name} is not valid TOML: {error}. {remedy}") from None
    if {"block", "well"} & set(raw):
        raise ScenarioError(
            f"{name} must have no [[block]] and [[well]] tables here. Received a fault of several blocks. Use the "
            "commands fault, design, guarantee, compare, simulate, export or limits (Python: quakedesign.load_chain)."
        )
    table = Table(raw, Problems())
    return table.problems.resolved(fault_of_tables(table, allow_code), name)


def fault_of_tables(table: Table, allow_code: bool) -> Fault | None:
    """Fault of a whole file; None if the table has errors, which are collected."""
    parts: Json = {"source": TEXTS["source"].default_text} | table.read(TEXTS | PLANT)
    parts["friction"] = read_friction(table.table("friction"), allow_code)
    task = _task(table.table("task", optional=True))
    parts["disturbance"] = _disturbance(table.table("disturbance", optional=True), _authority(parts))
    parts["box"] = _box(table)
    table.close()
    given = {key: value for key, value in parts.items() if value is not None}
    with table.problems.collected():
        if task is not None and given == parts:
            return completed(parts, task, _assumed(parts, table))
        require_all(
            lambda: require_plant(**{key: given[key] for key in PLANT if key in given}),
            lambda: require_name(given.get("name", "not given")),
        )
    return None


def read_friction(table: Table, allow_code: bool) -> FrictionLaw | None:
    """Friction law of a table; None for an invalid law, whose error is collected."""
    name = table.read({"law": FileEntry(name="law")})["law"]
    if name is None:
        table.report_missing()
        return None
    with table.problems.collected(), user_code():
        law = friction_law(name, in_file=True, allow_code=allow_code)
        values = table.read(entries_of(law))
        table.close()
        return None if None in values.values() else law(**values)
    return None


def _task(table: Table) -> dict[str, float] | None:
    """Entries of the task in a file; None if an entry is invalid."""
    values = table.read(TASK)
    table.close()
    given = {key: value for key, value in values.items() if value is not None}
    with table.problems.collected():
        require_positive("", **given)
        return given if given == values else None
    return None


def _authority(parts: Json) -> Fraction:
    """A/m [m²/kg]; 1 for an invalid plant, whose error is reported elsewhere."""
    density, *sides = (parts.get(name) for name in ("density", "length", "width"))
    given = [value for value in (density, *sides) if value is not None]
    if density is None or len(given) == 1 or not all(map(is_ordinary, given)):
        return Fraction(1)
    return 1 / (rational(density) * rational(min(given[1:])))


def _assumed(parts: Json, table: Table) -> tuple[str, ...]:
    """Remark on a disturbance that is missing or of frequency 0, for friction without a state."""
    if "disturbance" in parts["friction"].equilibrium.messages:
        return ()
    if "disturbance" not in table.entries:
        return (_UNDISTURBED,)
    given = parts["disturbance"]
    return (_STILL,) if given.amplitude and not (given.frequency or given.constant) else ()


def _disturbance(table: Table, authority: Fraction) -> Disturbance | None:
    stresses = []

    def value(quantity: object, unit: str, name: str) -> float:
        if unit != "m/s^2":
            return si_value(quantity, unit, name)
        size, stressed = acceleration(quantity, authority, name)
        stresses.extend([name.rpartition(".")[2]] if stressed else [])
        return size

    values = table.read(DISTURBANCE, value)
    table.close()
    return table.built(Disturbance, values | {"stresses": tuple(sorted(stresses))})


def _box(parent: Table) -> UncertaintyBox | None:
    """Named box, or one with the half-widths of the file."""
    given = parent.name_or_table("uncertainty", "paper")
    if not isinstance(given, Table):
        return parent.built(uncertainty_box, {"name": given})
    values = given.read(WIDTHS, lambda quantity, unit, name: rational(si_value(quantity, unit, name), name))
    given.close()
    return given.built(UncertaintyBox, {"name": "own"} | values)


# ----------------------------------------------------------------------
# A fault as a TOML file with all numbers that a result depends on.


def fault_toml(fault: Fault) -> str:
    """Text of a TOML file that `load_fault` reads as this fault, with every number in SI units."""
    law = type(fault.friction)
    name = law.name if law in friction_laws().values() else f"{law.__module__}:{law.__qualname__}"
    friction = _values(fault.friction, entries_of(law))
    tables: dict[str, Json] = {
        "friction": {"law": name} | {key: value for key, value in friction.items() if key != "healing" or value},
        "task": _values(fault.reference, TASK) | {"sampling_time": f"{fault.sampling_time!r} s"},
        "disturbance": _values(fault.disturbance, DISTURBANCE) | _stresses(fault),
        "uncertainty": _values(fault.box, WIDTHS),
    }
    top: Json = {"name": fault.name, "source": fault.source} | _values(fault, PLANT)
    if fault.poor_fit:
        top["poor_fit"] = fault.poor_fit
    if fault.box == BOXES.get(fault.box.name):
        top["uncertainty"] = fault.box.name
        del tables["uncertainty"]
    lines = []
    for table, entries in {"": top, **tables}.items():
        lines += ["", f"[{table}]"] if table else []
        lines += [f"{key} = {written(value)}" for key, value in entries.items()]
    return "\n".join(lines) + "\n"


def _values(part: object, entries: Mapping[str, FileEntry]) -> Json:
    """Values of those entries that an object has as attributes, quantities with their units."""
    return {
        name: f"{value!r} {entry.unit}" if entry.unit else value
        for name, entry in entries.items()
        if (value := getattr(part, name, None)) is not None
    }


def _stresses(fault: Fault) -> dict[str, str]:
    """Stresses [Pa] of disturbance entries given as a stress: smallest floats that reach the stored acceleration."""
    stresses = {}
    for name in fault.disturbance.stresses:
        size = abs(getattr(fault.disturbance, name))
        stress = nextafter(float_below(rational(size) / fault.exact_authority), 0)
        while acceleration(f"{stress!r} Pa", fault.exact_authority, name)[0] < size:
            stress = nextafter(stress, inf)
        stresses[name] = f"{stress if getattr(fault.disturbance, name) >= 0 else -stress!r} Pa"
    return stresses


def written(value: str | float) -> str:
    """Text or number in TOML."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(float(value))
