"""Files and folders are written whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from quakedesign.errors import OutputError
from quakedesign.temporary import ASIDE, is_temporary, lock_of, sweep, temporary_folder, unlock

_placed = [0]
_LONGEST_NAME = 200  # of the 255 bytes of most systems; the rest is for what goes beside


def require_room(path: Path) -> None:
    """Refuse a place that cannot be written, before the work begins; put in order what a killed process left there.

    Raises
    ------
    OutputError
    """
    parent, length = path.absolute().parent, len(path.name.encode(errors="surrogatepass"))
    if length > _LONGEST_NAME:
        raise OutputError(
            f"{path} must have a name of at most {_LONGEST_NAME} bytes. Received {length}. Choose a shorter one."
        )
    try:
        with temporary_folder(parent) as work:
            (work / path.name).touch()
        sweep(parent)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise OutputError(
            f"{path} must be in a folder that can be written. Received {parent}: {reason}. Choose another."
        ) from None


_held: list[tuple[Path, Path, int | None]] = []
"""Folders that this command writes, with their locks."""


def hold(folder: Path, *, make: bool = False) -> bool:
    """Refuse a folder that another command writes, and keep it from others until `release`; False if it is held.

    Parameters
    ----------
    folder : Path
    make : bool
        Make the folders above it where there are none.

    Raises
    ------
    OutputError
    """
    place = Path(os.path.realpath(folder))
    if any(place == held for held, _, _ in _held):
        return False
    try:
        if make:
            place.parent.mkdir(parents=True, exist_ok=True)
        _held.append((place, *lock_of(place)))
    except BlockingIOError:
        raise OutputError(
            f"{folder} must be written by one command at a time. Received one that another writes to. Wait for it, or "
            "choose another folder."
        ) from None
    except OSError as error:
        raise OutputError(f"{folder} cannot be written: {error.strerror}. Choose another folder.") from None
    return True


def release(folder: Path | None = None) -> None:
    """Let others write a folder; every one, unless told."""
    place = None if folder is None else Path(os.path.realpath(folder))
    for entry in [entry for entry in _held if place in (None, entry[0])]:
        _held.remove(entry)
        unlock(*entry[1:])


@contextmanager
def sole_writer(folder: Path, *, make: bool = False) -> Iterator[None]:
    """Hold a folder in a block, see `hold`."""
    new = hold(folder, make=make)
    try:
        yield
    finally:
        if new:
            release(folder)


def number_placed() -> int:
    """How many files and folders this process has put in their places, that which it is about to put among them."""
    return _placed[0]


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file through a temporary neighbour, so that no reader ever sees half of it.

    Raises
    ------
    OutputError
        When the file cannot be written; nothing is left behind then.
    """
    data = content.encode() if isinstance(content, str) else content
    _require_name(path)
    try:
        with temporary_folder(path.parent) as work:
            new = work / "new"
            new.write_bytes(data)
            new.chmod(0o644)
            _place(new, path)
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror}. Choose a folder that you may write.") from None


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """Folder for files of a block, made with those above it; what was made goes again where the block fails.

    Raises
    ------
    OutputError
        When it cannot be made.
    """
    missing = [place for place in (folder, *folder.parents) if not os.path.lexists(place)]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException as error:
        for place in missing:
            with suppress(OSError):  # it holds something, or was never made
                place.rmdir()
        if isinstance(error, OSError) and not isinstance(error, OutputError):
            raise OutputError(f"{folder} cannot be written: {error.strerror}. Choose another folder.") from None
        raise


@contextmanager
def whole_folder(target: Path) -> Iterator[Path]:
    """Folder to fill that takes its place, and that of an earlier one, when the block ends without an error.

    Raises
    ------
    OutputError
        When it cannot be written; nothing is left behind then, and an earlier folder stays.
    """
    _require_name(target)
    try:
        with sole_writer(target), temporary_folder(target.absolute().parent) as work:
            new = work / "new"
            new.mkdir()
            yield new
            new.chmod(0o755)
            if target.exists():
                (work / ASIDE).mkdir()
                os.replace(target, work / ASIDE / target.name)
            _place(new, target)
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"{target} cannot be written: {error.strerror}. Choose another folder.") from None


def _require_name(path: Path) -> None:
    """Refuse what no system can name."""
    try:
        os.access(path, os.F_OK)
    except ValueError as error:
        raise OutputError(f"{str(path)!r} cannot be written: {error}. Choose another name.") from None


def _place(new: Path, target: Path) -> None:
    if not is_temporary(target):
        _placed[0] += 1
    os.replace(new, target)
