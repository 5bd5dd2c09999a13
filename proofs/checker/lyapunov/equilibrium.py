"""Refutations: a point other than the origin at which a closed loop rests, in the sense of Filippov."""

from collections.abc import Iterable
from fractions import Fraction
from math import prod
from typing import Any

from ..numbers import Exponents, Number, add, multiply, named, need, read_object, read_rational, to_integers
from .loop import LOOP_KEYS, Loop, Term, cells_of, describe, read_loop


def read_values(value: Any, where: str, names: Iterable[str]) -> dict[str, Fraction]:
    """Read one rational for every name, in the order of the names."""
    numbers = read_object(value, where, names)
    return {name: read_rational(numbers[name], f"{where} {name}") for name in names}


def refute(document: dict[str, Any]) -> list[str]:
    """Verify that a point is an equilibrium of Filippov's inclusion, and describe it."""
    read_object(document, "the file", (*LOOP_KEYS, "refutation"))
    loop = read_loop(document)
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
            add(balance, state, limit_of(term, values, list(point.values()), mixture))
        need(not balance, f"the weighted limit of d{state}/dt", "zero", "a nonzero number")
    return [*describe(loop), *describe_equilibrium(loop, values, point, weights)]


def limit_of(
    term: Term, values: dict[str, Fraction], point: list[Fraction], mixture: list[tuple[int, Exponents]]
) -> Number:
    """Sum share * limit over the cells: the absolute powers are common, the signs are those of the cell."""
    flags = [index for index, odd in enumerate(term.odd) if odd]
    share = sum(share * prod(cell[index] for index in flags) for share, cell in mixture)
    factors: list[Number] = [term.number, share, *(values[name] for name in term.uncertain)]
    return multiply(factors, map(abs, point), tuple(map(int, term.exponents)))


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
