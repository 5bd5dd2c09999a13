"""What an implicit step does with an estimate of the disturbance in place of integral states; simulated and proved.

Both functions take floats, SymPy and CasADi expressions. The estimate d follows what the slip rate did over the last
period beyond T_s·B0·p, and the pressure takes the slip rate to the end w of the step, less d.
"""

from fractions import Fraction
from typing import Any

import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.loop.implicit_root import ImplicitRoot
from quakedesign.loop.laws import LinearLaw
from quakedesign.rationals import fraction_of, to_sympy

_STATES = ("rate_error_before", "push_before", "disturbance")


def followed(rate_error: Any, before: Any, pushed: Any, estimate: Any, weight: Any, gain: Any) -> Any:
    """d ← d + a[(e2 − e2⁻)/(T_sB0) − p⁻ − d] [Pa], with the gain T_sB0 [m/(s Pa)]."""
    return estimate + weight * ((rate_error - before) / gain - pushed - estimate)


def answered(rate_error: Any, end_rate: Any, estimate: Any, gain: Any) -> Any:
    """p = (w − e2)/(T_sB0) − d [Pa]."""
    return (end_rate - rate_error) / gain - estimate


def compensated(root: ImplicitRoot, weight: Fraction, gain: Fraction) -> LinearLaw:
    """The compensated step as matrices; its states are e2⁻, T_sB0·p⁻ and T_sB0·d, all in m/s, for numbers of one size.

    The first sample, before which there is none, says nothing of the disturbance: there e2⁻ = e2.

    Parameters
    ----------
    root : ImplicitRoot
        Of the step's end w.
    weight : Fraction
        a [-], above 0 and at most 1.
    gain : Fraction
        T_sB0 [m/(s Pa)], positive.

    Raises
    ------
    ParameterError
    """
    if not 0 < weight <= 1 or gain <= 0:
        raise ParameterError(
            "a compensated step needs a weight in (0, 1] and a positive gain. Received "
            f"{float(weight):.4g} and {float(gain):.4g}. Change them."
        )
    known = before, pushed, estimate, _, rate_error, end_rate = sp.symbols("before pushed estimate e1 e2 w")
    share, size = to_sympy(weight), to_sympy(gain)
    level = followed(rate_error, before, pushed / size, estimate / size, share, size)
    pressure = answered(rate_error, end_rate, level, size)
    rows = [_coefficients(expression, known) for expression in (rate_error, size * pressure, size * level)]
    output = _coefficients(pressure, known)
    return LinearLaw(
        states=_STATES,
        update=tuple(row[:3] for row in rows),
        measured=tuple(row[3:] for row in rows),
        output=output[:3],
        feedback=output[3:],
        root=root,
        first=tuple(tuple(Fraction(k == 1 == entry) for k in (0, 1)) for entry in (1, 0, 0)),
        applied=(Fraction(0), gain, Fraction(0)),
    )


def _coefficients(expression: sp.Expr, known: tuple[sp.Symbol, ...]) -> tuple[Fraction, ...]:
    """Of a linear expression."""
    expanded = sp.expand(expression)
    return tuple(fraction_of(sp.Rational(expanded.coeff(symbol))) for symbol in known)
