"""Exponential slip weakening."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from quakedesign.fault.friction.weakening import SlipWeakening

if TYPE_CHECKING:
    import sympy as sp


@dataclass(frozen=True, slots=True, kw_only=True)
class ExponentialSlipWeakening(SlipWeakening):
    """μ(slip) = residual + drop · exp(−slip/critical_slip), eq. mu of the paper, whose Δμ is −drop.

    The law meets the bounds of eq. mug only for slip ≥ 0; `extended` holds μ at its static value for
    slip < 0 (ERRATA 12).
    """

    name: ClassVar[str] = "exponential-slip-weakening"
    source: ClassVar[str] = "Kanamori and Brodsky (2004), Rep. Prog. Phys. 67, 1429; eq. mu of the paper"
    domain: ClassVar[str] = "slip >= 0"

    def coefficient(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] for slip ≥ 0 (eq. mu)."""
        import sympy as sp

        return self.residual + self.drop * sp.exp(-slip / self.critical_slip)
