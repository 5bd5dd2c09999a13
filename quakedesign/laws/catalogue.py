"""Control laws by name, discovered in this package, and the published gains."""

import tomllib
from dataclasses import replace
from functools import cache
from importlib.resources import files

from quakedesign.discovery import discovered, named
from quakedesign.exact import rational
from quakedesign.laws.base import BaseGains, Controller, Law
from quakedesign.laws.loop_field import LoopField

_OF_MATRICES = "sampled", "stick-slip", "user-law"
"""Laws that are not defined by an ordered list of gains."""
Subject = str | type[Law] | LoopField
"""What a claim can be about: the name of a law of the package, a user-defined law, or a bare closed loop."""
BARE = "custom"


@cache
def laws() -> dict[str, type[Law]]:
    """Laws of the package that are defined by a list of gains, by name; not all of them control a fault."""
    classes = discovered(__package__, Law)
    return {name: law for name, law in classes.items() if name not in _OF_MATRICES}


def law(name: str) -> type[Law]:
    """Law by name, or a user-defined one as ``module:Class``."""
    return named(name, laws(), Law, "controller")


@cache
def control_laws() -> dict[str, type[Controller]]:
    """Every law of the package that acts on the slip of a fault, by name."""
    return {name: item for name, item in laws().items() if issubclass(item, Controller)}


def control_law(name: str | type[Controller]) -> type[Controller]:
    """Control law by name, or a user-defined one as a class or as ``module:Class``."""
    return named(name, control_laws(), Controller, "controller") if isinstance(name, str) else name


def model_of(subject: Subject) -> tuple[str, LoopField]:
    """Name and closed loop of the subject of a claim; a bare loop is called ``custom``.

    Raises
    ------
    UnknownNameError
        For a name that the package does not know.
    """
    if isinstance(subject, LoopField):
        return BARE, subject
    chosen = law(subject) if isinstance(subject, str) else subject
    return chosen.name, chosen.loop_field()


def published(fault_name: str) -> dict[str, Controller]:
    """Controllers with the gains that the paper prints for a preset fault.

    Parameters
    ----------
    fault_name : str
        ``"real-fault"`` or ``"lab-fault"``; the result is empty for any other fault.

    Returns
    -------
    dict of str to Controller
        By name of the law; gains in the units of the law, with the divisor of the laboratory fault.
    """
    data = tomllib.loads((files(__package__) / "published.toml").read_text(encoding="utf-8"))
    sets = {name: entry for name, entry in data.items() if isinstance(entry, dict)}
    controllers: dict[str, Controller] = {}
    for name, entry in sets.get(fault_name, {}).items():
        more = {k: v for k, v in entry.items() if k != "gains"}
        printed = control_law(name).for_authority(tuple(entry["gains"]), rational(data["divisor"]))
        controllers[name] = replace(printed, gains=dict(printed.gains), **more)
    return controllers


def family(name: str) -> tuple[BaseGains[Law], ...]:
    """Base gains of a law with a proof, in the order in which a design tries them.

    Raises
    ------
    UnknownNameError
        When there are none for the law.
    """
    return law(name).base_gains()
