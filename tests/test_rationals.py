"""Numbers become exact in one place, and only finite ones."""

import math
import re
import sys
from fractions import Fraction as F

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from quakedesign.errors import ParameterError
from quakedesign.exact import (
    apart,
    exact_text,
    float_above,
    float_below,
    fraction_of_float,
    nearest,
    rational,
    shortly,
    six_digits,
)


@pytest.mark.parametrize(
    ("written", "exact"),
    [
        ("2.3", F(23, 10)),
        ("4.51e-4", F(451, 1000000)),
        ("23/10", F(23, 10)),
        ("-3/4", F(-3, 4)),
        ("+.5", F(1, 2)),
        ("5.", F(5)),
        (" 1E+3\n", F(1000)),
        (0.1, F(1, 10)),
        (-0.0, F(0)),
        (7, F(7)),
        (F(1, 3), F(1, 3)),
        (np.float64(0.1), F(1, 10)),
        (np.int64(-3), F(-3)),
        (sp.Rational(2, 7), F(2, 7)),
    ],
    ids=repr,
)
def test_numbers_are_read_exactly(written, exact):
    assert rational(written) == exact
    assert type(rational(written)) is F


@pytest.mark.parametrize(
    "written",
    [
        *("", ".", "abc", "1/0", "1/00", "3/-4", "1.5/2", "1_0", "0x1", "١", "1e5000", "nan", "inf", "1" * 301),
        *(float("nan"), float("-inf"), True, None, 1j, [1], b"1"),
    ],
    ids=lambda written: repr(written)[:20],
)
def test_anything_else_is_refused_with_what_was_received(written):
    with pytest.raises(ParameterError, match=r"^gain k1 must be a finite number.*Received .*\. Write for example"):
        rational(written, "gain k1")


@pytest.mark.parametrize("precise", [1 - np.longdouble(2) ** -60, sp.Float("0.1", 40), 1 + sp.Float(2, 40) ** -99])
def test_more_digits_than_a_float_has_are_not_rounded_away(precise):
    with pytest.raises(ParameterError, match=r"^gain must be a float, a rational or text.*Give it as text"):
        rational(precise, "gain")


@pytest.mark.parametrize("written", ["1e309", "1e-309", "9.9e999", 5e-324, 10**5000], ids=lambda w: str(type(w)))
def test_a_number_that_no_float_can_show_is_refused(written):
    with pytest.raises(ParameterError, match="at most 308 digits"):
        rational(written)


@given(st.fractions(), st.integers(1, 10**6))
def test_the_nearest_multiple_is_at_most_half_a_step_away(value, denominator):
    found = nearest(float(value), denominator)
    assert (found * denominator).denominator == 1
    assert abs(found - F(float(value))) <= F(1, 2 * denominator)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_only_finite_numbers_are_rounded(value):
    with pytest.raises(ParameterError, match="finite"):
        nearest(value, 10)


@pytest.mark.parametrize("value", [0.1, -2.5, 1e300, 3e-300, 0.0])
def test_a_float_of_sympy_is_read_as_that_of_python(value):
    assert fraction_of_float(sp.Float(value)) == rational(value)


@pytest.mark.parametrize("written", ["0.1234567890123456789", "1e400", "-1e-400", "3.00000000000000000000001"])
def test_a_float_beyond_python_s_is_itself(written):
    """To the last of its digits; the nearest of Python's is another number, or none."""
    value = sp.Float(written, 40)
    assert abs(fraction_of_float(value) - F(written)) <= abs(F(written)) / 10**39


@pytest.mark.parametrize(
    "value", [F(1, 3), F(2, 3), F(-1, 3), F(1, 10), F(3, 10), F(10) ** 300 / 7, F(1, 2), F(0), F(-7)]
)
def test_floats_on_either_side_are_the_nearest_there(value):
    above, below = float_above(value), float_below(value)
    assert F(math.nextafter(above, -math.inf)) < value <= F(above)
    assert F(below) <= value < F(math.nextafter(below, math.inf))


