"""Sample i is a function of seed and i; the samples fill the box evenly."""

import math

import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.simulation.campaign.space import Space, noise_seed, point

BOX = Space.of(load_fault("lab-fault", box="ten-percent"), initial_slip=2e-3, initial_slip_rate=1e-2)
SIZE = len(BOX.ranges)


def test_every_dyadic_interval_holds_one_point():
    """The property of a (0, m, 1)-net that every coordinate of a Sobol' sequence has (Sobol' 1967)."""
    points = np.array([point(5, i, SIZE) for i in range(128)])
    for column in points.T:
        assert sorted(np.floor(128 * column)) == list(range(128))


def test_a_point_does_not_depend_on_those_asked_for_before():
    late, early = point(1, 700, SIZE), point(1, 3, SIZE)
    assert np.array_equal(point(1, 3, SIZE), early)
    assert np.array_equal([point(1, i, SIZE) for i in range(1024)][700], late)
    assert not np.array_equal(point(2, 3, SIZE), early)


def test_noise_seeds_differ_with_index_and_seed():
    assert len({noise_seed(seed, i) for seed in (0, 1) for i in range(500)}) == 1000


def test_the_ends_of_the_cube_are_those_of_the_box():
    low, high = BOX.sample([0.0] * SIZE, 0).numbers, BOX.sample([1.0] * SIZE, 0).numbers
    assert (low["stiffness"], high["authority"]) == (0.9, 1.1)
    assert (low["weakening"], high["weakening"]) == (0.0, 1.0)
    assert (low["phase"], high["phase"]) == (0.0, 2 * math.pi)
    assert (high["initial_slip"], high["initial_slip_rate"]) == (2e-3, 1e-2)


def test_what_is_certain_is_not_varied():
    paper = Space.of(load_fault("lab-fault"))
    assert [list(paper.ranges)[i] for i in paper.active] == ["weakening", "amplitude", "phase"]
    assert paper.sample([0.3] * SIZE, 0).numbers["damping"] == 1.0


def test_a_start_that_slips_back_is_refused():
    with pytest.raises(ParameterError, match="initial_slip must be zero or positive"):
        Space.of(load_fault("lab-fault"), initial_slip=-1e-3)


def test_a_point_of_another_dimension_is_refused():
    space = Space.of(load_fault("lab-fault"))
    with pytest.raises(ParameterError, match=f"point must have {len(space.ranges)} numbers"):
        space.sample([0.5], 1)


@pytest.mark.parametrize(("box", "width"), [("ten-percent", 0.1), ("paper", None)])
def test_a_space_is_the_box_the_disturbance_and_the_start(box, width):
    fault = load_fault("lab-fault", box=box)
    widths = {name: width or getattr(fault.box, name) for name in ("stiffness", "damping", "authority")}
    ranges = {name: (1 - off, 1 + off) for name, off in widths.items()}
    ranges |= {"weakening": (0.0, 1.0), "amplitude": (0.0, 1.0), "phase": (0.0, 2 * math.pi)}
    assert Space.of(fault).ranges == ranges | {"initial_slip": (0.0, 0.0), "initial_slip_rate": (0.0, 0.0)}
    moved = Space.of(fault, initial_slip=2e-3, initial_slip_rate=1e-2)
    assert moved.ranges == ranges | {"initial_slip": (0.0, 2e-3), "initial_slip_rate": (0.0, 1e-2)}
    assert moved.periodic == (5,)
    assert moved.sample([0.25] * SIZE, 7).numbers == {
        name: pytest.approx(0.75 * low + 0.25 * high, rel=1e-15) for name, (low, high) in moved.ranges.items()
    }
    assert moved.sample([0.25] * SIZE, 7).noise_seed == 7
    assert list(Space({"a": (0.0, 1.0), "b": (2.0, 2.0), "c": (3.0, 2.0)}).active) == [0]


@pytest.mark.parametrize(("low", "high"), [(0.3, 0.9), (0.03, 0.29)])
def test_no_number_of_a_sample_lies_beyond_its_range(low, high):
    assert low + 1.0 * (high - low) > high, "in floats"
    assert Space({"a": (low, high)}).sample([1.0], 0).numbers["a"] == high
