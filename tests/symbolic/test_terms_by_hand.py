"""Sums of signed powers, one by one."""

from fractions import Fraction as F

import pytest
import sympy as sp

from quakedesign.errors import CertificateError, KinkError
from quakedesign.symbolic import AbsolutePower, SignedPower
from quakedesign.symbolic.term_expressions import from_terms, lie_derivative, to_terms, without_nesting
from quakedesign.symbolic.terms import (
    Term,
    cell_polynomial,
    collected,
    lie_terms,
    multiplied,
    real_polynomial,
    value,
    written,
)

a, b, k, q = sp.symbols("a b k q", real=True)
HALF, THIRD = sp.Rational(1, 2), sp.Rational(1, 3)


def signed(state, exponent):
    return state, F(exponent), "s"


def absolute(state, exponent):
    return state, F(exponent), "a"


def test_nested_powers_are_named_from_the_inside():
    inner = SignedPower(a + 2 * b, HALF)
    outer = AbsolutePower(inner + 3 * k, THIRD)
    lifts, (found, other, plain) = without_nesting(
        [outer * k, SignedPower(2 * b + a, THIRD) + SignedPower(a, 2), SignedPower(k + q, HALF) + 7],
        (a, b),
        ("n2", "n4"),
    )
    first, second = sp.symbols("n1 n3", real=True)
    assert lifts == {first: a + 2 * b, second: SignedPower(first, HALF) + 3 * k}
    assert list(lifts) == [first, second]
    assert found == k * AbsolutePower(second, THIRD)
    assert other == SignedPower(first, THIRD) + SignedPower(a, 2)
    assert plain == SignedPower(k + q, HALF) + 7  # of no state
    assert without_nesting([SignedPower(a, 2) * k, 5], (a,)) == ({}, [SignedPower(a, 2) * k, 5])
    assert list(without_nesting([SignedPower(a + 1, HALF)], (a,))[0]) == [first]


def test_what_is_expanded_in_a_lift_is_found_again():
    lifts, (one, other) = without_nesting([SignedPower(a * (b + 1), HALF), SignedPower(a * b + a, HALF)], (a, b))
    assert list(lifts.values()) == [a * b + a]
    assert one == other


def test_parts_are_split_into_numbers_parameters_and_powers():
    expression = sp.Rational(-3, 4) * k**2 * q * a**2 * SignedPower(b, THIRD) + 2 * a - a + AbsolutePower(a, HALF) ** 3
    assert to_terms(expression, (a, b)) == (
        Term(F(-3, 4), ("k", "k", "q"), (absolute("a", 2), signed("b", "1/3"))),
        Term(F(1), (), (signed("a", 1),)),
        Term(F(1), (), (absolute("a", "3/2"),)),
    )
    assert to_terms(a**3 * SignedPower(b, HALF) ** 3 + SignedPower(b, HALF) ** 2, (a, b)) == (
        Term(F(1), (), (signed("a", 3), signed("b", "3/2"))),
        Term(F(1), (), (absolute("b", 1),)),
    )
    assert to_terms(sp.Integer(-7), (a,)) == (Term(F(-7), (), ()),)


@pytest.mark.parametrize(
    "expression",
    [
        sp.sqrt(2) * a,
        sp.Rational(1, 2) ** HALF * a,
        1 / a,
        a / k,
        k**HALF,
        sp.sqrt(k) * a,
        1 / SignedPower(a, HALF),
        AbsolutePower(a, THIRD) ** HALF,
        SignedPower(a, sp.sqrt(2)),
        SignedPower(k, HALF),
        SignedPower(a + b, HALF),
        sp.sin(a),
        a**k,
    ],
)
def test_other_factors_are_refused(expression):
    with pytest.raises(CertificateError, match="products of signed powers of single states"):
        to_terms(expression, (a, b))


def test_equal_products_are_collected_in_the_order_of_states_and_names():
    terms = [
        Term(F(1), ("q", "k"), (signed("b", 1), absolute("a", 2))),
        Term(F(2), ("k", "q"), (absolute("a", 2), signed("b", 1))),
        Term(F(5), (), (signed("b", 1),)),
        Term(F(-5), (), (signed("b", 1),)),
        Term(F(-1), (), ()),
    ]
    assert collected(terms, ["a", "b"]) == (
        Term(F(-1), (), ()),
        Term(F(3), ("k", "q"), (absolute("a", 2), signed("b", 1))),
    )
    assert collected(terms[:1], ["b", "a"])[0].factors == (signed("b", 1), absolute("a", 2))


def test_factors_multiply_by_adding_exponents_and_signs():
    assert multiplied([signed("a", "1/3"), signed("b", 1), signed("a", "1/3")]) == (
        absolute("a", "2/3"),
        signed("b", 1),
    )
    assert multiplied([absolute("a", 1), signed("a", 2)]) == (signed("a", 3),)
    assert multiplied([absolute("a", 1), absolute("a", 2)]) == (absolute("a", 3),)
    assert multiplied([signed("a", 0)]) == (signed("a", 0),)
    assert multiplied([signed("a", 0), signed("a", 0), absolute("b", 0)]) == ()
    assert multiplied([signed("a", "1/2"), absolute("a", "-1/2")]) == (signed("a", 0),)


