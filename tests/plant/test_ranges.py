"""Data of a plant that no fault has are rejected with the quantity, the condition and the value."""

from contextlib import nullcontext
from dataclasses import replace
from fractions import Fraction as F

import pytest

from quakedesign import load_fault
from quakedesign.errors import ParameterError
from quakedesign.plant.of_fault import slow_sliding_plant, uncertain_plant

PLANT = uncertain_plant(load_fault("lab-fault"))
SLIDING = slow_sliding_plant(load_fault("crustal-patch"), F(1000))


@pytest.mark.parametrize("value", [F(0), F(-1)])
@pytest.mark.parametrize(
    "name", ["density", "shear_modulus", "length", "normal_stress", "target_slip", "operation_time"]
)
def test_positive_data_of_a_fault(name, value):
    with pytest.raises(ParameterError, match=f"^{name} of {PLANT.name} must be positive. Received {value}"):
        replace(PLANT, **{name: value})


@pytest.mark.parametrize("name", ["damping", "amplitude"])
def test_data_that_may_vanish(name):
    assert getattr(replace(PLANT, **{name: F(0)}), name) == 0
    with pytest.raises(ParameterError, match=f"^{name} of {PLANT.name} must be 0 or more. Received -1"):
        replace(PLANT, **{name: F(-1)})


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"least": F(0)}, "least friction coefficient of .* must be positive. Received 0"),
        ({"weakening": F(-1)}, "friction weakening of .* must be 0 or more. Received -1"),
        ({"strengthening": F(-1)}, "friction strengthening of .* must be 0 or more. Received -1"),
        ({"rate_slope": F(-1)}, "friction rate_slope of .* must be 0 or more. Received -1"),
        ({"static": F(9)}, "static friction coefficient of .* must be between the least, .* Received 9"),
        ({"static": F(1, 1000)}, "static friction coefficient of .* must be between the least, .* Received 0.001"),
        (
            {"static": F(1, 2) + F(1, 10**9), "largest": F(1, 2)},
            r"the largest, 0\.5\. Received 0\.500000001\.",
        ),
        ({"static": float("nan")}, "static of Friction must be a Fraction. Received nan"),
    ],
)
def test_friction_of_a_fault(changes, said):
    with pytest.raises(ParameterError, match=said):
        replace(PLANT, friction=replace(PLANT.friction, **changes))


@pytest.mark.parametrize(
    ("shape", "smooth"),
    [
        ((0, 0, 0, 10, -15, 6), True),
        ((0, 0, 6, -8, 3), False),  # r'' is 12 at the start, 0 at the end
        ((0, 0, 0, 4, -3), False),  # 0 at the start, -12 at the end
        ((0, 0, 3, -2), False),
    ],
)
def test_the_acceleration_of_a_smooth_reference_is_0_at_both_ends(shape, smooth):
    plant = replace(PLANT, shape=tuple(map(F, shape)))
    with nullcontext() if smooth else pytest.raises(ParameterError, match="whose acceleration jumps there"):
        plant.require_smooth_reference()


def test_a_bounded_rate_of_the_disturbance_is_a_difference_if_the_certificate_needs_one():
    rate = uncertain_plant(load_fault("lab-fault"), rate_limited=True)
    assert PLANT.differences(PLANT) == PLANT.differences(rate) == rate.differences(rate) == []
    assert rate.differences(PLANT) == ["class of the disturbance: rate in the certificate, amplitude in the fault"]


@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize("value", [F(-1, 100), F(1)])
def test_spreads_of_a_fault(place, value):
    spreads = [F(0)] * 3
    spreads[place] = value
    name = ("stiffness", "damping", "authority")[place]
    with pytest.raises(ParameterError, match=f"^spread of {name} of .* must be from 0 to below 1. Received "):
        replace(PLANT, spreads=tuple(spreads))


def test_the_disturbance_rate_and_the_shape_of_the_reference():
    assert replace(PLANT, change=F(0)).change == 0
    with pytest.raises(ParameterError, match=r"^disturbance rate of .* must be 0 or more. Received -1"):
        replace(PLANT, change=F(-1))
    with pytest.raises(ParameterError, match=r"must rise from 0 to 1 .* Received the coefficients 0, 1. Give"):
        replace(PLANT, shape=(F(0), F(1)))


@pytest.mark.parametrize("name", ["density", "shear_modulus", "length", "rate"])
def test_positive_data_of_slow_sliding(name):
    with pytest.raises(ParameterError, match=f"^{name} of {SLIDING.name} must be positive. Received 0"):
        replace(SLIDING, **{name: F(0)})


@pytest.mark.parametrize("name", ["damping", "distance", "ramp", "stress"])
def test_data_of_slow_sliding_that_may_vanish(name):
    assert getattr(replace(SLIDING, **{name: F(0)}), name) == 0
    with pytest.raises(ParameterError, match=f"^{name} of {SLIDING.name} must be 0 or more. Received -1"):
        replace(SLIDING, **{name: F(-1)})


@pytest.mark.parametrize("swing", [F(-1, 100), F(1)])
def test_the_swing_of_slow_sliding(swing):
    with pytest.raises(ParameterError, match=r"^swing of .* must be from 0 to below 1"):
        replace(SLIDING, swing=swing)


@pytest.mark.parametrize("ends", [(F(0), F(1)), (F(2), F(1))])
def test_ranges_of_slow_sliding(ends):
    with pytest.raises(ParameterError, match=r"^range of critical_slip of .* must be positive, its lower end first"):
        replace(SLIDING, ranges={**SLIDING.ranges, "critical_slip": ends})
    with pytest.raises(ParameterError, match=r"Received 1\.00000001 to 1\."):
        replace(SLIDING, ranges={**SLIDING.ranges, "critical_slip": (1 + F(1, 10**8), F(1))})
    with pytest.raises(
        ParameterError, match=r"^ranges of .* must be given for direct_effect, .* Received critical_slip"
    ):
        replace(SLIDING, ranges={"critical_slip": (F(1), F(2))})
