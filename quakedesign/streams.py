"""Standard streams, terminal width and memory at the start of a process."""

import errno
import io
import os
import sys
from typing import NoReturn

if sys.platform != "win32":
    import resource

LACKS_MEMORY = 4
"""Exit code of a command that ran out of memory, without a result."""
_NARROWEST, _WIDEST = 20, 1000  # columns; below 3 the layout of help never ends, and huge widths fill the memory
_LEAST = 600 * 2**20  # bytes of address space
_MESSAGES = ("cannot allocate memory", "failed to map", "out of memory", "can't start new thread", "std::bad_alloc")


def open_all() -> None:
    """Replace closed standard streams by null streams; writing to a closed stdout is an error.

    Otherwise the next opened file would get their descriptors.
    """
    for number, name, mode in ((0, "stdin", os.O_RDONLY), (1, "stdout", os.O_RDONLY), (2, "stderr", os.O_WRONLY)):
        if getattr(sys, name) is None:
            opened = os.open(os.devnull, mode)
            if opened != number:
                os.dup2(opened, number)
                os.close(opened)
            plain = open(number, "w" if number else "r", encoding="utf-8", closefd=False)
            setattr(sys, name, _Closed() if name == "stdout" else plain)


class _Closed(io.TextIOBase):
    """Stream that was closed at the start of the process."""

    def write(self, _text: str) -> int:
        raise OSError(errno.EBADF, "it is closed", "stdout")


def widen() -> None:
    """Limit the width of the terminal or ``COLUMNS`` to values for which help can be laid out."""
    given = os.environ.get("COLUMNS", "")
    if given.isascii() and given.isdecimal():
        columns = int(given[:9])
    else:
        os.environ.pop("COLUMNS", None)
        try:
            columns = os.get_terminal_size(1).columns or 80
        except OSError:
            return
    if not _NARROWEST <= columns <= _WIDEST:
        os.environ["COLUMNS"] = str(min(max(columns, _NARROWEST), _WIDEST))


def has_memory() -> bool:
    """Whether the memory limit suffices to load the libraries: OpenBLAS otherwise ends the process with exit code 1."""
    if sys.platform == "win32":
        return True
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return limit == resource.RLIM_INFINITY or limit >= _LEAST


def lack_memory() -> NoReturn:
    """End a command that has too little memory."""
    print("quakedesign: out of memory. Raise the memory limit, or reduce the problem.", file=sys.stderr)
    sys.exit(LACKS_MEMORY)


def lacks_memory(error: BaseException | None) -> bool:
    """Whether an error was caused by too little memory; libraries report this in different ways, even during import."""
    while error is not None:
        number = getattr(error, "errno", None)
        if (
            isinstance(error, MemoryError)
            or number == errno.ENOMEM
            or any(said in str(error).lower() for said in _MESSAGES)
        ):
            return True
        error = error.__cause__ or error.__context__
    return False
