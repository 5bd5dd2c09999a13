"""Verify certificate files of FORMAT.md in exact arithmetic, with the Python standard library alone.

Usage: ``python proofs/check.py FILE...``. Every file gets one block: ``proved`` or ``refuted`` with the
statement that was verified, or ``invalid`` with one reason. Exit code 0: all proved; 1: not all; 2: an
argument cannot be read.

A factor |x_i|^a is kept as the integer exponent r_i*a of u_i = |x_i|^(1/r_i) and a flag: odd for the signed
power, even for the absolute one. A polynomial maps tuples of exponents to nonzero fractions.
"""

import json
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import accumulate, combinations_with_replacement, product
from math import lcm, prod
from pathlib import Path
from typing import Any, NoReturn

MAX_BYTES, MAX_NESTING = 4 * 2**20, 12
MAX_STATES, MAX_WEIGHT, MAX_UNCERTAIN, MAX_NUMBERS = 6, 12, 8, 64
MAX_TERMS, MAX_EXPONENT, MAX_OBLIGATIONS, MAX_BASIS = 200, 24, 4096, 200
# The following bound what a hostile file can cost; an honest one is far below.
MAX_PARAMETERS = 32  # multiplied in one term
MAX_BITS = 1990  # of a term's number times gains and constants: below any digit limit of Python
MAX_DENOMINATOR_BITS = 2**14  # common denominator of a Gram matrix or of weights
MAX_STEPS = 10**8  # operations on integers of 1024 bits, about a microsecond each

RATIONAL = re.compile(r"-?(0|[1-9][0-9]{0,399})(/[1-9][0-9]{0,399})?")
INTEGER = re.compile(r"0|[1-9][0-9]{0,2}")
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")
LAW = re.compile(r"[A-Za-z0-9_-]{1,40}")
STRING = re.compile(r'"(?:[^"\\]++|\\.)*+"?', re.DOTALL)  # cannot fail once begun, hence linear

LOOP_KEYS = ("format", "law", "gains", "constants", "states", "domain", "uncertain", "field")
PROOF_KEYS = (*LOOP_KEYS, "V", "claims", "witnesses")

Exponents = tuple[int, ...]
Polynomial = dict[Exponents, Fraction]
SignedSum = dict[tuple[tuple[str, ...], Exponents, tuple[bool, ...]], Fraction]


class Refused(Exception):
    """The file is no valid certificate, for the reason given."""


@dataclass(frozen=True)
class Result:
    """Verdict, ``proved`` or ``refuted``, and the verified statement, line by line in ASCII."""

    verdict: str
    statement: tuple[str, ...]


@dataclass(frozen=True)
class Term:
    """Product of a number (gains and constants included), uncertain parameters and powers of the states."""

    number: Fraction
    uncertain: tuple[str, ...]
    exponents: Exponents
    odd: tuple[bool, ...]


@dataclass(frozen=True)
class Loop:
    """The closed loop; `numbers` are its gains and constants."""

    law: str
    numbers: dict[str, Fraction]
    weights: dict[str, int]
    domain: str
    uncertain: dict[str, tuple[Fraction, Fraction]]
    field: dict[str, list[Term]]


class Budget:
    """Steps left, so that every file ends in bounded time and memory."""

    def __init__(self) -> None:
        self.left = MAX_STEPS

    def spend(self, steps: int, bits: int) -> None:
        """Count steps on integers of the given length; division is quadratic in it."""
        self.left -= steps * (1 + (bits >> 10) ** 2)
        need(self.left >= 0, "the verification", "done in fewer steps; shorten terms or digits", MAX_STEPS)


# ---------------------------------------------------------------- reading


def need(condition: bool, where: str, expected: str, received: object) -> None:
    """Refuse the file unless the condition holds, in one line of ASCII."""
    if not condition:
        text = ascii(received)
        raise Refused(f"{where} must be {expected}. Received {text if len(text) < 60 else text[:57] + '...'}")


def refuse_number(text: str) -> NoReturn:
    """Refuse floats, NaN and infinities."""
    need(False, "a number", "an integer or a rational in a string", text)
    raise AssertionError


def read_integer(text: str) -> int:
    """Convert a non-negative integer; no integer of the format has more than six digits."""
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
        return json.loads(
            text,
            parse_float=refuse_number,
            parse_constant=refuse_number,
            parse_int=read_integer,
            object_pairs_hook=read_pairs,
        )
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


