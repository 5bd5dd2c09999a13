"""Third-order continuous twisting algorithm."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from quakedesign.laws.sliding_mode import IntegratorChain
from quakedesign.symbolic import SignedPower


@dataclass(frozen=True, kw_only=True)
class ThirdOrderTwisting(IntegratorChain):
    """3-CTA: ν = −k1⌈e1⌋^¼ − k2⌈e2⌋^⅓ − k3⌈e3⌋^½ + ξ, ξ' = −k4⌈e1⌋⁰ − k5⌈e2⌋⁰ − k6⌈e3⌋⁰ for e1''' = β(ν + h)."""

    name: ClassVar[str] = "cta3"
    title: ClassVar[str] = "3-CTA"
    source: ClassVar[str] = (
        "Mendoza-Avila, Moreno and Fridman (2020), Continuous twisting algorithm for third-order systems, "
        "IEEE Trans. Automatic Control 65"
    )
    gain_units: ClassVar[Mapping[str, str]] = {
        "k1": "m^(3/4)/s^3",
        "k2": "m^(2/3)/s^(8/3)",
        "k3": "m^(1/2)/s^2",
        "k4": "m/s^4",
        "k5": "m/s^4",
        "k6": "m/s^4",
    }
    order: ClassVar[int] = 3

    @staticmethod
    def virtual_control(errors: Sequence[sp.Expr], gains: Sequence[sp.Expr]) -> sp.Expr:
        """Return ν0 = −k1⌈e1⌋^¼ − k2⌈e2⌋^⅓ − k3⌈e3⌋^½."""
        powers = (sp.Rational(1, n) for n in (4, 3, 2))
        return -sum(k * SignedPower(e, a) for k, e, a in zip(gains[:3], errors, powers, strict=True))

    @staticmethod
    def integral_rate(errors: Sequence[sp.Expr], gains: Sequence[sp.Expr]) -> sp.Expr:
        """ξ' = −k4⌈e1⌋⁰ − k5⌈e2⌋⁰ − k6⌈e3⌋⁰."""
        return -sum(k * SignedPower(e, 0) for k, e in zip(gains[3:], errors, strict=True))
