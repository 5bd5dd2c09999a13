"""Arithmetic of sparse polynomials against SymPy."""

from fractions import Fraction as F
from itertools import product as pairs

import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from quakedesign.errors import PolynomialError
from quakedesign.sos.exact.polynomial import (
    combination,
    constant,
    degree,
    element,
    evaluate,
    from_sympy,
    mapping,
    monomials,
    product,
    rescaled,
    square_factor,
    times,
)

x, y = sp.symbols("x y")
polynomials = st.dictionaries(
    st.tuples(st.integers(0, 3), st.integers(0, 3)), st.fractions(-3, 3, max_denominator=4).filter(bool), max_size=4
)


def symbolic(polynomial):
    return sum((sp.Rational(str(c)) * x ** e[0] * y ** e[1] for e, c in polynomial.items()), sp.Integer(0))


def same(polynomial, expression):
    """Equal, without zeros."""
    return all(polynomial.values()) and sp.expand(symbolic(polynomial) - expression) == 0


@settings(max_examples=40, deadline=None)
@given(st.lists(polynomials, max_size=3))
def test_products(factors):
    assert same(product(2, factors), sp.prod(map(symbolic, factors)))


def test_products_with_one_and_with_zero():
    p = {(1, 0): F(2), (0, 1): F(1)}
    assert product(2, []) == product(2, [constant(2)]) == {(0, 0): 1}
    assert product(2, [p]) == product(2, [constant(2), p]) == p
    assert product(2, [p, {}]) == product(2, [{}]) == {}


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.fractions(-2, 2, max_denominator=3), polynomials), max_size=3))
def test_combinations(parts):
    assert same(combination(parts), sum((sp.Rational(str(c)) * symbolic(p) for c, p in parts), sp.Integer(0)))


@settings(max_examples=40, deadline=None)
@given(polynomials, st.tuples(st.fractions(-2, 2, max_denominator=3), st.fractions(-2, 2, max_denominator=3)))
def test_values_and_scales(p, at):
    numbers = [sp.Rational(str(v)) for v in at]
    assert sp.Rational(str(evaluate(p, at))) == symbolic(p).subs({x: numbers[0], y: numbers[1]}, simultaneous=True)
    if all(at):
        assert same(rescaled(p, at), symbolic(p).subs({x: numbers[0] * x, y: numbers[1] * y}, simultaneous=True))


def test_degrees_and_constants():
    assert degree({(1, 2): F(1), (2, 0): F(1)}) == 3
    assert degree({}) == degree({(0, 0): F(1)}) == 0
    assert constant(3, F(2)) == {(0, 0, 0): 2}
    assert constant(3, F(0)) == {}
    assert times((1, 2), (3, 0)) == (4, 2)
    assert mapping(element({(1, 0): F(0), (0, 1): F(1)}, 2)) == {(0, 1): 1}


def test_the_square_factor_is_the_largest():
    """x^2 (x - y)^3 (x + 1) = (x (x - y))^2 (x - y)(x + 1)."""
    root, rest = square_factor(from_sympy(sp.expand(3 * x**2 * (x - y) ** 3 * (x + 1)), (x, y)), 2)
    assert sp.expand(symbolic(root) ** 2 * symbolic(rest)) == sp.expand(3 * x**2 * (x - y) ** 3 * (x + 1))
    assert sp.expand(symbolic(root) ** 2 - (x * (x - y)) ** 2) == 0
    root, rest = square_factor(from_sympy(sp.expand((x + y) ** 5), (x, y)), 2)
    assert sp.expand(symbolic(root) ** 2 - (x + y) ** 4) == 0


@pytest.mark.parametrize(("most", "least"), [(0, 0), (3, 0), (3, 2), (-1, 0), (2, 3)])
def test_monomials_by_degree(most, least):
    found = list(monomials(3, most, least))
    assert set(found) == {e for e in pairs(range(5), repeat=3) if least <= sum(e) <= most}
    assert len(set(found)) == len(found)
    assert [sum(e) for e in found] == sorted(sum(e) for e in found)


def test_only_polynomials_with_rational_coefficients_are_read():
    assert from_sympy(x * y / 2 - x * y / 2 + y**2, (x, y)) == {(0, 2): 1}
    assert from_sympy(sp.Integer(0), (x, y)) == {}
    for bad in (sp.sqrt(x), sp.sin(x), 1 / x, sp.sqrt(2) * x, sp.Symbol("z") * x):
        with pytest.raises(PolynomialError):
            from_sympy(bad, (x, y))
