"""Plants of a fault that are compared with a given one."""

import pytest

from quakedesign import load_fault
from quakedesign.plant import plant_like
from quakedesign.plant.of_fault import uncertain_plant


@pytest.mark.parametrize("rate_limited", [False, True])
def test_a_plant_like_another_has_its_class_of_disturbances(rate_limited):
    fault = load_fault("lab-fault")
    given = uncertain_plant(fault, rate_limited=rate_limited)
    assert (given.change is not None) == rate_limited
    assert plant_like(given, fault) == given
