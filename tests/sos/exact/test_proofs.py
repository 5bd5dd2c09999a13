import dataclasses
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quakedesign.sos.exact.polynomial import full_matrix, nonnegative_definite, positive_definite
from quakedesign.sos.exact.polynomial_statement import statement
from quakedesign.sos.exact.proofs import (
    Functional,
    Point,
    Square,
    SumOfSquares,
    as_element,
    holds,
    identity_holds,
    in_echelon_form,
    localizing_matrix,
)

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
    in_floats = Square(basis=((1, 0), (0, 1)), gram=(ONE, -ONE, Fraction(2)))
    assert holds(asked, SumOfSquares(squares=(in_floats,)))
    object.__setattr__(in_floats, "gram", (1.0, -1.0, 2.0))  # which the constructor refuses
    for square in (
        Square(basis=(), gram=()),
        Square(basis=((1, 0), (1, 0)), gram=(ONE, ONE, ONE)),
        Square(basis=((1, 0),), gram=(ONE, ONE)),
        Square(basis=((1, 0, 0),), gram=(ONE,)),
        Square(basis=((1, 0), (0, 1, 0)), gram=(ONE, -ONE, Fraction(2))),
        Square(basis=((1, 0), (0,)), gram=(ONE, -ONE, Fraction(2))),
        in_floats,
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


# ---------------------------------------------------------------- multipliers that are not positive prove nothing


def in_x(polynomial, **options):
    return statement(("x",), {(e,): Fraction(c) for e, c in polynomial.items()}, **options)


X = {(1,): ONE}
ALONE = Square(basis=((1,),), gram=(ONE,))
UNIT = Square(basis=((0,),), gram=(ONE,))


def test_a_multiplier_of_zero_proves_nothing():
    assert not holds(in_x({0: -1}, multiplier={(0,): Fraction(0)}), SumOfSquares(squares=()))


def test_one_positive_coefficient_does_not_make_a_multiplier():
    """(1 - x^2)(1 - x^2) is a square, 1 - x^2 is negative at 2."""
    asked = in_x({0: 1, 2: -1}, multiplier={(0,): ONE, (2,): -ONE})
    square = Square(basis=({(0,): ONE, (2,): -ONE},), gram=(ONE,))
    assert not holds(asked, SumOfSquares(squares=(square,)))


def test_a_variable_that_is_not_positive_signs_no_multiplier():
    """(1 + x)(1 + x) is a square, 1 + x is negative at -2, where -x >= 0."""
    p = {0: 1, 1: 1}
    asked = in_x(p, multiplier={(0,): ONE, (1,): ONE}, inequalities=({(1,): -ONE},))
    square = Square(basis=({(0,): ONE, (1,): ONE},), gram=(ONE,))
    assert not holds(asked, SumOfSquares(squares=(square,)))
    there = in_x(p, multiplier={(0,): ONE, (1,): ONE}, inequalities=(X,))
    assert holds(there, SumOfSquares(squares=(square,)))


def test_a_multiplier_of_squares_must_hold_one_where_the_set_is_thin():
    """x^2 (-1) = -1 x^2 on x^2 = 0, and the multiplier x^2 is no proof of -1 >= 0; nor is one with a weight."""
    cofactors = ({(0,): -ONE},)
    point = in_x({0: -1}, multiplier={(2,): ONE}, equalities=({(2,): ONE},))
    assert not holds(point, SumOfSquares(squares=(), cofactors=cofactors, multiplier=(ALONE,)))
    ball = statement(
        ("x",), {(0,): -ONE}, equalities=({(2,): ONE},), inequalities=({(2,): ONE},), multiplier={(2,): ONE}
    )
    weighted = Square(product=(0,), basis=((0,),), gram=(ONE,))
    assert not holds(ball, SumOfSquares(squares=(), cofactors=cofactors, multiplier=(weighted,)))


def test_a_multiplier_of_several_squares_holds_with_one_among_them():
    asked = in_x({2: 1}, multiplier={(0,): ONE, (2,): ONE}, equalities=({(1,): ONE},))
    squares = (Square(basis=((1,), (2,)), gram=(ONE, Fraction(0), ONE)),)
    assert holds(asked, SumOfSquares(squares=squares, cofactors=({},), multiplier=(UNIT, ALONE)))
    assert holds(asked, SumOfSquares(squares=squares, cofactors=({},), multiplier=(ALONE, UNIT)))


def test_every_square_of_a_multiplier_is_one():
    """2*1 and -1*x^2 add up to 2 - x^2, which is negative at 2."""
    multiplier = {(0,): Fraction(2), (2,): -ONE}
    asked = in_x({0: 2, 2: -1}, multiplier=multiplier)
    square = Square(basis=({(0,): Fraction(2), (2,): -ONE},), gram=(ONE,))
    parts = (Square(basis=((0,),), gram=(Fraction(2),)), Square(basis=((1,),), gram=(-ONE,)))
    for order in (parts, parts[::-1]):
        assert not holds(asked, SumOfSquares(squares=(square,), multiplier=order))


def test_every_square_of_a_proof_is_one():
    """2x^2 - x^2 = x^2, but one part is no square."""
    parts = (Square(basis=((1,),), gram=(Fraction(2),)), Square(basis=((1,),), gram=(-ONE,)))
    for order in (parts, parts[::-1]):
        assert not holds(in_x({2: 1}), SumOfSquares(squares=order))
        assert not identity_holds(in_x({2: 1}), SumOfSquares(squares=order))


def test_what_is_malformed_has_no_identity():
    assert identity_holds(in_x({2: 1}), SumOfSquares(squares=(ALONE,)))
    for square in (
        Square(basis=((1,),), gram=(ONE, ONE)),
        Square(basis=((1,), (1,)), gram=(ONE / 4, Fraction(1, 8), Fraction(1, 2))),  # x^2 in all
        Square(product=(0,), basis=((1,),), gram=(ONE,)),
        Square(basis=({(1,): -ONE},), gram=(ONE,)),  # the sign of an element is not free
        Square(basis=((1, 0),), gram=(ONE,)),
    ):
        assert identity_holds(in_x({2: 1}), SumOfSquares(squares=(square,))) is False
        assert holds(in_x({2: 1}), SumOfSquares(squares=(square,))) is False
    empty = Square(basis=(), gram=())
    assert identity_holds(in_x({2: 1}), SumOfSquares(squares=(ALONE, empty))) is False


def test_an_identity_says_nothing_about_the_multiplier():
    minus = in_x({2: -1}, multiplier={(0,): -ONE})
    assert identity_holds(minus, SumOfSquares(squares=(ALONE,)))
    assert not holds(minus, SumOfSquares(squares=(ALONE,)))


def test_a_functional_must_be_negative_at_the_target():
    """L = evaluation at 1 is non-negative on squares; at x it is 1, at -x it is -1, at zero nothing follows."""
    at_one = Functional(values={(0,): ONE, (1,): ONE, (2,): ONE})
    assert holds(in_x({1: -1}), at_one)
    assert not holds(in_x({1: 1}), at_one)
    assert not holds(in_x({1: 1, 0: -1}), at_one)


def test_a_functional_must_be_non_negative_on_the_squares_of_every_product():
    """L(1) = 1, L(x) = -1 and L(x²) = 2 are non-negative on squares of degree 2; on 1·x they are not, L(x) = -1."""
    values, target = {(0,): ONE, (1,): -ONE, (2,): Fraction(2)}, {2: 1, 1: 4, 0: 1}
    assert holds(in_x(target), Functional(values=values))
    assert not holds(in_x(target, inequalities=(X,), products=((), (0,))), Functional(values=values))
    assert not holds(in_x(target), Functional(values=values | {(2,): -ONE}))


def test_a_functional_is_zero_on_monomials_without_a_value():
    """L(x²) = 1 alone; the target x²/2 - x⁴ has L = 1/2, its negative -1/2; in the matrix L(x³) and L(x⁴) are 0."""
    values = {(2,): ONE}
    assert not holds(in_x({2: Fraction(1, 2), 4: -1}), Functional(values=values))
    asked = in_x({2: Fraction(-1, 2), 4: Fraction(1, 3)})
    assert localizing_matrix({(0,): ONE}, [(1,), (2,)], values) == [[1, 0], [0, 0]]
    assert holds(asked, Functional(values=values))


def test_a_point_must_satisfy_every_condition():
    asked = in_x({1: -1}, inequalities=(X, {(1,): -ONE, (0,): Fraction(2)}), equalities=({(2,): ONE, (1,): -ONE},))
    assert holds(asked, Point(coordinates=(ONE,)))
    assert not holds(asked, Point(coordinates=(Fraction(0),)))  # not negative
    assert not holds(asked, Point(coordinates=(Fraction(3),)))
    assert not holds(asked, Point(coordinates=(Fraction(1, 2),)))  # off the equality
    below = in_x({1: 1}, inequalities=({(1,): ONE, (0,): ONE},))
    assert holds(below, Point(coordinates=(-ONE,)))  # on the edge
    assert not holds(below, Point(coordinates=(Fraction(-2),)))


# ---------------------------------------------------------------- bases


def value(square, at):
    """b'Qb at a point, by numbers."""
    elements = [b if isinstance(b, dict) else {b: ONE} for b in square.basis]
    b = [sum(c * at[0] ** e[0] * at[1] ** e[1] for e, c in p.items()) for p in elements]
    q = full_matrix(square.gram, len(b))
    return sum(q[i][j] * b[i] * b[j] for i in range(len(b)) for j in range(len(b)))


def test_echelon_form_keeps_the_square():
    basis = (
        {(1, 0): Fraction(2), (0, 1): ONE, (0, 0): ONE},
        {(1, 0): ONE, (0, 1): -ONE},
        {(1, 0): ONE, (0, 0): Fraction(3)},
    )
    crowded = Square(basis=basis, gram=tuple(map(Fraction, (5, 1, -1, 3, 1, 7))))
    moved = in_echelon_form(crowded)
    assert moved.basis != crowded.basis
    assert in_echelon_form(moved) is moved
    for at in ((1, 2), (-3, 1), (2, -5), (0, 1)):
        assert value(moved, at) == value(crowded, at)


def test_elements_with_fractions_are_multiplied_out():
    """(x/2 + y/3)^2 = x^2/4 + xy/3 + y^2/9."""
    p = {(2, 0): Fraction(1, 4), (1, 1): Fraction(1, 3), (0, 2): Fraction(1, 9)}
    element = {(1, 0): Fraction(1, 2), (0, 1): Fraction(1, 3)}
    assert holds(plain(p), SumOfSquares(squares=(Square(basis=(element,), gram=(ONE,)),)))
    assert not holds(plain(p), SumOfSquares(squares=(Square(basis=(element,), gram=(Fraction(36),)),)))


def test_a_monomial_with_coefficient_one_is_written_by_its_exponents():
    assert as_element({(1, 0): ONE, (0, 1): Fraction(0)}) == (1, 0)
    assert as_element({(1, 0): Fraction(2)}) == {(1, 0): 2}
    assert as_element({(1, 0): ONE, (0, 1): ONE}) == {(1, 0): 1, (0, 1): 1}
