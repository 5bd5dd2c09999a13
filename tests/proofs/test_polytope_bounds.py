"""Upper bounds of linear functions on polytopes in the standalone checker, against exact vertices."""

from fractions import Fraction as F
from itertools import combinations, product
from random import Random

import numpy as np
import pytest
from standalone_guarantee import CHECK

POLYTOPE = CHECK.beside("guarantee.polytope")
ONE, NOTHING = POLYTOPE.ONE, POLYTOPE.NOTHING
Near, Function = POLYTOPE.Near, POLYTOPE.Function


def determinant(m):
    if len(m) == 1:
        return m[0][0]
    return sum((-1) ** j * m[0][j] * determinant([row[:j] + row[j + 1 :] for row in m[1:]]) for j in range(len(m)))


def vertices(constraints):
    """All of them, by Cramer's rule."""
    found, n = [], len(constraints[0][0])
    for basis in combinations(range(len(constraints)), n):
        rows, ends = [list(constraints[j][0]) for j in basis], [constraints[j][1] for j in basis]
        if whole := determinant(rows):
            place = [
                determinant([[*row[:i], end, *row[i + 1 :]] for row, end in zip(rows, ends, strict=True)]) / whole
                for i in range(n)
            ]
            if all(sum(a * b for a, b in zip(row, place, strict=True)) <= end for row, end in constraints):
                found.append((basis, place))
    return found


def cut_box(random, cuts):
    """Facets n·z <= 1 of a box and of cuts through it, and y >= 0 as the last constraint."""
    sizes = [F(random.randint(1, 9), random.randint(1, 9)) for _ in range(3)]
    facets = [[sign * (i == j) / sizes[j] for j in range(3)] for sign in (1, -1) for i in range(3)]
    facets += [[F(random.randint(-9, 9), 13) / size for size in sizes] for _ in range(cuts)]
    return [*((row, F(1)) for row in facets), ([F(0), F(-1), F(0)], F(0))], sizes


def made(random, cuts):
    constraints, sizes = cut_box(random, cuts)
    corners = vertices(constraints)
    polytope = POLYTOPE.Polytope(constraints, sizes, [0, 1, 0], [basis for basis, _ in corners])
    return polytope, [place for _, place in corners]


def some_function(random, uncertain):
    row = [F(random.randint(-99, 99), random.randint(1, 99)) for _ in range(3)]
    more = [Near(random.randint(-ONE, ONE), random.randint(0, ONE >> 30)) if uncertain else NOTHING for _ in range(3)]
    return Function(row, F(random.randint(-99, 99), 7), more, more[0])


def exact(function, place):
    """Largest value at a point, with every number as large as it may be."""
    known = sum((F(m.at, ONE) + r) * z for r, m, z in zip(function.row, function.more, place, strict=True))
    off = sum(F(m.off, ONE) * abs(z) for m, z in zip(function.more, place, strict=True))
    return known + off + function.constant + F(function.beside.at + function.beside.off, ONE)


@pytest.mark.parametrize("uncertain", [False, True])
def test_a_bound_is_never_below_the_largest_value_and_hardly_above_it(uncertain):
    """The multipliers have 40 binary places, so a bound exceeds the value by about 2^-40 of the function."""
    random, nearest = Random(1), []
    for _ in range(12):
        polytope, places = made(random, random.randint(0, 3))
        for _ in range(6):
            function = some_function(random, uncertain)
            bound, value = F(polytope.largest(function), ONE), max(exact(function, place) for place in places)
            assert bound >= value
            nearest.append(float((bound - value) / (1 + sum(map(abs, function.row)))))
    assert max(nearest) < (1e-6 if uncertain else 1e-9)


def test_a_bound_by_integers_that_touches_the_value_is_above_it_by_few_units():
    """A facet itself is largest on the facet: its multiplier is 1, and only the rounding of its numbers remains."""
    random = Random(2)
    for _ in range(8):
        polytope, places = made(random, 2)
        for row, _ in polytope.lines[:-1]:
            function = Function(row, F(0), [NOTHING] * 3)
            if max(exact(function, place) for place in places) == 1:  # some cuts do not meet the box
                assert 0 <= polytope.largest(function) - ONE <= 40


