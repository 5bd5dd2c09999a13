"""What stands one a file in a folder, found by looking into it."""

from collections.abc import Collection
from importlib import import_module
from inspect import isabstract
from pkgutil import iter_modules
from typing import Any


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
    found: dict[str, Any] = {}
    for info in iter_modules(import_module(package).__path__):
        module = import_module(f"{package}.{info.name}")
        own = [item for item in vars(module).values() if isinstance(item, type) and issubclass(item, kind)]
        if shared is not None and info.name not in shared and all(i.__module__ != module.__name__ for i in own):
            raise ImportError(f"{module.__name__} defines no {kind.__name__}")
        found |= {item.name: item for item in own if hasattr(item, "name") and not isabstract(item)}
    return found
