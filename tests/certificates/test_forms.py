"""Bounds on ratios of forms: closed forms, and dense sampling by numpy."""

from fractions import Fraction as F
from itertools import product

import numpy as np
import pytest

from quakedesign.certificates.forms import Form, largest_ratio


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
