"""Negative points: caps cut off by the edge of a set, whose lowest value is known in closed form."""

from fractions import Fraction as F

import pytest
from thinned import few

from quakedesign import sos
from quakedesign.sos.exact.polynomial import evaluate
from quakedesign.sos.exact.polynomial_statement import statement
from quakedesign.sos.exact.polynomial_text import read
from quakedesign.sos.solve.decide import StatementSearch
from quakedesign.sos.solve.points import local_minima, negative_point

DIRECTIONS = ((F(1), F(0)), (F(0), F(1)), (F(3, 5), F(4, 5)), (F(5, 13), F(-12, 13)), (F(-8, 17), F(15, 17)))
RADII = (F(1), F(1, 16), F(67, 1000), F(2), F(3, 50), F(10**6), F(1, 10**8))
EXCESS = (F(9, 16), F(1, 10), F(1, 1000), F(1, 10**6))


def negative(polynomial, on):
    """Point that the search finds, without any programme, checked here by hand; None if it finds none."""
    names, p, inequalities, equalities, _ = read(polynomial, on, None, None)
    asked = statement(names, p, inequalities=inequalities, equalities=equalities)
    search = StatementSearch(asked)
    found = negative_point(search.statement, list(local_minima(search.statement)), search.units)
    if found is None:
        return None
    point = search.moved.restore(found).coordinates
    assert evaluate(p, point) < 0
    assert all(evaluate(g, point) >= 0 for g in inequalities)
    assert all(evaluate(h, point) == 0 for h in equalities)
    return dict(zip(names, point, strict=True))


def cap(radius, direction, excess, centre=(0, 0)):
    """1 − (1 + ε)u⁴/R² + v²/R on u² + v² ≤ R: least −ε, at u² = R; u and v are turned by a rational angle and moved."""
    a, b = direction
    u = f"({a}*(x - {centre[0]}) + ({b})*(y - {centre[1]}))"
    v = f"({a}*(y - {centre[1]}) - ({b})*(x - {centre[0]}))"
    polynomial = f"1 - {1 + excess}*{u}^4/({radius**2}) + {v}^2/({radius})"
    return polynomial, [f"(x - {centre[0]})^2 + (y - {centre[1]})^2 <= {radius}"]


@few("number", range(len(RADII)), every=3)
@pytest.mark.parametrize("excess", EXCESS, ids=str)
def test_every_cap_at_the_edge_of_a_disc_is_found(number, excess):
    assert negative(*cap(RADII[number], DIRECTIONS[number % len(DIRECTIONS)], excess)) is not None


@few("radius", RADII[:4], ids=str, every=2)
def test_a_cap_that_ends_before_the_edge_is_not_invented(radius):
    for direction, excess in zip(DIRECTIONS[1:4], (F(0), F(-1, 10**6), F(-1, 2)), strict=True):
        assert negative(*cap(radius, direction, excess)) is None


@few("centre", [(3, 4), (F(-1, 3), F(2, 7)), (-1, 0)], ids=str, every=3)
def test_discs_elsewhere(centre):
    for direction in DIRECTIONS:
        assert negative(*cap(F(67, 1000), direction, F(1, 100), centre)) is not None


SETS = {
    "corner of a square": ("1 - {m}*(x + y)^4/16", ["x <= 1", "x >= -1", "y <= 1", "y >= -1"]),
    "irrational corner": ("4 - {m}*x^4*y^4*4", ["x^2 <= 2", "y^2 <= 1/2", "x^2*y^2 <= 1"]),
    "end of a lens": ("3/4 - {m}*y^2", ["(x - 1/2)^2 + y^2 <= 1", "(x + 1/2)^2 + y^2 <= 1"]),
    "inner edge of a ring": ("x^2 + y^2 + x^2*y^2 - {m}", ["x^2 + y^2 >= 1", "x^2 + y^2 <= 4"]),
    "edge of an ellipse": ("1 - {m}*x^6/64 + y^2", ["x^2/4 + 100*y^2 <= 1"]),
    "edge of a ball": ("1 - {m}*z^8 + x^2*y^2 + y^2", ["x^2 + y^2 + z^2 <= 1"]),
    "half disc": ("1/2 - {m}*x*y + (x - y)^2", ["x^2 + y^2 <= 1", "x >= 0"]),
    "a parabola's side": ("1 - {m}*y + (x - 1)^2", ["y <= x^2", "x <= 1"]),
    "an interval": ("2 - {m}*x^2", ["2 - x^2 >= 0"]),
    "a thin strip": ("1 - {m}*x^4 + y^2", ["x^2 <= 1", "10^6*y^2 <= 1"]),
    "inside, a narrow dip": ("(x - 1/3)^2 + (y - 1/7)^2 + 1 - {m}", ["x^2 + y^2 <= 1"]),
}


@few("name", SETS, every=4)
@pytest.mark.parametrize("excess", [F(1, 2), F(1, 100), F(1, 10**5), F(0)], ids=str)
def test_edges_of_other_sets(name, excess):
    # every row is 0 at its least for m = 1 and −ε, or a positive multiple, for m = 1 + ε
    polynomial, on = SETS[name]
    found = negative(polynomial.format(m=f"({1 + excess})"), on)
    assert (found is None) == (excess == 0)


SUBLEVEL = "100*x^4 - 384*x^2*y^2 + 400*y^4"


@pytest.mark.slow
@pytest.mark.parametrize("level", ["67/1000", "1/16", "3/50", "1/10"])
def test_drakes_region_12876_is_left_where_its_radius_is_too_large(level):
    # U = 1 first at radius² 1/20
    answer = sos.prove(f"1 - ({SUBLEVEL})", on=[f"x^2 + y^2 <= {level}"])
    assert str(answer.verdict) == "negative"
    assert answer.check()


def test_a_cap_with_a_mixed_term():
    # −1/8 at (0, 1/4)
    for order in ("1 - 288*y^4 + 5*x^2 - 4*x*y", "5*x^2 - 4*x*y + 1 - 288*y^4"):
        answer = sos.prove(order, on=["x^2 + y^2 <= 1/16"])
        assert str(answer.verdict) == "negative"
        assert answer.check()


@few("factor", ["1", "x^2 + 1"], every=2)
def test_products_of_motzkins_polynomial_have_no_negative_point(factor):
    motzkin = "(x^4*y^2 + x^2*y^4 + 1 - 3*x^2*y^2)"
    assert negative(f"{factor}*{motzkin}", ["x^2 + y^2 <= 3"]) is None
    assert str(sos.prove(motzkin).verdict) == "not-sos"
