"""Sums of signed powers as data: round trip, Lie derivative, polynomials on cells."""

import math
from fractions import Fraction as F

import mpmath
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from quakedesign.errors import CertificateError, KinkError
from quakedesign.symbolic import AbsolutePower, SignedPower
from quakedesign.symbolic.term_expressions import from_terms, lie_derivative, to_terms
from quakedesign.symbolic.terms import Term, cell_polynomial, collected, lie_terms, multiplied, real_polynomial, value

a, b, c = sp.symbols("a b c", real=True)
k, q = sp.symbols("k q", real=True)
STATES = (a, b, c)
SYMBOLS = {symbol.name: symbol for symbol in (*STATES, k, q)}
WEIGHTS = {"a": 3, "b": 2, "c": 1}


def evaluate(terms, at):
    """Sum of terms at floats, from the definition of ⌈x⌋^a and |x|^a."""
    total = 0.0
    for term in terms:
        product = float(term.coefficient) * math.prod(at[name] for name in term.parameters)
        for state, exponent, kind in term.factors:
            size = abs(at[state]) ** float(exponent)
            product *= math.copysign(size, at[state]) if kind == "s" else size
        total += product
    return total


@st.composite
def sums(draw):
    """Terms whose exponents become integers on cells, each product once."""
    found = {}
    for _ in range(draw(st.integers(1, 4))):
        factors = []
        for state, weight in WEIGHTS.items():
            degree, kind = draw(st.integers(0, 6)), draw(st.sampled_from("sa"))
            if degree or kind == "s":
                factors.append((state, F(degree, weight), kind))
        key = (tuple(sorted(draw(st.lists(st.sampled_from("kq"), max_size=2)))), tuple(factors))
        found[key] = draw(st.fractions(-9, 9, max_denominator=20).filter(bool))
    return tuple(sorted(Term(coefficient, *key) for key, coefficient in found.items()))


sizes = st.floats(0.01, 3) | st.floats(-3, -0.01)
places = st.fixed_dictionaries(dict.fromkeys(SYMBOLS, sizes))


@given(sums())
def test_terms_survive_the_way_through_sympy(terms):
    assert to_terms(from_terms(terms, SYMBOLS), STATES) == terms


@given(sums(), places)
def test_the_expression_has_the_value_of_its_terms(terms, at):
    expression = from_terms(terms, SYMBOLS).subs({SYMBOLS[name]: sp.Float(v, 30) for name, v in at.items()})
    assert float(sp.N(expression, 20)) == pytest.approx(evaluate(terms, at), rel=1e-9, abs=1e-9)


@given(sums(), st.fixed_dictionaries(dict.fromkeys(WEIGHTS, st.floats(0.1, 1.5))), st.data())
def test_the_polynomial_of_a_cell_has_the_value_of_the_terms_there(terms, u, data):
    signs = {state: data.draw(st.sampled_from((-1, 1))) for state in WEIGHTS}
    parameters = {"k": F(3, 2), "q": F(-2, 7)}
    polynomial = cell_polynomial(terms, WEIGHTS, signs, parameters)
    found = sum(float(v) * math.prod(u[s] ** n for s, n in zip(WEIGHTS, e, strict=True)) for e, v in polynomial.items())
    at = {name: signs[name] * u[name] ** WEIGHTS[name] for name in WEIGHTS} | {
        n: float(v) for n, v in parameters.items()
    }
    assert found == pytest.approx(evaluate(terms, at), rel=1e-9, abs=1e-9)


def test_products_of_one_state_are_joined():
    half = sp.Rational(1, 2)
    (joined,) = to_terms(3 * k * SignedPower(a, half) * AbsolutePower(a, half) * SignedPower(b, half) ** 2, STATES)
    assert joined == Term(F(3), ("k",), (("a", F(1), "s"), ("b", F(1), "a")))
    assert to_terms(SignedPower(a, 0) ** 2, STATES) == (Term(F(1), (), ()),)
    assert to_terms(a * AbsolutePower(a, half) - SignedPower(a, 3 * half), STATES) == ()
    assert to_terms(sp.Integer(0), STATES) == ()


def test_plain_powers_are_signed_by_their_parity():
    assert to_terms(a**2 + b**3 / 7, STATES) == (
        Term(F(1, 7), (), (("b", F(3), "s"),)),
        Term(F(1), (), (("a", F(2), "a"),)),
    )


@pytest.mark.parametrize(
    "expression", [sp.sqrt(2) * a, sp.exp(a), 1 / a, SignedPower(a + b, 2), AbsolutePower(a, 1) / AbsolutePower(b, 2)]
)
def test_anything_else_is_refused(expression):
    with pytest.raises(CertificateError, match="products of signed powers of single states"):
        to_terms(expression, STATES)


