"""Claims by hand: what follows from bounds, what covers what, and rounding to the outer side."""

from dataclasses import replace
from fractions import Fraction as F

import pytest

from quakedesign.bounds import LowerBound, UpperBound
from quakedesign.certificates.guarantee import Bounds, Claims, task_of
from quakedesign.certificates.guarantee.statement import _above, sentence_of
from quakedesign.fault import load_fault

TASK = task_of(load_fault("real-fault"))
CLAIMS = Claims(
    slip_error=UpperBound(F(1, 3)),
    slip_rate_error=UpperBound(F(1, 7)),
    peak_slip_rate=UpperBound(F(2, 7)),
    least_pressure=LowerBound(F(-10, 3)),
    largest_pressure=UpperBound(F(20, 3)),
)
NAMES = tuple(Claims.__dataclass_fields__)


def test_claims_are_the_bounds_of_the_errors_beside_the_reference_and_the_pressure_at_rest():
    bounds = Bounds(slip_error=F(1, 3), slip_rate_error=F(1, 7), push=3 * TASK.authority, small_gain=F(1, 2))
    found = Claims.of(TASK, bounds)
    assert (found.slip_error, found.slip_rate_error) == (F(1, 3), F(1, 7))
    assert found.peak_slip_rate == F(1, 7) + TASK.reference_rates[0]
    assert (found.least_pressure, found.largest_pressure) == (TASK.rest_pressure[0] - 3, TASK.rest_pressure[1] + 3)


@pytest.mark.parametrize("name", NAMES)
def test_claims_cover_what_is_tighter_in_every_entry_and_nothing_else(name):
    kind, outward = (LowerBound, -1) if name == "least_pressure" else (UpperBound, 1)
    other = replace(CLAIMS, **{name: kind(getattr(CLAIMS, name) + F(outward, 10**12))})
    assert CLAIMS.covers(CLAIMS)
    assert other.covers(CLAIMS)
    assert not CLAIMS.covers(other)


def test_rounded_claims_are_a_thousandth_weaker_with_four_digits():
    found = CLAIMS.rounded()
    assert found.covers(CLAIMS)
    assert (found.slip_error, found.slip_rate_error) == (F("0.3337"), F("0.143"))  # 0.33366… and 1001/7000 itself
    assert found.peak_slip_rate == F("0.286")
    assert (found.least_pressure, found.largest_pressure) == (F("-3.344"), F("6.677"))  # ∓ 10/1000


@pytest.mark.parametrize(("value", "rounded"), [("12345.1", "12350"), ("-12345.1", "-12340"), ("0", "0"), ("1", "1")])
def test_four_digits_are_not_below(value, rounded):
    assert _above(F(value)) == F(rounded)


@pytest.mark.parametrize(
    ("amplitude", "change", "said"),
    [
        (F("0.00032"), None, "for every disturbance |phi| <= 0.00032 m/s^2, for all"),
        (
            F("0.00032"),
            F("0.0002208"),
            "|phi| <= 0.00032 m/s^2 that starts at 0 and changes by at most 0.000221 m/s^3, for",
        ),
        (F(0), None, "held over 1 s, without disturbance, for all friction"),
        (F(0), F(0), "held over 1 s, without disturbance, for all friction"),
    ],
)
def test_a_sentence_says_which_disturbances(amplitude, change, said):
    assert said in sentence_of(replace(TASK, amplitude=amplitude, change=change), CLAIMS, "held over 1 s")
