"""Searches of functions whose largest value is known."""

import math
from types import MappingProxyType

import pytest

from quakedesign.fault import load_fault
from quakedesign.simulation.campaign.space import Space, corners, neighbours, search

PAPER = Space.of(load_fault("lab-fault"))
MIDDLE = [0.5] * len(PAPER.ranges)


def found_by(function, rounds=12, starts=(MIDDLE,), space=PAPER):
    return search(
        space, "any", lambda samples: [function(s.numbers) for s in samples], starts, noise_seed=3, rounds=rounds
    )


def test_corners_are_all_combinations():
    assert len(corners(PAPER)) == 4  # weakening and amplitude; a phase has no ends
    wide = Space.of(load_fault("lab-fault", box="ten-percent"), initial_slip=1.0)
    assert len(corners(wide)) == 2**6


def test_a_convex_function_is_worst_in_a_corner():
    worst = found_by(lambda n: 3 * n["weakening"] - n["amplitude"], rounds=0)
    assert worst.value == 3.0
    assert (worst.sample.numbers["weakening"], worst.sample.numbers["amplitude"]) == (1.0, 0.0)


def test_a_peak_inside_is_approached():
    def peak(n):
        return -((n["weakening"] - 0.3) ** 2) - (n["amplitude"] - 0.7) ** 2 + 0.1 * math.cos(n["phase"] - 6.0)

    worst = found_by(peak, rounds=30)
    assert worst.value == pytest.approx(0.1, abs=1e-3)
    assert worst.sample.numbers["phase"] == pytest.approx(6.0, abs=0.1)


def test_the_phase_goes_round():
    assert {round(p[5], 3) for p in neighbours(PAPER, (0.5,) * 8, 0.75) if p[5] != 0.5} == {0.25, 0.75}
    assert all(0 <= x <= 1 for p in neighbours(PAPER, (0.9,) * 8, 0.25) for x in p)


def test_it_is_never_better_than_its_starts():
    worst = found_by(lambda n: -abs(n["weakening"] - 0.123) * 1e3, rounds=2, starts=[[0.123] * 8])
    assert worst.value == pytest.approx(0, abs=1e-9)
    assert worst.index == 0


def test_divergence_ends_it_and_every_index_is_known():
    seen = []

    def function(n):
        seen.append(n)
        return math.inf if n["weakening"] == 1.0 else 0.0

    worst = found_by(function)
    assert worst.value == math.inf
    assert len(worst.looked_at) == len(seen) == 5
    assert worst.looked_at[worst.index] == worst.sample
    assert worst.sample.noise_seed == 3


def test_nothing_to_vary():
    space = Space(MappingProxyType({name: (low, low) for name, (low, _) in PAPER.ranges.items()}))
    assert len(found_by(lambda n: 1.0, space=space).looked_at) == 2


def test_every_coordinate_is_moved_both_ways_within_the_box():
    space = Space({"a": (0.0, 1.0), "phase": (0.0, 1.0), "fixed": (2.0, 2.0)})
    assert neighbours(space, (0.5, 0.5, 0.0), 0.25) == [
        (0.25, 0.5, 0.0),
        (0.75, 0.5, 0.0),
        (0.5, 0.25, 0.0),
        (0.5, 0.75, 0.0),
    ]
    assert neighbours(space, (1.0, 0.0, 0.0), 0.25) == [(0.75, 0.0, 0.0), (1.0, 0.75, 0.0), (1.0, 0.25, 0.0)]
    assert neighbours(space, (0.1, 0.9, 0.0), 0.25)[:2] == [(0.0, 0.9, 0.0), (0.35, 0.9, 0.0)]
    assert corners(space) == [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]


@pytest.mark.parametrize(("rounds", "spans"), [(0, []), (1, [0.25]), (4, [0.25, 0.25, 0.125, 0.0625])])
def test_the_span_is_halved_where_no_neighbour_is_worse(rounds, spans):
    """One coordinate, worst at 0.75 between the corners: found at the first look, and then closed in upon."""
    space, looks = Space({"a": (0.0, 1.0)}), []

    def evaluate(samples):
        looks.append([sample.numbers["a"] for sample in samples])
        return [-abs(value - 0.75) for value in looks[-1]]

    worst = search(space, "any", evaluate, [(0.5,)], noise_seed=3, rounds=rounds)
    assert looks[0] == [0.5, 0.0, 1.0]
    centres = [0.5, 0.75, 0.75, 0.75]
    expected = [[centre - span, centre + span] for centre, span in zip(centres, spans, strict=False)]
    assert looks[1:] == expected
    assert worst.sample.numbers["a"] == (0.75 if rounds else 0.5)
    assert (worst.value, worst.metric) == (0.0 if rounds else -0.25, "any")
    every = [value for look in looks for value in look]
    assert [sample.numbers["a"] for sample in worst.looked_at] == every
    assert worst.index == (4 if rounds else 0)


def test_of_equal_samples_the_first_is_the_worst():
    worst = found_by(lambda n: 1.0, rounds=3)
    assert (worst.index, worst.value) == (0, 1.0)
