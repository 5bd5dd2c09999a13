"""The implicit step of a law as a sum of signed powers, read off the expression that the scheme itself evaluates."""

from fractions import Fraction
from functools import lru_cache

import sympy as sp

from quakedesign.controllers import Controller
from quakedesign.errors import UnsupportedError
from quakedesign.loop import Power
from quakedesign.loop.schemes.compensated import Compensated
from quakedesign.loop.steps import discrete_law
from quakedesign.loop.steps.discrete_law import Law
from quakedesign.loop.steps.inclusion import end_rate, end_slip
from quakedesign.rationals import fraction_of, to_sympy
from quakedesign.symbolic import SignedPower

_NAMES = {end_slip: "slip", end_rate: "rate"}
_DIGITS = 60
_WIDTH = Fraction(1, 10**40)  # relative, around numbers that are no fractions


def implicit_pull(controller: Controller, step: Fraction, authority: Fraction) -> tuple[Power, ...]:
    """q of w = e2 − q(e1 + T_s·w, w), for the scheme ``compensated``.

    Parameters
    ----------
    controller : Controller
    step, authority : Fraction
        T_s [s], B0 [m²/kg].

    Raises
    ------
    UnsupportedError
        For a law with a feed-forward, or whose pressure is no falling sum of signed powers of the errors.
    """
    pull, feed_forward, _ = _derived(Law.of(controller, 0.0))
    if feed_forward != 0:
        raise UnsupportedError("a law with a feed-forward has no guarantee in an implicit step. Use feedforward none.")
    numbers = {discrete_law.step: to_sympy(step), discrete_law.authority: to_sympy(authority)}
    return _terms(-pull.xreplace(numbers))


@lru_cache(maxsize=256)
def _derived(law: Law) -> tuple[sp.Expr, ...]:
    """For every T_s and B0; searches ask for the same few scales again and again."""
    return Compensated.derive(law)


def _terms(expression: sp.Expr) -> tuple[Power, ...]:
    """Terms of an expression that never falls."""
    return tuple(_term(part) for part in sp.Add.make_args(sp.expand_mul(expression)))


def _term(expression: sp.Expr) -> Power:
    factor, core = expression.as_independent(end_slip, end_rate, as_Add=False)
    if factor.is_nonnegative and core in _NAMES:
        return Power(factor=_enclosed(factor), exponent=Fraction(1), argument=_NAMES[core])
    if factor.is_nonnegative and isinstance(core, SignedPower) and core.args[1].is_Rational:
        inner = _NAMES.get(core.args[0]) or _terms(core.args[0])
        return Power(factor=_enclosed(factor), exponent=fraction_of(core.args[1]), argument=inner)
    raise UnsupportedError(
        "an implicit step with a guarantee needs a pressure that is a falling sum of signed powers. "
        f"Received the term {expression}. Use another law."
    )


def _enclosed(value: sp.Expr) -> tuple[Fraction, Fraction]:
    """Rational ends around a number, equal for a rational."""
    if value.is_Rational:
        return fraction_of(value), fraction_of(value)
    near = fraction_of(sp.Rational(str(value.evalf(_DIGITS))))
    return near * (1 - _WIDTH), near * (1 + _WIDTH)
