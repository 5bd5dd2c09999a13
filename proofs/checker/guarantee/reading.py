"""Reading of certificates of a guarantee: texts, rationals, rows, and why a file is refused."""

import json
import re
from collections.abc import Iterator
from decimal import Decimal
from fractions import Fraction
from hashlib import sha256
from typing import Any

from ..numbers import Refused

RATIONAL = re.compile(r"-?(0|[1-9][0-9]{0,399})(/[1-9][0-9]{0,399})?")
Row = list[Fraction]
NAMES = ("name", "states")  # nothing depends on them
LISTED = 64  # most entries of a list that is printed
LONGEST = 24  # most characters of a fraction that is printed


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
    need(canonical, f'{where} must be a rational such as "-3/2", each part of at most 400 digits')
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


def upper(value: Fraction, digits: int = 4) -> str:
    """Decimal with so many digits, at most 15, that is not below the number."""
    bits = value.numerator.bit_length() - value.denominator.bit_length()
    exponent = bits * 30103 // 100000 - digits - 1  # of a number of any length; log10(2) = 0.30103
    while abs(shown := -(-value // Fraction(10) ** exponent)) >= 10**digits:
        exponent += 1
    if abs(exponent) > 300:  # beyond what a float holds
        return f"{shown}e{exponent}"
    return f"{float(f'{shown}e{exponent}'):.{digits}g}"


def lower(value: Fraction, digits: int = 4) -> str:
    """Decimal with so many digits that is not above the number."""
    text = upper(-value, digits)
    return text[1:] if text.startswith("-") else text if text == "0" else f"-{text}"


def exact(value: Fraction) -> str:
    """Decimal if one of 15 digits is the number itself, else p/q."""
    text = upper(value, 15)
    return text if Fraction(text) == value else str(value)


def inside(low: Fraction, high: Fraction) -> str:
    """A verified range: a point exactly, else ends rounded inward."""
    if low == high:
        return f"= {exact(low)}"
    for digits in range(4, 16):
        ends = upper(low, digits), lower(high, digits)
        if Fraction(ends[0]) < Fraction(ends[1]):
            return f"in [{ends[0]}, {ends[1]}]"
    return f"in [{low}, {high}]"


def entries(document: dict[str, Any]) -> list[str]:
    """All entries of a file except names, in SI units, the claims included, and its hash.

    Rounded numbers are marked; the SHA-256 is that of all entries except names and claims, as JSON with sorted keys.
    """
    parts = {key: unnamed(value) for key, value in document.items() if key not in ("format", "kind")}
    claims = parts.pop("claims")
    bounds = (
        f"{name} {(lower if name.startswith('least') else upper)(Fraction(claims[name]), 6)}" for name in sorted(claims)
    )
    canonical = json.dumps(parts, sort_keys=True, separators=(",", ":"))
    return [
        "entries in SI units, see FORMAT.md; ~ marks rounding to nearest, claims are rounded outward:",
        *(f"{key}: {'; '.join(written(parts[key]))}" for key in sorted(parts)),
        f"claims: {', '.join(bounds)}",
        f"SHA-256 of the entries without claims: {sha256(canonical.encode()).hexdigest()}",
    ]


def unnamed(value: Any) -> Any:
    """The same without names."""
    if type(value) is dict:
        return {key: unnamed(entry) for key, entry in value.items() if key not in NAMES}
    return value


def written(value: Any, name: str = "") -> Iterator[str]:
    """Plain entries of an object in one text, then its objects, each behind its name; keys are sorted."""
    if type(value) is not dict:
        yield plain(value)
        return
    flat = [f"{key} {plain(value[key])}" for key in sorted(value) if type(value[key]) is not dict]
    if flat:
        yield f"{name} " * bool(name) + ", ".join(flat)
    for key in sorted(value):
        if type(value[key]) is dict:
            yield from written(value[key], f"{name} {key}".strip())


def plain(value: Any) -> str:
    """An entry of a list, or a list; a long one by its number of entries."""
    if type(value) is list:
        many = leaves(value)
        return f"({many} entries)" if many > LISTED else f"[{', '.join(map(plain, value))}]"
    if type(value) is dict:
        return f"{{{'; '.join(written(value))}}}"
    canonical = type(value) is str and RATIONAL.fullmatch(value) is not None
    return short(Fraction(value)) if canonical else str(value)


def leaves(value: Any) -> int:
    """Number of entries; an empty list is one."""
    parts = value.values() if type(value) is dict else value if type(value) is list else []
    return sum(map(leaves, parts)) or 1


def short(value: Fraction) -> str:
    """A number exactly, in at most 15 digits or as a short fraction, else rounded to six digits."""
    numerator, denominator = Decimal(value.numerator), Decimal(value.denominator)
    for text in (f"{float(numerator / denominator):.15g}", str(value)):
        if len(text) <= LONGEST and "n" not in text and Fraction(text) == value:
            return text
    return f"~{numerator / denominator:.6g}"
