"""Plain polynomials: non-negative on a set by sums of squares, or negative at a point of it."""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

from .numbers import (
    MAX_BYTES,
    Exponents,
    Number,
    Polynomial,
    add,
    add_product,
    budget,
    multiply,
    named,
    need,
    read_list,
    read_name,
    read_object,
    read_polynomial,
    read_polynomials,
    read_rational,
)
from .squares import check_identity, read_square

MAX_VARIABLES, MAX_CONSTRAINTS, MAX_PRODUCTS = 16, 32, 1024
KEPT = 300  # steps for a term in the cache, so that memory is bounded too

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


# ---------------------------------------------------------------- reading and writing


def read_product(value: Any, where: str, count: int) -> Product:
    """Read an increasing list of indices of inequalities."""
    for index in read_list(value, where, 0, count):
        need(type(index) is int and index < count, where, f"a list of indices below {count}", index)
    need(value == sorted(set(value)), where, "increasing", value)
    return tuple(value)


def read_statement(document: dict[str, Any]) -> Statement:
    """Read the common part of the three kinds of proof."""
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


def product_expander(statement: Statement) -> Expander:
    """Return a function that expands a product of inequalities, with a cache."""

    @cache
    def expand_product(chosen: Product) -> Polynomial:
        if not chosen:
            return {(0,) * len(statement.variables): Fraction(1)}
        total = add_product({}, expand_product(chosen[:-1]), statement.inequalities[chosen[-1]])
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
    """Describe the statement of the verdict."""
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


# ---------------------------------------------------------------- squares


def sum_squares(value: Any, where: str, statement: Statement, expanded: Expander) -> tuple[Polynomial, bool]:
    """Sum the squares times their products, and tell whether 1 is in the basis of one without inequalities."""
    total, size, positive = dict[Exponents, Number](), len(statement.variables), False
    for index, entry in enumerate(read_list(value, where, 0, MAX_BYTES), 1):
        place = f"{where} square {index}"
        label, basis, square = read_square(entry, place, "product", size, mixed=True)
        chosen = read_product(label, f"{place} product", len(statement.inequalities))
        need(chosen in statement.products, f"{place} product", "one of the products", label)
        add_product(total, expanded(chosen), square)
        positive |= not chosen and {(0,) * size: 1} in basis
    return total, positive


def check_multiplier(value: Any, statement: Statement, expanded: Expander) -> None:
    """Check that the multiplier is non-negative on the set, and positive on it if the set may have no interior."""
    one, limits = (0,) * len(statement.variables), statement.inequalities
    units = [e for g in limits for e, number in g.items() if len(g) == 1 and sum(e) == 1 and number > 0]
    signed = {exponents.index(1) for exponents in units}
    if read_list(value, "sos multiplier", 0, MAX_BYTES):
        total, positive = sum_squares(value, "sos multiplier", statement, expanded)
        check_identity({one: Fraction(1)}, statement.multiplier, total, "sos multiplier identity")
    else:
        positive = one in statement.multiplier
        for exponents, number in statement.multiplier.items():
            even = all(exponent % 2 == 0 or i in signed for i, exponent in enumerate(exponents))
            need(number > 0 and even, "multiplier", "of squares, or of positive even terms", exponents)
    orthant = len(units) == len(limits) and not statement.equalities
    need(positive or orthant, "multiplier", "positive everywhere on this set, by a term or square of 1", "another")


def prove_squares(value: Any, statement: Statement) -> list[str]:
    """Verify that multiplier * polynomial is a sum of non-negative terms and terms that vanish on the set."""
    proof, count = read_object(value, "sos", ("squares", "cofactors", "multiplier")), len(statement.equalities)
    expanded = product_expander(statement)
    check_multiplier(proof["multiplier"], statement, expanded)
    total, _ = sum_squares(proof["squares"], "sos", statement, expanded)
    cofactors = read_polynomials(proof["cofactors"], "sos cofactors", len(statement.variables), count, count)
    for cofactor, equality in zip(cofactors, statement.equalities, strict=True):
        add_product(total, cofactor, equality)
    check_identity(statement.multiplier, statement.polynomial, total, "sos identity")
    more = ["the set is empty, so the statement holds trivially"] if is_empty(statement) else []
    return ["conclusion: the polynomial is >= 0 on the set (the degree of the identity is not verified)", *more]


def is_empty(statement: Statement) -> bool:
    """Tell whether the set of a proved statement is seen to have no point, by signs and even exponents."""
    one = {(0,) * len(statement.variables)}
    turned = [{exponents: -number for exponents, number in entry.items()} for entry in statement.equalities]
    below = [*statement.inequalities, *statement.equalities, *turned]
    below += [statement.polynomial] if set(statement.polynomial) == one else []
    signs = ({number < 0 for number in entry.values()} == {True} for entry in below)
    even = (not any(power % 2 for exponents in entry for power in exponents) for entry in below)
    return any(s and e and one <= set(entry) for s, e, entry in zip(signs, even, below, strict=True))


# ---------------------------------------------------------------- a point


def evaluate(polynomial: Polynomial, point: list[Fraction]) -> Number:
    """Return the value of a polynomial at a point."""
    total: dict[str, Number] = {}
    for exponents, number in polynomial.items():
        add(total, "value", multiply([number], point, exponents))
    return total.get("value", 0)


def refute_by_point(value: Any, statement: Statement) -> list[str]:
    """Verify that the polynomial is negative at a point of the set."""
    entries = read_object(value, "negative", ("point",))["point"]
    count = len(statement.variables)
    point = [read_rational(entry, "point") for entry in read_list(entries, "point", count, count)]
    inside = all(evaluate(inequality, point) >= 0 for inequality in statement.inequalities)
    need(inside, "the point", "one where every inequality holds", entries)
    inside = all(evaluate(equality, point) == 0 for equality in statement.equalities)
    need(inside, "the point", "one where every equality holds", entries)
    need(evaluate(statement.polynomial, point) < 0, "the polynomial", "negative at the point", entries)
    return [
        f"point: {named(dict(zip(statement.variables, point, strict=True)))}",
        "conclusion: the polynomial is < 0 at this point of the set, so that no degree and no positive multiplier help",
    ]
