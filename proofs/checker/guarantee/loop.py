"""The error loop of a law: its flow, the events of a period, inputs and outputs, from the matrices of the file."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

from .matrices import unit, zeros
from .reading import Row, keys, matrix, need, number, numbers, row
from .root import Root, read_root
from .task import Task

MAX_STATES, MAX_LAW_STATES, MAX_PERIODS = 20, 12, 8
MODES, PI = 8, Fraction(314159265358979323846, 10**20)  # modes of a diffusion path; PI is below pi by less than SHORT
SHORT = Fraction(1, 10**20)
SHORTEST = 32  # L^2/D of a diffusion path is at least 1/32 of a step
EVEN = [Fraction(i, 8) for i in range(9)]  # ends of pieces of a flow between two events
HALVES = [Fraction(i, 2) for i in range(3)]
BENT = [Fraction(i, 128) for i in (0, 1, 3, 6, 10, 15, 22, 32, 46, 64, 84, 106, 128)]  # the same with a lag or path
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")


@dataclass
class Pulse:
    """Input from `early` before the event with this number until `late` after it.

    Its area before the event, divided by `before`, and its area after it, divided by `after`, add up to at most 1.
    """

    event: int
    early: Fraction
    late: Fraction
    before: Fraction
    after: Fraction


@dataclass
class Fade:
    """At most height*e^(-rate*t) + floor, t after the event with this number."""

    event: int
    height: Fraction
    rate: Fraction
    floor: Fraction

    def weight(self, time: Fraction) -> Fraction:
        """Upper bound after a time: e^x is larger than the first terms of its sum."""
        x = self.rate * time
        return self.height / (1 + x + x**2 / 2 + x**3 / 6 + x**4 / 24) + self.floor


@dataclass
class Loop:
    """Flow x' = Ax, then events (map, time until the next one; none in continuous time), inputs, the implicit step.

    The first two inputs flow; those of the implicit step and of the noise, if there are any, enter with the first
    event. If the reference itself is an input of the law (`referred`), two more come before these: one that flows, and
    one that enters with the first event, both bounded by the rate of the reference. `noise` bounds the measurement
    errors of e1 and e2, an input each where it is not 0. Without events there may be two inputs more, the second and
    third derivatives of the reference.
    With a diffusion path, L^2/D = `layer`, a fourth output bounds the truncation error of its modes; where `fade` is
    given, that is one more input, the last one. Where `asked`, the last output, or the last but one if `stepped`, is
    the pressure at the valve. `start` has the columns of the box of initial conditions, none at rest. `pump` has its
    limits as the file states them. Where the last step of the valve is bounded it is the last output, `stepped`, and
    `pulse` says when it may occur. `off` is the jitter of measurements plus half their averaging time, and `told` lists
    those of e1 and e2 that have an input for jitter or noise. With aperiodic sampling each interval is `step` to
    `longest`; else `longest` is 0.
    """

    flow: list[Row]
    events: list[tuple[list[Row], Fraction]]
    outputs: list[Row]
    inputs: list[Row]
    root: Root | None
    step: Fraction
    noise: tuple[Fraction, Fraction] = (Fraction(0), Fraction(0))
    cuts: Sequence[Fraction] = field(default_factory=lambda: EVEN)
    past_cuts: Sequence[Fraction] = field(default_factory=lambda: EVEN)
    fade: Fade | None = None
    layer: Fraction = Fraction(0)
    start: list[Row] = field(default_factory=list)
    asked: bool = False
    pump: dict[str, Fraction] = field(default_factory=dict)
    stepped: bool = False
    pulse: Pulse | None = None
    off: Fraction = Fraction(0)
    told: list[int] = field(default_factory=list)
    longest: Fraction = Fraction(0)
    referred: bool = False


@dataclass
class Held:
    """A sampled law as a file states it, and the places of the pressure's states in its loop."""

    step: Fraction
    delay: Fraction
    lag: Fraction
    diffusion: Fraction  # 0 without a diffusion path
    update: list[Row]
    measured: list[Row]
    output: Row
    feedback: Row
    root: Root | None
    noise: tuple[Fraction, Fraction]
    first: list[Row]  # states of the law at its first sample, by initial slip and slip rate
    jitter: Row  # of measurements, of pressures in addition, and averaging time of a measurement
    pump: dict[str, Fraction]
    longest: Fraction  # longest sampling interval; 0 if periodic
    referred: list[Row]  # gains of reference and its rate on the law's states and, last, on the pressure

    def __post_init__(self) -> None:
        whole, self.part = self.delay // self.step, self.delay % self.step  # arrival after a sample
        self.own = len(self.update)
        self.waiting = int(whole) + (self.part > 0)
        self.valve = 2 + self.own + self.waiting
        layered = self.diffusion > 0
        self.off = self.jitter[0] + self.jitter[2] / 2
        self.watched = any(self.jitter) or "rate" in self.pump
        self.well, self.stepped = self.valve + 1, self.watched or (layered and self.lag == 0)
        self.path = range(self.well, self.well + (self.lag > 0) + MODES * layered)
        self.modes = self.path[self.lag > 0 :]
        self.fed = self.measured, self.feedback
        self.size = self.well + len(self.path) + self.stepped


