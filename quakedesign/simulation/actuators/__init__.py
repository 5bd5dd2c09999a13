"""What lies between the pressure that a law asks for and the pressure in the fault, one stage a file."""

from quakedesign.arguments import check_arguments
from quakedesign.simulation.actuators.base import FlowStage, SampledStage, Stage, stages
from quakedesign.simulation.actuators.chain import DIRECT, Actuator
from quakedesign.simulation.actuators.delay import Delay
from quakedesign.simulation.actuators.diffusion import Diffusion
from quakedesign.simulation.actuators.lag import Lag
from quakedesign.simulation.actuators.quantisation import Quantisation
from quakedesign.simulation.actuators.rate_limit import RateLimit
from quakedesign.simulation.actuators.saturation import Saturation

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

check_arguments(__name__)
