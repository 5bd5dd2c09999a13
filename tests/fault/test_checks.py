"""The shared checks of physical values."""

import math

import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault.model import (
    require_count,
    require_finite,
    require_name,
    require_nonnegative,
    require_ordinary,
    require_positive,
)

CHECKS = {require_positive: {1e-300, 2}, require_nonnegative: {0, -0.0, 2}, require_finite: {-2, 0, 1e300}}


@pytest.mark.parametrize("check", CHECKS, ids=lambda c: c.__name__)
def test_each_check_lets_its_values_pass_and_no_infinity(check):
    for value in CHECKS[check]:
        assert check(it=value) is None
    for value in (math.nan, math.inf, -math.inf):
        with pytest.raises(ParameterError, match=rf"^it must be .*finite\. Received {value!r} \(SI units\)\. Why\.$"):
            check("Why.", it=value)


@pytest.mark.parametrize(("check", "value"), [(require_positive, 0), (require_positive, -1), (require_nonnegative, -1)])
def test_signs(check, value):
    with pytest.raises(ParameterError, match=f"Received {value} "):
        check(fine=1, it=value)


@pytest.mark.parametrize("value", ["2600 kg/m^3", None, True, 1j, [1], "x" * 10_000])
@pytest.mark.parametrize("check", CHECKS, ids=lambda c: c.__name__)
def test_only_numbers_are_numbers(check, value):
    with pytest.raises(ParameterError, match=r"^it must be a number in SI units") as raised:
        check(it=value)
    assert len(str(raised.value)) < 400


def test_an_integer_beyond_the_floats_is_not_finite():
    for digits in (310, 5000):
        with pytest.raises(ParameterError, match=r"^it must be finite"):
            require_finite(it=10**digits)


def test_all_values_are_judged_at_once():
    with pytest.raises(ParameterError, match=r"^2 errors\. \(1\) a must .* \(2\) c must") as raised:
        require_positive(a=-1, b=1, c=0)
    assert [str(part)[0] for part in raised.value.parts] == ["a", "c"]


def test_ordinary_sizes():
    require_ordinary(zero=0, small=1e-40, large=-1e40)
    require_ordinary(0, tiny=1e-300)
    for value in (1e41, -1e41, 1e-41):
        with pytest.raises(ParameterError, match="it must have a magnitude between"):
            require_ordinary(it=value)


@pytest.mark.parametrize("value", [0, -1, 9, 1.0, True, "2", None, 10**5000], ids=lambda v: str(type(v)))
def test_counts(value):
    require_count(8, one=1, eight=8)
    with pytest.raises(ParameterError, match=r"^it must be a whole number from 1 to 8"):
        require_count(8, it=value)


def test_names_fit_into_the_names_of_files():
    for name in ("real-fault", "a" * 60, "ä" * 60, "3 b_c.d-e"):
        require_name(name)
    for name in ("", "a" * 61, chr(0x1D49C) * 31, "a/b", "../a", "a\n", "\ud800", 3, None, "x" * 10**6):
        with pytest.raises(ParameterError, match="name must be a string of at most 60") as raised:
            require_name(name)
        assert len(str(raised.value)) < 500
