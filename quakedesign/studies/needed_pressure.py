"""The pressure that a task needs at equilibrium, and whether a run had it."""

from typing import TYPE_CHECKING

from quakedesign.bounds import Enclosure
from quakedesign.certificates.sectors import equilibrium_pressure
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.rationals import rational

if TYPE_CHECKING:
    from quakedesign.simulation import Trajectory

_MARGIN = 0.01
"""Of the range that is needed: what is closer to zero, or to the range, makes no difference."""


def needed_pressure(fault: Fault, slip: float | None = None) -> Enclosure | None:
    """Pressure [Pa] that holds the nominal fault at rest at references up to a slip [m], the target unless given.

    None for friction with a state, and where no finite range is found.
    """
    if fault.friction.state_names:
        return None
    try:
        return Enclosure.of(
            *equilibrium_pressure(fault, rational(fault.reference.target_slip if slip is None else slip))
        )
    except ParameterError:
        return None


def ways(needed: Enclosure) -> tuple[str, ...]:
    """What a range of pressures takes: ``withdrawal`` below zero, ``injection`` above."""
    margin = _margin(needed)
    taken = {"withdrawal": needed.low < -margin, "injection": needed.high > margin}
    return tuple(way for way, needs in taken.items() if needs)


def need_sentence(needed: Enclosure) -> str:
    """Range of the pressure that a task needs, and what it takes."""
    taken = f"the task needs {' and '.join(ways(needed))} of fluid" if ways(needed) else "the task needs no fluid"
    ends = f"{needed.low.quantity('Pa')} to {needed.high.quantity('Pa')}"
    return f"pressure at equilibrium along the reference {ends} (p < 0 is withdrawal): {taken}"


def pressure_extremes(run: "Trajectory") -> tuple[float, float] | None:
    """Least and largest pressure [Pa] of a run; None without a controller, and for one that diverged."""
    least, largest = run.metrics.min_pressure, run.metrics.max_pressure
    return None if least is None or largest is None else (least, largest)


def shortfall(run: "Trajectory", fault: Fault) -> str | None:
    """Pressure that the reference of a run needs at equilibrium and the run never had; None for a run that tracked."""
    extremes = pressure_extremes(run)
    if run.reference is None or extremes is None or run.outcome.kind == "tracked":
        return None
    needed = needed_pressure(fault, float(run.reference.max()))
    if needed is None:
        return None
    (least, largest), margin = extremes, _margin(needed)
    if least > needed.low + margin:
        end, had = needed.low.quantity("Pa"), f"has no less than {_mega(least)}" if least < 0 else "never withdraws"
    elif largest < needed.high - margin:
        end, had = (
            needed.high.quantity("Pa"),
            "never injects" if largest <= 0 else f"has no more than {_mega(largest)}",
        )
    else:
        return None
    return f"falls short of its task: the reference needs {end} at equilibrium, and this run {had}"


def _mega(pressure: float) -> str:
    return f"{pressure / 1e6:.3g} MPa"


def _margin(needed: Enclosure) -> float:
    return _MARGIN * float(needed.high - needed.low)
