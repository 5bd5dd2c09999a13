"""One step of a loop as text, and the compiled call that repeats it for many samples."""

import ctypes
import hashlib
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from quakedesign.simulation.backend import Backend, compiler, ladder, shared_library
from quakedesign.simulation.instructions import expanded
from quakedesign.simulation.lanes import LANE_FLAGS, LANES, lanes_c, processor_flags
from quakedesign.simulation.stepping import Advancer
from quakedesign.temporary import temporary_folder

Mover = Callable[["np.ndarray", int], None]
SLICE = 200_000  # steps of all samples together in one call of compiled code, which is deaf: a fraction of a second


@dataclass(frozen=True, kw_only=True)
class Library:
    """Compiled source, bound to its content: whoever loads it makes sure that it is what was built.

    Attributes
    ----------
    path : Path
    digest : str
    """

    path: Path
    digest: str

    @classmethod
    def of(cls, path: Path) -> "Library":
        """Library that has just been built in a private place."""
        return cls(path=path, digest=_digest(path.read_bytes()))

    def content(self) -> bytes:
        """What was built.

        Raises
        ------
        OSError
            When it is not there any more, or something else is.
        """
        content = self.path.read_bytes()
        if _digest(content) != self.digest:
            raise OSError(f"{self.path} is not what was built")
        return content


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


@dataclass(frozen=True, kw_only=True)
class CompiledProgram:
    """What a worker needs to move samples on; it can be sent anywhere.

    Attributes
    ----------
    source : str
        C text with ``advance_samples``, which steps several of them at once.
    function : str
        The step with all elementary functions written out, as CasADi writes it, for workers without a C compiler.
    size : int
        Length of the vector of one sample.
    diverged : int
        Index of the time of divergence in it.
    library : Library or None
        Where somebody has compiled the source already.
    """

    lanes: ClassVar[int] = LANES
    batch_steps: ClassVar[int] = 80_000_000

    source: str
    function: str
    size: int
    diverged: int
    library: Library | None = None

    @classmethod
    def of(cls, step: Any, diverged: int) -> "CompiledProgram":
        """Program of a CasADi Function that maps the vector one step on."""
        source, function = lanes_c(step, diverged), expanded(step).serialize()
        return cls(source=source, function=function, size=step.size1_in(0), diverged=diverged)

    @property
    def fingerprint(self) -> str:
        """Digest of the arithmetic of one step."""
        return hashlib.sha256(self.function.encode()).hexdigest()

    def compiled(self, folder: Path) -> "CompiledProgram":
        """Program whose library lies in a folder, which must be private; the same program where no compiler works."""
        try:
            command = compiler()
            built = shared_library(self.source, folder, command, (*LANE_FLAGS, *processor_flags(command)))
            return replace(self, library=Library.of(built))
        except (OSError, subprocess.SubprocessError):
            return self

    def ends(self, starts: "np.ndarray", steps: int) -> "np.ndarray":
        """Vectors after a number of steps, one a row, in slices that can be interrupted; one that diverges ends there.

        Parameters
        ----------
        starts : ndarray
            Shape (samples, size).
        steps : int
        """
        move = mover(self)
        vectors = np.array(starts, dtype=np.float64, order="C", ndmin=2)
        slice_ = max(1, SLICE // len(vectors))
        for taken in range(0, steps, slice_):
            move(vectors, min(slice_, steps - taken))
        return vectors


@lru_cache(maxsize=8)
def mover(program: CompiledProgram) -> Mover:
    """Callable (vectors, steps) that moves vectors, one a row, on in place: machine code where it can be had.

    A library that is missing or is not what was built, as on another machine, is built anew.
    """
    with temporary_folder() as folder:
        for given in (program, replace(program, library=None)):
            try:
                if library := (given if given.library else given.compiled(folder)).library:
                    return _machine_code(library.content(), folder, program.size)
            except (OSError, AttributeError):
                continue
    return _virtual_machine(program)


def _machine_code(content: bytes, folder: Path, size: int) -> Mover:
    library = folder / f"{_digest(content)}.so"  # of another name than one that is loaded already, and refused
    library.write_bytes(content)
    loaded = ctypes.CDLL(str(library))
    if not loaded.made_for_this_processor():
        raise OSError("the library was built for another processor")
    advance = loaded.advance_samples
    rows = np.ctypeslib.ndpointer(dtype=np.float64, ndim=2, flags="C_CONTIGUOUS")
    advance.argtypes, advance.restype = [rows, ctypes.c_longlong, ctypes.c_longlong], ctypes.c_int

    def move(vectors: "np.ndarray", steps: int) -> None:
        assert vectors.shape[1] == size
        if advance(vectors, len(vectors), steps):
            raise ArithmeticError("the compiled step failed")

    return move


def _virtual_machine(program: CompiledProgram) -> Mover:
    rungs = ladder(ca.Function.deserialize(program.function))
    advancer = Advancer.of(Backend(rungs, "virtual-machine", ""), [0.0] * program.size)
    alone = Lock()  # threads share the advancer

    def move(vectors: "np.ndarray", steps: int) -> None:
        with alone:
            for row in vectors:
                if not row[program.diverged] >= 0:
                    row[:] = _moved(advancer, row, steps, program.diverged)

    return move


def _moved(advancer: Advancer, start: "np.ndarray", steps: int, diverged: int) -> "np.ndarray":
    """Vector after a number of steps, or after the one at which divergence is noticed, as in machine code."""
    advancer.vector[:] = start
    advancer.advance(steps)
    if advancer.vector[diverged] >= 0:
        advancer.vector[:] = start
        while not advancer.vector[diverged] >= 0:
            advancer.advance(1)
    return advancer.vector
