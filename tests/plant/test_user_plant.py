"""User-defined plants: fields in exact numbers, an actuator for each control, and a state-space system."""

from dataclasses import replace
from fractions import Fraction as F

import control
import numpy as np
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


ONE = {"A": [[-1]], "B": [[1]]}
MANY = {"A": [[0] * 40] * 40, "B": [[1] * 40] * 40}


def sector(**changes):
    return {"sectors": {"s": replace(Sector(entry=[1], row=[1], slopes=(0, 1)), **changes)}}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (sector(row=[1, 1, 1]), "row of sector s must have 1 entries, or 2 with the controls. Received 3"),
        (sector(row=[]), "row of sector s must have 1 entries, or 2 with the controls. Received 0"),
        (sector(entry=[1, 1]), "entry of sector s must have 1 numbers. Received 2"),
        (sector(slopes=(0, 1, 2)), "slopes of sector s must have 2 numbers. Received 3"),
        (sector(slopes=(1, 0)), "sector s must have slopes low <= high"),
        (sector(slopes=(1, 0), within=1), "sector s must have slopes low <= high"),
        (sector(within=0), "within must be positive, and its row without controls. .* within 0"),
        (sector(within=-1), "within must be positive"),
        (sector(row=[1, 1], within=1), "its row without controls"),
        (sector(row=[1, 1], within=-1), "its row without controls"),
        ({"B": [[1, 1]]} | sector(row=[1, 1, 0], within=1), "its row without controls"),
        ({"A": [[0] * 41] * 41, "B": [[1]] * 41, "C": [[0] * 41]}, "Received 41, 1 and 1"),
        (sector(slopes=lambda y: (y, -y)), "sector s must have slopes low <= high"),
        (MANY | {"A": [[0] * 41] * 41, "B": [[1]] * 41}, "1 to 40 states, controls and measure.* 41, 1 and 41"),
        (MANY | {"B": [[1] * 41] * 40}, "Received 40, 41 and 40"),
        ({"A": [], "B": []}, "Received 0, 0 and 0"),
        ({"A": [[1]], "B": [[]]}, "Received 1, 0 and 1"),
        ({"A": [[1]], "B": []}, "Received 1, 0 and 1"),
        (MANY | {"C": [[0] * 40] * 41}, "Received 40, 40 and 41"),
        ({"A": [[1, 2]]}, "matrix A of a plant must be 1 x 1. Received 1 rows of 2 entries"),
        ({"B": [[1], [1]]}, "matrix B of a plant must be 1 x 1. Received 2 rows of 1 entries"),
        ({"C": [[1, 2]]}, "matrix C of a plant must be 1 x 1"),
        ({"A": "12"}, "matrix A must be a sequence of rows. Received '12'"),
        ({"A": 3}, "matrix A must be a sequence of rows. Received 3"),
        ({"A": ["1"]}, "a row of A must be a sequence of numbers. Received '1'"),
        ({"A": [1]}, "a row of A must be a sequence of numbers. Received 1"),
        ({"start": "1"}, "start must be a sequence of numbers"),
        ({"start": 1}, "start must be a sequence of numbers"),
        ({"start": [1, 2]}, "start must have 1 numbers. Received 2"),
        ({"start": [-1]}, "noise and start must be 0 or more"),
        ({"noise": {"y1": -1}}, "noise and start must be 0 or more"),
        ({"noise": {"y2": 1}}, "noise of a plant must be given for y1. Received y2"),
        ({"gains": {"u2": (1, 2)}}, "gains of a plant must be given for u1. Received u2"),
        ({"gains": {"u1": (2, 1)}}, r"gains of a control must be \(least, largest\)"),
        ({"gains": {"u1": (2,)}}, "gains of u1 must have 2 numbers"),
        ({"units": {"z": "m"}}, "units of a plant must be given for outputs, controls or disturbances. Received z"),
        ({"outputs": {}}, "1 to 40 outputs"),
        ({"outputs": {f"z{i}": [1] for i in range(41)}}, "1 to 40 outputs"),
        ({"outputs": {"z": [1, 2]}}, "output z must have 1 numbers"),
        ({"sectors": dict.fromkeys(map(str, range(41)), sector()["sectors"]["s"])}, "at most 40 sectors and gains"),
        (
            {"sectors": dict.fromkeys(map(str, range(40)), sector()["sectors"]["s"]), "gains": {"u1": (1, 2)}},
            "at most 40 sectors and gains",
        ),
        ({"sectors": {"u1": sector()["sectors"]["s"]}, "gains": {"u1": (1, 2)}}, "different names. Received u1"),
        ({"controls": ("a", "b")}, "controls must be 1 different names. Received a, b"),
        (MANY | {"controls": ("a",) * 40}, "controls must be 40 different names"),
        ({"measurements": ("a", "a")}, "measurements must be 1 different names. Received a, a"),
        ({"disturbances": {"d": ([1], -1)}}, "size of disturbance d must be 0 or more. Received -1"),
        ({"disturbances": {"d": ([1, 1], 1)}}, "entry of disturbance d must have 1 numbers"),
    ],
)  # fmt: skip
def test_a_plant_that_is_not_well_formed_is_rejected(given, said):
    with pytest.raises(ParameterError, match=said):
        UncertainPlant(**ONE | given)