def read_exponents(value: Any, where: str, size: int, most: int) -> Exponents:
    """Convert a list of integers, one for every state."""
    for entry in read_list(value, where, size, size):
        need(type(entry) is int and entry <= most, where, f"a list of integers up to {most}", entry)
    return tuple(value)


def read_names(value: Any, where: str, least: int, most: int) -> dict[str, Any]:
    """Check the names of an object's members and their number."""
    need(least <= len(read_object(value, where)) <= most, where, f"{least} to {most} members", len(value))
    for name in value:
        need(NAME.fullmatch(name) is not None, f"a name in {where}", "[A-Za-z][A-Za-z0-9_]*, up to 40", name)
    return value  # type: ignore[no-any-return]


def read_range(value: Any, where: str) -> tuple[Fraction, Fraction]:
    """Read the ends of an uncertain parameter's range."""
    low, high = (read_rational(end, where) for end in read_list(value, where, 2, 2))
    need(low <= high, where, "a range with the lower end first", value)
    return low, high


def read_loop(document: dict[str, Any]) -> Loop:
    """Read everything that proofs and refutations share."""
    version, law, domain = (document[key] for key in ("format", "law", "domain"))
    need(type(version) is int and version == 1, "format", "the integer 1", version)
    need(type(law) is str and LAW.fullmatch(law) is not None, "law", "1 to 40 of [A-Za-z0-9_-]", law)
    need(type(domain) is str and domain in ("cells", "reals"), "domain", "cells or reals", domain)
    parts = ("gains", 0, MAX_NUMBERS), ("constants", 0, MAX_NUMBERS), ("uncertain", 0, MAX_UNCERTAIN)
    gains, constants, uncertain = (read_names(document[key], key, least, most) for key, least, most in parts)
    need(len(gains) + len(constants) <= MAX_NUMBERS, "gains and constants", "at most 64", "more")
    weights = read_names(document["states"], "states", 1, MAX_STATES)
    names = [*gains, *constants, *uncertain, *weights]
    need(len(set(names)) == len(names), "names", "different from each other", names)
    most = MAX_WEIGHT if domain == "cells" else 1
    for name, weight in weights.items():
        valid = type(weight) is int and 1 <= weight <= most
        need(valid, f"weight of {name}", f"1 to {most} on {domain}", weight)
    numbers = {name: read_rational(value, name) for name, value in (gains | constants).items()}
    ranges = {name: read_range(ends, f"range of {name}") for name, ends in uncertain.items()}
    terms = read_object(document["field"], "field", weights)
    loop = Loop(law, numbers, weights, domain, ranges, {})
    return replace(loop, field={state: read_terms(terms[state], f"d{state}/dt", loop) for state in weights})


def read_factor(value: Any, where: str, loop: Loop) -> tuple[str, tuple[int, bool]]:
    """Read a power of a state: its name, the exponent of u_i and whether it is odd."""
    state, text, kind = read_list(value, where, 3, 3)
    need(type(state) is str and state in loop.weights, where, "a power of a state", state)
    need(type(kind) is str and kind in ("s", "a"), where, "of kind s or a", kind)
    exponent = read_rational(text, where, positive=kind == "a")
    need(0 <= exponent <= MAX_EXPONENT, where, f"a power 0 to {MAX_EXPONENT}", text)
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
        need(known, where, "a product of gains, constants and uncertain parameters", name)
        number *= loop.numbers.get(name, 1)
        uncertain += [name] if name in loop.uncertain else []
    need(length(number) <= MAX_BITS, where, "a number with gains of at most 599 digits", length(number))
    entries = read_list(powers, f"factors in {where}", 0, MAX_STATES)
    factors = dict(read_factor(factor, where, loop) for factor in entries)
    need(len(factors) == len(entries), where, "a term with each state at most once", powers)
    exponents, odd = zip(*(factors.get(state, (0, False)) for state in loop.weights), strict=True)
    return Term(number, tuple(sorted(uncertain)), exponents, odd)


def read_terms(value: Any, where: str, loop: Loop) -> list[Term]:
    """Read a sum of terms."""
    entries = read_list(value, where, 0, MAX_TERMS)
    return [read_term(entry, f"{where} term {index}", loop) for index, entry in enumerate(entries, 1)]


# ---------------------------------------------------------------- exact arithmetic


def length(number: Fraction) -> int:
    """Bits of the longer one of numerator and denominator."""
    return max(number.numerator.bit_length(), number.denominator.bit_length())


