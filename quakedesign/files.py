"""File input with bounded size, atomic file output, and locked temporary folders.

Input files are read whole and must be regular files. Output files and folders appear complete or not at
all. Temporary folders of a killed process are removed at the next start.
"""

import os
import platform
import secrets
import shutil
import stat
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from time import sleep
from typing import Any

from quakedesign.errors import OutputError, QuakedesignError

# ----------------------------------------------------------------------
# Files of users are read whole, from a regular file of bounded size: nothing waits, nothing is endless.

Json = dict[str, Any]
"""Object of a JSON file: values by key."""

_MOST_DOTS = 400
"""In a line of TOML: memory and time for a key of n parts grow as n²."""


def parse_toml(text: str) -> Json:
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


def read_text(
    path: str | Path, what: str, *, largest: int, refusal: type[QuakedesignError], marked: bool = True
) -> str:
    """Text of a file in UTF-8, without the byte-order mark that it may be `marked` with; others as in `read_bytes`."""
    try:
        return read_bytes(path, what, largest=largest, refusal=refusal).decode("utf-8-sig" if marked else "utf-8")
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


# ----------------------------------------------------------------------
# Temporary folders, each locked by the process that made it; what a killed process left goes at the next start.

if sys.platform != "win32":
    import fcntl

FAMILY = ".quakedesign-"
"""Beginning of the names of temporary folders."""
PREFIX = f"{FAMILY}{sha256(platform.node().encode()).hexdigest()[:8]}-"
"""The same on this machine: on a disk shared by many, a lock may be known to one of them only."""
ASIDE = "aside"
"""What lies in this folder of a temporary folder has been moved there, and goes back where its place is empty."""

_TRIALS, _PAUSE = 10, 0.02  # s: a sweep holds a lock for less
_mine: set[Path] = set()


@contextmanager
def temporary_folder(parent: Path | None = None) -> Iterator[Path]:
    """Folder that nobody else may read, which goes when the block ends, or at the next start if the process is killed.

    Parameters
    ----------
    parent : Path, optional
        Where it lies; the folder of the system for temporary files unless given.
    """
    folder = (parent or Path(tempfile.gettempdir())).absolute() / f"{PREFIX}{secrets.token_hex(8)}"
    _mine.add(folder)
    lock = None
    try:
        lock = _taken(folder)
        yield folder
    finally:
        unlock(folder, lock)


def lock_of(target: Path) -> tuple[Path, int | None]:
    """Lock of a place until it is given back to `unlock`: a temporary folder beside it, and its descriptor.

    Another command on another machine does not see it, and None stands for a file system without locks.

    Raises
    ------
    BlockingIOError
        When another process holds it, or this one.
    """
    place = Path(os.path.realpath(target))
    folder = place.parent / f"{PREFIX}{sha256(os.fsencode(place.name)).hexdigest()[:16]}"
    if folder in _mine:
        raise BlockingIOError
    try:
        lock = _taken(folder)
    except BlockingIOError:
        raise
    except OSError:  # no new folder may be made there, but files may be in that which is there
        return folder, None
    _mine.add(folder)
    return folder, lock


def unlock(folder: Path, lock: int | None) -> None:
    """Give back what `lock_of` gave."""
    _discard(folder)
    if lock is not None:
        os.close(lock)


def is_temporary(path: Path) -> bool:
    """Whether a path lies in a temporary folder of this process."""
    return not _mine.isdisjoint(path.absolute().parents)


def sweep(parent: Path) -> None:
    """Remove what killed processes left in a folder: what nobody holds the lock of."""
    for folder in parent.glob(f"{PREFIX}*"):
        try:
            lock = _locked(folder)
        except OSError:
            continue
        try:
            if os.fstat(lock).st_uid == os.getuid():
                _discard(folder)
        finally:
            os.close(lock)


def sweep_system() -> None:
    """Remove what killed processes left in the folder of the system for temporary files."""
    try:
        sweep(Path(tempfile.gettempdir()))
    except OSError:  # there is no such folder: nothing is in it
        return


def discard_all() -> None:
    """Remove all temporary folders of this process, wherever its blocks stand."""
    for folder in list(_mine):
        _discard(folder)


def _taken(folder: Path) -> int | None:
    """Make a folder, and lock it until the descriptor is closed; None where the file system has no locks.

    Raises
    ------
    BlockingIOError
        When another process holds it.
    OSError
        When it cannot be made.
    """
    for trial in range(_TRIALS):
        folder.mkdir(mode=0o700, exist_ok=True)
        try:
            lock = _locked(folder)
        except BlockingIOError:  # held, or swept at this moment
            if trial == _TRIALS - 1:
                raise
            sleep(_PAUSE)
        except FileNotFoundError:
            continue
        except OSError:
            return None
        else:
            if _stands(folder, lock):
                return lock
            os.close(lock)
    raise BlockingIOError


def _stands(folder: Path, lock: int) -> bool:
    """Whether a folder is still the one that was locked, and not swept or made anew since."""
    try:
        return os.path.samestat(os.fstat(lock), os.stat(folder))
    except FileNotFoundError:
        return False


def _locked(folder: Path) -> int:
    """Descriptor that locks a folder until it is closed, at the latest when the process ends.

    Raises
    ------
    OSError
        When somebody else holds it, or the file system has no locks.
    """
    if sys.platform == "win32":
        raise OSError("folders have no locks here")
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def _discard(folder: Path) -> None:
    """Remove a folder once what was moved aside is back in its place, or replaced."""
    try:
        aside = list((folder / ASIDE).glob("*"))
    except OSError:  # no such folder can be
        aside = []
    for held in aside:
        if not (place := folder.parent / held.name).exists():
            os.replace(held, place)
    shutil.rmtree(folder, ignore_errors=True)
    _mine.discard(folder)


# ----------------------------------------------------------------------
# Files and folders are written whole or not at all.

_placed = [0]
_LONGEST_NAME = 200  # of the 255 bytes of most systems; the rest is for what goes beside


def require_room(path: Path) -> None:
    """Refuse a place that cannot be written, before the work begins; put in order what a killed process left there."""
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


_held: dict[Path, tuple[Path, int | None]] = {}
"""Folders that this command writes, with their locks."""


def hold(folder: Path, *, make: bool = False) -> bool:
    """Refuse a folder that another command writes, and keep it from others until `release`; False if it is held.

    Parameters
    ----------
    make : bool
        Make the folders above it where there are none.
    """
    place = Path(os.path.realpath(folder))
    if place in _held:
        return False
    try:
        if make:
            place.parent.mkdir(parents=True, exist_ok=True)
        _held[place] = lock_of(place)
    except BlockingIOError:
        raise OutputError(
            f"{folder} must be written by one command at a time. Received one that another writes to. Wait for it, or "
            "choose another folder."
        ) from None
    except OSError as error:
        raise OutputError(f"{folder} cannot be written: {error.strerror}. Choose another folder.") from None
    return True


def release(folder: Path | None = None) -> None:
    """Let others write a folder; every one, by default."""
    for place in list(_held) if folder is None else {Path(os.path.realpath(folder))} & _held.keys():
        unlock(*_held.pop(place))


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
