"""The strict reader: what is canonical, and how deep a text is, decided by slow rules of their own."""

import json
import math
import time
from dataclasses import dataclass
from fractions import Fraction
from typing import Annotated

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import Meta
from msgspec.structs import replace

from quakedesign.errors import CertificateError
from quakedesign.exact import UpperBound
from quakedesign.sos.exact.strict import (
    Entries,
    PolynomialEntries,
    _difference,
    common_grid,
    headed,
    made,
    parse,
    polynomial_text,
    read_as,
    read_polynomial,
    read_rational,
    require_polynomial,
    written,
)


@given(st.fractions())
def test_a_canonical_text_gives_its_number(number):
    assert read_rational(str(number)) == number


@given(st.integers(-60, 60), st.integers(0, 12), st.sampled_from(["", "+", "0", " ", "-"]))
def test_only_lowest_terms_are_canonical(top, bottom, more):
    text = f"{more}{top}/{bottom}"
    if more == "" and top and bottom > 1 and math.gcd(top, bottom) == 1:
        assert read_rational(text) == Fraction(top, bottom)
    elif not (more == "-" and top > 0 and bottom > 1 and math.gcd(top, bottom) == 1):
        with pytest.raises(CertificateError):
            read_rational(text)


@pytest.mark.parametrize(
    "raw", [1, 1.0, True, None, [], {}, "", "-0", "1/1", "0/2", "1.5", "1e3", "٣", "1" * 401, "1/" + "3" * 401]
)
def test_everything_else_is_no_rational(raw):
    for _ in range(2):
        with pytest.raises(CertificateError):
            read_rational(raw)


def nested(levels, inside="1"):
    return "[" * levels + inside + "]" * levels


def test_twelve_levels_are_read_and_thirteen_are_not():
    assert parse(nested(12)) == json.loads(nested(12))
    assert parse(nested(6, '{"a":' + nested(5) + "}")) == json.loads(nested(6, '{"a":' + nested(5) + "}"))
    for text in (nested(13), nested(100_000), "[" * 13, nested(12, '{"a":1}')):
        with pytest.raises(CertificateError, match="deeper"):
            parse(text)


@pytest.mark.parametrize(
    "inside", ["[" * 50, "{" * 50, '\\"' + "[" * 50, "\\\\", 'a\\\\\\"' + "]" * 3 + "[" * 50, "\\n["]
)
def test_brackets_inside_strings_do_not_count(inside):
    text = nested(12, f'"{inside}"')
    assert parse(text) == json.loads(text)


@pytest.mark.parametrize("end", ["", "\\", '\\"', "[" * 50, '"x'])
def test_a_string_that_never_ends_is_no_json(end):
    with pytest.raises(CertificateError, match="not JSON"):
        parse('["a","' + end)


def test_a_text_of_escapes_is_refused_in_linear_time():
    began = time.process_time()
    with pytest.raises(CertificateError):
        parse('"' + '\\"' * 1_000_000 + "\\")
    assert time.process_time() - began < 5


def test_a_common_denominator_is_bounded():
    primes = [p for p in range(2, 20_000) if all(p % q for q in range(2, math.isqrt(p) + 1))]
    bits = math.prod(primes).bit_length()
    assert bits > 1 << 14
    common_grid([Fraction(1, p) for p in primes[:100]] * 50)
    with pytest.raises(CertificateError, match="common denominator"):
        common_grid([Fraction(1, p) for p in primes])


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ('{"a":1,"a":1}', "occurs twice"),
        ('[{"b":{"a":1,"c":2,"a":3}}]', "occurs twice"),
        ("[1.0]", "numbers must be"),
        ("[1e3]", "numbers must be"),
        ("[NaN]", "numbers must be"),
        ("[-Infinity]", "numbers must be"),
        ("[1000]", "out of range"),
        ("[-100]", "out of range"),
        ("[-0]", "out of range"),
        ("[" + "9" * 5000 + "]", "out of range"),
        ("[1", "not JSON"),
    ],
)
def test_what_json_allows_and_the_format_does_not_is_refused(text, reason):
    with pytest.raises(CertificateError, match=reason):
        parse(text)


