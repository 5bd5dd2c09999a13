"""The step function repeated, in machine code where a C compiler is at hand."""

import ctypes
import os
import shlex
import shutil
import signal
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

import casadi as ca

from quakedesign import cache
from quakedesign.errors import SimulationError
from quakedesign.simulation.c_files import c_file
from quakedesign.simulation.instructions import expanded, expanded_size
from quakedesign.simulation.portable_c import in_place_of_the_library
from quakedesign.temporary import temporary_folder

FLAGS = (
    *("-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"),
    *("-fPIC", "-fvisibility=hidden", "-shared"),  # what is not hidden is never inlined
)
"""None of them changes a digit."""
RADIX = 64
LEVELS = 3
_LONGEST_COMPILATION = 120
_WORTH = 100_000_000
"""Instructions of a whole run from which on a compiler, which takes some 0.3 s, saves time."""


STEP = "quakedesign_step"
"""Name of a step function: in a library that is loaded, that of a function of the C library would be taken for it."""

MachineCode = Callable[[Any, int], int]


@dataclass(frozen=True)
class Backend:
    """What advances a vector.

    Attributes
    ----------
    functions : tuple of casadi.Function
        That advance it by 1, 64 and 4096 steps, one input and one output each; none beside machine code.
    name : str
        ``"compiled"`` or ``"virtual-machine"``.
    reason : str
        The compiler, or why there is none.
    machine_code : callable, optional
        Advances the floats at a pointer by a number of steps; not 0 if it fails.
    """

    functions: tuple[Any, ...]
    name: str
    reason: str
    machine_code: MachineCode | None = None


def prepare(step: Any, compiled: bool | None, steps: int) -> Backend:
    """Backend of a step function; both kinds give the same digits.

    Parameters
    ----------
    step : casadi.Function
        One vector in, one vector of the same length out; called `STEP`.
    compiled : bool or None
        Whether to compile; None: if the run is long enough to be worth it, and a compiler is found and works.
    steps : int
        Number of steps of the run.

    Raises
    ------
    SimulationError
        When compilation was asked for and is not possible.
    """
    if compiled is False:
        return _virtual_machine(step, "asked for")
    if compiled is None and steps * expanded_size(step) < _WORTH:
        return _virtual_machine(step, "the run is shorter than a compilation")
    try:
        command = compiler()
        return Backend((), "compiled", " ".join((*command, *FLAGS)), _compile(_source(step), command))
    except (OSError, subprocess.SubprocessError) as error:
        reason = _reason(error)
        if compiled:
            raise SimulationError(
                f"a compiled loop needs a C compiler. {reason}. Install one, set CC, or use compiled=None."
            ) from None
        return _virtual_machine(step, reason)


def _virtual_machine(step: Any, reason: str) -> Backend:
    return Backend(ladder(expanded(step)), "virtual-machine", reason)


def ladder(step: Any) -> tuple[Any, ...]:
    """Functions for 1, RADIX, RADIX² … steps; each calls the one below, so that the code stays small."""
    rungs = [step]
    for level in range(1, LEVELS):
        start = ca.MX.sym("z", step.size1_in(0))
        end = start
        for _ in range(RADIX):
            end = rungs[-1](end)
        rungs.append(ca.Function(f"steps_{RADIX**level}", [start], [end]))
    return tuple(rungs)


def _source(step: Any) -> str:
    generator = ca.CodeGenerator("steps.c")
    generator.add(step)
    sizes = {
        "step": step.name(),
        "size": step.size1_in(0),
        "work": max(1, step.sz_w()),
        "integers": max(1, step.sz_iw()),
        "arguments": step.sz_arg(),
        "results": step.sz_res(),
    }
    return in_place_of_the_library() + str(generator.dump()) + c_file("steps.c", **sizes)


def compiler() -> tuple[str, ...]:
    """Command of the C compiler: CC, or the first of cc, gcc and clang.

    Raises
    ------
    FileNotFoundError
        When there is none, or CC cannot be read.
    """
    try:
        wanted = shlex.split(os.environ.get("CC", ""))
    except ValueError as error:
        raise FileNotFoundError(f"CC must be a command: {error}") from None
    for command in [wanted] if wanted else [["cc"], ["gcc"], ["clang"]]:
        path = shutil.which(command[0])
        if path:
            return path, *command[1:]
    raise FileNotFoundError("no C compiler: neither CC nor cc, gcc or clang was found")


@lru_cache(maxsize=32)
def _compile(text: str, command: tuple[str, ...]) -> MachineCode:
    """Load the loop of a C source; the library stays in memory when its file is gone."""
    asked = text.encode(), repr((*command, *FLAGS, *_identity(command[0]))).encode()
    with temporary_folder() as folder:
        library = folder / "kept.so"
        if (content := cache.recall("code", *asked)) is not None:
            library.write_bytes(content)
        else:
            library = shared_library(text, folder, command)
            cache.keep("code", library.read_bytes(), *asked)
        advance: Any = ctypes.CDLL(str(library)).advance
    advance.argtypes, advance.restype = [ctypes.c_void_p, ctypes.c_longlong], ctypes.c_int
    return cast(MachineCode, advance)


def compilation() -> str:
    """How a compiled run is compiled: command and flags, and which compiler that is; empty without one."""
    try:
        command = compiler()
        return repr((*command, *FLAGS, *_identity(command[0])))
    except OSError:
        return ""


def _identity(program: str) -> tuple[str, int, int]:
    """Where a program lies, its size and when it changed last: another compiler has another one."""
    path = Path(program).resolve()
    told = path.stat()
    return str(path), told.st_size, told.st_mtime_ns


def shared_library(text: str, folder: Path, command: tuple[str, ...], flags: tuple[str, ...] = ()) -> Path:
    """Compile a C source into a shared library in a folder, with more flags where there are some.

    Raises
    ------
    OSError, SubprocessError
        When the compiler does not work.
    """
    written, library = folder / "steps.c", folder / "steps.so"
    written.write_text(text, encoding="utf-8")
    _run([*command, *FLAGS, *flags, str(written), "-o", str(library), "-lm"], folder)
    return library


def _run(call: list[str], folder: Path) -> None:
    """Run a compiler to its end; whatever else ends it ends those that it has started, and its files lie in a folder.

    Raises
    ------
    OSError, SubprocessError
    """
    where, pipe = os.environ | {"TMPDIR": str(folder)}, subprocess.PIPE
    with subprocess.Popen(
        call, stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe, env=where, start_new_session=True
    ) as process:
        try:
            said = process.communicate(timeout=_LONGEST_COMPILATION)
        except BaseException:
            _kill_all(process)
            raise
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, call, *said)


def _kill_all(process: "subprocess.Popen[bytes]") -> None:
    if hasattr(os, "killpg"):
        os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()


def _reason(error: Exception) -> str:
    if isinstance(error, subprocess.CalledProcessError):
        said = error.stderr.decode(errors="replace").strip().splitlines()
        return f"the C compiler failed: {said[0] if said else f'exit code {error.returncode}'}"
    return (str(error) or type(error).__name__).splitlines()[0]
