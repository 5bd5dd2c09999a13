"""User-defined friction law: hyperbolic weakening, μ = residual + drop/(1 + slip/length)."""

from dataclasses import dataclass, field
from typing import ClassVar

import sympy as sp

from quakedesign.fault import FrictionLaw


@dataclass(frozen=True, kw_only=True)
class HyperbolicWeakening(FrictionLaw):
    """Friction that decreases hyperbolically with slip [-]; invented for this notebook."""

    name: ClassVar[str] = "hyperbolic-weakening"
    source: ClassVar[str] = "this notebook"
    domain: ClassVar[str] = "slip >= 0"

    residual: float = field(metadata={"unit": "", "symbol": r"\mu_\infty"})
    drop: float = field(metadata={"unit": "", "symbol": r"\Delta"})
    length: float = field(metadata={"unit": "m", "symbol": r"\ell"})

    def coefficient(self, slip, rate):
        """Friction coefficient [-]."""
        return self.residual + self.drop / (1 + slip / self.length)

    def extended(self, slip, rate):
        """Friction coefficient [-], constant for negative slip."""
        return self.coefficient(sp.Max(slip, 0), rate)

    @property
    def bounds(self):
        """Smallest and largest coefficient [-]."""
        return self.residual, self.residual + self.drop

    @property
    def slip_slope(self):
        """Largest chord slope in slip [1/m]."""
        return self.drop / self.length

    @property
    def rate_slope(self):
        """Largest chord slope in slip rate [s/m]."""
        return 0