def test_beyond_all_floats_the_outer_side_is_infinite():
    largest = sys.float_info.max
    assert (float_below(F(10**400)), float_above(F(10**400))) == (largest, math.inf)
    assert (float_below(F(-(10**400))), float_above(F(-(10**400)))) == (-math.inf, -largest)


def test_fractions_are_themselves_and_numbers_have_at_most_308_digits_and_300_characters():
    class Own(F):
        """A fraction of a library's."""

    assert rational(F(10**400)) == 10**400
    assert rational(given := F(1, 3)) is given
    assert type(rational(Own(1, 3))) is F
    assert rational(10**308 - 1) == 10**308 - 1
    with pytest.raises(ParameterError, match="at most 308 digits"):
        rational(10**308)
    assert rational("1." + "0" * 298) == 1
    with pytest.raises(ParameterError, match="at most 300 characters"):
        rational("1." + "0" * 299)


def test_six_digits_are_shown_of_numbers_of_any_size():
    shown = {F(2, 3): "0.666667", F(-1, 8): "-0.125", F(10) ** 400: "1.00000e+400"}
    assert {value: six_digits(value) for value in shown} == shown


@pytest.mark.parametrize(
    ("written", "instead"), [("0.67%", "0.0067."), ("10 %", "0.1."), ("x%", "2.3, 4.51e-4 or 23/10.")]
)
def test_a_percentage_is_told_as_a_share(written, instead):
    with pytest.raises(ParameterError) as refused:
        rational(written, "spread")
    assert str(refused.value).endswith(f"Write for example {instead}")


def test_a_number_that_is_not_0_is_not_written_as_0():
    assert shortly(F(-1, 10**400)) == "-1e-400"
    assert shortly(F(10**400)) == "1.00000e+400"
    assert (shortly(F(0)), shortly(0.0), shortly(F(1, 3))) == ("0", "0", "0.333333")


@pytest.mark.parametrize(
    ("values", "texts"),
    [
        ((F(1), F(2)), ("1", "2")),
        ((F(1), F(1)), ("1", "1")),
        ((F(1, 3), F(1, 3) + F(1, 10**5), F(1)), ("0.333333", "0.333343", "1")),
        ((F(1), 1 + F(1, 10**8)), ("1", "1.00000001")),
        ((F(1), 1 + F(1, 10**20)), ("1", "1.00000000000000000001")),
        ((F(1), 1 + F(1, 10**40)), ("1", f"{10**40 + 1}/{10**40}")),
        ((F(1), F(1), 1 + F(1, 10**8)), ("1", "1", "1.00000001")),
    ],
)
def test_numbers_that_differ_are_written_apart(values, texts):
    assert apart(*values) == texts


@pytest.mark.parametrize(
    ("off", "texts"),
    [
        (8, ("0.333333333", "0.333333343")),
        (11, ("0.333333333333", "0.333333333343")),
        (20, ("0." + "3" * 24, "0." + "3" * 19 + "43333")),
    ],
)
def test_numbers_are_written_apart_with_the_fewest_of_9_12_and_24_digits(off, texts):
    assert apart(F(1, 3), F(1, 3) + F(1, 10**off)) == texts


def test_large_numbers_are_written_as_floats_are():
    assert shortly(F(10**6)) == shortly(1e6) == "1e+06"


@pytest.mark.parametrize(
    ("text", "example"),
    [("5%", "0.05"), ("12.5 %", "0.125"), ("1" * 20 + "%", "1.11111e+17"), ("1" * 21 + "%", "2.3,"), ("1/2%", "2.3,"),
     ("x%", "2.3,"), ("", "2.3,")],
)  # fmt: skip
def test_the_remedy_for_a_percentage_is_the_number(text, example):
    with pytest.raises(ParameterError, match=re.escape(f"Write for example {example}")):
        rational(text)


def test_values_that_are_no_rationals_are_written_as_they_are():
    assert (exact_text("x"), exact_text(0.5), exact_text(F(1, 2)), exact_text(F(2))) == ("x", "0.5", "1/2", "2")
