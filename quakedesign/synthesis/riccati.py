"""The Riccati design under its first name; its home is `quakedesign.synthesis.linear.riccati`."""

from quakedesign.synthesis.linear.riccati import RiccatiDesign, riccati_design
from quakedesign.synthesis.linear.scaled_design import vertex_poles

__all__ = ["RiccatiDesign", "riccati_design", "vertex_poles"]
