"""Bounds on ratios of forms: closed forms, and dense sampling by numpy."""

import math
from fractions import Fraction as F
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from quakedesign.lyapunov.exact.forms import Form, _bound, _FormPower, largest_ratio


def form(polynomial, variables, degree, sizes=None):
    return Form.of({e: F(c) for e, c in polynomial.items()}, variables, degree, sizes or (F(1),) * variables)


def power(variables, degree):
    """(s_1 + … )^degree, which is 1 on the simplex."""
    from math import factorial, prod

    exponents = (e for e in product(range(degree + 1), repeat=variables) if sum(e) == degree)
    return {e: factorial(degree) // prod(factorial(k) for k in e) for e in exponents}


@pytest.mark.parametrize(
    ("top", "bottom", "powers", "exact"),
    [
        ({(1, 1): 1}, {(2, 0): 1, (0, 2): 1}, (1, -1), 1 / 2),  # xy/(x² + y²)
        ({(1, 1, 1): -1}, power(3, 3), (1, -1), 1 / 27),  # arithmetic and geometric mean
        ({(4, 0): 1, (0, 4): 1}, {(5, 0): 1, (0, 5): 1}, (1, F(-4, 5)), 2**0.2),  # norms of order 4 and 5
        ({(2, 1): 3, (1, 2): -3}, power(2, 3), (1, -1), 1 / 12**0.5),  # 3xy(x − y) with x − y = 3^−½
        ({(1, 0): 1}, {(1, 0): 2, (0, 1): 1}, (1, -1), 1 / 2),  # at a corner, zero at the other
        ({(2, 0): 1, (0, 2): 1}, {(1, 0): 1, (0, 1): 2}, (F(1, 2), -2), 1),  # at a corner, with other powers
    ],
)
def test_known_maxima(top, bottom, powers, exact):
    size = len(next(iter(top)))
    forms = [form(p, size, sum(next(iter(p)))) for p in (top, bottom)]
    found = float(largest_ratio([(forms, [F(p) for p in powers])], tolerance=F(1, 1000)))
    assert exact * (1 - 1e-12) <= found <= exact * 1.0015


def values(polynomial, points):
    return sum(
        float(c) * np.prod([x**k for x, k in zip(points, e, strict=True)], axis=0) for e, c in polynomial.items()
    )


@pytest.mark.parametrize("seed", range(5))
def test_random_ratios_are_covered_and_not_loose(seed):
    rng = np.random.default_rng(seed)
    exponents = [e for e in product(range(5), repeat=3) if sum(e) == 4]
    top = {e: F(int(c), 7) for e, c in zip(exponents, rng.integers(-20, 21, len(exponents)), strict=True)}
    bottom = {e: F(int(c), 3) for e, c in zip(exponents, rng.integers(1, 30, len(exponents)), strict=True)}
    sizes = (F(3, 2), F(1, 4), F(2))
    points = rng.dirichlet([0.7, 0.7, 0.7], 100_000)
    points[:6000] = points[:6000].round(2)  # edges and corners too
    points[:3] = np.eye(3)
    points = points.T * np.array([[float(v)] for v in sizes])
    sampled = np.max(np.abs(values(top, points)) / values(bottom, points))
    forms = [form(p, 3, 4, sizes) for p in (top, bottom)]
    found = float(largest_ratio([(forms, (F(1), F(-1)))], tolerance=F(1, 50)))
    assert sampled <= found <= 1.03 * sampled


def test_the_largest_of_several_problems_counts():
    small, large = ({(1, 1): 1}, {(2, 0): 1, (0, 2): 1}), ({(1, 1): 3}, {(2, 0): 1, (0, 2): 1})
    problems = [([form(p, 2, 2) for p in pair], (F(1), F(-1))) for pair in (small, large)]
    assert float(largest_ratio(problems, tolerance=F(1, 100))) == pytest.approx(1.5, rel=0.02)


def test_the_largest_counts_before_anything_is_cut_too():
    problems = [([form({(1, 0): c, (0, 1): c}, 2, 1)], (F(1),)) for c in (3, 2, 5, 4)]
    assert largest_ratio(problems, pieces=0) == 5


ATTAINED = {
    "at a corner": ([{(1, 0): 1}, power(2, 1)], (1, -1), 1),
    "everywhere": ([power(2, 1)], (F(3, 7),), 1),
    "zero": ([{}], (1,), 0),
    "root of zero": ([{}], (F(1, 2),), 0),
    "power zero": ([{(1, 0): 1, (0, 1): -1}], (0,), 1),
}


@pytest.mark.parametrize("tolerance", [F(0), F(1, 2)])
@pytest.mark.parametrize(("polynomials", "powers", "exact"), ATTAINED.values(), ids=ATTAINED)
def test_the_search_ends_where_the_bound_is_attained(polynomials, powers, exact, tolerance):
    problem = [form(p, 2, 1) for p in polynomials], [F(p) for p in powers]
    assert largest_ratio([problem], tolerance=tolerance, pieces=10**9) == exact


@given(st.fractions(min_value=F(1, 10**9), max_value=10**9), st.sampled_from([F(1), F(-1), F(1, 3), F(-5, 2), F(4)]))
def test_a_bound_is_rounded_up_by_little(value, exponent):
    found = largest_ratio([([form({(1,): value}, 1, 1)], (exponent,))], pieces=0)
    exact = value**exponent.numerator
    assert exact <= found**exponent.denominator <= exact * (1 + F(1, 2**40))


def test_sizes_stretch_the_variables():
    """x²y + 4z³ at the corners of the simplex of (3/2, 1/4, 2) and at its middle, by hand."""
    found = form({(2, 1, 0): 1, (0, 0, 3): 4, (3, 0, 0): 8}, 3, 3, (F(3, 2), F(1, 4), F(2)))
    assert found.at_corners() == [27, 0, 32]
    half, _ = found.bisected((0, 1))
    assert half.at_corners() == [27, F(9, 16) * F(1, 8) + F(27, 8), 32]


def test_a_divisor_that_vanishes_has_no_bound():
    forms = [form({(2, 0): 1}, 2, 2), form({(2, 0): 1, (1, 1): -2, (0, 2): 1}, 2, 2)]
    assert largest_ratio([(forms, (F(1), F(-1)))], pieces=200) is None


@pytest.mark.parametrize("edge", [(0, 1), (1, 2), (0, 2)])
def test_halves_agree_with_the_whole(edge):
    rng = np.random.default_rng(5)
    polynomial = {e: F(int(rng.integers(-9, 10))) for e in product(range(4), repeat=3) if sum(e) == 3}
    whole = form(polynomial, 3, 3)
    corners = np.eye(3)
    middle = (corners[edge[0]] + corners[edge[1]]) / 2
    assert np.allclose([float(v) for v in whole.at_corners()], values(polynomial, corners))
    for half, replaced in zip(whole.bisected(edge), (edge[1], edge[0]), strict=True):
        cut = corners.copy()
        cut[replaced] = middle
        assert np.allclose([float(v) for v in half.at_corners()], values(polynomial, cut.T))
        weights = rng.dirichlet([1, 1, 1], 2000)
        inside = values(polynomial, (weights @ cut).T)
        assert float(half.least()) <= inside.min()
        assert np.abs(inside).max() <= float(half.largest())


@pytest.mark.parametrize("edge", [(0, 1), (0, 2), (1, 2)])
def test_halves_have_the_coefficients_of_what_is_substituted(edge):
    """Corners of a half put into the polynomial by SymPy."""
    t = sp.symbols("t0:3")
    places = [e for e in product(range(4), repeat=3) if sum(e) == 3]
    polynomial = {e: F((-1) ** n * (n + 2), n + 1) for n, e in enumerate(places)}
    middle = [F(i in edge, 2) for i in range(3)]
    for half, moved in zip(form(polynomial, 3, 3).bisected(edge), reversed(edge), strict=True):
        corners = [middle if i == moved else [F(i == j) for j in range(3)] for i in range(3)]
        at = [sum(sp.Rational(c[i]) * v for c, v in zip(corners, t, strict=True)) for i in range(3)]
        inside = sum(sp.Rational(c) * sp.prod(x**k for x, k in zip(at, e, strict=True)) for e, c in polynomial.items())
        whole = form({e: F(int(c.p), int(c.q)) for e, c in sp.Poly(inside, *t).terms()}, 3, 3)
        assert [c * half.scale for c in half.coefficients] == [c * whole.scale for c in whole.coefficients]


@pytest.mark.parametrize("exponent", [2, 3])
def test_a_bound_below_the_smallest_normal_float_is_rounded_up(exponent):
    """Subnormal numbers have few digits: the nearest one is below the bound in about half of all cases."""
    power = _FormPower.of(F(exponent))
    for k in range(1, 60):
        size = float(f"{k}e-{322 // exponent}")
        bound = _bound([SimpleNamespace(largest=lambda size=size: size)], [power])
        assert F(math.nextafter(bound, 0)) < F(size) ** exponent <= F(bound)


def test_the_form_of_zero_is_zero():
    assert (form({}, 2, 3).least(), form({}, 2, 3).largest()) == (0, 0)
    assert float(largest_ratio([([form({}, 2, 2), form(power(2, 2), 2, 2)], [F(1), F(-1)])])) < 1e-9


def test_values_at_the_corners_are_the_coefficients_of_pure_powers():
    """6x² + 10xy + 9y² has the values 6 and 9, whatever scale its integer coefficients share."""
    assert form({(2, 0): 6, (1, 1): 10, (0, 2): 9}, 2, 2).at_corners() == [6, 9]
    assert form({(1, 0): 6, (0, 1): 9}, 2, 1).at_corners() == [6, 9]
