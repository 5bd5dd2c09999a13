"""Closed loops in CasADi: integrators, schemes, compiled stepping, metrics, trajectories."""

from quakedesign.simulation.earthquake import natural_earthquake
from quakedesign.simulation.energy import EnergyBudget
from quakedesign.simulation.integrators import Integrator, integrator, integrators
from quakedesign.simulation.interop import to_casadi, to_iosystem
from quakedesign.simulation.loading import Load
from quakedesign.simulation.metrics import Metrics, StickMetrics
from quakedesign.simulation.run import simulate
from quakedesign.simulation.schemes import Scheme, schemes
from quakedesign.simulation.state_plants import SpringSlider
from quakedesign.simulation.state_run import simulate_state, velocity_step
from quakedesign.simulation.state_trajectory import StateTrajectory
from quakedesign.simulation.trajectory import Trajectory
from quakedesign.simulation.variation import Variation

__all__ = [
    "EnergyBudget",
    "Integrator",
    "Load",
    "Metrics",
    "Scheme",
    "SpringSlider",
    "StateTrajectory",
    "StickMetrics",
    "Trajectory",
    "Variation",
    "integrator",
    "integrators",
    "natural_earthquake",
    "schemes",
    "simulate",
    "simulate_state",
    "to_casadi",
    "to_iosystem",
    "velocity_step",
]
