"""Compilation of CasADi functions to portable C with bitwise reproducible results.

Chapters: elementary functions from IEEE 754 operations (errors below 1 ulp; below 1.5 ulp for powers other than cube
roots, and 2 for tanh); instructions of a CasADi function; fixed C files; portable C operations; repeated steps in
machine code where a compiler is available; many vectors at once, with inner loops for vectorisation.
"""

import ctypes
import math
import os
import shlex
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache, lru_cache
from importlib.resources import files
from itertools import groupby
from pathlib import Path
from string import Template
from typing import Any, cast

import casadi as ca

from quakedesign.cache import once
from quakedesign.errors import SimulationError
from quakedesign.files import temporary_folder
from quakedesign.loop.schemes.implicit import where_needed

# ----------------------------------------------------------------------
# Elementary functions from IEEE 754 operations: bitwise equal in every lane, on every processor, with any C library.
#
# Each is a sequence of sums, products, quotients, comparisons and selections without branches, which IEEE 754 rounds
# uniquely, with exact powers of two (`two_to`) and exact parts of floats (`exponent_and_mantissa`, `near_cube_root`).
# They are defined once, as CasADi expressions; this module inserts them into CasADi functions and translates them into
# C. Errors are below 1 unit in the last place; for cube roots below 0.65, for other powers (exponents up to 2) below
# 1.5, for the hyperbolic tangent below 2. The sign of a zero is unspecified. The power with the float nearest to ⅓ is
# the cube root.

_ROUNDER = 1.5 * 2.0**52  # sums with it are rounded to whole numbers
_SPLITTER = 2.0**27 + 1
_LEAST = 2.0**-1022  # smallest normal float, with 53 bits
THIRD = 1 / 3  # the float nearest to ⅓
_ROOT = float.fromhex("0x1.6a09e667f3bcdp+0")  # √2
_LN2 = Fraction(0xB17217F7D1CF79ABC9E3B39803F2F6AF40F343267298B62D8A0D175B8BAAFA2B, 2**256)  # 77 decimal digits
_HALF_PI = Fraction(0x1921FB54442D18469898CC51701B839A252049C1114CF98E804177D4C76273644, 2**256)


_in_bits = ContextVar("in_bits", default=False)


@contextmanager
def verbatim(*, bits: bool = False) -> Iterator[None]:
    """Context in which CasADi does not simplify: (x + y) − x remains, as it differs from y in floating point.

    With `bits`, expressions are for C, where exponent, mantissa and approximate cube root are read from the bits of a
    float. CasADi's log, log1p and sinh then serve as placeholders for these three functions.
    """
    before, token = ca.GlobalOptions.getSimplificationOnTheFly(), _in_bits.set(bits)
    ca.GlobalOptions.setSimplificationOnTheFly(False)
    try:
        yield
    finally:
        ca.GlobalOptions.setSimplificationOnTheFly(before)
        _in_bits.reset(token)


def _pieces(number: Fraction, bits: int, count: int) -> list[float]:
    """Floats that sum to `number` up to rounding of the last; all others have a given number of leading bits."""
    leading = []
    for _ in range(count - 1):
        unit = Fraction(2) ** (math.frexp(float(number))[1] - bits)
        leading.append(math.floor(number / unit) * unit)
        number -= leading[-1]
    return [*map(float, leading), float(number)]


def _economised(coefficients: list[Fraction], low: Fraction, high: Fraction, count: int) -> list[float]:
    """Coefficients of a shorter polynomial close to a given one on an interval (Lanczos 1938).

    A multiple of the Chebyshev polynomial of equal degree, which is small on the interval, cancels the highest power.
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
_RESIDUAL = Fraction(955, 10000)  # bound of |x − y³|/x for y = near_cube_root(x)
_ROOT_BITS = 44693264  # ⅔·1023·2¹⁶ minus a correction that minimises `_RESIDUAL`
_CUBE_ROOT = _economised(
    [Fraction(math.prod(3 * k + 1 for k in range(n)), math.factorial(n) * 3**n) for n in range(1, 40)],
    -_RESIDUAL,
    _RESIDUAL,
    12,
)


def two_to(exponent: ca.SX) -> ca.SX:
    """2ⁿ for whole n, −1022 … 1023, without rounding."""
    return ca.SX(2.0) ** exponent


def choice(condition: ca.SX, yes: ca.SX, no: ca.SX) -> ca.SX:
    """`yes` if the condition holds, else `no`; the value that is not selected may be NaN."""
    return ca.if_else(condition, yes, no)


def rounded(x: ca.SX) -> ca.SX:
    """Nearest whole number, ties to even, for |x| < 2⁵¹."""
    return (x + _ROUNDER) + -_ROUNDER


def _polynomial(x: ca.SX, coefficients: list[float]) -> ca.SX:
    """Value of a polynomial by Estrin's scheme (1960), whose chains of dependent operations are short."""
    powers, parts = x, [ca.SX(c) for c in coefficients]
    while len(parts) > 1:
        pairs = [parts[i] + parts[i + 1] * powers for i in range(0, len(parts) - 1, 2)]
        parts, powers = pairs + parts[2 * len(pairs) :], powers * powers
    return parts[0]


