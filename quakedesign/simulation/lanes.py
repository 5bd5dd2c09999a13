"""Many vectors stepped at once: C whose innermost loops run over lanes, for the compiler to vectorise."""

import subprocess
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby
from typing import Any

import casadi as ca

from quakedesign.simulation.c_files import c_file
from quakedesign.simulation.instructions import Instruction, called, instructions
from quakedesign.simulation.portable_c import (
    Value,
    called_alone,
    constant,
    declared,
    elementary_c,
    portable_name,
)

LANES = 16
LANE_FLAGS = ("-fno-tree-pre", "-fno-thread-jumps")
"""What lets a compiler choose between values instead of branching; none of it changes a digit."""
_WIDE = {"__AVX512F__": ("-mavx512f", "-mprefer-vector-width=512"), "__AVX2__": ("-mavx2",)}
_LONGEST_QUESTION = 10


@lru_cache(maxsize=4)
def processor_flags(command: tuple[str, ...]) -> tuple[str, ...]:
    """Flags of a compiler for the widest vectors of this processor; none where it cannot tell."""
    question = [*command, "-march=native", "-dM", "-E", "-x", "c", "-"]
    try:
        told = subprocess.run(question, input="", capture_output=True, text=True, timeout=_LONGEST_QUESTION, check=True)
    except (OSError, subprocess.SubprocessError, UnicodeError):
        return ()
    macros = told.stdout.split()
    return next((flags for macro, flags in _WIDE.items() if macro in macros), ())


def lanes_c(step: Any, diverged: int) -> str:
    """C text with ``advance_samples``, which moves vectors that lie side by side on until they diverge.

    Parameters
    ----------
    step : casadi.Function
        One vector in, the next one out.
    diverged : int
        Index of the time of divergence.

    Raises
    ------
    NotPortableError
        For operations that have no text in C here.
    """
    parts = [elementary_c()]
    _add_body(parts, step, "one_step")
    loop = c_file("lanes.c", size=step.size1_in(0), diverged=diverged)
    return c_file("lanes.h", lanes=LANES) + "".join(parts) + loop


def _add_body(parts: list[str], function: Any, name: str) -> None:
    """Function in C that maps the vectors of all lanes in place, after those that it calls."""
    body = _Body(function, name)
    for number, call in body.called.items():
        _add_body(parts, call.function, f"{name}_{number}")
    lines = "\n".join(f"  {line}" for line in body.lines())
    size = function.size1_in(0)
    parts.append(f"\nPORTABLE void {name}(double z[{size}][LANES]) {{\n{lines}\n}}\n")


Place = tuple[int, int]
"""Number of a task, and of its result."""


@dataclass(frozen=True)
class _Task:
    """An instruction, and where its arguments come from."""

    number: int
    work: Instruction
    sources: tuple[Place, ...]

    @property
    def kind(self) -> int:
        """Number of a loop that is over before what must not stand in it: a call, or a function of the C library."""
        return self.number if self.work.operation == ca.OP_CALL else -1 - bool(called_alone(self.work.operation))


def _tasks(work: Iterable[Instruction]) -> list[_Task]:
    """What is done, in order, the results of all at the end."""
    at: dict[int, Place] = {}
    tasks = list[_Task]()
    for number, one in enumerate(work):
        taken = () if one.operation == ca.OP_INPUT else one.taken
        tasks.append(_Task(number, one, tuple(at[place] for place in taken)))
        if one.operation != ca.OP_OUTPUT:
            at |= {place: (number, i) for i, place in enumerate(one.given)}
    return sorted(tasks, key=lambda task: task.work.operation == ca.OP_OUTPUT)


class _Body:
    """The work of a function as loops over lanes: one, but for what must not stand in a loop with others."""

    def __init__(self, function: Any, name: str) -> None:
        self._name = name
        self.tasks = _tasks(instructions(function))
        calls = (task for task in self.tasks if task.work.operation == ca.OP_CALL)
        self.called = {task.number: called(function, task.work) for task in calls}
        self._loops = [list(tasks) for _, tasks in groupby(self.tasks, key=lambda task: task.kind)]
        self._by_number = {task.number: task for task in self.tasks}
        loop_of = {task.number: i for i, tasks in enumerate(self._loops) for task in tasks}
        used = {(place, task.number) for task in self.tasks for place in task.sources}
        crossing = {place for place, user in used if loop_of[place[0]] != loop_of[user] and not self._at_hand(place)}
        self._kept = {place: f"kept[{i}][lane]" for i, place in enumerate(sorted(crossing))}

    def _at_hand(self, place: Place) -> bool:
        return self._by_number[place[0]].work.operation in (ca.OP_INPUT, ca.OP_CONST)

    def lines(self) -> Iterator[str]:
        """Text of the body."""
        yield "int lane;"
        if self._kept:
            yield f"double kept[{len(self._kept)}][LANES];"
        for tasks in self._loops:
            yield from self._call(tasks[0]) if tasks[0].work.operation == ca.OP_CALL else self._loop(tasks)

    def _call(self, task: _Task) -> Iterator[str]:
        call, lines = self.called[task.number], list[str]()
        given = [self._value(place, {}, lines).number for place in task.sources]
        first, again = not call.times, f"{self._name}_{task.number}(vector)"
        lines += [f"needed[lane] = {given[0]} != 0;"] * first
        lines += [f"vector[{i}][lane] = {text};" for i, text in enumerate(given[first:])]
        results = [(self._kept.get((task.number, i)), i) for i in range(len(task.work.given))]
        chosen = "needed[lane] ? vector[{0}][lane] : 0.0" if first else "vector[{0}][lane]"
        yield "{"
        yield f"double vector[{len(given) - first}][LANES];"
        yield "int needed[LANES], any = 0;" if first else "int times;"
        yield from _over_lanes(lines)
        if first:
            yield "for (lane = 0; lane < LANES; ++lane) any |= needed[lane];"
            yield f"if (any) {again};"
        else:
            yield f"for (times = 0; times < {call.times}; ++times) {again};"
        yield from _over_lanes([f"{kept} = {chosen.format(i)};" for kept, i in results if kept])
        yield "}"

    def _loop(self, tasks: list[_Task]) -> Iterator[str]:
        lines, ends, values = list[str](), list[str](), dict[Place, Value]()
        for task in tasks:
            work, place = task.work, (task.number, 0)
            if work.operation == ca.OP_INPUT:
                continue
            taken = [self._value(source, values, lines) for source in task.sources]
            if work.operation == ca.OP_OUTPUT:
                ends.append(f"z[{work.given[1]}][lane] = {taken[0].number};")
                continue
            values[place] = declared(lines, task.number, work, taken, _named)
            if place in self._kept:
                lines.append(f"{self._kept[place]} = {values[place].number};")
        yield from _over_lanes([*lines, *ends])

    def _value(self, place: Place, values: dict[Place, Value], lines: list[str]) -> Value:
        """A result of this loop, or one of another that is read once."""
        if place not in values:
            work = self._by_number[place[0]].work
            if work.operation == ca.OP_CONST:
                return Value(constant(work.constant))
            name = f"v{place[0]}_{place[1]}"
            source = f"z[{work.taken[1]}][lane]" if work.operation == ca.OP_INPUT else self._kept[place]
            lines.append(f"const double {name} = {source};")
            values[place] = Value(name)
        return values[place]


def _named(code: int) -> str | None:
    return portable_name(code) or called_alone(code)


def _over_lanes(lines: list[str]) -> Iterator[str]:
    yield "for (lane = 0; lane < LANES; ++lane) {"
    yield from (f"  {line}" for line in lines)
    yield "}"
