"""Temporary folders, each locked by the process that made it; what a killed process left goes at the next start."""

import os
import platform
import secrets
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from time import sleep

if sys.platform != "win32":
    import fcntl

FAMILY = ".quakedesign-"
"""Beginning of the names of temporary folders."""
PREFIX = f"{FAMILY}{sha256(platform.node().encode()).hexdigest()[:8]}-"
"""The same on this machine: on a disk shared by many, a lock may be known to one of them only."""
ASIDE = "aside"
"""What lies in this folder of a temporary folder has been moved there, and goes back where its place is empty."""

_SWEPT = -1
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
    folder, lock = _made((parent or Path(tempfile.gettempdir())).absolute())
    try:
        yield folder
    finally:
        _discard(folder)
        if lock is not None:
            os.close(lock)


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
    for trial in range(_TRIALS):
        try:
            folder.mkdir(mode=0o700, exist_ok=True)
            lock = _locked(folder)
            if os.path.samestat(os.fstat(lock), os.stat(folder)):
                _mine.add(folder)
                return folder, lock
            os.close(lock)
        except BlockingIOError:  # held, or swept at this moment
            if trial == _TRIALS - 1:
                raise
            sleep(_PAUSE)
        except FileNotFoundError:
            continue
        except OSError:
            break
    return folder, None


def unlock(folder: Path, lock: int | None) -> None:
    """Give back what `lock_of` gave."""
    if lock is not None:
        _discard(folder)
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


def _made(parent: Path) -> tuple[Path, int | None]:
    """New folder and its lock, None where the file system has no locks."""
    while True:
        folder = parent / f"{PREFIX}{secrets.token_hex(8)}"
        _mine.add(folder)
        try:
            folder.mkdir(mode=0o700)
        except BaseException:
            _mine.discard(folder)
            raise
        lock = _locks(folder)
        if lock != _SWEPT:
            return folder, lock
        _mine.discard(folder)


def _locks(folder: Path) -> int | None:
    """Descriptor of the lock of a new folder; None without locks, `_SWEPT` where another process was here first."""
    try:
        lock = _locked(folder)
    except (BlockingIOError, FileNotFoundError):
        return _SWEPT
    except OSError:
        return None
    if folder.exists():
        return lock
    os.close(lock)
    return _SWEPT


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
    for held in (folder / ASIDE).glob("*"):
        if not (place := folder.parent / held.name).exists():
            os.replace(held, place)
    shutil.rmtree(folder, ignore_errors=True)
    _mine.discard(folder)
