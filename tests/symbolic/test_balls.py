"""Enclosures contain every value; bounds are never below a sample."""

from fractions import Fraction as F

import flint
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.symbolic import AbsolutePower, SignedPower
from quakedesign.symbolic.enclosure import ball, enclose, upper_bound

x, y = sp.symbols("x y", real=True)
SLACK = 1e-7  # a ball rounds its radius outward to 30 bits
numbers = st.fractions(-4, 4, max_denominator=12)
HALF = sp.Rational(1, 2)


def sympy_rational(value):
    return sp.Rational(value.numerator, value.denominator)


def one_step(inner):
    pairs = st.tuples(inner, inner)
    return st.one_of(
        pairs.map(lambda e: e[0] + e[1]),
        pairs.map(lambda e: e[0] * e[1]),
        pairs.map(lambda e: e[0] - e[1]),
        pairs.map(lambda e: sp.Max(*e)),
        pairs.map(lambda e: sp.Min(*e)),
        pairs.map(lambda e: e[0] / (2 + sp.cos(e[1]))),
        inner.map(sp.sin),
        inner.map(lambda e: sp.exp(-AbsolutePower(e, sp.Rational(1, 2)))),
        inner.map(lambda e: sp.exp(sp.sin(e))),
        inner.map(sp.Abs),
        inner.map(sp.asinh),
        inner.map(lambda e: sp.log(e**2 + 1)),
        inner.map(lambda e: (e**2 + 1) ** sp.Rational(-3, 2)),
        st.tuples(inner, st.integers(2, 5)).map(lambda e: e[0] ** e[1]),
        st.tuples(inner, st.sampled_from(("1/3", "1/2", "3/2", "2", "5/3"))).map(
            lambda e: SignedPower(e[0], sp.Rational(e[1]))
        ),
        inner.map(lambda e: AbsolutePower(e, sp.Rational(5, 2))),
    )


expressions = st.recursive(st.sampled_from((x, y)) | numbers.map(sympy_rational), one_step, max_leaves=5)
intervals = st.tuples(numbers, numbers).map(lambda ends: tuple(sorted(ends)))
shares = st.fractions(0, 1, max_denominator=30)


def exact(expression, at):
    """Value with an error below 1e-25, as a ball."""
    found = sp.N(sp.sympify(expression).subs({s: sympy_rational(v) for s, v in at.items()}), 40)
    radius = "1e-25" if found == 0 else str(abs(sp.Float(found, 40)) * sp.Float("1e-25", 40))
    return flint.arb(str(found), radius)


@pytest.mark.slow
@settings(max_examples=2 * settings.default.max_examples, deadline=None)
@given(expressions, intervals, intervals, shares, shares)
def test_an_enclosure_contains_every_value(expression, first, second, along, across):
    box = {x: first, y: second}
    at = {x: first[0] + along * (first[1] - first[0]), y: second[0] + across * (second[1] - second[0])}
    assert enclose(expression, box).overlaps(exact(expression, at))


@settings(max_examples=30, deadline=None)
@given(expressions, numbers, numbers)
def test_an_enclosure_of_a_point_is_as_narrow_as_the_arithmetic(expression, first, second):
    """With 200 bits the value to 25 digits: what a number such as pi or 1/3 is rounded to is not taken for it."""
    at = {x: first, y: second}
    with flint.ctx.workprec(200):
        found = enclose(expression, {symbol: (value, value) for symbol, value in at.items()})
        if found.is_finite():  # |x|^a about zero is as wide as a root of the rounding
            assert found.overlaps(exact(expression, at))
            assert found.rad() < 1e-12


@given(intervals)
def test_a_reciprocal_is_no_wider_than_that_of_the_ball(ends):
    assert not ends[0] > 0 or (1 / ball(*ends)).contains(enclose(1 / x, {x: ends}))


@given(intervals)
def test_a_ball_contains_both_ends(ends):
    found = ball(*ends)
    assert all(found.contains(flint.arb(flint.fmpq(v.numerator, v.denominator))) for v in ends)


UNBOUNDED = {
    "1/x": 1 / x,
    "1/x²": 1 / x**2,
    "|x|^-½": AbsolutePower(x, -sp.Rational(1, 2)),
    "⌈x⌋^-½": SignedPower(x, -sp.Rational(1, 2)),
    "log": sp.log(x),
    "root": sp.sqrt(x),
}


@pytest.mark.parametrize("ends", [(F(-1), F(1)), (F(-1, 3), F(2))], ids=str)
@pytest.mark.parametrize("expression", UNBOUNDED.values(), ids=UNBOUNDED)
def test_where_it_is_not_defined_the_enclosure_is_not_finite(expression, ends):
    assert not enclose(expression, {x: ends}).is_finite()
    with pytest.raises(ValueError, match="no finite bound"):
        upper_bound(expression, {x: ends}, pieces=30)


