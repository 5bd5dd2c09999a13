"""An input gain that changes slowly: its range cut into parts, each with a nominal loop of its own."""

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from guarantee_gains import gains, input_gains
from guarantee_loop import Loop
from guarantee_reading import keys, need, number
from guarantee_start import start_gains
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


def all_gains(loop: Loop) -> list[list[list[Fraction]]]:
    """Gains of every input, and of the start where that is not rest."""
    return [*input_gains(loop), *([start_gains(loop)] if loop.start else [])]


def slow_gains(task: Task, loop: Loop, slow: Slow) -> list[list[list[Fraction]]]:
    """Gains of every input, and of one more, the past of what enters as the first, one part after another."""
    width = (task.beta[1] - task.beta[0]) / slow.parts
    count = len(loop.inputs) + bool(loop.start) + 1
    total: list[list[list[Fraction]]] = [[[] for _ in loop.outputs] for _ in range(count)]
    for part in range(slow.parts):
        gain = task.beta[0] + (2 * part + 1) * width / 2
        steady, grown = (with_gain(loop, gain, growth) for growth in (Fraction(0), slow.growth))
        for whole, found in zip(total, [*all_gains(steady), gains(grown, loop.inputs[0], False)], strict=True):
            for line, values in zip(whole, found, strict=True):
                line += values
    return total
