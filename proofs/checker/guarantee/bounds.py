"""The theorem: bounds of the errors and of the pressure if the small gain is below 1; beta may vary slowly."""

from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain
from math import ceil
from typing import Any

from .gains import gains, loop_gains, without_area
from .loop import Loop
from .matrices import BITS
from .reading import Refused, Row, keys, need, number, upper
from .task import Task

MAX_PARTS = 16  # of the range of a slowly varying input gain


@dataclass
class Slow:
    """Number of parts of the range of beta; an input t ago has the weight e^(growth*t)."""

    parts: int
    growth: Fraction


def read_slow(value: Any, task: Task, loop: Loop) -> Slow:
    """Read the use of a slowly varying beta: friction of the slip alone, and a sampled law."""
    given = keys(value, "slow_gain", "parts", "growth")
    parts, growth = given["parts"], number(given["growth"], "growth")
    need(type(parts) is int and 1 <= parts <= MAX_PARTS and growth > 0, "slow_gain needs 1 to 16 parts, growth > 0")
    need(task.steady_beta and bool(loop.events), "slow_gain needs friction of the slip alone and a sampled law")
    return Slow(parts, growth)


def with_gain(loop: Loop, gain: Fraction, growth: Fraction) -> Loop:
    """The loop with another nominal beta, its responses at time t multiplied by e^(growth*t)."""
    flow = [[v + growth * (i == j) for j, v in enumerate(line)] for i, line in enumerate(loop.flow)]
    flow[1] = [*flow[1][:2], *(gain * v for v in loop.outputs[2][2:])]
    return replace(loop, flow=flow)


def slow_gains(task: Task, loop: Loop, slow: Slow) -> list[list[list[Fraction]]]:
    """Gains of every input, and of one more, the first with weights e^(growth*t), one part after another."""
    width = (task.beta[1] - task.beta[0]) / slow.parts
    parts = []
    for part in range(slow.parts):
        gain = task.beta[0] + (2 * part + 1) * width / 2
        steady, grown = (with_gain(loop, gain, growth) for growth in (Fraction(0), slow.growth))
        grown = without_area(grown, gain)[0] if loop.layer else grown
        parts.append([*loop_gains(steady, gain), gains(grown, loop.inputs[0], False)])
    return [[list(chain(*lines)) for lines in zip(*of, strict=True)] for of in zip(*parts, strict=True)]


ONE_OVER_E = Fraction(3679, 10000)  # from above


def bounds(task: Task, loop: Loop, slow: Slow | None = None, slip: Fraction = Fraction(0)) -> tuple[Row, Fraction]:
    """Bounds of |e1|, |e2| and b|p − p*|, and the small gain (FORMAT.md, A guarantee); the best of both classes.

    Where the valve's pressure is not the fault's, its b|p − p*| is a fourth; where its last step is bounded, b times
    that is the last.
    With a slowly varying input gain they hold while the slip error stays below `slip`.
    """
    spread = None
    if slow:
        off = (task.beta[1] - task.beta[0]) / (2 * slow.parts) + 2 * task.slope_of_beta * slip
        spread = off, task.slope_of_beta * task.reference_rate * ONE_OVER_E / slow.growth
    found = slow_gains(task, loop, slow) if slow else loop_gains(loop, sum(task.beta) / 2)
    proved, refusals = [], []
    for one in [task] if task.change is None else [task, replace(task, change=None)]:
        try:
            proved.append(of_class(one, loop, found, spread))
        except Refused as refusal:
            refusals.append(refusal)
    if not proved:
        raise refusals[0]
    return [min(values) for values in zip(*(peaks for peaks, _ in proved), strict=True)], min(m for _, m in proved)


