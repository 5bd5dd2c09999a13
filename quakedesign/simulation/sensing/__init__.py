"""What lies between the true slip and what a law is told: transducer, averaging, differentiator."""

from quakedesign.arguments import check_arguments
from quakedesign.simulation.sensing.averaging import Averaging
from quakedesign.simulation.sensing.base import Sensor, SlipStage
from quakedesign.simulation.sensing.differentiator import Differentiator
from quakedesign.simulation.sensing.joint_choice import JointCondition, joint_condition, smallest_bound
from quakedesign.simulation.sensing.noise import Transducer
from quakedesign.simulation.sensing.output_feedback import OutputFeedback

__all__ = [
    "Averaging",
    "Differentiator",
    "JointCondition",
    "OutputFeedback",
    "Sensor",
    "SlipStage",
    "Transducer",
    "joint_condition",
    "smallest_bound",
]

check_arguments(__name__)