def test_a_negative_power_up_to_zero_is_unbounded():
    for kind in (SignedPower, AbsolutePower):
        assert not enclose(kind(x, -sp.Rational(1, 2)), {x: (F(0), F(1))}).is_finite()
        assert float(enclose(kind(x, -sp.Rational(1, 2)), {x: (F(1, 4), F(1))}).upper()) == pytest.approx(2)


def test_the_sign_at_zero_is_the_whole_interval():
    sign = SignedPower(x, 0)
    for ends, low, high in (
        ((F(-1), F(1)), -1, 1),
        ((F(0), F(1)), -1, 1),
        ((F(1), F(2)), 1, 1),
        ((F(-2), F(-1)), -1, -1),
    ):
        found = enclose(sign, {x: ends})
        assert [float(found.lower()), float(found.upper())] == pytest.approx([low, high], abs=SLACK)


def test_powers_are_enclosed_tightly():
    assert float(enclose(x**2, {x: (F(-1), F(2))}).lower()) == pytest.approx(0, abs=SLACK)
    assert float(enclose(x**2, {x: (F(-1), F(2))}).upper()) == pytest.approx(4)
    assert float(enclose(x**3, {x: (F(-1), F(2))}).lower()) == pytest.approx(-1)


@pytest.mark.parametrize("number", [sp.pi, sp.E, sp.sqrt(2) * sp.exp(sp.Rational(1, 3)), sp.Rational(1, 3)], ids=str)
def test_numbers(number):
    for bits in (53, 200):
        with flint.ctx.workprec(bits):
            found = enclose(number + sp.Symbol(f"x{bits}"), {sp.Symbol(f"x{bits}"): (F(0), F(0))})
            assert found.overlaps(exact(number, {}))
            assert float(found.rad()) < 2.0 ** (4 - bits)


@pytest.mark.parametrize("expression", [sp.gamma(x), sp.Integer(2) ** x, x**sp.pi, SignedPower(x, sp.sqrt(2))], ids=str)
def test_what_has_no_enclosure_is_said(expression):
    with pytest.raises(UnsupportedError, match="no enclosure for"):
        enclose(expression, {x: (F(1), F(2))})


MAXIMA = [
    (x * (1 - x), {x: (F(0), F(1))}, 0.25),
    (x**2 - 3, {x: (F(-1), F(1))}, 3),
    (sp.sin(x), {x: (F(0), F(4))}, 1),
    (x * sp.exp(-x), {x: (F(0), F(5))}, 0.36787944117144233),
    (x * y - x, {x: (F(-1), F(1)), y: (F(-2), F(2))}, 3),
    (SignedPower(x, sp.Rational(1, 3)) - x, {x: (F(-1), F(1))}, 0.38490017945975052),  # at 3^{-3/2}: 2/3^{3/2}
    (-AbsolutePower(x, sp.Rational(3, 2)), {x: (F(-4), F(1))}, 8),
    (sp.Max(x, 1 - x), {x: (F(0), F(1))}, 1),
    (x * (sp.Rational(33, 10) - x), {x: (F(2), F(3))}, 2.6),  # at the end; larger values lie outside
    (sp.Integer(0) * x, {x: (F(0), F(1))}, 0),
    (sp.Integer(-2), {}, 2),
]


@pytest.mark.parametrize(("expression", "box", "largest"), MAXIMA, ids=lambda v: str(v)[:30])
def test_known_maxima_are_bounded_within_the_tolerance(expression, box, largest):
    bound = float(upper_bound(expression, box, tolerance=F(1, 100), pieces=3000))
    assert largest * (1 - 1e-12) <= bound <= largest * 1.0101


@settings(max_examples=40, deadline=None)
@given(expressions, intervals, intervals)
def test_a_bound_is_never_below_a_dense_sample(expression, first, second):
    box = {x: first, y: second}
    try:
        bound = upper_bound(expression, box, pieces=8)
    except ValueError:
        return
    numeric = sp.lambdify((x, y), expression.replace(SignedPower, signed).replace(AbsolutePower, absolute), "mpmath")
    numeric_steps = [F(i, 8) for i in range(9)]
    for i in numeric_steps:
        for j in numeric_steps:
            at = [float(low + share * (high - low)) for share, (low, high) in ((i, first), (j, second))]
            assert abs(numeric(*at)) <= float(bound) * (1 + 1e-9) + 1e-9


def signed(base, exponent):
    return sp.sign(base) * sp.Abs(base) ** exponent


def absolute(base, exponent):
    return sp.Abs(base) ** exponent


def test_an_early_stop_is_rigorous_too():
    assert upper_bound(x * (1 - x), {x: (F(0), F(1))}, pieces=0) >= F(1, 4)


