"""Linear state feedback with double integral action."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from quakedesign.controllers.base import Controller, LoopField, Signals
from quakedesign.errors import ParameterError

FEEDBACKS = ("error", "state")


@dataclass(frozen=True, kw_only=True)
class ExtendedLQR(Controller):
    """e-LQR: p = −Kx_a with ξ1' = x1 − r, ξ2' = ξ1 (eqs. double_integrator and u).

    Attributes
    ----------
    feedback : str
        ``"state"``: k1 and k2 act on x1 and x2, as printed in eq. u. ``"error"``: they act on x1 − r and
        x2 − r', which keeps p small and the error of tracking a ramp too (ERRATA 29). The loop about a
        constant reference is the same.
    """

    name: ClassVar[str] = "elqr"
    title: ClassVar[str] = "e-LQR"
    source: ClassVar[str] = "eqs. double_integrator and u of the paper; ERRATA 29"
    gain_units: ClassVar[Mapping[str, str]] = {"k1": "Pa/m", "k2": "Pa s/m", "k3": "Pa/(m s)", "k4": "Pa/(m s^2)"}
    integral_units: ClassVar[tuple[str, ...]] = ("m s", "m s^2")

    feedback: str = "error"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.feedback not in FEEDBACKS:
            raise ParameterError(f"feedback must be one of {', '.join(FEEDBACKS)}. Received {self.feedback!r}.")

    def pressure(self, signals: Signals) -> sp.Expr:
        """Return p [Pa] = −Kx_a, eq. u."""
        ends = {
            "error": (signals.slip_error, signals.slip_rate_error),
            "state": (signals.slip, signals.slip_rate),
        }[self.feedback]
        return -sum(k * x for k, x in zip(self._exact_gains(), (*ends, *signals.integrals), strict=True))

    def integral_rates(self, signals: Signals) -> tuple[sp.Expr, ...]:
        """ξ1' = x1 − r and ξ2' = ξ1."""
        return signals.slip_error, signals.integrals[0]

    @classmethod
    def loop_field(cls) -> LoopField:
        """Return the loop about the equilibrium of a constant reference (ERRATA 8), all uncertainty in s, w and β.

        x2' = s·x1 − w·x2 + β·b·p, where s [1/s²] is the chord of everything that depends on slip (friction,
        spring, disturbance), w [1/s] that of everything that depends on slip rate, b = μ_res·N̂_min [m²/kg].
        """
        x1, x2, xi1, xi2 = sp.symbols("x1 x2 xi1 xi2", real=True)
        beta, s, w, authority = sp.symbols("beta s w b", real=True)
        gains = tuple(sp.Symbol(name, real=True) for name in cls.gain_units)
        states = (x1, x2, xi1, xi2)
        pressure = -sum(k * x for k, x in zip(gains, states, strict=True))
        field = {x1: x2, x2: sp.expand(s * x1 - w * x2 + beta * authority * pressure), xi1: x1, xi2: xi1}
        return LoopField(
            states=dict.fromkeys(states, 1),
            field=field,
            gains=gains,
            constants=(authority,),
            uncertain=(beta, s, w),
            domain="reals",
            degree=2,
        )
