"""Regions of attraction: a Lyapunov function that falls along a polynomial field where it is below a level."""

from dataclasses import replace
from fractions import Fraction
from typing import Any

from .numbers import (
    Polynomial,
    add,
    add_product,
    add_scaled,
    named,
    need,
    read_list,
    read_name,
    read_object,
    read_polynomial,
    read_polynomials,
    read_rational,
)
from .polynomials import MAX_VARIABLES, Statement, evaluate, prove_squares, terms_text

CLAIM_KEYS = ("format", "kind", "variables", "field", "V", "level")
PROOF_KEYS = ("multiplier", "positive", "decrease")


def partial(polynomial: Polynomial, index: int) -> Polynomial:
    """Differentiate a polynomial by one variable."""
    total: Polynomial = {}
    for exponents, number in polynomial.items():
        if exponents[index]:
            lower = (*exponents[:index], exponents[index] - 1, *exponents[index + 1 :])
            add(total, lower, number * exponents[index])
    return total


def along(field: list[Polynomial], function: Polynomial) -> Polynomial:
    """Differentiate a function along a field."""
    total: Polynomial = {}
    for index, entry in enumerate(field):
        add_product(total, partial(function, index), entry)
    return total


def check_powers(proof: Any, size: int, where: str) -> None:
    """Check that a pure power of every variable is in a basis: the squares then vanish at the origin alone."""
    lists = (entry for square in proof["squares"] for entry in square["basis"] if type(entry) is list)
    powers = {tuple(map(bool, entry)) for entry in lists}
    for index in range(size):
        unit = tuple(other == index for other in range(size))
        need(unit in powers, where, "of squares with a pure power of every variable in a basis", index)


def decide(document: dict[str, Any]) -> tuple[str, list[str]]:
    """Verify a file: its verdict and statement."""
    read_object(document, "the file", (*CLAIM_KEYS, *(("negative",) if "negative" in document else PROOF_KEYS)))
    names = [read_name(name, "variables") for name in read_list(document["variables"], "variables", 1, MAX_VARIABLES)]
    need(len(set(names)) == len(names), "variables", "different from each other", names)
    origin = (0,) * len(names)
    field = read_polynomials(document["field"], "field", len(names), len(names), len(names))
    function = read_polynomial(document["V"], "V", len(names))
    need(not any(origin in entry for entry in (function, *field)), "V and the field", "0 at the origin", "a constant")
    levels = [read_rational(entry, "level", positive=True) for entry in read_list(document["level"], "level", 0, 1)]
    falling = add_scaled({}, Fraction(-1), along(field, function))
    below = [add_scaled({origin: level}, Fraction(-1), function) for level in levels]
    products = [(), *((index,) for index in range(len(below)))]
    positive = Statement(names, function, {origin: Fraction(1)}, [], [], [()], 0)
    lines = [
        *(f"{name}' = {terms_text(entry, positive)}" for name, entry in zip(names, field, strict=True)),
        f"V = {terms_text(function, positive)}",
        *(f"level: {level}" for level in levels),
    ]
    if "negative" in document:
        rests = refute(document["negative"], field, replace(positive, polynomial=falling), function, levels)
        return "refuted", [*lines, *rests]
    multiplier = read_polynomial(document["multiplier"], "multiplier", len(names))
    decrease = Statement(names, falling, multiplier, below, [], products, 0)
    return "proved", [*lines, *prove(document, positive, decrease)]


def prove(document: dict[str, Any], positive: Statement, decrease: Statement) -> list[str]:
    """Verify that V is positive, and that it decreases where it is below the level, except at the origin."""
    for part, statement in (("positive", positive), ("decrease", decrease)):
        prove_squares(document[part], statement)
        check_powers(document[part], len(statement.variables), part)
    where = "that starts where V < level remains there and" if decrease.inequalities else "from any initial state"
    return [
        f"multiplier: {terms_text(decrease.multiplier, positive)}",
        f"conclusion: every solution {where} tends to the origin, which is asymptotically stable",
    ]


def refute(
    value: Any, field: list[Polynomial], falling: Statement, function: Polynomial, levels: list[Fraction]
) -> list[str]:
    """Verify that V is not positive at a point below the level, or does not fall there."""
    names = falling.variables
    entries = read_list(read_object(value, "negative", ("point",))["point"], "point", len(names), len(names))
    point = [read_rational(entry, "point") for entry in entries]
    need(any(point), "the point", "other than the origin", entries)
    height = evaluate(function, point)
    need(all(height < level for level in levels), "the point", "one where V is below the level", entries)
    wrong = height <= 0 or evaluate(falling.polynomial, point) <= 0
    need(wrong, "the point", "one where V <= 0 or its derivative is >= 0", entries)
    rests = not any(evaluate(entry, point) for entry in field)
    return [
        f"point: {named(dict(zip(names, point, strict=True)))}",
        "conclusion: V <= 0 or its derivative is >= 0 there, so that this V proves no such statement",
        *(["the field vanishes there, so that no other V proves it"] if rests else []),
    ]
