"""Every file that the package writes is proved again by the standalone checker, from the same bounds."""

import json
from fractions import Fraction as F

import pytest
from random_loops import random_loop
from standalone_guarantee import checker
from thinned import few

from quakedesign.guarantees import TrackingProof, guarantee
from quakedesign.guarantees.exact.guarantee_files import guarantee_text


def bounds_of_both(number):
    """Slip error and slip-rate error of a random loop, by package and checker; None without a guarantee or a law."""
    asked = random_loop(number)
    found = guarantee(*asked) if asked is not None else None
    if not isinstance(found, TrackingProof):
        return None
    document = json.loads(guarantee_text(found))
    checker.verify(document)
    task = checker.read_task(document)
    start = checker.read_start(document["start"]) if "start" in document else [F(0)] * 2
    loop = checker.read_loop(document["loop"], task, start)
    slow = checker.read_slow(document["slow_gain"], task, loop) if "slow_gain" in document else None
    theirs, _ = checker.bounds(task, loop, slow, found.claims.slip_error)
    ours = found.theorem_bounds()
    return (ours.slip_error, ours.slip_rate_error), theirs[:2]


@few("number", [0, 5, 9, 15, 26, 29, 31], every=3)
def test_both_look_back_as_far(number):
    """Both stop at the same K, seeing the same mode alone, whatever their units: also where two modes are as slow."""
    for ours, theirs in zip(*bounds_of_both(number), strict=True):
        assert abs(theirs / ours - 1) < F(1, 10**8)


@pytest.mark.slow
def test_every_file_of_two_hundred_random_loops_is_proved_again():
    """Claims leave a thousandth of room; between both bounds lies a hundred-thousandth of that."""
    both = [bounds_of_both(number) for number in range(200)]
    found = [pair for pair in both if pair is not None]
    assert len(found) > 100
    assert all(abs(b / a - 1) < F(1, 10**8) for pair in found for a, b in zip(*pair, strict=True))
