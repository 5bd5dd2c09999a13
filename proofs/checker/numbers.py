"""Rationals and polynomials: read strictly, computed exactly, every step counted.

A polynomial maps tuples of exponents to nonzero fractions. A broken rule raises `Refused`; `budget` counts what the
arithmetic costs, before it is done, so that every file ends in bounded time and memory.
"""

import json
import re
from collections.abc import Collection, Iterable
from fractions import Fraction
from itertools import accumulate, product
from math import lcm, prod
from typing import Any, NoReturn

# Limits of the cost of a hostile file; honest files stay far below.
MAX_BYTES, MAX_NESTING = 4 * 2**20, 12
MAX_POLYNOMIAL = 20_000  # terms
MAX_DENOMINATOR_BITS = 2**14  # common denominator of a Gram matrix, of weights or of a polynomial
MAX_STEPS = 3 * 10**7  # about a microsecond each

RATIONAL = re.compile(r"-?(0|[1-9][0-9]{0,399})(/[1-9][0-9]{0,399})?")
INTEGER = re.compile(r"0|[1-9][0-9]{0,2}")
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")
STRING = re.compile(r'"(?:[^"\\]++|\\.)*+"?', re.DOTALL)  # cannot fail once begun, hence linear

Exponents = tuple[int, ...]
Number = Fraction | int
Polynomial = dict[Exponents, Number]  # integers where this saves time


class Refused(Exception):
    """The file is no valid certificate, for the reason given."""


def need(condition: bool, where: str, expected: str, received: object) -> None:
    """Refuse the file unless the condition holds, in one line of ASCII."""
    if condition:
        return
    text = ascii(received)
    raise Refused(f"{where} must be {expected}. Received {text if len(text) < 60 else text[:57] + '...'}")


# ---------------------------------------------------------------- steps


class Budget:
    """Steps left for the file that is verified."""

    def __init__(self) -> None:
        self.renew()

    def renew(self) -> None:
        """Begin another file."""
        self.left = MAX_STEPS

    def spend(self, steps: int, bits: int) -> None:
        """Count steps on integers of the given length; division is quadratic in it."""
        self.left -= steps * (1 + (bits * bits >> 20))
        need(self.left >= 0, "the verification", "done in fewer steps; shorten terms or digits", MAX_STEPS)


budget = Budget()


# ---------------------------------------------------------------- reading and writing


def refuse_number(text: str) -> NoReturn:
    """Refuse floats, NaN and infinities."""
    raise Refused(f"a number must be an integer or a rational in a string. Received {text[:50]!a}")


def read_integer(text: str) -> int:
    """Convert a non-negative integer; no integer of the format has more than three digits."""
    need(INTEGER.fullmatch(text) is not None, "an integer", "0 or [1-9][0-9]* of at most 3 digits", text)
    return int(text)


