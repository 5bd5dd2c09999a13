"""Verify certificate files of FORMAT.md in exact arithmetic, with the Python standard library alone.

Usage: ``python proofs/check.py FILE...``. Every file gets one block: ``proved`` or ``refuted`` with the
statement that was verified, or ``invalid`` with one reason. Exit code 0: all proved; 1: not all; 2: an
argument cannot be read. Files of the kind ``guarantee`` need guarantee.py beside this file.

A polynomial maps tuples of exponents to nonzero fractions. The sections are: reading, exact arithmetic and
squares for both kinds of file; closed loops; plain polynomials; the command.
"""

import json
import re
import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import module_from_spec
from itertools import accumulate, chain, product
from math import comb, lcm, prod
from pathlib import Path
from typing import Any, NoReturn

MAX_BYTES, MAX_NESTING = 4 * 2**20, 12
MAX_STATES, MAX_WEIGHT, MAX_UNCERTAIN, MAX_NUMBERS = 6, 12, 8, 64
MAX_TERMS, MAX_EXPONENT, MAX_OBLIGATIONS, MAX_BASIS = 200, 24, 4096, 200
MAX_ROOTS, MAX_LIFTS = 4, 4
MAX_VARIABLES, MAX_CONSTRAINTS, MAX_PRODUCTS = 16, 32, 1024
MAX_MONOMIALS, MAX_REDUCED, MAX_POLYNOMIAL = 2000, 400, 20_000
# The following bound what a hostile file can cost; an honest one is far below.
MAX_PARAMETERS = 32  # multiplied in one term
MAX_BITS = 1990  # of a term's number times gains and constants: below any digit limit of Python
MAX_DENOMINATOR_BITS = 2**14  # common denominator of a Gram matrix, of weights or of a polynomial
MAX_STEPS = 3 * 10**7  # about a microsecond each
KEPT = 300  # steps for a term that is kept, so that memory is bounded too

RATIONAL = re.compile(r"-?(0|[1-9][0-9]{0,399})(/[1-9][0-9]{0,399})?")
INTEGER = re.compile(r"0|[1-9][0-9]{0,2}")
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")
LAW = re.compile(r"[A-Za-z0-9_-]{1,40}")
STRING = re.compile(r'"(?:[^"\\]++|\\.)*+"?', re.DOTALL)  # cannot fail once begun, hence linear

Exponents = tuple[int, ...]
Number = Fraction | int
Polynomial = dict[Exponents, Number]  # integers where this saves time


class Refused(Exception):
    """The file is no valid certificate, for the reason given."""


class Outdated(Exception):
    """The file is of a kind that is no longer read."""


@dataclass(frozen=True)
class Result:
    """Verdict, ``proved`` or ``refuted``, and the verified statement, line by line in ASCII."""

    verdict: str
    statement: tuple[str, ...]


class Budget:
    """Steps left, so that every file ends in bounded time and memory."""

    def __init__(self) -> None:
        self.left = MAX_STEPS

    def spend(self, steps: int, bits: int) -> None:
        """Count steps on integers of the given length; division is quadratic in it."""
        self.left -= steps * (1 + (bits * bits >> 20))
        need(self.left >= 0, "the verification", "done in fewer steps; shorten terms or digits", MAX_STEPS)


# ---------------------------------------------------------------- reading


def need(condition: bool, where: str, expected: str, received: object) -> None:
    """Refuse the file unless the condition holds, in one line of ASCII."""
    if condition:
        return
    text = ascii(received)
    raise Refused(f"{where} must be {expected}. Received {text if len(text) < 60 else text[:57] + '...'}")


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
    need(matches, where, 'a string such as "-3/2", at most 400 digits above and below', value)
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


# ---------------------------------------------------------------- exact arithmetic and squares


def length(number: Number) -> int:
    """Bits of the longer one of numerator and denominator."""
    return max(number.numerator.bit_length(), number.denominator.bit_length())


def add(total: dict[Any, Any], key: Any, value: Any, budget: Budget) -> None:
    """Add to one coefficient of a sum; a zero is dropped."""
    before = total.pop(key, 0)
    budget.spend(6, length(before) + length(value))  # a product of fractions and its sum cost six integer operations
    if before + value:
        total[key] = before + value


def add_scaled(first: Polynomial, scale: Fraction, second: Polynomial, budget: Budget) -> Polynomial:
    """Return first + scale * second."""
    total = dict(first)
    for exponents, number in second.items():
        add(total, exponents, scale * number, budget)
    return total


def add_product(total: dict[Any, Any], first: dict[Any, Any], second: dict[Any, Any], budget: Budget) -> dict[Any, Any]:
    """Add the product of two polynomials, with fractions or integers for coefficients, to a third."""
    for (a, x), (b, y) in product(first.items(), second.items()):
        add(total, times(a, b), x * y, budget)
        need(len(total) <= MAX_POLYNOMIAL, "an expanded polynomial", f"of at most {MAX_POLYNOMIAL} terms", "more")
    return total


def times(first: Exponents, second: Exponents) -> Exponents:
    """Multiply two monomials."""
    return tuple(map(sum, zip(first, second, strict=True)))


