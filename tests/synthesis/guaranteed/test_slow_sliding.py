"""Guarantees of slow sliding claim as little as follows; where that is too little, what was claimed first is proved."""

import importlib.util
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import pytest

from quakedesign.bounds import UpperBound
from quakedesign.certificates import Verdict
from quakedesign.certificates.guarantee import Held
from quakedesign.certificates.slow_sliding import SlidingClaims, SlidingTask, parse_sliding, sliding_text
from quakedesign.certificates.slow_sliding.theorem import cell_bounds
from quakedesign.loop import SlidingModel
from quakedesign.synthesis.guaranteed import slow_sliding
from quakedesign.synthesis.guaranteed.slow_sliding import proved_sliding
from quakedesign.synthesis.linear.sampled.slow_sliding import Weights, sliding_law

PROOFS = Path(__file__).parents[3] / "proofs"
SPECIFICATION = importlib.util.spec_from_file_location("smallest_check", PROOFS / "check.py")
checker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(checker)
NAMES = tuple(SlidingClaims.__dataclass_fields__)
MODEL = SlidingModel(
    rate=F("1.2e-6"), state_rate=F("1.2e-3"), slope=F(1), state_slope=F(1), strength=F(500024), weakening=F(1100000),
    direct=F("0.01"), evolution=F("0.022"), stiffness=F(6 * 10**6), coefficient=F("0.6"),
)  # fmt: skip
WEIGHTS = Weights(slip=3.0, state=0.18, pressure=9000.0, slip_noise=3.0, state_noise=0.006, level_noise=20.0)
HELD = Held(law=sliding_law(MODEL, F(50), weights=WEIGHTS), step=F(50), lag=F(10))


def task(half, stress):
    """The fault of the issue of slow sliding: a = 0.010, b = 0.015, 1 mm, 50 MPa, 5 km, 1.2 µm/s."""
    known = {"direct_effect": F("0.01"), "evolution_effect": F("0.015"), "critical_slip": F("0.001")}
    ranges = {name: (value * (1 - F(half)), value * (1 + F(half))) for name, value in known.items()}
    exact = {"coefficient": (F("0.6"),) * 2, "normal_stress": (F(50 * 10**6),) * 2}
    plant = {"density": F(2700), "shear_modulus": F(30 * 10**9), "length": F(5000), "damping": F(5 * 10**14)}
    moved = {"rate": F("1.2e-6"), "distance": F("0.01"), "ramp": F(12), "stress": F(stress)}
    return SlidingTask(name="a patch", ranges=ranges | exact, **plant, **moved)


def sizes(claims):
    return {name: getattr(claims, name) for name in NAMES}


@pytest.mark.parametrize("half", ["0", "0.02"])
def test_claims_are_followed_down_to_what_both_checkers_still_prove(half):
    found = proved_sliding(task(half, 8000), HELD)
    assert found.check() is Verdict.PROVED
    assert checker.check(sliding_text(found)).verdict == "proved"
    assert found.claims.log_rate < F(1, 4)
    every = [cell_bounds(cell, found.held, found.claims) for cell in found.cells]
    reached = {name: max(bounds[name] for bounds in every) for name in NAMES}
    assert all(reached[name] > F(9, 10) * v for name, v in sizes(found.claims).items())  # there is not much left
    smaller = SlidingClaims(**{name: UpperBound(F(9, 10) * v) for name, v in sizes(found.claims).items()})
    assert replace(found, claims=smaller).check() is Verdict.UNDECIDED


@pytest.mark.parametrize("half", ["0", "0.02"])
def test_what_was_claimed_first_is_proved_where_too_little_is_claimed_then(half, monkeypatch):
    def too_small(found):
        return SlidingClaims(**{name: UpperBound(v / 100) for name, v in sizes(found.claims).items()})

    monkeypatch.setattr(slow_sliding, "_smallest_claims", too_small)
    found = proved_sliding(task(half, 8000), HELD)
    assert found.claims.log_rate == F(1, 2)
    assert found.check() is Verdict.PROVED


def test_a_stress_that_the_law_does_not_stand_has_no_claims():
    assert proved_sliding(task("0.02", 80000), HELD).reason.startswith("a stress of 8e+04 Pa is not shown")


@pytest.mark.slow
def test_ten_percent_of_a_b_and_d_c_leave_the_slip_rate_below_1_32_v():
    wide = parse_sliding((PROOFS / "certificates" / "boxes" / "sliding_ten-percent.json").read_text())
    smaller = replace(wide, claims=slow_sliding._smallest_claims(wide))
    assert smaller.check() is Verdict.PROVED
    assert smaller.peak_slip_rate < F(132, 100) * wide.task.rate
