"""Options of runs without control of faults whose friction has a state."""

from dataclasses import asdict, dataclass, is_dataclass
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cyclopts import Group, Parameter

from quakedesign.cli.shared import Seconds
from quakedesign.errors import ParameterError

if TYPE_CHECKING:
    from quakedesign.fault import Fault

_GROUP = Group("Friction with a state (rate-and-state), without a controller")
_TAKEN = {"drift": "loading_rate", "duration": "duration", "plant": "plant", "method": "method"}
_AROUND = ("fault", "state", "out", "force", "json")


@Parameter(name="*", group=_GROUP)
@dataclass(frozen=True, kw_only=True)
class StateOptions:
    """How such a fault starts, and which pressure acts on it; it is loaded at --drift, or the law's reference rate.

    Parameters
    ----------
    pressure
        '5 MPa'; or instants, linear between and a step where one stands twice, as '0 s: 0 MPa, 1 day: 0 MPa, 1 day: 5
        MPa'; or a file FILE.csv with the columns 'time [s]' and 'pressure [Pa]', in any units.
    start
        steady (sliding; unless given), locked (held for --hold) or late (in the cycle: --share).
    hold
        Time for which the far end has been at rest before the run, such as '100 year'.
    share
        Of the time between two events that has passed at the start; 0.9 unless given.
    """

    pressure: str | None = None
    start: str | None = None
    hold: Seconds | None = None
    share: float | None = None

    def given(self) -> dict[str, Any]:
        """Those that are given."""
        from quakedesign.simulation import pressure_course

        told = {name: value for name in ("start", "hold", "share") if (value := getattr(self, name)) is not None}
        return told | ({} if self.pressure is None else {"pressure": pressure_course(self.pressure)})


NO_STATE = StateOptions()


def require_no_state_options(state: StateOptions, fault: "Fault") -> None:
    """Refuse options that friction without a state has no use for."""
    if state != NO_STATE:
        raise ParameterError(
            "pressure, start, hold and share need friction with a state, without a controller. "
            f"Received {fault.friction.name}. Leave them out."
        )


def show_state_run(fault: "Fault", command: Any, options: dict[str, Any]) -> int:
    """Run a fault whose friction has a state as `simulate` was asked to, and print what it comes to."""
    from quakedesign.report.state_runs import state_run_lines
    from quakedesign.studies.state_runs import run_state

    usual = _single({name: option.default for name, option in signature(command).parameters.items()})
    changed = {name: value for name, value in _single(options).items() if value != usual[name]}
    if foreign := [name for name in changed if name not in (*_TAKEN, *_AROUND)]:
        raise ParameterError(
            f"{', '.join(foreign)}: not for friction with a state, which runs without control. Received "
            f"{fault.friction.name}. Leave out what is not among drift, duration, plant, method, pressure and start."
        )
    told = {_TAKEN[name]: value for name, value in changed.items() if name in _TAKEN}
    found = run_state(fault, **told, **options["state"].given())
    if options["out"] is not None:
        found.trajectory.save(Path(options["out"]))
    said = [found.trajectory.name, *(f"  {line}" for line in state_run_lines(found.to_dict()))]
    options["output"].show(found.to_dict(), said)
    return 0


def _single(options: dict[str, Any]) -> dict[str, Any]:
    """Options of all groups but that of the state, by their own names."""
    groups = [name for name, value in options.items() if is_dataclass(value) and name != "state"]
    alone = {name: value for name, value in options.items() if name not in groups}
    return alone | {name: value for group in groups for name, value in asdict(options[group]).items()}