@pytest.mark.parametrize(
    "given",
    [
        {},
        MANY,
        MANY | {"C": [[0] * 40] * 40},
        MANY | {"C": [[0] * 40]},
        {"A": [[0] * 2] * 2, "B": [[1] * 40] * 2},
        {"outputs": {f"z{i}": [1] for i in range(40)}},
        {"gains": {"u1": (1, 1)}},
        {"disturbances": {"d": ([1], 0)}},
        {"noise": {"y1": 0}, "start": [0]},
        {"noise": {"y1": "1/9"}, "start": ["1/9"]},
        {"controls": ("a",), "measurements": ("b",), "units": {"a": "Pa", "b": "m"}},
        {"sectors": dict.fromkeys(map(str, range(39)), sector()["sectors"]["s"]), "gains": {"u1": (1, 2)}},
        sector(slopes=(1, 1)),
        sector(row=[1, 1]),
        sector(within="1/9"),
    ],
)
def test_a_plant_at_the_limits_is_accepted(given):
    plant = UncertainPlant(**ONE | given)
    assert plant.sizes == (len((ONE | given)["A"]), len((ONE | given)["B"][0]))


def test_numbers_are_exact_and_cannot_be_changed():
    given = {"s": Sector(entry=[1], row=[1], slopes=(0, "0.1"))}
    plant = UncertainPlant(**ONE, sectors=given, noise={"y1": 0.1}, units={"y1": "m"}, gains={"u1": (0.5, 2)})
    given["t"] = given["s"]
    assert (plant.noise, plant.units, list(plant.sectors)) == ({"y1": F(1, 10)}, {"y1": "m"}, ["s"])
    for values in (
        plant.noise,
        plant.units,
        plant.sectors,
        plant.gains,
        plant.outputs,
        plant.loads,
        plant.disturbances,
    ):
        with pytest.raises(TypeError):
            values["z"] = 1
    assert UncertainPlant(A=np.array([[-1.0]]), B=np.array([[0.5]]), start=np.array([0.1])).start == (F(1, 10),)


def test_the_gain_of_a_control_acts_on_that_control():
    """Two controls; the gain of the second varies between 1/2 and 2, around 1."""
    plant = UncertainPlant(A=[[-1]], B=[[3, 5]], gains={"u2": ("1/2", 2)})
    assert plant.exact_sectors(lambda _: F(1)) == {
        "u2": ExactSector(entry=(F(5),), row=(F(0), F(0), F(1)), slopes=(F(-1, 2), F(1)), within=None)
    }
