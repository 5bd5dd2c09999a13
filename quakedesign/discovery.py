"""Discovery of extensions: classes in a folder of the package, or in a user-defined module."""

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from importlib import import_module
from inspect import isabstract, isclass
from pkgutil import iter_modules
from traceback import walk_tb
from typing import Any, TypeVar, cast

from quakedesign.errors import QuakedesignError, UnknownNameError, UserCodeError, require_known
from quakedesign.text import shown

Kind = TypeVar("Kind")
_allowed: ContextVar[bool] = ContextVar("allowed", default=False)
_imported: set[str] = set()
"""Names of the user-defined modules whose classes have been loaded by `named`."""
_OURS = {__name__.partition(".")[0], *sys.stdlib_module_names}  # this package and the standard library


def discovered(package: str, kind: type) -> dict[str, Any]:
    """Concrete subclasses of `kind` in the modules of a package, by their attribute `name`; others are omitted."""
    kinds: dict[str, Any] = {}
    for info in iter_modules(import_module(package).__path__):
        own = vars(import_module(f"{package}.{info.name}")).values()
        items = [item for item in own if isinstance(item, type) and issubclass(item, kind)]
        kinds |= {item.name: item for item in items if hasattr(item, "name") and not isabstract(item)}
    return dict(sorted(kinds.items()))


def allow_code(allowed: bool) -> None:
    """Allow or forbid files to name code as ``module:Class``; allowed only at the user's request."""
    _allowed.set(allowed)


@contextmanager
def user_code() -> Iterator[None]:
    """Turn every exception of user code into a `UserCodeError`, except interruptions and errors of quakedesign."""
    try:
        yield
    except (KeyboardInterrupt, MemoryError, QuakedesignError):
        raise
    except BaseException as error:
        if (module := _raised_by(error)) is None:
            raise
        raise UserCodeError(f"{module} fails with {type(error).__name__}: {error}. Fix its code.") from error


def _raised_by(error: BaseException) -> str | None:
    """Name of the user module in the traceback of an error, or None.

    For an error that is not an `Exception`, which only user code raises, "a user-defined module" if no name is known.
    """
    through = [str(frame.f_globals.get("__name__")) for frame, _ in walk_tb(error.__traceback__)]
    # rich exits at a closed pipe
    by_others = isinstance(error, Exception) or not _imported or through[-1].startswith("rich.")
    others = None if by_others else "a user-defined module"
    return next((module for module in reversed(through) if module in _imported), others)


def named(
    name: str, known: Mapping[str, type[Kind]], kind: type, what: str, *, in_file: bool = False, code: bool = False
) -> type[Kind]:
    """Class registered under a name, or a user-defined class ``module:Class`` of a module that can be imported.

    Parameters
    ----------
    name : str
        Name, or ``module:Class``.
    known : mapping of str to type
        Classes of the package.
    kind : type
        Base class of a user-defined class.
    what : str
        Description for the message.
    in_file : bool
        Whether the name is in a file, which may be untrusted: it imports nothing unless code is allowed.
    code : bool
        Whether the caller allows code, as `allow_code` does for a whole command.

    Raises
    ------
    UnknownNameError
        For an unknown name, a module or class that cannot be imported, a class in ``__main__`` or not of the kind, or
        code named in a file without permission.
    """
    if name in known:
        return known[name]
    module, own, attribute = name.partition(":")
    if not own:
        require_known(name, known, what, UnknownNameError)
    if in_file and not (code or _allowed.get()):
        raise UnknownNameError(
            f"{what} in a file must be one of {', '.join(known)}. Received {shown(name)}, which runs code of that "
            "module. If you trust the file, add --allow-code, or allow_code=True in Python."
        )
    if "__main__" in module.split("."):
        raise UnknownNameError(f"{what} must not be in __main__. Received {shown(name)}. Move it to another module.")
    if "" not in sys.path:  # an installed script does not search the current folder
        sys.path.append("")
    try:
        loaded: Any = getattr(import_module(module), attribute)
    except (KeyboardInterrupt, MemoryError):
        raise
    except BaseException as error:  # from user code: SystemExit would set the exit code
        raise UnknownNameError(
            f"{what} must be module:Class of a module that can be imported. Received {shown(name)}, which fails with "
            f"{type(error).__name__}: {error}. Run in the folder of the module, or add it to PYTHONPATH."
        ) from error
    if not isclass(loaded) or not issubclass(loaded, kind) or isabstract(loaded) or not hasattr(loaded, "name"):
        raise UnknownNameError(
            f"{what} must be a concrete class derived from {kind.__name__}, with an attribute name. "
            f"Received {shown(name)}. Define its abstract methods and name."
        )
    _imported.update(base.__module__ for base in loaded.__mro__ if base.__module__.partition(".")[0] not in _OURS)
    return cast(type[Kind], loaded)
