"""What laws for a chain of integrators share: a continuous ν, one discontinuous integral, weights n+1 … 1."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import ClassVar

import sympy as sp

from quakedesign.controllers.base import Law
from quakedesign.controllers.loop_field import LoopField
from quakedesign.rationals import fraction_of

beta, d = sp.symbols("beta d", real=True)


@dataclass(frozen=True, kw_only=True)
class IntegratorChain(Law):
    """A homogeneous law of degree −1 for e1' = e2, …, en' = β(ν + h), proved on its own plant.

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
        """At e1 = 1, e2 = … = en = 0, e(n+1) = −ν0 a constant d holds the loop where the sliding ξ' can cancel it."""
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
