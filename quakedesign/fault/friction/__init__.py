"""Friction laws, one a file, found by looking into this folder."""

from functools import cache

from quakedesign.arguments import checked
from quakedesign.discovery import discovered, named
from quakedesign.fault.friction.base import FrictionLaw

__all__ = ["FrictionLaw", "friction_law", "friction_laws"]


@cache
def friction_laws() -> dict[str, type[FrictionLaw]]:
    """Every friction law of the package, by name; a module of this folder that defines none is an error.

    A law that cannot be built (an abstract class, for others to derive from) counts for its module but is not listed.
    """
    return discovered(__name__, FrictionLaw, shared=("base", "weakening"))


@checked
def friction_law(name: str, *, in_file: bool = False, allow_code: bool = False) -> type[FrictionLaw]:
    """Friction law of a given name, or of the user's own as ``module:Class``.

    Parameters
    ----------
    in_file : bool
        The name stands in a file: it may be one of the package only, unless code is allowed.
    allow_code : bool
        Whether it is.

    Raises
    ------
    UnknownNameError
        When there is none.
    """
    return named(name, friction_laws(), FrictionLaw, "friction law", in_file=in_file, code=allow_code)
