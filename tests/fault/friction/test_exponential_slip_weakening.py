"""Exponential slip weakening, eq. mu."""

import math

import pytest
import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.fault import friction_law

LAW = friction_law("exponential-slip-weakening")(residual=0.2353, drop=0.1, critical_slip=0.27635)


def test_one_critical_slip_leaves_one_over_e_of_the_drop():
    assert float(LAW.coefficient(LAW.critical_slip, 0)) == pytest.approx(0.2353 + 0.1 / math.e, rel=1e-14)


def test_it_starts_static_and_ends_kinetic():
    assert float(LAW.coefficient(0, 0)) == pytest.approx(0.3353)
    assert float(LAW.coefficient(100, 0)) == pytest.approx(0.2353)
    assert LAW.bounds == (0.2353, pytest.approx(0.3353))


def test_negative_slip_leaves_the_bounds_unless_extended():
    # ERRATA 12: μ(−d_c) = μ_res + drop·e
    assert float(LAW.coefficient(-LAW.critical_slip, 0)) == pytest.approx(0.2353 + 0.1 * math.e)
    assert float(LAW.extended(-LAW.critical_slip, 0)) == pytest.approx(0.3353)


def test_the_steepest_slope_is_at_rest():
    slip = sp.Symbol("slip", positive=True)
    slope = sp.diff(LAW.exact().coefficient(slip, 0), slip)
    assert float(slope.subs(slip, 0)) == pytest.approx(-LAW.slip_slope, rel=1e-14)
    assert LAW.slip_slope == pytest.approx(0.1 / 0.27635)
    assert LAW.rate_slope == 0


def test_the_sign_convention_is_explained():
    with pytest.raises(ParameterError, match="paper's Δμ has the opposite sign"):
        type(LAW)(residual=0.2353, drop=-0.1, critical_slip=0.27635)
