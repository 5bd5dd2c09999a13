"""Backward differentiation formulas with fixed leading coefficient, for implicit equations."""

from typing import ClassVar

from quakedesign.simulation.integrators.adaptive import AdaptiveIntegrator


class Idas(AdaptiveIntegrator):
    """Orders 1 to 5 on 0 = f − y', a family of formulas other than that of `Cvodes`."""

    name: ClassVar[str] = "idas"
    source: ClassVar[str] = "Hindmarsh et al. (2005), ACM TOMS 31, 363; Brenan, Campbell and Petzold (1996), SIAM"