def read_loop(value: Any, task: Task, errors: Sequence[Fraction] = (Fraction(0), Fraction(0))) -> Loop:
    """Build the error loop: e1, e2, the law's states, pressures on their way, valve, and states behind it.

    These are: with a lag, the well's pressure minus the valve's; modes of a diffusion path, minus the well's.
    With jitter, a pump rate, or a diffusion path without a lag, the last state is the last step of the valve. `errors`:
    initial e1, e2.
    """
    if type(value) is dict and "rates" in value:
        need(not any(errors), "a law in continuous time must start at rest")
        return read_continuous(value, task)
    law = read_held(value)
    flow, push = flow_of(law, task)
    sample, arrival = maps_of(law, task.b)
    size, root, step = law.size, law.root, law.step
    slope = sum(root.slopes) / (2 * step) if root else Fraction(0)
    events = [([[line[0] - slope * line[size], *line[1:size]] for line in sample], law.part or step)]
    events += [(arrival, step - law.part)] if law.part else []
    inputs = [unit(size)[1], drift_of(law, task.b), *([[line[size] for line in sample]] if root else [])]
    told = [[line[k] - (i == k) for i, line in enumerate(events[0][0])] for k in (0, 1)]  # of measurement errors
    heard = [k for k in (0, 1) if law.noise[k] or (law.off and (k == 0 or root or uses_rate(*law.fed)))]
    inputs += [reference_of(law), [line[-1] for line in sample]] if law.referred else []
    inputs += [told[k] for k in heard]
    outputs = [unit(size)[0], unit(size)[1], push]
    cuts = BENT if law.lag else EVEN
    loop = Loop(flow, events, outputs, inputs, root, step, law.noise, cuts, start=starts_of(law, errors), pump=law.pump)
    loop = with_left_out(loop, law) if law.diffusion else loop
    loop = replace(loop, outputs=[*loop.outputs, unit(size)[law.valve]], asked=True) if law.path else loop
    loop = replace(loop, off=law.off, told=heard, longest=law.longest, referred=bool(law.referred))
    plain = not (law.delay or law.path or law.watched or root or any(errors) or any(map(any, law.first)))
    need(
        plain or not law.longest, "aperiodic sampling must have a linear law from rest, without delay, path and jitter"
    )
    if not law.watched:
        return loop
    return replace(loop, outputs=[*loop.outputs, unit(size)[-1]], stepped=True, pulse=pulse_of(law))


