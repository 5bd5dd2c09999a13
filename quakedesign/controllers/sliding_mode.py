"""What the continuous sliding-mode laws share: p = ν/(μ0N̂0), one integral state, homogeneity."""

from abc import abstractmethod
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, ClassVar, Self

import sympy as sp

from quakedesign.controllers.base import Controller, Sampling, Signals
from quakedesign.controllers.feed_forward import NONE, FeedForward
from quakedesign.controllers.loop_field import LoopField
from quakedesign.errors import ParameterError
from quakedesign.rationals import rational

beta, d = sp.symbols("beta d", real=True)
e1, e2, e3 = sp.symbols("e1 e2 e3", real=True)


@dataclass(frozen=True, kw_only=True)
class SlidingMode(Controller):
    """A homogeneous law ν(e1, e2, ξ1) with weights (3, 2, 1) and degree −1.

    Attributes
    ----------
    scale : Fraction
        λ [-], which stretches the loop: e → λe maps the loop with λ = 1 onto this one.
    divisor : Fraction
        μ0N̂0 of eq. ps [m²/kg].
    feedforward : FeedForward
        What is added to ν from what is known of the plant; nothing unless told.
    sampling : Sampling, optional
        How it runs as a law of samples; None for the law in continuous time, which any scheme runs.
    """

    integral_units: ClassVar[tuple[str, ...]] = ("m/s^2",)
    weights: ClassVar[tuple[int, int, int]] = (3, 2, 1)

    scale: Fraction = Fraction(1)
    divisor: Fraction = Fraction(1)
    feedforward: FeedForward = NONE
    sampling: Sampling | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("scale", "divisor"):
            value = rational(getattr(self, name), name)
            if value <= 0:
                raise ParameterError(f"{name} must be positive. Received {value}.")
            object.__setattr__(self, name, value)

    @staticmethod
    @abstractmethod
    def virtual_control(error: sp.Expr, rate_error: sp.Expr, integral: sp.Expr, gains: Any, scale: Any) -> sp.Expr:
        """ν [m/s²]."""

    @staticmethod
    @abstractmethod
    def integral_rate(error: sp.Expr, rate_error: sp.Expr, gains: Any, scale: Any) -> sp.Expr:
        """ξ1' [m/s³]."""

    @property
    @abstractmethod
    def lipschitz_limit(self) -> Fraction:
        """Bound on |h'| that no Lyapunov function can exceed with these gains (ERRATA, end)."""

    @property
    def numbers(self) -> dict[str, Fraction]:
        """Gains, ``scale``, ``divisor``, a feed-forward that is on, and numbers of the scheme of a law of samples."""
        added = {} if self.feedforward == NONE else self.feedforward.coefficients
        known = {f"feedforward_{name}": value for name, value in added.items()}
        settings = self.sampling.settings if self.sampling else ()
        return {**self.gains, "scale": self.scale, "divisor": self.divisor, **known, **dict(settings)}

    @classmethod
    def for_authority(cls, values: "tuple[str | float | Fraction, ...]", authority: Fraction) -> Self:
        """Return a law from base gains in order, with a divisor."""
        return cls.from_values(values, divisor=authority)

    def scaled(self, scale: str | float | Fraction) -> Self:
        """Return the same base gains with another λ."""
        return replace(self, gains=dict(self.gains), scale=rational(scale, "scale"))

    def with_divisor(self, divisor: Fraction) -> Self:
        """Return the same gains with another divisor."""
        return replace(self, gains=dict(self.gains), divisor=divisor)

    def with_feedforward(self, feedforward: FeedForward) -> Self:
        """Return the same law with another feed-forward."""
        return replace(self, gains=dict(self.gains), feedforward=feedforward)

    def pressure(self, signals: Signals) -> sp.Expr:
        """Return p [Pa] = (ν + feed-forward)/(μ0N̂0), eq. ps and the remark after it."""
        nu = self.virtual_control(
            signals.slip_error, signals.slip_rate_error, signals.integrals[0], self._exact_gains(), self._exact_scale()
        )
        known = self.feedforward.acceleration(signals.slip, signals.slip_rate, signals.reference_acceleration)
        return (nu + known) / sp.Rational(self.divisor.numerator, self.divisor.denominator)

    def integral_rates(self, signals: Signals) -> tuple[sp.Expr, ...]:
        """ξ1' as one entry."""
        args = (signals.slip_error, signals.slip_rate_error, self._exact_gains(), self._exact_scale())
        return (self.integral_rate(*args),)

    @classmethod
    def loop_field(cls) -> LoopField:
        """Return the loop in e1, e2 and e3 = ξ1 + h with λ = 1, eqs. clsystem1 and clsystem2; d stands for h'."""
        gains = tuple(sp.Symbol(name, real=True) for name in cls.gain_units)
        h = sp.Symbol("h", real=True)
        nu = cls.virtual_control(e1, e2, e3 - h, gains, sp.Integer(1))
        field = {
            e1: e2,
            e2: sp.expand(beta * sp.expand(nu + h)),
            e3: sp.expand(cls.integral_rate(e1, e2, gains, sp.Integer(1)) + d),
        }
        return LoopField(
            states=dict(zip((e1, e2, e3), cls.weights, strict=True)),
            field=field,
            gains=gains,
            constants=(),
            uncertain=(beta, d),
            domain="cells",
        )

    def _exact_scale(self) -> sp.Rational:
        return sp.Rational(self.scale.numerator, self.scale.denominator)