def test_multipliers_bound_a_function_whatever_was_rounded():
    """Rows and ends are up to one unit above their integers: the largest of Σ s_j·end_j + Σ |f_i − Σ s_j·row_ji|."""
    random = Random(7)
    for _ in range(20):
        polytope, _ = made(random, 2)
        scaled = [Near(random.randint(-9 * ONE, 9 * ONE), random.randint(0, 99)) for _ in range(3)]
        floats = [f.at / ONE for f in scaled]
        for number, (_, basis, columns) in enumerate(polytope.found):
            raw = [sum(map(float.__mul__, floats, column)) for column in columns]
            shares = [F(max(round(v * (1 << POLYTOPE.GRAIN)), 0), 1 << POLYTOPE.GRAIN) for v in raw]
            worst = sum(share * (polytope.ends[j] + 1) for share, j in zip(shares, basis, strict=True))
            for i, (f, sign) in enumerate(zip(scaled, polytope.signs, strict=True)):
                middle = f.at - sum(share * polytope.rows[j][i] for share, j in zip(shares, basis, strict=True))
                ends = middle + f.off, middle - f.off - sum(shares)
                worst += max(ends[0], F(0)) if sign else max(map(abs, ends))
            assert 0 <= polytope.by_vertex(scaled, floats, number) - worst <= 12 + 3 * sum(shares)


@pytest.mark.parametrize("steep", [F(-2), F(-1, 3), F(1, 5), F(3)])
def test_the_image_of_a_facet_is_bounded_by_the_facet_and_the_difference(steep):
    """Σ r_i·z_i is at most |r_i| times the size where the sign is open, and max(r_i, 0) times it where z_i >= 0."""
    random = Random(3)
    for _ in range(6):
        polytope, _ = made(random, 2)
        row, _ = polytope.lines[6]
        rest = [F(random.randint(-9, 9), 1000), steep / 1000, F(random.randint(-9, 9), 1000)]
        a, b, c = (r * size for r, size in zip(rest, polytope.sizes, strict=True))
        expected = 1 + F(-1, 2) + abs(a) + max(b, F(0)) + abs(c)
        for more in (NOTHING, Near(5 * ONE >> 20, 3)):
            slower = NOTHING if more == NOTHING else Near(-ONE >> 20, 3)
            function = Function([r + n for r, n in zip(rest, row, strict=True)], F(-1, 2), [NOTHING, slower, more])
            wider = abs(c + polytope.sizes[2] * F(more.at, ONE)) - abs(c) + polytope.sizes[2] * F(more.off, ONE)
            wider += max(b + polytope.sizes[1] * F(slower.at + slower.off, ONE), F(0)) - max(b, F(0))
            moved = [m.times(size) for m, size in zip(function.more, polytope.sizes, strict=True)]
            assert 0 <= polytope.second(function, moved, 6) - (expected + wider) * ONE <= 20
        found = polytope.largest(function, 6)
        assert found <= polytope.second(function, moved, 6)
        assert found <= max(polytope.largest(function), ONE)


@pytest.mark.parametrize(("r1", "r3"), list(product([F(-1, 9), F(1, 7)], [F(-1, 3), F(2, 5)])))
def test_the_slip_until_a_stop_counts_as_a_multiple_of_the_slip_rate(r1, r3):
    """On 0 <= δ <= g·y and 0 <= y <= Y: r1·y + r3·δ is at most max(r1 + g·max(r3, 0), 0)·Y."""
    g, sizes = F(3, 4), [F(2), F(1, 3), F(5), F(1, 2)]
    box = [([sign * F(i == j) / sizes[j] for j in range(4)], F(1)) for sign in (1, -1) for i in range(3)]
    ends = [([F(0), F(-1), F(0), F(0)], F(0)), ([F(0)] * 3 + [F(-1)], F(0)), ([F(0), -g, F(0), F(1)], F(0))]
    constraints = [*box, *ends]
    corners = vertices(constraints)
    polytope = POLYTOPE.Polytope(constraints, sizes, [0, 1, 0, 1], [basis for basis, _ in corners])
    row = [a + b for a, b in zip(constraints[0][0], [F(0), r1, F(0), r3], strict=True)]
    function = Function(row, F(-2), [NOTHING] * 4)
    expected = 1 - 2 + max(r1 + g * max(r3, F(0)), F(0)) * sizes[1]
    assert 0 <= polytope.second(function, [NOTHING] * 4, 0) - expected * ONE <= 4
    value = max(exact(function, place) for _, place in corners)
    assert F(polytope.largest(function, 0), ONE) == F(polytope.second(function, [NOTHING] * 4, 0), ONE) >= value
    plain = F(polytope.largest(function), ONE)
    assert value <= plain <= value + F(1, 10**9)


