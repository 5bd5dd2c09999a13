"""Fixed-step integrators, one a file, found by looking into this folder."""

from functools import cache
from importlib import import_module
from pkgutil import iter_modules

from quakedesign.errors import ParameterError
from quakedesign.simulation.integrators.base import Integrator

__all__ = ["Integrator", "integrator", "integrators"]


@cache
def integrators() -> dict[str, type[Integrator]]:
    """Every integrator of the package, by name."""
    found: dict[str, type[Integrator]] = {}
    for info in iter_modules(__path__):
        for item in vars(import_module(f"{__name__}.{info.name}")).values():
            if isinstance(item, type) and issubclass(item, Integrator) and hasattr(item, "name"):
                found[item.name] = item
    return found


def integrator(name: str) -> type[Integrator]:
    """Integrator of a given name.

    Raises
    ------
    ParameterError
        When there is none.
    """
    if name not in integrators():
        raise ParameterError(f"method must be one of {', '.join(sorted(integrators()))}. Received {name!r}.")
    return integrators()[name]
