"""What stands between law and fault, each element stated once: loops as exact matrices, schemes, actuators, sensors."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.loop.compensation import compensated
    from quakedesign.loop.continuous import ContinuousLaw, continuous_loop, exact_integrals
    from quakedesign.loop.held import SHORTEST, held_loop
    from quakedesign.loop.implicit_root import ImplicitRoot, Power
    from quakedesign.loop.internal_model import PathModel, estimate_through_path
    from quakedesign.loop.laws import (
        NOISES,
        LinearLaw,
        Model,
        Prediction,
        disturbance_estimate,
        summed_integrals,
    )
    from quakedesign.loop.layer import Layer
    from quakedesign.loop.observer import ErrorPrediction, slip_observer
    from quakedesign.loop.periodic import Fading, PeriodicLoop, Segment
    from quakedesign.loop.running import SampledController
    from quakedesign.loop.sliding import SlidingModel, at_once, sliding_loop

__all__ = [
    "NOISES",
    "SHORTEST",
    "ContinuousLaw",
    "ErrorPrediction",
    "Fading",
    "ImplicitRoot",
    "Layer",
    "LinearLaw",
    "Model",
    "PathModel",
    "PeriodicLoop",
    "Power",
    "Prediction",
    "SampledController",
    "Segment",
    "SlidingModel",
    "at_once",
    "compensated",
    "continuous_loop",
    "disturbance_estimate",
    "estimate_through_path",
    "exact_integrals",
    "held_loop",
    "sliding_loop",
    "slip_observer",
    "summed_integrals",
]

face(__name__)
