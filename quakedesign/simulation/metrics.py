"""The figures by which controllers are compared, computed from every step of a run."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from typing import Any

_FASTEST = 1e6  # m/s: far above an earthquake, and below what a plant reaches whose motion overflows
EVENTS = ("diverged", "opening", "reverse_slip", "stick")


def _figure(unit: str) -> Any:
    """Field with an SI unit, None unless given."""
    return field(default=None, metadata={"unit": unit})


@dataclass(frozen=True, slots=True, kw_only=True)
class Metrics:
    """Figures of one run; those that do not apply are None, and all of a diverged run but its peak.

    All but `peak_slip_rate`, `max_h_rate` and the two extreme pressures are taken over t > settled_from.

    Attributes
    ----------
    max_slip_error, rms_slip_error : float or None
        Of x1 − r [m].
    max_slip_rate_error, rms_slip_rate_error : float or None
        Of x2 − r' [m/s].
    mise_slip, mise_slip_rate : float or None
        Mean of the squared error [m², m²/s²].
    rms_pressure : float or None
        [Pa].
    pressure_total_variation : float or None
        Sum of |Δp| between successive steps [Pa].
    reverse_slip_fraction : float or None
        Share of the steps with x2 < 0 [-].
    peak_slip_rate : float or None
        Largest |x2| of the whole run [m/s].
    max_h_rate : float or None
        Largest |Δh/Δt| between successive steps of the whole run [unit of ν per s].
    max_pressure, min_pressure : float or None
        Over the whole run [Pa].
    settled_from : float
        [s].
    steps : int
        Steps taken before the end or before divergence.
    seconds : float
        Time that the computation took [s].
    """

    max_slip_error: float | None = _figure("m")
    max_slip_rate_error: float | None = _figure("m/s")
    rms_slip_error: float | None = _figure("m")
    rms_slip_rate_error: float | None = _figure("m/s")
    mise_slip: float | None = _figure("m^2")
    mise_slip_rate: float | None = _figure("m^2/s^2")
    rms_pressure: float | None = _figure("Pa")
    pressure_total_variation: float | None = _figure("Pa")
    reverse_slip_fraction: float | None = _figure("")
    peak_slip_rate: float | None = _figure("m/s")
    max_h_rate: float | None = _figure("m/s^3")
    max_pressure: float | None = _figure("Pa")
    min_pressure: float | None = _figure("Pa")
    settled_from: float = field(metadata={"unit": "s"})
    steps: int
    seconds: float = field(metadata={"unit": "s"})

    def to_dict(self) -> dict[str, Any]:
        """Return the figures by name, as JSON can hold them."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @staticmethod
    def unit(name: str) -> str:
        """SI unit of one figure; empty for a number."""
        return _UNITS[name]


@dataclass(frozen=True, slots=True, kw_only=True)
class StickMetrics(Metrics):
    """Figures of one run of a plant whose friction holds it at rest, given without a controller too.

    Attributes
    ----------
    stick_fraction : float or None
        Share of the steps with x2 = 0 over t > settled_from [-].
    """

    stick_fraction: float | None = _figure("")


@dataclass(frozen=True, slots=True, kw_only=True)
class ActuatorMetrics(StickMetrics):
    """Figures of one run whose pressure reaches the fault through an actuator; extremes of the whole run.

    Attributes
    ----------
    max_well_pressure, min_well_pressure : float or None
        Of the pressure at the well, behind delay, saturation and the like [Pa].
    max_injected_volume, min_injected_volume : float or None
        Of the fluid that the rock holds more than before the start, where a stage stores it [m³].
    max_flow_rate, min_flow_rate : float or None
        Into the well, negative for withdrawal [m³/s].
    """

    max_well_pressure: float | None = _figure("Pa")
    min_well_pressure: float | None = _figure("Pa")
    max_injected_volume: float | None = _figure("m^3")
    min_injected_volume: float | None = _figure("m^3")
    max_flow_rate: float | None = _figure("m^3/s")
    min_flow_rate: float | None = _figure("m^3/s")


_UNITS: dict[str, str] = {each.name: each.metadata.get("unit", "") for each in fields(ActuatorMetrics)}


def events(watched: dict[str, float]) -> dict[str, float]:
    """Time of the first occurrence [s] of everything that happened; what came after divergence means nothing."""
    end = watched["diverged"] if watched["diverged"] >= 0 else math.inf
    return {name: watched[name] for name in EVENTS if 0 <= watched[name] <= end}


def metrics(
    watched: dict[str, float],
    *,
    controlled: bool,
    step: float,
    steps: int,
    settled_from: float,
    seconds: float,
    sticks: bool = False,
    further: Iterable[str] = (),
) -> Metrics:
    """Figures from what the loop accumulated; `step` [s] is the length of one step, `further` are signals beyond p."""
    signals = list(further)
    kind = ActuatorMetrics if signals else StickMetrics if sticks else Metrics
    if watched["diverged"] >= 0:
        peak = watched["peak_slip_rate"]  # of a plant that stays finite where the numbers of its law overflow
        known = {"peak_slip_rate": peak} if peak <= _FASTEST else {}
        return kind(**known, settled_from=settled_from, steps=round(watched["diverged"] / step), seconds=seconds)
    figures = _whole_run(watched, step) | _settled(watched) | _ranges(watched, signals) if controlled else {}
    figures["peak_slip_rate"] = watched["peak_slip_rate"]
    if sticks:
        figures |= _shares(watched)
    finite = {name: value for name, value in figures.items() if math.isfinite(value)}
    return kind(**finite, settled_from=settled_from, steps=steps, seconds=seconds)


def _whole_run(watched: dict[str, float], step: float) -> dict[str, float]:
    return {
        "max_h_rate": watched["max_h_change"] / step,
        "max_pressure": watched["max_pressure"],
        "min_pressure": watched["min_pressure"],
    }


def _ranges(watched: dict[str, float], signals: list[str]) -> dict[str, float]:
    return {name: watched[name] for signal in signals for name in (f"max_{signal}", f"min_{signal}")}


def _shares(watched: dict[str, float]) -> dict[str, float]:
    count = watched["settled_count"]
    counted = {"stick_fraction": "rest_count", "reverse_slip_fraction": "reverse_count"}
    return {name: watched[what] / count for name, what in counted.items()} if count else {}


def _settled(watched: dict[str, float]) -> dict[str, float]:
    count = watched["settled_count"]
    if not count:
        return {}
    means = {name: watched[f"sum_square_{name}"] / count for name in ("slip_error", "slip_rate_error", "pressure")}
    return {
        "max_slip_error": watched["max_slip_error"],
        "max_slip_rate_error": watched["max_slip_rate_error"],
        "rms_slip_error": math.sqrt(means["slip_error"]),
        "rms_slip_rate_error": math.sqrt(means["slip_rate_error"]),
        "mise_slip": means["slip_error"],
        "mise_slip_rate": means["slip_rate_error"],
        "rms_pressure": math.sqrt(means["pressure"]),
        "pressure_total_variation": watched["pressure_variation"],
        "reverse_slip_fraction": watched["reverse_count"] / count,
    }