# ---------------------------------------------------------------- powers from their ends


ENDS = [
    (F(1), F(2)),
    (F(-2), F(-1)),
    (F(-1), F(2)),
    (F(-2), F(1)),
    (F(0), F(2)),
    (F(-2), F(0)),
    (F(0), F(0)),
    (F(3), F(3)),
]


@pytest.mark.parametrize("exponent", ["1/3", "1/2", "1", "3/2", "5/2"])
@pytest.mark.parametrize("ends", ENDS, ids=str)
def test_powers_of_an_interval_by_their_ends(ends, exponent):
    """|x|^a grows away from zero, ⌈x⌋^a everywhere; an end at zero is rounded outward by 30 bits of the interval."""
    low, high = map(float, ends)
    a = float(F(exponent))
    slack = max(SLACK, (4 * 2.0**-30) ** a)
    absolute = enclose(AbsolutePower(x, sp.Rational(exponent)), {x: ends})
    least, most = sorted((abs(low) ** a, abs(high) ** a))
    assert float(absolute.lower()) == pytest.approx(0 if low <= 0 <= high else least, abs=slack)
    assert float(absolute.upper()) == pytest.approx(most, abs=slack)
    signed = enclose(SignedPower(x, sp.Rational(exponent)), {x: ends})
    assert float(signed.lower()) == pytest.approx(abs(low) ** a * (-1 if low < 0 else 1), abs=slack)
    assert float(signed.upper()) == pytest.approx(abs(high) ** a * (-1 if high < 0 else 1), abs=slack)


@pytest.mark.parametrize("ends", [(F(1), F(4)), (F(-4), F(-1))], ids=str)
def test_negative_powers_of_an_interval_without_zero(ends):
    sign = 1 if ends[0] > 0 else -1
    for found, factor in (
        (enclose(AbsolutePower(x, -HALF), {x: ends}), 1),
        (enclose(SignedPower(x, -HALF), {x: ends}), sign),
    ):
        assert sorted(map(float, (factor * found.lower(), factor * found.upper()))) == pytest.approx(
            [0.5, 1], abs=SLACK
        )


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, -1, -2, -3])
@pytest.mark.parametrize("ends", [(F(1), F(2)), (F(-2), F(-1)), (F(-1), F(2)), (F(-3), F(1))], ids=str)
def test_whole_powers_of_an_interval_by_their_ends(ends, n):
    found = enclose(x**n, {x: ends})
    if n < 0 and ends[0] < 0 < ends[1]:
        assert not found.is_finite()
        return
    values = [float(end) ** n for end in ends] + ([0.0] if n % 2 == 0 and ends[0] < 0 < ends[1] else [])
    assert [float(found.lower()), float(found.upper())] == pytest.approx([min(values), max(values)], abs=300 * SLACK)


def test_the_size_to_the_power_zero_is_one():
    for ends in ((F(1), F(2)), (F(-2), F(-1))):
        found = enclose(sp.Add(AbsolutePower(x, 0, evaluate=False), y, evaluate=False), {x: ends, y: (F(0), F(0))})
        assert [float(found.lower()), float(found.upper())] == pytest.approx([1, 1], abs=SLACK)
    about = enclose(sp.Add(AbsolutePower(x, 0, evaluate=False), y, evaluate=False), {x: (F(-1), F(1)), y: (F(0), F(0))})
    assert -SLACK < about.lower() <= 1 <= about.upper() < 1 + SLACK


def test_what_is_not_finite_stays_so():
    """1/x over an interval with zero, under a signed power."""
    for kind in (SignedPower, AbsolutePower):
        for exponent in (sp.Rational(1, 3), sp.Integer(0)):
            undefined = sp.Add(kind(1 / x, exponent, evaluate=False), y, evaluate=False)
            assert not enclose(undefined, {x: (F(-1), F(1)), y: (F(0), F(0))}).is_finite()


def test_numbers_are_enclosed():
    for number in (
        sp.Rational(1, 3),
        sp.Float("0.1"),
        sp.pi,
        sp.E,
        sp.sqrt(2),
        sp.exp(sp.Rational(1, 3)),
        sp.cos(1) + 2,
    ):
        found = enclose(number * x, {x: (F(1), F(1))})
        assert float(found.upper() - found.lower()) < 1e-7
        assert found.overlaps(flint.arb(str(sp.N(number, 30)), "1e-20"))


def test_a_bound_stops_near_a_value_that_is_attained():
    """x (1 - x) on [0, 1]: 1/4 within a hundredth, or within what is asked."""
    for options, share in (
        ({}, F(1, 100)),
        ({"tolerance": F(1, 10**4)}, F(1, 10**4)),
        ({"tolerance": F(1, 2)}, F(1, 2)),
    ):
        found = upper_bound(x * (1 - x), {x: (F(0), F(1))}, **options)
        assert F(1, 4) <= found <= F(1, 4) * (1 + (share or F(1, 100)))
    one = upper_bound(x * (1 - x), {x: (F(0), F(1))}, pieces=1)
    assert F(1, 4) * F(11, 10) < one <= 1


