"""Elementary functions of plain arithmetic: the same digits in every lane, on every processor, with any C library.

Each is a straight line of sums, products, quotients, comparisons and choices, which IEEE 754 rounds in one way only, on
exact powers of two (`two_to`) and exact parts of floats (`exponent_and_mantissa`, `near_cube_root`). They are stated
once, as CasADi expressions; `quakedesign.simulation.instructions` puts them into functions,
`quakedesign.simulation.portable_c` into C.
Errors are below one unit in the last place, those of cube roots below 0.65, of other powers (exponents up to 2) below
one and a half, of the hyperbolic tangent below two. Zeros have no sign. The power ⅓ of floats is the cube root.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from fractions import Fraction
from typing import Any

import casadi as ca

_ROUNDER = 1.5 * 2.0**52  # sums with it have no digits behind the point
_SPLITTER = 2.0**27 + 1
_LEAST = 2.0**-1022  # with 53 digits
THIRD = 1 / 3  # next to it
_ROOT = float.fromhex("0x1.6a09e667f3bcdp+0")  # of 2
_LN2 = Fraction(0xB17217F7D1CF79ABC9E3B39803F2F6AF40F343267298B62D8A0D175B8BAAFA2B, 2**256)  # of 77 digits
_HALF_PI = Fraction(0x1921FB54442D18469898CC51701B839A252049C1114CF98E804177D4C76273644, 2**256)


_in_bits = ContextVar("in_bits", default=False)


@contextmanager
def verbatim(*, bits: bool = False) -> Iterator[None]:
    """While it lasts, CasADi keeps expressions as they are written: (x + y) − x stays, since it is not y.

    With `bits`, expressions are for C, where `exponent_and_mantissa` and `near_cube_root` look at the bits: they are
    log, log1p and sinh then.
    """
    before, token = ca.GlobalOptions.getSimplificationOnTheFly(), _in_bits.set(bits)
    ca.GlobalOptions.setSimplificationOnTheFly(False)
    try:
        yield
    finally:
        ca.GlobalOptions.setSimplificationOnTheFly(before)
        _in_bits.reset(token)


def _pieces(number: Fraction, bits: int, count: int) -> list[float]:
    """Floats of a number of leading bits each, and a last one, whose sum is a number."""
    leading = []
    for _ in range(count - 1):
        unit = Fraction(2) ** (math.frexp(float(number))[1] - bits)
        leading.append(math.floor(number / unit) * unit)
        number -= leading[-1]
    return [*map(float, leading), float(number)]


def _economised(coefficients: list[Fraction], low: Fraction, high: Fraction, count: int) -> list[float]:
    """As many coefficients as wanted of a polynomial next to a longer one on an interval (Lanczos 1938).

    The highest power is taken off with the Chebyshev polynomial of its degree, which is nowhere large.
    """
    line = [-(high + low) / (high - low), 2 / (high - low)]
    chebyshev = [[Fraction(1)], line]
    while len(chebyshev) < len(coefficients):
        before, last = chebyshev[-2:]
        next_ = [Fraction(0)] * (len(last) + 1)
        for i, value in enumerate(last):
            next_[i] += 2 * line[0] * value
            next_[i + 1] += 2 * line[1] * value
        chebyshev.append([value - (before[i] if i < len(before) else 0) for i, value in enumerate(next_)])
    while len(coefficients) > count:
        share = coefficients[-1] / chebyshev[len(coefficients) - 1][-1]
        coefficients = [c - share * t for c, t in zip(coefficients, chebyshev[len(coefficients) - 1], strict=True)][:-1]
    return [float(c) for c in coefficients]


_LN2_PIECES = _pieces(_LN2, 42, 2)
_HALF_PI_PIECES = _pieces(_HALF_PI, 22, 4)
_R, _Z, _S = Fraction(347, 1000), Fraction(617, 1000), Fraction(295, 10000)  # bounds of |r|, r² of sines, s² of log
_EXP = _economised([Fraction(1, math.factorial(n)) for n in range(2, 18)], -_R, _R, 11)
_SIN = _economised([Fraction((-1) ** n, math.factorial(2 * n + 1)) for n in range(1, 12)], Fraction(0), _Z, 7)
_COS = _economised([Fraction((-1) ** n, math.factorial(2 * n)) for n in range(2, 12)], Fraction(0), _Z, 6)
_ATANH = _economised([Fraction(2, 2 * n + 1) for n in range(1, 16)], Fraction(0), _S, 7)
_LEFT = Fraction(955, 10000)  # of a number beside the cube of what is near its cube root
_ROOT_BITS = 44693264  # two thirds of 1023·2¹⁶, less what makes `_LEFT` least
_CUBE_ROOT = _economised(
    [Fraction(math.prod(3 * k + 1 for k in range(n)), math.factorial(n) * 3**n) for n in range(1, 40)],
    -_LEFT,
    _LEFT,
    12,
)


def two_to(exponent: Any) -> Any:
    """2ⁿ for whole n, −1022 … 1023, without rounding."""
    return ca.SX(2.0) ** exponent


def choice(condition: Any, yes: Any, no: Any) -> Any:
    """One of two values; the other may be no number."""
    return ca.if_else(condition, yes, no)


def rounded(x: Any) -> Any:
    """Nearest whole number, the even one of two; for |x| < 2⁵¹."""
    return (x + _ROUNDER) + -_ROUNDER


def _polynomial(x: Any, coefficients: list[float]) -> Any:
    """Values of lower and upper half, joined by a power of x, in turn: short chains (Estrin 1960)."""
    powers, parts = x, [ca.SX(c) for c in coefficients]
    while len(parts) > 1:
        pairs = [parts[i] + parts[i + 1] * powers for i in range(0, len(parts) - 1, 2)]
        parts, powers = pairs + parts[2 * len(pairs) :], powers * powers
    return parts[0]


def _sum(a: Any, b: Any) -> tuple[Any, Any]:
    """Rounded sum and what is missing (Knuth's two-sum)."""
    total = a + b
    of_b = total - a
    return total, (a - (total - of_b)) + (b - of_b)


def _halves(x: Any) -> tuple[Any, Any]:
    """26 leading bits, and the others (Veltkamp's splitting)."""
    scaled = x * _SPLITTER
    first = scaled - (scaled - x)
    return first, x - first


def _limited(x: Any, low: float, high: float) -> Any:
    return choice(x < low, ca.SX(low), choice(x > high, ca.SX(high), x))


def _scaled(x: Any, exponent: Any) -> Any:
    """x·2ⁿ for |n| < 2000."""
    half = rounded(exponent * 0.5)
    return x * two_to(half) * two_to(exponent - half)


def _grown(first: Any, r: Any, rest: Any) -> Any:
    """First + e^(r + rest) − 1 for |r| ≤ ln2/2 and a small rest; |first| ≥ |r| or 0."""
    tail = rest + r * r * _polynomial(r, _EXP)
    total = first + r
    return total + (((first - total) + r) + tail)


def _by_ln2(x: Any) -> tuple[Any, Any, Any]:
    """n, r and rest: x = n·ln2 + r + rest."""
    whole = rounded(x * float(1 / _LN2))
    rough, less = x - whole * _LN2_PIECES[0], whole * _LN2_PIECES[1]
    r = rough - less
    return whole, r, (rough - r) - less


def exp(x: Any) -> Any:
    """e^x."""
    whole, r, rest = _by_ln2(_limited(x, -800, 800))
    return _scaled(_grown(ca.SX(1.0), r, rest), whole)


def expm1(x: Any) -> Any:
    """e^x − 1."""
    whole, r, rest = _by_ln2(_limited(x, -60, 710))
    first = 1 - two_to(-choice(whole > 600, ca.SX(600.0), whole))
    return (_grown(first, r, rest) * 2) * two_to(whole - 1)


def _parted(x: Any) -> tuple[Any, Any]:
    """n and m: x = m·2ⁿ with √½ ≤ m < √2, for positive finite x."""
    small = x < _LEAST
    x = x * choice(small, ca.SX(2.0**54), ca.SX(1.0))
    whole, mantissa = exponent_and_mantissa(x)
    return whole - choice(small, ca.SX(54.0), ca.SX(0.0)), mantissa


def exponent_and_mantissa(x: Any) -> tuple[Any, Any]:
    """As `_parted`, for x from 2⁻¹⁰²² on; exact, whatever the C library's logarithm has for last digits.

    Of it only a whole number counts, that of a power of two below x; where it changes, either serves.
    """
    if _in_bits.get():
        return ca.log(x), ca.log1p(x)
    whole = rounded(ca.log(x) * float(1 / _LN2) - 0.4)
    mantissa = (x * two_to(1 - whole)) * 0.5
    high = mantissa >= _ROOT
    return whole + high, mantissa * choice(high, ca.SX(0.5), ca.SX(1.0))


def _logarithm(mantissa: Any) -> tuple[Any, Any, Any]:
    """f = m − 1, and f²/2 and s(f²/2 + R) of log m = f − (f²/2 − s(f²/2 + R)), where s = f/(2 + f)."""
    f = mantissa - 1
    s, half = f / (2 + f), 0.5 * f * f
    z = s * s
    return f, half, s * (half + z * _polynomial(z, _ATANH))


def log(x: Any) -> Any:
    """Natural logarithm; no number below zero."""
    whole, mantissa = _parted(x)
    f, half, product = _logarithm(mantissa)
    value = whole * _LN2_PIECES[0] - ((half - (product + whole * _LN2_PIECES[1])) - f)
    return _at_the_ends(x, value, -math.inf, math.inf)


def _at_the_ends(x: Any, value: Any, at_zero: float, at_infinity: float) -> Any:
    """Value with that of zero and of infinity; no number where x is negative or none."""
    proper = choice(x == 0, ca.SX(at_zero), choice(x < math.inf, value, ca.SX(at_infinity)))
    return choice(x >= 0, proper, ca.SX(math.nan))


def power(x: Any, a: Any) -> Any:
    """x^a, the cube root where a is the float next to ⅓; for negative x no number unless a is whole."""
    if not a.is_constant():
        return choice(a == THIRD, cube_root(x), any_power(x, a))
    if float(a) == round(float(a)):
        return choice(x < 0, (-1.0) ** (float(a) % 2) * _power(-x, a), _power(x, a)) if a else ca.SX(1.0)
    return cube_root(x) if float(a) == THIRD else _power(x, a)


def near_cube_root(x: Any) -> Any:
    """A number of 17 bits whose cube is within a tenth of x, from 2⁻¹⁰²² on.

    The leading bits of a float, its exponent and 16 of its fraction as one whole number, are nearly its logarithm: a
    third of them are nearly those of the cube root (Kahan 1991).
    """
    if _in_bits.get():
        return ca.sinh(x)
    whole, mantissa = exponent_and_mantissa(x)
    low = mantissa < 1
    fraction = (mantissa * choice(low, ca.SX(2.0), ca.SX(1.0)) - 1) * 2.0**16
    bits = (whole - low + 1023) * 2.0**16 + rounded(fraction - (0.5 - 2.0**-37))
    third = ((bits - 1) * THIRD + (2.0**52 + _ROOT_BITS)) - 2.0**52
    exponent = rounded(third * 2.0**-16 - (0.5 - 2.0**-17))
    return (1 + (third - exponent * 2.0**16) * 2.0**-16) * two_to(exponent - 1023)


def cube_root(x: Any) -> Any:
    """x^⅓; no number below zero.

    With y near it, whose cube is exact, and z = (x − y³)/x it is y(1 − z)^(−⅓).
    """
    small = x < _LEAST
    scaled = x * choice(small, ca.SX(2.0**54), ca.SX(1.0))
    near = near_cube_root(scaled)
    left = (scaled - near * near * near) * (1 / scaled)
    near = near * choice(small, ca.SX(2.0**-18), ca.SX(1.0))
    value = near + near * left * _polynomial(left, _CUBE_ROOT)
    return choice(ca.logic_and(x > 0, x < math.inf), value, choice(x < 0, ca.SX(math.nan), x))


def any_power(x: Any, a: Any) -> Any:
    """Power with an exponent that is not known yet, but for that of a cube root."""
    size = ca.fabs(a)
    whole, even = (ca.logic_or(size >= 2.0**51, rounded(part) == part) for part in (a, 0.5 * a))
    value = _power(choice(ca.logic_and(whole, x < 0), -x, x), a)
    value = choice(ca.logic_and(x < 0, ca.logic_and(whole, ca.logic_not(even))), -value, value)
    return choice(a == 0, ca.SX(1.0), choice(size >= 0, value, a))


def _power(x: Any, a: Any) -> Any:
    """x^a for x that are not negative; a·log x in whole powers of two and a small rest."""
    whole, mantissa = _parted(x)
    f, half, product = _logarithm(mantissa)
    small = a * (f - (half - product))
    first, second = _halves(a)
    exponent = rounded(a * whole + small * float(1 / _LN2))
    r = (first * whole - exponent) * float(_LN2) + (small + (second * whole) * float(_LN2))
    value = _scaled(_grown(ca.SX(1.0), r, ca.SX(0.0)), exponent)
    value = choice(ca.fabs(exponent) < 1200, value, choice(exponent > 0, ca.SX(math.inf), ca.SX(0.0)))
    root = ca.sqrt(x)
    return choice(ca.logic_and(x > 0, x < math.inf), value, choice(a > 0, root, 1 / root))


def _by_half_pi(x: Any) -> tuple[Any, Any, Any]:
    """Turns beside whole ones, −½, −¼, 0, ¼ or ½, and r and rest: x = nπ/2 + r + rest."""
    x = x * (ca.fabs(x) < 2.0**52)
    whole = rounded(x * float(1 / _HALF_PI))
    first, second, third, fourth = (whole * piece for piece in _HALF_PI_PIECES)
    rough, less = _sum((x - first) - second, -third)
    r, rest = _sum(rough, less - fourth)
    turns = 0.25 * whole
    return turns - rounded(turns), r, rest


def _sine_and_cosine(r: Any, rest: Any) -> tuple[Any, Any]:
    z = r * r
    half = 0.5 * z
    nearly = 1 - half
    sine = r + (rest * nearly + r * z * _polynomial(z, _SIN))
    return sine, nearly + (((1 - nearly) - half) + (z * z * _polynomial(z, _COS) - r * rest))


def sin(x: Any) -> Any:
    """Sine; beyond |x| = 2³¹ that of an argument within one unit in the last place, beyond 2⁵² zero."""
    turns, r, rest = _by_half_pi(x)
    sine, cosine = _sine_and_cosine(r, rest)
    size = ca.fabs(turns)
    return choice(size == 0.25, 4 * turns * cosine, (1 - 4 * size) * sine)


def cos(x: Any) -> Any:
    """Cosine; of large arguments see `sin`."""
    turns, r, rest = _by_half_pi(x)
    sine, cosine = _sine_and_cosine(r, rest)
    size = ca.fabs(turns)
    return choice(size == 0.25, -4 * turns * sine, (1 - 4 * size) * cosine)


def tanh(x: Any) -> Any:
    """Hyperbolic tangent."""
    grown = expm1(2 * _limited(ca.fabs(x), 0, 22))
    return ca.sign(x) * (grown / (grown + 2))


def fmax(x: Any, y: Any) -> Any:
    """The larger of two numbers, or the one that is a number."""
    return choice(ca.logic_or(x > y, ca.logic_not(y <= math.inf)), x, y)


def fmin(x: Any, y: Any) -> Any:
    """The smaller of two numbers, or the one that is a number."""
    return choice(ca.logic_or(x < y, ca.logic_not(y <= math.inf)), x, y)


def floor(x: Any) -> Any:
    """Largest whole number that is not above x."""
    size = ca.fabs(x)
    near = (size + 2.0**52) + -(2.0**52)
    near = choice(x < 0, -near, near)
    return choice(size < 2.0**52, near - (near > x), x)


FUNCTIONS: dict[int, Callable[..., Any]] = {
    ca.OP_EXP: exp,
    ca.OP_EXPM1: expm1,
    ca.OP_LOG: log,
    ca.OP_POW: power,
    ca.OP_CONSTPOW: power,
    ca.OP_SIN: sin,
    ca.OP_COS: cos,
    ca.OP_TANH: tanh,
    ca.OP_FMAX: fmax,
    ca.OP_FMIN: fmin,
    ca.OP_FLOOR: floor,
}
"""What stands for CasADi's operations of these codes."""
