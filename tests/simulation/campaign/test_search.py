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