@pytest.mark.parametrize(
    ("limit", "least", "most"),
    [(F(2), 1, 1.001), (F(1), 0.5, 0.501), (F(1, 2), 0.375, 0.376), (F(1, 4), 1, 1.001), (F(1, 8), 1, 1.001)],
)
def test_beside_a_limit_a_bound_stops_once_that_is_decided(limit, least, most):
    """x (1 − x) on [0, 1]: at most 1, halved 1/2, halved again 3/8; it attains 1/4, so no bound is below that."""
    found = upper_bound(x * (1 - x), {x: (F(0), F(1))}, limit=limit)
    assert least <= found <= most
    assert (found < limit) == (limit > F(1, 4))


def test_beside_a_limit_a_bound_is_found_where_the_first_is_not_finite():
    """1/(1 + x − 4x²) on [0, 3/5]: 25/4 at the end, and in the middle more than the limit from the first on."""
    expression, box = 1 / (1 + x - 4 * x**2), {x: (F(0), F(3, 5))}
    assert not enclose(expression, box).is_finite()
    assert upper_bound(expression, box, limit=F(1, 2)) >= F(25, 4)


@pytest.mark.parametrize("tolerance", [F(0), F(1, 2)])
@pytest.mark.parametrize("value", [0, -7])
def test_the_search_ends_where_the_bound_is_attained(value, tolerance):
    assert upper_bound(sp.Integer(value) + 0 * x, {x: (F(0), F(1))}, tolerance=tolerance, pieces=10**9) == abs(value)


@pytest.mark.parametrize("order", [(x, y), (y, x)], ids=str)
def test_the_range_that_lowers_the_bound_most_is_cut(order):
    """x (1 − x) + 100 y: 101, but 100.5 once x is halved, and at most 100.375 once both halves are."""
    box = {symbol: (F(0), F(1)) for symbol in order}
    found = upper_bound(x * (1 - x) + 100 * y, box, tolerance=F(1, 10**6), pieces=3)
    assert F(401, 4) <= found <= F(1003751, 10**4)


def test_a_point_whose_bound_is_not_attained_is_kept():
    found = upper_bound(sp.exp(x), {x: (F(1), F(1))}, tolerance=F(0), pieces=3)
    assert 0 < float(found - F("2.718281828459045235360287")) < 1e-14


def test_a_bound_is_of_the_size():
    assert F(4) <= upper_bound(-(x**2), {x: (F(-2), F(1))}) <= F(404, 100)
    assert F(3) <= upper_bound(x - y, {x: (F(0), F(1)), y: (F(1), F(3))}) <= F(303, 100)
    assert upper_bound(sp.Integer(-7), {}) == 7
    assert upper_bound(x, {x: (F(5), F(5)), y: (F(0), F(1))}) == 5


def test_the_sign_of_zero_alone_is_any():
    found = enclose(SignedPower(x, 0), {x: (F(0), F(0))})
    assert [float(found.lower()), float(found.upper())] == pytest.approx([-1, 1], abs=SLACK)


@pytest.mark.parametrize("expression", [SignedPower(sp.Abs(x), 0), SignedPower(y - sp.Abs(x), 0)], ids=str)
def test_the_sign_at_an_end_that_is_zero_exactly_is_any(expression):
    found = enclose(expression, {x: (F(-1), F(1)), y: (F(0), F(0))})
    assert [float(found.lower()), float(found.upper())] == pytest.approx([-1, 1], abs=SLACK)


def test_the_first_power_is_no_reciprocal():
    assert float(enclose(sp.Pow(x, 1, evaluate=False), {x: (F(4), F(4))})) == 4


def test_bounds_beyond_a_size_are_zero_or_none():
    """Such numbers have balls, but as rationals they would fill the memory."""
    far = {x: (F(10**6), F(2 * 10**6))}
    assert upper_bound(sp.exp(-x), far, pieces=3) == F(1, 2**4096)
    assert upper_bound(1 + sp.exp(-x), far) <= 1 + F(1, 2**50)
    with pytest.raises(ParameterError, match="no finite bound"):
        upper_bound(sp.exp(x), far, pieces=3)


def test_floats_of_more_digits_than_python_s_are_enclosed():
    assert upper_bound(sp.Float("1.00000000000000000001", 30) - 1, {}) > 0
    assert upper_bound(x * sp.Float("1e-400"), {x: (F(0), F(10**400))}) >= F(1, 2)
