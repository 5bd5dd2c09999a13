"""Closed loops in CasADi: integrators, schemes, actuators, sensing, compiled stepping, metrics, trajectories, export.

Numerical libraries load inside the functions that need them. Campaigns are in `quakedesign.simulation.campaign`.
"""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.loop.actuators import (
        Actuator,
        Delay,
        Diffusion,
        Lag,
        Quantisation,
        RateLimit,
        Saturation,
        stages,
    )
    from quakedesign.loop.schemes import Scheme, schemes, simulation_scheme
    from quakedesign.loop.sensing import (
        Averaging,
        Differentiator,
        JointCondition,
        OutputFeedback,
        Sensor,
        Transducer,
        joint_condition,
        smallest_bound,
    )
    from quakedesign.loop.sensing.measurement import Measurement
    from quakedesign.simulation.actuated_trajectory import SampledTrajectory
    from quakedesign.simulation.c_source import ControllerStep
    from quakedesign.simulation.earthquake import natural_earthquake
    from quakedesign.simulation.energy import EnergyBudget
    from quakedesign.simulation.export import controller_step, export_controller
    from quakedesign.simulation.integrators import Integrator, integrator, integrators
    from quakedesign.simulation.interop import to_casadi, to_iosystem
    from quakedesign.simulation.linear_models import loop_transfer, to_statespace
    from quakedesign.simulation.loading import Load
    from quakedesign.simulation.metrics import ActuatorMetrics, Metrics, StickMetrics
    from quakedesign.simulation.outcome import Outcome, OutcomeCriterion
    from quakedesign.simulation.perturbation import perturbation
    from quakedesign.simulation.pressure_course import PressureCourse, pressure_course
    from quakedesign.simulation.sensitivity import Study, accuracy, gain_sensitivity, noise_sensitivity
    from quakedesign.simulation.simulate import simulate
    from quakedesign.simulation.state_plants import SpringSlider
    from quakedesign.simulation.state_run import simulate_state, velocity_step
    from quakedesign.simulation.state_trajectory import StateTrajectory
    from quakedesign.simulation.trajectory import Trajectory
    from quakedesign.simulation.variation import Variation

__all__ = [
    "Actuator",
    "ActuatorMetrics",
    "Averaging",
    "ControllerStep",
    "Delay",
    "Differentiator",
    "Diffusion",
    "EnergyBudget",
    "Integrator",
    "JointCondition",
    "Lag",
    "Load",
    "Measurement",
    "Metrics",
    "Outcome",
    "OutcomeCriterion",
    "OutputFeedback",
    "PressureCourse",
    "Quantisation",
    "RateLimit",
    "SampledTrajectory",
    "Saturation",
    "Scheme",
    "Sensor",
    "SpringSlider",
    "StateTrajectory",
    "StickMetrics",
    "Study",
    "Trajectory",
    "Transducer",
    "Variation",
    "accuracy",
    "controller_step",
    "export_controller",
    "gain_sensitivity",
    "integrator",
    "integrators",
    "joint_condition",
    "loop_transfer",
    "natural_earthquake",
    "noise_sensitivity",
    "perturbation",
    "pressure_course",
    "schemes",
    "simulate",
    "simulate_state",
    "simulation_scheme",
    "smallest_bound",
    "stages",
    "to_casadi",
    "to_iosystem",
    "to_statespace",
    "velocity_step",
]

face(__name__)
