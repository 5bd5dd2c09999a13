"""Rationals with few digits for numbers that a design proposes."""

from fractions import Fraction
from math import floor, log10

_DIGITS = 4


def short(value: float, digits: int = _DIGITS) -> Fraction:
    """Rational with few decimal digits near a float."""
    if not value:
        return Fraction(0)
    unit = Fraction(10) ** (floor(log10(abs(value))) + 1 - digits)
    return round(Fraction(value) / unit) * unit
