"""The strict reader: what is canonical, and how deep a text is, decided by slow rules of their own."""

import json
import math
import time
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quakedesign.errors import CertificateError
from quakedesign.sos.exact.strict import common_grid, parse, read_exponents, read_rational


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
