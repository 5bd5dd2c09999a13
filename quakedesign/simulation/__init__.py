"""Closed loops in CasADi: integrators, schemes, actuators, sensing, compiled stepping, metrics, trajectories, export.

Numerical libraries load inside the functions that need them. Campaigns are in `quakedesign.simulation.campaign`.
"""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.loop.actuators import Actuator as Actuator
    from quakedesign.loop.actuators import Delay as Delay
    from quakedesign.loop.actuators import Diffusion as Diffusion
    from quakedesign.loop.actuators import Lag as Lag
    from quakedesign.loop.actuators import Quantisation as Quantisation
    from quakedesign.loop.actuators import RateLimit as RateLimit
    from quakedesign.loop.actuators import Saturation as Saturation
    from quakedesign.loop.actuators import stages as stages
    from quakedesign.loop.schemes import Scheme as Scheme
    from quakedesign.loop.schemes import schemes as schemes
    from quakedesign.loop.schemes import simulation_scheme as simulation_scheme
    from quakedesign.loop.sensing import Averaging as Averaging
    from quakedesign.loop.sensing import Differentiator as Differentiator
    from quakedesign.loop.sensing import JointCondition as JointCondition
    from quakedesign.loop.sensing import OutputFeedback as OutputFeedback
    from quakedesign.loop.sensing import Sensor as Sensor
    from quakedesign.loop.sensing import Transducer as Transducer
    from quakedesign.loop.sensing import joint_condition as joint_condition
    from quakedesign.loop.sensing import smallest_bound as smallest_bound
    from quakedesign.loop.sensing.measurement import Measurement as Measurement
    from quakedesign.simulation.actuated_trajectory import SampledTrajectory as SampledTrajectory
    from quakedesign.simulation.c_source import ControllerStep as ControllerStep
    from quakedesign.simulation.energy import EnergyBudget as EnergyBudget
    from quakedesign.simulation.export import controller_step as controller_step
    from quakedesign.simulation.export import export_controller as export_controller
    from quakedesign.simulation.integrators import Integrator as Integrator
    from quakedesign.simulation.integrators import integrator as integrator
    from quakedesign.simulation.integrators import integrators as integrators
    from quakedesign.simulation.interop import to_casadi as to_casadi
    from quakedesign.simulation.interop import to_iosystem as to_iosystem
    from quakedesign.simulation.linear_models import LoopMargins as LoopMargins
    from quakedesign.simulation.linear_models import loop_margins as loop_margins
    from quakedesign.simulation.linear_models import loop_transfer as loop_transfer
    from quakedesign.simulation.linear_models import to_statespace as to_statespace
    from quakedesign.simulation.loading import Load as Load
    from quakedesign.simulation.memoryless_earthquake import natural_earthquake as natural_earthquake
    from quakedesign.simulation.metrics import ActuatorMetrics as ActuatorMetrics
    from quakedesign.simulation.metrics import Metrics as Metrics
    from quakedesign.simulation.metrics import StickMetrics as StickMetrics
    from quakedesign.simulation.outcome import Outcome as Outcome
    from quakedesign.simulation.outcome import OutcomeCriterion as OutcomeCriterion
    from quakedesign.simulation.perturbation import perturbation as perturbation
    from quakedesign.simulation.pressure_course import PressureCourse as PressureCourse
    from quakedesign.simulation.pressure_course import pressure_course as pressure_course
    from quakedesign.simulation.sensitivity import Study as Study
    from quakedesign.simulation.sensitivity import accuracy as accuracy
    from quakedesign.simulation.sensitivity import gain_sensitivity as gain_sensitivity
    from quakedesign.simulation.sensitivity import noise_sensitivity as noise_sensitivity
    from quakedesign.simulation.simulate import simulate as simulate
    from quakedesign.simulation.sliding_conditions import SlidingVariation as SlidingVariation
    from quakedesign.simulation.sliding_conditions import Tide as Tide
    from quakedesign.simulation.slow_sliding import SlidingRun as SlidingRun
    from quakedesign.simulation.state_plants import SpringSlider as SpringSlider
    from quakedesign.simulation.state_run import simulate_state as simulate_state
    from quakedesign.simulation.state_run import velocity_step as velocity_step
    from quakedesign.simulation.state_trajectory import StateTrajectory as StateTrajectory
    from quakedesign.simulation.trajectory import Trajectory as Trajectory
    from quakedesign.simulation.variation import Variation as Variation

face(__name__)
