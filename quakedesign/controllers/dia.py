"""Second-order discontinuous integral algorithm."""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import sympy as sp

from quakedesign.controllers.sliding_mode import SlidingMode
from quakedesign.errors import ParameterError
from quakedesign.symbolic import SignedPower


@dataclass(frozen=True, kw_only=True)
class DiscontinuousIntegral(SlidingMode):
    """2-DIA, eq. dia: ν = −λ^½k_I2⌈⌈e2⌋^{3/2} + λ^½k_I1^{3/2}e1⌋^⅓ + ξ1, ξ1' = −λk_I3⌈e1 + λ^{−½}k_I4⌈e2⌋^{3/2}⌋⁰."""

    name: ClassVar[str] = "dia"
    title: ClassVar[str] = "2-DIA"
    source: ClassVar[str] = "Moreno (2016); eq. dia of the paper, with λ^½ in both places (ERRATA 5)"
    gain_units: ClassVar[Mapping[str, str]] = {
        "kI1": "m^(1/3)/s",
        "kI2": "m^(1/2)/s^(3/2)",
        "kI3": "m/s^3",
        "kI4": "s^(3/2)/m^(1/2)",
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.gains["kI1"] < 0:
            raise ParameterError(
                f"gain kI1 must not be negative, since the law takes its root. Received {self.gains['kI1']}."
            )

    @staticmethod
    def virtual_control(error: sp.Expr, rate_error: sp.Expr, integral: sp.Expr, gains, scale) -> sp.Expr:
        """ν of eq. dia."""
        k1, k2, _, _ = gains
        root = scale ** sp.Rational(1, 2)
        inner = SignedPower(rate_error, sp.Rational(3, 2)) + root * k1 ** sp.Rational(3, 2) * error
        return -root * k2 * SignedPower(inner, sp.Rational(1, 3)) + integral

    @staticmethod
    def integral_rate(error: sp.Expr, rate_error: sp.Expr, gains, scale) -> sp.Expr:
        """ξ1' of eq. dia."""
        _, _, k3, k4 = gains
        inner = error + scale ** sp.Rational(-1, 2) * k4 * SignedPower(rate_error, sp.Rational(3, 2))
        return -scale * k3 * SignedPower(inner, 0)

    @property
    def lipschitz_limit(self) -> Fraction:
        """λk_I3: from there on h' can hold off the integral action."""
        return self.scale * self.gains["kI3"]
