"""Super-twisting algorithm."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from quakedesign.laws.sliding_mode import IntegratorChain
from quakedesign.symbolic import SignedPower


@dataclass(frozen=True, kw_only=True)
class SuperTwisting(IntegratorChain):
    """ν = −k1⌈e1⌋^½ + ξ, ξ' = −k2⌈e1⌋⁰ for e1' = β(ν + h), such as a slip-rate error driven by a pressure.

    For a constant β = 1 and |h'| ≤ L < k2 the stabilising gains are known exactly: Seeber and Horn (2018), Necessary
    and sufficient stability criterion for the super-twisting algorithm, 15th Workshop on Variable Structure Systems.
    """

    name: ClassVar[str] = "super-twisting"
    title: ClassVar[str] = "super-twisting"
    source: ClassVar[str] = (
        "Levant (1993), Sliding order and sliding accuracy in sliding mode control, Int. J. Control 58"
    )
    gain_units: ClassVar[Mapping[str, str]] = {"k1": "m^(1/2)/s^(3/2)", "k2": "m/s^3"}
    order: ClassVar[int] = 1

    @staticmethod
    def virtual_control(errors: Sequence[sp.Expr], gains: Sequence[sp.Expr]) -> sp.Expr:
        """Return ν0 = −k1⌈e1⌋^½."""
        return -gains[0] * SignedPower(errors[0], sp.Rational(1, 2))

    @staticmethod
    def integral_rate(errors: Sequence[sp.Expr], gains: Sequence[sp.Expr]) -> sp.Expr:
        """ξ' = −k2⌈e1⌋⁰."""
        return -gains[1] * SignedPower(errors[0], 0)
