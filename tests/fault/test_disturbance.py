"""What else acts on the fault."""

import math
from fractions import Fraction
from itertools import pairwise

import pytest
import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.fault import Disturbance, load_fault

FULL = Disturbance(constant=-0.5, amplitude=2.0, frequency=3.0, slip_growth=0.25, rate_growth=-0.125)


def test_the_acceleration_is_the_sum_that_is_documented():
    assert float(FULL.acceleration(sp.Integer(4), sp.Integer(8), sp.Integer(1))) == pytest.approx(
        -0.5 + 2 * math.sin(3) + 1 - 1
    )


def test_bounds_hold_and_are_reached():
    samples = [float(FULL.explicit(sp.Rational(i, 500))) for i in range(1500)]
    assert max(map(abs, samples)) == pytest.approx(FULL.largest_explicit, rel=1e-4)
    assert max(map(abs, samples)) <= FULL.largest_explicit == 2.5
    rates = [abs(b - a) * 500 for a, b in pairwise(samples)]
    assert max(rates) == pytest.approx(FULL.largest_rate, rel=1e-4)
    assert max(rates) <= FULL.largest_rate == 6.0


def test_exact_bounds_are_those_of_the_decimals_where_floats_round_inward():
    """0.1 + 0.7 and 0.7·0.1."""
    given = Disturbance(constant=-0.1, amplitude=0.7, frequency=0.1)
    assert given.largest_explicit < 0.8
    assert given.largest_rate < 0.07
    assert given.exact_bounds() == (Fraction("0.8"), Fraction("0.07"))
    assert FULL.exact_bounds() == (Fraction(5, 2), 6)


def test_the_real_fault_feels_what_the_paper_simulates():
    # section IV-A: 3.2e-4 sin(0.69t) + 3.2e-6 x1
    assert load_fault("real-fault").disturbance == Disturbance(amplitude=3.2e-4, frequency=0.69, slip_growth=3.2e-6)


def test_none_is_the_default():
    assert Disturbance().acceleration(sp.Symbol("a"), sp.Symbol("b"), sp.Symbol("c")) == 0


@pytest.mark.parametrize("name", ["constant", "amplitude", "frequency", "slip_growth", "rate_growth"])
def test_numbers_are_finite(name):
    for value in (math.nan, math.inf):
        with pytest.raises(ParameterError, match=rf"^{name} must be .*finite"):
            Disturbance(**{name: value})


@pytest.mark.parametrize("name", ["amplitude", "frequency"])
def test_amplitude_and_frequency_are_not_negative(name):
    with pytest.raises(ParameterError, match=f"^{name} must be zero or positive"):
        Disturbance(**{name: -1.0})
