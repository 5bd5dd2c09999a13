"""Roots of rationals against mpmath with 50 digits, and their algebra."""

from fractions import Fraction

import mpmath
import pytest
from hypothesis import given
from hypothesis import strategies as st

from quakedesign.errors import ParameterError
from quakedesign.fault.similarity import Radical, radical

positive = st.fractions(min_value=Fraction(1, 10**4), max_value=10**6, max_denominator=10**4)
powers = st.fractions(min_value=-3, max_value=3, max_denominator=6)


@given(positive, powers)
def test_decimal_is_what_mpmath_says(base, power):
    with mpmath.workdps(50):
        oracle = (mpmath.mpf(base.numerator) / base.denominator) ** (mpmath.mpf(power.numerator) / power.denominator)
        value = (radical(base) ** power).decimal(20)
        assert abs(mpmath.mpf(str(value)) / oracle - 1) < mpmath.mpf("1e-19")


@given(positive, powers.filter(bool))
def test_a_power_is_undone_exactly(base, power):
    assert (radical(base) ** power) ** (1 / power) == radical(base)


@given(positive, positive, powers)
def test_powers_distribute_and_equal_numbers_are_equal(a, b, power):
    assert (radical(a) ** power) * (radical(b) ** power) == (radical(a) * b) ** power
    assert radical(a) ** power * radical(a) ** -power == radical(1)


def test_canonical_form_has_the_smallest_degree():
    assert radical(8) ** Fraction(1, 6) == radical(2) ** Fraction(1, 2) == Radical(1, Fraction(2), 2)
    assert (radical(Fraction(8, 27)) ** Fraction(1, 3)).fraction == Fraction(2, 3)
    assert (radical(64) ** Fraction(1, 6)).fraction == 2


def test_signs():
    assert (radical(-2) * radical(-3)).fraction == 6
    assert (radical(-2) ** 3).fraction == -8
    assert (radical(0) * radical(7)).text() == "0"
    assert float(radical(-2) * (radical(2) ** Fraction(1, 2))) == pytest.approx(-(2**1.5), rel=1e-15)


@pytest.mark.parametrize(("base", "power"), [(-2, Fraction(1, 2)), (0, Fraction(-1)), (0, Fraction(0))])
def test_powers_that_do_not_exist_are_refused(base, power):
    with pytest.raises(ParameterError, match="must be real and finite"):
        radical(base) ** power


def test_an_irrational_number_is_no_fraction():
    root = radical(2) ** Fraction(1, 2)
    with pytest.raises(ParameterError, match=r"rational number is needed. Received 1.41421356237"):
        root.fraction  # noqa: B018
    assert root.nearest(5) == Fraction(14142, 10000)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (Fraction(11054, 100), "110.54"),
        (Fraction(500), "500"),
        (Fraction(500, 277), "500/277"),
        (Fraction(-1, 4), "-0.25"),
        (Fraction(10**20), "1E+20"),
    ],
)
def test_rational_texts_are_exact(value, text):
    assert radical(value).text() == str(radical(value)) == text
    assert Fraction(text) == value


def test_irrational_texts_have_twelve_digits():
    assert (radical(2) ** Fraction(1, 2)).text() == "1.41421356237"
    assert (radical(2 * 10**18) ** Fraction(1, 2)).text() == "1414213562.37"