def test_integers_of_three_digits_are_read():
    assert parse('{"a":[0,7,10,999,-99],"b":{"a":""}}') == {"a": [0, 7, 10, 999, -99], "b": {"a": ""}}
    assert parse("7") == 7
    assert parse('""') == ""


def test_depth_counts_what_is_open():
    """Twelve open at once, but twenty in all."""
    assert parse("[" + nested(11) + "," + nested(11) + "]") == [json.loads(nested(11))] * 2
    with pytest.raises(CertificateError, match="deeper"):
        parse("[" + nested(11) + "," + nested(12) + "]")


class Part(Entries):
    """An object of a test file."""

    size: Fraction
    name: Annotated[str, Meta(pattern=r"\A[a-z]{1,3}\Z")]
    ends: tuple[Fraction, Fraction] = (Fraction(0), Fraction(1))
    count: Annotated[int, Meta(ge=1, le=3)] = 1
    sum: PolynomialEntries | None = None


GIVEN = {"size": "1/2", "name": "ab", "ends": ["-1", "2"], "count": 2, "sum": {"1,0": "3"}}


def test_an_object_is_read_by_the_types_of_its_fields_and_written_again():
    part = read_as(Part, GIVEN)
    assert (part.size, part.ends, part.count) == (Fraction(1, 2), (-1, 2), 2)
    assert part.sum == {(1, 0): 3}
    assert written(part) == GIVEN
    least = read_as(Part, {"size": "0", "name": "a"})
    assert written(least) == {"size": "0", "name": "a"}
    assert made(Part, part, size=Fraction(7)) == read_as(Part, GIVEN | {"size": "7"})


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"more": 1}, "unknown field `more`"),
        ({"size": "2/4"}, "lowest terms"),
        ({"size": 1}, "size: a rational must be a string"),
        ({"size": None}, "a rational must be a string"),
        ({"name": "abcd"}, "name: expected a name of up to 40 letters"),
        ({"name": "a\n"}, "name: expected a name of up to 40 letters"),
        ({"ends": ["1"]}, "ends: expected `array` of length 2"),
        ({"ends": ["1", "2", "3"]}, "ends: expected `array` of length 2"),
        ({"ends": ["0", "1"]}, "ends is an unknown key, or has its default value"),
        ({"count": 1}, "count is an unknown key"),
        ({"count": 4}, "count: expected `int` <= 3"),
        ({"count": True}, "count: expected `int`"),
        ({"count": "2"}, "count: expected `int`"),
        ({"sum": None}, "sum is an unknown key"),
        ({"sum": {"1,0": "0"}}, "zero coefficient"),
    ],
)
def test_what_is_not_as_the_types_say_is_refused_with_its_place(change, said):
    with pytest.raises(CertificateError, match=said):
        read_as(Part, GIVEN | change)


def test_a_missing_key_and_another_value_than_an_object_are_refused():
    for raw in ({"name": "a"}, [], "a", None, 5):
        with pytest.raises(CertificateError):
            read_as(Part, raw)


@pytest.mark.parametrize(
    "raw",
    [
        *({key: "1"} for key in ("", "a", "01,0", "1,,0", "1, 0", "-1,0", "1000,0", "+1,0", "1.0")),
        {"0": "1", "0,1": "1"},
        {"0": 1},
        {"0": "1/1"},
        ["0", "1"],
        "0",
    ],
)
def test_only_exponents_and_rationals_are_a_polynomial(raw):
    text = {"0,1": "1/2", "2,0": "-3"}
    assert read_polynomial(text) == {(0, 1): Fraction(1, 2), (2, 0): -3}
    assert polynomial_text(read_polynomial(text)) == text
    assert read_polynomial({"999,0": "1"}) == {(999, 0): 1}
    assert read_polynomial({}) == {}
    with pytest.raises(CertificateError):
        read_polynomial(raw)


def test_a_polynomial_has_the_variables_and_at_most_the_terms_that_are_allowed():
    polynomial = {(0, 1): Fraction(1), (2, 0): Fraction(2)}
    require_polynomial(polynomial, "x", 2, 2)
    with pytest.raises(CertificateError, match="longer than 1"):
        require_polynomial(polynomial, "x", 2, 1)
    with pytest.raises(CertificateError, match="another number of variables"):
        require_polynomial(polynomial, "x", 3, 2)


