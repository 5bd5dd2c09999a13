"""Disk cache of one user: compiled code, runs, figures and results of searches; no verdicts.

What is kept is found by its content alone: the question, the sources of this package, the versions of Python and of the
libraries, and the machine. So nothing is ever out of date. A search only proposes, here as elsewhere: what it proposed
is decided in exact arithmetic each time.

The folder is that of ``QUAKEDESIGN_CACHE`` (``off`` for none), else ``quakedesign`` in the user's folder for caches
(``XDG_CACHE_HOME``, ``~/.cache``; ``~/Library/Caches``). It is used if it belongs to this user and nobody else may
write it, and so is each file; a changed file is ignored. Files are written atomically, and the oldest are deleted when
their total size is too large. After any failure, as where nothing can be written, the work is done again.
"""

import io
import json
import os
import pickle
import platform
import stat
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import MappingProxyType
from typing import Any

PLACE = "QUAKEDESIGN_CACHE"
MOST_BYTES = 200_000_000
_LIBRARIES = (
    *("casadi", "clarabel", "control", "cvxpy", "numpy", "python-flint", "scipy", "sympy"),
    *("contourpy", "kiwisolver", "matplotlib", "pillow", "pyparsing"),  # of figures
)
_KERNEL = "OPENBLAS_CORETYPE"  # of linear algebra; its last digits depend on that
_DIGEST = sha256().digest_size
_PROCESSOR = Path("/proc/cpuinfo")
_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def switch_off() -> None:
    """Keep and take nothing from here on, in processes that this one starts as well."""
    os.environ[PLACE] = "off"


def in_use() -> bool:
    """Whether anything is kept."""
    return _folder() is not None


@cache
def shipped(path: Path) -> Any:
    """What a JSON file beside the code holds: found before, the same for every user, and compared anew by a test."""
    return json.loads(path.read_text(encoding="utf-8"))


def recall(kind: str, *question: bytes) -> bytes | None:
    """What was kept for a question, or None."""
    name = _name(kind, question)
    try:
        with open(os.open(_own_folder() / name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK), "rb") as file:
            told = os.fstat(file.fileno())
            if not stat.S_ISREG(told.st_mode) or not _own(told):
                return None
            content = file.read()
            with suppress(OSError):  # what is asked for again is not the oldest
                os.utime(file.fileno())
    except OSError:
        return None
    digest, rest = content[:_DIGEST], content[_DIGEST:]
    return rest if digest == _digest(name, rest) else None


def keep(kind: str, content: bytes, *question: bytes) -> None:
    """Keep the answer to a question for `recall`, if there is a place for it."""
    name = _name(kind, question)
    with suppress(OSError):
        folder = _own_folder(make=True)
        descriptor, new = tempfile.mkstemp(prefix=".", dir=folder)
        try:
            with open(descriptor, "wb") as file:
                file.write(_digest(name, content) + content)
            os.replace(new, folder / name)
        except BaseException:
            with suppress(OSError):
                os.unlink(new)
            raise
        _make_room(folder)


def once(kind: str, work: Callable[[], bytes], *question: bytes) -> bytes:
    """Answer to a question: what was kept, else what work gives, which is kept."""
    if (known := recall(kind, *question)) is None:
        known = work()
        keep(kind, known, *question)
    return known


def search_once(search: Callable[[], Any], *question: Any) -> Any:
    """What a search found for a question before, or finds now: numbers, texts, lists, as JSON has them.

    Parameters
    ----------
    search : callable
        It depends on the question alone, and what it finds is not trusted.
    *question
        Values that say everything; what cannot be pickled is searched each time.
    """
    asked = stated(question) if in_use() else None
    return search() if asked is None else json.loads(once("search", lambda: json.dumps(search()).encode(), asked))


class CachedStatement(pickle.Pickler):
    """A value by its fields alone: what was computed of it on the way and is kept beside them says nothing more."""

    def field(self, value: Any, name: str) -> Any:
        """What is written of a field."""
        return getattr(value, name)

    def reducer_override(self, value: Any) -> Any:
        """Text of a value given by its fields or its items."""
        if isinstance(value, MappingProxyType):
            return dict, (tuple(value.items()),)
        if not is_dataclass(value) or isinstance(value, type):
            return NotImplemented
        return type(value), tuple(self.field(value, field.name) for field in fields(value))


def stated(value: Any, writer: type[CachedStatement] = CachedStatement) -> bytes | None:
    """The arguments of a computation in bytes; None if they have no such form."""
    content = io.BytesIO()
    try:
        writer(content).dump(value)
    except (pickle.PicklingError, AttributeError, TypeError, ValueError, RecursionError):
        return None
    return content.getvalue()


def _folder() -> Path | None:
    told = os.environ.get(PLACE)
    if told == "off" or sys.platform == "win32":  # folders have no owners there that could be asked for
        return None
    if told:
        return Path(told).absolute()
    shared = os.environ.get("XDG_CACHE_HOME", "")
    if os.path.isabs(shared):
        return Path(shared) / "quakedesign"
    with suppress(RuntimeError):  # a user without a home
        return Path.home() / ("Library/Caches" if sys.platform == "darwin" else ".cache") / "quakedesign"
    return None


def _own_folder(*, make: bool = False) -> Path:
    """Return the folder.

    Raises
    ------
    OSError
        When there is none, or it is somebody else's, or others may write it.
    """
    place = _folder()
    if place is None:
        raise FileNotFoundError(PLACE)
    if make:
        place.parent.mkdir(parents=True, exist_ok=True)
        place.mkdir(mode=0o700, exist_ok=True)
    told = place.lstat()
    if not stat.S_ISDIR(told.st_mode) or not _own(told):
        raise PermissionError(place)
    return place


def _own(told: os.stat_result) -> bool:
    """Whether something is of this user, and nobody else may write it."""
    return told.st_uid == os.getuid() and not told.st_mode & _OTHERS


def _make_room(folder: Path) -> None:
    """Remove the oldest files until three quarters of the room are left, if there is too much."""
    with os.scandir(folder) as entries:
        files = [(entry.stat(follow_symlinks=False), entry.path) for entry in entries]
    size = sum(told.st_size for told, _ in files)
    if size <= MOST_BYTES:
        return
    for told, path in sorted(files, key=lambda file: file[0].st_mtime):
        if size <= MOST_BYTES * 3 // 4:
            break
        with suppress(OSError):  # another process was here first
            os.unlink(path)
        size -= told.st_size


def _name(kind: str, question: tuple[bytes, ...]) -> str:
    parts = b"".join(sha256(part).digest() for part in question)
    return f"{kind}-{sha256(_here() + parts).hexdigest()}"


def _digest(name: str, content: bytes) -> bytes:
    return sha256(name.encode() + content).digest()


@cache
def _here() -> bytes:
    """Digest of everything that an answer depends on beside its question."""
    lines = [sys.version, platform.platform(), platform.node(), _features(), os.environ.get(_KERNEL, "")]
    lines += [f"{name} {_version(name)}" for name in _LIBRARIES]
    here, package = sha256(repr(lines).encode()), Path(__file__).parent
    for file in sorted(path for path in package.rglob("*") if path.is_file() and path.suffix not in (".pyc", ".pyo")):
        here.update(sha256(str(file.relative_to(package)).encode()).digest() + sha256(file.read_bytes()).digest())
    return here.digest()


def _features() -> str:
    """What the processor can do: the C library computes with it, and its last digits depend on that."""
    with suppress(OSError):
        lines = _PROCESSOR.read_text(errors="replace").splitlines()
        return next((line for line in lines if line.startswith(("flags", "Features"))), "")
    return platform.processor()


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"
