"""Proofs of stability: V and -dV/dt are large enough on every cell and at every vertex, by sums of squares."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain, product
from typing import Any

from ..numbers import (
    Polynomial,
    add,
    add_product,
    add_scaled,
    need,
    read_exponents,
    read_list,
    read_object,
    read_polynomial,
    read_polynomials,
    read_rational,
)
from ..squares import check_identity, read_square
from .loop import (
    LOOP_KEYS,
    Cell,
    Loop,
    SignedSum,
    Term,
    cells_with_lifts,
    collect,
    degree_of,
    describe,
    pad_terms,
    read_loop,
    read_terms,
    restrict,
    sum_text,
    whole_space,
    widen,
)

PROOF_KEYS = (*LOOP_KEYS, "V", "claims", "witnesses")
MAX_OBLIGATIONS = 4096


def read_function(value: Any, loop: Loop) -> list[Term]:
    """Read V; the closed-cell argument and the affine ends need it C1 and without uncertain parameters."""
    function = pad_terms(read_terms(value, "V", replace(loop, lifts={})), len(loop.weights) + len(loop.lifts))
    for index, term in enumerate(function, 1):
        need(not term.uncertain, f"V term {index}", "without uncertain parameters", term.uncertain)
        for weight, exponent, odd in zip(loop.weights.values(), term.exponents, term.odd, strict=False):
            smooth = exponent >= weight if odd else exponent == 0 or exponent > weight
            need(smooth, f"V term {index}", "C1: exponents s >= 1, a > 1", str(Fraction(exponent, weight)))
    return function


def time_derivative(function: list[Term], loop: Loop) -> SignedSum:
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
            add(total, (other.uncertain, exponents, odd), number)
    return total


def read_claims(value: Any, loop: Loop) -> dict[str, Fraction]:
    """Read the claims in the order of their obligations: positive, bounds, decrease or rate, then decay."""
    bounds = [f"bound_{state}" for state in loop.weights if f"bound_{state}" in read_object(value, "claims")]
    keys = "positive", *bounds, *(("decrease",) if loop.domain == "cells" else ("rate",))
    keys += ("decay",) if loop.domain == "cells" and "decay" in value else ()
    given = read_object(value, "claims", keys)
    return {key: read_rational(given[key], f"claims {key}", positive=True) for key in keys}


# ---------------------------------------------------------------- obligations


@dataclass(frozen=True)
class Obligation:
    """P >= 0 where the limits hold and, on cells, no variable is negative; `size` is the number of variables."""

    name: str
    polynomial: Polynomial
    size: int
    equalities: Sequence[Polynomial] = ()
    inequalities: Sequence[Polynomial] = ()

    def key(self) -> Any:
        """Identify obligations that share a witness."""
        parts = (self.polynomial,), self.equalities, self.inequalities
        return tuple(tuple(frozenset(entry.items()) for entry in part) for part in parts)


def power_sum(indices: Iterable[int], size: int, degree: int) -> Polynomial:
    """Return the sum of u_i^degree over some of the variables."""
    return {tuple(degree * (i == j) for j in range(size)): Fraction(1) for i in indices}


def vertices_of(loop: Loop) -> list[dict[str, Fraction]]:
    """Return the vertices of the box of uncertain parameters; a range of one point has one end."""
    return [
        dict(zip(loop.uncertain, vertex, strict=True))
        for vertex in product(*(dict.fromkeys(ends) for ends in loop.uncertain.values()))
    ]


def named_vertex(name: str, vertex: dict[str, Fraction]) -> str:
    """Return the name of an obligation at a vertex."""
    return name + "".join(f" {key}={value}" for key, value in vertex.items())


def obligations(
    function: SignedSum, rate: SignedSum, claims: dict[str, Fraction], loop: Loop
) -> Iterator[tuple[int, Obligation]]:
    """Yield the degree of V or dV/dt and the obligation, in the order of the format."""
    size, on_cells, vertices = len(loop.weights), loop.domain == "cells", vertices_of(loop)
    lower = [claim for claim in claims if claim not in ("decrease", "rate", "decay")]
    if on_cells:
        cells = cells_with_lifts(loop)
        plain = cells_with_lifts(replace(loop, field={}, lifts={}))
    else:
        plain = cells = [whole_space(size)]
    count = len(plain) * len(lower) + len(cells) * (len(claims) - len(lower)) * len(vertices)
    need(count <= MAX_OBLIGATIONS, "obligations", f"at most {MAX_OBLIGATIONS}", count)
    for claim, cell in product(lower, plain):
        value = restrict(function, cell, {})
        degree = degree_of(value, "V")
        need(on_cells or degree % 2 == 0, "V", "of even degree on reals", degree)
        chosen = [i for i, state in enumerate(loop.weights) if claim in ("positive", f"bound_{state}")]
        difference = add_scaled(value, -claims[claim], power_sum(chosen, size, degree))
        yield degree, Obligation(claim + cell.label, difference, size)
    for claim, cell, vertex in product(claims, cells, vertices):
        if claim not in lower:
            name = named_vertex(claim + cell.label, vertex)
            fall = add_scaled({}, Fraction(-1), restrict(rate, cell, vertex))
            value = restrict(function, cell, {}) if claim != "decrease" else {}
            yield falling(name, fall, value, claim, claims[claim], cell)


def falling(
    name: str, fall: Polynomial, value: Polynomial, claim: str, number: Fraction, cell: Cell
) -> tuple[int, Obligation]:
    """Return the degree of -dV/dt and the obligation that it is large enough."""
    size, equalities = len(cell.degrees), cell.equalities
    if claim == "rate":
        return 0, Obligation(name, add_scaled(fall, -2 * number, value), size)
    degree = degree_of(fall, f"dV/dt at {name}")
    powers = power_sum(range(cell.states), size, degree)
    if claim == "decay":
        size += 1
        [fall], [value], powers = widen([fall], size), widen([value], size), power_sum([size - 1], size, degree)
        root = power_sum([size - 1], size, degree_of(value, "V"))
        equalities = [*equalities, add_scaled(root, Fraction(-1), value)]
    limits = widen(equalities, size), widen(cell.inequalities, size)
    return degree, Obligation(name, add_scaled(fall, -number, powers), size, *limits)


# ---------------------------------------------------------------- witnesses


def read_squares(value: Any, where: str, size: int, most: int) -> Polynomial:
    """Read and expand the sum of u^times b'Qb, with entries of `times` up to `most`, 1 on cells and 0 on reals."""
    total: Polynomial = {}
    for index, entry in enumerate(read_list(value, f"{where} squares", 0, 2**size), 1):
        label, _, expanded = read_square(entry, f"{where} square {index}", "times", size)
        factor = read_exponents(label, f"{where} square {index} times", size, most)
        add_product(total, {factor: 1}, expanded)
    return total


