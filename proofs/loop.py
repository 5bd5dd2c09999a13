"""Closed loops: a vector field of signed and absolute powers, with nested ones, as a file says it and in words."""

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain
from typing import Any

from exact_numbers import Number, length, named, need, read_list, read_name, read_object, read_rational

MAX_STATES, MAX_WEIGHT, MAX_UNCERTAIN, MAX_NUMBERS = 6, 12, 8, 64
MAX_TERMS, MAX_EXPONENT = 200, 24
MAX_ROOTS, MAX_LIFTS = 4, 4
MAX_PARAMETERS = 32  # multiplied in one term
MAX_BITS = 1990  # of a term's number times gains and constants: below any digit limit of Python

LOOP_KEYS = ("format", "law", "gains", "constants", "states", "domain", "uncertain", "roots", "lifts", "field")

LAW = re.compile(r"[A-Za-z0-9_-]{1,40}")

Powers = tuple[Number, ...]


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


# ---------------------------------------------------------------- reading


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

    Terms with a gain or constant zero are disregarded; of the others only roots may have a range.
    """
    lifts: dict[str, list[Term]] = {}
    for lift, entries in value.items():
        where = f"lift {lift}"
        lifts[lift] = read_terms(entries, where, replace(loop, lifts=lifts))
        for name in chain.from_iterable(term.uncertain for term in lifts[lift] if term.number):
            low, high = loop.uncertain[name]
            need(low == high or name in loop.roots, where, "without parameters that vary", name)
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


# ---------------------------------------------------------------- writing


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