def add(total: dict[Any, Fraction], key: Any, value: Fraction, budget: Budget) -> None:
    """Add to one coefficient of a sum; a zero is dropped."""
    before = total.pop(key, Fraction(0))
    budget.spend(1, length(before) + length(value))
    if before + value:
        total[key] = before + value


def add_scaled(first: Polynomial, scale: Fraction, second: Polynomial, budget: Budget) -> Polynomial:
    """Return first + scale * second."""
    total = dict(first)
    for exponents, number in second.items():
        add(total, exponents, scale * number, budget)
    return total


def times(first: Exponents, second: Exponents) -> Exponents:
    """Multiply two monomials."""
    return tuple(map(sum, zip(first, second, strict=True)))


def power_sum(indices: Iterable[int], size: int, degree: int) -> Polynomial:
    """Return the sum of u_i^degree over some of the variables."""
    return {tuple(degree * (i == j) for j in range(size)): Fraction(1) for i in indices}


def to_integers(numbers: Sequence[Fraction], where: str) -> tuple[list[int], int]:
    """Return the numbers times their common denominator, and that."""
    common = 1
    for denominator in {number.denominator for number in numbers}:
        common = lcm(common, denominator)
        bits = common.bit_length()
        need(bits <= MAX_DENOMINATOR_BITS, where, f"of common denominator < 2^{MAX_DENOMINATOR_BITS}", bits)
    return [number.numerator * (common // number.denominator) for number in numbers], common


def is_positive_definite(upper: list[list[int]], budget: Budget) -> bool:
    """Decide by the leading minors (Sylvester), from fraction-free elimination (Bareiss), in place.

    Before step k every entry left is a minor of order k + 1, the pivot a leading one, so that `//` is exact.
    """
    size, divisor = len(upper), 1
    for k, row in enumerate(upper):
        if row[k] <= 0:
            return False
        budget.spend((size - k) ** 2, 2 * max(entry.bit_length() for rest in upper[k:] for entry in rest[k:]))
        for i in range(k + 1, size):
            for j in range(i, size):
                upper[i][j] = (row[k] * upper[i][j] - row[i] * row[j]) // divisor
        divisor = row[k]
    return True


# ---------------------------------------------------------------- proofs


def read_function(value: Any, loop: Loop) -> list[Term]:
    """Read V; the closed-cell argument and the affine ends need it C1 and without uncertain parameters."""
    function = read_terms(value, "V", loop)
    for index, term in enumerate(function, 1):
        need(not term.uncertain, f"V term {index}", "without uncertain parameters", term.uncertain)
        for weight, exponent, odd in zip(loop.weights.values(), term.exponents, term.odd, strict=True):
            smooth = exponent >= weight if odd else exponent == 0 or exponent > weight
            need(smooth, f"V term {index}", "C1: exponents s >= 1, a > 1", str(Fraction(exponent, weight)))
    return function


def derivative(term: Term, i: int, weight: int) -> Term:
    """Differentiate one term: d[x]^a = a |x|^(a-1) and d|x|^a = a [x]^(a-1), so that the parity flips."""
    number = term.number * Fraction(term.exponents[i], weight)
    exponents = tuple(exponent - weight * (i == j) for j, exponent in enumerate(term.exponents))
    return Term(number, (), exponents, tuple(odd != (i == j) for j, odd in enumerate(term.odd)))


def time_derivative(function: list[Term], loop: Loop, budget: Budget) -> SignedSum:
    """Sum the products of the partial derivatives of V with the field; odd times odd is even."""
    total: SignedSum = {}
    for i, (state, weight) in enumerate(loop.weights.items()):
        slopes = [derivative(term, i, weight) for term in function if term.exponents[i]]
        for slope, term in product(slopes, loop.field[state]):
            odd = tuple(a != b for a, b in zip(slope.odd, term.odd, strict=True))
            key = term.uncertain, times(slope.exponents, term.exponents), odd
            add(total, key, slope.number * term.number, budget)
    return total


def restrict(function: SignedSum, signs: Exponents, values: dict[str, Fraction], budget: Budget) -> Polynomial:
    """Write a function as a polynomial in u on one cell at one vertex (in x on reals, with all signs +)."""
    total: Polynomial = {}
    for (uncertain, exponents, odd), number in function.items():
        sign = prod(sign for sign, flag in zip(signs, odd, strict=True) if flag)
        add(total, exponents, sign * number * prod(values[name] for name in uncertain), budget)
    return total


def degree_of(form: Polynomial, name: str) -> int:
    """Return the degree of a nonzero form."""
    degrees = {sum(exponents) for exponents in form}
    need(len(degrees) == 1 and 0 not in degrees, name, "a form of one degree >= 1", sorted(degrees))
    return degrees.pop()


def cells_of(choices: Iterable[Sequence[int]]) -> dict[str, Exponents]:
    """Sign cells by label, from the admissible signs of every state."""
    return {"".join("+" if sign > 0 else "-" for sign in signs): signs for signs in product(*choices)}


def read_claims(value: Any, loop: Loop) -> dict[str, Fraction]:
    """Read the claims in the order of their obligations: positive, bounds, then decrease or rate."""
    bounds = [f"bound_{state}" for state in loop.weights if f"bound_{state}" in read_object(value, "claims")]
    keys = "positive", *bounds, "decrease" if loop.domain == "cells" else "rate"
    given = read_object(value, "claims", keys)
    return {key: read_rational(given[key], f"claims {key}", positive=True) for key in keys}


def obligations(
    function: SignedSum, rate: SignedSum, claims: dict[str, Fraction], loop: Loop, budget: Budget
) -> Iterator[tuple[str, int, Polynomial]]:
    """Yield the name, the degree of V or dV/dt, and the polynomial P >= 0, in the order of the format."""
    size, on_cells, (*lower, last) = len(loop.weights), loop.domain == "cells", claims
    cells = {f" {k}": v for k, v in cells_of([(1, -1)] * size).items()} if on_cells else {"": (1,) * size}
    vertices = list(product(*(dict.fromkeys(ends) for ends in loop.uncertain.values())))
    count = len(cells) * (len(lower) + len(vertices))
    need(count <= MAX_OBLIGATIONS, "obligations", f"at most {MAX_OBLIGATIONS}", count)
    for claim, (cell, signs) in product(lower, cells.items()):
        value = restrict(function, signs, {}, budget)
        degree = degree_of(value, "V")
        need(on_cells or degree % 2 == 0, "V", "of even degree on reals", degree)
        chosen = [i for i, state in enumerate(loop.weights) if claim in ("positive", f"bound_{state}")]
        yield claim + cell, degree, add_scaled(value, -claims[claim], power_sum(chosen, size, degree), budget)
    for (cell, signs), vertex in product(cells.items(), vertices):
        values = dict(zip(loop.uncertain, vertex, strict=True))
        name = last + cell + "".join(f" {key}={value}" for key, value in values.items())
        fall = add_scaled({}, Fraction(-1), restrict(rate, signs, values, budget), budget)
        if on_cells:
            degree = degree_of(fall, f"dV/dt at {name}")
            powers = power_sum(range(size), size, degree)
            yield name, degree, add_scaled(fall, -claims[last], powers, budget)
        else:
            value = restrict(function, signs, {}, budget)
            yield name, 0, add_scaled(fall, -2 * claims[last], value, budget)


def read_multiplier(value: Any, where: str, loop: Loop) -> Polynomial:
    """Read a polynomial with positive coefficients; on the reals it must be the constant 1."""
    multiplier: Polynomial = {}
    for key, number in read_object(value, where).items():
        parts = key.split(",")
        valid = len(parts) == len(loop.weights) and all(INTEGER.fullmatch(part) for part in parts)
        need(valid, where, "an object with keys such as '2,0,0', an integer for every state", key)
        multiplier[tuple(map(int, parts))] = read_rational(number, where, positive=True)
    need(bool(multiplier), where, "nonempty", value)
    return multiplier


def add_square(total: Polynomial, value: Any, where: str, loop: Loop, budget: Budget) -> None:
    """Add u^times b'Qb, after checking that Q is positive definite."""
    square, size = read_object(value, where, ("times", "basis", "gram")), len(loop.weights)
    factor = read_exponents(square["times"], f"{where} times", size, 1 if loop.domain == "cells" else 0)
    rows = read_list(square["basis"], f"{where} basis", 1, MAX_BASIS)
    basis = [read_exponents(row, f"{where} basis", size, 999) for row in rows]
    need(len(set(basis)) == len(basis), f"{where} basis", "without repetitions", rows)
    pairs = list(combinations_with_replacement(range(len(basis)), 2))
    entries = read_list(square["gram"], f"{where} gram", len(pairs), len(pairs))
    numbers, denominator = to_integers([read_rational(entry, f"{where} gram") for entry in entries], where)
    upper = [[0] * len(basis) for _ in basis]
    expanded: dict[Exponents, int] = {}
    for (i, j), number in zip(pairs, numbers, strict=True):
        upper[i][j] = number
        exponents = times(factor, times(basis[i], basis[j]))
        expanded[exponents] = expanded.get(exponents, 0) + number * (1 if i == j else 2)
    for exponents, number in expanded.items():
        add(total, exponents, Fraction(number, denominator), budget)
    need(is_positive_definite(upper, budget), f"{where} gram", "positive definite", entries)


def check_witness(name: str, polynomial: Polynomial, value: Any, loop: Loop, budget: Budget) -> None:
    """Check multiplier * P = sum of u^times b'Qb."""
    where, one = f"witness of {name}:", {(0,) * len(loop.weights): Fraction(1)}
    witness = read_object(value, where, ("obligation", "multiplier", "squares"))
    need(witness["obligation"] == name, where, "the next witness", witness["obligation"])
    multiplier = read_multiplier(witness["multiplier"], f"{where} multiplier", loop)
    trivial = loop.domain == "reals" or not polynomial  # so that no number of the file is without effect
    need(multiplier == one or not trivial, f"{where} multiplier", "1 on reals or for P = 0", multiplier)
    squares = read_list(witness["squares"], f"{where} squares", 0, 0 if not polynomial else MAX_BYTES)
    left: Polynomial = {}
    for (a, scale), (b, number) in product(multiplier.items(), polynomial.items()):
        add(left, times(a, b), scale * number, budget)
    right: Polynomial = {}
    for index, square in enumerate(squares, 1):
        add_square(right, square, f"{where} square {index}", loop, budget)
    difference = add_scaled(left, Fraction(-1), right, budget)
    need(not difference, f"{where} identity", "exact in every monomial", min(difference, default=()))


def prove(document: dict[str, Any], loop: Loop, budget: Budget) -> Result:
    """Verify a proof."""
    for term in (term for terms in loop.field.values() for term in terms):  # else the ends would not decide
        unique = len(set(term.uncertain)) == len(term.uncertain)
        need(unique, "field", "affine in every uncertain parameter", term.uncertain)
    function, potential = read_function(document["V"], loop), SignedSum()
    for term in function:
        add(potential, ((), term.exponents, term.odd), term.number, budget)
    claims, rate = read_claims(document["claims"], loop), time_derivative(function, loop, budget)
    witnesses = iter(read_list(document["witnesses"], "witnesses", 0, MAX_OBLIGATIONS))
    seen, degrees = set(), dict[str, int]()
    for name, degree, polynomial in obligations(potential, rate, claims, loop, budget):
        first = degrees.setdefault("dV/dt" if name.split()[0] in ("decrease", "rate") else "V", degree)
        need(degree == first, f"degree at {name}", f"{first} as before", degree)
        key = frozenset(polynomial.items())
        if key not in seen:
            seen.add(key)
            check_witness(name, polynomial, next(witnesses, "none"), loop, budget)
    need(next(witnesses, None) is None, "witnesses", f"{len(seen)} in number", len(document["witnesses"]))
    lines = describe_claims(loop, claims, degrees["V"], degrees["dV/dt"])
    return Result("proved", (*describe(loop), f"V = {sum_text(function, loop)}", *lines))


# ---------------------------------------------------------------- refutations


def read_values(value: Any, where: str, names: Iterable[str]) -> dict[str, Fraction]:
    """Read one rational for every name, in the order of the names."""
    numbers = read_object(value, where, names)
    return {name: read_rational(numbers[name], f"{where} {name}") for name in names}


def refute(document: dict[str, Any], loop: Loop, budget: Budget) -> Result:
    """Verify that a point is an equilibrium of Filippov's inclusion."""
    need(loop.domain == "cells", "the domain of a refutation", "cells", loop.domain)
    refutation = read_object(document["refutation"], "refutation", ("parameters", "point", "weights"))
    values = read_values(refutation["parameters"], "parameters", loop.uncertain)
    for name, (low, high) in loop.uncertain.items():
        need(low <= values[name] <= high, f"parameter {name}", "in its range", str(values[name]))
    point = read_values(refutation["point"], "point", loop.weights)
    need(any(point.values()), "point", "away from the origin", refutation["point"])
    cells = cells_of([(1,) if v > 0 else (-1,) if v < 0 else (1, -1) for v in point.values()])
    weights = read_values(refutation["weights"], "weights", cells)
    need(min(weights.values()) >= 0, "weights", "non-negative", refutation["weights"])
    shares, total = to_integers(list(weights.values()), "weights")
    need(sum(shares) == total, "weights", "of sum 1", refutation["weights"])
    mixture = list(zip(shares, cells.values(), strict=True))
    for state, terms in loop.field.items():
        balance: dict[str, Fraction] = {}
        for term in terms:
            add(balance, state, limit_of(term, values, list(point.values()), mixture, budget), budget)
        need(not balance, f"the weighted limit of d{state}/dt", "zero", "another number")
    return Result("refuted", (*describe(loop), *describe_equilibrium(loop, values, point, weights)))


def limit_of(
    term: Term,
    values: dict[str, Fraction],
    point: list[Fraction],
    mixture: list[tuple[int, Exponents]],
    budget: Budget,
) -> Fraction:
    """Sum share * limit over the cells: the absolute powers are common, the signs are those of the cell."""
    flags = [index for index, odd in enumerate(term.odd) if odd]
    share = sum(share * prod(cell[index] for index in flags) for share, cell in mixture)
    factors = [term.number, Fraction(share), *(values[name] for name in term.uncertain)]
    for v, exponent in zip(point, term.exponents, strict=True):
        budget.spend(1, exponent * length(v))
        factors.append(abs(v) ** exponent)
    budget.spend(len(factors), sum(map(length, factors)))
    return prod(factors, start=Fraction(1))


# ---------------------------------------------------------------- the statement in words


def term_text(term: Term, loop: Loop) -> str:
    """Write one term, e.g. ``-7*beta*sign(e1)*|e1|^(1/3)``."""
    parts = [str(term.number), *term.uncertain]
    for (state, weight), exponent, odd in zip(loop.weights.items(), term.exponents, term.odd, strict=True):
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
    ranges = [f"{name} in [{low}, {high}]" for name, (low, high) in loop.uncertain.items()]
    return [
        f"law {loop.law}: the name is not verified, the verdict is about the field below",
        f"gains and constants: {named(loop.numbers)}",
        f"domain: {loop.domain}; states with weights: {named(loop.weights)}",
        f"uncertain, measurable in time: {', '.join(ranges) or 'none'}",
        *(f"d{state}/dt = {sum_text(terms, loop)}" for state, terms in loop.field.items()),
    ]


def describe_claims(loop: Loop, claims: dict[str, Fraction], m: int, n: int) -> list[str]:
    """Describe what a proof proves; V <= C sum u^m makes dV/dt <= -c V^(n/m)."""
    positive, *bounds, decay = claims.values()
    if loop.domain == "reals":
        text = f"V >= {positive} * sum x_i^{m}; dV/dt <= -2*a*V with a = {decay}"
        degrees, ending = f"V {m}", "exponentially with rate a" if m == 2 else "with V(t) <= exp(-2*a*t)*V(0)"
    else:
        text = f"V >= {positive} * sum u_i^{m}; dV/dt <= -{decay} * sum u_i^{n}; u_i = |x_i|^(1/weight)"
        degrees, ending = f"V {m}, dV/dt {n}", "in finite time" if n < m else "finite time is not claimed"
    bounded = [(state, weight) for state, weight in loop.weights.items() if f"bound_{state}" in claims]
    return [
        f"claims: {text}",
        *(f"V >= {gamma} * |{x}|^({Fraction(m, r)})" for gamma, (x, r) in zip(bounds, bounded, strict=True)),
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


# ---------------------------------------------------------------- the command


def check(text: str) -> Result:
    """Verify the text of a certificate file.

    Parameters
    ----------
    text : str
        JSON as FORMAT.md specifies it.

    Returns
    -------
    Result
        Verdict ``proved`` or ``refuted``, and the statement it is about.

    Raises
    ------
    Refused
        If a rule of the format is broken or a witness fails; this says nothing about the claim itself.
    """
    document, budget = read_object(parse(text), "the file"), Budget()
    is_refutation = "refutation" in document
    read_object(document, "the file", (*LOOP_KEYS, "refutation") if is_refutation else PROOF_KEYS)
    loop = read_loop(document)
    return refute(document, loop, budget) if is_refutation else prove(document, loop, budget)


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
        print(f"{ascii(name)[1:-1]}: invalid: {error or 'it needs too much memory'}")
        return 1
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
