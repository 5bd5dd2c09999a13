"""Orders of accuracy, sensitivity to noise and to the input gain, on short runs."""

import math

import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.laws import control_law
from quakedesign.simulation.sensitivity import accuracy, gain_sensitivity, noise_sensitivity

REAL = load_fault("real-fault")
LAW = control_law("cta").from_values(("7", "5", "2.3", "1.1"), scale="1/4000", divisor="2353/125000000000")


@pytest.fixture(scope="module")
def orders():
    steps = [0.0184 * 10 ** (-k / 2) for k in (0, 2)]
    schemes = ("explicit", "compensated")
    return accuracy(REAL, LAW, steps=steps, schemes=schemes, duration=120.0, settled_from=60.0)


@pytest.mark.parametrize(("scheme", "expected"), [("explicit", (3, 2, 1)), ("compensated", (3, 2.1, 1))])
def test_errors_fall_with_the_stated_powers_of_the_sampling_period(orders, scheme, expected):
    """Levant (1993): |e_i| ~ T_s^(4−i) for a homogeneous sliding mode of third order, sampled explicitly."""
    found = orders.orders()[scheme]
    assert list(found.values()) == pytest.approx(expected, abs=0.17)


def test_a_study_is_a_table_and_a_figure(orders):
    table = orders.to_pandas()
    assert list(table.columns) == ["scheme", "T_s", "slip_error", "slip_rate_error", "matched_error"]
    assert len(table) == 4
    panels = orders.figure().axes
    assert [axis.get_ylabel() for axis in panels] == ["max |e1| [m]", "max |e2| [m/s]", "max |e3| [m/s^2]"]
    assert panels[-1].get_xlabel() == "T_s [s]"


@pytest.mark.slow
def test_the_orders_hold_over_three_decades():
    steps = [0.184 * 10 ** (-k / 2) for k in range(7)]
    study = accuracy(REAL, LAW, steps=steps, duration=120.0, settled_from=60.0)
    # at coarse steps the cycle of the explicit scheme is irregular and hangs on last digits
    explicit = [np.polyfit(np.log(steps[3:]), np.log(e[3:]), 1)[0] for e in study.errors["explicit"].values()]
    assert explicit == pytest.approx((3, 2, 1), abs=0.05)
    assert list(study.orders()["explicit"].values()) == pytest.approx((3, 2, 1), abs=0.17)
    assert list(study.orders()["implicit"].values()) == pytest.approx((2, 2, 0.5), abs=0.05)
    assert list(study.orders()["compensated"].values()) == pytest.approx((3, 2.15, 1), abs=0.05)


@pytest.mark.slow
def test_noise_raises_the_errors_and_leaves_the_order_of_the_schemes():
    study = noise_sensitivity(
        REAL,
        LAW,
        levels=(1e-8, 1e-5),
        of="rate_noise",
        schemes=("explicit", "compensated"),
        duration=2000.0,
        plant="printed",
    )
    for found in study.errors.values():
        assert found["slip_rate_error"][1] > found["slip_rate_error"][0]
    assert study.errors["compensated"]["slip_rate_error"] < study.errors["explicit"]["slip_rate_error"]


@pytest.mark.slow
def test_the_compensated_scheme_keeps_both_limits_over_the_whole_box():
    study = gain_sensitivity(
        REAL.with_box("ten-percent"), LAW, points=2, schemes=("compensated",), duration=30000.0, plant="printed"
    )
    assert study.levels[0] < 1.1 < 1.3 < study.levels[1]
    assert max(study.errors["compensated"]["slip_error"]) < 1e-5
    assert max(study.errors["compensated"]["slip_rate_error"]) < 6e-6


def test_a_diverging_run_counts_as_infinite():
    law = control_law("elqr").from_values(("1.9e9", "5.8e8", "1e6", "18"))
    study = noise_sensitivity(REAL, law, levels=(1e-9,), schemes=("explicit",), duration=400.0, plant="printed")
    assert study.errors["explicit"]["slip_error"] == (math.inf,)


def test_meaningless_studies_are_refused():
    with pytest.raises(ParameterError, match="noise must be"):
        noise_sensitivity(REAL, LAW, levels=(1e-9,), of="colour")
    with pytest.raises(ParameterError, match="ten-percent"):
        gain_sensitivity(REAL, LAW)
    with pytest.raises(ParameterError, match="settled_from must be at least 0 s and less than the duration"):
        accuracy(REAL, LAW, steps=(0.184,), schemes=("explicit",), duration=2.0, settled_from=9.0)
