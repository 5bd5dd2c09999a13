"""Magnitudes of the law at the start of the step, signs at its end."""

from dataclasses import dataclass, replace
from typing import ClassVar

import sympy as sp

from quakedesign.loop.schemes.implicit import Implicit
from quakedesign.loop.steps import discrete_law
from quakedesign.loop.steps.backward import backward_euler
from quakedesign.loop.steps.discrete_law import Law
from quakedesign.symbolic import AbsolutePower, SignedPower

_START = {symbol: sp.Dummy(symbol.name, real=True) for symbol in (discrete_law.slip_error, discrete_law.rate_error)}


@dataclass(frozen=True, kw_only=True)
class SemiImplicit(Implicit):
    """Splits every ⌈x⌋^a into |x|^a at the start and the set-valued sign of x at the end of the step.

    The homogeneous semi-implicit Euler method of Michel, Ghanes, Plestan, Aoustin and Barbot (2021), Automatica 129,
    109582 (a differentiator there), applied to the law. The inclusion is that of `Implicit` with jumps only.
    """

    name: ClassVar[str] = "semi-implicit"

    @staticmethod
    def derive(law: Law) -> tuple[sp.Expr, ...]:
        """See `backward_euler`."""
        split = replace(law, pressure=_split(law.pressure), rates=tuple(map(_split, law.rates)))
        back = {dummy: symbol for symbol, dummy in _START.items()}
        return tuple(part.subs(back) for part in backward_euler(split))


def _split(expression: sp.Expr) -> sp.Expr:
    """Expression with every outermost power split into its size before and its sign after the step."""
    if isinstance(expression, SignedPower) and expression.args[1] != 0:
        base, exponent = expression.args
        return AbsolutePower(base.subs(_START), exponent) * SignedPower(base, 0)
    if expression.is_Add or expression.is_Mul:
        return expression.func(*map(_split, expression.args))
    return expression