def _sum(a: ca.SX, b: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Rounded sum and its rounding error (Knuth's two-sum)."""
    total = a + b
    of_b = total - a
    return total, (a - (total - of_b)) + (b - of_b)


def _halves(x: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Leading 26 bits of a float and the remaining ones (Veltkamp's splitting)."""
    scaled = x * _SPLITTER
    first = scaled - (scaled - x)
    return first, x - first


def _limited(x: ca.SX, low: float, high: float) -> ca.SX:
    return choice(x < low, ca.SX(low), choice(x > high, ca.SX(high), x))


def _scaled(x: ca.SX, exponent: ca.SX) -> ca.SX:
    """x·2ⁿ for |n| < 2000."""
    half = rounded(exponent * 0.5)
    return x * two_to(half) * two_to(exponent - half)


def _grown(first: ca.SX, r: ca.SX, rest: ca.SX) -> ca.SX:
    """`first` + e^(r + rest) − 1 for |r| ≤ ln2/2 and a small rest; |first| ≥ |r| or 0."""
    tail = rest + r * r * _polynomial(r, _EXP)
    total = first + r
    return total + (((first - total) + r) + tail)


def _by_ln2(x: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """n, r and rest: x = n·ln2 + r + rest."""
    whole = rounded(x * float(1 / _LN2))
    rough, less = x - whole * _LN2_PIECES[0], whole * _LN2_PIECES[1]
    r = rough - less
    return whole, r, (rough - r) - less


def exp(x: ca.SX) -> ca.SX:
    """e^x."""
    whole, r, rest = _by_ln2(_limited(x, -800, 800))
    return _scaled(_grown(ca.SX(1.0), r, rest), whole)


def expm1(x: ca.SX) -> ca.SX:
    """e^x − 1."""
    whole, r, rest = _by_ln2(_limited(x, -60, 710))
    first = 1 - two_to(-choice(whole > 600, ca.SX(600.0), whole))
    return (_grown(first, r, rest) * 2) * two_to(whole - 1)


def _parted(x: ca.SX) -> tuple[ca.SX, ca.SX]:
    """n and m such that x = m·2ⁿ and √½ ≤ m < √2, for positive finite x."""
    small = x < _LEAST
    x = x * choice(small, ca.SX(2.0**54), ca.SX(1.0))
    whole, mantissa = exponent_and_mantissa(x)
    return whole - choice(small, ca.SX(54.0), ca.SX(0.0)), mantissa


def exponent_and_mantissa(x: ca.SX) -> tuple[ca.SX, ca.SX]:
    """n and m such that x = m·2ⁿ and √½ ≤ m < √2, for x ≥ 2⁻¹⁰²²; exact for every rounding of the C logarithm.

    The logarithm only selects a whole number, the exponent of a power of two near x; where its rounding decides between
    two exponents, both give the same result.
    """
    if _in_bits.get():
        return ca.log(x), ca.log1p(x)
    whole = rounded(ca.log(x) * float(1 / _LN2) - 0.4)
    mantissa = (x * two_to(1 - whole)) * 0.5
    high = mantissa >= _ROOT
    return whole + high, mantissa * choice(high, ca.SX(0.5), ca.SX(1.0))


def _logarithm(mantissa: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """f = m − 1, and f²/2 and s(f²/2 + R) of log m = f − (f²/2 − s(f²/2 + R)), where s = f/(2 + f)."""
    f = mantissa - 1
    s, half = f / (2 + f), 0.5 * f * f
    z = s * s
    return f, half, s * (half + z * _polynomial(z, _ATANH))


def log(x: ca.SX) -> ca.SX:
    """Natural logarithm; NaN below zero."""
    whole, mantissa = _parted(x)
    f, half, product = _logarithm(mantissa)
    value = whole * _LN2_PIECES[0] - ((half - (product + whole * _LN2_PIECES[1])) - f)
    # Value with the limits at zero and infinity; NaN where x is negative or NaN.
    proper = choice(x == 0, ca.SX(-math.inf), choice(x < math.inf, value, ca.SX(math.inf)))
    return choice(x >= 0, proper, ca.SX(math.nan))


def power(x: ca.SX, a: ca.SX) -> ca.SX:
    """x^a, the cube root where a is the float nearest to ⅓; NaN for negative x unless a is whole."""
    if not a.is_constant():
        return choice(a == THIRD, cube_root(x), any_power(x, a))
    if float(a) == round(float(a)):
        return choice(x < 0, (-1.0) ** (float(a) % 2) * _power(-x, a), _power(x, a)) if a else ca.SX(1.0)
    return cube_root(x) if float(a) == THIRD else _power(x, a)


def near_cube_root(x: ca.SX) -> ca.SX:
    """Number with 17 significant bits whose cube is within 10 % of x, for x ≥ 2⁻¹⁰²².

    The leading bits of a float (exponent and 16 bits of the fraction), read as one integer, approximate its logarithm.
    A third of this integer approximates the logarithm of the cube root (Kahan 1991).
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


def cube_root(x: ca.SX) -> ca.SX:
    """x^⅓; NaN below zero.

    With an approximation y, whose cube is exact, and z = (x − y³)/x, the root is y(1 − z)^(−⅓).
    """
    small = x < _LEAST
    scaled = x * choice(small, ca.SX(2.0**54), ca.SX(1.0))
    near = near_cube_root(scaled)
    residual = (scaled - near * near * near) * (1 / scaled)
    near = near * choice(small, ca.SX(2.0**-18), ca.SX(1.0))
    value = near + near * residual * _polynomial(residual, _CUBE_ROOT)
    return choice(ca.logic_and(x > 0, x < math.inf), value, choice(x < 0, ca.SX(math.nan), x))


def any_power(x: ca.SX, a: ca.SX) -> ca.SX:
    """Power with a symbolic exponent other than that of a cube root."""
    size = ca.fabs(a)
    whole, even = (ca.logic_or(size >= 2.0**51, rounded(part) == part) for part in (a, 0.5 * a))
    value = _power(choice(ca.logic_and(whole, x < 0), -x, x), a)
    value = choice(ca.logic_and(x < 0, ca.logic_and(whole, ca.logic_not(even))), -value, value)
    return choice(a == 0, ca.SX(1.0), choice(size >= 0, value, a))


def _power(x: ca.SX, a: ca.SX) -> ca.SX:
    """x^a for x ≥ 0: a·log x is split into whole multiples of ln 2 and a small rest."""
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


def _by_half_pi(x: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Fraction of a turn n/4 (−½, −¼, 0, ¼ or ½), r and rest, such that x = nπ/2 + r + rest modulo 2π."""
    x = x * (ca.fabs(x) < 2.0**52)
    whole = rounded(x * float(1 / _HALF_PI))
    first, second, third, fourth = (whole * piece for piece in _HALF_PI_PIECES)
    rough, less = _sum((x - first) - second, -third)
    r, rest = _sum(rough, less - fourth)
    turns = 0.25 * whole
    return turns - rounded(turns), r, rest


def _sine_and_cosine(r: ca.SX, rest: ca.SX) -> tuple[ca.SX, ca.SX]:
    z = r * r
    half = 0.5 * z
    nearly = 1 - half
    sine = r + (rest * nearly + r * z * _polynomial(z, _SIN))
    return sine, nearly + (((1 - nearly) - half) + (z * z * _polynomial(z, _COS) - r * rest))


def sin(x: ca.SX) -> ca.SX:
    """Sine of x. For |x| > 2³¹ it is the sine of a number within 1 ulp of x; for |x| ≥ 2⁵² it is 0."""
    turns, r, rest = _by_half_pi(x)
    sine, cosine = _sine_and_cosine(r, rest)
    size = ca.fabs(turns)
    return choice(size == 0.25, 4 * turns * cosine, (1 - 4 * size) * sine)


def cos(x: ca.SX) -> ca.SX:
    """Cosine of x. For |x| > 2³¹ it is the cosine of a number within 1 ulp of x; for |x| ≥ 2⁵² it is 1."""
    turns, r, rest = _by_half_pi(x)
    sine, cosine = _sine_and_cosine(r, rest)
    size = ca.fabs(turns)
    return choice(size == 0.25, -4 * turns * sine, (1 - 4 * size) * cosine)


def tanh(x: ca.SX) -> ca.SX:
    """Hyperbolic tangent."""
    grown = expm1(2 * _limited(ca.fabs(x), 0, 22))
    return ca.sign(x) * (grown / (grown + 2))


def fmax(x: ca.SX, y: ca.SX) -> ca.SX:
    """The larger of two numbers; if one is NaN, the other."""
    return choice(ca.logic_or(x > y, ca.logic_not(y <= math.inf)), x, y)


def fmin(x: ca.SX, y: ca.SX) -> ca.SX:
    """The smaller of two numbers; if one is NaN, the other."""
    return choice(ca.logic_or(x < y, ca.logic_not(y <= math.inf)), x, y)


def floor(x: ca.SX) -> ca.SX:
    """Largest whole number ≤ x."""
    size = ca.fabs(x)
    near = (size + 2.0**52) + -(2.0**52)
    near = choice(x < 0, -near, near)
    return choice(size < 2.0**52, near - (near > x), x)


FUNCTIONS: dict[int, Callable[..., ca.SX]] = {
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
"""Portable functions that replace CasADi's operations, by the codes of the operations."""


# ----------------------------------------------------------------------
# Instructions of scalar CasADi Functions (SX), and the functions that these instructions call.

_WRITTEN_OUT = 60
"""Mean number of instructions of an elementary function in expanded form."""


class NotPortableError(ValueError):
    """An operation for which no portable C code exists."""


@dataclass(frozen=True)
class Instruction:
    """One instruction of a CasADi Function."""

    operation: int  # CasADi's operation code
    taken: tuple[int, ...]  # Positions of the arguments in the work vector; for an input its number and the entry
    given: tuple[int, ...]  # Positions of the results, −1 where unused; for an output its number and the entry
    constant: float


def instructions(function: ca.Function) -> Iterator[Instruction]:
    """Instructions of a CasADi Function of scalar operations, in order."""
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        value = function.instruction_constant(k) if operation == ca.OP_CONST else 0.0
        yield Instruction(operation, tuple(function.instruction_input(k)), tuple(function.instruction_output(k)), value)


@dataclass(frozen=True)
class Called:
    """Function that an instruction calls."""

    function: ca.Function  # Of scalar operations, with one input vector and one output vector
    # Number of calls, each on the previous result. 0 means a branch: if the first argument is not zero, one call with
    # the other arguments; else the result is 0
    times: int

    def __call__(self, function: ca.Function, arguments: list[ca.SX]) -> ca.SX:
        """Result (SX) with another function in place of this one."""
        if self.times:
            return function.fold(self.times, {"never_inline": True})(ca.vertcat(*arguments))
        return where_needed(function)(arguments[0], ca.vertcat(*arguments[1:]))


def called(function: ca.Function, work: Instruction) -> Called:
    """Function called by an instruction `work` of `function`.

    Raises
    ------
    NotPortableError
        If the call is neither a repetition nor a branch, or is ambiguous.
    """
    matching = [
        f for f in function.find_functions(0) if f.nnz_in() == len(work.taken) and f.nnz_out() == len(work.given)
    ]
    name = matching[0].name() if len(matching) == 1 else ""
    if name.startswith("fold_"):
        inner = name.removeprefix("fold_")
        # the name of the repeated function varies with the number of calls
        (all_of_them,) = map(matching[0].get_function, matching[0].get_function())
        return Called(matching[0].find_function(inner), int(all_of_them.size2_out(0)))
    if name == "where_needed":
        return Called(matching[0].find_function("solved"), 0)
    raise NotPortableError(f"a call in {function.name()} is neither a repetition nor a branch")


def expanded(function: ca.Function) -> ca.Function:
    """Function with the elementary functions expanded into basic operations, for CasADi's virtual machine."""
    with verbatim():
        return _expanded(function)


def expanded_size(function: ca.Function) -> int:
    """Approximate number of instructions of the expanded function."""
    operations = [function.instruction_id(k) for k in range(function.n_instructions())]
    return len(operations) + _WRITTEN_OUT * sum(operation in FUNCTIONS for operation in operations)


def _expanded(function: ca.Function) -> ca.Function:
    inputs = [ca.SX.sym(f"i{n}", function.sparsity_in(n)) for n in range(function.n_in())]
    results = [ca.SX(function.sparsity_out(n)) for n in range(function.n_out())]
    values: dict[int, ca.SX] = {}
    for work in instructions(function):
        if work.operation == ca.OP_INPUT:
            values[work.given[0]] = inputs[work.taken[0]].nz[work.taken[1]]
        elif work.operation == ca.OP_OUTPUT:
            results[work.given[0]].nz[work.given[1]] = values[work.taken[0]]
        elif work.operation == ca.OP_CALL:
            call = called(function, work)
            after = call(_expanded(call.function), [values[i] for i in work.taken])
            values |= {place: after[i] for i, place in enumerate(work.given) if place >= 0}
        else:
            values[work.given[0]] = _operated(work, [values[i] for i in work.taken])
    return ca.Function(function.name(), inputs, results, function.name_in(), function.name_out())


def _operated(work: Instruction, arguments: list[ca.SX]) -> ca.SX:
    if work.operation == ca.OP_CONST:
        return ca.SX(work.constant)
    if work.operation in FUNCTIONS:
        return FUNCTIONS[work.operation](*arguments)
    return (ca.SX.unary if len(arguments) == 1 else ca.SX.binary)(work.operation, *arguments)


# ----------------------------------------------------------------------
# The fixed parts of generated C are C files in this folder; numbers are inserted by name.


@cache
def _template(name: str) -> Template:
    return Template(files("quakedesign.simulation").joinpath(name).read_text(encoding="utf-8"))


def c_file(name: str, **numbers: object) -> str:
    """Text of a C file with numbers in place of ``${…}``."""
    return _template(name).substitute(numbers)


# ----------------------------------------------------------------------
# Bitwise reproducible operations in C, including the elementary functions.

_ATOMIC = {
    ca.OP_POW: "two_to",
    ca.OP_CONSTPOW: "two_to",
    ca.OP_LOG: "exponent_of",
    ca.OP_LOG1P: "mantissa_of",
    ca.OP_SINH: "near_cube_root",
}
_BINARY = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
_COMPARED = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!="}
_JOINED = {ca.OP_AND: "&", ca.OP_OR: "|"}
_WRITTEN = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "2 * {0}",
    ca.OP_INV: "1 / {0}",
    ca.OP_FABS: "fabs({0})",
    ca.OP_SQRT: "sqrt({0})",
    ca.OP_SIGN: "{0} < 0 ? -1.0 : {0} > 0 ? 1.0 : {0}",
}
_OF_THE_LIBRARY = {
    ca.OP_FMOD: "fmod",
    ca.OP_CEIL: "ceil",
    ca.OP_TAN: "tan",
    ca.OP_ATAN: "atan",
    ca.OP_SINH: "sinh",
    ca.OP_COSH: "cosh",
    ca.OP_ASINH: "asinh",
    ca.OP_LOG1P: "log1p",
}


@dataclass(frozen=True)
class Value:
    """A value in C."""

    text: str
    true_or_false: bool = False

    @property
    def number(self) -> str:
        """Text of the value as a double."""
        return f"({self.text} ? 1.0 : 0.0)" if self.true_or_false else self.text

    @property
    def condition(self) -> str:
        """Text of the value as a condition."""
        return self.text if self.true_or_false else f"({self.text} != 0)"


def operation(code: int, arguments: Sequence[Value], named: Callable[[int], str | None]) -> Value:
    """Result of an operation in C; `named` maps the code of an operation to the function to call, if any."""
    numbers = [argument.number for argument in arguments]
    if name := named(code):
        return Value(f"{name}({', '.join(numbers)})")
    if code in _BINARY:
        return Value(f"{numbers[0]} {_BINARY[code]} {numbers[1]}")
    if code in _COMPARED:
        return Value(f"{numbers[0]} {_COMPARED[code]} {numbers[1]}", True)
    if code in _JOINED:
        return Value(f"{arguments[0].condition} {_JOINED[code]} {arguments[1].condition}", True)
    if code == ca.OP_NOT:
        return Value(f"!{arguments[0].condition}", True)
    if code == ca.OP_IF_ELSE_ZERO:
        return Value(f"{arguments[0].condition} ? {numbers[1]} : 0.0")
    if code in _WRITTEN:
        return Value(_WRITTEN[code].format(*numbers))
    raise NotPortableError(f"operation {code} of CasADi has no portable C code: remove it from the loop")


def constant(value: float) -> str:
    """C literal with the exact value of a float."""
    if math.isnan(value):
        return "NAN"
    return f"({'-' if value < 0 else ''}INFINITY)" if math.isinf(value) else f"({value.hex()})"


def called_alone(code: int) -> str | None:
    """Name of the scalar C library function that implements an operation; None if there is none."""
    return _OF_THE_LIBRARY.get(code)


@cache
def elementary_c() -> str:
    """The elementary functions in C, to be inlined."""
    parts: list[Callable[..., ca.SX]] = [*dict.fromkeys(FUNCTIONS.values()), cube_root, any_power]
    written = "".join(_function_c(function) for function in parts if function is not power)
    return c_file("portable.c") + written + c_file("power.c", third=constant(THIRD))


def _function_c(function: Callable[..., ca.SX]) -> str:
    count = function.__code__.co_argcount
    with verbatim(bits=True):
        arguments = [ca.SX.sym(f"x{i}") for i in range(count)]
        written = ca.Function("written", arguments, [ca.cse([function(*arguments)])[0]])
    lines, values, end = list[str](), dict[int, Value](), ""
    for number, work in enumerate(instructions(written)):
        if work.operation == ca.OP_OUTPUT:
            end = values[work.taken[0]].number
            continue
        if work.operation == ca.OP_INPUT:
            values[work.given[0]] = Value(f"x{work.taken[0]}")
            continue
        arguments_ = [values[i] for i in work.taken]
        if work.operation in (ca.OP_POW, ca.OP_CONSTPOW):
            arguments_ = arguments_[1:]
        values[work.given[0]] = declared(lines, number, work, arguments_, _ATOMIC.get)
    head = ", ".join(f"double x{i}" for i in range(count))
    body = "\n".join(f"  {line}" for line in lines)
    return f"\nPORTABLE double portable_{function.__name__}({head}) {{\n{body}\n  return {end};\n}}\n"


def declared(
    lines: list[str], number: int, work: Instruction, arguments: Sequence[Value], named: Callable[[int], str | None]
) -> Value:
    """Value of an instruction; the line that computes it is appended to `lines`."""
    if work.operation == ca.OP_CONST:
        return Value(constant(work.constant))
    made = operation(work.operation, arguments, named)
    name = f"{'b' if made.true_or_false else 'v'}{number}"
    lines.append(f"const {'_Bool' if made.true_or_false else 'double'} {name} = {made.text};")
    return replace(made, text=name)


@cache
def portable_library() -> str:
    """C code before CasADi's generated code; it replaces calls of the C library by the portable functions."""
    names = {FUNCTIONS[code].__name__: code for code in FUNCTIONS if code != ca.OP_POW}
    called = {"power": "pow"}
    replaced = "".join(f"#define {called.get(name, name)} portable_{name}\n" for name in names)
    return elementary_c() + "\n" + replaced + "\n"


# ----------------------------------------------------------------------
# Repeated steps, in machine code where a C compiler is available.

FLAGS = (
    *("-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"),
    *("-fPIC", "-fvisibility=hidden", "-shared"),  # only hidden functions are inlined
)
"""Compiler options that leave all results bitwise unchanged."""
RADIX = 64
LEVELS = 3
_LONGEST_COMPILATION = 120  # s
_WORTH = 100_000_000
"""Least number of instructions of a run for which compilation (about 0.3 s) saves time."""


STEP = "quakedesign_step"
"""Name of a step function; it differs from all names of the C library, which take precedence when a library loads."""

MachineCode = Callable[[Any, int], int]


@dataclass(frozen=True)
class Backend:
    """Backend that advances a vector."""

    # Functions that advance the vector by 1, 64 and 4096 steps, each with one input and one output; empty if
    # `machine_code` is given
    functions: tuple[ca.Function, ...]
    name: str  # ``"compiled"`` or ``"virtual-machine"``
    reason: str  # The compiler, or the reason for using none
    machine_code: MachineCode | None = None  # (pointer to the vector, number of steps) → 0, or not 0 on failure


def prepare(step: ca.Function, compiled: bool | None, steps: int) -> Backend:
    """Backend of a step function; both kinds give bitwise equal results.

    Parameters
    ----------
    step : casadi.Function
        One vector in, one vector of the same length out; called `STEP`.
    compiled : bool or None
        Whether to compile. None: compile if this saves time and a compiler works.
    steps : int
        Number of steps of the run.

    Raises
    ------
    SimulationError
        If `compiled` is True and no compiler works.
    """
    if compiled is False:
        return _virtual_machine(step, "requested")
    if compiled is None and steps * expanded_size(step) < _WORTH:
        return _virtual_machine(step, "compilation would take longer than the run")
    try:
        command = compiler()
        return Backend((), "compiled", " ".join((*command, *FLAGS)), _compile(_source(step), command))
    except (OSError, subprocess.SubprocessError) as error:
        reason = _reason(error)
        if compiled:
            raise SimulationError(
                f"compiled=True needs a working C compiler: {reason}. Install one, set CC, or use compiled=None."
            ) from None
        return _virtual_machine(step, reason)


def _virtual_machine(step: ca.Function, reason: str) -> Backend:
    return Backend(ladder(expanded(step)), "virtual-machine", reason)


def ladder(step: ca.Function) -> tuple[ca.Function, ...]:
    """Functions for 1, RADIX, RADIX² … steps; each calls the one below, so that the code stays small."""
    rungs = [step]
    for level in range(1, LEVELS):
        start = ca.MX.sym("z", step.size1_in(0))
        end = start
        for _ in range(RADIX):
            end = rungs[-1](end)
        rungs.append(ca.Function(f"steps_{RADIX**level}", [start], [end]))
    return tuple(rungs)


def _source(step: ca.Function) -> str:
    generator = ca.CodeGenerator("steps.c")
    generator.add(step)
    sizes = {
        "step": step.name(),
        "size": step.size1_in(0),
        "work": max(1, step.sz_w()),
        "integers": max(1, step.sz_iw()),
        "arguments": step.sz_arg(),
        "results": step.sz_res(),
    }
    return portable_library() + str(generator.dump()) + c_file("steps.c", **sizes)


def compiler() -> tuple[str, ...]:
    """Command of the C compiler: CC, or the first of cc, gcc and clang.

    Raises
    ------
    FileNotFoundError
        If there is none, or CC cannot be parsed.
    """
    try:
        preferred = shlex.split(os.environ.get("CC", ""))
    except ValueError as error:
        raise FileNotFoundError(f"CC must be a command: {error}") from None
    for command in [preferred] if preferred else [["cc"], ["gcc"], ["clang"]]:
        path = shutil.which(command[0])
        if path:
            return path, *command[1:]
    raise FileNotFoundError("no C compiler was found: install cc, gcc or clang, or set CC to a compiler")


@lru_cache(maxsize=32)
def _compile(text: str, command: tuple[str, ...]) -> MachineCode:
    """Compile a C source and load its function ``advance``; the library stays in memory after its file is deleted."""
    key = text.encode(), repr((*command, *FLAGS, *_identity(command[0]))).encode()
    with temporary_folder() as folder:
        library = folder / "kept.so"
        library.write_bytes(once("code", lambda: shared_library(text, folder, command).read_bytes(), *key))
        advance: Any = ctypes.CDLL(str(library)).advance
    advance.argtypes, advance.restype = [ctypes.c_void_p, ctypes.c_longlong], ctypes.c_int
    return cast(MachineCode, advance)


def compilation() -> str:
    """Command, flags and identity of the compiler of compiled runs; empty without one."""
    try:
        command = compiler()
        return repr((*command, *FLAGS, *_identity(command[0])))
    except OSError:
        return ""


def _identity(program: str) -> tuple[str, int, int]:
    """Path, size and modification time of a program, which differ between compilers."""
    path = Path(program).resolve()
    status = path.stat()
    return str(path), status.st_size, status.st_mtime_ns


def shared_library(text: str, folder: Path, command: tuple[str, ...], flags: tuple[str, ...] = ()) -> Path:
    """Compile a C source into a shared library in a folder, with optional further flags.

    Raises
    ------
    OSError, SubprocessError
        If the compiler fails.
    """
    written, library = folder / "steps.c", folder / "steps.so"
    written.write_text(text, encoding="utf-8")
    _run([*command, *FLAGS, *flags, str(written), "-o", str(library), "-lm"], folder)
    return library


def _run(call: list[str], folder: Path) -> None:
    """Run a compiler in a separate folder; an interruption ends it and its child processes."""
    where, pipe = os.environ | {"TMPDIR": str(folder)}, subprocess.PIPE
    with subprocess.Popen(
        call, stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe, env=where, start_new_session=True
    ) as process:
        try:
            output = process.communicate(timeout=_LONGEST_COMPILATION)
        except BaseException:
            if hasattr(os, "killpg"):
                os.killpg(process.pid, signal.SIGKILL)
            else:
                process.kill()
            raise
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, call, *output)


def _reason(error: Exception) -> str:
    if isinstance(error, subprocess.CalledProcessError):
        lines = error.stderr.decode(errors="replace").strip().splitlines()
        return f"the C compiler failed: {lines[0] if lines else f'exit code {error.returncode}'}"
    return (str(error) or type(error).__name__).splitlines()[0]


# ----------------------------------------------------------------------
# Steps of many vectors at once: C with innermost loops over lanes, which the compiler vectorises.

LANES = 16
LANE_FLAGS = ("-fno-tree-pre", "-fno-thread-jumps")
"""Compiler options that favour conditional moves over branches; results are bitwise unchanged."""
_WIDE = {"__AVX512F__": ("-mavx512f", "-mprefer-vector-width=512"), "__AVX2__": ("-mavx2",)}
_LONGEST_QUERY = 10  # s


@lru_cache(maxsize=4)
def processor_flags(command: tuple[str, ...]) -> tuple[str, ...]:
    """Compiler flags for the widest vectors of this processor; empty if the compiler does not report them."""
    query = [*command, "-march=native", "-dM", "-E", "-x", "c", "-"]
    try:
        reply = subprocess.run(query, input="", capture_output=True, text=True, timeout=_LONGEST_QUERY, check=True)
    except (OSError, subprocess.SubprocessError, UnicodeError):
        return ()
    macros = reply.stdout.split()
    return next((flags for macro, flags in _WIDE.items() if macro in macros), ())


def lanes_c(step: ca.Function, diverged: int) -> str:
    """C text with ``advance_samples``, which advances vectors in adjacent lanes until they diverge.

    Parameters
    ----------
    step : casadi.Function
        One vector in, the next one out.
    diverged : int
        Index of the time of divergence in the vector.

    Raises
    ------
    NotPortableError
        For operations without a portable C text.
    """
    parts = [elementary_c()]
    _add_body(parts, step, "one_step")
    loop = c_file("lanes.c", size=step.size1_in(0), diverged=diverged)
    return c_file("lanes.h", lanes=LANES) + "".join(parts) + loop


def _add_body(parts: list[str], function: ca.Function, name: str) -> None:
    """Append a C function that maps the vectors of all lanes in place, after the functions that it calls."""
    body = _Body(function, name)
    for number, call in body.called.items():
        _add_body(parts, call.function, f"{name}_{number}")
    lines = "\n".join(f"  {line}" for line in body.lines())
    size = function.size1_in(0)
    parts.append(f"\nPORTABLE void {name}(double z[{size}][LANES]) {{\n{lines}\n}}\n")


Place = tuple[int, int]
"""Number of a task, and index of one of its results."""


@dataclass(frozen=True)
class _Task:
    """An instruction and the sources of its arguments."""

    number: int
    work: Instruction
    sources: tuple[Place, ...]

    @property
    def kind(self) -> int:
        """Key of the task's loop: a call has its own loop, and functions of the C library have separate ones."""
        return self.number if self.work.operation == ca.OP_CALL else -1 - bool(called_alone(self.work.operation))


def _tasks(work: Iterable[Instruction]) -> list[_Task]:
    """Tasks in order, with the outputs last."""
    at: dict[int, Place] = {}
    tasks = list[_Task]()
    for number, one in enumerate(work):
        taken = () if one.operation == ca.OP_INPUT else one.taken
        tasks.append(_Task(number, one, tuple(at[place] for place in taken)))
        if one.operation != ca.OP_OUTPUT:
            at |= {place: (number, i) for i, place in enumerate(one.given)}
    return sorted(tasks, key=lambda task: task.work.operation == ca.OP_OUTPUT)


class _Body:
    """Body of a function as loops over lanes: one loop, split at calls and functions of the C library."""

    def __init__(self, function: ca.Function, name: str) -> None:
        self._name = name
        self.tasks = _tasks(instructions(function))
        calls = (task for task in self.tasks if task.work.operation == ca.OP_CALL)
        self.called = {task.number: called(function, task.work) for task in calls}
        self._loops = [list(tasks) for _, tasks in groupby(self.tasks, key=lambda task: task.kind)]
        self._by_number = {task.number: task for task in self.tasks}
        loop_of = {task.number: i for i, tasks in enumerate(self._loops) for task in tasks}
        used = {(place, task.number) for task in self.tasks for place in task.sources}
        crossing = {
            place
            for place, user in used
            if loop_of[place[0]] != loop_of[user]
            and self._by_number[place[0]].work.operation not in (ca.OP_INPUT, ca.OP_CONST)
        }
        self._kept = {place: f"kept[{i}][lane]" for i, place in enumerate(sorted(crossing))}

    def lines(self) -> Iterator[str]:
        """Text of the body."""
        yield "int lane;"
        if self._kept:
            yield f"double kept[{len(self._kept)}][LANES];"
        for tasks in self._loops:
            yield from self._call(tasks[0]) if tasks[0].work.operation == ca.OP_CALL else self._loop(tasks)

    def _call(self, task: _Task) -> Iterator[str]:
        call, lines = self.called[task.number], list[str]()
        given = [self._value(place, {}, lines).number for place in task.sources]
        first, again = not call.times, f"{self._name}_{task.number}(vector)"
        lines += [f"needed[lane] = {given[0]} != 0;"] * first
        lines += [f"vector[{i}][lane] = {text};" for i, text in enumerate(given[first:])]
        results = [(self._kept.get((task.number, i)), i) for i in range(len(task.work.given))]
        chosen = "needed[lane] ? vector[{0}][lane] : 0.0" if first else "vector[{0}][lane]"
        yield "{"
        yield f"double vector[{len(given) - first}][LANES];"
        yield "int needed[LANES], any = 0;" if first else "int times;"
        yield from _over_lanes(lines)
        if first:
            yield "for (lane = 0; lane < LANES; ++lane) any |= needed[lane];"
            yield f"if (any) {again};"
        else:
            yield f"for (times = 0; times < {call.times}; ++times) {again};"
        yield from _over_lanes([f"{variable} = {chosen.format(i)};" for variable, i in results if variable])
        yield "}"

    def _loop(self, tasks: list[_Task]) -> Iterator[str]:
        lines, ends, values = list[str](), list[str](), dict[Place, Value]()
        for task in tasks:
            work, place = task.work, (task.number, 0)
            if work.operation == ca.OP_INPUT:
                continue
            taken = [self._value(source, values, lines) for source in task.sources]
            if work.operation == ca.OP_OUTPUT:
                ends.append(f"z[{work.given[1]}][lane] = {taken[0].number};")
                continue
            values[place] = declared(lines, task.number, work, taken, _macro)
            if place in self._kept:
                lines.append(f"{self._kept[place]} = {values[place].number};")
        yield from _over_lanes([*lines, *ends])

    def _value(self, place: Place, values: dict[Place, Value], lines: list[str]) -> Value:
        """A result of this loop, or one of another loop, which is loaded once."""
        if place not in values:
            work = self._by_number[place[0]].work
            if work.operation == ca.OP_CONST:
                return Value(constant(work.constant))
            name = f"v{place[0]}_{place[1]}"
            source = f"z[{work.taken[1]}][lane]" if work.operation == ca.OP_INPUT else self._kept[place]
            lines.append(f"const double {name} = {source};")
            values[place] = Value(name)
        return values[place]


def _macro(code: int) -> str | None:
    return (f"portable_{FUNCTIONS[code].__name__}" if code in FUNCTIONS else None) or called_alone(code)


def _over_lanes(lines: list[str]) -> Iterator[str]:
    yield "for (lane = 0; lane < LANES; ++lane) {"
    yield from (f"  {line}" for line in lines)
    yield "}"
