"""Closed loops in CasADi: integrators, schemes, actuators, sensing, compiled stepping, metrics, trajectories, export.

Numerical libraries load inside the functions that need them. Campaigns are in `quakedesign.simulation.campaign`.
"""

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
    from quakedesign.loop.schemes import schemes as schemes
    from quakedesign.loop.schemes import simulation_scheme as simulation_scheme
    from quakedesign.loop.schemes.base import Scheme as Scheme
    from quakedesign.loop.sensing.choice import JointCondition as JointCondition
    from quakedesign.loop.sensing.choice import joint_condition as joint_condition
    from quakedesign.loop.sensing.choice import smallest_bound as smallest_bound
    from quakedesign.loop.sensing.differentiator import Differentiator as Differentiator
    from quakedesign.loop.sensing.differentiator import OutputFeedback as OutputFeedback
    from quakedesign.loop.sensing.measurement import Averaging as Averaging
    from quakedesign.loop.sensing.measurement import Measurement as Measurement
    from quakedesign.loop.sensing.measurement import Sensor as Sensor
    from quakedesign.loop.sensing.measurement import Transducer as Transducer
    from quakedesign.simulation.closed_loop import EnergyBudget as EnergyBudget
    from quakedesign.simulation.closed_loop import Load as Load
    from quakedesign.simulation.closed_loop import Variation as Variation
    from quakedesign.simulation.export import ControllerStep as ControllerStep
    from quakedesign.simulation.export import controller_step as controller_step
    from quakedesign.simulation.export import export_controller as export_controller
    from quakedesign.simulation.inputs import PressureCourse as PressureCourse
    from quakedesign.simulation.inputs import perturbation as perturbation
    from quakedesign.simulation.inputs import pressure_course as pressure_course
    from quakedesign.simulation.integrators import Integrator as Integrator
    from quakedesign.simulation.integrators import integrator as integrator
    from quakedesign.simulation.integrators import integrators as integrators
    from quakedesign.simulation.interop import LoopMargins as LoopMargins
    from quakedesign.simulation.interop import loop_margins as loop_margins
    from quakedesign.simulation.interop import loop_transfer as loop_transfer
    from quakedesign.simulation.interop import to_casadi as to_casadi
    from quakedesign.simulation.interop import to_iosystem as to_iosystem
    from quakedesign.simulation.interop import to_statespace as to_statespace
    from quakedesign.simulation.natural import natural_earthquake as natural_earthquake
    from quakedesign.simulation.recorder import ActuatorMetrics as ActuatorMetrics
    from quakedesign.simulation.recorder import Metrics as Metrics
    from quakedesign.simulation.recorder import StickMetrics as StickMetrics
    from quakedesign.simulation.sensitivity import Study as Study
    from quakedesign.simulation.sensitivity import accuracy as accuracy
    from quakedesign.simulation.sensitivity import gain_sensitivity as gain_sensitivity
    from quakedesign.simulation.sensitivity import noise_sensitivity as noise_sensitivity
    from quakedesign.simulation.simulate import simulate as simulate
    from quakedesign.simulation.slow_sliding import SlidingRun as SlidingRun
    from quakedesign.simulation.state_plant import SlidingVariation as SlidingVariation
    from quakedesign.simulation.state_plant import SpringSlider as SpringSlider
    from quakedesign.simulation.state_plant import Tide as Tide
    from quakedesign.simulation.stick_slip import simulate_state as simulate_state
    from quakedesign.simulation.stick_slip import velocity_step as velocity_step
    from quakedesign.simulation.trajectory import Outcome as Outcome
    from quakedesign.simulation.trajectory import OutcomeCriterion as OutcomeCriterion
    from quakedesign.simulation.trajectory import SampledTrajectory as SampledTrajectory
    from quakedesign.simulation.trajectory import StateTrajectory as StateTrajectory
    from quakedesign.simulation.trajectory import Trajectory as Trajectory

face(__name__)
