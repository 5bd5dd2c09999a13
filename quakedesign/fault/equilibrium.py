"""Equilibria of faults (rest and steady sliding), and functions with one implementation for each."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Concatenate, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")
S = TypeVar("S")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FaultEquilibrium:
    """Equilibrium about which a fault is studied and controlled."""

    name: str
    coordinates: str  # Coordinates of the plant: begins a sentence that the equations of the plant complete
    poles: str  # Equilibrium of the poles, in words: a format string for the slip rate [m/s]
    messages: Mapping[str, str]  # Message about each argument that does not apply, by its name


AT_REST = FaultEquilibrium(
    name="rest",
    coordinates="Slip x₁ and slip rate x₂, relative to the equilibrium without pressure,",
    poles="",
    messages={
        "ramp": "ramp needs friction with a state, whose reference has a constant rate. Received the ramp {value!r} "
        "with {law}, whose reference is already smooth. Omit ramp.",
        "simulate_state": "the friction law must have a state. Received {law}. Use simulate.",
    },
)
STEADY_SLIDING = FaultEquilibrium(
    name="sliding",
    coordinates="Slip x₁, slip rate v, extension s of the spring, whose far end is fixed, and the state of friction",
    poles=" about steady sliding at {:.4g} m/s",
    messages={
        "disturbance": "friction with a state needs the bound of a shear stress, not a disturbance. Received "
        "{value!r}. Give --stress.",
        "diffusivity": "diffusivity along the fault needs friction without a state. Received {law}. Omit diffusivity, "
        "for steady pressures along the fault.",
        "purpose": "{value} needs a friction law of slip and slip rate alone. Received {law}, with the state {states}. "
        "The commands fault, derive, simulate, guarantee and design accept this law.",
        "blocks": "the command blocks needs friction without a state. Received {law}. Write [[block]] and [[well]] "
        "tables into the fault file, and run limits, which lists the unstable modes that no well can control.",
        "no_diffusion": "diffusion must be above 0 s. Received 0 s. Omit --diffusion for a well at the fault.",
        "plant": "plant must be omitted for friction with a state, which never rests. Received {value!r} with {law}. "
        "Omit plant.",
        "stick_slip": "plant must be omitted for friction with a state, which never rests. Received stick-slip with "
        "{law}. Omit plant.",
    },
)


def by_equilibrium(
    *, rest: Callable[Concatenate[S, P], R], sliding: Callable[Concatenate[S, P], R]
) -> Callable[Concatenate[S, P], R]:
    """Function with one implementation per equilibrium, that of its first argument, a fault or a friction law."""

    def chosen(subject: S, /, *positional: P.args, **named: P.kwargs) -> R:
        given: Any = subject
        law = given if hasattr(given, "equilibrium") else given.friction
        return (rest if law.equilibrium is AT_REST else sliding)(subject, *positional, **named)

    return chosen
