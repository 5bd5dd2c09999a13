"""Slip-rate weakening."""

import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault import friction_law

LAW = friction_law("slip-rate-weakening")(residual=0.2, drop=0.4, critical_rate=0.1)


@pytest.mark.parametrize(("rate", "friction"), [(0, 0.6), (0.1, 0.4), (0.3, 0.3), (1e9, 0.2)])
def test_half_of_the_drop_has_happened_at_the_critical_rate(rate, friction):
    assert float(LAW.coefficient(0, rate)) == pytest.approx(friction, rel=1e-8)


def test_extended_it_is_even_in_the_rate():
    assert float(LAW.extended(0, -0.3)) == pytest.approx(0.3)


def test_bounds_and_slopes():
    assert LAW.bounds == (0.2, pytest.approx(0.6))
    assert LAW.rate_slope == pytest.approx(4)
    assert LAW.slip_slope == 0


def test_a_critical_rate_of_zero_is_refused():
    with pytest.raises(ParameterError, match="critical_rate must be positive"):
        type(LAW)(residual=0.2, drop=0.4, critical_rate=0.0)
