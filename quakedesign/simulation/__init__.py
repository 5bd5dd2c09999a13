"""Closed loops in CasADi: integrators, schemes, compiled stepping, metrics, trajectories."""

from quakedesign.simulation.earthquake import natural_earthquake
from quakedesign.simulation.integrators import Integrator, integrator, integrators
from quakedesign.simulation.interop import to_casadi, to_iosystem
from quakedesign.simulation.metrics import Metrics
from quakedesign.simulation.run import simulate
from quakedesign.simulation.schemes import Scheme, schemes
from quakedesign.simulation.trajectory import Trajectory

__all__ = [
    "Integrator",
    "Metrics",
    "Scheme",
    "Trajectory",
    "integrator",
    "integrators",
    "natural_earthquake",
    "schemes",
    "simulate",
    "to_casadi",
    "to_iosystem",
]