def test_a_vertex_beyond_a_constraint_is_not_used_and_one_vertex_at_least_is_needed():
    constraints, sizes = cut_box(Random(4), 0)
    constraints.insert(6, ([F(1, 2) / sizes[0], F(0), F(0)], F(1, 4)))  # half of the box
    inner, outer = [6, 1, 2], [0, 1, 2]  # x = 1/2 and x = 1, beyond the cut
    polytope = POLYTOPE.Polytope(constraints, sizes, [0, 1, 0], [outer, inner, [0, 3, 1]])
    assert [basis for _, basis, _ in polytope.found] == [inner]
    for bases in ([outer], [[0, 3, 1]], []):  # the third has two parallel faces
        with pytest.raises(CHECK.Refused, match="must name vertices of it"):
            POLYTOPE.Polytope(constraints, sizes, [0, 1, 0], bases)


def test_an_inverse_is_that_of_numpy():
    random = np.random.default_rng(5)
    for n in (3, 4):
        rows = random.standard_normal((n, n)) * 10.0 ** random.integers(-6, 7, (n, 1))
        np.testing.assert_allclose(POLYTOPE.inverse(rows.tolist()), np.linalg.inv(rows), rtol=1e-9)
    assert POLYTOPE.inverse([[0.0, 1.0, 0.0], [0.0, 0.0, 2.0], [4.0, 0.0, 0.0]]) is not None
    assert POLYTOPE.inverse([[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [0.0, 1.0, 0.0]]) is None
    assert POLYTOPE.inverse([[0.0] * 3] * 3) is None


def test_numbers_with_errors_contain_all_that_they_stand_for():
    random = Random(6)

    def some():
        return Near(random.randint(-(1 << 200), 1 << 200), random.randint(0, 1 << random.randint(1, 120)))

    for _ in range(400):
        one, other, factor = some(), some(), F(random.randint(-(10**9), 10**9), random.randint(1, 10**6))
        for s, t in product((-1, 1), repeat=2):
            a, b = F(one.at + s * one.off, ONE), F(other.at + t * other.off, ONE)
            for found, value in ((one + other, a + b), (one * other, a * b), (one.times(factor), a * factor)):
                assert abs(value * ONE - found.at) <= found.off
            assert abs(one).at - abs(one).off <= abs(a) * ONE <= abs(one).at + abs(one).off
            assert one.above().at >= max(a, F(0)) * ONE
    assert one.times(F(0)) == NOTHING.times(F(3)) == NOTHING * one == one * NOTHING == NOTHING
    assert Near.of(F(3, 8)) == Near(3 * ONE >> 3, 0)
    third = Near.of(F(-1, 3))
    assert (third.off, third.at) == (1, -ONE // 3)
    with pytest.raises(CHECK.Refused, match="must be below 2\\^192"):
        Near.of(F(1 << 200))


def test_a_function_too_large_for_the_integers_of_the_check_is_refused():
    polytope, _ = made(Random(8), 0)
    for place in range(3):
        more = [NOTHING] * 3
        more[place] = Near(-POLYTOPE.LARGEST * 100, 0)
        with pytest.raises(CHECK.Refused, match="must be below 2\\^192"):
            polytope.largest(Function([F(0)] * 3, F(0), more))
