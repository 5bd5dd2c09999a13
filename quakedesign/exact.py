"""Exact rational numbers from decimal text and floats, and certified bounds.

Numbers of users, as text or floats, become `fractions.Fraction` here. The second chapter defines one-sided bounds and
enclosures, which are printed rounded outward (an upper bound up, a lower bound down).
"""

import math
import re
import sys
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction
from numbers import Rational, Real
from typing import TYPE_CHECKING, Any, ClassVar

from quakedesign.errors import ParameterError
from quakedesign.text import PREFIXES

if TYPE_CHECKING:
    import sympy as sp
    from flint import arb


# ----------------------------------------------------------------------
# Conversion of decimal text and floats to `fractions.Fraction`, for all numbers that are input.

_DIGITS = 308  # so that float() of the number neither overflows nor vanishes
_NUMBER = re.compile(r"[+-]?(\d+(/\d+)?|(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?)", re.ASCII)


def rational(value: float | str | Fraction, name: str = "value") -> Fraction:
    """Exact value of a decimal, an exponent form, a fraction p/q, or a float read as its shortest decimal.

    Parameters
    ----------
    value : float, int, str or Fraction
        Number, also one of NumPy or SymPy; a float means the decimal that Python prints for it, so 0.1 is 1/10.
    name : str
        Name of the number in error messages.

    Raises
    ------
    ParameterError
        When the value is not a finite number; has more than 300 characters or 308 digits (a `Fraction` may have any
        length); or has a real type that is not rational (such as a long double) and no float equals it.
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
            f"{name} must be a float, a rational or text. Received {value!r:.60}, which a float cannot represent. "
            "Give it as text."
        )
    written = number.strip() if isinstance(number, str) else repr(number)
    if len(written) > 300 or not _NUMBER.fullmatch(written) or re.search(r"/0+$", written):
        raise ParameterError(
            f"{name} must be a finite number: a decimal, an exponent form or p/q, in at most 300 characters. "
            f"Received {written[:60]!r}. Write for example {_example(written)}."
        )
    return Fraction(written)


def _example(written: str) -> str:
    """Example of a valid number, for the message on an invalid text."""
    percentage = written.removesuffix("%").strip()
    if percentage != written and len(percentage) <= 20 and _NUMBER.fullmatch(percentage) and "/" not in percentage:
        return f"{float(percentage) / 100:g}"
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


def end_of(ball: "arb") -> Fraction:
    """Fraction of a python-flint ball of radius 0, such as the end of a wider ball."""
    return fraction_of(ball.fmpq())


def fraction_of_float(value: "sp.Float") -> Fraction:
    """Fraction of a SymPy float: that of `rational` if it equals a Python float, else its exact value."""
    import sympy as sp

    near = float(value)
    return rational(near) if sp.Float(near) == value else fraction_of(sp.Rational(value))


def to_sympy(value: Fraction) -> "sp.Rational":
    """Rational of SymPy."""
    import sympy as sp

    return sp.Rational(value.numerator, value.denominator)


def exact_text(value: Any) -> str:
    """Text p/q, or p for an integer, of a rational of any length; ``str`` rejects integers of over 4300 digits.

    Values of other types are written by ``str``.
    """
    if not isinstance(value, Rational):
        return str(value)
    numerator, denominator = (str(Decimal(int(part))) for part in (value.numerator, value.denominator))
    return numerator if denominator == "1" else f"{numerator}/{denominator}"


def float_above(value: Fraction) -> float:
    """Smallest float that is not below a rational; infinity above the largest float."""
    try:
        number = float(value)
    except OverflowError:
        return math.inf if value > 0 else -sys.float_info.max
    return number if Fraction(number) >= value else math.nextafter(number, math.inf)


def float_below(value: Fraction) -> float:
    """Largest float that is not above a rational; −infinity below the least float."""
    return -float_above(-value)


def shortly(value: Fraction | float) -> str:
    """Text of a number with six digits, also outside the range of floats."""
    try:
        number = float(value)
    except OverflowError:
        return six_digits(Fraction(value))
    return f"{number:.6g}" if number or not value else six_digits(Fraction(value))


def apart(*values: Fraction) -> tuple[str, ...]:
    """Texts of numbers, such as a value and its limit, with six digits, or more if needed to distinguish them."""
    texts, count = tuple(map(shortly, values)), len(set(values))
    for digits in (9, 12, 24):
        if len(set(map(Fraction, texts))) == count:
            return texts
        texts = tuple(f"{Decimal(v.numerator) / Decimal(v.denominator):.{digits}g}" for v in values)
    return texts if len(set(map(Fraction, texts))) == count else tuple(map(exact_text, values))


def six_digits(value: Fraction) -> str:
    """Text with six digits, rounded to nearest, by `Decimal`, which does not overflow."""
    return f"{Decimal(value.numerator) / Decimal(value.denominator):.6g}"


# ----------------------------------------------------------------------
# Certified numbers, printed with outward rounding only: an upper bound is rounded up, a lower one down.
#
# A bound is a `fractions.Fraction`, so that comparison and arithmetic are exact. A result of arithmetic is a plain
# fraction; the code that computes it declares whether it is a bound, and of which side.

_SPEC = re.compile(
    r"(?P<align>.?[<>^])?(?P<sign>[-+ ]?)(?P<width>([1-9]\d*)?)(\.(?P<digits>\d+))?(?P<kind>[eEfFgG%]?)", re.ASCII
)


class Bound(Fraction):
    """Exact bound of a certified quantity; `UpperBound` and `LowerBound` are its two sides.

    ``str`` and ``repr`` show six digits, ``format`` a specified number of digits, ``float`` the nearest float, all
    rounded outward. Only the text `exact` is not rounded.
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
            Unit that takes a prefix, such as Pa, m or m/s.
        digits : int
            Number of significant digits; digits before the point are always shown.
        """
        _, exponent = self._significant(digits)
        power = min(max(3 * (exponent // 3), -18), 18)
        shown = format(type(self)(self / Fraction(10) ** power), f".{max(digits - 1 - exponent + power, 0)}f")
        return f"{_bare(shown)} {PREFIXES[power]}{unit}"

    def __str__(self) -> str:
        return format(self, "")

    def __repr__(self) -> str:
        return f"{type(self).__name__}('{self}')"

    def __format__(self, spec: str) -> str:
        """Decimal rounded outward, within a unit of its last digit.

        Parameters
        ----------
        spec : str
            Alignment, sign, width, precision, and one of ``e``, ``f``, ``g``, ``%``, as for a float.

        Raises
        ------
        ValueError
            For any other format.
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
        """Decimal with `digits` digits, rounded outward, and the power of ten of its first digit."""
        context = Context(prec=max(digits, 1), rounding=self._side)
        rounded = context.divide(Decimal(self.numerator), Decimal(self.denominator))
        return rounded, rounded.adjusted()

    def _whole(self, factor: int) -> int:
        """The bound in units of 1/factor, rounded outward."""
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
    """Upper bound of a quantity, such as a peak, a settling time or the requirement of a premise. Rounded up."""

    __slots__ = ()
    _side = ROUND_CEILING

    def __float__(self) -> float:
        return float_above(Fraction(self))


class LowerBound(Bound):
    """Lower bound of a quantity, such as a longest step, a margin, a decay rate or a certified range. Rounded down."""

    __slots__ = ()
    _side = ROUND_FLOOR

    def __float__(self) -> float:
        return float_below(Fraction(self))


@dataclass(frozen=True, slots=True)
class Enclosure:
    """Interval that contains a quantity, also after the outward rounding of its printed ends.

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
    """Mantissa with `digits` decimal places; exact, because the number has no further digits."""
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
    """Decimal text without trailing zeros."""
    return text.rstrip("0").rstrip(".") if "." in text else text
