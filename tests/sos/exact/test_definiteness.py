"""Definiteness against determinants of leading blocks, which another library computes."""

from fractions import Fraction as F

import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from quakedesign.sos.exact.polynomial import full_matrix, over_common_denominator, positive_definite

entries = st.fractions(-3, 3, max_denominator=5)


@st.composite
def triangles(draw):
    size = draw(st.integers(1, 4))
    count = size * (size + 1) // 2
    return size, draw(st.lists(entries, min_size=count, max_size=count))


def by_determinants(rows):
    """Sylvester: every leading minor is positive."""
    matrix = sp.Matrix([[sp.Rational(v.numerator, v.denominator) for v in row] for row in rows])
    return all(matrix[:k, :k].det() > 0 for k in range(1, len(rows) + 1))


@given(triangles(), st.integers(0, 8))
def test_a_symmetric_matrix_is_definite_where_its_leading_minors_are_positive(triangle, lift):
    size, upper = triangle
    rows = full_matrix(upper, size)
    assert all(rows[i][j] == rows[j][i] for i in range(size) for j in range(size))
    assert [rows[i][j] for i in range(size) for j in range(i, size)] == upper
    lifted = [[v + lift * (i == j) for j, v in enumerate(row)] for i, row in enumerate(rows)]
    assert positive_definite(lifted) == by_determinants(lifted)


@pytest.mark.parametrize("size", [1, 2, 3, 7, 20])
def test_the_edge_of_definiteness_is_found_exactly(size):
    """1 + (n − 1)c is an eigenvalue of the matrix of ones on the diagonal and c elsewhere, 1 − c are the others."""
    edge = F(-1, size - 1) if size > 1 else F(-1)
    for c, expected in ((edge + F(1, 10**30), True), (edge, size == 1), (edge - F(1, 10**30), size == 1)):
        assert positive_definite([[F(1) if i == j else c for j in range(size)] for i in range(size)]) is expected
    assert not positive_definite([[F(1)] * size] * size) or size == 1
    assert not positive_definite([[F(0)] * size] * size)


@given(st.lists(st.fractions(), min_size=1))
def test_integers_over_a_common_denominator_are_the_numbers(values):
    integers, denominator = over_common_denominator(values)
    assert [F(n, denominator) for n in integers] == values
    assert denominator == sp.ilcm(1, *(v.denominator for v in values))


def test_a_triangle_of_another_size_is_refused():
    with pytest.raises(ValueError, match="6 entries"):
        full_matrix([F(1)] * 5, 3)
