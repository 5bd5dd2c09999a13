"""Signed roots of rationals: the exact numbers that appear when a rational is raised to a rational power."""

from dataclasses import dataclass
from decimal import Context, Decimal, localcontext
from fractions import Fraction
from functools import reduce
from math import lcm

from quakedesign.errors import ParameterError
from quakedesign.rationals import exact_text, rational

_WORKING_DIGITS = 60


@dataclass(frozen=True, slots=True)
class Radical:
    """sign · radicand^(1/degree), held in its one canonical form, so that equal numbers compare equal.

    Products, quotients and rational powers of such numbers are such numbers, hence every scale factor and every
    carried gain is exact. Build them with `radical`.

    Attributes
    ----------
    sign : int
        −1, 0 or 1.
    radicand : Fraction
        Positive; 1 for the number zero.
    degree : int
        Smallest possible, so 1 for a rational number.
    """

    sign: int
    radicand: Fraction
    degree: int

    @property
    def is_rational(self) -> bool:
        """True where the number is a rational."""
        return self.degree == 1

    @property
    def fraction(self) -> Fraction:
        """The number itself, where it is rational.

        Raises
        ------
        ParameterError
            When it is irrational.
        """
        if not self.is_rational:
            raise ParameterError(
                f"a rational number is needed. Received {self.text()}…, a root of degree {self.degree}."
            )
        return self.sign * self.radicand

    def __mul__(self, other: "Radical | Fraction | int") -> "Radical":
        right = radical(other)
        degree = lcm(self.degree, right.degree)
        radicand = self.radicand ** (degree // self.degree) * right.radicand ** (degree // right.degree)
        return _canonical(self.sign * right.sign, radicand, degree)

    __rmul__ = __mul__

    def __truediv__(self, other: "Radical | Fraction | int") -> "Radical":
        return self * radical(other) ** -1

    def __pow__(self, exponent: Fraction | int) -> "Radical":
        power = Fraction(exponent)
        if (self.sign == 0 and power <= 0) or (self.sign < 0 and power.denominator != 1):
            raise ParameterError(f"{self.text()} has no real power {power}.")
        if self.sign == 0:
            return self
        sign = -1 if self.sign < 0 and power.numerator % 2 else 1
        return _canonical(sign, self.radicand**power.numerator, self.degree * power.denominator)

    def decimal(self, digits: int = 12) -> Decimal:
        """Nearest decimal number with so many significant digits."""
        with localcontext(Context(prec=max(_WORKING_DIGITS, 2 * digits))):
            ratio = Decimal(self.radicand.numerator) / Decimal(self.radicand.denominator)
            root = self.sign * ratio ** (Decimal(1) / self.degree)
        return Context(prec=digits).plus(root)

    def nearest(self, digits: int = 12) -> Fraction:
        """The number itself where it is rational, else the nearest decimal with so many significant digits."""
        return self.fraction if self.is_rational else rational(str(self.decimal(digits)))

    def text(self, digits: int = 12) -> str:
        """Exact decimal or p/q where the number is rational, else a decimal with so many significant digits."""
        if not self.is_rational:
            return f"{self.decimal(digits):.{digits}g}"
        rounded = self.decimal(17).normalize()
        if Fraction(rounded) != self.fraction:
            return exact_text(self.fraction)
        return f"{rounded:f}" if -7 <= rounded.adjusted() <= 17 else str(rounded)

    def __float__(self) -> float:
        return float(self.decimal(40))

    def __str__(self) -> str:
        return self.text()


def radical(value: "Radical | Fraction | int") -> Radical:
    """Exact number from a rational; a `Radical` is returned as it is."""
    if isinstance(value, Radical):
        return value
    exact = Fraction(value)
    return _canonical((exact > 0) - (exact < 0), abs(exact) or Fraction(1), 1)


def _canonical(sign: int, radicand: Fraction, degree: int) -> Radical:
    if sign == 0:
        return Radical(0, Fraction(1), 1)
    return Radical(sign, *reduce(_without_prime, _primes(degree), (radicand, degree)))


def _without_prime(held: tuple[Fraction, int], prime: int) -> tuple[Fraction, int]:
    radicand, degree = held
    while degree % prime == 0 and (root := _root(radicand, prime)) is not None:
        radicand, degree = root, degree // prime
    return radicand, degree


def _root(value: Fraction, degree: int) -> Fraction | None:
    """Rational root of a positive rational, None where there is none."""
    from sympy import integer_nthroot

    (top, exact_top), (bottom, exact_bottom) = (
        integer_nthroot(n, degree) for n in (value.numerator, value.denominator)
    )
    return Fraction(int(top), int(bottom)) if exact_top and exact_bottom else None


def _primes(number: int) -> list[int]:
    if number == 1:
        return []
    from sympy import primefactors

    return [int(prime) for prime in primefactors(number)]
