"""What a certificate of the kind ``guarantee`` is read with: texts, rationals, rows, and why a file is refused."""

import re
from fractions import Fraction
from typing import Any

from exact_numbers import Refused

RATIONAL = re.compile(r"-?(0|[1-9][0-9]{0,399})(/[1-9][0-9]{0,399})?")
Row = list[Fraction]


def need(condition: bool, reason: str) -> None:
    """Refuse the file unless the condition holds."""
    if not condition:
        raise Refused(reason)


def keys(value: Any, where: str, *names: str) -> dict[str, Any]:
    """Object with exactly these keys."""
    need(type(value) is dict and set(value) == set(names), f"{where} must have exactly the keys {', '.join(names)}")
    return value  # type: ignore[no-any-return]


def number(value: Any, where: str) -> Fraction:
    """Rational in canonical form."""
    canonical = type(value) is str and RATIONAL.fullmatch(value) is not None
    need(canonical, f'{where} must be a rational such as "-3/2", at most 400 digits above and below')
    top, _, bottom = value.partition("/")
    found = Fraction(int(top), int(bottom or 1))
    need(str(found) == value, f"{where} must be in lowest terms")
    return found


def numbers(value: Any, where: str, *names: str) -> dict[str, Fraction]:
    """Object of rationals with exactly these keys."""
    return {name: number(v, f"{where}.{name}") for name, v in keys(value, where, *names).items()}


def row(value: Any, where: str, length: int) -> Row:
    """List of so many rationals."""
    need(type(value) is list and len(value) == length, f"{where} must be a list of {length} rationals")
    return [number(v, where) for v in value]


def matrix(value: Any, where: str, height: int, width: int) -> list[Row]:
    """List of rows."""
    need(type(value) is list and len(value) == height, f"{where} must have {height} rows")
    return [row(v, where, width) for v in value]


def upper(value: Fraction) -> str:
    """Decimal with four digits that is not below the number."""
    bits = value.numerator.bit_length() - value.denominator.bit_length()
    exponent = bits * 30103 // 100000 - 5  # of a number of any length; log10(2) = 0.30103
    digits = -(-value // Fraction(10) ** exponent)
    while abs(digits) >= 10**4:
        exponent += 1
        digits = -(-value // Fraction(10) ** exponent)
    if abs(exponent) > 300:  # beyond what a float holds
        return f"{digits}e{exponent}" if digits else "0"
    return f"{float(f'{digits}e{exponent}'):.4g}"


def lower(value: Fraction) -> str:
    """Decimal with four digits that is not above the number."""
    text = upper(-value)
    return text[1:] if text.startswith("-") else text if text == "0" else f"-{text}"
