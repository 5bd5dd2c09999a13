"""Second-order continuous twisting algorithm."""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import sympy as sp

from quakedesign.laws.sliding_mode import SlidingMode
from quakedesign.symbolic import SignedPower


@dataclass(frozen=True, kw_only=True)
class ContinuousTwisting(SlidingMode):
    """2-CTA, eq. cta: ν = −λ^⅔k1⌈e1⌋^⅓ − λ^½k2⌈e2⌋^½ + ξ1, ξ1' = −λk3⌈e1⌋⁰ − λk4⌈e2⌋⁰."""

    name: ClassVar[str] = "cta"
    title: ClassVar[str] = "2-CTA"
    source: ClassVar[str] = "Torres-González, Sánchez, Fridman and Moreno (2017); eq. cta of the paper"
    gain_units: ClassVar[Mapping[str, str]] = {
        "k1": "m^(2/3)/s^2",
        "k2": "m^(1/2)/s^(3/2)",
        "k3": "m/s^3",
        "k4": "m/s^3",
    }

    @staticmethod
    def virtual_control(error: sp.Expr, rate_error: sp.Expr, integral: sp.Expr, gains: Any, scale: Any) -> sp.Expr:
        """ν of eq. cta."""
        k1, k2, _, _ = gains
        return (
            -(scale ** sp.Rational(2, 3)) * k1 * SignedPower(error, sp.Rational(1, 3))
            - scale ** sp.Rational(1, 2) * k2 * SignedPower(rate_error, sp.Rational(1, 2))
            + integral
        )

    @staticmethod
    def integral_rate(error: sp.Expr, rate_error: sp.Expr, gains: Any, scale: Any) -> sp.Expr:
        """ξ1' of eq. cta."""
        _, _, k3, k4 = gains
        return -scale * k3 * SignedPower(error, 0) - scale * k4 * SignedPower(rate_error, 0)

    @property
    def lipschitz_limit(self) -> Fraction:
        """λ(k3 − |k4|) [m/s³]: with a constant |h'| of this value the loop has a Filippov equilibrium with e1 ≠ 0."""
        return self.scale * (self.gains["k3"] - abs(self.gains["k4"]))

    @classmethod
    def counterexample(
        cls, gains: Mapping[str, Fraction], uncertain: Mapping[str, tuple[Fraction, Fraction]]
    ) -> Mapping[str, Mapping[str, Fraction]] | None:
        """For h' = max(0, k3 − |k4|) and k3 ≥ −|k4| all points e2 = 0, e3 = k1⌈e1⌋^⅓, e1 > 0 are equilibria."""
        k1, _, k3, k4 = gains.values()
        pull = max(Fraction(0), k3 - abs(k4))
        if not k1 or not uncertain["d"][0] <= pull <= uncertain["d"][1] or (not k4 and pull != k3):
            return None
        share = ((k3 - pull) / abs(k4) + 1) / 2 if k4 else Fraction(1)
        if not 0 <= share <= 1:
            return None
        towards, away = ("-", "+") if k4 >= 0 else ("+", "-")
        last = "+" if k1 > 0 else "-"
        return {
            "parameters": {"beta": uncertain["beta"][0], "d": pull},
            "point": {"e1": Fraction(1), "e2": Fraction(0), "e3": k1},
            "weights": {f"+{towards}{last}": share, f"+{away}{last}": 1 - share},
        }