def read_held(value: Any) -> Held:
    """Read step, delay, lag and diffusion, the law's matrices, the implicit step, the noise and the pump."""
    optional = ("root", "noise", "diffusion", "first", "jitter", "pump", "applied", "longest", "of_reference")
    more = [k for k in optional if type(value) is dict and k in value]
    named = ("step", "delay", "lag", "states", "update", "measured", "output", "feedback")
    given = keys(value, "loop", *named, *more)
    implicit = "root" in more
    root = read_root(given["root"]) if implicit else None
    step, delay, lag = (number(given[k], k) for k in ("step", "delay", "lag"))
    need(step > 0 and 0 <= delay <= MAX_PERIODS * step and lag >= 0, "step must be > 0, delay 0 to 8 steps, lag >= 0")
    n = count_states(given["states"])
    update, seen = matrix(given["update"], "update", n, n), matrix(given["measured"], "measured", n, 2 + implicit)
    output, feedback = row(given["output"], "output", n), row(given["feedback"], "feedback", 2 + implicit)
    noise = read_noise(given["noise"]) if "noise" in more else (Fraction(0), Fraction(0))
    need(implicit or not noise[1] or uses_rate(seen, feedback), "noise of the slip rate needs a law that measures it")
    time = number(given.get("diffusion", "0"), "diffusion")
    need("diffusion" not in more or SHORTEST * time >= step, "diffusion must be at least 1/32 of step")
    first = matrix(given["first"], "first", n, 2) if "first" in more else [[Fraction(0)] * 2] * n
    if "applied" in more:  # limits that are never reached: read, and no part of the proof
        row(given["applied"], "applied", n)
    jitter = read_jitter(given["jitter"]) if "jitter" in more else [Fraction(0)] * 3
    pump = read_pump(given["pump"]) if "pump" in more else {}
    longest = number(given["longest"], "longest") if "longest" in more else Fraction(0)
    need("longest" not in more or longest > step, "the longest interval must be longer than step")
    referred = matrix(given["of_reference"], "of_reference", n + 1, 2) if "of_reference" in more else []
    need("of_reference" not in more or any(map(any, referred)), "of_reference must not be zero if given")
    need(not (referred and (time or longest or root)), "of_reference must be given without diffusion, root and longest")
    parts = (step, delay, lag, time, update, seen, output, feedback, root, noise, first, jitter, pump, longest)
    law = Held(*parts, referred)
    need(not (law.watched and time), "jitter and a pump rate must not be given with diffusion")
    need(law.size <= MAX_STATES, f"the loop must have at most {MAX_STATES} states")
    return law


def read_jitter(value: Any) -> Row:
    """Read the jitter of measurements, of pressures in addition, and the averaging time."""
    mean = ("mean",) if type(value) is dict and "mean" in value else ()
    found = [*numbers(value, "jitter", "measured", "delay", *mean).values()]
    need(min(found) >= 0 and any(found), "jitter must be >= 0, and not all 0")
    need(not mean or found[2] > 0, "mean must be > 0 if given")
    return found if mean else [*found, Fraction(0)]


def read_pump(value: Any) -> dict[str, Fraction]:
    """Read limits of the pressure, and of its rate with the time in which the commanded value is reached."""
    paced = type(value) is dict and "rate" in value
    limited = not paced or not set(value) <= {"rate", "ramp"}
    found = numbers(value, "pump", *(("least", "largest") if limited else ()), *(("rate", "ramp") if paced else ()))
    if limited:
        low, high = found["least"], found["largest"]
        need(low <= 0 <= high and low != high, "the range of a pump must contain 0 and have different ends")
    need(not paced or min(found["rate"], found["ramp"]) > 0, "rate and ramp of a pump must be > 0")
    return found


def pulse_of(law: Held) -> Pulse | None:
    """When the valve's pressure may differ from the scheduled one; refused if that reaches another sample."""
    off, ramp, before = sum(law.jitter[:2]), law.pump.get("ramp", Fraction(0)), law.part or law.step
    after = law.step - law.part
    apart = off <= before and off + ramp <= after and 2 * off + ramp <= law.step and 2 * law.off <= law.step
    need(apart, "every pressure must change between two samples only, and samples must keep their order")
    return Pulse(int(law.part > 0), off, off + ramp, off, off + ramp / 2) if off or ramp else None


