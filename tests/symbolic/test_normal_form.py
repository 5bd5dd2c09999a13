"""One normal form: rules of signed powers against plain numbers."""

import mpmath as mp
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st
from thinned import few

from quakedesign.errors import KinkError
from quakedesign.symbolic import SignedPower, normal_form
from quakedesign.symbolic.signed_power import AbsolutePower

R = sp.Rational
x, y, z = sp.symbols("x y z", real=True)
k = sp.Symbol("k", positive=True)


def signed(v, a):
    return mp.sign(v) * (abs(v) ** a if v else mp.mpf(0))


def number(expression, **values):
    """Value by mpmath, with the two powers written anew."""
    names = sorted(values)
    own = {"SignedPower": signed, "AbsolutePower": lambda v, a: abs(v) ** a}
    function = sp.lambdify([sp.Symbol(n) for n in names], expression, [own, "mpmath"])
    return function(*(mp.mpf(values[n]) for n in names))


def plain(expression):
    """Same expression in symbols without assumptions, so that no rule of SymPy's helps."""
    return expression.xreplace({s: sp.Symbol(s.name) for s in expression.free_symbols})


@pytest.mark.parametrize(
    ("written", "simple"),
    [
        (SignedPower(SignedPower(x, R(1, 3)), R(3, 2)), SignedPower(x, R(1, 2))),
        (AbsolutePower(SignedPower(x, R(1, 3)), 6), x**2),
        (SignedPower(k**3 * x, R(1, 3)), k * SignedPower(x, R(1, 3))),
        (x * sp.Abs(x), SignedPower(x, 2)),
        (sp.sign(x) * sp.Abs(x) ** R(1, 2), SignedPower(x, R(1, 2))),
        (AbsolutePower(x, R(1, 2)) * SignedPower(x, R(1, 2)), x),
        (SignedPower(x * y, R(1, 3)), SignedPower(x, R(1, 3)) * SignedPower(y, R(1, 3))),
        (SignedPower(k * x + k * y, R(1, 2)), sp.sqrt(k) * SignedPower(x + y, R(1, 2))),
        (SignedPower(y - 2 * x, R(1, 2)), -SignedPower(2 * x - y, R(1, 2))),
        (sp.sqrt(x**2 + y**2), AbsolutePower(x**2 + y**2, R(1, 2))),
    ],
    ids=str,
)
def test_rules(written, simple):
    assert normal_form(written) == normal_form(simple)
    assert normal_form(written - simple) == 0


EXPRESSIONS = [
    SignedPower(k * SignedPower(x, R(1, 2)) + k**2 * y, R(2, 3)) * sp.Abs(x) * SignedPower(x, R(1, 3)),
    sp.expand((x + y) ** 3) * SignedPower(SignedPower(z, R(3, 2)) - x, R(1, 3)) ** 2,
    SignedPower(SignedPower(SignedPower(x, R(1, 3)) + y, R(1, 2)) - z, 3)
    + sp.sign(-x) * AbsolutePower(-2 * y, R(5, 3)),
    (AbsolutePower(x, 3) + x**2 * AbsolutePower(y, 1)) ** R(1, 6) * SignedPower(y, 0),
    SignedPower(-(x**3) * y**2 / 7, R(3, 5)) / k,
]
floats = st.floats(-5, 5).filter(lambda v: abs(v) > 1e-3)


@few("expression", EXPRESSIONS, ids=range(len(EXPRESSIONS)), every=2)
@given(floats, floats, floats, st.floats(0.1, 5))
def test_the_value_never_changes(expression, a, b, c, positive):
    with mp.workdps(50):
        values = {"x": a, "y": b, "z": c, "k": positive}
        before, after = (number(plain(e), **values) for e in (expression, normal_form(expression)))
        assert abs(before - after) <= mp.mpf(10) ** -40 * (1 + abs(before))


@pytest.mark.parametrize("expression", EXPRESSIONS, ids=range(len(EXPRESSIONS)))
def test_it_is_reached_in_one_call(expression):
    once = normal_form(expression)
    assert normal_form(once) == once


def test_two_ways_of_writing_one_nested_power_agree():
    c = k ** R(-3, 2)
    first = SignedPower(x + c * SignedPower(y, R(3, 2)), R(1, 3))
    second = SignedPower(k ** R(3, 2) * x + SignedPower(y, R(3, 2)), R(1, 3)) / sp.sqrt(k)
    assert normal_form(first - second) == 0
    assert normal_form(first - 2 * second) != 0


def test_a_negative_power_of_zero_is_refused():
    with pytest.raises(KinkError, match="negative power"):
        normal_form(AbsolutePower(sp.Integer(0), R(-1, 3), evaluate=False) * x)
