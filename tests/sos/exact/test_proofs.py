import dataclasses
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quakedesign.sos.exact.definiteness import nonnegative_definite, positive_definite
from quakedesign.sos.exact.proofs import Functional, Point, SumOfSquares, holds
from quakedesign.sos.exact.squares import Square, in_echelon_form
from quakedesign.sos.exact.statement import statement

ONE = Fraction(1)
X2_2XY_2Y2 = {(2, 0): ONE, (1, 1): Fraction(-2), (0, 2): Fraction(2)}
DIFFERENCE = {(1, 0): ONE, (0, 1): -ONE}


def plain(polynomial, **options):
    return statement(("x", "y"), polynomial, **options)


def test_a_sum_of_squares_by_hand_holds_in_monomials_and_on_a_face():
    monomials = Square(basis=((1, 0), (0, 1)), gram=(ONE, -ONE, Fraction(2)))
    face = Square(basis=(DIFFERENCE,), gram=(ONE,)), Square(basis=((0, 1),), gram=(ONE,))
    for squares in ((monomials,), face):
        assert holds(plain(X2_2XY_2Y2), SumOfSquares(squares=squares))


def test_an_element_without_a_monomial_of_its_own_is_refused():
    """Else x + 1 beside 1 could change its 1 without losing the identity."""
    crowded = Square(basis=(DIFFERENCE, (0, 1)), gram=(ONE, Fraction(0), ONE))
    assert not holds(plain(X2_2XY_2Y2), SumOfSquares(squares=(crowded,)))
    moved = in_echelon_form(crowded)
    assert holds(plain(X2_2XY_2Y2), SumOfSquares(squares=(moved,)))


def test_a_semidefinite_gram_matrix_is_refused_but_its_face_holds():
    square = {(2, 0): ONE, (1, 1): Fraction(-2), (0, 2): ONE}
    singular = Square(basis=((1, 0), (0, 1)), gram=(ONE, -ONE, ONE))
    assert not holds(plain(square), SumOfSquares(squares=(singular,)))
    assert holds(plain(square), SumOfSquares(squares=(Square(basis=(DIFFERENCE,), gram=(ONE,)),)))


@given(st.integers(0, 2), st.fractions(min_value=-3, max_value=3, max_denominator=7))
def test_changing_an_entry_loses_the_proof(index, value):
    gram = [ONE, -ONE, Fraction(2)]
    changed = gram.copy()
    changed[index] = value
    proof = SumOfSquares(squares=(Square(basis=((1, 0), (0, 1)), gram=tuple(changed)),))
    assert holds(plain(X2_2XY_2Y2), proof) == (changed == gram)


def test_another_polynomial_loses_the_proof():
    proof = SumOfSquares(squares=(Square(basis=((1, 0), (0, 1)), gram=(ONE, -ONE, Fraction(2))),))
    assert not holds(plain(X2_2XY_2Y2 | {(2, 0): Fraction(2)}), proof)


def test_multiplier_that_changes_sign_is_refused():
    x = {(1, 0): ONE}
    proof = SumOfSquares(squares=(Square(basis=((1, 0),), gram=(ONE,)),))
    assert not holds(plain(x, multiplier=x), proof)  # x·x is a square, x is not positive
    assert holds(plain(x, multiplier=x, inequalities=(x,)), proof)  # on x ≥ 0 it is


def test_multiplier_must_be_positive_where_the_set_may_be_thin():
    """On the isolated point x = 0 of x²(x − 1) ≥ 0 the polynomial −1 + x is negative, and a multiplier x² hides it."""
    cubic = {(3, 0): ONE, (2, 0): -ONE}
    p = {(1, 0): ONE, (0, 0): -ONE}
    hidden = plain(p, inequalities=(cubic,), multiplier={(2, 0): ONE}, products=False)
    proof = SumOfSquares(squares=(Square(product=(0,), basis=((0, 0),), gram=(ONE,)),))
    assert not holds(hidden, proof)
    assert holds(plain(p, inequalities=(cubic,)), Point(coordinates=(Fraction(0), Fraction(0))))


def test_multiplier_as_a_square_is_checked_against_the_statement():
    multiplier = {(2, 0): ONE, (1, 1): Fraction(-2), (0, 2): ONE}
    asked = plain(multiplier, multiplier=multiplier)
    fourth = Square(basis=({(2, 0): ONE, (1, 1): Fraction(-2), (0, 2): ONE},), gram=(ONE,))
    right, wrong = (Square(basis=(b,), gram=(ONE,)) for b in (DIFFERENCE, {(1, 0): ONE, (0, 1): ONE}))
    assert holds(asked, SumOfSquares(squares=(fourth,), multiplier=(right,)))
    assert not holds(asked, SumOfSquares(squares=(fourth,), multiplier=(wrong,)))
    assert not holds(asked, SumOfSquares(squares=(fourth,)))