def test_a_common_denominator_of_the_largest_length_is_read():
    common_grid([Fraction(1, 2**13), Fraction(1, 2**16383)])  # of 16384 bits
    for gram in ([Fraction(1, 2**16384)], [Fraction(1, 2**16383), Fraction(1, 3)]):
        with pytest.raises(CertificateError):
            common_grid(gram)


def test_a_file_has_its_format_and_kind():
    assert headed({"format": 1, "kind": "a", "x": 2}, "a") == {"x": 2}
    assert headed({"format": 1, "kind": "a", "x": 2}) == {"kind": "a", "x": 2}
    assert headed({"format": 1}) == {}
    for raw in ({"format": 1, "kind": "b"}, {"format": 1}, {"format": 1, "kind": None}):
        with pytest.raises(CertificateError, match="kind must be a"):
            headed(raw, "a")
    for raw in ({"kind": "a"}, {"format": 2, "kind": "a"}, {"format": True, "kind": "a"}, {"format": "1"}):
        with pytest.raises(CertificateError, match="format must be 1"):
            headed(raw, "a")
    with pytest.raises(CertificateError, match="the file must be an object"):
        headed([1], "a")


@dataclass(frozen=True)
class Bounds:
    """A value of the package, without rules of its own."""

    top: UpperBound
    low: Fraction = Fraction(0)
    parts: tuple[Part, ...] = ()


def test_a_value_is_read_and_written_by_the_types_of_its_fields():
    least = read_as(Bounds, {"top": "1/3"})
    assert (least, type(least.top), type(least.low)) == (Bounds(top=UpperBound(Fraction(1, 3))), UpperBound, Fraction)
    assert written(least) == {"top": "1/3"}
    whole = {"top": "2", "low": "-1", "parts": [{"size": "0", "name": "a"}, GIVEN]}
    assert written(read_as(Bounds, whole)) == whole
    assert type(read_as(Bounds, whole).low) is Fraction


@pytest.mark.parametrize(
    ("raw", "said"),
    [
        ({"top": "2", "low": "0"}, "^low is an unknown key, or has its default value"),
        ({"top": "2", "parts": [{"size": "0", "name": "a", "count": 1}]}, r"^parts\[0\]\.count is an unknown key"),
        (
            {"top": "2", "parts": [{"size": "0", "name": "a"}, {"size": "0", "name": "a", "count": 1}]},
            r"^parts\[1\]\.count is an unknown key",
        ),
        ({"top": "2", "b" * 50: "1"}, f"^{'b' * 40} is an unknown key"),
        ({"top": "2", "b" * 40: "1"}, f"^{'b' * 40} is an unknown key"),
    ],
)
def test_the_place_of_a_key_that_may_not_be_there_is_named(raw, said):
    with pytest.raises(CertificateError, match=said):
        read_as(Bounds, raw)


def test_an_object_is_made_of_entries_then_of_sources_then_of_defaults():
    part = read_as(Part, GIVEN)
    assert made(Part, object(), size=Fraction(1), name="a") == read_as(Part, {"size": "1", "name": "a"})
    assert made(Part, object(), part, replace(part, name="c"), count=3) == read_as(Part, GIVEN | {"count": 3})
    assert made(Bounds, part, top=UpperBound(1)) == Bounds(top=UpperBound(1))


def test_entries_that_differ_are_placed_where_they_first_do():
    assert _difference({"a": ["1", {"b": "2"}]}, {"a": ["1", {"b": "2"}]}) == ""
    assert _difference({"a": ["1", {"b": "2"}]}, {"a": ["1", {"b": "3"}]}) == ".a[1].b "
    assert _difference({"a": ["1", "2"]}, {"a": ["0", "2"]}) == ".a[0] "
    assert _difference({"a": "1"}, ["a"]) == _difference(["a"], {"a": "1"}) == _difference("1", 1) == " "


@pytest.mark.parametrize("value", [None, 1.5, object()])
def test_a_value_of_another_type_is_written_as_it_is(value):
    assert written(value) is value
