"""Disk cache of one user: compiled code, runs, figures and results of searches; no verdicts.

The key of an entry is a digest of the input data, the sources of this package, the versions of Python and of the
libraries, and the machine. So no entry is ever out of date. A search only proposes candidates: exact arithmetic decides
on them each time.

The folder is ``QUAKEDESIGN_CACHE`` if set (``off`` for no cache), else ``quakedesign`` in ``XDG_CACHE_HOME`` if set,
else in ``~/.cache`` (``~/Library/Caches`` on macOS). There is no cache on Windows. Folder and files are used only if
they belong to this user and no other user may write them; a corrupt file is ignored. Files are written atomically, and
the oldest are deleted if their total size exceeds 200 MB. After a failure, such as a folder without write permission,
the result is computed anew.
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
    *("contourpy", "kiwisolver", "matplotlib", "pillow", "pyparsing"),  # for figures
)
_KERNEL = "OPENBLAS_CORETYPE"  # kernel of linear algebra, on which rounding depends
_DIGEST = sha256().digest_size
_PROCESSOR = Path("/proc/cpuinfo")
_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def switch_off() -> None:
    """Switch the cache off, also for processes that this one starts."""
    os.environ[PLACE] = "off"


def in_use() -> bool:
    """Whether the cache is in use."""
    return _folder() is not None


@cache
def shipped(path: Path) -> Any:
    """Content of a JSON file of the package: precomputed results, equal for every user, and re-checked by a test."""
    return json.loads(path.read_text(encoding="utf-8"))


def load(kind: str, *key: bytes) -> bytes | None:
    """Cached result for a key, or None."""
    name = _name(kind, key)
    try:
        with open(os.open(_own_folder() / name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK), "rb") as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode) or not _owned(status):
                return None
            content = file.read()
            with suppress(OSError):  # reading renews the time of an entry, so that `_evict` deletes it later
                os.utime(file.fileno())
    except OSError:
        return None
    digest, rest = content[:_DIGEST], content[_DIGEST:]
    return rest if digest == _digest(name, rest) else None


def store(kind: str, content: bytes, *key: bytes) -> None:
    """Cache the result for a key, for `load`, if the cache is in use."""
    name = _name(kind, key)
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
        _evict(folder)


def once(kind: str, work: Callable[[], bytes], *key: bytes) -> bytes:
    """Cached result for a key, else the result of `work`, which is then cached."""
    if (content := load(kind, *key)) is None:
        content = work()
        store(kind, content, *key)
    return content


def search_once(search: Callable[[], Any], *inputs: Any) -> Any:
    """Cached or new result of a search: JSON-able numbers, texts and lists.

    Parameters
    ----------
    search : callable
        Depends only on the inputs, and its result is not trusted.
    *inputs
        All input values of the search; if they cannot be pickled, the search runs each time.
    """
    key = stated(inputs) if in_use() else None
    return search() if key is None else json.loads(once("search", lambda: json.dumps(search()).encode(), key))


class CachedStatement(pickle.Pickler):
    """Pickler of a value by its fields alone; cached properties of the value are ignored."""

    def field(self, value: Any, name: str) -> Any:
        """Value that is pickled for a field."""
        return getattr(value, name)

    def reducer_override(self, value: Any) -> Any:
        """Reduction of a dataclass to its fields, and of a read-only mapping to its items."""
        if isinstance(value, MappingProxyType):
            return dict, (tuple(value.items()),)
        if not is_dataclass(value) or isinstance(value, type):
            return NotImplemented
        return type(value), tuple(self.field(value, field.name) for field in fields(value))


def stated(value: Any, writer: type[CachedStatement] = CachedStatement) -> bytes | None:
    """Bytes of a value, for use as a key; None if it cannot be pickled."""
    content = io.BytesIO()
    try:
        writer(content).dump(value)
    except (pickle.PicklingError, AttributeError, TypeError, ValueError, RecursionError):
        return None
    return content.getvalue()


def _folder() -> Path | None:
    setting = os.environ.get(PLACE)
    if setting == "off" or sys.platform == "win32":  # Windows folders have no owner to check
        return None
    if setting:
        return Path(setting).absolute()
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
        When it does not exist, belongs to another user, or others may write it.
    """
    place = _folder()
    if place is None:
        raise FileNotFoundError(PLACE)
    if make:
        place.parent.mkdir(parents=True, exist_ok=True)
        place.mkdir(mode=0o700, exist_ok=True)
    status = place.lstat()
    if not stat.S_ISDIR(status.st_mode) or not _owned(status):
        raise PermissionError(place)
    return place


def _owned(status: os.stat_result) -> bool:
    """Whether a file or folder belongs to this user, and no other user may write it."""
    return status.st_uid == os.getuid() and not status.st_mode & _OTHERS


def _evict(folder: Path) -> None:
    """Remove the oldest files, if the total size is too large, until it is three quarters of the limit."""
    with os.scandir(folder) as entries:
        files = [(entry.stat(follow_symlinks=False), entry.path) for entry in entries]
    size = sum(status.st_size for status, _ in files)
    if size <= MOST_BYTES:
        return
    for status, path in sorted(files, key=lambda file: file[0].st_mtime):
        if size <= MOST_BYTES * 3 // 4:
            break
        with suppress(OSError):  # another process has removed it
            os.unlink(path)
        size -= status.st_size


def _name(kind: str, key: tuple[bytes, ...]) -> str:
    parts = b"".join(sha256(part).digest() for part in key)
    return f"{kind}-{sha256(_here() + parts).hexdigest()}"


def _digest(name: str, content: bytes) -> bytes:
    return sha256(name.encode() + content).digest()


@cache
def _here() -> bytes:
    """Digest of everything other than its key on which a result depends."""
    lines = [sys.version, platform.platform(), platform.node(), _features(), os.environ.get(_KERNEL, "")]
    lines += [f"{name} {_version(name)}" for name in _LIBRARIES]
    here, package = sha256(repr(lines).encode()), Path(__file__).parent
    for file in sorted(path for path in package.rglob("*") if path.is_file() and path.suffix not in (".pyc", ".pyo")):
        here.update(sha256(str(file.relative_to(package)).encode()).digest() + sha256(file.read_bytes()).digest())
    return here.digest()


def _features() -> str:
    """Instruction sets of the processor: the C library uses them, and its rounding depends on them."""
    with suppress(OSError):
        lines = _PROCESSOR.read_text(errors="replace").splitlines()
        return next((line for line in lines if line.startswith(("flags", "Features"))), "")
    return platform.processor()


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"
