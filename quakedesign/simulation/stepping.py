"""Long runs in steps: checkpoints, stored samples, and cached results.

The result of an interrupted and resumed run is bitwise equal to that of an uninterrupted one.
"""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from quakedesign import cache
from quakedesign.errors import OutputError, SimulationError
from quakedesign.files import sweep, write_whole
from quakedesign.simulation.compiled import LEVELS, RADIX, Backend, MachineCode, compilation

if TYPE_CHECKING:
    import casadi as ca

# ----------------------------------------------------------------------
# Checkpoints: long runs can be interrupted at any moment and resumed with bitwise equal results.

SECONDS = 30.0  # least time between two writes of a checkpoint


@dataclass(frozen=True)
class Checkpoint:
    """File with the vectors that a run has stored so far, written atomically."""

    path: Path
    fingerprint: str  # Digest of everything that determines the results; a file of another run is rejected
    _written: list[float] = field(default_factory=lambda: [monotonic()], repr=False)

    @classmethod
    def of(cls, path: str | Path, step: "ca.Function", start: Sequence[float], instants: Sequence[int]) -> "Checkpoint":
        """Checkpoint of a run.

        Parameters
        ----------
        path : str or Path
        step : casadi.Function
            One step of the run.
        start : sequence of float
            Vector at time zero.
        instants : sequence of int
            Numbers of the steps to store.
        """
        inputs = (step.serialize(), *(float(x).hex() for x in start), *map(str, instants), version("casadi"))
        return cls(Path(path), hashlib.sha256("\n".join(inputs).encode()).hexdigest())

    def read(self) -> "list[np.ndarray]":
        """Vectors stored so far; an empty list if there is no file.

        Raises
        ------
        OutputError
            If the file cannot be read.
        SimulationError
            If it is not a checkpoint, or that of another run.
        """
        sweep(self.path.parent)
        try:
            with np.load(BytesIO(self.path.read_bytes()), allow_pickle=False) as archive:
                fingerprint, vectors = str(archive["fingerprint"]), archive["vectors"]
        except FileNotFoundError:
            return []
        except OSError as error:
            raise OutputError(f"checkpoint {self.path} cannot be read: {error.strerror or error}.") from None
        except (ValueError, KeyError, EOFError, BadZipFile):
            fingerprint, vectors = "", np.empty((0, 0))
        if fingerprint != self.fingerprint:
            raise SimulationError(
                f"checkpoint {self.path} does not belong to this run, or is not a checkpoint. "
                "Delete it, or choose another name."
            )
        return list(vectors)

    def write(self, vectors: "Sequence[np.ndarray]", *, now: bool = False) -> None:
        """Write the vectors stored so far, at most every `SECONDS` s unless `now`.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        if not now and monotonic() - self._written[0] < SECONDS:
            return
        content = BytesIO()
        np.savez(content, fingerprint=np.array(self.fingerprint), vectors=np.array(vectors))
        write_whole(self.path, content.getvalue())
        self._written[0] = monotonic()

    def remove(self) -> None:
        """Delete the file after the end of the run."""
        self.path.unlink(missing_ok=True)


# ----------------------------------------------------------------------
# Many steps of a backend, with storage at some instants.

GOLDEN = (5**0.5 - 1) / 2

ProgressReport = Callable[[float], None]


@dataclass(frozen=True)
class Advancer:
    """Advances one vector in place, by any number of steps."""

    vector: "np.ndarray"
    calls: tuple[Callable[[], None], ...] = ()  # Advance the vector by 1, 64 and 4096 steps; empty with machine code
    owners: tuple[object, ...] = ()  # CasADi's buffers, which must stay alive with the calls
    machine_code: MachineCode | None = None  # See `Backend`

    @classmethod
    def of(cls, backend: Backend, start: list[float]) -> "Advancer":
        """Advancer at an initial vector."""
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


def _bound(function: Any, vector: "np.ndarray") -> tuple[Callable[[], None], object]:
    result = np.empty_like(vector)
    buffer, evaluate = function.buffer()
    buffer.set_arg(0, vector.data)
    buffer.set_res(0, result.data)

    def call() -> None:
        evaluate()
        vector[:] = result

    return call, (function, buffer, result)


def instants(steps: int, samples: int) -> list[int]:
    """Step numbers to store: the first, the last, and one from each of at most `samples` strides of equal length.

    The position within the stride advances by the golden ratio, hence positions are uniformly distributed (Weyl 1916).
    Equidistant instants would sample a signal whose period divides their spacing, such as chatter, always at the same
    phase, and could miss its amplitude.
    """
    stride = max(1, -(-steps // samples))
    starts = enumerate(range(stride, steps, stride), start=1)
    return [0, *(min(start + int(stride * (number * GOLDEN % 1)), steps - 1) for number, start in starts), steps]


def march(
    advancer: Advancer,
    instants: list[int],
    diverged_at: int,
    progress: ProgressReport | None,
    checkpoint: Checkpoint | None = None,
) -> "np.ndarray":
    """Vectors at the step numbers `instants`, one per column; ends early once the entry `diverged_at` is set.

    Python code runs between two calls, so that the user can interrupt the run and see its progress. The vectors stored
    so far are in the checkpoint, if there is one; the next call resumes from these.
    """
    vectors = (checkpoint.read() if checkpoint else []) or [advancer.vector.copy()]
    advancer.vector[:] = vectors[-1]
    try:
        for before, after in pairwise(instants[len(vectors) - 1 :]):
            if advancer.vector[diverged_at] >= 0:
                break
            advancer.advance(after - before)
            vectors.append(advancer.vector.copy())
            if progress:
                progress(after / instants[-1])
            if checkpoint:
                checkpoint.write(vectors)
    except BaseException:
        if checkpoint:
            checkpoint.write(vectors, now=True)
        raise
    if checkpoint:
        checkpoint.remove()
    return np.array(vectors).T


# ----------------------------------------------------------------------
# Long runs are cached on the user's disk, see `quakedesign.cache`: code and initial vector determine the result.

LONG = 100_000_000
"""Least number of instructions of a cached run."""


def run_key(
    step: "ca.Function", start: Sequence[float], instants: Sequence[int], compiled: bool | None, steps: int
) -> tuple[bytes, ...]:
    """Everything that determines the results of a run of a step function; empty for a run that is not cached."""
    if not cache.in_use() or compiled is False or steps * step.n_instructions() < LONG:
        return ()
    return step.serialize().encode(), np.array(start).tobytes(), np.array(instants).tobytes(), compilation().encode()


def recall_run(key: tuple[bytes, ...]) -> tuple["np.ndarray", dict[str, str]] | None:
    """Cached vectors, one per column, and the provenance entries of the backend; None if the run is not cached."""
    if not key or (content := cache.load("run", *key)) is None:
        return None
    with np.load(BytesIO(content), allow_pickle=False) as archive:
        entries = {name: str(archive[name]) for name in archive.files if name != "vectors"}
        return archive["vectors"], entries | {"backend_reason": f"{entries['backend_reason']}; from the cache"}


def store_run(key: tuple[bytes, ...], vectors: "np.ndarray", entries: dict[str, str]) -> None:
    """Cache a run for `recall_run` if it was compiled."""
    if key and entries["backend"] == "compiled":
        content = BytesIO()
        np.savez(content, allow_pickle=False, vectors=vectors, **{name: np.array(entries[name]) for name in entries})
        cache.store("run", content.getvalue(), *key)
