"""What stands one a file in a folder, found by looking into it; and what users add, found by its module."""

import sys
from collections.abc import Collection, Mapping
from importlib import import_module
from inspect import isabstract, isclass
from pkgutil import iter_modules
from typing import Any, TypeVar, cast

from quakedesign.errors import UnknownNameError, require_known
from quakedesign.text import shown

Kind = TypeVar("Kind")


def discovered(package: str, kind: type, shared: Collection[str] | None = None) -> dict[str, Any]:
    """Every class of a kind in the modules of a package that can be built and has a name, by name.

    Parameters
    ----------
    package : str
    kind : type
    shared : collection of str, optional
        Modules that need none; unless given, none of them does.

    Raises
    ------
    ImportError
        For another module that defines none, so that a file does not go unheard.
    """
    kinds: dict[str, Any] = {}
    for info in iter_modules(import_module(package).__path__):
        module = import_module(f"{package}.{info.name}")
        own = [item for item in vars(module).values() if isinstance(item, type) and issubclass(item, kind)]
        if shared is not None and info.name not in shared and all(i.__module__ != module.__name__ for i in own):
            raise ImportError(f"{module.__name__} defines no {kind.__name__}")
        kinds |= {item.name: item for item in own if hasattr(item, "name") and not isabstract(item)}
    return kinds


def named(name: str, known: Mapping[str, type[Kind]], kind: type, what: str) -> type[Kind]:
    """Class of a name, or of the user's own: ``module:Class`` of a module that can be imported from here.

    Parameters
    ----------
    name : str
    known : mapping of str to type
        What the package has.
    kind : type
        What a class of the user's own derives from.
    what : str
        For the message.

    Raises
    ------
    UnknownNameError
        For an unknown name, or a module or class that cannot be had.
    """
    if name in known:
        return known[name]
    module, own, attribute = name.partition(":")
    if not own:
        require_known(name, known, what, UnknownNameError)
    if "" not in sys.path:  # a script that is installed does not look where it is started
        sys.path.append("")
    try:
        found: Any = getattr(import_module(module), attribute)
    except Exception as error:
        raise UnknownNameError(
            f"{what} must be module:Class of a module that can be imported. Received {shown(name)}, which fails with "
            f"{type(error).__name__}: {error}. Start where the module lies, or put it on PYTHONPATH."
        ) from error
    if not isclass(found) or not issubclass(found, kind) or isabstract(found) or not hasattr(found, "name"):
        raise UnknownNameError(
            f"{what} must be a class with a name that derives from {kind.__name__} and leaves nothing abstract. "
            f"Received {shown(name)}. Complete it."
        )
    return cast(type[Kind], found)
