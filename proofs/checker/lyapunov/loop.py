"""The field of a closed loop, signed and absolute powers, and the cells on which it is a polynomial (FORMAT.md)."""

import json
import re
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain, product
from math import prod
from typing import Any

from ..numbers import (
    Exponents,
    Number,
    Polynomial,
    add,
    add_scaled,
    budget,
    length,
    named,
    need,
    read_list,
    read_name,
    read_object,
    read_rational,
)

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

    A factor |x_i|^a is stored as the integer exponent r_i*a of u_i = |x_i|^(1/r_i) and a flag: odd for the
    signed power, even for the absolute one. For a lift, which comes after the states, a itself is stored.
    """

    number: Fraction
    uncertain: tuple[str, ...]
    exponents: Powers
    odd: tuple[bool, ...]
    written: str = ""  # text of a term whose number is zero: printed, so that any change of it shows


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

    Terms with a zero gain or constant are disregarded; in the others only roots may have ranges of more than one point.
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
    """Read the common part of closed loops."""
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
    """Describe the loop that the verdict is on."""
    ranges = {name: f"{name} in [{low}, {high}]" for name, (low, high) in loop.uncertain.items()}
    roots = {name: f"root: {ranges.pop(name)} is the positive square root of {of}" for name, of in loop.roots.items()}
    return [
        f"law {loop.law}: names are not verified, the verdict is on the field below",
        f"gains and constants: {named(loop.numbers)}",
        f"domain: {loop.domain}; states with weights: {named(loop.weights)}",
        f"uncertain, measurable in time: {', '.join(ranges.values()) or 'none'}",
        *roots.values(),
        *(f"argument of a nested power: {lift} = {sum_text(terms, loop)}" for lift, terms in loop.lifts.items()),
        *(f"d{state}/dt = {sum_text(terms, loop)}" for state, terms in loop.field.items()),
    ]


SignedSum = dict[tuple[tuple[str, ...], Powers, tuple[bool, ...]], Fraction]


def cells_of(choices: Iterable[Sequence[int]]) -> dict[str, Exponents]:
    """Sign cells by label, from the admissible signs of every state."""
    return {"".join("+" if sign > 0 else "-" for sign in signs): signs for signs in product(*choices)}


@dataclass
class Cell:
    """Points where states and lifts have given signs, and the relations there; it grows with every lift.

    `degrees` has an entry for every variable: its index among states and lifts, and the degree of the state (1) or of
    the lift's argument.
    """

    label: str
    states: int
    signs: Exponents
    degrees: dict[int, int]
    equalities: list[Polynomial]
    inequalities: list[Polynomial]

    def has_interior(self) -> bool:
        """Whether the signs alone admit points where all variables are positive."""
        one_sign = (len({number > 0 for number in h.values()}) == 1 for h in self.equalities)
        return not any(one_sign) and all(max(g.values()) > 0 for g in self.inequalities)


def whole_space(size: int) -> Cell:
    """Return the single cell of the domain reals."""
    return Cell("", size, (1,) * size, dict.fromkeys(range(size), 1), [], [])


def collect(terms: Iterable[Term]) -> SignedSum:
    """Add up terms."""
    total: SignedSum = {}
    for term in terms:
        add(total, (term.uncertain, term.exponents, term.odd), term.number)
    return total


def restrict(function: SignedSum, cell: "Cell", values: dict[str, Fraction]) -> Polynomial:
    """Write a function as a polynomial in u on one cell at one vertex (in x on reals, with all signs +)."""
    total: Polynomial = {}
    for (uncertain, exponents, odd), number in function.items():
        sign = prod(sign for sign, flag in zip(cell.signs, odd, strict=False) if flag)
        powers = [Fraction(exponents[i]) * n for i, n in cell.degrees.items()]
        need(all(power.denominator == 1 for power in powers), "powers of lifts", "integers on cells", "a fraction")
        add(total, tuple(map(int, powers)), sign * number * prod(values[name] for name in uncertain))
    return total


def restrict_to_ends(function: SignedSum, cell: "Cell", loop: Loop, name: str) -> tuple[Polynomial, Polynomial]:
    """Write an argument on one cell with the smallest and the largest coefficients that roots in their ranges give it.

    Every root is at least 0, so that a term is extreme where all its roots are at the same end.
    """
    small: Polynomial = {}
    large: Polynomial = {}
    lower, upper = ({key: ends[i] for key, ends in loop.uncertain.items()} for i in (0, 1))
    for key, number in function.items():
        at_ends = restrict({key: number}, cell, lower), restrict({key: number}, cell, upper)
        (exponents,) = at_ends[1] or [()]
        values = [entry.get(exponents, Fraction(0)) for entry in at_ends]
        add(small, exponents, min(values))
        add(large, exponents, max(values))
    signs = [small.get(e, Fraction(0)) * large.get(e, Fraction(0)) for e in small | large]
    need(all(sign > 0 for sign in signs), name, "with coefficients whose signs the ranges of roots decide", "others")
    return small, large


def degree_of(form: Polynomial, name: str) -> int:
    """Return the degree of a nonzero form."""
    degrees = {sum(exponents) for exponents in form}
    need(len(degrees) == 1 and 0 not in degrees, name, "a form of one degree >= 1", sorted(degrees))
    return degrees.pop()


def widen(polynomials: Iterable[Polynomial], size: int) -> list[Polynomial]:
    """Write polynomials in more variables."""
    return [{(*e, *[0] * (size - len(e))): number for e, number in entry.items()} for entry in polynomials]


def reach_of(form: Polynomial, reaches: dict[int, set[int]], count: int) -> set[int]:
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


def cells_with_lifts(loop: Loop) -> list[Cell]:
    """Return the cells with an interior; a lift P gives t*w^n = P or, where only its sign occurs, t*P >= 0.

    Where roots in P vary, t*P takes its largest coefficients: the variables are not negative.
    """
    count, degrees, cells = len(loop.weights), dict[str, int](), []
    terms = [*chain(*loop.field.values()), *(term for term in chain(*loop.lifts.values()) if term.number)]
    for i, lift in enumerate(loop.lifts, count):
        need(any(term.odd[i] or term.exponents[i] for term in terms), f"lift {lift}", "used", "one that is not")
    raised = {i for term in terms for i, exponent in enumerate(term.exponents) if exponent}
    arguments = [collect(terms) for terms in loop.lifts.values()]
    for label, signs in cells_of([(1, -1)] * (count + len(arguments))).items():
        cell, reaches = Cell(f" {label}", count, signs, dict.fromkeys(range(count), 1), [], []), dict[int, set[int]]()
        for i, (lift, argument) in enumerate(zip(loop.lifts, arguments, strict=True), count):
            (small, form), size = restrict_to_ends(argument, cell, loop, f"lift {lift}"), len(cell.degrees)
            degree = degree_of(form, f"lift {lift}")
            need(degrees.setdefault(lift, degree) == degree, f"lift {lift}", "of one degree on all cells", degree)
            reach = reach_of(form, reaches, count)
            if i in raised:
                need(
                    small == form, f"lift {lift}", "without roots that vary, or used by its sign only", "a power of it"
                )
                reaches[size], cell.degrees[i] = reach, degree
                power: Polynomial = {(*[0] * size, degree): signs[i]}
                cell.equalities.append(add_scaled(power, Fraction(-1), widen([form], size + 1)[0]))
            else:
                cell.inequalities.append(add_scaled({}, Fraction(signs[i]), form if signs[i] > 0 else small))
        if cell.has_interior():
            cells.append(cell)
    return cells
