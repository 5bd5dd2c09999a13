"""Discretisation schemes of a control law, discovered in the modules of this package."""

from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any

from quakedesign.arguments import checked
from quakedesign.discovery import discovered, named
from quakedesign.errors import ParameterError, require_known
from quakedesign.laws import Controller
from quakedesign.loop.schemes.base import Scheme, Stepped

__all__ = ["Scheme", "Stepped", "scheme_of_run", "schemes", "simulation_scheme"]


@cache
def schemes() -> dict[str, type[Scheme]]:
    """Every scheme of the package, by name."""
    return discovered(__name__, Scheme)


@checked
def simulation_scheme(name: str, **settings: Any) -> Scheme:
    """Scheme by name, or a user-defined one as ``module:Class``, with the given settings.

    Raises
    ------
    ParameterError
        For an unknown scheme, or a setting that the scheme does not have.
    """
    if ":" not in name:
        require_known(name, sorted(schemes()), "scheme")
    kind = named(name, schemes(), Scheme, "scheme")
    names: set[str] = {field.name for field in fields(kind)} if is_dataclass(kind) else set()
    for setting in sorted(settings.keys() - names):
        able = [n for n, one in schemes().items() if is_dataclass(one) and setting in {f.name for f in fields(one)}]
        raise ParameterError(
            f"{setting} is a setting of {', '.join(sorted(able)) or 'no scheme'}. "
            f"Received it with the scheme {name}. Use another scheme, or omit {setting}."
        )
    return kind(**settings)


@checked
def scheme_of_run(
    controller: Controller | None, scheme: str | Scheme | None, step: float | None, usual: str = "explicit"
) -> tuple[str | Scheme, float | None, dict[str, Any]]:
    """Scheme and step of a run; a sampled law has its own scheme, step and settings.

    Raises
    ------
    ParameterError
        When another scheme or step is requested for a sampled law.
    """
    own = controller.sampling if controller else None
    if own is None:
        return usual if scheme is None else scheme, step, {}
    chosen, period = own.scheme if scheme is None else scheme, float(own.step)
    settings, named = {key: float(value) for key, value in own.settings}, isinstance(chosen, str)
    received_settings = settings if isinstance(chosen, str) else {key: getattr(chosen, key, None) for key in settings}
    name = chosen if isinstance(chosen, str) else chosen.name
    if (name, received_settings) != (own.scheme, settings) or step not in (None, period):
        received = "".join(f", {key} {value!r}" for key, value in received_settings.items() if not named)
        raise ParameterError(
            f"a sampled law runs with the scheme {own} and the step {period!r} s of its design. Received the scheme "
            f"{name}{received} and the step {period if step is None else step!r} s. Omit scheme and step."
        )
    return chosen, period, settings if named else {}
