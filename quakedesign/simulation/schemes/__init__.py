"""Ways to carry a law out over a step, one a file, found by looking into this folder."""

from dataclasses import fields, is_dataclass
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from quakedesign.arguments import check_arguments
from quakedesign.errors import ParameterError
from quakedesign.simulation.schemes.base import Scheme

__all__ = ["Scheme", "schemes", "simulation_scheme"]


@cache
def schemes() -> dict[str, type[Scheme]]:
    """Every scheme of the package, by name."""
    found: dict[str, type[Scheme]] = {}
    for info in iter_modules(__path__):
        for item in vars(import_module(f"{__name__}.{info.name}")).values():
            if isinstance(item, type) and issubclass(item, Scheme) and hasattr(item, "name"):
                found[item.name] = item
    return found


def simulation_scheme(name: str, **settings: Any) -> Scheme:
    """Scheme of a given name, with settings other than its own defaults.

    Raises
    ------
    ParameterError
        When there is none, or it does not have one of the settings.
    """
    if name not in schemes():
        raise ParameterError(f"scheme must be one of {', '.join(sorted(schemes()))}. Received {name!r}.")
    kind = schemes()[name]
    known: set[str] = {field.name for field in fields(kind)} if is_dataclass(kind) else set()
    for setting in sorted(settings.keys() - known):
        able = [n for n, one in schemes().items() if is_dataclass(one) and setting in {f.name for f in fields(one)}]
        raise ParameterError(
            f"settings of {setting} are for the schemes {', '.join(sorted(able)) or 'of nobody'}. "
            f"Received {name}. Use one of them, or leave the settings out."
        )
    return kind(**settings)


check_arguments(__name__)
