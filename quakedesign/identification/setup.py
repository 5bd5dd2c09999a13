"""From a record and a law to the experiment that is fitted."""

from dataclasses import MISSING, dataclass, fields
from typing import Any

import numpy as np
import sympy as sp

from quakedesign.errors import RecordError
from quakedesign.fault import FrictionLaw
from quakedesign.identification.experiment import Coordinate, Experiment
from quakedesign.identification.record import Record
from quakedesign.identification.sliding import STIFFNESS, Drive, Sliding
from quakedesign.identification.straight import FAR_OFF, first_rate, scatter
from quakedesign.identification.weakening import START, Drawn, MeasuredSlip

_EFFECTS = {"low": 1e-5, "high": 1.0, "start": (2e-3, 3e-2)}
_SHARES = {"drop": (0.2, 1.5), "residual": (0.3, 1.1)}
_MODERATE = 1e3


@dataclass(frozen=True, kw_only=True)
class Setup:
    """An experiment with the samples that it is about.

    Attributes
    ----------
    experiment : Experiment
    used : ndarray of bool
        Samples of the record that it simulates.
    notes : tuple of str
        What was taken for granted.
    """

    experiment: Experiment
    used: "np.ndarray"
    notes: tuple[str, ...]


def set_up(record: Record, law: type[FrictionLaw], stiffness: float | None) -> Setup:
    """The experiment of a record, by what its law depends on and what was measured.

    Raises
    ------
    RecordError
        When the law is of neither kind, or something is missing.
    """
    if law.state_names:
        return _sliding(record, law, stiffness)
    template = law(**dict.fromkeys(law.quantities(), 1.0))
    slip, rate = sp.symbols("slip rate", positive=True)
    if sp.sympify(template.symbolic().coefficient(slip, rate)).has(rate):
        raise RecordError(
            f"a law that is identified must depend on slip or on a state. Received {law.name}, which depends on the "
            "slip rate alone. Take another."
        )
    return _measured_slip(record, law) if record.slip is not None else _drawn(record, law, stiffness)


