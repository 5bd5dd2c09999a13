"""The root of an implicit step lies between two lines, shown by halving the range of e1 (FORMAT.md)."""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from .matrices import BITS
from .reading import Row, keys, need, number, row

MAX_TERMS, MAX_POWER = 16, 6
CELLS = 10  # how often the range of e1 is halved
Sum = list[tuple[Row, Fraction, Any]]


@dataclass
class Root:
    """w of w = e2 - q(e1 + step*w, w), said to lie between two lines: see FORMAT.md."""

    pull: Sum
    slopes: Row
    remainder: Fraction


def read_root(value: Any) -> Root:
    """Read q, the slopes of both lines and the remainder."""
    given = keys(value, "root", "pull", "slopes", "remainder")
    slopes, remainder = row(given["slopes"], "slopes", 2), number(given["remainder"], "remainder")
    need(0 <= slopes[0] <= slopes[1] <= 1 and remainder >= 0, "slopes must be ordered in [0, 1], the remainder >= 0")
    pull = read_sum(given["pull"])
    need(count_terms(pull) <= MAX_TERMS, f"an implicit step must have at most {MAX_TERMS} terms")
    return Root(pull, slopes, remainder)


def read_sum(value: Any) -> Sum:
    """Terms: ends of the factor, power, and its base."""
    need(type(value) is list and 0 < len(value) <= MAX_TERMS, "a sum must be a list of its terms, at most 16")
    found = []
    for term in value:
        given = keys(term, "a term", "factor", "power", "of")
        factor, power, inner = row(given["factor"], "factor", 2), number(given["power"], "power"), given["of"]
        need(0 <= factor[0] <= factor[1], "a factor must be two ends in order, not negative")
        need(0 <= power.numerator <= MAX_POWER and power.denominator <= MAX_POWER, "powers must be p/q with p, q <= 6")
        plain = type(inner) is str
        need(not plain or inner in ("slip", "rate"), "a term must be of slip, of rate or of a sum")
        found.append((factor, power, inner if plain else read_sum(inner)))
    return found


def count_terms(terms: Sum) -> int:
    """Terms of a sum and of the sums in it."""
    return len(terms) + sum(count_terms(inner) for _, _, inner in terms if type(inner) is not str)


def least(terms: Sum, slip: Fraction, rate: Fraction) -> Fraction:
    """Lower bound of q at these arguments or larger ones, the sign of 0 taken as 1; a multiple of 2^-BITS."""
    total = 0
    for (low, high), power, inner in terms:
        value = least(inner, slip, rate) if type(inner) is not str else slip if inner == "slip" else rate
        factor, shift = (low, 0) if value >= 0 else (-high, 1)
        size = power_below(abs(value), power) + shift
        total += factor.numerator * size // factor.denominator
    return Fraction(total, 1 << BITS)


def power_below(value: Fraction, power: Fraction) -> int:
    """Floor of value^power in units of 2^-BITS, for a value that is not negative."""
    p, q = power.numerator, power.denominator
    return whole_root((value.numerator**p << BITS * q) // value.denominator**p, q)


def whole_root(value: int, q: int) -> int:
    """Floor of the q-th root, by Newton's steps from above."""
    found = 1 << value.bit_length() // q + 1
    while value:
        following = ((q - 1) * found + value // found ** (q - 1)) // q
        if following >= found:
            return found
        found = following
    return 0


def root_within(root: Root, step: Fraction, slip: Fraction, rate: Fraction) -> bool:
    """Whether |w + g*e1/step| <= remainder, for some g between the slopes, is shown for |e1| <= slip, |e2| <= rate."""
    low, high = root.slopes
    parts = [(1 - low, -low, Fraction(0), slip / step, 0), (high - 1, high, Fraction(0), slip / step, 0)]
    while parts:
        away, along, start, end, depth = parts.pop()
        ahead, at = (root.remainder + min(v * start, v * end) for v in (away, along))
        if at - rate + least(root.pull, step * ahead, at) < 0:
            if depth == CELLS:
                return False
            middle = (start + end) / 2
            parts += [(away, along, start, middle, depth + 1), (away, along, middle, end, depth + 1)]
    return True
