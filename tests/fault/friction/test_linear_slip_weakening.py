"""Linear slip weakening."""

import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault import friction_law

LAW = friction_law("linear-slip-weakening")(residual=0.5, drop=0.2, critical_slip=0.4)


@pytest.mark.parametrize(("slip", "friction"), [(0, 0.7), (0.1, 0.65), (0.4, 0.5), (3, 0.5)])
def test_friction_falls_on_a_straight_line_to_the_residual(slip, friction):
    assert float(LAW.coefficient(slip, 0)) == pytest.approx(friction, rel=1e-14)


def test_the_fracture_energy_is_half_of_drop_times_critical_slip():
    # Andrews (1976): area between the curve and the residual, here per unit of normal stress; midpoint rule
    steps = 1000
    area = sum(float(LAW.coefficient(0.4 * (i + 0.5) / steps, 0)) - 0.5 for i in range(steps)) * 0.4 / steps
    assert area == pytest.approx(0.2 * 0.4 / 2, rel=1e-12)


def test_bounds_and_slopes():
    assert LAW.bounds == (0.5, 0.7)
    assert LAW.slip_slope == pytest.approx(0.5)
    assert LAW.rate_slope == 0
    assert float(LAW.extended(-1, 0)) == pytest.approx(0.7)


def test_a_negative_drop_is_refused():
    with pytest.raises(ParameterError, match="drop must be zero or positive"):
        type(LAW)(residual=0.5, drop=-0.2, critical_slip=0.4)