SYMBOLS = {"a": a, "b": b, "k": k, "q": q}
SUM = (
    Term(F(-3, 4), ("k", "k"), (absolute("a", "2/3"), signed("b", "1/2"))),
    Term(F(5), ("q",), (signed("a", "1/3"),)),
    Term(F(2), (), ()),
)


def test_terms_are_the_expression_that_they_say():
    expected = -3 * k**2 * AbsolutePower(a, 2 * THIRD) * SignedPower(b, HALF) / 4 + 5 * q * SignedPower(a, THIRD) + 2
    assert from_terms(SUM, SYMBOLS) == expected
    assert from_terms((), SYMBOLS) == 0


def test_terms_are_written_as_sympy_reads_them():
    names = SYMBOLS | {"SignedPower": SignedPower, "AbsolutePower": AbsolutePower}
    assert sp.sympify(written(SUM), names) == from_terms(SUM, SYMBOLS)
    assert written(SUM) == "5*q*SignedPower(a, 1/3) + 2 - 3*k*k*AbsolutePower(a, 2/3)*SignedPower(b, 1/2)/4"
    assert written(SUM[:1]) == "-3*k*k*AbsolutePower(a, 2/3)*SignedPower(b, 1/2)/4"
    assert written([Term(F(-1), (), (signed("a", 1),)), Term(F(-1), (), (absolute("a", 1),))]) == (
        "-a - AbsolutePower(a, 1)"
    )
    assert written([Term(F(1, 2), (), ())]) == "1/2"
    assert written(()) == "0"


def test_the_derivative_along_a_field():
    """V = |a|^{3/2}·⌈b⌋² with a' = 2b and b' = −k⌈a⌋^{1/2} + 5."""
    function = Term(F(7), ("q",), (absolute("a", "3/2"), signed("b", 2)))
    field = {
        "a": (Term(F(2), (), (signed("b", 1),)),),
        "b": (Term(F(-1), ("k",), (signed("a", "1/2"),)), Term(F(5), (), ())),
    }
    assert list(lie_terms(function, field)) == [
        Term(F(21), ("q",), (absolute("b", 3), signed("a", "1/2"))),
        Term(F(-14), ("q", "k"), (signed("a", 2), absolute("b", 1))),
        Term(F(70), ("q",), (absolute("a", "3/2"), absolute("b", 1))),
    ]
    assert lie_derivative(a * b**2, {a: k, b: a}) == k * b**2 + 2 * a**2 * b
    with pytest.raises(KinkError):
        lie_derivative(AbsolutePower(a, 1), {a: k})


def test_values_and_polynomials_on_a_cell():
    parameters = {"k": F(3), "q": F(1, 5)}
    assert [value(term, parameters) for term in SUM] == [F(-27, 4), 1, 2]
    weights = {"a": 3, "b": 2}
    assert cell_polynomial(SUM, weights, {"a": 1, "b": 1}, parameters) == {(2, 1): F(-27, 4), (1, 0): 1, (0, 0): 2}
    assert cell_polynomial(SUM, weights, {"a": -1, "b": 1}, parameters) == {(2, 1): F(-27, 4), (1, 0): -1, (0, 0): 2}
    assert cell_polynomial(SUM, weights, {"a": 1, "b": -1}, parameters) == {(2, 1): F(27, 4), (1, 0): 1, (0, 0): 2}
    twice = (Term(F(1), (), (signed("a", 1),)), Term(F(2), (), (absolute("a", 1),)), Term(F(1), (), (signed("b", 0),)))
    assert cell_polynomial(twice, weights, {"a": -1, "b": -1}, {}) == {(3, 0): 1, (0, 0): -1}
    both = (Term(F(1), (), (signed("a", 1),)), Term(F(1), (), (absolute("a", 1),)))
    assert cell_polynomial(both, weights, {"a": -1, "b": 1}, {}) == {}
    odd = Term(F(1), (), (signed("a", 1), signed("b", 1)))
    assert cell_polynomial([odd], weights, {"a": -1, "b": -1}, {}) == {(3, 2): 1}


@pytest.mark.parametrize(("state", "exponent"), [("a", "1/2"), ("a", "-1"), ("b", "1/3"), ("b", "-1/2")])
def test_exponents_that_become_no_integers_or_negative_ones_are_refused(state, exponent):
    with pytest.raises(CertificateError, match="not polynomial on a cell"):
        cell_polynomial([Term(F(1), (), (signed(state, exponent),))], {"a": 3, "b": 2}, {"a": 1, "b": 1}, {})


def test_polynomials_on_the_reals():
    cube = Term(F(2), ("k",), (signed("a", 3), absolute("b", 2)))
    assert real_polynomial(iter([cube, Term(F(1), (), ())]), ["a", "b"], {"k": F(5)}) == {(3, 2): 10, (0, 0): 1}
    for exponent, kind in ((F(2), "s"), (F(3), "a"), (F(1, 2), "s"), (F(3, 2), "a"), (F(0), "s")):
        with pytest.raises(CertificateError, match="not polynomial on the reals"):
            real_polynomial([Term(F(1), (), (("a", exponent, kind),))], ["a"], {})
