"""Enclosures over bounded and unbounded boxes hold every value, and attained ends exactly."""

from fractions import Fraction as F
from math import inf

import mpmath
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from quakedesign.errors import UnsupportedError
from quakedesign.symbolic import AbsolutePower, SignedPower
from quakedesign.symbolic.intervals import EVERYTHING, interval

x, y = sp.symbols("x y", real=True)
HALF_LINE, LINE = (F(0), inf), (-inf, inf)
EXACT = [
    (sp.exp(-x / 3), HALF_LINE, (0, 1)),
    (1 / (1 + x), HALF_LINE, (0, 1)),
    (F(2, 5) + sp.Rational(1, 10) * sp.exp(-sp.Max(x, 0)), LINE, (F(2, 5), F(1, 2))),
    (sp.Max(0, 1 - sp.Max(x, 0) / 7), LINE, (0, 1)),
    (1 / (1 + sp.Abs(x)), LINE, (0, 1)),
    (sp.sin(x), LINE, (-1, 1)),
    (sp.tanh(x), LINE, (-1, 1)),
    (sp.exp(-sp.Max(x, 0)).diff(x), LINE, (-1, 0)),
    (sp.Abs(x).diff(x), (F(0), F(2)), (1, 1)),
    (sp.Abs(x).diff(x), (F(-2), F(0)), (-1, -1)),
    (sp.Abs(x).diff(x), (F(-2), F(1)), (-1, 1)),
    (x**2, (F(-1), F(2)), (0, 4)),
    (x**3, LINE, LINE),
    (1 / x, (F(-1), F(1)), LINE),
    (1 / x, (F(0), F(2)), (F(1, 2), inf)),
    (x**-2, (F(-2), F(0)), (F(1, 4), inf)),
    (sp.sqrt(x), (F(-1), F(1)), LINE),
    (sp.log(x), (F(0), F(1)), (-inf, 0)),
    (sp.log(x), (F(-1), F(1)), LINE),
    (sp.cosh(x), (F(-1), inf), (1, inf)),
    (SignedPower(x, 2), (F(-2), F(1)), (-4, 1)),
    (AbsolutePower(x, 3), (F(-2), F(1)), (0, 8)),
    (SignedPower(x, 0), (F(-2), F(1)), (-1, 1)),
    (sp.DiracDelta(x), (F(-2), F(1)), LINE),
    (sp.DiracDelta(x), (F(0), F(1)), (0, 0)),
    (0.1 * x, (F(0), F(1)), (0, F(1, 10))),
]


@pytest.mark.parametrize(("expression", "ends", "expected"), EXACT, ids=lambda v: str(v)[:28])
def test_ends_that_are_attained_are_exact(expression, ends, expected):
    assert interval(sp.sympify(expression), {x: ends}) == expected


def test_where_nothing_is_known_it_is_the_whole_line():
    assert interval(sp.oo * 1, {}) == EVERYTHING
    with pytest.raises(UnsupportedError, match="no enclosure for gamma"):
        interval(sp.gamma(x), {x: (F(1), F(2))})
    with pytest.raises(UnsupportedError, match="no enclosure for the exponent"):
        interval(sp.Pow(x, y), {x: (F(1), F(2)), y: (F(1), F(2))})


@pytest.mark.parametrize(
    "number", [sp.pi, sp.E, sp.exp(sp.Rational(1, 3)), sp.asinh(2), sp.sqrt(2), sp.sinh(-1)], ids=str
)
def test_irrational_numbers_lie_strictly_inside_of_narrow_intervals(number):
    low, high = interval(number, {})
    assert sp.Rational(low.numerator, low.denominator) < number < sp.Rational(high.numerator, high.denominator)
    assert high - low < F(1, 10**45)


leaves = st.sampled_from((x, y)) | st.fractions(-3, 3, max_denominator=7).map(
    lambda v: sp.Rational(v.numerator, v.denominator)
)
expressions = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.tuples(inner, inner).map(lambda e: e[0] + e[1]),
        st.tuples(inner, inner).map(lambda e: e[0] * e[1]),
        st.tuples(inner, inner).map(lambda e: sp.Max(*e)),
        st.tuples(inner, inner).map(lambda e: sp.Min(*e)),
        inner.map(sp.Abs),
        inner.map(sp.tanh),
        inner.map(sp.sin),
        inner.map(lambda e: sp.exp(-sp.Abs(e))),
        inner.map(lambda e: 1 / (1 + e**2)),
        inner.map(lambda e: SignedPower(e, sp.Rational(3, 2))),
    ),
    max_leaves=5,
)
ends = st.tuples(st.fractions(-3, 3, max_denominator=5), st.fractions(0, 3, max_denominator=5)).map(
    lambda pair: (pair[0], pair[0] + pair[1])
)


@settings(max_examples=150, deadline=None)
@given(expressions, ends, st.booleans(), st.integers(0, 12), st.integers(0, 12))
def test_an_interval_contains_every_value(expression, first, unbounded, i, j):
    """The oracle evaluates at points, 40 digits long; on a half-line far out too."""
    box = {x: (first[0], inf) if unbounded else first, y: (F(-1), F(2))}
    along = first[0] + (F(3) ** i - 1 if unbounded else F(i, 12) * (first[1] - first[0]))
    at = {x: sp.Rational(along.numerator, along.denominator), y: sp.Rational(3 * j, 12) - 1}
    plain = sp.sympify(expression).replace(SignedPower, lambda b, e: sp.sign(b) * sp.Abs(b) ** e)
    low, high = interval(expression, box)
    with mpmath.workdps(60):
        value = mpmath.mpf(str(sp.N(plain.subs(at), 40)))
        slack = abs(value) * mpmath.mpf("1e-35") + mpmath.mpf("1e-60")
        below, above = (v if isinstance(v, float) else mpmath.mpf(v.numerator) / v.denominator for v in (low, high))
        assert below - slack <= value <= above + slack
