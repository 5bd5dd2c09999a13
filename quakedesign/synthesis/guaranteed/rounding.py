"""Rationals with few digits for numbers that a design proposes."""

from collections.abc import Iterable
from fractions import Fraction
from math import floor, log10

_DIGITS = 4


def short(value: float, digits: int = _DIGITS) -> Fraction:
    """Rational with few decimal digits near a float."""
    if not value:
        return Fraction(0)
    unit = Fraction(10) ** (floor(log10(abs(value))) + 1 - digits)
    return round(Fraction(value) / unit) * unit


def rounded(rows: Iterable[Iterable[float]]) -> tuple[tuple[Fraction, ...], ...]:
    """The same of every entry of a matrix."""
    return tuple(tuple(short(float(v)) for v in row) for row in rows)
