"""A certified number is never printed on its inner side, whatever the format."""

import copy
import math
import pickle
from fractions import Fraction as F

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from quakedesign.errors import ParameterError
from quakedesign.exact import Enclosure, LowerBound, UpperBound, rational

KINDS = st.sampled_from((UpperBound, LowerBound))
NUMBERS = st.one_of(
    st.fractions(),
    st.builds(lambda m, e: F(m) * F(10) ** e, st.integers(-(10**20), 10**20), st.integers(-40, 40)),
    st.builds(F, st.floats(allow_nan=False, allow_infinity=False)),
)
SPECS = st.builds(
    lambda align, sign, width, digits, kind: f"{align}{sign}{width}{digits}{kind}",
    st.sampled_from(("", "<", ">", "^", "_>")),
    st.sampled_from(("", "+", "-", " ")),
    st.sampled_from(("", "1", "12", "60")),
    st.one_of(st.just(""), st.integers(0, 40).map(lambda n: f".{n}")),
    st.sampled_from(("", *"eEfFgG%")),
)


def last_place(text, figures):
    """A unit of the last place of a printed number that has so many significant figures, zeros left out put back."""
    mantissa, _, exponent = text.lower().partition("e")
    written = mantissa.lstrip("+-").replace(".", "").lstrip("0")
    places = len(mantissa.partition(".")[2]) + max(figures - len(written), 0)
    return F(10) ** (int(exponent or 0) - places)


def outside_by_less_than_a_unit(kind, number, spec):
    """Whether the text lies on the outer side of the number, within a unit of its last digit."""
    text = format(kind(number), spec).strip(" _")
    scale = 100 if text.endswith("%") else 1
    text = text.removesuffix("%")
    beyond = (F(text) / scale - number) * (1 if kind is UpperBound else -1)
    digits = int(spec.rstrip("eEfFgG%").partition(".")[2] or 6)
    general = spec == "" or spec[-1] not in "eEfF%"
    return 0 <= beyond < last_place(text, max(digits, 1) if general else 0) / scale


@given(KINDS, NUMBERS, SPECS)
@example(UpperBound, F("0.9999996"), ".6g")
@example(LowerBound, F("-0.9999996"), ".6g")
@example(LowerBound, F("0.157675"), ".3g")
@example(UpperBound, F("8.33542235e-5"), ".2g")
@example(UpperBound, F(-1, 10**9), ".2f")
@example(UpperBound, F(5e-324), "")
def test_every_format_prints_on_the_outer_side_within_a_unit_of_the_last_digit(kind, number, spec):
    assert outside_by_less_than_a_unit(kind, number, spec)


@pytest.mark.parametrize("letter", "efg%")
@pytest.mark.parametrize("kind", [UpperBound, LowerBound])
def test_every_number_of_digits_is_on_the_outer_side(kind, letter):
    for number in map(
        F, ("1/3", "-2/3", "1.25", "9.9996", "-0.00012345678", "123456.789", "-12345678901", "1/7000000")
    ):
        assert all(outside_by_less_than_a_unit(kind, number, f".{digits}{letter}") for digits in range(10))


@given(KINDS, st.integers(-(10**15), 10**15), st.integers(-30, 10), st.integers(0, 14), st.sampled_from("eEfFgG"))
@example(UpperBound, 0, 0, 3, "e")
def test_a_number_that_has_no_more_digits_is_printed_like_a_float(kind, mantissa, power, digits, letter):
    number, spec = kind(F(mantissa) * F(10) ** power), f"+.{digits}{letter}"
    printed = format(number, spec)
    if F(printed) == number and len(printed) < 16:
        assert printed == format(float(f"{mantissa}e{power}"), spec)


