"""Exact matrices against NumPy and against textbooks."""

from fractions import Fraction as F

import numpy as np
import pytest

from quakedesign.linear import linear_problem as m

RNG = np.random.default_rng(3)


def random(n, k=None):
    return tuple(tuple(F(int(v), 7) for v in row) for row in RNG.integers(-20, 20, (n, k or n)))


def floats(a):
    return np.array(a, dtype=float)


def test_products_and_sums_agree_with_floating_point():
    a, b, c = random(4), random(4), random(4)
    assert floats(m.matrix_product(a, b, c)) == pytest.approx(floats(a) @ floats(b) @ floats(c))
    assert floats(m.total(a, b, m.times(-2, c))) == pytest.approx(floats(a) + floats(b) - 2 * floats(c))
    assert floats(m.lyapunov(a, m.diagonal((F(1), F(2), F(3), F(4))))) == pytest.approx(
        floats(a).T @ np.diag([1, 2, 3, 4]) + np.diag([1, 2, 3, 4]) @ floats(a)
    )
    assert float(m.trace_of_product(m.total(a, m.transpose(a)), m.total(b, m.transpose(b)))) == pytest.approx(
        np.trace((floats(a) + floats(a).T) @ (floats(b) + floats(b).T))
    )


@pytest.mark.parametrize("scale", [F(1), F(1, 10**40), F(10**40)])
def test_the_norm_is_an_upper_bound_and_tight(scale):
    a = m.times(scale, random(3))
    square = sum(v * v for row in a for v in row)
    assert square <= m.frobenius(a) ** 2 <= square * (1 + F(1, 10**12))
    assert m.frobenius(((F(0),),)) == 0


def test_the_routh_test_agrees_with_the_roots():
    for _ in range(300):
        roots = RNG.normal(size=2).tolist()
        pair = complex(RNG.normal(), RNG.normal())
        polynomial = [F(float(c)) for c in np.poly([*roots, pair, pair.conjugate()]).real]
        found = np.roots([float(c) for c in polynomial]).real.max()
        assert m.hurwitz(polynomial) == (found < 0)


def test_the_routh_test_refuses_roots_on_the_axis():
    assert not m.hurwitz([F(1), F(0), F(1)])
    assert not m.hurwitz([F(1), F(1), F(0)])
    assert m.hurwitz([F(-1), F(-2)])
    assert m.hurwitz([F(1), F(3), F(3), F(1)])
    assert m.hurwitz([F(-1), F(-2), F(-3)])
    assert m.hurwitz([F(1, 2), F(1), F(1)])
    assert not m.hurwitz([F(-1), F(2)])


def test_the_characteristic_polynomial_of_a_companion_matrix():
    companion = ((F(0), F(1), F(0)), (F(0), F(0), F(1)), (F(-5), F(-3), F(-2)))
    assert m.characteristic(companion) == (1, 2, 3, 5)


def test_rounding_keeps_symmetry_and_digits():
    a = np.array([[1e12, 3.3], [3.3, 1e-9]]) * 1.2345678901234567
    found = m.rounded(a, 40)
    assert found[0][1] == found[1][0]
    assert floats(found) == pytest.approx(a, rel=1e-9, abs=1e-9)