def to_integers(numbers: Collection[Number], where: str) -> tuple[list[int], int]:
    """Return the numbers times their common denominator, and that."""
    common = 1
    for denominator in {number.denominator for number in numbers}:
        common = lcm(common, denominator)
        bits = common.bit_length()
        need(bits <= MAX_DENOMINATOR_BITS, where, f"of common denominator < 2^{MAX_DENOMINATOR_BITS}", bits)
    return [number.numerator * (common // number.denominator) for number in numbers], common


def multiply(factors: list[Number], bases: Iterable[Fraction], exponents: Exponents, budget: Budget) -> Number:
    """Multiply numbers and powers of numbers."""
    for base, exponent in zip(bases, exponents, strict=True):
        if exponent:
            budget.spend(1, exponent * length(base))
            factors = [*factors, base**exponent]
    budget.spend(6 * len(factors), sum(map(length, factors)))
    return prod(factors)


def is_positive_definite(upper: list[list[int]], budget: Budget, *, or_singular: bool = False) -> bool:
    """Decide whether a symmetric matrix is positive (or non-negative) definite, by fraction-free elimination (Bareiss).

    Before step k every entry left is a minor of order k + 1, the pivot a leading one, so that `//` is exact. A
    singular matrix is non-negative where a zero pivot has a zero row; leaving both out changes no other minor.
    """
    size, divisor = len(upper), 1
    for k, row in enumerate(upper):
        if row[k] <= 0:
            if row[k] < 0 or not or_singular or any(row[k:]):
                return False
            continue
        budget.spend(comb(size - k, 2), 2 * max(entry.bit_length() for rest in upper[k:] for entry in rest[k:]))
        for i in range(k + 1, size):
            for j in range(i, size):
                upper[i][j] = (row[k] * upper[i][j] - row[i] * row[j]) // divisor
        divisor = row[k]
    return True


def read_element(value: Any, where: str, size: int, mixed: bool) -> Polynomial:
    """Read an element of a basis: a monomial or, in a mixed basis, any other polynomial."""
    if not mixed or type(value) is list:
        return {read_exponents(value, where, size, 999): 1}  # an integer, so that sums of monomials remain integers
    element = read_polynomial(value, where, size)
    need(list(element.values()) not in ([], [1]), where, "nonzero, and a list where it is a monomial", value)
    return element


def read_basis(value: Any, where: str, size: int, mixed: bool) -> list[Polynomial]:
    """Read a basis; every element has a term of its own, so that no entry of it can change without effect."""
    rows = read_list(value, where, 1, MAX_REDUCED if mixed else MAX_BASIS)
    basis = [read_element(row, where, size, mixed) for row in rows]
    uses = Counter(chain.from_iterable(basis))
    for element in basis:
        own = any(uses[exponents] == 1 and number > 0 for exponents, number in element.items())
        need(own, where, "without repetitions, every element with a positive term in no other", list(element))
    return basis


def read_square(
    value: Any, where: str, label: str, size: int, budget: Budget, *, mixed: bool = False
) -> tuple[Any, list[Polynomial], Polynomial]:
    """Read the entry under the label, the basis b, and expand b'Qb after checking that Q is positive definite."""
    square = read_object(value, where, (label, "basis", "gram"))
    basis = read_basis(square["basis"], f"{where} basis", size, mixed)
    count = len(basis) * (len(basis) + 1) // 2
    entries = read_list(square["gram"], f"{where} gram", count, count)
    numbers, denominator = to_integers([read_rational(entry, f"{where} gram") for entry in entries], f"{where} gram")
    remaining = iter(numbers)
    upper = [[0] * i + [next(remaining) for _ in basis[i:]] for i in range(len(basis))]
    expanded: Polynomial = {key: Fraction(number) / denominator for key, number in expand(basis, upper, budget).items()}
    need(is_positive_definite(upper, budget), f"{where} gram", "positive definite", entries)
    return square[label], basis, expanded


def expand(basis: list[Polynomial], upper: list[list[int]], budget: Budget) -> Polynomial:
    """Return b'Qb as the sum over i of b_i * (Q_ii b_i + 2 sum over j > i of Q_ij b_j)."""
    total: Polynomial = {}
    for i, first in enumerate(basis):
        weighted: Polynomial = {}
        for j in range(i, len(basis)):
            for exponents, number in basis[j].items():
                add(weighted, exponents, (1 if i == j else 2) * upper[i][j] * number, budget)
        add_product(total, first, weighted, budget)
    return total


def check_identity(first: Polynomial, second: Polynomial, total: Polynomial, where: str, budget: Budget) -> None:
    """Check that a product of two polynomials is a third."""
    difference = add_scaled(add_product({}, first, second, budget), Fraction(-1), total, budget)
    need(not difference, where, "exact in every monomial", min(difference, default=()))


# ---------------------------------------------------------------- closed loops: reading and writing

LOOP_KEYS = ("format", "law", "gains", "constants", "states", "domain", "uncertain", "roots", "lifts", "field")
PROOF_KEYS = (*LOOP_KEYS, "V", "claims", "witnesses")

Powers = tuple[Number, ...]
SignedSum = dict[tuple[tuple[str, ...], Powers, tuple[bool, ...]], Fraction]


@dataclass(frozen=True)
class Term:
    """Product of a number (gains and constants included), uncertain parameters and powers of states and lifts.

    A factor |x_i|^a is kept as the integer exponent r_i*a of u_i = |x_i|^(1/r_i) and a flag: odd for the
    signed power, even for the absolute one. For a lift, which comes after the states, a itself is kept.
    """

    number: Fraction
    uncertain: tuple[str, ...]
    exponents: Powers
    odd: tuple[bool, ...]
    written: str = ""  # in the file, where the number is zero, so that no change of it goes unseen


@dataclass(frozen=True)
class Loop:
    """The closed loop; `numbers` are its gains and constants, `uncertain` has the roots at its end.

    `roots` maps to the number under the root, `lifts` to the terms of the argument.
    """

    law: str
    numbers: dict[str, Fraction]
    weights: dict[str, int]
    domain: str
    uncertain: dict[str, tuple[Fraction, Fraction]]
    roots: dict[str, str]
    lifts: dict[str, list[Term]]
    field: dict[str, list[Term]]


def read_names(value: Any, where: str, least: int, most: int) -> dict[str, Any]:
    """Check the names of an object's members and their number."""
    need(least <= len(read_object(value, where)) <= most, where, f"{least} to {most} members", len(value))
    return {read_name(name, where): entry for name, entry in value.items()}


def read_range(value: Any, where: str) -> tuple[Fraction, Fraction]:
    """Read the ends of an uncertain parameter's range."""
    low, high = (read_rational(end, where) for end in read_list(value, where, 2, 2))
    need(low <= high, where, "a range with the lower end first", value)
    return low, high


def read_root(value: Any, where: str, numbers: dict[str, Fraction]) -> tuple[str, tuple[Fraction, Fraction]]:
    """Read a positive square root: the name of its square and the ends of a range that contains it."""
    square, *ends = read_list(value, where, 3, 3)
    need(type(square) is str and square in numbers, where, "the root of a gain or constant", square)
    low, high = read_range(ends, f"range of {where}")
    need(numbers[square] > 0, where, "the root of a positive number", square)
    need(low >= 0 and low**2 <= numbers[square] <= high**2, f"range of {where}", "one that contains the root", ends)
    return square, (low, high)


def pad_terms(terms: list[Term], size: int) -> list[Term]:
    """Write terms with zero powers of the lifts that do not occur in them."""
    rests = [size - len(term.odd) for term in terms]
    return [
        replace(term, exponents=(*term.exponents, *[0] * rest), odd=(*term.odd, *[False] * rest))
        for term, rest in zip(terms, rests, strict=True)
    ]


def read_lifts(value: dict[str, Any], loop: Loop) -> dict[str, list[Term]]:
    """Read the arguments of nested powers, each of states and of the lifts before it.

    Terms with a gain or constant zero are disregarded; the others must not vary at a given state.
    """
    lifts: dict[str, list[Term]] = {}
    for lift, entries in value.items():
        where = f"lift {lift}"
        lifts[lift] = read_terms(entries, where, replace(loop, lifts=lifts))
        for name in chain.from_iterable(term.uncertain for term in lifts[lift] if term.number):
            low, high = loop.uncertain[name]
            need(low == high, where, "without parameters that vary", name)
    return {lift: pad_terms(terms, len(loop.weights) + len(lifts)) for lift, terms in lifts.items()}


def read_loop(document: dict[str, Any]) -> Loop:
    """Read everything that closed loops share."""
    law, domain = document["law"], document["domain"]
    need(type(law) is str and LAW.fullmatch(law) is not None, "law", "1 to 40 of [A-Za-z0-9_-]", law)
    need(type(domain) is str and domain in ("cells", "reals"), "domain", "cells or reals", domain)
    parts = ("gains", MAX_NUMBERS), ("constants", MAX_NUMBERS), ("uncertain", MAX_UNCERTAIN), ("roots", MAX_ROOTS)
    gains, constants, uncertain, roots = (read_names(document[key], key, 0, most) for key, most in parts)
    need(len(gains) + len(constants) <= MAX_NUMBERS, "gains and constants", "at most 64", "more")
    weights = read_names(document["states"], "states", 1, MAX_STATES)
    lifts = read_names(document["lifts"], "lifts", 0, MAX_LIFTS if domain == "cells" else 0)
    names = [*gains, *constants, *uncertain, *roots, *lifts, *weights]
    need(len(set(names)) == len(names), "names", "different from each other", names)
    most = MAX_WEIGHT if domain == "cells" else 1
    for name, weight in weights.items():
        valid = type(weight) is int and 1 <= weight <= most
        need(valid, f"weight of {name}", f"1 to {most} on {domain}", weight)
    numbers = {name: read_rational(value, name) for name, value in (gains | constants).items()}
    squares = {name: read_root(value, f"root {name}", numbers) for name, value in roots.items()}
    ranges = {name: read_range(ends, f"range of {name}") for name, ends in uncertain.items()}
    ranges |= {name: ends for name, (_, ends) in squares.items()}
    terms = read_object(document["field"], "field", weights)
    loop = Loop(law, numbers, weights, domain, ranges, {name: square for name, (square, _) in squares.items()}, {}, {})
    loop = replace(loop, lifts=read_lifts(lifts, loop))
    return replace(loop, field={state: read_terms(terms[state], f"d{state}/dt", loop) for state in weights})


def read_factor(value: Any, where: str, loop: Loop) -> tuple[str, tuple[Number, bool]]:
    """Read a power of a state or lift: its name, the exponent of u_i or of the lift and whether it is odd."""
    state, text, kind = read_list(value, where, 3, 3)
    known = type(state) is str and (state in loop.weights or state in loop.lifts)
    need(known, where, "a power of a state or of an earlier lift", state)
    need(type(kind) is str and kind in ("s", "a"), where, "of kind s or a", kind)
    exponent = read_rational(text, where, positive=kind == "a")
    need(0 <= exponent <= MAX_EXPONENT, where, f"a power 0 to {MAX_EXPONENT}", text)
    if state in loop.lifts:
        return state, (exponent, kind == "s")
    scaled = exponent * loop.weights[state]
    need(scaled.denominator == 1, where, "a power whose exponent times the weight is an integer", text)
    parity = loop.domain == "cells" or scaled % 2 == (kind == "s")
    need(parity, where, "an odd power of kind s or an even one of kind a on reals", value)
    return state, (scaled.numerator, kind == "s")


def read_term(value: Any, where: str, loop: Loop) -> Term:
    """Read one term, multiplying gains and constants into its number."""
    first, parameters, powers = read_list(value, where, 3, 3)
    number, uncertain = read_rational(first, where), []
    need(number != 0, where, "a term with a nonzero number", first)
    for name in read_list(parameters, f"parameters in {where}", 0, MAX_PARAMETERS):
        known = type(name) is str and (name in loop.numbers or name in loop.uncertain)
        need(known, where, "a product of gains, constants, roots and uncertain parameters", name)
        number *= loop.numbers.get(name, 1)
        uncertain += [name] if name in loop.uncertain else []
    need(length(number) <= MAX_BITS, where, "a number with gains of at most 599 digits", length(number))
    entries = read_list(powers, f"factors in {where}", 0, MAX_STATES + MAX_LIFTS)
    factors = dict(read_factor(factor, where, loop) for factor in entries)
    need(len(factors) == len(entries), where, "a term with each state and lift at most once", powers)
    exponents, odd = zip(*(factors.get(name, (0, False)) for name in (*loop.weights, *loop.lifts)), strict=True)
    return Term(number, tuple(sorted(uncertain)), exponents, odd, "" if number else json.dumps(value))


def read_terms(value: Any, where: str, loop: Loop) -> list[Term]:
    """Read a sum of terms."""
    entries = read_list(value, where, 0, MAX_TERMS)
    return [read_term(entry, f"{where} term {index}", loop) for index, entry in enumerate(entries, 1)]


def term_text(term: Term, loop: Loop) -> str:
    """Write one term, e.g. ``-7*beta*sign(e1)*|e1|^(1/3)``."""
    if term.written:
        return f"0 for {term.written}"
    parts, weights = [str(term.number), *term.uncertain], loop.weights | dict.fromkeys(loop.lifts, 1)
    for (state, weight), exponent, odd in zip(weights.items(), term.exponents, term.odd, strict=True):
        signed = odd and exponent != weight
        power = state if exponent == weight and odd else f"|{state}|^({Fraction(exponent, weight)})"
        parts += [f"sign({state})"] * signed + [power] * (exponent > 0)
    return "*".join(parts)


def sum_text(terms: Iterable[Term], loop: Loop) -> str:
    """Write a sum of terms."""
    return " + ".join(term_text(term, loop) for term in terms) or "0"


def named(numbers: dict[str, Any]) -> str:
    """Write names and numbers."""
    return ", ".join(f"{name} = {number}" for name, number in numbers.items()) or "none"


def describe(loop: Loop) -> list[str]:
    """Describe the loop, which is what the verdict is about."""
    ranges = {name: f"{name} in [{low}, {high}]" for name, (low, high) in loop.uncertain.items()}
    roots = {name: f"root: {ranges.pop(name)} is the positive square root of {of}" for name, of in loop.roots.items()}
    return [
        f"law {loop.law}: no name is verified, the verdict is about the field below",
        f"gains and constants: {named(loop.numbers)}",
        f"domain: {loop.domain}; states with weights: {named(loop.weights)}",
        f"uncertain, measurable in time: {', '.join(ranges.values()) or 'none'}",
        *roots.values(),
        *(f"argument of a nested power: {lift} = {sum_text(terms, loop)}" for lift, terms in loop.lifts.items()),
        *(f"d{state}/dt = {sum_text(terms, loop)}" for state, terms in loop.field.items()),
    ]


def describe_claims(loop: Loop, claims: dict[str, Fraction], m: int, n: int) -> list[str]:
    """Describe what a proof proves; V <= C sum u^m makes dV/dt <= -c V^(n/m)."""
    positive, decrease, kappa = (claims.get(key) for key in ("positive", "decrease", "decay"))
    if loop.domain == "reals":
        text = f"V >= {positive} * sum x_i^{m}; dV/dt <= -2*a*V with a = {claims['rate']}"
        degrees, ending = f"V {m}", "exponentially with rate a" if m == 2 else "with V(t) <= exp(-2*a*t)*V(0)"
    else:
        text = f"V >= {positive} * sum u_i^{m}; dV/dt <= -{decrease} * sum u_i^{n}; u_i = |x_i|^(1/weight)"
        degrees, ending = f"V {m}, dV/dt {n}", "in finite time" if n < m else "finite time is not claimed"
    bounds = [(claims.get(f"bound_{x}"), x, Fraction(m, r)) for x, r in loop.weights.items()]
    fall = [f"dV/dt <= -{kappa} * V^({Fraction(n, m)})"] if kappa else []
    if kappa and n < m:
        time, power = Fraction(m, m - n) / kappa, Fraction(m - n, m)
        fall.append(f"settling time: the origin is reached within {time} * V(0)^({power})")
    return [
        f"claims: {text}",
        *(f"V >= {gamma} * |{x}|^({power})" for gamma, x, power in bounds if gamma),
        *fall,
        f"homogeneous degrees: {degrees}",
        f"conclusion: the origin is globally asymptotically stable, {ending}",
    ]


def describe_equilibrium(
    loop: Loop, values: dict[str, Fraction], point: dict[str, Fraction], weights: dict[str, Fraction]
) -> list[str]:
    """Describe a refutation; a homogeneous field has a whole ray of equilibria, down to the origin."""
    degrees = {
        sum(term.exponents) - weight
        for (state, weight) in loop.weights.items()
        for term in loop.field[state]
        if term.number and all(values[name] for name in term.uncertain)
    }
    ending = "not asymptotically stable" if len(degrees) < 2 else "not globally asymptotically stable"
    return [
        f"parameters: {named(values)}",
        f"v, where x_i = sign(v_i)*|v_i|^weight: {named(point)}",
        f"weights of the cells: {named(weights)}",
        f"homogeneous degrees: field {', '.join(map(str, sorted(degrees))) or 'any'}",
        f"conclusion: x is a Filippov equilibrium; the origin is {ending} for these parameters, whatever V",
    ]


# ---------------------------------------------------------------- closed loops: proofs


def read_function(value: Any, loop: Loop) -> list[Term]:
    """Read V; the closed-cell argument and the affine ends need it C1 and without uncertain parameters."""
    function = pad_terms(read_terms(value, "V", replace(loop, lifts={})), len(loop.weights) + len(loop.lifts))
    for index, term in enumerate(function, 1):
        need(not term.uncertain, f"V term {index}", "without uncertain parameters", term.uncertain)
        for weight, exponent, odd in zip(loop.weights.values(), term.exponents, term.odd, strict=False):
            smooth = exponent >= weight if odd else exponent == 0 or exponent > weight
            need(smooth, f"V term {index}", "C1: exponents s >= 1, a > 1", str(Fraction(exponent, weight)))
    return function


def time_derivative(function: list[Term], loop: Loop, budget: Budget) -> SignedSum:
    """Sum the products of the partial derivatives of V with the field.

    d[x]^a = a |x|^(a-1) and d|x|^a = a [x]^(a-1): the parity of x flips. Odd times odd is even.
    """
    total: SignedSum = {}
    for (i, (state, weight)), term in product(enumerate(loop.weights.items()), function):
        for other in loop.field[state] if term.exponents[i] else ():
            pairs = enumerate(zip(term.exponents, other.exponents, term.odd, other.odd, strict=True))
            powers = [(a + b - weight * (i == j), (c != d) != (i == j)) for j, (a, b, c, d) in pairs]
            exponents, odd = zip(*powers, strict=True)
            number = term.number * other.number * Fraction(term.exponents[i], weight)
            add(total, (other.uncertain, exponents, odd), number, budget)
    return total


def collect(terms: Iterable[Term], budget: Budget) -> SignedSum:
    """Add up terms."""
    total: SignedSum = {}
    for term in terms:
        add(total, (term.uncertain, term.exponents, term.odd), term.number, budget)
    return total


def restrict(function: SignedSum, cell: "Cell", values: dict[str, Fraction], budget: Budget) -> Polynomial:
    """Write a function as a polynomial in u on one cell at one vertex (in x on reals, with all signs +)."""
    total: Polynomial = {}
    for (uncertain, exponents, odd), number in function.items():
        sign = prod(sign for sign, flag in zip(cell.signs, odd, strict=False) if flag)
        powers = [Fraction(exponents[i]) * n for i, n in cell.degrees.items()]
        need(all(power.denominator == 1 for power in powers), "powers of lifts", "integers on cells", "a fraction")
        add(total, tuple(map(int, powers)), sign * number * prod(values[name] for name in uncertain), budget)
    return total


def degree_of(form: Polynomial, name: str) -> int:
    """Return the degree of a nonzero form."""
    degrees = {sum(exponents) for exponents in form}
    need(len(degrees) == 1 and 0 not in degrees, name, "a form of one degree >= 1", sorted(degrees))
    return degrees.pop()


def cells_of(choices: Iterable[Sequence[int]]) -> dict[str, Exponents]:
    """Sign cells by label, from the admissible signs of every state."""
    return {"".join("+" if sign > 0 else "-" for sign in signs): signs for signs in product(*choices)}


@dataclass
class Cell:
    """Points where states and lifts have given signs, after what holds there; it grows with every lift.

    `degrees` has an entry for every variable: its index among states and lifts, and the degree of that.
    """

    label: str
    states: int
    signs: Exponents
    degrees: dict[int, int]
    equalities: list[Polynomial]
    inequalities: list[Polynomial]

    def has_interior(self) -> bool:
        """Tell whether signs alone leave points where all variables are positive."""
        one_sign = (len({number > 0 for number in h.values()}) == 1 for h in self.equalities)
        return not any(one_sign) and all(max(g.values()) > 0 for g in self.inequalities)


def whole_space(size: int) -> Cell:
    """Return what takes the place of the cells on reals."""
    return Cell("", size, (1,) * size, dict.fromkeys(range(size), 1), [], [])


def widen(polynomials: Iterable[Polynomial], size: int) -> list[Polynomial]:
    """Write polynomials in more variables."""
    return [{(*e, *[0] * (size - len(e))): number for e, number in entry.items()} for entry in polynomials]


def reach_of(form: Polynomial, reaches: dict[int, set[int]], count: int, budget: Budget) -> set[int]:
    """Return the states that a lift's argument depends on, after checking that it is zero on a null set only.

    As a polynomial in those states on which no lift in it depends, it has a coefficient without lifts. This is a
    nonzero polynomial in the other states, hence zero on a null set.
    """
    budget.spend(len(form) * MAX_STATES, 0)
    inner = set[int]().union(*(reaches[i] for e in form for i in range(count, len(e)) if e[i]))
    parts = defaultdict[Exponents, set[bool]](set)
    for e in form:
        parts[tuple(0 if i in inner else e[i] for i in range(count))].add(any(e[count:]))
    need({False} in parts.values(), "an argument", "zero on a null set only, by a part without lifts", "another")
    return inner | {i for e in form for i in range(count) if e[i]}


def cells_with_lifts(loop: Loop, budget: Budget) -> list[Cell]:
    """Return the cells with an interior; a lift P gives t*w^n = P or, where only its sign occurs, t*P >= 0."""
    count, degrees, cells = len(loop.weights), dict[str, int](), []
    fixed = {name: low for name, (low, high) in loop.uncertain.items() if low == high}
    terms = [*chain(*loop.field.values()), *(term for term in chain(*loop.lifts.values()) if term.number)]
    for i, lift in enumerate(loop.lifts, count):
        need(any(term.odd[i] or term.exponents[i] for term in terms), f"lift {lift}", "used", "one that is not")
    raised = {i for term in terms for i, exponent in enumerate(term.exponents) if exponent}
    arguments = [collect(terms, budget) for terms in loop.lifts.values()]
    for label, signs in cells_of([(1, -1)] * (count + len(arguments))).items():
        cell, reaches = Cell(f" {label}", count, signs, dict.fromkeys(range(count), 1), [], []), dict[int, set[int]]()
        for i, (lift, argument) in enumerate(zip(loop.lifts, arguments, strict=True), count):
            form, size = restrict(argument, cell, fixed, budget), len(cell.degrees)
            degree = degree_of(form, f"lift {lift}")
            need(degrees.setdefault(lift, degree) == degree, f"lift {lift}", "of one degree on all cells", degree)
            reach = reach_of(form, reaches, count, budget)
            if i in raised:
                reaches[size], cell.degrees[i] = reach, degree
                power: Polynomial = {(*[0] * size, degree): signs[i]}
                cell.equalities.append(add_scaled(power, Fraction(-1), widen([form], size + 1)[0], budget))
            else:
                cell.inequalities.append(add_scaled({}, Fraction(signs[i]), form, budget))
        if cell.has_interior():
            cells.append(cell)
    return cells


@dataclass(frozen=True)
class Obligation:
    """P >= 0 where all variables are non-negative and the limits hold; `size` is the number of variables."""

    name: str
    polynomial: Polynomial
    size: int
    equalities: Sequence[Polynomial] = ()
    inequalities: Sequence[Polynomial] = ()

    def key(self) -> Any:
        """Identify obligations that share a witness."""
        parts = (self.polynomial,), self.equalities, self.inequalities
        return tuple(tuple(frozenset(entry.items()) for entry in part) for part in parts)


def read_claims(value: Any, loop: Loop) -> dict[str, Fraction]:
    """Read the claims in the order of their obligations: positive, bounds, decrease or rate, then decay."""
    bounds = [f"bound_{state}" for state in loop.weights if f"bound_{state}" in read_object(value, "claims")]
    keys = "positive", *bounds, *(("decrease",) if loop.domain == "cells" else ("rate",))
    keys += ("decay",) if loop.domain == "cells" and "decay" in value else ()
    given = read_object(value, "claims", keys)
    return {key: read_rational(given[key], f"claims {key}", positive=True) for key in keys}


def power_sum(indices: Iterable[int], size: int, degree: int) -> Polynomial:
    """Return the sum of u_i^degree over some of the variables."""
    return {tuple(degree * (i == j) for j in range(size)): Fraction(1) for i in indices}


def vertices_of(loop: Loop) -> list[dict[str, Fraction]]:
    """Return the vertices of the box of uncertain parameters; a range of one point has one."""
    return [
        dict(zip(loop.uncertain, vertex, strict=True))
        for vertex in product(*(dict.fromkeys(ends) for ends in loop.uncertain.values()))
    ]


def named_vertex(name: str, vertex: dict[str, Fraction]) -> str:
    """Return the name of an obligation at a vertex."""
    return name + "".join(f" {key}={value}" for key, value in vertex.items())


def obligations(
    function: SignedSum, rate: SignedSum, claims: dict[str, Fraction], loop: Loop, budget: Budget
) -> Iterator[tuple[int, Obligation]]:
    """Yield the degree of V or dV/dt and the obligation, in the order of the format."""
    size, on_cells, vertices = len(loop.weights), loop.domain == "cells", vertices_of(loop)
    lower = [claim for claim in claims if claim not in ("decrease", "rate", "decay")]
    if on_cells:
        cells = cells_with_lifts(loop, budget)
        plain = cells_with_lifts(replace(loop, field={}, lifts={}), budget)
    else:
        plain = cells = [whole_space(size)]
    count = len(plain) * len(lower) + len(cells) * (len(claims) - len(lower)) * len(vertices)
    need(count <= MAX_OBLIGATIONS, "obligations", f"at most {MAX_OBLIGATIONS}", count)
    for claim, cell in product(lower, plain):
        value = restrict(function, cell, {}, budget)
        degree = degree_of(value, "V")
        need(on_cells or degree % 2 == 0, "V", "of even degree on reals", degree)
        chosen = [i for i, state in enumerate(loop.weights) if claim in ("positive", f"bound_{state}")]
        difference = add_scaled(value, -claims[claim], power_sum(chosen, size, degree), budget)
        yield degree, Obligation(claim + cell.label, difference, size)
    for claim, cell, vertex in product(claims, cells, vertices):
        if claim not in lower:
            name = named_vertex(claim + cell.label, vertex)
            fall = add_scaled({}, Fraction(-1), restrict(rate, cell, vertex, budget), budget)
            value = restrict(function, cell, {}, budget) if claim != "decrease" else {}
            yield falling(name, fall, value, claim, claims[claim], cell, budget)


def falling(
    name: str, fall: Polynomial, value: Polynomial, claim: str, number: Fraction, cell: Cell, budget: Budget
) -> tuple[int, Obligation]:
    """Return the degree of -dV/dt and the obligation that it is large enough."""
    size, equalities = len(cell.degrees), cell.equalities
    if claim == "rate":
        return 0, Obligation(name, add_scaled(fall, -2 * number, value, budget), size)
    degree = degree_of(fall, f"dV/dt at {name}")
    powers = power_sum(range(cell.states), size, degree)
    if claim == "decay":
        size += 1
        [fall], [value], powers = widen([fall], size), widen([value], size), power_sum([size - 1], size, degree)
        root = power_sum([size - 1], size, degree_of(value, "V"))
        equalities = [*equalities, add_scaled(root, Fraction(-1), value, budget)]
    limits = widen(equalities, size), widen(cell.inequalities, size)
    return degree, Obligation(name, add_scaled(fall, -number, powers, budget), size, *limits)


def read_squares(value: Any, where: str, size: int, most: int, budget: Budget) -> Polynomial:
    """Read and expand the sum of u^times b'Qb, with times up to 1 or 0."""
    total: Polynomial = {}
    for index, entry in enumerate(read_list(value, f"{where} squares", 0, 2**size), 1):
        label, _, expanded = read_square(entry, f"{where} square {index}", "times", size, budget)
        factor = read_exponents(label, f"{where} square {index} times", size, most)
        add_product(total, {factor: 1}, expanded, budget)
    return total


def check_witness(obligation: Obligation, value: Any, on_cells: bool, budget: Budget) -> None:
    """Check multiplier * P = squares + sum of g_l * squares_l + sum of q_k * h_k."""
    where, size, most = f"witness of {obligation.name}:", obligation.size, int(on_cells)
    witness = read_object(value, where, ("obligation", "multiplier", "squares", "equalities", "inequalities"))
    need(witness["obligation"] == obligation.name, where, "the next witness", witness["obligation"])
    multiplier = read_polynomial(witness["multiplier"], f"{where} multiplier", size, positive=True)
    need(bool(multiplier), f"{where} multiplier", "nonempty", multiplier)
    one = multiplier == {(0,) * size: 1}  # so that no number of the file is without effect
    need(
        one or (on_cells and bool(obligation.polynomial)), f"{where} multiplier", "1 on reals or for P = 0", multiplier
    )
    count = len(obligation.inequalities)
    lists = [witness["squares"], *read_list(witness["inequalities"], f"{where} inequalities", count, count)]
    count = len(obligation.equalities)
    cofactors = read_polynomials(witness["equalities"], f"{where} equalities", size, count, count)
    empty = not any(lists) and not any(cofactors)
    need(bool(obligation.polynomial) or empty, f"{where} squares and equalities", "empty for P = 0", "others")
    right: Polynomial = {}
    factors: list[Polynomial] = [{(0,) * size: 1}, *obligation.inequalities]
    for factor, squares in zip(factors, lists, strict=True):
        add_product(right, factor, read_squares(squares, where, size, most, budget), budget)
    for cofactor, equality in zip(cofactors, obligation.equalities, strict=True):
        add_product(right, cofactor, equality, budget)
    check_identity(multiplier, obligation.polynomial, right, f"{where} identity", budget)


def check_witnesses(value: Any, pairs: Iterable[Obligation], on_cells: bool, budget: Budget) -> None:
    """Check a witness for each different obligation, in their order."""
    witnesses, seen = iter(read_list(value, "witnesses", 0, MAX_OBLIGATIONS)), set()
    for obligation in pairs:
        if obligation.key() not in seen:
            seen.add(obligation.key())
            check_witness(obligation, next(witnesses, "none"), on_cells, budget)
    need(next(witnesses, None) is None, "witnesses", f"{len(seen)} in number", len(value))


def check_affine(loop: Loop) -> None:
    """Check that no uncertain parameter occurs twice in a term, else the ends would not decide."""
    for term in chain(*loop.field.values()):
        unique = len(set(term.uncertain)) == len(term.uncertain)
        need(unique, "field", "affine in every uncertain parameter", term.uncertain)


def prove(document: dict[str, Any], loop: Loop, budget: Budget) -> Result:
    """Verify a proof."""
    check_affine(loop)
    function, claims, degrees = read_function(document["V"], loop), read_claims(document["claims"], loop), [0, 0]
    rate = time_derivative(function, loop, budget)

    def consistent() -> Iterator[Obligation]:
        for degree, obligation in obligations(collect(function, budget), rate, claims, loop, budget):
            kind = obligation.name.split()[0] in ("decrease", "rate", "decay")
            degrees[kind] = degrees[kind] or degree
            need(degree == degrees[kind], f"degree at {obligation.name}", f"{degrees[kind]} as before", degree)
            yield obligation

    check_witnesses(document["witnesses"], consistent(), loop.domain == "cells", budget)
    lines = describe_claims(loop, claims, *degrees)
    return Result("proved", (*describe(loop), f"V = {sum_text(function, loop)}", *lines))


# ---------------------------------------------------------------- closed loops: refutations


def read_values(value: Any, where: str, names: Iterable[str]) -> dict[str, Fraction]:
    """Read one rational for every name, in the order of the names."""
    numbers = read_object(value, where, names)
    return {name: read_rational(numbers[name], f"{where} {name}") for name in names}


def refute(document: dict[str, Any], loop: Loop, budget: Budget) -> Result:
    """Verify that a point is an equilibrium of Filippov's inclusion."""
    need(loop.domain == "cells", "the domain of a refutation", "cells", loop.domain)
    need(not loop.roots and not loop.lifts, "roots and lifts of a refutation", "empty", [*loop.roots, *loop.lifts])
    refutation = read_object(document["refutation"], "refutation", ("parameters", "point", "weights"))
    values = read_values(refutation["parameters"], "parameters", loop.uncertain)
    for name, (low, high) in loop.uncertain.items():
        need(low <= values[name] <= high, f"parameter {name}", "in its range", str(values[name]))
    point = read_values(refutation["point"], "point", loop.weights)
    need(any(point.values()), "point", "away from the origin", refutation["point"])
    cells = cells_of([(1,) if v > 0 else (-1,) if v < 0 else (1, -1) for v in point.values()])
    weights = read_values(refutation["weights"], "weights", cells)
    need(min(weights.values()) >= 0, "weights", "non-negative", refutation["weights"])
    shares, total = to_integers(weights.values(), "weights")
    need(sum(shares) == total, "weights", "of sum 1", refutation["weights"])
    mixture = list(zip(shares, cells.values(), strict=True))
    for state, terms in loop.field.items():
        balance: dict[str, Number] = {}
        for term in terms:
            add(balance, state, limit_of(term, values, list(point.values()), mixture, budget), budget)
        need(not balance, f"the weighted limit of d{state}/dt", "zero", "another number")
    return Result("refuted", (*describe(loop), *describe_equilibrium(loop, values, point, weights)))


def limit_of(
    term: Term, values: dict[str, Fraction], point: list[Fraction], mixture: list[tuple[int, Exponents]], budget: Budget
) -> Number:
    """Sum share * limit over the cells: the absolute powers are common, the signs are those of the cell."""
    flags = [index for index, odd in enumerate(term.odd) if odd]
    share = sum(share * prod(cell[index] for index in flags) for share, cell in mixture)
    factors: list[Number] = [term.number, share, *(values[name] for name in term.uncertain)]
    return multiply(factors, map(abs, point), tuple(map(int, term.exponents)), budget)


# ---------------------------------------------------------------- polynomials: reading and writing

STATEMENT_KEYS = ("format", "variables", "polynomial", "inequalities", "equalities", "products", "degree", "multiplier")

Product = tuple[int, ...]  # of inequalities, by their indices
Expander = Callable[[Product], Polynomial]


@dataclass(frozen=True)
class Statement:
    """multiplier * polynomial = sum of products of inequalities * sums of squares + cofactors * equalities."""

    variables: list[str]
    polynomial: Polynomial
    multiplier: Polynomial
    inequalities: list[Polynomial]
    equalities: list[Polynomial]
    products: list[Product]
    degree: int


def read_polynomials(value: Any, where: str, size: int, least: int, most: int) -> list[Polynomial]:
    """Read a list of polynomials."""
    return [read_polynomial(entry, where, size) for entry in read_list(value, where, least, most)]


def read_product(value: Any, where: str, count: int) -> Product:
    """Read an increasing list of indices of inequalities."""
    for index in read_list(value, where, 0, count):
        need(type(index) is int and index < count, where, f"a list of indices below {count}", index)
    need(value == sorted(set(value)), where, "increasing", value)
    return tuple(value)


def read_statement(document: dict[str, Any]) -> Statement:
    """Read everything that the three kinds of proof share."""
    entries = read_list(document["variables"], "variables", 1, MAX_VARIABLES)
    variables, degree, size = [read_name(name, "variables") for name in entries], document["degree"], len(entries)
    need(len(set(variables)) == size, "variables", "different from each other", variables)
    need(type(degree) is int, "degree", "an integer", degree)
    polynomial, multiplier = (read_polynomial(document[key], key, size) for key in ("polynomial", "multiplier"))
    inequalities = read_polynomials(document["inequalities"], "inequalities", size, 0, MAX_CONSTRAINTS)
    most = MAX_CONSTRAINTS - len(inequalities)
    equalities = read_polynomials(document["equalities"], "equalities", size, 0, most)
    need(all((multiplier, *inequalities, *equalities)), "multiplier, inequalities and equalities", "nonzero", "0")
    different = {frozenset(inequality.items()) for inequality in inequalities}
    need(len(different) == len(inequalities), "inequalities", "different from each other", "a repetition")
    entries = read_list(document["products"], "products", 1, MAX_PRODUCTS)
    products = [read_product(entry, "products", len(inequalities)) for entry in entries]
    valid = () in products and len(set(products)) == len(products)
    need(valid, "products", "different from each other, the empty one among them", entries)
    return Statement(variables, polynomial, multiplier, inequalities, equalities, products, degree)


def product_expander(statement: Statement, budget: Budget) -> Expander:
    """Return a function that expands a product of inequalities, and remembers it."""

    @cache
    def expand_product(chosen: Product) -> Polynomial:
        if not chosen:
            return {(0,) * len(statement.variables): Fraction(1)}
        total = add_product({}, expand_product(chosen[:-1]), statement.inequalities[chosen[-1]], budget)
        budget.spend(KEPT * len(total), 0)
        return total

    return expand_product


def terms_text(polynomial: Polynomial, statement: Statement, form: str = "{0}*{1}", joint: str = " + ") -> str:
    """Write a polynomial, e.g. ``1*x^2 + -2/3*x + 1``, or the values of a functional."""
    terms = []
    for exponents, number in sorted(polynomial.items(), reverse=True):
        powers = zip(statement.variables, exponents, strict=True)
        monomial = "*".join(f"{name}^{power}" if power > 1 else name for name, power in powers if power)
        terms.append(form.format(number, monomial or "1").removesuffix("*1"))
    return joint.join(terms) or "0"


def describe_statement(statement: Statement) -> list[str]:
    """Describe what the verdict is about."""
    products = ("*".join(f"[{index}]" for index in chosen) or "1" for chosen in statement.products)
    limits = [f"[{i}] = {terms_text(entry, statement)} >= 0" for i, entry in enumerate(statement.inequalities)]
    limits += [f"{terms_text(entry, statement)} = 0" for entry in statement.equalities]
    return [
        f"variables, all real: {', '.join(statement.variables)}",
        f"polynomial: {terms_text(statement.polynomial, statement)}",
        *(f"set: {limit}" for limit in limits or ["all points"]),
        f"multiplier: {terms_text(statement.multiplier, statement)}",
        f"products: {', '.join(products)}; degree: {statement.degree}",
    ]


# ---------------------------------------------------------------- polynomials: proofs


def sum_squares(
    value: Any, where: str, statement: Statement, expanded: Expander, budget: Budget
) -> tuple[Polynomial, bool]:
    """Sum the squares times their products, and tell whether 1 is in the basis of one without inequalities."""
    total, size, positive = dict[Exponents, Number](), len(statement.variables), False
    for index, entry in enumerate(read_list(value, where, 0, MAX_BYTES), 1):
        place = f"{where} square {index}"
        label, basis, square = read_square(entry, place, "product", size, budget, mixed=True)
        chosen = read_product(label, f"{place} product", len(statement.inequalities))
        need(chosen in statement.products, f"{place} product", "one of the products", label)
        add_product(total, expanded(chosen), square, budget)
        positive |= not chosen and {(0,) * size: 1} in basis
    return total, positive


def check_multiplier(value: Any, statement: Statement, expanded: Expander, budget: Budget) -> None:
    """Check that the multiplier is non-negative on the set, and positive where this may have no interior."""
    one, limits = (0,) * len(statement.variables), statement.inequalities
    units = [e for g in limits for e, number in g.items() if len(g) == 1 and sum(e) == 1 and number > 0]
    signed = {exponents.index(1) for exponents in units}
    if read_list(value, "sos multiplier", 0, MAX_BYTES):
        total, positive = sum_squares(value, "sos multiplier", statement, expanded, budget)
        check_identity({one: Fraction(1)}, statement.multiplier, total, "sos multiplier identity", budget)
    else:
        positive = one in statement.multiplier
        for exponents, number in statement.multiplier.items():
            even = all(exponent % 2 == 0 or i in signed for i, exponent in enumerate(exponents))
            need(number > 0 and even, "multiplier", "of squares, or of positive even terms", exponents)
    orthant = len(units) == len(limits) and not statement.equalities
    need(positive or orthant, "multiplier", "positive everywhere on this set, by a term or square of 1", "another")


def prove_squares(value: Any, statement: Statement, budget: Budget) -> list[str]:
    """Verify that multiplier * polynomial is a sum of non-negative terms and terms that vanish on the set."""
    proof, count = read_object(value, "sos", ("squares", "cofactors", "multiplier")), len(statement.equalities)
    expanded = product_expander(statement, budget)
    check_multiplier(proof["multiplier"], statement, expanded, budget)
    total, _ = sum_squares(proof["squares"], "sos", statement, expanded, budget)
    cofactors = read_polynomials(proof["cofactors"], "sos cofactors", len(statement.variables), count, count)
    for cofactor, equality in zip(cofactors, statement.equalities, strict=True):
        add_product(total, cofactor, equality, budget)
    check_identity(statement.multiplier, statement.polynomial, total, "sos identity", budget)
    return ["conclusion: the polynomial is >= 0 on the set (the degree of the identity is not verified)"]


# ---------------------------------------------------------------- polynomials: refutations

Coded = dict[int, int]  # integer coefficients by monomials, each one an integer, so that their products are sums
DIGIT = 12  # bits of an exponent in a coded monomial; the largest exponent, of multiplier * polynomial, is 1998


def coded(polynomial: Polynomial, where: str) -> Coded:
    """Return a positive multiple with integer coefficients."""
    codes = (sum(exponent << DIGIT * i for i, exponent in enumerate(exponents)) for exponents in polynomial)
    return dict(zip(codes, to_integers(polynomial.values(), where)[0], strict=True))


def monomials(size: int, degree: int) -> list[int]:
    """Return all coded monomials up to a degree, none if it is negative."""
    partial = [(0, degree)] if degree >= 0 else []
    for i in range(size):
        partial = [(m + (a << DIGIT * i), left - a) for m, left in partial for a in range(left + 1)]
    return [m for m, _ in partial]


def apply(functional: Coded, monomial: int, polynomial: Coded, budget: Budget) -> int:
    """Return L(monomial * polynomial)."""
    total = 0
    for m, number in polynomial.items():
        value = functional.get(monomial + m, 0)
        budget.spend(1, value.bit_length() + number.bit_length())
        total += number * value
    return total


def check_equalities(functional: Coded, statement: Statement, budget: Budget) -> set[int]:
    """Check that L is zero on all multiples of equalities within the degree, and return their monomials."""
    covered, size = set[int](), len(statement.variables)
    for equality in statement.equalities:
        factor, room = coded(equality, "an equality"), statement.degree - max(map(sum, equality))
        budget.spend(comb(size + max(room, 0), size) * len(factor), 0)
        for m in monomials(size, room):
            zero = apply(functional, m, factor, budget) == 0
            need(zero, "the functional", "zero on all multiples of the equalities", "another number")
            covered.update(m + t for t in factor)
    return covered


def reduce(bases: dict[Product, list[int]], factors: dict[Product, Coded], kept: set[int]) -> dict[Product, set[int]]:
    """Drop monomials whose diagonal Gram entries must be zero, as long as there are any.

    Where only positive diagonal entries contribute to a monomial that is not kept, they add up to zero: each is
    zero, and its row with it. What hinders can only become less, so the order does not matter.
    """
    hindering: Counter[int] = Counter()  # by monomial, the number of all other contributions
    diagonal: dict[int, list[tuple[Product, int]]] = defaultdict(list)
    for chosen, basis in bases.items():
        for (t, number), (i, b) in product(factors[chosen].items(), enumerate(basis)):
            hindering.update(map((t + b).__add__, basis[i + (number > 0) :]))
            if number > 0:
                diagonal[t + b + b].append((chosen, b))
    alive = {chosen: set(basis) for chosen, basis in bases.items()}
    droppable = [e for e in diagonal if not hindering[e] and e not in kept]
    while droppable:
        for chosen, b in diagonal[droppable.pop()]:
            if b not in alive[chosen]:
                continue
            for (t, number), other in product(factors[chosen].items(), alive[chosen]):
                if other != b or number < 0:
                    e = t + b + other
                    hindering[e] -= 1
                    if not hindering[e] and e in diagonal and e not in kept:
                        droppable.append(e)
            alive[chosen].remove(b)
    return alive


def survivors(statement: Statement, kept: set[int], budget: Budget) -> Iterator[tuple[Product, Coded, list[int]]]:
    """Yield the products within the degree, expanded, with the monomials of their squares after reduction."""
    size, degrees = len(statement.variables), [max(map(sum, entry)) for entry in statement.inequalities]
    rooms = {chosen: statement.degree - sum(degrees[i] for i in chosen) for chosen in statement.products}
    counts = {chosen: comb(size + room // 2, size) for chosen, room in rooms.items() if room >= 0}
    need(counts[()] <= MAX_MONOMIALS, "a basis before reduction", f"of at most {MAX_MONOMIALS} monomials", counts[()])
    expanded = product_expander(statement, budget)
    factors = {chosen: coded(expanded(chosen), "a product") for chosen in counts}
    budget.spend(sum(comb(count + 1, 2) * len(factors[chosen]) for chosen, count in counts.items()), 0)
    bases = {chosen: monomials(size, rooms[chosen] // 2) for chosen in counts}
    for chosen, basis in reduce(bases, factors, kept).items():
        need(len(basis) <= MAX_REDUCED, "a reduced basis", f"of at most {MAX_REDUCED} monomials", len(basis))
        yield chosen, factors[chosen], sorted(basis)


def blocks(upper: list[list[int]]) -> Iterator[list[list[int]]]:
    """Split a symmetric matrix, given by its upper triangle, into connected blocks."""
    left = list(range(len(upper)))
    while left:
        block = [left.pop(0)]
        for i in block:  # grows while it is read
            linked = {j for j in left if upper[min(i, j)][max(i, j)]}
            block += linked
            left = [j for j in left if j not in linked]
        yield [[upper[min(i, j)][max(i, j)] for j in block] for i in block]


def refute_by_functional(value: Any, statement: Statement, budget: Budget) -> list[str]:
    """Verify that L is negative at multiplier * polynomial and non-negative at all sums of the statement."""
    proof, size = read_object(value, "not-sos", ("functional",)), len(statement.variables)
    values = read_polynomial(proof["functional"], "functional", size)
    left = add_product({}, statement.multiplier, statement.polynomial, budget)
    functional, target = coded(values, "functional"), coded(left, "multiplier times polynomial")
    negative = apply(functional, 0, target, budget) < 0
    need(negative, "the functional", "negative at multiplier times polynomial", "another number")
    kept = check_equalities(functional, statement, budget) | set(target)
    for chosen, factor, basis in survivors(statement, kept, budget):
        upper = [[0] * i + [apply(functional, b + c, factor, budget) for c in basis[i:]] for i, b in enumerate(basis)]
        valid = all(is_positive_definite(block, budget, or_singular=True) for block in blocks(upper))
        need(valid, f"the moment matrix of product {list(chosen)}", "non-negative definite", "another one")
    return [
        f"functional, zero on all other monomials: {terms_text(values, statement, 'L({1}) = {0}', ', ')}",
        "conclusion: multiplier times polynomial is no sum, of terms up to the degree, of products times sums of "
        "squares and multiples of the equalities",
    ]


def evaluate(polynomial: Polynomial, point: list[Fraction], budget: Budget) -> Number:
    """Return the value of a polynomial at a point."""
    total: dict[str, Number] = {}
    for exponents, number in polynomial.items():
        add(total, "value", multiply([number], point, exponents, budget), budget)
    return total.get("value", 0)


def refute_by_point(value: Any, statement: Statement, budget: Budget) -> list[str]:
    """Verify that the polynomial is negative at a point of the set."""
    entries = read_object(value, "negative", ("point",))["point"]
    count = len(statement.variables)
    point = [read_rational(entry, "point") for entry in read_list(entries, "point", count, count)]
    inside = all(evaluate(inequality, point, budget) >= 0 for inequality in statement.inequalities)
    need(inside, "the point", "one where every inequality holds", entries)
    inside = all(evaluate(equality, point, budget) == 0 for equality in statement.equalities)
    need(inside, "the point", "one where every equality holds", entries)
    need(evaluate(statement.polynomial, point, budget) < 0, "the polynomial", "negative at the point", entries)
    return [
        f"point: {named(dict(zip(statement.variables, point, strict=True)))}",
        "conclusion: the polynomial is < 0 at this point of the set, so that no degree and no positive multiplier help",
    ]


def check_polynomial(document: dict[str, Any], budget: Budget) -> Result:
    """Verify a file about a plain polynomial."""
    kinds = {"sos": prove_squares, "not-sos": refute_by_functional, "negative": refute_by_point}
    given = [kind for kind in kinds if kind in document] or ["sos"]
    read_object(document, "the file", (*STATEMENT_KEYS, given[0]))
    statement = read_statement(document)
    lines = kinds[given[0]](document[given[0]], statement, budget)
    return Result("proved" if given == ["sos"] else "refuted", (*describe_statement(statement), *lines))


# ---------------------------------------------------------------- the command


def check(text: str) -> Result:
    """Verify the text of a file; it is Refused if a rule is broken, which says nothing about the claim itself."""
    document, budget = read_object(parse(text), "the file"), Budget()
    version = document.get("format")
    need(type(version) is int and version == 1, "format", "the integer 1", version)
    if "polynomial" in document:
        return check_polynomial(document, budget)
    if "kind" in document:
        return check_guarantee(document)
    if "inputs" in document:
        raise Outdated
    refutes = "refutation" in document
    read_object(document, "the file", (*LOOP_KEYS, "refutation") if refutes else PROOF_KEYS)
    return (refute if refutes else prove)(document, read_loop(document), budget)


def check_guarantee(document: dict[str, Any]) -> Result:
    """Verify a file of the kind ``guarantee``, by the module beside this one."""
    need(document["kind"] == "guarantee", "kind", "guarantee", document["kind"])
    module = guarantee_module()
    try:
        return Result("proved", tuple(module.verify(document)))
    except module.Refused as error:
        raise Refused(str(error)) from None


@cache
def guarantee_module() -> Any:
    """The module beside this one."""
    path = Path(__file__).with_name("guarantee.py")
    if not path.is_file():
        raise OSError("guarantee.py must stand beside check.py")
    loader = SourceFileLoader("guarantee", str(path))
    module = sys.modules[loader.name] = module_from_spec(ModuleSpec(loader.name, loader))
    loader.exec_module(module)
    return module


def read_file(name: str) -> str:
    """Read a regular file of bounded size as UTF-8."""
    if Path(name).exists() and not Path(name).is_file():
        raise OSError("it is no regular file")
    with open(name, "rb") as stream:
        content = stream.read(MAX_BYTES + 1)
    need(len(content) <= MAX_BYTES, "the file", f"at most {MAX_BYTES} bytes long", "more")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise Refused(f"the file must be UTF-8. Received another byte at {error.start}") from None


def report(name: str) -> int:
    """Check one file, print its block and return its exit code."""
    try:
        result = check(read_file(name))
    except (Refused, MemoryError) as error:
        print(f"{ascii(name)[1:-1]}: invalid: {str(error) or 'it needs too much memory'}")
        return 1
    except Outdated:
        expected = "FILE must be a proof, a refutation or of the kind guarantee"
        remedy = "Make the new file with quakedesign certify elqr FAULT --gains K1 K2 K3 K4 --peaks CLASS --out FILE"
        print(f"{expected}. Received {name!a}, a bound under inputs: no longer read. {remedy}.", file=sys.stderr)
        return 2
    except (OSError, ValueError) as error:
        reason = ascii(getattr(error, "strerror", None) or str(error))
        print(f"FILE must be readable. Received {name!a}: {reason}. Check the path.", file=sys.stderr)
        return 2
    print(f"{ascii(name)[1:-1]}: {result.verdict}", *result.statement, sep="\n    ")
    return 0 if result.verdict == "proved" else 1


def main(arguments: list[str]) -> int:
    """Check every file named on the command line."""
    options = [argument for argument in arguments if argument.startswith("-")]
    if options or not arguments:
        print(f"Arguments must be files. Received {options}. Use: python check.py FILE...", file=sys.stderr)
        return 2
    return max([report(name) for name in arguments])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
