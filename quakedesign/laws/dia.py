"""Second-order discontinuous integral algorithm."""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.laws.loop_field import LoopField
from quakedesign.laws.sliding_mode import SlidingMode
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
    def virtual_control(error: sp.Expr, rate_error: sp.Expr, integral: sp.Expr, gains: Any, scale: Any) -> sp.Expr:
        """ν of eq. dia."""
        k1, k2, _, _ = gains
        root = scale ** sp.Rational(1, 2)
        inner = SignedPower(rate_error, sp.Rational(3, 2)) + root * k1 ** sp.Rational(3, 2) * error
        return -root * k2 * SignedPower(inner, sp.Rational(1, 3)) + integral

    @staticmethod
    def integral_rate(error: sp.Expr, rate_error: sp.Expr, gains: Any, scale: Any) -> sp.Expr:
        """ξ1' of eq. dia."""
        _, _, k3, k4 = gains
        inner = error + scale ** sp.Rational(-1, 2) * k4 * SignedPower(rate_error, sp.Rational(3, 2))
        return -scale * k3 * SignedPower(inner, 0)

    @classmethod
    def loop_field(cls) -> LoopField:
        """Closed loop with λ = 1 in (f1, e2, e3), where f1 = κ³e1 and κ = √k_I1.

        Then ν = −k_I2⌈⌈e2⌋^{3/2} + f1⌋^⅓ + ξ1 does not contain κ, which is a factor of f1' = κk_I1e2 alone: V̇ is
        affine in κ, so that an interval that contains κ suffices. It also suffices for k_I4 ≠ 0, where the argument of
        the sign contains κ: a proof treats the two signs of this argument separately, and assumes in each case only
        that the argument has this sign for some κ of the interval.
        """
        f1, e2, e3, beta, d, root = sp.symbols("f1 e2 e3 beta d kappa", real=True)
        k1, k2, k3, k4 = sp.symbols("kI1 kI2 kI3 kI4", real=True)
        power = SignedPower(e2, sp.Rational(3, 2))
        return LoopField(
            states={f1: 3, e2: 2, e3: 1},
            field={
                f1: root * k1 * e2,
                e2: beta * (e3 - k2 * SignedPower(f1 + power, sp.Rational(1, 3))),
                e3: d - k3 * SignedPower(f1 + k4 * k1 * root * power, 0),
            },
            gains=(k1, k2, k3, k4),
            constants=(),
            uncertain=(beta, d),
            domain="cells",
            roots={root: k1},
            units={f1: root**-3},
        )

    @property
    def lipschitz_limit(self) -> Fraction:
        """λk_I3 [m/s³]: an |h'| of at least this value can cancel the integral action."""
        return self.scale * self.gains["kI3"]