def test_the_lie_derivative_against_finite_differences():
    V = AbsolutePower(a, sp.Rational(5, 3)) - a * b / 4 + AbsolutePower(b, sp.Rational(5, 2)) + SignedPower(c, 2) * a
    field = {a: b, b: -SignedPower(a, sp.Rational(1, 3)) + c, c: -SignedPower(a, 0)}
    at = {a: sp.Rational(-3, 7), b: sp.Rational(5, 11), c: sp.Rational(-13, 10)}
    with mpmath.workdps(50):
        x, y, z = (mpmath.mpf(int(v.p)) / int(v.q) for v in at.values())

        def along(s):  # V on the straight line with the field's direction at the point, by hand
            third = -mpmath.sign(x) * abs(x) ** (mpmath.mpf(1) / 3)
            p, q_, r = x + s * y, y + s * (third + z), z - s * mpmath.sign(x)
            squares = mpmath.sign(r) * r**2
            return abs(p) ** (mpmath.mpf(5) / 3) - p * q_ / 4 + abs(q_) ** (mpmath.mpf(5) / 2) + squares * p

        numeric = mpmath.diff(along, 0, h=mpmath.mpf(10) ** -20)
        ours = mpmath.mpf(str(sp.N(lie_derivative(V, field).subs(at), 50)))
        assert abs(ours - numeric) < mpmath.mpf(10) ** -25


def test_a_function_with_a_kink_has_no_lie_derivative():
    with pytest.raises(KinkError):
        lie_derivative(AbsolutePower(a, 1), {a: -a})


def test_the_value_of_a_coefficient():
    assert value(Term(F(2, 3), ("k", "k", "q"), ()), {"k": F(3), "q": F(1, 4)}) == F(3, 2)


def test_weights_that_leave_roots_are_refused():
    with pytest.raises(CertificateError, match="not polynomial on a cell"):
        cell_polynomial([Term(F(1), (), (("a", F(1, 2), "s"),))], {"a": 3}, {"a": 1}, {})


def test_polynomials_on_the_reals_need_the_right_parity():
    square, cube = Term(F(1), (), (("a", F(2), "a"),)), Term(F(2), (), (("a", F(3), "s"),))
    assert real_polynomial([square, cube], ["a", "b"], {}) == {(2, 0): 1, (3, 0): 2}
    for exponent, kind in ((F(2), "s"), (F(3), "a"), (F(1, 2), "s")):
        with pytest.raises(CertificateError, match="not polynomial on the reals"):
            real_polynomial([Term(F(1), (), (("a", exponent, kind),))], ["a"], {})


@st.composite
def smooth(draw):
    """C¹ products: signed powers from 1 on, absolute ones beyond."""
    factors = []
    for state in WEIGHTS:
        kind = draw(st.sampled_from(("s", "a", None)))
        more = draw(st.fractions(0, 3, max_denominator=6))
        if kind and (kind == "s" or more):
            factors.append((state, 1 + more, kind))
    coefficient = draw(st.fractions(-9, 9, max_denominator=20).filter(bool))
    return Term(coefficient, tuple(draw(st.lists(st.sampled_from("kq"), max_size=1))), tuple(factors))


@settings(max_examples=15, deadline=None)
@given(smooth(), st.fixed_dictionaries(dict.fromkeys(WEIGHTS, sums())))
def test_the_derivative_of_terms_is_that_of_their_expressions(function, field):
    found = collected(lie_terms(function, field), list(WEIGHTS))
    rates = {SYMBOLS[state]: from_terms(terms, SYMBOLS) for state, terms in field.items()}
    assert found == to_terms(lie_derivative(from_terms([function], SYMBOLS), rates), STATES)


@settings(max_examples=30)
@given(smooth(), places)
def test_the_derivative_of_terms_is_a_difference_quotient(function, at):
    """Along the field (1, 0, 0) at 50 digits, on whose states alone the function depends."""
    one = (Term(F(1), (), ()),)
    found = evaluate(list(lie_terms(function, {"a": one, "b": (), "c": ()})), at)
    with mpmath.workdps(50):

        def value_at(x):
            number = mpmath.mpf(function.coefficient.numerator) / function.coefficient.denominator
            for name in function.parameters:
                number *= at[name]
            for state, exponent, kind in function.factors:
                place = x if state == "a" else mpmath.mpf(at[state])
                size = abs(place) ** (mpmath.mpf(exponent.numerator) / exponent.denominator)
                number *= size * mpmath.sign(place) if kind == "s" else size
            return number

        step = mpmath.mpf(10) ** -20
        place = mpmath.mpf(at["a"])
        quotient = (value_at(place + step) - value_at(place - step)) / (2 * step)
    assert found == pytest.approx(float(quotient), rel=1e-9, abs=1e-12)


def test_factors_of_one_state_are_multiplied():
    third = F(1, 3)
    assert multiplied([("a", third, "s"), ("b", F(1), "a"), ("a", third, "s")]) == (
        ("a", 2 * third, "a"),
        ("b", F(1), "a"),
    )
    assert multiplied([("a", F(0), "a"), ("b", F(0), "s")]) == (("b", F(0), "s"),)