def read_pairs(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Make a JSON object, refusing a key that occurs twice."""
    result: dict[str, Any] = {}
    for key, value in pairs:
        need(key not in result, "a key", "unique in its object", key)
        result[key] = value
    return result


def parse(text: str) -> Any:
    """Parse JSON after checking its size and nesting."""
    size = len(text.encode("utf-8", "surrogatepass"))
    need(size <= MAX_BYTES, "the file", f"at most {MAX_BYTES} bytes long", size)
    brackets = re.findall(r"[\[\]{}]", STRING.sub("", text))
    depth = max(accumulate((1 if bracket in "[{" else -1 for bracket in brackets), initial=0))
    need(depth <= MAX_NESTING, "nesting", f"at most {MAX_NESTING} deep", depth)
    try:
        options: dict[str, Any] = {"parse_float": refuse_number, "parse_constant": refuse_number}
        return json.loads(text, parse_int=read_integer, object_pairs_hook=read_pairs, **options)
    except (ValueError, RecursionError) as error:
        raise Refused(f"the file must be JSON: {ascii(str(error))[:80]}") from None


def read_list(value: Any, where: str, least: int, most: int) -> list[Any]:
    """Check that a value is a list of admissible length."""
    need(type(value) is list, where, "a list", value)
    need(least <= len(value) <= most, where, f"a list of {least} to {most} entries", len(value))
    return value  # type: ignore[no-any-return]


def read_object(value: Any, where: str, keys: Iterable[str] | None = None) -> dict[str, Any]:
    """Check that a value is an object and, where keys are given, that it has exactly these."""
    need(type(value) is dict, where, "an object", value)
    for key in keys or ():
        need(key in value, where, f"complete; {key} is missing", list(value))
    for key in value if keys is not None else ():
        need(key in set(keys or ()), where, "without unknown keys", key)
    return value  # type: ignore[no-any-return]


def read_rational(value: Any, where: str, *, positive: bool = False) -> Fraction:
    """Convert a rational in canonical form."""
    matches = type(value) is str and RATIONAL.fullmatch(value) is not None
    need(matches, where, 'a string such as "-3/2", each part of at most 400 digits', value)
    numerator, _, denominator = value.partition("/")
    number = Fraction(int(numerator), int(denominator or 1))
    need(str(number) == value, where, "in lowest terms", value)
    need(number > 0 or not positive, where, "positive", value)
    return number


def read_name(value: Any, where: str) -> str:
    """Check a name."""
    valid = type(value) is str and NAME.fullmatch(value) is not None
    need(valid, f"a name in {where}", "[A-Za-z][A-Za-z0-9_]*, up to 40", value)
    return value  # type: ignore[no-any-return]


def read_exponents(value: Any, where: str, size: int, most: int) -> Exponents:
    """Convert a list of integers, one for every variable."""
    for entry in read_list(value, where, size, size):
        need(type(entry) is int and entry <= most, where, f"a list of integers up to {most}", entry)
    return tuple(value)


def read_polynomial(value: Any, where: str, size: int, *, positive: bool = False) -> Polynomial:
    """Read an object such as {"2,0": "1/3"}: exponents and nonzero or positive coefficients."""
    polynomial: Polynomial = {}
    need(len(read_object(value, where)) <= MAX_POLYNOMIAL, where, f"of at most {MAX_POLYNOMIAL} terms", len(value))
    for key, text in value.items():
        parts = key.split(",", size)
        valid = len(parts) == size and all(INTEGER.fullmatch(part) for part in parts)
        need(valid, where, "an object with keys such as '2,0,0', an integer for every variable", key)
        number = read_rational(text, where, positive=positive)
        need(number != 0, where, "without zeros", key)
        polynomial[tuple(map(int, parts))] = number
    return polynomial


def read_polynomials(value: Any, where: str, size: int, least: int, most: int) -> list[Polynomial]:
    """Read a list of polynomials."""
    return [read_polynomial(entry, where, size) for entry in read_list(value, where, least, most)]


def named(numbers: dict[str, Any]) -> str:
    """Write names and numbers."""
    return ", ".join(f"{name} = {number}" for name, number in numbers.items()) or "none"


# ---------------------------------------------------------------- arithmetic


def length(number: Number) -> int:
    """Bits of the longer one of numerator and denominator."""
    return max(number.numerator.bit_length(), number.denominator.bit_length())


def times(first: Exponents, second: Exponents) -> Exponents:
    """Multiply two monomials."""
    return tuple(map(sum, zip(first, second, strict=True)))


def add(total: dict[Any, Any], key: Any, value: Any) -> None:
    """Add to one coefficient of a sum; a zero is dropped."""
    before = total.pop(key, 0)
    budget.spend(6, length(before) + length(value))  # a product of fractions and its sum cost six integer operations
    if before + value:
        total[key] = before + value


def add_scaled(first: Polynomial, scale: Fraction, second: Polynomial) -> Polynomial:
    """Return first + scale * second."""
    total = dict(first)
    for exponents, number in second.items():
        add(total, exponents, scale * number)
    return total


def add_product(total: dict[Any, Any], first: dict[Any, Any], second: dict[Any, Any]) -> dict[Any, Any]:
    """Add the product of two polynomials, with fractions or integers for coefficients, to a third."""
    for (a, x), (b, y) in product(first.items(), second.items()):
        add(total, times(a, b), x * y)
        need(len(total) <= MAX_POLYNOMIAL, "an expanded polynomial", f"of at most {MAX_POLYNOMIAL} terms", "more")
    return total


def to_integers(numbers: Collection[Number], where: str) -> tuple[list[int], int]:
    """Return the numbers times their common denominator, and this denominator."""
    common = 1
    for denominator in {number.denominator for number in numbers}:
        common = lcm(common, denominator)
        bits = common.bit_length()
        need(bits <= MAX_DENOMINATOR_BITS, where, f"of common denominator < 2^{MAX_DENOMINATOR_BITS}", bits)
    return [number.numerator * (common // number.denominator) for number in numbers], common


def multiply(factors: list[Number], bases: Iterable[Fraction], exponents: Exponents) -> Number:
    """Multiply numbers and powers of numbers."""
    for base, exponent in zip(bases, exponents, strict=True):
        if exponent:
            budget.spend(1, exponent * length(base))
            factors = [*factors, base**exponent]
    budget.spend(6 * len(factors), sum(map(length, factors)))
    return prod(factors)