def test_equality_needs_its_cofactor():
    circle = {(2, 0): ONE, (0, 2): ONE, (0, 0): -ONE}
    p = {(0, 0): ONE, (0, 2): -ONE}  # 1 − y² = x² on the circle
    asked = plain(p, equalities=(circle,))
    square = Square(basis=((1, 0),), gram=(ONE,))
    assert holds(asked, SumOfSquares(squares=(square,), cofactors=({(0, 0): -ONE},)))
    assert not holds(asked, SumOfSquares(squares=(square,), cofactors=({},)))
    assert not holds(asked, SumOfSquares(squares=(square,)))


MOTZKIN = {(4, 2): ONE, (2, 4): ONE, (0, 0): ONE, (2, 2): Fraction(-3)}
SEPARATING = {(4, 2): Fraction(1, 3), (2, 4): Fraction(1, 3), (0, 0): Fraction(1, 3), (2, 2): ONE}


def test_a_functional_separates_motzkins_polynomial_and_no_sum_of_squares():
    """Diagonal moments are enough, since only x²y, xy², 1 and xy survive the reduction."""
    assert holds(plain(MOTZKIN), Functional(values=SEPARATING))
    assert not holds(plain(MOTZKIN), Functional(values=SEPARATING | {(2, 2): Fraction(1, 3)}))
    assert not holds(plain(MOTZKIN), Functional(values=SEPARATING | {(4, 2): Fraction(-1, 3)}))
    assert not holds(plain(X2_2XY_2Y2), Functional(values=SEPARATING))


def test_a_functional_must_vanish_on_multiples_of_equalities():
    asked = statement(("x",), {(1,): ONE}, equalities=({(2,): ONE},))
    assert holds(asked, Functional(values={(1,): -ONE}))  # the constant cannot occur in a square, so L(x) is free
    point = statement(("x",), {(1,): ONE}, equalities=({(1,): ONE, (0,): ONE},))
    evaluation = {(0,): ONE, (1,): -ONE, (2,): ONE}  # at x = −1
    assert holds(point, Functional(values=evaluation))
    assert not holds(point, Functional(values=evaluation | {(2,): Fraction(2)}))


@pytest.mark.parametrize(
    ("point", "expected"), [((1, 1), False), ((2, 1), False), ((-1, 0), True), ((Fraction(1, 2),), False)]
)
def test_a_point_must_be_negative_and_of_full_length(point, expected):
    asked = plain({(1, 0): ONE, (0, 1): ONE})
    assert holds(asked, Point(coordinates=tuple(map(Fraction, point)))) is expected


def test_malformed_proofs_are_false_not_errors():
    asked = plain(X2_2XY_2Y2)
    for square in (
        Square(basis=(), gram=()),
        Square(basis=((1, 0), (1, 0)), gram=(ONE, ONE, ONE)),
        Square(basis=((1, 0),), gram=(ONE, ONE)),
        Square(basis=((1, 0, 0),), gram=(ONE,)),
        Square(basis=((1, 0), (0, 1, 0)), gram=(ONE, -ONE, Fraction(2))),
        Square(basis=((1, 0), (0,)), gram=(ONE, -ONE, Fraction(2))),
        Square(basis=((1, 0), (0, 1)), gram=(1.0, -1.0, 2.0)),
        Square(product=(3,), basis=((1, 0),), gram=(ONE,)),
    ):
        assert holds(asked, SumOfSquares(squares=(square,))) is False
    assert holds(asked, dataclasses.replace(SumOfSquares(squares=()), cofactors=({},))) is False


matrices = st.lists(st.lists(st.integers(-3, 3), min_size=3, max_size=3), min_size=1, max_size=4)


@given(matrices)
def test_gram_products_are_non_negative_definite_and_minus_one_is_lost(rows):
    gram = [[Fraction(sum(a * b for a, b in zip(r, s, strict=True))) for s in rows] for r in rows]
    assert nonnegative_definite(gram)
    spoilt = [row.copy() for row in gram]
    spoilt[0][0] = -ONE
    assert not nonnegative_definite(spoilt)
    if positive_definite(gram):
        assert len(rows) <= 3
