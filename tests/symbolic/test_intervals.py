"""Enclosures over bounded and unbounded boxes hold every value, and attained ends exactly."""

from fractions import Fraction as F
from itertools import combinations_with_replacement, product
from math import inf

import mpmath
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from thinned import few

from quakedesign.errors import UnsupportedError
from quakedesign.symbolic import AbsolutePower, SignedPower
from quakedesign.symbolic.enclosure import EVERYTHING, add, interval, negative, regular, times

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
    "number", [sp.pi, sp.E, sp.exp(sp.Rational(1, 3)), sp.asinh(2), sp.sqrt(2), sp.cbrt(7), sp.sinh(-1)], ids=str
)
def test_irrational_numbers_lie_strictly_inside_of_narrow_intervals(number):
    low, high = interval(number, {})
    assert sp.Rational(low.numerator, low.denominator) < number < sp.Rational(high.numerator, high.denominator)
    assert high - low < F(1, 10**45)


def test_floats_of_more_digits_than_python_s_are_enclosed():
    long = sp.Float("0.1234567890123456789", 30)
    low, high = interval(long, {})
    assert low <= F(sp.Rational(long).p, sp.Rational(long).q) <= high
    assert interval(1 / (x * sp.Float("1e-400")), {x: (F(1), F(1))})[0] > 10**399


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


@settings(max_examples=2 * settings.default.max_examples, deadline=None)
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


# ---------------------------------------------------------------- hulls of samples

ENDS = (-inf, F(-2), F(-1, 3), F(0), F(1, 2), F(3), inf)
BOXES = [(low, high) for low, high in combinations_with_replacement(ENDS, 2) if low < inf and high > -inf]
FAR = 10**12, 10**24


def samples(box, far):
    """Ends of an interval, in place of infinite ones a point far out, and points beside zero."""
    low, high = box
    points = {max(low, F(-far)), min(high, F(far)), *(p for p in (F(-1, far), F(0), F(1, far)) if low <= p <= high)}
    return [mpmath.mpf(p.numerator) / p.denominator for p in sorted(points)]


def limit(near, further):
    """Where the extreme of samples goes as they lie further out."""
    if abs(further) > abs(near) * 3 / 2:
        return inf if further > 0 else -inf
    return mpmath.mpf(0) if abs(further) <= abs(near) / 2 else near


def hull(function, *boxes):
    """The least interval around all values, but where the function has none."""
    with mpmath.workdps(60):
        found = []
        for far in FAR:
            values = [function(*point) for point in product(*(samples(box, far) for box in boxes))]
            known = [value for value in values if value is not None]
            if not known or any(isinstance(value, mpmath.mpc) for value in known):
                return EVERYTHING
            found.append((min(known), max(known)))
        return tuple(limit(*ends) for ends in zip(*found, strict=True))


def is_hull(found, expected):
    """Whether ends are fractions or infinite, not inside of the hull, and at most 1e-40 outside."""
    return all(type(end) is F or abs(end) == inf for end in found) and all(
        _is_end(end, other, outer) for end, other, outer in zip(found, expected, (-1, 1), strict=True)
    )


def _is_end(end, other, outer):
    if isinstance(end, float) or isinstance(other, float):
        return end == other
    with mpmath.workdps(60):
        beyond = outer * (mpmath.mpf(end.numerator) / end.denominator - other)
        return -1e-55 * (1 + abs(other)) <= beyond <= 1e-40 * (1 + abs(other))


def signed(exponent):
    return lambda v: mpmath.sign(v) * abs(v) ** exponent if v or exponent > 0 else None


def plain(exponent):
    return lambda v: v**exponent if v or exponent > 0 else None


