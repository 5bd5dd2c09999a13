"""File input with bounded size, atomic file output, and locked temporary folders.

Input files are read whole and must be regular files. Output files and folders appear complete or not at all. Temporary
folders of a killed process are removed at the next start.
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
# User files are read whole, from regular files of bounded size, so that no read blocks or is endless.

Json = dict[str, Any]
"""Object of a JSON file: values by key."""

_MOST_DOTS = 400
"""Largest number of dots in a line of TOML: memory and time for a key of n parts grow as n²."""


def parse_toml(text: str) -> Json:
    """Entries of a TOML text; the caller bounds its size, 64 KiB for the files of this package.

    Raises
    ------
    ValueError
        When it is not TOML, is nested too deeply, or has a line of more than 400 dots, in a key or elsewhere.
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
    """Text of a file in UTF-8; `marked` accepts and removes a byte-order mark; otherwise as `read_bytes`."""
    try:
        return read_bytes(path, what, largest=largest, refusal=refusal).decode("utf-8-sig" if marked else "utf-8")
    except UnicodeDecodeError:
        raise refusal(f"{what} must be UTF-8 text. Received {path}, which is not. Convert the file to UTF-8.") from None


def read_bytes(path: str | Path, what: str, *, largest: int, refusal: type[QuakedesignError]) -> bytes:
    """Content of a file.

    Parameters
    ----------
    path : str or Path
    what : str
        Description of the file for the message.
    largest : int
        Largest size [byte].
    refusal : type of QuakedesignError
        Class of the error that is raised when the file cannot be read, is larger, or is a pipe, a device or a folder.
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
        reason = getattr(error, "strerror", None) or "no file can have this name"
        raise refusal(f"{what} cannot be read: {path}: {reason}. Give a readable file.") from None


# ----------------------------------------------------------------------
# Temporary folders, each locked by its process; those of a killed process are removed at the next start.

if sys.platform != "win32":
    import fcntl

FAMILY = ".quakedesign-"
"""Beginning of the names of temporary folders."""
PREFIX = f"{FAMILY}{sha256(platform.node().encode()).hexdigest()[:8]}-"
"""`FAMILY` and a hash of this machine's name: on a shared disk, a lock may be visible to one machine only."""
ASIDE = "aside"
"""Subfolder of a temporary folder for files moved aside; each is restored if its original place is empty."""

_TRIALS, _PAUSE = 10, 0.02  # s; a sweep holds a lock for a shorter time
_mine: set[Path] = set()


@contextmanager
def temporary_folder(parent: Path | None = None) -> Iterator[Path]:
    """Private folder, removed when the block ends; if the process is killed, by the next `sweep` of its parent folder.

    Parameters
    ----------
    parent : Path, optional
        Parent folder; by default that of the system for temporary files.
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
    """Lock a path until `unlock`, by a temporary folder in its parent folder; return this folder and its descriptor.

    A command on another machine does not see the lock. The descriptor is None on a file system without locks, or if the
    folder cannot be made; then other processes are not excluded.

    Raises
    ------
    BlockingIOError
        When another process, or this one, holds the lock.
    """
    place = Path(os.path.realpath(target))
    folder = place.parent / f"{PREFIX}{sha256(os.fsencode(place.name)).hexdigest()[:16]}"
    if folder in _mine:
        raise BlockingIOError
    try:
        lock = _taken(folder)
    except BlockingIOError:
        raise
    except OSError:  # no folder can be made there, but an existing folder may be writable
        return folder, None
    _mine.add(folder)
    return folder, lock


def unlock(folder: Path, lock: int | None) -> None:
    """Release a lock from `lock_of`, and remove its folder; files in its `ASIDE` move back."""
    _discard(folder)
    if lock is not None:
        os.close(lock)


def is_temporary(path: Path) -> bool:
    """Whether a path lies in a temporary folder of this process."""
    return not _mine.isdisjoint(path.absolute().parents)


def sweep(parent: Path) -> None:
    """Remove the temporary folders of killed processes from a folder: those that are not locked."""
    for folder in parent.glob(f"{PREFIX}*"):
        try:
            lock = _locked(folder)
        except OSError:
            continue
        try:
            # a folder made anew at this path since the lock was opened belongs to a running process
            if os.fstat(lock).st_uid == os.getuid() and _is_same_folder(folder, lock):
                _discard(folder)
        finally:
            os.close(lock)


def sweep_system() -> None:
    """Remove the temporary folders of killed processes from the temporary folder of the system."""
    try:
        sweep(Path(tempfile.gettempdir()))
    except OSError:  # there is no such folder, so nothing to remove
        return


def discard_all() -> None:
    """Remove all temporary folders of this process, even those whose ``with`` block has not ended."""
    for folder in list(_mine):
        _discard(folder)


def _taken(folder: Path) -> int | None:
    """Make a folder, and lock it until the descriptor is closed; None if the file system has no locks.

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
            if _is_same_folder(folder, lock):
                return lock
            os.close(lock)
    raise BlockingIOError