def flow_of(law: Held, task: Task) -> tuple[list[Row], Row]:
    """The flow between events, and the fault's pressure as a row over the states."""
    push = [Fraction(i == law.valve or (i == law.well and law.lag > 0)) for i in range(law.size)]  # modes follow
    flow = zeros(law.size)
    flow[0][1] = Fraction(1)
    if law.lag > 0:
        flow[law.well][law.well] = -1 / law.lag
    for k, mode in enumerate(law.modes):
        push[mode], flow[mode][mode] = mode_share(k), -mode_rate(k, law.diffusion)
        if law.lag > 0:
            flow[mode][law.well] = 1 / law.lag
    flow[1] = [sum(task.beta) / 2 * v for v in push]
    flow[1][0], flow[1][1] = sum(task.s) / 2, -sum(task.w) / 2
    return flow, push


def maps_of(law: Held, b: Fraction) -> tuple[list[Row], list[Row]]:
    """The sample, with columns for w and the reference's rate, and the arrival of a pressure, if between samples."""
    n, size, valve = law.own, law.size, law.valve
    rest = [Fraction(0)] * (size - 2 - n)  # behind it the columns of w and of the reference's rate
    *moved, pressed = [line[1] for line in law.referred] or [Fraction(0)] * (n + 1)
    asked = [*(b * v for v in (*law.feedback[:2], *law.output)), *rest, b * sum(law.feedback[2:]), b * pressed]
    sample = [[*line, Fraction(0), Fraction(0)] for line in unit(size)]
    for i, (seen, kept) in enumerate(zip(law.measured, law.update, strict=True)):
        sample[2 + i] = [*seen[:2], *kept, *rest, Fraction(sum(seen[2:])), moved[i]]
    queue = [*range(2 + n, valve), *([] if law.part else [valve])]
    for i, place in enumerate(queue):
        sample[place] = [*unit(size)[queue[i - 1]], Fraction(0), Fraction(0)] if i else asked
    arrival = unit(size)
    arrival[valve] = unit(size)[valve - 1]
    last = arrival if law.part else sample
    change = [v - (i == valve) for i, v in enumerate(last[valve])]
    for i in law.path[:1] if law.lag > 0 else law.path:  # pressures behind the valve do not jump with it
        last[i] = [v - c for v, c in zip(last[i], change, strict=True)]
    if law.stepped:
        last[-1] = change
    return sample, arrival


def drift_of(law: Held, b: Fraction) -> Row:
    """Effect of a change of the steady pressure on the states, measured from those that command it."""
    still = [[v - (i == j) for j, v in enumerate(line)] for i, line in enumerate(law.update)]
    steady = steady_states(still, law.output, [Fraction(0)] * law.own, Fraction(1))
    behind = [Fraction(0)] * (law.size - law.well)
    return [Fraction(0), Fraction(0), *(-v / b for v in steady), *[Fraction(-1)] * (law.waiting + 1), *behind]


def reference_of(law: Held) -> Row:
    """Effect of a change of the reference on the states, measured from those that command p* there."""
    still = [[v - (i == j) for j, v in enumerate(line)] for i, line in enumerate(law.update)]
    *rates, pressed = [-line[0] for line in law.referred]
    moved = steady_states(still, law.output, rates, pressed)
    return [Fraction(0), Fraction(0), *(-v for v in moved), *[Fraction(0)] * (law.size - 2 - law.own)]


def starts_of(law: Held, errors: Sequence[Fraction]) -> list[Row]:
    """Columns of the box of initial conditions: both errors with the law's states for them, and those for the noise."""
    found = []
    for k in (0, 1):
        made = [line[k] for line in law.first] + [Fraction(0)] * (law.size - 2 - law.own)
        found.append([errors[k] * v for v in [*unit(2)[k], *made]])
        found.append([law.noise[k] * v for v in [Fraction(0), Fraction(0), *made]])
    return [column for column in found if any(column)]


def with_left_out(loop: Loop, law: Held) -> Loop:
    """The loop with a bound of the truncation error of the modes: by the rate of the well, or after its steps."""
    size, time, high = law.size, law.diffusion, abs(mode_share(MODES))
    rate, floor = mode_rate(MODES, time), 6 * MODES * SHORT
    cut = replace(loop, cuts=BENT, past_cuts=HALVES, layer=time)
    if law.lag > 0:
        left = (high / rate + floor * time) / law.lag
        return replace(cut, outputs=[*loop.outputs, [left * v for v in unit(size)[law.well]]])
    height, floor = high * (1 + 1 / (rate * law.step)), floor * (1 + time / law.step)
    most = height + floor
    fade = Fade(int(law.part > 0), height / most, rate, floor / most)
    outputs, inputs = [*loop.outputs, [most * v for v in unit(size)[-1]]], [*loop.inputs, unit(size)[1]]
    return replace(cut, outputs=outputs, inputs=inputs, fade=fade)


