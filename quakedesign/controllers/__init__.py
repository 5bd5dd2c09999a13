"""Control laws, one a file, found by looking into this folder; and the gains that the paper prints."""

import tomllib
from fractions import Fraction
from functools import cache
from importlib import import_module
from importlib.resources import files
from inspect import isabstract
from pkgutil import iter_modules

from quakedesign.controllers.base import Controller, LoopField, Signals
from quakedesign.controllers.sliding_mode import SlidingMode
from quakedesign.errors import UnknownNameError

__all__ = ["Controller", "LoopField", "Signals", "SlidingMode", "control_law", "control_laws", "family", "published"]


@cache
def control_laws() -> dict[str, type[Controller]]:
    """Every control law of the package, by name."""
    laws: dict[str, type[Controller]] = {}
    for info in iter_modules(__path__):
        module = import_module(f"{__name__}.{info.name}")
        for item in vars(module).values():
            if isinstance(item, type) and issubclass(item, Controller) and not isabstract(item):
                laws[item.name] = item
    return laws


def control_law(name: str) -> type[Controller]:
    """Control law of a given name.

    Raises
    ------
    UnknownNameError
    """
    laws = control_laws()
    if name not in laws:
        raise UnknownNameError(f"controller must be one of {', '.join(laws)}. Received {name!r}.")
    return laws[name]


def published(fault_name: str) -> dict[str, Controller]:
    """Controllers with the gains that the paper prints for a preset fault.

    Parameters
    ----------
    fault_name : str
        ``"real-fault"`` or ``"lab-fault"``; there are none for any other fault.

    Returns
    -------
    dict of str to Controller
        By name of the law; gains in the units of the law, divisor that of the laboratory fault.
    """
    data = tomllib.loads((files(__name__) / "published.toml").read_text(encoding="utf-8"))
    sets = {name: entry for name, entry in data.items() if isinstance(entry, dict)}
    found: dict[str, Controller] = {}
    for name, entry in sets.get(fault_name, {}).items():
        more = {k: v for k, v in entry.items() if k != "gains"}
        law = control_law(name)
        if issubclass(law, SlidingMode):
            more["divisor"] = data["divisor"]
        found[name] = law.from_values(tuple(entry["gains"]), **more)
    return found


def family(name: str) -> tuple[Fraction, tuple[Controller, ...]]:
    """Lipschitz bound and base gains of the sets that synthesis tries for a law, in order.

    Raises
    ------
    UnknownNameError
        When there are none for the law.
    """
    data = tomllib.loads((files(__name__) / "families.toml").read_text(encoding="utf-8"))
    if name not in data:
        raise UnknownNameError(f"base gains exist for {', '.join(data)}. Received {name!r}.")
    law = control_law(name)
    return Fraction(data[name]["lipschitz"]), tuple(law.from_values(tuple(g)) for g in data[name]["gains"])
