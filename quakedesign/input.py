"""Files of users are read whole, from a regular file of bounded size: nothing waits, nothing is endless."""

import os
import stat
import tomllib
from pathlib import Path
from typing import Any

from quakedesign.errors import QuakedesignError

_MOST_DOTS = 400
"""In a line of TOML: memory and time for a key of n parts grow as n²."""


def parse_toml(text: str) -> dict[str, Any]:
    """Entries of a TOML file of some 64 KiB.

    Raises
    ------
    ValueError
        When it is no TOML, nested too deeply, or has a key of more than 400 parts.
    """
    for number, line in enumerate(text.split("\n"), start=1):
        if line.count(".") > _MOST_DOTS:
            raise ValueError(f"a line may have at most {_MOST_DOTS} dots, line {number} has {line.count('.')}")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("its values are nested too deeply") from None


def read_text(path: str | Path, what: str, *, largest: int, refusal: type[QuakedesignError]) -> str:
    """Text of a file in UTF-8; parameters as in `read_bytes`."""
    try:
        return read_bytes(path, what, largest=largest, refusal=refusal).decode()
    except UnicodeDecodeError:
        raise refusal(f"{what} cannot be read: {path}: its text is not UTF-8. Give a readable file.") from None


def read_bytes(path: str | Path, what: str, *, largest: int, refusal: type[QuakedesignError]) -> bytes:
    """Content of a file.

    Parameters
    ----------
    path : str or Path
    what : str
        What the file is, for the message.
    largest : int
        Most bytes that it may have.
    refusal : type of QuakedesignError
        What is raised when it cannot be read, is larger, or is a pipe, a device or a folder.
    """
    try:
        with open(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb") as handle:
            if not stat.S_ISREG(os.fstat(handle.fileno()).st_mode):
                raise refusal(f"{what} must be a regular file. Received {path}, a pipe or device. Give a file.")
            data = handle.read(largest + 1)
        if len(data) > largest:
            size = f"{largest >> 20} MiB" if largest >> 20 else f"{largest >> 10} KiB"
            raise refusal(f"{what} must be at most {size}. Received {path}, which is larger. Give a smaller one.")
        return data
    except QuakedesignError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "its name is none that a file can have"
        raise refusal(f"{what} cannot be read: {path}: {reason}. Give a readable file.") from None