def read_noise(value: Any) -> tuple[Fraction, Fraction]:
    """Bounds of the measurement errors of slip and slip rate."""
    slip, rate = numbers(value, "noise", "slip", "rate").values()
    need(slip >= 0 and rate >= 0, "bounds of the noise must be >= 0")
    return slip, rate


def uses_rate(measured: list[Row], feedback: Row) -> bool:
    """Whether a law without an implicit step uses the slip rate."""
    return any(line[1] for line in (*measured, feedback))


def mode_rate(number: int, time: Fraction) -> Fraction:
    """Decay rate of a mode of a diffusion path, from below, for L^2/D = time."""
    return ((2 * number + 1) * PI / 2) ** 2 / time


def mode_share(number: int) -> Fraction:
    """Share of a mode of a diffusion path in a step, its size from above."""
    return (-1) ** number * 4 / ((2 * number + 1) * PI)


def read_continuous(value: Any, task: Task) -> Loop:
    """Build the error loop of a law in continuous time: e1, e2 and the law's states."""
    parts = ("states", "rates", "measured", "output", "feedback")
    given = keys(value, "loop", *parts, *(["of_reference"] if "of_reference" in value else []))
    n = count_states(given["states"])
    rates, seen = matrix(given["rates"], "rates", n, n), matrix(given["measured"], "measured", n, 2)
    output, feedback = row(given["output"], "output", n), row(given["feedback"], "feedback", 2)
    push = [task.b * v for v in (*feedback, *output)]
    middles = [sum(task.s) / 2, -sum(task.w) / 2] + [Fraction(0)] * n
    flow = [unit(2 + n)[1]]
    flow.append([v + sum(task.beta) / 2 * p for v, p in zip(middles, push, strict=True)])
    flow += [[*fed, *kept] for fed, kept in zip(seen, rates, strict=True)]
    steady = steady_states(rates, output, [Fraction(0)] * n, Fraction(1))
    inputs = [unit(2 + n)[1], [Fraction(0)] * 2 + [-v / task.b for v in steady]]
    forward = row(given.get("of_reference", ["0", "0"]), "of_reference", 2)
    if any(forward):
        need(task.smooth, "the reference must start and end without acceleration for this law")
        moving = steady_states(rates, output, steady, Fraction(0))
        inputs += [[Fraction(0)] * 2 + [k * v for v in moving] for k in forward]
    return Loop(flow, [], [unit(2 + n)[0], unit(2 + n)[1], push], inputs, None, Fraction(0))


def count_states(names: Any) -> int:
    """Number of a law's states, after checking their names."""
    sound = type(names) is list and len(names) <= MAX_LAW_STATES and all(type(v) is str for v in names)
    need(
        sound and all(NAME.fullmatch(v) for v in names) and len(set(names)) == len(names), "states must be unique names"
    )
    return len(names)


def steady_states(own: list[Row], output: Row, rates: Row, asked: Fraction) -> Row:
    """Some z with Mz = rates and Cz = asked, by elimination."""
    n = len(output)
    table = [[*line, rate] for line, rate in zip(own, rates, strict=True)]
    table.append([*output, asked])
    found = [Fraction(0)] * n
    pivots: list[tuple[int, Row]] = []
    for column in range(n):
        chosen = next((line for line in table if line[column]), None)
        if chosen is None:
            continue
        chosen = [v / chosen[column] for v in chosen]
        table = [[a - line[column] * c for a, c in zip(line, chosen, strict=True)] for line in table]
        pivots.append((column, chosen))
    need(not any(line[n] for line in table), "the law must be able to command any constant pressure at zero errors")
    for column, line in reversed(pivots):
        found[column] = line[n] - sum(v * f for v, f in zip(line, found, strict=False))
    return found
