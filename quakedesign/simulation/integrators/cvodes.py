"""Backward differentiation formulas of variable order and step."""

from typing import ClassVar

from quakedesign.simulation.integrators.adaptive import AdaptiveIntegrator


class Cvodes(AdaptiveIntegrator):
    """Orders 1 to 5, Newton's iteration with the exact Jacobian."""

    name: ClassVar[str] = "cvodes"
    source: ClassVar[str] = (
        "Cohen and Hindmarsh (1996), Comput. Phys. 10, 138; Hindmarsh et al. (2005), ACM TOMS 31, 363"
    )
