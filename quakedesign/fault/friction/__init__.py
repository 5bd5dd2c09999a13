"""Friction laws, one a file, found by looking into this folder."""

from functools import cache

from quakedesign.arguments import check_arguments
from quakedesign.discovery import discovered, named
from quakedesign.fault.friction.base import FrictionLaw

__all__ = ["FrictionLaw", "friction_law", "friction_laws"]


@cache
def friction_laws() -> dict[str, type[FrictionLaw]]:
    """Every friction law of the package, by name; a module of this folder that defines none is an error.

    A law that cannot be built (an abstract class, for others to derive from) counts for its module but is not listed.
    """
    return discovered(__name__, FrictionLaw, shared=("base", "weakening"))


def friction_law(name: str) -> type[FrictionLaw]:
    """Friction law of a given name, or of the user's own as ``module:Class``.

    Raises
    ------
    UnknownNameError
        When there is none.
    """
    return named(name, friction_laws(), FrictionLaw, "friction law")


check_arguments(__name__)