def of_class(
    task: Task, loop: Loop, found: list[list[list[Fraction]]], spread: tuple[Fraction, Fraction] | None = None
) -> tuple[Row, Fraction]:
    """The same for one class of disturbances, from the gains of every input.

    `spread`: deviation of a slowly varying beta from that of the nominal loop, now and in the past.
    """
    pushes = len(loop.outputs) - loop.asked - loop.stepped  # outputs before it are errors and pressures on the fault
    half = [(high - low) / 2 for low, high in (task.s, task.w, task.beta)]
    force, drift, coupling, shifted = inputs(task, half[2])
    half[2] = spread[0] if spread else half[2]
    none = [Fraction(0)] * len(loop.outputs)
    own, shares = [force, drift], [[*half, *none[3:]], [none[0], coupling, *none[2:]]]
    if loop.root:
        low, high = loop.root.slopes
        wide = (high - low) / 2 / loop.step
        own.append(loop.root.remainder + wide * (loop.noise[0] + loop.off * task.reference_rate))
        shares.append([wide, *none[1:]])
    if loop.referred:
        own += [task.reference_rate] * 2
        shares += [none] * 2
    for k in loop.told:
        own.append(loop.noise[k] + loop.off * (task.reference_acceleration + force if k else task.reference_rate))
        moves = [max(map(abs, ends)) for ends in (task.s, task.w, task.beta)] if k else [Fraction(0), Fraction(1)]
        shares.append([*(loop.off * v for v in moves), *none[len(moves) :]])
    if not loop.events and len(loop.inputs) == 4:
        own += [task.reference_acceleration, task.reference_jerk]
        shares += [none] * 2
    if loop.layer:  # the fourth output bounds the truncation error
        if loop.fade:
            shares.append([*none])
        shares[-1 if loop.fade else 0][3] = half[2]  # it acts as b(p - p*) does, in the small gain
        shares += [[*none[:3], Fraction(1), *none[4:]]] * 2  # b*Y, and its measurement
        own += [Fraction(0)] * (len(shares) - len(own))
    if loop.pulse:
        own.append(Fraction(0))
        shares.append([*none[1:], Fraction(1)])
    if loop.start:
        own.append(Fraction(1))
        shares.append(none)
    if spread:
        own.append(Fraction(0))
        shares.append([spread[1] if 2 <= i < pushes else Fraction(0) for i in range(len(none))])
    peaks, small = peaks_of(found, own, shares)
    last = len(peaks) - loop.stepped
    asked = [v + shifted for v in peaks[pushes:last]]
    return [peaks[0], peaks[1], sum(peaks[2:pushes]) + shifted, *asked, *peaks[last:]], small


def peaks_of(found: list[list[list[Fraction]]], own: Row, shares: list[Row]) -> tuple[Row, Fraction]:
    """Bounds of the outputs, and the small gain, from gains by input, output and piece, and bounds of the inputs."""
    table = [
        [max(sum(c * g for c, g in zip(share, at, strict=True)) for at in zip(*of, strict=True)) for of in found]
        for share in shares
    ]
    small = radius(table)
    need(small < 1, f"the small gain must be below 1. It is {upper(small)}")
    sizes = solve(table, own)
    peaks = [
        max(sum(g * v for g, v in zip(at, sizes, strict=True)) for at in zip(*of, strict=True))
        for of in zip(*found, strict=True)
    ]
    return peaks, small


def solve(table: list[Row], own: Row) -> Row:
    """(1 − M)^-1 F by elimination: M >= 0 has all pivots positive if, and only if, its spectral radius is below 1."""
    lines = [
        [*((i == j) - v for j, v in enumerate(line)), bound]
        for i, (line, bound) in enumerate(zip(table, own, strict=True))
    ]
    for i, line in enumerate(lines):
        need(line[i] > 0, "the small gain must be below 1")
        line[:] = [v / line[i] for v in line]
        for other in lines:
            if other is not line:
                other[:] = [v - other[i] * p for v, p in zip(other, line, strict=True)]
    return [line[-1] for line in lines]


def radius(table: list[Row]) -> Fraction:
    """Upper bound of the spectral radius of M >= 0, by halving: it is below v where M/v passes `solve`.

    M is rounded up first: it is solved many times.
    """
    table = [[Fraction(ceil(v * (1 << BITS)), 1 << BITS) for v in line] for line in table]
    low, high = Fraction(0), max(sum(line) for line in table) + 1
    for _ in range(48):
        middle = (low + high) / 2
        try:
            solve([[v / middle for v in line] for line in table], [Fraction(0)] * len(table))
        except Refused:
            low = middle
        else:
            high = middle
    return high


def inputs(task: Task, half_beta: Fraction) -> tuple[Fraction, Fraction, Fraction, Fraction]:
    """Bounds of the force and the drift, the coupling from e2 to the drift, and the shift of b(p - p*)."""
    if task.change is None:
        return task.reference_force + task.amplitude, task.drift, Fraction(0), Fraction(0)
    if not task.steady_beta:
        middle = sum(task.beta) / 2
        left = task.amplitude * half_beta / middle
        return task.reference_force + left, task.drift + task.change / middle, Fraction(0), task.amplitude / middle
    coupling = task.amplitude * task.slope_of_beta
    return task.reference_force, task.drift + task.change + coupling * task.reference_rate, coupling, task.amplitude