def _coordinate(name: str, law: type[FrictionLaw], record: Record, path: float) -> Coordinate:
    """Where one quantity of a law is sought; `path` is how far the block can have slipped [m]."""
    unit = law.quantities()[name].metadata["unit"]
    size = float(np.max(np.abs(record.friction)))
    ends: dict[str, Any]
    if unit == "m":
        ends = {"low": path * 1e-6, "high": path * 10, "start": (path * 1e-3, path * 0.3)}
    elif name in _SHARES:
        spread = size if name == "residual" else float(np.ptp(record.friction[record.friction > size / 3]))
        low, high = _SHARES[name]
        ends = {"low": size * 1e-4, "high": size * 10, "start": (spread * low, spread * high)}
    elif name == "reference_coefficient":
        level = float(np.median(record.friction[: max(len(record.friction) // 20, 1)]))
        ends = {"low": size * 1e-2, "high": size * 10, "start": (level * 0.999, level * 1.001)}
    else:
        ends = _EFFECTS
    return Coordinate(name=name, unit=unit, **ends)


def _sliding(record: Record, law: type[FrictionLaw], stiffness: float | None) -> Setup:
    if record.load_point is None:
        raise RecordError(
            f"{law.name} needs the motion of the load point, which drives the experiment. Received none. Add "
            "load_point_displacement [um] or load_point_rate [um/s]."
        )
    lengths = np.diff(record.time)
    rates = np.diff(record.load_point) / lengths
    first = record.first_rate or first_rate(record.time, record.load_point)
    if not first > 0:
        raise RecordError(
            f"a record for {law.name} must begin in steady sliding. Received a load point that moves at {first:.3g} "
            "m/s. Cut off what is before."
        )
    path = float(np.ptp(record.load_point))
    chosen = _rates(law, rates, first)
    optional = {field.name for field in fields(law) if field.default is not MISSING}  # type: ignore[arg-type]
    names = [name for name in law.quantities() if name not in chosen and name not in optional]
    coordinates = [_coordinate(name, law, record, path) for name in names]
    if stiffness is None:
        coordinates.append(_stiffness(record, path))
    template = law(**dict.fromkeys(names, 1.0), **chosen)
    log_normal = np.log(record.normal)
    drive = Drive(
        lengths=lengths,
        rates=rates,
        growth=np.diff(log_normal) / lengths,
        compliance=np.exp(-(log_normal[1:] + log_normal[:-1]) / 2),
        first_rate=first,
    )
    experiment = Sliding(
        law=template,
        drive=drive,
        normal_unit=record.normal_unit,
        coordinates=tuple(coordinates),
        stiffness=stiffness,
        steps=tuple((length,) for length in lengths.tolist()),
    )
    notes = (f"the record begins in steady sliding at {first:.4g} m/s",)
    return Setup(experiment=experiment, used=np.ones(len(record.time), dtype=bool), notes=notes)


def _rates(law: type[FrictionLaw], rates: "np.ndarray", first: float) -> dict[str, float]:
    """Rates of a law, which are chosen, not fitted: that of the first sliding, and a range around those of the load."""
    fast = max(float(np.max(rates)), first)
    chosen = {
        "reference_rate": float(f"{first:.6g}"),
        "slowest_rate": first / _MODERATE,
        "fastest_rate": fast * _MODERATE,
    }
    return {name: chosen[name] for name in law.quantities() if name in chosen}


def _stiffness(record: Record, path: float) -> Coordinate:
    """Stiffness [as the record's], about that at which the whole friction takes between all and 1e-4 of the path."""
    whole = float(np.max(record.normal) * np.max(np.abs(record.friction))) / path
    return Coordinate(
        name=STIFFNESS,
        unit=record.stiffness_unit,
        low=whole * 1e-2,
        high=whole * 1e6,
        start=(whole, whole * 1e3),
    )


def _measured_slip(record: Record, law: type[FrictionLaw]) -> Setup:
    """Samples after the slip has left the noise about zero for good."""
    assert record.slip is not None
    noise = scatter(record.time, record.slip)
    resting = np.flatnonzero(record.slip <= FAR_OFF * noise)
    used = np.arange(len(record.slip)) > (resting[-1] if len(resting) else -1)
    if used.sum() < 3 * len(law.quantities()):
        raise RecordError(
            f"slip must have grown from zero in at least {3 * len(law.quantities())} samples. Received "
            f"{int(used.sum())}. Measure it from where the fault begins to slip, forward positive."
        )
    slip = record.slip[used]
    coordinates = tuple(_coordinate(name, law, record, float(slip.max())) for name in law.quantities())
    template = law(**dict.fromkeys(law.quantities(), 1.0))
    note = f"friction as a function of the measured slip, in {int(used.sum())} samples that slip"
    return Setup(
        experiment=MeasuredSlip(law=template, slip=slip, slip_noise=noise, coordinates=coordinates),
        used=used,
        notes=(note,),
    )


def _drawn(record: Record, law: type[FrictionLaw], stiffness: float | None) -> Setup:
    if record.load_point is None:
        raise RecordError(
            f"{law.name} needs the column slip, or the motion of the load point. Received neither. Add slip [mm], say."
        )
    path = float(np.ptp(record.load_point))
    coordinates = [_coordinate(name, law, record, path) for name in law.quantities()]
    template = law(**dict.fromkeys(law.quantities(), 1.0))
    if stiffness is None:
        coordinates.append(_stiffness(record, path))
    first, size = float(record.friction[0]), float(np.max(np.abs(record.friction)))
    start = (first - 0.02 * size, first + 0.02 * size)
    coordinates.append(Coordinate(name=START, unit="", low=-size, high=2 * size, start=start, logarithmic=False))
    experiment = Drawn(
        law=template,
        load_point=record.load_point - record.load_point[0],
        normal=record.normal,
        coordinates=tuple(coordinates),
        stiffness=stiffness,
    )
    notes = ("the block sticks at first and has not slipped before", "without inertia")
    return Setup(experiment=experiment, used=np.ones(len(record.time), dtype=bool), notes=notes)
