"""What lies between the true slip and what a law is told: transducer, averaging, differentiator."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.loop.sensing.choice import JointCondition as JointCondition
    from quakedesign.loop.sensing.choice import joint_condition as joint_condition
    from quakedesign.loop.sensing.choice import smallest_bound as smallest_bound
    from quakedesign.loop.sensing.differentiator import Differentiator as Differentiator
    from quakedesign.loop.sensing.differentiator import OutputFeedback as OutputFeedback
    from quakedesign.loop.sensing.measurement import Averaging as Averaging
    from quakedesign.loop.sensing.measurement import Measurement as Measurement
    from quakedesign.loop.sensing.measurement import Sensor as Sensor
    from quakedesign.loop.sensing.measurement import SlipStage as SlipStage
    from quakedesign.loop.sensing.measurement import Transducer as Transducer

face(__name__)
