"""Laws, one a file, found by looking into this folder; and the gains that the paper prints."""

import tomllib
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from importlib.resources import files

from quakedesign.arguments import check_arguments
from quakedesign.controllers.base import Controller, Law, LoopField, Sampling, Signals
from quakedesign.controllers.sliding_mode import SlidingMode
from quakedesign.discovery import discovered
from quakedesign.errors import UnknownNameError

__all__ = [
    "BaseGains",
    "Controller",
    "Law",
    "LoopField",
    "Sampling",
    "Signals",
    "SlidingMode",
    "Subject",
    "control_law",
    "control_laws",
    "family",
    "law",
    "laws",
    "model_of",
    "published",
]

Subject = str | type[Law] | LoopField
"""What a claim can be about: the name of a law of the package, a law of the user's own, or a bare closed loop."""
BARE = "custom"


@dataclass(frozen=True, slots=True, kw_only=True)
class BaseGains:
    """Gains of a law with λ = 1, the bound on |h'| that they are meant for, and where they come from.

    Attributes
    ----------
    law : Controller
    lipschitz : Fraction
        [m/s³]
    source : str
    literature : bool
        False for gains that were found with this package.
    """

    law: Controller
    lipschitz: Fraction
    source: str
    literature: bool


@cache
def laws() -> dict[str, type[Law]]:
    """Every law of the package by name, those included that act on other plants than a fault and are only proved."""
    return discovered(__name__, Law)


def law(name: str) -> type[Law]:
    """Law of a given name.

    Raises
    ------
    UnknownNameError
    """
    if name not in laws():
        raise UnknownNameError(f"controller must be one of {', '.join(laws())}. Received {name!r}.")
    return laws()[name]


@cache
def control_laws() -> dict[str, type[Controller]]:
    """Every law of the package that acts on the slip of a fault, by name."""
    return {name: item for name, item in laws().items() if issubclass(item, Controller)}


def control_law(name: str) -> type[Controller]:
    """Control law of a given name.

    Raises
    ------
    UnknownNameError
    """
    known = control_laws()
    if name not in known:
        raise UnknownNameError(f"controller must be one of {', '.join(known)}. Received {name!r}.")
    return known[name]


def model_of(subject: Subject) -> tuple[str, LoopField]:
    """Name and closed loop of what a claim is about; a bare loop is called ``custom``.

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
        chosen = control_law(name)
        if issubclass(chosen, SlidingMode):
            more["divisor"] = data["divisor"]
        found[name] = chosen.from_values(tuple(entry["gains"]), **more)
    return found


def family(name: str) -> tuple[BaseGains, ...]:
    """Base gains of a law that are known to be good, in the order in which a design tries them.

    Raises
    ------
    UnknownNameError
        When there are none for the law.
    """
    data = tomllib.loads((files(__name__) / "families.toml").read_text(encoding="utf-8")).values()
    if name not in (known := {group["law"] for group in data}):
        raise UnknownNameError(f"base gains exist for {', '.join(sorted(known))}. Received {name!r}.")
    chosen = control_law(name)
    return tuple(
        BaseGains(
            law=chosen.from_values(tuple(gains)),
            lipschitz=Fraction(group["lipschitz"]),
            source=group["source"],
            literature=group["literature"],
        )
        for group in data
        if group["law"] == name
        for gains in group["gains"]
    )


check_arguments(__name__)
