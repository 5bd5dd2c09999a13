"""What stands between law and fault, each element stated once: loops as exact matrices, schemes, actuators, sensors."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.loop.actuators import stages as stages
    from quakedesign.loop.actuators.chain import Actuator as Actuator
    from quakedesign.loop.actuators.flow_stages import Diffusion as Diffusion
    from quakedesign.loop.actuators.flow_stages import Lag as Lag
    from quakedesign.loop.actuators.sampled_stages import Delay as Delay
    from quakedesign.loop.actuators.sampled_stages import Quantisation as Quantisation
    from quakedesign.loop.actuators.sampled_stages import RateLimit as RateLimit
    from quakedesign.loop.actuators.sampled_stages import Saturation as Saturation
    from quakedesign.loop.error_loop import SHORTEST as SHORTEST
    from quakedesign.loop.error_loop import ContinuousLaw as ContinuousLaw
    from quakedesign.loop.error_loop import SlidingModel as SlidingModel
    from quakedesign.loop.error_loop import StateLaw as StateLaw
    from quakedesign.loop.error_loop import at_once as at_once
    from quakedesign.loop.error_loop import continuous_loop as continuous_loop
    from quakedesign.loop.error_loop import exact_integrals as exact_integrals
    from quakedesign.loop.error_loop import held_loop as held_loop
    from quakedesign.loop.error_loop import sliding_loop as sliding_loop
    from quakedesign.loop.error_loop import starts as starts
    from quakedesign.loop.layer import Layer as Layer
    from quakedesign.loop.layer import with_known_area as with_known_area
    from quakedesign.loop.periodic import Fading as Fading
    from quakedesign.loop.periodic import Instants as Instants
    from quakedesign.loop.periodic import PeriodicLoop as PeriodicLoop
    from quakedesign.loop.periodic import Pulse as Pulse
    from quakedesign.loop.periodic import Segment as Segment
    from quakedesign.loop.schemes import schemes as schemes
    from quakedesign.loop.schemes import simulation_scheme as simulation_scheme
    from quakedesign.loop.schemes.base import Scheme as Scheme

face(__name__)
