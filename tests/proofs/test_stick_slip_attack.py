"""Stored certificates of the stick-slip plant under a simulator that knows nothing but their numbers."""

import json
from fractions import Fraction
from pathlib import Path

import pytest
from stick_slip_attack import Attack

CERTIFICATES = Path(__file__).parents[2] / "proofs" / "certificates"


def stored(name):
    return json.loads((CERTIFICATES / name).read_text(encoding="utf-8"))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["", "noise_", "cta_", "aperiodic_"])
def test_no_course_leaves_the_polytope_or_passes_a_claim(kind):
    found = Attack(stored(f"stick_slip_{kind}real-fault.json")).run(periods=150, long=2000)
    assert 0.7 < found["facet"] < 1
    assert 0.6 < found["slip_rate"] < 1
    assert max(found["behind"], found["ahead"]) < 1
    assert 0.99 < found["pressure"] < 1
    assert found["periods"] > 10**6
    assert 0.6 < found["long_facet"] < 1
    assert 0.5 < found["long_slip_rate"] < 1


@pytest.mark.slow
def test_the_attack_finds_courses_outside_where_the_disturbance_is_larger():
    """A third more than the file says: the polytope is left, so that the attack would see a set that is too small."""
    document = stored("stick_slip_real-fault.json")
    document["disturbance"]["amplitude"] = str(Fraction(document["disturbance"]["amplitude"]) * Fraction(4, 3))
    assert Attack(document).run(periods=60, long=0)["facet"] > 1
    assert Attack(document).run(periods=0, long=2000)["long_facet"] > 1