HALF, THIRD = sp.Rational(1, 2), sp.Rational(1, 3)
FUNCTIONS = {
    **{x**n: plain(n) for n in (2, 3, -1, -2, -3)},
    sp.sqrt(x): plain(mpmath.mpf("0.5")),
    x ** sp.Rational(3, 2): plain(mpmath.mpf("1.5")),
    1 / sp.sqrt(x): plain(mpmath.mpf("-0.5")),
    sp.Abs(x): abs,
    **{SignedPower(x, n): signed(n) for n in (2, 3, -1, -2)},
    SignedPower(x, HALF): signed(mpmath.mpf("0.5")),
    **{AbsolutePower(x, n): lambda v, n=n: plain(n)(abs(v)) for n in (1, 3, -1, -2)},
    AbsolutePower(x, HALF): lambda v: abs(v) ** mpmath.mpf("0.5"),
    sp.exp(x): mpmath.exp,
    sp.log(x): lambda v: mpmath.log(v) if v else None,
    sp.asinh(x): mpmath.asinh,
    sp.sinh(x): mpmath.sinh,
    sp.cosh(x): mpmath.cosh,
    sp.tanh(x): mpmath.tanh,
}


@pytest.mark.parametrize("expression", FUNCTIONS, ids=str)
def test_functions_that_run_one_way_on_each_side_of_zero_have_their_hull(expression):
    for box in BOXES:
        assert is_hull(interval(expression, {x: box}), hull(FUNCTIONS[expression], box))


@few(
    ("expression", "function"),
    [
        (x + y, lambda a, b: a + b),
        (x * y, lambda a, b: a * b),
        (sp.Max(x, y), max),
        (sp.Min(x, y), min),
        (x * y + x, lambda a, b: a * b + a),
    ],
    ids=("sum", "product", "larger", "smaller", "both"),
    every=3,
)
def test_pairs_of_intervals_have_their_hull(expression, function):
    """For x·y + x the enclosure is that of the sum of two hulls."""
    for one, other in product(BOXES, repeat=2):
        expected = hull(function, one, other)
        if expression == x * y + x:
            expected = add(times(one, other), one)
        assert is_hull(interval(expression, {x: one, y: other}), expected)


def test_cube_roots_are_enclosed_to_the_same_digits():
    found = interval(sp.cbrt(x), {x: (F(0), F(2))})
    assert found[0] == 0
    assert 0 < found[1] ** 3 - 2 < F(1, 10**70)


def test_jumps_are_told_from_the_sides_of_the_box():
    """Both values where the jump is within, or nothing is beside it; the side's own where it is an end."""
    for low, high in BOXES:
        below, above = low < 0 or high <= 0, high > 0 or low >= 0
        if low < high:
            below, above = low < 0, high > 0
        elif low != 0:
            below, above = low < 0, low > 0
        inside = below and above
        box = {x: (low, high)}
        assert interval(sp.Heaviside(x), box) == (F(not below), F(above))
        assert interval(sp.sign(x), box) == interval(SignedPower(x, 0), box) == (-1 if below else 1, 1 if above else -1)
        assert interval(sp.DiracDelta(x), box) == (EVERYTHING if inside else (0, 0))


@pytest.mark.parametrize("wave", [sp.sin, sp.cos])
def test_waves_are_enclosed_closely_on_short_boxes_and_by_one_on_long_ones(wave):
    for box in (HALF_LINE, (-inf, F(0)), LINE, (F(-90), F(100))):
        assert interval(wave(x), {x: box}) == (-1, 1)
    low, high = interval(wave(x), {x: (F(1), F(1) + F(1, 10**6))})
    assert float(low) < min(wave(1.0), wave(1.000001)) < max(wave(1.0), wave(1.000001)) < float(high)
    assert high - low < F(1, 10**5)


def test_large_numbers_are_less_than_infinite():
    large = F(10**400)
    assert add((large, inf), (large, large)) == (2 * large, inf)
    assert add((-inf, -large), (-large, -large)) == (-inf, -2 * large)
    assert times((large, inf), (-1 / large, large)) == (-inf, inf)
    assert times((1 / large, large), (large, inf)) == (1, inf)
    assert times((F(0), large), (F(1), inf)) == times((F(1), inf), (F(0), large)) == (0, inf)
    assert negative((-inf, large)) == (-large, inf)
    assert interval(sp.exp(sp.exp(x)), {x: (F(100), F(200))})[1] == inf
    assert interval(-sp.exp(sp.exp(x)), {x: (F(100), F(200))})[0] == -inf


