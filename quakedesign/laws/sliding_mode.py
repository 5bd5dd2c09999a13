"""Base classes of continuous sliding-mode laws, p = ν/(μ0N̂0) with one integral state.

The second class covers laws for a chain of integrators: continuous ν, a discontinuous integral, weights n+1 … 1.
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product
from typing import Any, ClassVar, Self

import sympy as sp

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.exact import fraction_of, rational
from quakedesign.laws.base import Controller, Law, Sampling, Signals
from quakedesign.laws.feed_forward import NONE, FeedForward
from quakedesign.laws.loop_field import LoopField

# ----------------------------------------------------------------------
# Common base of the continuous sliding-mode laws: p = ν/(μ0N̂0), one integral state, homogeneity.

beta, d = sp.symbols("beta d", real=True)
e1, e2, e3 = sp.symbols("e1 e2 e3", real=True)


@checked_dataclass(frozen=True, kw_only=True)
class SlidingMode(Controller):
    """A homogeneous law ν(e1, e2, ξ1) with weights (3, 2, 1) and degree −1.

    Attributes
    ----------
    scale : Fraction
        λ [-], which scales the loop: e → λe maps the loop with λ = 1 onto this one.
    divisor : Fraction
        μ0N̂0 of eq. ps [m²/kg].
    feedforward : FeedForward
        Terms from a plant model that are added to ν [m/s²]; none by default.
    sampling : Sampling, optional
        Sampling of a sampled law; None for the law in continuous time, which may run under any scheme.
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
        """Value of |h'| [m/s³] from which on no Lyapunov function exists with these gains; below it none need exist."""

    @property
    def numbers(self) -> dict[str, Fraction]:
        """Gains, ``scale``, ``divisor``, an active feed-forward, and numbers of the scheme of a sampled law."""
        added = {} if self.feedforward == NONE else self.feedforward.coefficients
        gains = {f"feedforward_{name}": value for name, value in added.items()}
        settings = self.sampling.settings if self.sampling else ()
        return {**self.gains, "scale": self.scale, "divisor": self.divisor, **gains, **dict(settings)}

    @classmethod
    def for_authority(cls, values: "tuple[str | float | Fraction, ...]", authority: Fraction) -> Self:
        """Return a law from base gains in the order of `gain_units`, with the divisor `authority` [m²/kg]."""
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
        predicted = self.feedforward.acceleration(signals.slip, signals.slip_rate, signals.reference_acceleration)
        return (nu + predicted) / sp.Rational(self.divisor.numerator, self.divisor.denominator)

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


# ----------------------------------------------------------------------
# Common base of laws for a chain of integrators: a continuous ν, one discontinuous integral, weights n+1 … 1.


@dataclass(frozen=True, kw_only=True)
class IntegratorChain(Law):
    """A homogeneous law of degree −1 for e1' = e2, …, en' = β(ν + h), with proofs for this plant, not for a fault.

    With e(n+1) = ξ + h the loop is en' = β(ν0(e1 … en) + e(n+1)), e(n+1)' = ξ' + d, where ν = ν0 + ξ and d = h'.
    """

    order: ClassVar[int]

    @staticmethod
    @abstractmethod
    def virtual_control(errors: Sequence[sp.Expr], gains: Sequence[sp.Expr]) -> sp.Expr:
        """Return ν0, the continuous part without the integral."""

    @staticmethod
    @abstractmethod
    def integral_rate(errors: Sequence[sp.Expr], gains: Sequence[sp.Expr]) -> sp.Expr:
        """ξ'."""

    @classmethod
    def loop_field(cls) -> LoopField:
        """Return the loop in e1 … e(n+1); β and d are uncertain."""
        gains = tuple(sp.Symbol(name, real=True) for name in cls.gain_units)
        *errors, last = states = sp.symbols(f"e1:{cls.order + 2}", real=True)
        field = dict(zip(errors, states[1:], strict=True))
        field[errors[-1]] = sp.expand(beta * (cls.virtual_control(errors, gains) + last))
        field[last] = sp.expand(cls.integral_rate(errors, gains) + d)
        return LoopField(
            states=dict(zip(states, range(cls.order + 1, 0, -1), strict=True)),
            field=field,
            gains=gains,
            constants=(),
            uncertain=(beta, d),
            domain="cells",
        )

    @classmethod
    def counterexample(
        cls, gains: Mapping[str, Fraction], uncertain: Mapping[str, tuple[Fraction, Fraction]]
    ) -> Mapping[str, Mapping[str, Fraction]] | None:
        """The equilibrium e1 = 1, e2 = … = en = 0, e(n+1) = −ν0, if a Filippov value of ξ' cancels a constant d."""
        exact = [sp.Rational(gains[name].numerator, gains[name].denominator) for name in cls.gain_units]
        rest = sp.Rational(cls.virtual_control((sp.Integer(1), *[sp.Integer(0)] * (cls.order - 1)), exact))
        if rest == 0:
            return None
        corners = list(product((1, -1), repeat=cls.order - 1))
        pulls = [-fraction_of(cls.integral_rate((sp.Integer(1), *map(sp.Integer, signs)), exact)) for signs in corners]
        least, most = min(pulls), max(pulls)
        pull = max(uncertain["d"][0], least)
        if pull > min(uncertain["d"][1], most):
            return None
        weights = dict.fromkeys(range(len(corners)), Fraction(0))
        share = (pull - least) / (most - least) if most > least else Fraction(0)
        weights[pulls.index(least)] += 1 - share
        weights[pulls.index(most)] += share
        last = "+" if rest < 0 else "-"
        names = ["+" + "".join("+" if s > 0 else "-" for s in signs) + last for signs in corners]
        middle = {f"e{i}": Fraction(0) for i in range(2, cls.order + 1)}
        return {
            "parameters": {"beta": uncertain["beta"][0], "d": pull},
            "point": {"e1": Fraction(1), **middle, f"e{cls.order + 1}": -fraction_of(rest)},
            "weights": dict(zip(names, weights.values(), strict=True)),
        }
