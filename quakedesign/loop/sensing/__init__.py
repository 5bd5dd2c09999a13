"""What lies between the true slip and what a law is told: transducer, averaging, differentiator."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.loop.sensing.averaging import Averaging as Averaging
    from quakedesign.loop.sensing.base import Sensor as Sensor
    from quakedesign.loop.sensing.base import SlipStage as SlipStage
    from quakedesign.loop.sensing.differentiator import Differentiator as Differentiator
    from quakedesign.loop.sensing.joint_choice import JointCondition as JointCondition
    from quakedesign.loop.sensing.joint_choice import joint_condition as joint_condition
    from quakedesign.loop.sensing.joint_choice import smallest_bound as smallest_bound
    from quakedesign.loop.sensing.output_feedback import OutputFeedback as OutputFeedback
    from quakedesign.loop.sensing.transducer import Transducer as Transducer

face(__name__)
