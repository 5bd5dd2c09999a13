"""Laws, one a file, found by looking into this folder; and the gains that the paper prints."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.laws.base import BaseGains as BaseGains
    from quakedesign.laws.base import Controller as Controller
    from quakedesign.laws.base import Law as Law
    from quakedesign.laws.base import Sampling as Sampling
    from quakedesign.laws.base import Signals as Signals
    from quakedesign.laws.catalogue import Subject as Subject
    from quakedesign.laws.catalogue import control_law as control_law
    from quakedesign.laws.catalogue import control_laws as control_laws
    from quakedesign.laws.catalogue import family as family
    from quakedesign.laws.catalogue import law as law
    from quakedesign.laws.catalogue import laws as laws
    from quakedesign.laws.catalogue import model_of as model_of
    from quakedesign.laws.catalogue import published as published
    from quakedesign.laws.implicit_root import ImplicitRoot as ImplicitRoot
    from quakedesign.laws.implicit_root import Power as Power
    from quakedesign.laws.loop_field import LoopField as LoopField
    from quakedesign.laws.sampled_controller import SampledController as SampledController
    from quakedesign.laws.sampled_controller import compensated as compensated
    from quakedesign.laws.sampled_law import NOISES as NOISES
    from quakedesign.laws.sampled_law import ErrorPrediction as ErrorPrediction
    from quakedesign.laws.sampled_law import LinearLaw as LinearLaw
    from quakedesign.laws.sampled_law import NominalModel as NominalModel
    from quakedesign.laws.sampled_law import PathModel as PathModel
    from quakedesign.laws.sampled_law import Prediction as Prediction
    from quakedesign.laws.sampled_law import RestLimit as RestLimit
    from quakedesign.laws.sampled_law import disturbance_estimate as disturbance_estimate
    from quakedesign.laws.sampled_law import estimate_through_path as estimate_through_path
    from quakedesign.laws.sampled_law import observer_through_path as observer_through_path
    from quakedesign.laws.sampled_law import slip_observer as slip_observer
    from quakedesign.laws.sampled_law import summed_integrals as summed_integrals
    from quakedesign.laws.sliding_mode import SlidingMode as SlidingMode

face(__name__)
