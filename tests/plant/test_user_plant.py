"""User-defined plants: fields in exact numbers, an actuator for each control, and a state-space system."""

from dataclasses import replace
from fractions import Fraction as F

import control
import pytest

from quakedesign.errors import ParameterError
from quakedesign.plant import Sector, UncertainPlant
from quakedesign.plant.plant_values import ExactSector, SlowLoad

SECTOR = Sector(entry=[0, 1], row=[1, 0], slopes=(-1, 2))
PLANT = UncertainPlant(
    A=[[0, 1], [-2, -3]],
    B=[[0], [5]],
    C=[[1, 0]],
    sectors={"spring": SECTOR},
    gains={"u1": ("0.5", 2)},
    disturbances={"force": ([0, 1], 7)},
    loads={"balance": ([1], None, 4)},
    noise={"y1": "0.1"},
    start=[1, 0],
)


def test_an_actuator_adds_a_state_for_each_control():
    """q' = (u - q)/4; the plant is driven by q, and so are the gain of the control and its load."""
    whole = PLANT.behind(4)
    assert whole.A == ((0, 1, 0), (-2, -3, 5), (0, 0, F(-1, 4)))
    assert whole.B == ((0,), (0,), (F(1, 4),))
    assert (whole.C, whole.outputs) == (((1, 0, 0),), {"y1": (1, 0, 0)})
    assert whole.disturbances == {"force": ((0, 1, 0), 7)}
    assert (whole.start, whole.noise, whole.gains) == ((1, 0, 0), {"y1": F(1, 10)}, {})
    assert whole.loads == {"balance": SlowLoad(control=(F(1),), shift=(F(0), F(0), F(1)), rate=F(4))}
    assert whole.exact_sectors(lambda _: F(1)) == {
        "spring": ExactSector(
            entry=(F(0), F(1), F(0)), row=(F(1), F(0), F(0), F(0)), slopes=(F(-1), F(2)), within=None
        ),
        "u1": ExactSector(entry=(F(0), F(5), F(0)), row=(F(0), F(0), F(1), F(0)), slopes=(F(-1, 2), F(1)), within=None),
    }


def test_an_actuator_keeps_slopes_that_depend_on_the_bound():
    plant = replace(PLANT, sectors={"spring": replace(SECTOR, slopes=lambda y: (-3 * y, y))}, gains={})
    asked = []

    def bound(name):
        asked.append(name)
        return F(2)

    assert plant.behind("4").exact_sectors(bound)["spring"].slopes == (-6, 2)
    assert asked == ["spring"]
    assert plant.exact_sectors(bound)["spring"].within == 2
    narrow = replace(plant, sectors={"spring": replace(SECTOR, slopes=lambda y: (-y, y), within=5)})
    assert narrow.exact_sectors(bound)["spring"].slopes == (-5, 5)


@pytest.mark.parametrize("lag", [0, -1])
def test_a_lag_must_be_positive(lag):
    with pytest.raises(ParameterError, match=f"lag must be positive. Received {lag} s"):
        PLANT.behind(lag)


@pytest.mark.parametrize("rate", [F(-1), F(0), F(1)])
def test_a_load_needs_a_rate_of_0_or_more(rate):
    made = {"A": [[0, 1], [-2, -3]], "B": [[0], [5]], "C": [[1, 0]]}
    if rate >= 0:
        assert UncertainPlant(**made, loads={"balance": ([1], [0, 3], rate)}).loads["balance"].shift == (0, 3)
        return
    with pytest.raises(ParameterError, match="load balance must have a rate of 0 or more and a shift that is not"):
        UncertainPlant(**made, loads={"balance": ([1], [0, 3], rate)})


def test_no_measurement_may_see_the_shift_of_a_load():
    with pytest.raises(ParameterError, match="a shift that is not measured"):
        UncertainPlant(A=[[0, 1], [0, 0]], B=[[0], [1]], C=[[1, 0], [0, 1]], loads={"balance": ([1], [0, 3], 0)})


@pytest.mark.parametrize(
    ("given", "good"),
    [([0, 0], True), ([0, 1], False), ([1, 0], False), ([1, 1], False)],
)
def test_direct_feedthrough_is_rejected(given, good):
    system = control.ss([[0, 1], [-2, -3]], [[0, 0], [1, 2]], [[1, 0]], [given])
    if good:
        plant = UncertainPlant.from_statespace(system, noise={"y[0]": 1})
        assert (plant.A, plant.C) == (((0, 1), (-2, -3)), ((1, 0),))
        assert (plant.controls, plant.measurements, plant.name) == (("u[0]", "u[1]"), ("y[0]",), system.name)
        return
    with pytest.raises(ParameterError, match="in continuous time, with D = 0"):
        UncertainPlant.from_statespace(system)


@pytest.mark.parametrize("system", [control.ss([[0]], [[1]], [[1]], 0, 0.1), [[1]], None])
def test_another_system_is_rejected(system):
    with pytest.raises(ParameterError, match=r"a plant must be a control\.StateSpace in continuous time"):
        UncertainPlant.from_statespace(system)
