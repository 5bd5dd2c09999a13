"""Friction laws, discovered in the modules of this package."""

from functools import cache

from quakedesign.arguments import checked
from quakedesign.discovery import discovered, named
from quakedesign.fault.friction.base import FrictionLaw

__all__ = ["FrictionLaw", "friction_law", "friction_laws"]


@cache
def friction_laws() -> dict[str, type[FrictionLaw]]:
    """Every friction law of the package by name, without abstract base classes."""
    return discovered(__name__, FrictionLaw)


@checked
def friction_law(name: str, *, in_file: bool = False, allow_code: bool = False) -> type[FrictionLaw]:
    """Friction law of a given name, or a user-defined one as ``module:Class``.

    Parameters
    ----------
    name : str
    in_file : bool
        Whether the name comes from a file, which may name only laws of the package unless code is allowed.
    allow_code : bool
        Whether a file may name user-defined code.

    Raises
    ------
    UnknownNameError
        For an unknown name, or a user-defined law in a file without `allow_code`.
    """
    return named(name, friction_laws(), FrictionLaw, "friction law", in_file=in_file, code=allow_code)
