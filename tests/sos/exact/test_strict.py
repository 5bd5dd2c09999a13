"""The strict reader: what is canonical, and how deep a text is, decided by slow rules of their own."""

import json
import math
import time
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quakedesign.errors import CertificateError
from quakedesign.sos.exact.strict import (
    common_grid,
    listed,
    objected,
    parse,
    polynomial_text,
    read_exponents,
    read_polynomial,
    read_rational,
    read_rationals,
    with_keys,
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


@pytest.mark.parametrize(
    "raw", [[0, 1], [0, 1, 2, 3], [0, 1, True], [0, 1, -1], [0, 1, 1000], [0, 1, "2"], "012", None]
)
def test_wrong_exponents_are_refused(raw):
    assert read_exponents([0, 1, 999], 3, 999) == (0, 1, 999)
    with pytest.raises(CertificateError):
        read_exponents(raw, 3, 999)


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


def refused(read, *arguments, **options):
    with pytest.raises(CertificateError):
        read(*arguments, **options)
    return True


def test_keys_lengths_and_kinds_are_exact():
    assert with_keys({"a": 1}, {"a"}) == {"a": 1}
    assert all(refused(with_keys, raw, {"a"}) for raw in ({}, {"a": 1, "b": 2}, {"b": 1}, ["a"], {"a"}, None, "a"))
    assert listed([1, 2], "x", 2) == listed([1, 2], "x", length=2) == listed([1, 2], "x") == [1, 2]
    assert all(refused(listed, raw, "x", 2) for raw in ([1, 2, 3], (1, 2), {"a": 1}, "ab"))
    assert all(refused(listed, raw, "x", length=2) for raw in ([1], [1, 2, 3]))
    assert objected({"a": 1, "b": 2}, "x", 2) == {"a": 1, "b": 2}
    assert all(refused(objected, raw, "x", 2) for raw in ({"a": 1, "b": 2, "c": 3}, [1], "ab"))


def test_named_rationals_have_names():
    assert read_rationals({"a_1": "1/2"}, "x", 1) == {"a_1": Fraction(1, 2)}
    assert all(refused(read_rationals, raw, "x", 2) for raw in ({"1a": "1"}, {"a b": "1"}, {"a": 1}, {"a" * 41: "1"}))


def test_polynomials_are_read_and_written():
    text = {"0,0": "1", "2,10": "-1/3"}
    assert read_polynomial(text, "x", 2, 2) == read_polynomial(text, "x", None, 2) == {
        (0, 0): 1, (2, 10): Fraction(-1, 3)
    }  # fmt: skip
    assert polynomial_text(read_polynomial(text, "x", 2, 2)) == text
    assert read_polynomial({"999,0": "1"}, "x", 2, 2) == {(999, 0): 1}
    for raw in ({"0,0": "0"}, {"0": "1"}, {"0,0,0": "1"}, {"00,0": "1"}, {"0, 0": "1"}, {"-1,0": "1"}, {"1000,0": "1"}):
        assert refused(read_polynomial, raw, "x", 2, 2)
    assert refused(read_polynomial, text, "x", 2, 1)
    assert refused(read_polynomial, {"0": "1", "0,1": "1"}, "x", None, 2)


def test_exponents_reach_from_zero_to_the_largest():
    assert read_exponents([0, 3], 2, 3) == (0, 3)
    assert all(refused(read_exponents, raw, 2, 3) for raw in ([0, 4], [-1, 3], [False, 3]))


def test_a_common_denominator_of_the_largest_length_is_read():
    common_grid([Fraction(1, 2**13), Fraction(1, 2**16383)])  # of 16384 bits
    assert refused(common_grid, [Fraction(1, 2**16384)])
    assert refused(common_grid, [Fraction(1, 2**16383), Fraction(1, 3)])
