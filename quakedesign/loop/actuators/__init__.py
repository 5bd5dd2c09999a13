"""Actuator stages between the commanded pressure and the pressure in the fault, discovered in this package."""

from functools import cache

from quakedesign.discovery import discovered
from quakedesign.loop.actuators.base import FlowStage, SampledStage, Stage
from quakedesign.loop.actuators.chain import DIRECT, Actuator
from quakedesign.loop.actuators.delay import Delay
from quakedesign.loop.actuators.lag_and_diffusion import Diffusion, Lag
from quakedesign.loop.actuators.pump_limits import Quantisation, RateLimit, Saturation

__all__ = [
    "DIRECT",
    "Actuator",
    "Delay",
    "Diffusion",
    "FlowStage",
    "Lag",
    "Quantisation",
    "RateLimit",
    "SampledStage",
    "Saturation",
    "Stage",
    "stages",
]


@cache
def stages() -> dict[str, type[Stage]]:
    """Every stage of the package by name, in the order of the signal."""
    every = discovered(__name__, Stage)
    return dict(sorted(every.items(), key=lambda item: (issubclass(item[1], FlowStage), item[1].rank)))
