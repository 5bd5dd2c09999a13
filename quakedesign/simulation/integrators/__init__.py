"""Integrators, one a file, found by looking into this folder: with a fixed step, or with one of their own choice."""

from functools import cache

from quakedesign.arguments import check_arguments
from quakedesign.discovery import discovered
from quakedesign.errors import ParameterError, require_known
from quakedesign.simulation.integrators.adaptive import AdaptiveIntegrator
from quakedesign.simulation.integrators.base import Integrator
from quakedesign.text import nearest_name

__all__ = ["AdaptiveIntegrator", "Integrator", "adaptive_integrators", "any_integrator", "integrator", "integrators"]


@cache
def integrators() -> dict[str, type[Integrator]]:
    """Every integrator with a fixed step, by name."""
    return discovered(__name__, Integrator)


@cache
def adaptive_integrators() -> dict[str, type[AdaptiveIntegrator]]:
    """Every integrator with a step of its own choice, by name."""
    return discovered(__name__, AdaptiveIntegrator)


def integrator(name: str) -> type[Integrator]:
    """Integrator with a fixed step of a given name.

    Raises
    ------
    ParameterError
        When there is none.
    """
    require_known(name, sorted(integrators()), "method")
    return integrators()[name]


def any_integrator(name: str) -> type[Integrator] | type[AdaptiveIntegrator]:
    """Integrator of a given name, of either kind.

    Raises
    ------
    ParameterError
        When there is none.
    """
    known = integrators() | adaptive_integrators()
    if name not in known:
        raise ParameterError(
            f"method must be one of {', '.join(sorted(integrators()))} (fixed step) or "
            f"{', '.join(sorted(adaptive_integrators()))} (to a tolerance, smooth loops). Received {name!r}."
            f"{nearest_name(name, known)}"
        )
    return known[name]


check_arguments(__name__)