def _is_same_folder(folder: Path, lock: int) -> bool:
    """Whether the locked folder still exists at its path: it was not removed or replaced by a new one."""
    try:
        return os.path.samestat(os.fstat(lock), os.stat(folder))
    except FileNotFoundError:
        return False


def _locked(folder: Path) -> int:
    """Descriptor that locks a folder until the descriptor is closed, at the latest when the process ends.

    Raises
    ------
    OSError
        When another process holds it, or the file system has no locks.
    """
    if sys.platform == "win32":
        raise OSError("folders cannot be locked on this system")
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def _discard(folder: Path) -> None:
    """Move the contents of `ASIDE` back where their places are empty, then remove the temporary folder."""
    try:
        aside = list((folder / ASIDE).glob("*"))
    except OSError:  # the path cannot exist
        aside = []
    for moved in aside:
        if not (place := folder.parent / moved.name).exists():
            os.replace(moved, place)
    shutil.rmtree(folder, ignore_errors=True)
    _mine.discard(folder)


# ----------------------------------------------------------------------
# Files and folders are written whole or not at all.

_placed = [0]
_LONGEST_NAME = 200  # of the 255 bytes of most systems; the rest is for added prefixes


def require_writable(path: Path) -> None:
    """Reject a path that cannot be written, before the work begins, and clean up after killed processes there.

    Raises
    ------
    OutputError
        If the name is longer than 200 bytes, or the folder cannot be written.
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


_held: dict[Path, tuple[Path, int | None]] = {}
"""Folders that this command writes, with their locks."""


def lock_folder(folder: Path, *, make: bool = False) -> bool:
    """Reject a folder that another command writes, and lock it until `release`; False if this process holds it already.

    Parameters
    ----------
    make : bool
        Make missing parent folders.

    Raises
    ------
    OutputError
        If another command writes the folder, or it cannot be written.
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
            f"{folder} must be written by one command at a time. Received a folder that another command writes. Wait "
            "for that command, or choose another folder."
        ) from None
    except OSError as error:
        raise OutputError(f"{folder} cannot be written: {error.strerror}. Choose another folder.") from None
    return True


def release(folder: Path | None = None) -> None:
    """Release the lock of a folder; by default of all folders."""
    for place in list(_held) if folder is None else {Path(os.path.realpath(folder))} & _held.keys():
        unlock(*_held.pop(place))


@contextmanager
def sole_writer(folder: Path, *, make: bool = False) -> Iterator[None]:
    """Lock a folder during a ``with`` block; see `lock_folder`."""
    new = lock_folder(folder, make=make)
    try:
        yield
    finally:
        if new:
            release(folder)


def number_placed() -> int:
    """Number of files and folders that this process has placed outside its temporary folders, or is placing."""
    return _placed[0]


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file through a temporary one in the same folder, so that no reader sees a partial file.

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
    """Make a folder and its missing parents for a ``with`` block; if it fails, remove those that are new and empty.

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
            with suppress(OSError):  # it is not empty, or was not made
                place.rmdir()
        if isinstance(error, OSError) and not isinstance(error, OutputError):
            raise OutputError(f"{folder} cannot be written: {error.strerror}. Choose another folder.") from None
        raise


@contextmanager
def whole_folder(target: Path) -> Iterator[Path]:
    """New folder that moves to `target`, replacing an earlier folder, when the block ends without an error.

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
    """Reject a path that the system cannot represent."""
    try:
        os.access(path, os.F_OK)
    except ValueError as error:
        raise OutputError(f"{str(path)!r} cannot be written: {error}. Choose another name.") from None


def _place(new: Path, target: Path) -> None:
    if not is_temporary(target):
        _placed[0] += 1
    os.replace(new, target)
