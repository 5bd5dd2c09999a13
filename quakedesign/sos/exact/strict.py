"""JSON read strictly: canonical rationals, bounded sizes, no unknown or duplicate keys; one reason for a refusal."""

import json
import math
import re
from fractions import Fraction
from typing import Any

from quakedesign.errors import CertificateError

LARGEST_FILE = 4 << 20
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")
_RATIONAL = re.compile(r"(-?)(0|[1-9][0-9]{0,399})(?:/([1-9][0-9]{0,399}))?")
_EXPONENTS = re.compile(r"(0|[1-9][0-9]{0,2})(,(0|[1-9][0-9]{0,2}))*")
_GRID_BITS = 1 << 14


def parse(text: str) -> Any:
    """JSON value of a text.

    Raises
    ------
    CertificateError
        When it is no JSON, too deep, or has floats, long integers or duplicate keys.
    """
    if max(_depths(text), default=0) > 12:
        raise CertificateError("the file is nested deeper than 12 levels.")
    try:
        return json.loads(
            text, object_pairs_hook=_unique, parse_float=_no_float, parse_constant=_no_float, parse_int=_integer
        )
    except (json.JSONDecodeError, RecursionError) as error:
        raise CertificateError(f"the file is not JSON: {error}.") from None


def _depths(text: str):
    depth, in_string, escaped = 0, False, False
    for character in text:
        if in_string:
            in_string = escaped or character != '"'
            escaped = character == "\\" and not escaped
        elif character == '"':
            in_string, escaped = True, False
        elif character in "[{":
            depth += 1
            yield depth
        elif character in "]}":
            depth -= 1


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    need(len({k for k, _ in pairs}) == len(pairs), "a key occurs twice in one object")
    return dict(pairs)


def _no_float(text: str):
    raise CertificateError(f"numbers must be integers or texts of rationals; received {text[:20]}.")


def _integer(text: str) -> int:
    need(len(text) <= 3 and text != "-0", f"the integer {text[:20]} is out of range")
    return int(text)


def need(condition: bool, reason: str) -> None:
    """Refuse unless a condition holds."""
    if not condition:
        raise CertificateError(f"{reason}.")


def with_keys(raw: Any, keys: set[str]) -> dict[str, Any]:
    """Object with exactly the given keys."""
    need(isinstance(raw, dict) and set(raw) == keys, f"an object must have exactly the keys {', '.join(sorted(keys))}")
    return raw


def listed(raw: Any, what: str, limit: int | None = None, length: int | None = None) -> list[Any]:
    """List of bounded or given length."""
    need(isinstance(raw, list), f"{what} must be a list")
    need(limit is None or len(raw) <= limit, f"{what} is longer than {limit}")
    need(length is None or len(raw) == length, f"{what} must have {length} entries")
    return raw


def objected(raw: Any, what: str, limit: int) -> dict[str, Any]:
    """Object of bounded size."""
    need(isinstance(raw, dict) and len(raw) <= limit, f"{what} must be an object with at most {limit} entries")
    return raw


def read_rational(raw: Any) -> Fraction:
    """Canonical rational."""
    need(isinstance(raw, str), "a rational must be a text")
    match = _RATIONAL.fullmatch(raw)
    need(match is not None and raw != "-0" and match[3] != "1", f"{raw[:40]!r} is not a canonical rational")
    assert match is not None
    top, bottom = int(match[2]), int(match[3] or 1)
    need(math.gcd(top, bottom) == 1 and (top != 0 or match[3] is None), f"{raw[:40]!r} is not in lowest terms")
    return Fraction(-top if match[1] else top, bottom)


def read_rationals(raw: Any, what: str, limit: int) -> dict[str, Fraction]:
    """Object of names and rationals."""
    entries = objected(raw, what, limit)
    for name in entries:
        need(NAME.fullmatch(name) is not None, f"{name[:40]!r} in {what} is not a name")
    return {name: read_rational(v) for name, v in entries.items()}


def read_exponents(raw: Any, variables: int, largest: int) -> tuple[int, ...]:
    """Exponents from a list of integers."""
    entries = listed(raw, "exponents", length=variables)
    need(all(type(e) is int and 0 <= e <= largest for e in entries), f"exponents must be integers from 0 to {largest}")
    return tuple(entries)


def common_grid(gram: list[Fraction]) -> None:
    """Refuse a Gram matrix whose common denominator would make exact arithmetic slow."""
    common = 1
    for entry in gram:
        common = math.lcm(common, entry.denominator)
        need(common.bit_length() <= _GRID_BITS, f"the common denominator of a Gram matrix exceeds {_GRID_BITS} bits")


def read_polynomial(raw: Any, what: str, variables: int | None, limit: int) -> dict[tuple[int, ...], Fraction]:
    """Polynomial from an object of exponents to nonzero rationals; with `variables` None its keys are equally long."""
    polynomial: dict[tuple[int, ...], Fraction] = {}
    for key, number in objected(raw, what, limit).items():
        need(_EXPONENTS.fullmatch(key) is not None, f"{what} has a wrong key")
        parts = [int(part) for part in key.split(",")]
        variables = len(parts) if variables is None else variables
        exponents = read_exponents(parts, variables, 999)
        polynomial[exponents] = read_rational(number)
        need(polynomial[exponents] != 0, f"{what} has a zero coefficient")
    return polynomial


def polynomial_text(polynomial: Any) -> dict[str, str]:
    """Inverse of `read_polynomial`."""
    return {",".join(map(str, e)): str(c) for e, c in polynomial.items()}
