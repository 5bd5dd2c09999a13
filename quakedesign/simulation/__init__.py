"""Closed loops in CasADi: integrators, schemes, actuators, sensing, compiled stepping, metrics, trajectories, export.

Numerical libraries load inside the functions that need them. Campaigns are in `quakedesign.simulation.campaign`.
"""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