def check_witness(obligation: Obligation, value: Any, on_cells: bool) -> None:
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
        add_product(right, factor, read_squares(squares, where, size, most))
    for cofactor, equality in zip(cofactors, obligation.equalities, strict=True):
        add_product(right, cofactor, equality)
    check_identity(multiplier, obligation.polynomial, right, f"{where} identity")


def check_witnesses(value: Any, pairs: Iterable[Obligation], on_cells: bool) -> None:
    """Check a witness for each different obligation, in their order."""
    witnesses, seen = iter(read_list(value, "witnesses", 0, MAX_OBLIGATIONS)), set()
    for obligation in pairs:
        if obligation.key() not in seen:
            seen.add(obligation.key())
            check_witness(obligation, next(witnesses, "none"), on_cells)
    need(next(witnesses, None) is None, "witnesses", f"{len(seen)} in number", len(value))


# ---------------------------------------------------------------- the verdict


def check_affine(loop: Loop) -> None:
    """Check that no uncertain parameter occurs twice in a term, so that the ends suffice."""
    for term in chain(*loop.field.values()):
        unique = len(set(term.uncertain)) == len(term.uncertain)
        need(unique, "field", "affine in every uncertain parameter", term.uncertain)


def describe_claims(loop: Loop, claims: dict[str, Fraction], m: int, n: int) -> list[str]:
    """Describe the statement of a proof; V <= C sum u^m makes dV/dt <= -c V^(n/m)."""
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


def prove(document: dict[str, Any]) -> list[str]:
    """Verify a proof and describe its statement."""
    read_object(document, "the file", PROOF_KEYS)
    loop = read_loop(document)
    check_affine(loop)
    function, claims, degrees = read_function(document["V"], loop), read_claims(document["claims"], loop), [0, 0]
    rate = time_derivative(function, loop)

    def consistent() -> Iterator[Obligation]:
        for degree, obligation in obligations(collect(function), rate, claims, loop):
            kind = obligation.name.split()[0] in ("decrease", "rate", "decay")
            degrees[kind] = degrees[kind] or degree
            need(degree == degrees[kind], f"degree at {obligation.name}", f"{degrees[kind]} as before", degree)
            yield obligation

    check_witnesses(document["witnesses"], consistent(), loop.domain == "cells")
    return [*describe(loop), f"V = {sum_text(function, loop)}", *describe_claims(loop, claims, *degrees)]
