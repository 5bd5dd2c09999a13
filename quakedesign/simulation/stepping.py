"""Running a backend over many steps and keeping some instants."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from quakedesign.errors import SimulationError
from quakedesign.simulation.backend import LEVELS, RADIX, Backend, MachineCode
from quakedesign.simulation.checkpoint import Checkpoint

GOLDEN = (5**0.5 - 1) / 2

ProgressReport = Callable[[float], None]


@dataclass(frozen=True)
class Advancer:
    """Moves one vector forward in place, by any number of steps.

    Attributes
    ----------
    vector : ndarray
    calls : tuple of callable
        Advance the vector by 1, 64 and 4096 steps; none beside machine code.
    owners : tuple
        CasADi's buffers, which must live as long as the calls.
    machine_code : callable or None
        See `Backend`.
    """

    vector: "np.ndarray"
    calls: tuple[Callable[[], None], ...] = ()
    owners: tuple[Any, ...] = ()
    machine_code: MachineCode | None = None

    @classmethod
    def of(cls, backend: Backend, start: list[float]) -> "Advancer":
        """Advancer at a starting vector."""
        vector = np.array(start)
        if backend.machine_code:
            return cls(vector, machine_code=backend.machine_code)
        calls, owners = zip(*(_bound(function, vector) for function in backend.functions), strict=True)
        return cls(vector, calls, owners)

    def advance(self, steps: int) -> None:
        """Take a number of steps; no call into compiled code lasts longer than 4096 of them."""
        if self.machine_code:
            return self._advance_compiled(self.machine_code, steps)
        for level in reversed(range(len(self.calls))):
            times, steps = divmod(steps, RADIX**level)
            for _ in range(times):
                self.calls[level]()

    def _advance_compiled(self, machine_code: MachineCode, steps: int) -> None:
        longest = RADIX ** (LEVELS - 1)
        for first in range(0, steps, longest):
            if machine_code(self.vector.ctypes.data, min(longest, steps - first)):
                raise SimulationError("the compiled step failed. Use compiled=False.")


def _bound(function: Any, vector: "np.ndarray") -> tuple[Callable[[], None], Any]:
    result = np.empty_like(vector)
    buffer, evaluate = function.buffer()
    buffer.set_arg(0, vector.data)
    buffer.set_res(0, result.data)

    def call() -> None:
        evaluate()
        vector[:] = result

    return call, (function, buffer, result)


def instants(steps: int, samples: int) -> list[int]:
    """Step numbers to keep: one of every stride of equal length, at most `samples` strides, and the first and the last.

    Its place within the stride moves on by the golden section of it (Weyl 1916: such places are evenly distributed).
    Instants at equal distances would meet chatter, a disturbance or anything else that repeats with their distance, or
    a divisor of it, in one phase alone, and never show its size.
    """
    stride = max(1, -(-steps // samples))
    starts = enumerate(range(stride, steps, stride), start=1)
    return [0, *(min(start + int(stride * (number * GOLDEN % 1)), steps - 1) for number, start in starts), steps]


def march(
    advancer: Advancer,
    kept: list[int],
    diverged_at: int,
    progress: ProgressReport | None,
    checkpoint: Checkpoint | None = None,
) -> "np.ndarray":
    """Vectors at the kept instants, one a column; ends early once the entry `diverged_at` is set.

    Python runs between two calls, so that the user can interrupt and sees the progress; what was kept until then is in
    the checkpoint, if there is one, and the next march goes on from there.
    """
    found = (checkpoint.read() if checkpoint else []) or [advancer.vector.copy()]
    advancer.vector[:] = found[-1]
    try:
        for before, after in pairwise(kept[len(found) - 1 :]):
            if advancer.vector[diverged_at] >= 0:
                break
            advancer.advance(after - before)
            found.append(advancer.vector.copy())
            if progress:
                progress(after / kept[-1])
            if checkpoint:
                checkpoint.write(found)
    except BaseException:
        if checkpoint:
            checkpoint.write(found, now=True)
        raise
    if checkpoint:
        checkpoint.remove()
    return np.array(found).T
