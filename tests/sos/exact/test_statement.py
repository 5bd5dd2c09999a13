"""What a statement holds, by small sets written down by hand."""

from fractions import Fraction as F
from itertools import product

import pytest

from quakedesign.errors import PolynomialError
from quakedesign.sos.exact.polynomial_statement import Statement, parity, residue, statement

X, Y = {(1, 0): F(1)}, {(0, 1): F(1)}
DISC = {(0, 0): F(1), (2, 0): F(-1), (0, 2): F(-1)}
ONE = {(0, 0): F(1)}


def asked(polynomial=X, **options):
    return statement(("x", "y"), polynomial, **options)


def made(**parts):
    return Statement(**{"variables": ("x", "y"), "polynomial": X, "degree": 2, "multiplier": ONE} | parts)


@pytest.mark.parametrize(
    "parts",
    [
        {"variables": ("x", "x")},
        {"variables": ("x",)},
        {"polynomial": {(1, 0): F(1), (1, 0, 0): F(1)}},
        {"multiplier": {(0,): F(1)}},
        {"inequalities": ({(1,): F(1)},), "products": ((), (0,))},
        {"equalities": ({(1,): F(1)},)},
        {"multiplier": {}},
        {"inequalities": (X, {})},
        {"equalities": (X, {})},
        {"inequalities": (X, dict(X))},
        {"products": ()},
        {"products": ((), ())},
        {"products": ((), (0,))},
        {"inequalities": (X, Y), "products": ((0,), (1,))},
        {"inequalities": (X, Y), "products": ((), (1, 0))},
        {"inequalities": (X, Y), "products": ((), (0, 0))},
        {"inequalities": (X, Y), "products": ((), (0,), (2,))},
        {"inequalities": (X, Y), "products": ((), (-1,))},
    ],
    ids=str,
)
def test_what_is_ill_formed_is_refused(parts):
    with pytest.raises(PolynomialError):
        made(**parts)
    assert made(inequalities=(X, Y), equalities=(DISC,), products=((), (0, 1), (1,))).degree == 2


def test_the_target_is_the_product():
    assert asked(DISC, multiplier={(1, 0): F(2), (0, 0): F(3)}).target == {
        (0, 0): 3, (1, 0): 2, (2, 0): -3, (3, 0): -2, (0, 2): -3, (1, 2): -2
    }  # fmt: skip
    assert asked(X).target == X


def test_weights_are_products_of_the_inequalities():
    found = made(inequalities=(X, DISC), products=((), (0,), (0, 1)))
    assert found.weights == (ONE, X, {(1, 0): 1, (3, 0): -1, (1, 2): -1})


@pytest.mark.parametrize(
    ("polynomial", "variable"),
    [
        (X, True),
        ({(0, 1): F(5, 3)}, True),
        ({(1, 0): F(-1)}, False),
        ({(2, 0): F(1)}, False),
        ({(1, 1): F(1)}, False),
        (ONE, False),
        ({(1, 0): F(1), (0, 1): F(1)}, False),
        ({(1, 0): F(1), (0, 0): F(1)}, False),
        ({(1, 0): F(0)}, False),
    ],
)
def test_a_variable_is_one_times_a_positive_number(polynomial, variable):
    assert Statement.is_variable(polynomial) is variable


def test_the_space_and_orthants_are_dense_and_nothing_else_is():
    assert asked().dense
    assert asked(inequalities=(X,)).dense
    assert asked(inequalities=(X, Y)).dense
    assert not asked(inequalities=(X, DISC)).dense
    assert not asked(inequalities=({(1, 0): F(-1)},)).dense
    assert not asked(equalities=(X,)).dense
    assert not asked(inequalities=(X,), equalities=(Y,)).dense


def test_forms_of_the_degree_are_graded():
    quadratic = {(2, 0): F(1), (1, 1): F(1)}
    assert asked(quadratic).graded
    assert asked(quadratic, inequalities=(X,), equalities=(Y,)).graded
    assert not asked({(2, 0): F(1), (1, 0): F(1)}).graded
    assert not asked(quadratic, degree_bound=4).graded
    assert not asked(quadratic, inequalities=(DISC, X)).graded
    assert not asked(quadratic, inequalities=(X, DISC)).graded
    assert not asked(quadratic, equalities=(DISC,)).graded


def test_the_degree_is_even_and_holds_everything():
    cubic, quintic = {(3, 0): F(1)}, {(0, 5): F(1)}
    assert asked(X).degree == 2
    assert asked(DISC).degree == 2
    assert asked(cubic).degree == 4
    assert asked(X, multiplier=cubic).degree == 4
    assert asked(X, inequalities=(quintic,)).degree == asked(X, equalities=(quintic,)).degree == 6
    assert asked(X, more=2).degree == 4
    assert asked(X, degree_bound=7).degree == 7
    assert asked(X, degree_bound=0).degree == 0
    assert asked(X, degree_bound=3, more=2).degree == 5


def test_products_are_those_of_orthants_and_single_ones_of_others():
    both = (X, DISC, Y)
    assert asked(inequalities=both).products == ((), (0,), (1,), (2,), (0, 2))
    assert asked(inequalities=both, products=False).products == ((), (0,), (1,), (2,))
    assert asked(inequalities=both, products=True).products == ((), (0,), (1,), (2,), (0, 2))  # of degree 2 at most
    assert asked(inequalities=both, products=True, degree_bound=3).products == (
        (), (0,), (1,), (2,), (0, 1), (0, 2), (1, 2)
    )  # fmt: skip
    assert asked(inequalities=both, products=True, degree_bound=4).products[-1] == (0, 1, 2)
    assert asked(inequalities=both, degree_bound=4).products == ((), (0,), (1,), (2,), (0, 2))
    assert asked(inequalities=both, degree_bound=1).products == ((), (0,), (2,))
    assert asked(inequalities=both, degree_bound=0, products=False).products == ((),)
    assert asked(inequalities=(X, dict(X))).inequalities == (X,)


def test_without_a_multiplier_it_is_one():
    assert asked().multiplier == ONE
    assert asked(multiplier=X).multiplier == X


def test_parities_are_the_odd_exponents():
    assert parity((1, 2, 3, 0)) == 0b0101
    assert parity((0, 0)) == 0


@pytest.mark.parametrize("vectors", list(product(range(8), repeat=3))[::7])
def test_the_residue_decides_membership_in_the_span(vectors):
    """By all eight sums of three vectors."""
    polynomial = {tuple(int(v >> i & 1) for i in range(3)): F(1) for v in vectors}
    echelon = statement(("x", "y", "z"), polynomial).parities
    span = {(vectors[0] * a) ^ (vectors[1] * b) ^ (vectors[2] * c) for a, b, c in product((0, 1), repeat=3)}
    assert {v for v in range(8) if residue(v, echelon) == 0} == span


def test_parities_come_from_every_condition():
    found = statement(("x", "y"), {(2, 2): F(1)}, inequalities=(X,), equalities=({(0, 3): F(1)},))
    assert all(residue(v, found.parities) == 0 for v in range(4))
    assert residue(1, asked({(0, 1): F(1)}).parities) == 1
