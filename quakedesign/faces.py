"""The face of a room: its public names, each loaded when it is asked for, and checking its arguments from then on.

A room imports its public names under ``TYPE_CHECKING``, each as itself, where tools and people find them, and ends in
``face``, which makes them its ``__all__``.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import Any

from quakedesign.arguments import check_arguments, checked, imported_for_types

_CLASSES: dict[str, list[str]] = {}
"""Public names by the module that defines them: its classes check their arguments as soon as it is loaded."""


class _Face(ModuleType):
    """A room whose public names are loaded when they are asked for."""

    _homes: dict[str, str]

    def __getattr__(self, name: str) -> Any:
        if name not in self._homes:
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
        value = checked(getattr(import_module(self._homes[name]), name))
        self.__dict__[name] = value
        return value

    def __setattr__(self, name: str, value: Any) -> None:
        """Take a module of the room that Python has loaded; a public name of the same spelling goes before it."""
        if isinstance(value, ModuleType) and value.__name__ == f"{self.__name__}.{name}":
            for public in _CLASSES.get(value.__name__, ()):
                if isinstance(vars(value).get(public), type):
                    checked(vars(value)[public])
            if name in self._homes:
                return
        super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        return sorted({*self.__dict__, *self._homes})


def face(room: str, **elsewhere: str) -> None:
    """Load the public names of a room when they are asked for; those that it has already check their arguments too.

    Parameters
    ----------
    room : str
        Name of the package.
    **elsewhere : str
        Where those names are defined that it does not import for type checkers.
    """
    module = sys.modules[room]
    homes = imported_for_types(room) | elsewhere
    for name, home in homes.items():
        _CLASSES.setdefault(home, []).append(name)
    module.__dict__.update(_homes=homes, __all__=sorted(homes, key=lambda name: (name.islower(), name)))
    module.__class__ = _Face
    check_arguments(room)
