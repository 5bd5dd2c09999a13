"""An input gain that changes slowly: its range cut into parts, each with a nominal loop of its own."""

from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain
from typing import Any

from guarantee_gains import gains
from guarantee_layer import loop_gains, without_area
from guarantee_loop import Loop
from guarantee_reading import keys, need, number
from guarantee_task import Task

MAX_PARTS = 16  # of the range of a slow input gain


@dataclass
class Slow:
    """Cut the range of beta into so many parts; what is past counts e^(growth*t) times, t ago."""

    parts: int
    growth: Fraction


def read_slow(value: Any, task: Task, loop: Loop) -> Slow:
    """Read how the slow change of beta is used: friction of the slip alone, and a law of samples."""
    given = keys(value, "slow_gain", "parts", "growth")
    parts, growth = given["parts"], number(given["growth"], "growth")
    need(type(parts) is int and 1 <= parts <= MAX_PARTS and growth > 0, "slow_gain needs 1 to 16 parts, growth > 0")
    need(task.steady_beta and bool(loop.events), "slow_gain needs friction of the slip alone and a law of samples")
    return Slow(parts, growth)


def with_gain(loop: Loop, gain: Fraction, growth: Fraction) -> Loop:
    """The loop with another nominal beta, its responses e^(growth*t) as large after t."""
    flow = [[v + growth * (i == j) for j, v in enumerate(line)] for i, line in enumerate(loop.flow)]
    flow[1] = [*flow[1][:2], *(gain * v for v in loop.outputs[2][2:])]
    return replace(loop, flow=flow)


def slow_gains(task: Task, loop: Loop, slow: Slow) -> list[list[list[Fraction]]]:
    """Gains of every input, and of one more, the past of what enters as the first, one part after another."""
    width = (task.beta[1] - task.beta[0]) / slow.parts
    parts = []
    for part in range(slow.parts):
        gain = task.beta[0] + (2 * part + 1) * width / 2
        steady, grown = (with_gain(loop, gain, growth) for growth in (Fraction(0), slow.growth))
        grown = without_area(grown, gain)[0] if loop.layer else grown
        parts.append([*loop_gains(steady, gain), gains(grown, loop.inputs[0], False)])
    return [[list(chain(*lines)) for lines in zip(*of, strict=True)] for of in zip(*parts, strict=True)]
