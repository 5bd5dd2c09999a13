"""Linear state feedback with double integral action."""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import sympy as sp

from quakedesign.errors import ParameterError, require_known
from quakedesign.exact import to_sympy
from quakedesign.laws.base import Controller, Signals
from quakedesign.laws.loop_field import LoopField

FEEDBACKS = ("error", "state")


@dataclass(frozen=True, slots=True, kw_only=True)
class PressureLimits:
    """Pressure limits (ERRATA 23) and the recovery time of the integrals at a limit."""

    # [Pa], lowest < 0 < highest; choose highest below the effective normal stress, so that the fault does not open
    lowest: Fraction
    highest: Fraction
    recovery_time: Fraction = Fraction(1)  # Time constant [s] of both integrals while p is at a limit, positive

    def __post_init__(self) -> None:
        if not self.lowest < 0 < self.highest or self.recovery_time <= 0:
            raise ParameterError(
                "limits must be lowest < 0 < highest with a positive recovery_time. Received "
                f"{float(self.lowest):.4g} Pa, {float(self.highest):.4g} Pa, {float(self.recovery_time):.4g} s. "
                "Give the withdrawal as a negative pressure."
            )


@dataclass(frozen=True, kw_only=True)
class ExtendedLQR(Controller):
    """e-LQR: p = −Kx_a with ξ1' = x1 − r, ξ2' = ξ1 (eqs. double_integrator and u)."""

    name: ClassVar[str] = "elqr"
    title: ClassVar[str] = "e-LQR"
    source: ClassVar[str] = "eqs. double_integrator and u of the paper; ERRATA 29"
    gain_units: ClassVar[Mapping[str, str]] = {"k1": "Pa/m", "k2": "Pa s/m", "k3": "Pa/(m s)", "k4": "Pa/(m s^2)"}
    integral_units: ClassVar[tuple[str, ...]] = ("m s", "m s^2")

    # ``"state"``: k1 and k2 act on x1 and x2, as printed in eq. u. ``"error"``: they act on x1 − r and x2 − r', which
    # limits p and the error of tracking a ramp (ERRATA 29). The loop about a constant reference is the same.
    feedback: str = "error"
    # p is saturated at these limits, which need k4 ≠ 0; the excess drives the integrals back (back-calculation, Åström
    # and Rundqwist 1989, Proc. Amer. Control Conf., 1693). The loop field is the one without limits.
    limits: PressureLimits | None = None
    offset: Fraction = Fraction(0)  # p for Kx_a = 0 [Pa]: an initial pressure, since ξ = 0 initially

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.limits is not None and not self.gains["k4"]:
            raise ParameterError(
                "k4 must not be 0 in a law with limits, whose anti-windup acts through k4. Received 0. Omit limits."
            )
        require_known(self.feedback, FEEDBACKS, "feedback")

    def pressure(self, signals: Signals) -> sp.Expr:
        """Return p [Pa] = offset − Kx_a, eq. u, inside the limits if there are any."""
        unlimited = self._unlimited_pressure(signals)
        if self.limits is None:
            return unlimited
        return sp.Min(sp.Max(unlimited, to_sympy(self.limits.lowest)), to_sympy(self.limits.highest))

    def integral_rates(self, signals: Signals) -> tuple[sp.Expr, ...]:
        """ξ1' = x1 − r and ξ2' = ξ1; at a limit, back-calculation gives both the double pole −1/recovery_time."""
        rates = signals.slip_error, signals.integrals[0]
        if self.limits is None:
            return rates
        excess = self.pressure(signals) - self._unlimited_pressure(signals)
        return tuple(rate + back * excess for rate, back in zip(rates, self._back_calculation_gains(), strict=True))

    def _unlimited_pressure(self, signals: Signals) -> sp.Expr:
        measured = {"error": (signals.slip_error, signals.slip_rate_error), "state": (signals.slip, signals.slip_rate)}[
            self.feedback
        ]
        commanded = -sum(k * x for k, x in zip(self._exact_gains(), (*measured, *signals.integrals), strict=True))
        return commanded + to_sympy(self.offset) if self.offset else commanded

    def _back_calculation_gains(self) -> tuple[sp.Expr, sp.Expr]:
        """l1, l2 for which ξ' = (l1, l2)(k3ξ1 + k4ξ2) + (0, ξ1) has the double pole −1/τ."""
        assert self.limits is not None
        *_, k3, k4 = self._exact_gains()
        pace = 1 / to_sympy(self.limits.recovery_time)
        first = -(pace**2) / k4
        return first, (-2 * pace - first * k3) / k4

    @classmethod
    def loop_field(cls) -> LoopField:
        """Return the loop about the equilibrium of a constant reference (ERRATA 8), all uncertainty in s, w and β.

        x2' = s·x1 − w·x2 + β·b·p, where s [1/s²] is the chord slope of all terms that depend on slip (friction, spring,
        disturbance), −w [1/s] that of all terms that depend on slip rate, and b = μ_res·N̂_min [m²/kg].
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
        )
