"""What lies between the true slip and what a law is told: transducer, averaging, differentiator."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.loop.sensing.averaging import Averaging
    from quakedesign.loop.sensing.base import Sensor, SlipStage
    from quakedesign.loop.sensing.differentiator import Differentiator
    from quakedesign.loop.sensing.joint_choice import JointCondition, joint_condition, smallest_bound
    from quakedesign.loop.sensing.noise import Transducer
    from quakedesign.loop.sensing.output_feedback import OutputFeedback

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

face(__name__)