def test_long_ends_are_rounded_outwards_and_shorter_ones_kept():
    short, long = F(3**80, 2**127 - 1), F(3**130 + 1, 2**203 + 1)
    assert interval(x**6, {x: (-short, short)}) == (0, short**6)
    low, high = interval(x**5, {x: (-long, long)})
    assert high > long**5 == -((-long) ** 5) > -high
    assert low == -high
    assert high - long**5 < long**5 / 2**250
    assert max(high.numerator.bit_length(), high.denominator.bit_length()) < 700
    low, _ = interval(x**5, {x: (long, inf)})
    assert long**5 * (1 - F(1, 2**250)) < low < long**5


def test_ends_beyond_a_size_become_infinite_or_zero_or_stay_at_it():
    """As numbers with as many digits as they have bits they would fill the memory."""
    far, size = F(10**6), F(2) ** 4096
    assert interval(sp.exp(x), {x: (far, far)}) == (size, inf)
    assert interval(sp.exp(x), {x: (-far, -far)}) == (0, 1 / size)
    assert interval(sp.sinh(x), {x: (-far, far)}) == (-inf, inf)
    assert interval(sp.sinh(x), {x: (-far, -far)}) == (-inf, -size)
    assert interval(x**3, {x: (-size, 1 / size)}) == (-inf, 1 / size)
    assert interval(x**3, {x: (-1 / size, size)}) == (-1 / size, inf)
    assert interval(x, {x: (-size, size)}) == (-size, size)
    assert interval(2 * x, {x: (size / 2, 1.0)})[0] == size
    assert interval(x / 2, {x: (F(-2) / size, F(2) / size)}) == (-1 / size, 1 / size)
    assert interval(x / 2, {x: (F(-3) / size, F(3) / size)}) == (F(-3, 2) / size, F(3, 2) / size)
    assert interval(x / 2, {x: (F(-4) / size, F(4) / size)}) == (-2 / size, 2 / size)


REGULAR = {
    "power": (x**2, [(F(-1), F(1)), (F(0), F(1))], []),
    "line": (2 * x - 1, [(F(-1), F(1))], []),
    "pole": (1 / x, [(F(1, 2), F(1)), (F(-2), F(-1, 2))], [(F(0), F(1)), (F(-1), F(0)), (F(-1), F(1))]),
    "root": (sp.sqrt(x), [(F(1, 2), F(1))], [(F(0), F(1)), (F(-1), F(1))]),
    "logarithm": (sp.log(x), [(F(1, 2), F(1))], [(F(0), F(1)), (F(-1), F(1))]),
    "jump": (SignedPower(x, 0), [(F(1, 2), F(1))], [(F(-1), F(1)), (F(0), F(1))]),
    "kink": (AbsolutePower(x, 1), [(F(-1), F(1))], []),
    "infinite slope": (SignedPower(x, HALF), [(F(-1), F(-1, 2))], [(F(-1), F(1)), (F(-1), F(0))]),
    "two": (sp.log(x) + 1 / (x - 2), [(F(1, 2), F(1))], [(F(0), F(1)), (F(1), F(2)), (F(1), F(3))]),
    "numbers": (sp.sqrt(2) * x + sp.log(3) + sp.pi, [(F(-1), F(1))], []),
}


@pytest.mark.parametrize(("expression", "yes", "no"), REGULAR.values(), ids=REGULAR)
def test_where_derivatives_tell_how_it_runs(expression, yes, no):
    assert all(regular(expression, {x: box}) for box in yes)
    assert not any(regular(expression, {x: box}) for box in no)
