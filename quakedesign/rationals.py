"""The one place where numbers become exact: decimal text and floats in, `fractions.Fraction` out."""

import math
import re
import sys
from decimal import Decimal
from fractions import Fraction
from numbers import Rational, Real
from typing import TYPE_CHECKING, Any

from quakedesign.errors import ParameterError

if TYPE_CHECKING:
    import sympy as sp

_DIGITS = 308  # so that float() of the number neither overflows nor vanishes
_NUMBER = re.compile(r"[+-]?(\d+(/\d+)?|(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?)", re.ASCII)


def rational(value: float | str | Fraction, name: str = "value") -> Fraction:
    """Exact value of a decimal, an exponent form, a fraction p/q, or a float read as its shortest decimal.

    Parameters
    ----------
    value : float, int, str or Fraction
        Number, also one of NumPy or SymPy; a float means the decimal that Python prints for it, so 0.1 is 1/10.
    name : str
        What the number is, for the message.

    Returns
    -------
    Fraction

    Raises
    ------
    ParameterError
        When the value is not a finite number of at most 300 characters and 308 digits, or has more digits than a float
        without being a rational.
    """
    if isinstance(value, Fraction):
        return value if type(value) is Fraction else Fraction(value)
    exact = _read(value, name)
    if max(abs(exact.numerator), exact.denominator) >= 10**_DIGITS:
        raise ParameterError(f"{name} must have at most {_DIGITS} digits. Received more. Round it, or check its unit.")
    return exact


def _read(value: object, name: str) -> Fraction:
    if isinstance(value, Rational) and not isinstance(value, bool):
        return Fraction(int(value.numerator), int(value.denominator))
    number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else value
    if isinstance(number, float) and number != value and not math.isnan(number):
        raise ParameterError(
            f"{name} must be a float, a rational or text. Received {value!r:.60}, which is no float. Give it as text."
        )
    written = number.strip() if isinstance(number, str) else repr(number)
    if len(written) > 300 or not _NUMBER.fullmatch(written) or re.search(r"/0+$", written):
        raise ParameterError(
            f"{name} must be a finite number: a decimal, an exponent form or p/q, in at most 300 characters. "
            f"Received {written[:60]!r}. Write for example {_instead(written)}."
        )
    return Fraction(written)


def _instead(written: str) -> str:
    """A number that may be meant."""
    share = written.removesuffix("%").strip()
    if share != written and len(share) <= 20 and _NUMBER.fullmatch(share) and "/" not in share:
        return f"{float(share) / 100:g}"
    return "2.3, 4.51e-4 or 23/10"


def nearest(value: float, denominator: int) -> Fraction:
    """Multiple of 1/denominator that is nearest to a float.

    Raises
    ------
    ParameterError
        When the float is not finite.
    """
    if not math.isfinite(value):
        raise ParameterError(f"a finite number is needed for rounding. Received {value!r}.")
    return Fraction(round(Fraction(value) * denominator), denominator)


def fraction_of(value: Any) -> Fraction:
    """Fraction of a rational of python-flint or SymPy, both of which have p and q."""
    return Fraction(int(value.p), int(value.q))


def end_of(ball: Any) -> Fraction:
    """Fraction of an exact ball of python-flint, such as an end of another."""
    return fraction_of(ball.fmpq())


def fraction_of_float(value: "sp.Float") -> Fraction:
    """Fraction of a float of SymPy: as `rational` reads it where it is one of Python's, else its exact value."""
    import sympy as sp

    near = float(value)
    return rational(near) if sp.Float(near) == value else fraction_of(sp.Rational(value))


def to_sympy(value: Fraction) -> "sp.Rational":
    """Rational of SymPy."""
    import sympy as sp

    return sp.Rational(value.numerator, value.denominator)


def exact_text(value: Any) -> str:
    """A rational as p/q, or p, whatever its length: ``str`` refuses more than 4300 digits, `Decimal` none.

    What is no rational of Python is written by ``str``.
    """
    if not isinstance(value, Rational):
        return str(value)
    numerator, denominator = (str(Decimal(int(part))) for part in (value.numerator, value.denominator))
    return numerator if denominator == "1" else f"{numerator}/{denominator}"


def float_above(value: Fraction) -> float:
    """Float at or just above a rational, infinite above the largest."""
    try:
        number = float(value)
    except OverflowError:
        return math.inf if value > 0 else -sys.float_info.max
    return number if Fraction(number) >= value else math.nextafter(number, math.inf)


def float_below(value: Fraction) -> float:
    """Float at or just below a rational."""
    return -float_above(-value)


def shortly(value: Fraction | float) -> str:
    """A number as floats are written, or six digits of one that no float holds."""
    try:
        return f"{float(value):.6g}"
    except OverflowError:
        return six_digits(Fraction(value))


def six_digits(value: Fraction) -> str:
    """Six digits, to nearest, for people; Decimal has no largest number as floats have."""
    return f"{Decimal(value.numerator) / Decimal(value.denominator):.6g}"
