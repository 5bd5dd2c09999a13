"""What stands between law and fault, each element stated once: loops as exact matrices, schemes, actuators, sensors."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.loop.compensation import compensated as compensated
    from quakedesign.loop.continuous import ContinuousLaw as ContinuousLaw
    from quakedesign.loop.continuous import continuous_loop as continuous_loop
    from quakedesign.loop.continuous import exact_integrals as exact_integrals
    from quakedesign.loop.held import SHORTEST as SHORTEST
    from quakedesign.loop.held import held_loop as held_loop
    from quakedesign.loop.held import starts as starts
    from quakedesign.loop.implicit_root import ImplicitRoot as ImplicitRoot
    from quakedesign.loop.implicit_root import Power as Power
    from quakedesign.loop.instants import Instants as Instants
    from quakedesign.loop.internal_model import PathModel as PathModel
    from quakedesign.loop.internal_model import estimate_through_path as estimate_through_path
    from quakedesign.loop.internal_model import observer_through_path as observer_through_path
    from quakedesign.loop.known_area import with_known_area as with_known_area
    from quakedesign.loop.laws import NOISES as NOISES
    from quakedesign.loop.laws import LinearLaw as LinearLaw
    from quakedesign.loop.laws import Model as Model
    from quakedesign.loop.laws import Prediction as Prediction
    from quakedesign.loop.laws import disturbance_estimate as disturbance_estimate
    from quakedesign.loop.laws import summed_integrals as summed_integrals
    from quakedesign.loop.layer import Layer as Layer
    from quakedesign.loop.observer import ErrorPrediction as ErrorPrediction
    from quakedesign.loop.observer import slip_observer as slip_observer
    from quakedesign.loop.periodic import Fading as Fading
    from quakedesign.loop.periodic import PeriodicLoop as PeriodicLoop
    from quakedesign.loop.periodic import Pulse as Pulse
    from quakedesign.loop.periodic import Segment as Segment
    from quakedesign.loop.rest_limit import RestLimit as RestLimit
    from quakedesign.loop.running import SampledController as SampledController
    from quakedesign.loop.sliding import SlidingModel as SlidingModel
    from quakedesign.loop.sliding import StateLaw as StateLaw
    from quakedesign.loop.sliding import at_once as at_once
    from quakedesign.loop.sliding import sliding_loop as sliding_loop

face(__name__)
