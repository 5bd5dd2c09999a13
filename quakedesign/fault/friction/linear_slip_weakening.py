"""Linear slip weakening."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from quakedesign.fault.friction.weakening import SlipWeakening

if TYPE_CHECKING:
    import sympy as sp


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearSlipWeakening(SlipWeakening):
    """μ(slip) = residual + drop · max(0, 1 − slip/critical_slip).

    Friction has a kink at the critical slip, and would grow without bound for slip < 0; `extended` holds it there.

    Attributes
    ----------
    critical_slip : float
        Slip at which friction is kinetic d_c [m], positive.
    """

    name: ClassVar[str] = "linear-slip-weakening"
    source: ClassVar[str] = "Ida (1972), J. Geophys. Res. 77(20), 3796; Andrews (1976), J. Geophys. Res. 81(20), 3575"
    domain: ClassVar[str] = "slip >= 0"

    def coefficient(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] for slip ≥ 0."""
        import sympy as sp

        return self.residual + self.drop * sp.Max(0, 1 - slip / self.critical_slip)