@given(KINDS, NUMBERS)
def test_text_float_and_prefix_are_on_the_outer_side_too(kind, number):
    bound = kind(number)
    prefixes = {"": 0, "k": 3, "M": 6, "G": 9, "T": 12, "P": 15, "E": 18}
    prefixes |= {"m": -3, "µ": -6, "n": -9, "p": -12, "f": -15, "a": -18}
    amount, named = bound.quantity("Pa", 4).split(" ")
    shown = [F(str(bound)), F(amount) * F(10) ** prefixes[named.removesuffix("Pa")], F(eval(repr(bound)))]
    shown += [F(float(bound))] if math.isfinite(float(bound)) else []
    assert all(v >= number if kind is UpperBound else v <= number for v in shown)
    assert F(bound.exact) == number
    assert 1 <= abs(F(amount)) < 1000 or not number or not 10**-18 <= abs(number) < 10**20


def test_examples_by_hand():
    assert f"{LowerBound('0.157675'):.3g} {UpperBound('0.157675'):.3g}" == "0.157 0.158"
    assert f"{UpperBound('8.33542235e-5'):.2g} {LowerBound('8.33542235e-5'):.2e}" == "8.4e-05 8.33e-05"
    assert f"{UpperBound('-1/3'):+.2f} {LowerBound('-1/3'):6.1f} {UpperBound('1/3'):.0%}" == "-0.33   -0.4 34%"
    assert f"{UpperBound('20134567').quantity('Pa')}, {LowerBound('0.000999999').quantity('m/s', 2)}" == (
        "20.2 MPa, 999 µm/s"
    )
    assert f"{LowerBound('0.00012')} {LowerBound('0.000012')} {LowerBound(10):.1g} {LowerBound(10):.2g}" == (
        "0.00012 1.2e-05 1e+01 10"
    )
    assert f"{UpperBound('1/3'):<6.2f}{UpperBound('1/3'):_^8.2f}{UpperBound('1/3'):6.2f}" == "0.34  __0.34__  0.34"
    assert UpperBound(0).quantity("Pa") == "0 Pa"
    assert (str(LowerBound("2/3")), repr(UpperBound("2/3"))) == ("0.666666", "UpperBound('0.666667')")
    assert float(UpperBound(F(1, 10))) == 0.1  # the float nearest to 1/10 lies above it
    assert float(LowerBound(F(1, 10))) == math.nextafter(0.1, 0)
    assert float(UpperBound(10**400)) == math.inf
    assert float(LowerBound(10**400)) == pytest.approx(1.797e308, rel=1e-3)


@pytest.mark.parametrize("spec", ["n", "d", ",", "z.2f", "05.2f", ".3s", "=5g"])
def test_a_format_that_could_round_otherwise_is_refused(spec):
    with pytest.raises(ValueError, match="a format of a bound"):
        format(UpperBound(1), spec)


def test_a_bound_is_an_exact_number_wherever_it_goes():
    bound = UpperBound("1/3")
    assert bound == F(1, 3)
    assert bound < LowerBound("1/2")
    assert type(bound + bound) is F
    assert type(rational(bound)) is F
    for again in (copy.copy(bound), copy.deepcopy(bound), pickle.loads(pickle.dumps(bound))):
        assert (type(again), again) == (UpperBound, F(1, 3))


def test_an_enclosure_still_contains_what_it_encloses_when_printed():
    found = Enclosure.of(F(1, 3), F(2, 3))
    assert f"{found:.2g}" == "0.33 to 0.67"
    assert str(found) == "0.333333 to 0.666667"
    assert str(Enclosure.of(F(1), F(1))) == "1 to 1"
    with pytest.raises(ParameterError, match="from low to high"):
        Enclosure.of(F(1), F(0))


def whole(text):
    """Whole number of its digits, a few at a time."""
    value = 0
    for part in (text[i : i + 100] for i in range(0, len(text), 100)):
        value = value * 10 ** len(part) + int(part)
    return value


@pytest.mark.parametrize("number", [F(10**5000 + 1, 3), F(-7, 10**9656 + 1), F(10**5000), F(0)], ids=[1, 2, 3, 4])
def test_a_number_of_any_length_is_written(number):
    """A small gain of 10^96564 ended in a defect, at Python's limit of 4300 digits."""
    text = UpperBound(number).exact
    numerator, _, denominator = text.removeprefix("-").partition("/")
    assert F(whole(numerator), whole(denominator or "1")) == abs(number)
    assert text.startswith("-") == (number < 0)
