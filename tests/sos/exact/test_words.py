"""Answers in sentences, written out by hand."""

from dataclasses import replace
from fractions import Fraction as F

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quakedesign.sos.exact import polynomial_text as text
from quakedesign.sos.exact.answer import Answer
from quakedesign.sos.exact.polynomial_statement import statement
from quakedesign.sos.exact.proofs import Functional, Point, Square, SumOfSquares
from quakedesign.sos.exact.words import polynomial_words, sentences

WRITTEN = {
    "0": {},
    "1": {(0, 0): F(1)},
    "-1": {(0, 0): F(-1)},
    "-x^2 - y": {(2, 0): F(-1), (0, 1): F(-1)},
    "-x + y": {(1, 0): F(-1), (0, 1): F(1)},
    "3/2*x^2*y - x*y - 2": {(0, 0): F(-2), (2, 1): F(3, 2), (1, 1): F(-1)},
    "x^3 + x^2 - y^2 - x": {(1, 0): F(-1), (0, 2): F(-1), (2, 0): F(1), (3, 0): F(1)},
}


@pytest.mark.parametrize(("written", "polynomial"), WRITTEN.items(), ids=WRITTEN)
def test_a_polynomial_is_written_from_its_highest_degree_down(written, polynomial):
    assert polynomial_words(polynomial, ("x", "y")) == written


@given(st.dictionaries(st.tuples(st.integers(0, 3), st.integers(0, 3)), st.fractions().filter(bool), max_size=6))
def test_what_is_written_is_read_back(polynomial):
    assert text.parse(polynomial_words(polynomial, ("x", "y")), ("x", "y"))[1] == polynomial


ASKED = statement(("x",), {(2,): F(1), (0,): F(1)})
SQUARES = Answer(
    statement=ASKED,
    proof=SumOfSquares(squares=(Square(product=(), basis=((0,), (1,)), gram=(F(1), F(0), F(1, 100))),)),
    blocks={"before": [3, 2], "after": []},
    seconds=1.234,
)
ONE = replace(SQUARES, proof=SumOfSquares(squares=(Square(product=(), basis=((0,),), gram=(F(1),)),)))


def test_a_sum_of_squares_is_counted():
    assert sentences(SQUARES) == [
        "sos: x^2 + 1",
        "a sum of 2 squares with rational coefficients of at most 5 characters",
        "1.23 s; checked in exact arithmetic",
    ]
    assert sentences(ONE)[1] == "a sum of 1 square with rational coefficients of at most 1 characters"
    none = replace(SQUARES, proof=SumOfSquares(squares=()))
    assert sentences(none)[1] == "a sum of 0 squares with rational coefficients of at most 1 characters"


def test_sizes_are_told_where_they_are_asked_for():
    assert sentences(SQUARES, verbose=True)[2:4] == [
        "Gram matrices before reduction: 3 + 2",
        "Gram matrices after reduction: none",
    ]


def test_conditions_and_multiplier_are_told():
    asked = statement(
        ("x", "y"),
        {(1, 0): F(1)},
        inequalities=({(1, 0): F(1)}, {(0, 1): F(1)}),
        equalities=({(1, 0): F(1), (0, 1): F(-1)},),
        multiplier={(2, 0): F(1)},
    )
    assert sentences(Answer(statement=asked, proof=None)) == [
        "undecided: x",
        "on x >= 0, y >= 0, x - y == 0",
        "multiplied by x^2",
        "neither a rational proof nor a rational refutation was found",
        "0.00 s",
    ]


def test_a_functional_says_up_to_which_degree():
    found = sentences(Answer(statement=ASKED, proof=Functional(values={(0,): F(1), (2,): F(3)})))
    assert found[1] == (
        "it has no sum of squares with summands up to degree 2: a rational functional with 2 values is "
        "non-negative on all such sums and negative on this polynomial"
    )


def at(*coordinates, polynomial):
    asked = statement(("x", "y"), polynomial)
    return sentences(Answer(statement=asked, proof=Point(coordinates=coordinates)))


def test_a_point_is_told_with_its_value():
    found = at(F(1, 2), F(3), polynomial={(1, 1): F(-1)})
    assert found[1:3] == ["negative at x = 1/2, y = 3", "value -3/2"]


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (F(-(10**198)), f"-1{'0' * 198}"),  # 200 characters
        (F(-(10**199)), f"-1{'0' * 197}…"),
        (F(-(2**998)), f"-{2**998}"[:199] + "…"),  # 999 bits
        (F(-(2**999)), "at most -5.35754E+300"),  # 5.357543035931337e300
        (F(-2, 3 * 10**400), "at most -6.66666E-401"),
    ],
)
def test_a_long_value_is_cut_or_rounded_upwards(value, shown):
    assert at(F(1), F(1), polynomial={(1, 0): value})[2] == f"value {shown}"
