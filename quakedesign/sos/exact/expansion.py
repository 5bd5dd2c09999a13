"""Expansion of polynomials with a budget: every limit is enforced before the work that it limits."""

from collections.abc import Sequence
from fractions import Fraction
from math import comb, prod
from typing import Any, NamedTuple, NoReturn

from flint import fmpq

from quakedesign.errors import PolynomialError
from quakedesign.rationals import fraction_of

DEGREE = 60
"""Total degree of any intermediate polynomial, and largest exponent."""
MONOMIALS = 10_000
"""Monomials of any intermediate polynomial."""
DIGITS = 400
"""Decimal digits of the numerator and of the denominator of a number in the text."""
COEFFICIENT_DIGITS = 1000
"""Decimal digits of any intermediate numerator or denominator."""

_WORK = 2_000_000  # sums and products of two short coefficients in one text: about a second
_FIELD = 7  # bits an exponent; sums of two exponents up to DEGREE fit
_BITS_OF_NUMBERS = (10**DIGITS).bit_length()
_BITS = (10**COEFFICIENT_DIGITS).bit_length()
_SHORT = 256  # bits; longer coefficients cost more of the budget

Exponents = tuple[int, ...]
Terms = dict[int, Any]
"""Exponents packed into one integer, the total degree on top, to nonzero fmpq."""


class Token(NamedTuple):
    """A word of the text: its kind, its characters and the place of the first."""

    kind: str
    text: str
    start: int


def refuse(text: str, token: Token, expected: str, remedy: str) -> NoReturn:
    """Raise the one kind of error, its place marked by ⟦ ⟧ in a short excerpt on one line."""
    start, end = token.start, token.start + min(len(token.text), 24)
    before, after = text[max(0, start - 24) : start], text[end : end + 24]
    shown = f"{'…' if start > 24 else ''}{before}⟦{text[start:end]}⟧{after}{'…' if end + 24 < len(text) else ''}"
    line = "".join(c if c.isprintable() else repr(c)[1:-1] for c in shown)
    where = "at the end" if token.kind == "end" else f"at character {start + 1}"
    raise PolynomialError(f"{expected} expected {where}. Received {line} there. {remedy}")


class Expansion:
    """Arithmetic on the polynomials of one text, which share one budget of work.

    Operands are used up: a sum may be formed in place.

    Parameters
    ----------
    text : str
        For the excerpt in messages.
    variables : sequence of str
    """

    def __init__(self, text: str, variables: Sequence[str]) -> None:
        self._text = text
        count = len(variables)
        self._top = _FIELD * count
        self._units = {name: (1 << _FIELD * i) + (1 << self._top) for i, name in enumerate(variables)}
        self._count = count
        self._work = _WORK

    def number(self, token: Token) -> Terms:
        """Constant polynomial of a decimal."""
        mantissa, _, exponent = token.text.lower().partition("e")
        whole, _, decimals = mantissa.partition(".")
        if len(mantissa) > DIGITS or len(exponent) > 5 or abs(int(exponent or "0")) > DIGITS:
            self._too_long(token)
        power = int(exponent or "0") - len(decimals)
        value = fmpq(int(whole + decimals)) * fmpq(10) ** power
        if value.height_bits() > _BITS_OF_NUMBERS:
            self._too_long(token)
        return {0: value} if value else {}

    def _too_long(self, token: Token) -> NoReturn:
        refuse(self._text, token, f"a number of at most {DIGITS} digits", "Round it, or scale the polynomial.")

    def variable(self, token: Token) -> Terms:
        """Polynomial of one name."""
        return {self._units[token.text]: fmpq(1)}

    def negative(self, terms: Terms, token: Token) -> Terms:
        """−p."""
        self._spend(len(terms), token)
        return {key: -value for key, value in terms.items()}

    def add(self, left: Terms, right: Terms, token: Token) -> Terms:
        """p + q, formed in the longer of the two."""
        total, other = (left, right) if len(left) >= len(right) else (right, left)
        self._spend(len(other), token, other)
        for key, value in other.items():
            self._accumulate(total, key, value, token)
        self._room(len(total), token)
        return total

    def multiply(self, left: Terms, right: Terms, token: Token) -> Terms:
        """p·q."""
        if self._degree(left) + self._degree(right) > DEGREE:
            refuse(self._text, token, f"degree at most {DEGREE}", "Lower the degree.")
        self._spend(len(left) * len(right), token, left, right)
        total: Terms = {}
        for key, value in left.items():
            for other, factor in right.items():
                self._accumulate(total, key + other, value * factor, token)
            self._room(len(total), token)
        return total

    def divide(self, left: Terms, right: Terms, token: Token) -> Terms:
        """p/c for a nonzero number c."""
        if set(right) != {0}:
            refuse(self._text, token, "a nonzero number after /", "Multiply out; only numbers divide.")
        return self.multiply(left, {0: 1 / right[0]}, token)

    def power(self, base: Terms, token: Token) -> Terms:
        """p to the whole number that the token must be."""
        if not token.text.isdigit() or len(token.text) > 9 or int(token.text) > DEGREE:
            expected = f"a whole number from 0 to {DEGREE} as exponent"
            refuse(self._text, token, expected, "Write for example x^2; only digits make an exponent.")
        exponent = int(token.text)
        self._room(self._size_of_power(base, exponent), token)
        total: Terms = {0: fmpq(1)}
        for _ in range(exponent):
            total = self.multiply(total, base, token)
        return total

    def _size_of_power(self, base: Terms, exponent: int) -> int:
        """Upper bound of the monomials of a power: of its products of terms, and of the box of its exponents."""
        sizes = [max((key >> _FIELD * i) % (1 << _FIELD) for key in base or (0,)) for i in range(self._count)]
        box = prod(size * exponent + 1 for size in sizes)
        degree = self._degree(base) * exponent
        within = comb(degree + sum(size > 0 for size in sizes), degree)
        return min(comb(max(len(base), 1) + exponent - 1, exponent), box, within)

    def unpacked(self, terms: Terms) -> dict[Exponents, Fraction]:
        """Exponents and rational coefficients of a result."""
        fields = [_FIELD * i for i in range(self._count)]
        return {
            tuple(key >> field & (1 << _FIELD) - 1 for field in fields): fraction_of(value)
            for key, value in terms.items()
        }

    def _degree(self, terms: Terms) -> int:
        return max(terms, default=0) >> self._top

    def _spend(self, operations: int, token: Token, *operands: Terms) -> None:
        longest = sum(max((value.height_bits() for value in terms.values()), default=0) for terms in operands)
        self._work -= operations * (1 + longest // _SHORT) + sum(map(len, operands))
        if self._work < 0:
            refuse(self._text, token, "less to expand", "Expand or simplify the polynomial before.")

    def _room(self, monomials: int, token: Token) -> None:
        if monomials > MONOMIALS:
            refuse(self._text, token, f"at most {MONOMIALS} monomials", "Use fewer variables, or a lower degree.")

    def _accumulate(self, total: Terms, key: int, value: Any, token: Token) -> None:
        old = total.get(key)
        new = value if old is None else old + value
        if not new:
            total.pop(key, None)
        elif new.height_bits() > _BITS:
            expected = f"coefficients of at most {COEFFICIENT_DIGITS} digits"
            refuse(self._text, token, expected, "Round or scale the numbers.")
        else:
            total[key] = new
