"""Certified numbers, which are printed on their outer side only: an upper bound is rounded up, a lower one down.

A bound is a `fractions.Fraction`, so that it is compared and computed with exactly. What is computed from it is a plain
fraction: whether that is a bound again, and of which side, says the code that computed it.
"""

import math
import re
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction
from typing import ClassVar

from quakedesign.errors import ParameterError
from quakedesign.rationals import exact_text, float_above, float_below

_SPEC = re.compile(
    r"(?P<align>.?[<>^])?(?P<sign>[-+ ]?)(?P<width>([1-9]\d*)?)(\.(?P<digits>\d+))?(?P<kind>[eEfFgG%]?)", re.ASCII
)
_PREFIXES = {3 * i - 18: prefix for i, prefix in enumerate("a f p n µ m  k M G T P E".split(" "))}


class Bound(Fraction):
    """Exact bound of a certified quantity; `UpperBound` and `LowerBound` are its two sides.

    ``str`` and ``repr`` show six digits, ``format`` as many as it is told, ``float`` the nearest float, all on the
    outer side. `exact` is the only text that is the number itself.
    """

    __slots__ = ()
    _side: ClassVar[str]

    @property
    def exact(self) -> str:
        """The number itself, p/q."""
        return exact_text(Fraction(self))

    def quantity(self, unit: str, digits: int = 3) -> str:
        """Text with a unit and its engineering prefix, such as ``20.1 MPa``.

        Parameters
        ----------
        unit : str
            One that takes prefixes, such as Pa, m or m/s.
        digits : int
            Significant ones, at least those before the point.
        """
        _, exponent = self._significant(digits)
        power = min(max(3 * (exponent // 3), -18), 18)
        shown = format(type(self)(self / Fraction(10) ** power), f".{max(digits - 1 - exponent + power, 0)}f")
        return f"{_bare(shown)} {_PREFIXES[power]}{unit}"

    def __str__(self) -> str:
        return format(self, "")

    def __repr__(self) -> str:
        return f"{type(self).__name__}('{self}')"

    def __format__(self, spec: str) -> str:
        """Decimal on the outer side, within a unit of its last digit.

        Parameters
        ----------
        spec : str
            Alignment, sign, width, precision, and one of ``e``, ``f``, ``g``, ``%``, as for a float.

        Raises
        ------
        ValueError
            For any other.
        """
        match = _SPEC.fullmatch(spec)
        if match is None:
            raise ValueError(f"a format of a bound must be one of e, f, g or %, as '.3g'. Received {spec!r}.")
        digits = int(match["digits"]) if match["digits"] else 6
        kind = match["kind"].lower() or "g"
        text = {"e": self._scientific, "f": self._fixed, "g": self._general, "%": self._percent}[kind](digits)
        sign = "-" if text.startswith("-") else match["sign"].replace("-", "")
        text = sign + text.removeprefix("-")
        text = text.upper() if match["kind"].isupper() else text
        return format(text, f"{match['align'] or '>'}{match['width']}")

    def _significant(self, digits: int) -> tuple[Decimal, int]:
        """Outer decimal of so many digits, and the power of ten of its first."""
        context = Context(prec=max(digits, 1), rounding=self._side)
        found = context.divide(Decimal(self.numerator), Decimal(self.denominator))
        return found, found.adjusted()

    def _whole(self, factor: int) -> int:
        """Outer whole multiple of 1/factor."""
        return (math.ceil if self._side == ROUND_CEILING else math.floor)(self * factor)

    def _scientific(self, digits: int) -> str:
        number, exponent = self._significant(digits + 1)
        return f"{_mantissa(number, exponent, digits)}e{exponent:+03d}"

    def _fixed(self, digits: int) -> str:
        return _fixed(self._whole(10**digits), digits)

    def _percent(self, digits: int) -> str:
        return _fixed(self._whole(10 ** (digits + 2)), digits) + "%"

    def _general(self, digits: int) -> str:
        number, exponent = self._significant(digits)
        if -4 <= exponent < max(digits, 1):
            return _bare(format(number, "f"))
        return f"{_bare(_mantissa(number, exponent, digits))}e{exponent:+03d}"


class UpperBound(Bound):
    """Not exceeded: a peak, a settling time, what a premise requires. Rounded up."""

    __slots__ = ()
    _side = ROUND_CEILING

    def __float__(self) -> float:
        return float_above(Fraction(self))


class LowerBound(Bound):
    """Reached at least: a longest step, a margin, a decay rate, what a certificate covers. Rounded down."""

    __slots__ = ()
    _side = ROUND_FLOOR

    def __float__(self) -> float:
        return float_below(Fraction(self))


@dataclass(frozen=True, slots=True)
class Enclosure:
    """Interval that contains a quantity: printed, it contains it still.

    Attributes
    ----------
    low : LowerBound
    high : UpperBound

    Raises
    ------
    ParameterError
        For ends in the wrong order.
    """

    low: LowerBound
    high: UpperBound

    def __post_init__(self) -> None:
        if self.low > self.high:
            raise ParameterError(f"an enclosure must run from low to high. Received {self}. Swap its ends.")

    @classmethod
    def of(cls, low: Fraction, high: Fraction) -> "Enclosure":
        """Enclosure by its two exact ends."""
        return cls(LowerBound(low), UpperBound(high))

    def __format__(self, spec: str) -> str:
        return f"{self.low:{spec}} to {self.high:{spec}}"

    def __str__(self) -> str:
        return format(self, "")


def _mantissa(number: Decimal, exponent: int, digits: int) -> str:
    """Number over its power of ten, with so many places; exact, since it has no more digits."""
    sign, figures, _ = number.as_tuple()
    written = "".join(map(str, figures)).ljust(digits + 1, "0")
    whole = f"{written[0]}.{written[1:]}" if digits else written[0]
    return f"-{whole}" if sign else whole


def _fixed(count: int, places: int) -> str:
    """Decimal text of count·10^(−places)."""
    written = str(abs(count)).rjust(places + 1, "0")
    whole = f"{written[:-places]}.{written[-places:]}" if places else written
    return f"-{whole}" if count < 0 else whole


def _bare(text: str) -> str:
    """Decimal text without the zeros that say nothing."""
    return text.rstrip("0").rstrip(".") if "." in text else text
