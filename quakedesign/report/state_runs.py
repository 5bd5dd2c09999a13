"""What is said of a run of a fault whose friction has a state, free or held in slow sliding."""

from typing import TYPE_CHECKING, Any

from quakedesign.controllers import control_laws
from quakedesign.text import lasting

if TYPE_CHECKING:
    from quakedesign.studies.comparison import Compared
    from quakedesign.studies.state_runs import StateRun

_MOST_EVENTS = 8
_LOCKED = 0.5  # of what it is loaded by: a fault that slips less stores the rest
FASTEST_PLATE = 1e-8
"""Rate of loading [m/s] that no plate has: 0.3 m a year."""
_LABORATORY = 10.0  # length of a fault [m] below which what loads it is a machine


def state_run_lines(answer: dict[str, Any]) -> list[str]:
    """Lines for people, from `StateRun.to_dict`: outcome, cycle, events."""
    outcome, cycle, events = answer["outcome"], answer["cycle"], answer["slip_events"]
    least, largest = (p / 1e6 for p in answer["pressure"])
    state = ", ".join(f"{name} = {value:.4g} s" for name, value in answer["start"]["state"].items())
    lines = [
        f"{outcome['kind']}: peak slip rate {outcome['peak_slip_rate']:.3g} m/s (an earthquake from "
        f"{outcome['earthquake_from']:.3g} m/s on), {len(events)} events in {lasting(answer['duration'])}, "
        f"slip {answer['slip']:.4g} m",
        f"loaded at {answer['loading_rate']:.4g} m/s; starts at {answer['start']['slip_rate']:.4g} m/s with {state}",
        f"pressure from {least:.3g} MPa to {largest:.3g} MPa",
    ]
    if answer["resting"]:
        lines.append("steady sliding is unstable here, but nothing disturbs it: start late, or give a pressure")
    if outcome["kind"] == "creep" and answer["slip"] < _LOCKED * answer["loading_rate"] * answer["duration"]:
        lines.append(
            "it does not creep for good: it slips far less than it is loaded, and the run ends before what is stored "
            "goes; the recurrence interval that design tells, or a longer --duration, shows the event"
        )
    if cycle["recurrence_interval"] is not None:
        lines.append(f"recurrence interval {lasting(cycle['recurrence_interval'])}")
    if cycle["slip"] is not None:
        lines.append(f"slip of an event {cycle['slip']:.4g} m, magnitude {cycle['magnitude']:.2f}")
    lines += [_event_line(number, event) for number, event in enumerate(events[:_MOST_EVENTS], start=1)]
    if len(events) > _MOST_EVENTS:
        lines.append(f"and {len(events) - _MOST_EVENTS} events more (--json has them all)")
    lines.append(f"energy that the integration loses: {answer['energy']['relative_residual']:.2g} of the largest share")
    return lines


def cycle_sentence(run: "StateRun") -> str:
    """What a fault whose friction has a state does without control, with its last complete event."""
    if run.failed:
        return f"Without control: unknown, since its cycle could not be computed ({run.failed.rstrip('.')})"
    cycle, peak = run.cycle, f"slip rate up to {run.outcome.peak_slip_rate:.3g} m/s"
    if not run.slip_events:
        return f"Without control: the fault creeps, {peak}"
    size = "" if cycle["magnitude"] is None else f" of magnitude {cycle['magnitude']:.2f}"
    again = "" if cycle["recurrence_interval"] is None else f" every {lasting(cycle['recurrence_interval'])}"
    return f"Without control: {run.outcome.kind}{size}{again}, {peak}, {_loading(run)}"


def _loading(run: "StateRun") -> str:
    """The rate of loading of a cycle, its plant, and that the rate may be one that nobody has chosen."""
    moved = "with inertia" if run.provenance["plant"] == "smooth" else "quasi-dynamic"
    loaded = f"loaded at {run.loading_rate:.3g} m/s ({moved})"
    if run.loading_rate <= FASTEST_PLATE or run.fault.length < _LABORATORY:
        return loaded
    return (
        f"{loaded}, FASTER than any plate: that is reference_rate of [friction]; for how often it breaks put in the "
        "rate of the plates there, such as '1 nm/s' (30 mm a year)"
    )


def left_out_lines(comparison: "Compared") -> list[str]:
    """Laws that are not for this fault, each reason once."""
    named: dict[str, list[str]] = {}
    for name, why in comparison.left_out.items():
        named.setdefault(why, []).append(control_laws()[name].title)
    return [f"Not designed, {', '.join(titles)}: {why}" for why, titles in named.items()]


def proved_line(sentence: str | None, outside: list[str]) -> str:
    """What is proved of the law of a run, and which options of the run the proof does not know; empty without one."""
    if sentence is None:
        return ""
    return f"NOT proved of this run, by {', '.join(outside)}; without: {sentence}" if outside else f"proved: {sentence}"


def sliding_run_lines(answer: dict[str, Any]) -> list[str]:
    """Lines for people, from `HeldRun.to_dict`: outcome, errors, pressure, and what is proved where that is known."""
    outcome, found = answer["outcome"], answer["metrics"]
    least, largest = (p / 1e6 for p in answer["pressure"])
    path = "".join(f", through a {name.replace('_', ' ')}" for name in answer["stages"])
    path += f", through a lag of {answer['lag']:.4g} s" if answer["lag"] else ""
    path += f", through rock of L^2/D = {answer['diffusion']:.4g} s" if answer["diffusion"] else ""
    shaken = f", under a shear stress of up to {answer['stress'] / 1e3:.4g} kPa" if answer["stress"] else ""
    return [
        f"{outcome['kind']}: peak slip rate {outcome['peak_slip_rate']:.4g} m/s, the reference's is "
        f"{answer['largest_reference_rate']:.4g} m/s (an earthquake from {outcome['earthquake_from']:.3g} m/s on)",
        f"held over {answer['step']:.4g} s{path}{shaken}, for {lasting(answer['duration'])}; without control errors "
        f"grow by {answer['growth_rate']:.3g} 1/s",
        f"|ln(V/V_r)| at most {found['max_log_rate']:.3g}, slip error at most {found['max_slip_error']:.3g} m",
        f"pressure from {least:.3g} MPa to {largest:.3g} MPa; the law asks for at most "
        f"{found['max_asked'] / 1e6:.3g} MPa beside what the reference needs",
        proved_line((answer["guarantee"] or {}).get("sentence"), answer["outside"])
        or "no guarantee: what is said was seen in this run",
    ]


def _event_line(number: int, event: dict[str, Any]) -> str:
    nucleation = "" if event["nucleation"] is None else f"nucleation from {event['nucleation']:.6g} s, "
    arrest = "not over at the end of the run" if event["arrest"] is None else f"arrest {event['arrest']:.6g} s"
    return f"event {number}: {nucleation}onset {event['onset']:.6g} s, {arrest}, peak {event['peak_slip_rate']:.3g} m/s"
