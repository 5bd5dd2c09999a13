"""The search for a set that a loop by no clock never leaves, and designs of laws for it."""

from dataclasses import replace
from fractions import Fraction as F
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from quakedesign.fault import load_fault
from quakedesign.guarantees import (
    NoProof,
    TrackingProof,
    best_guarantee,
    design_sampled_law,
    guarantee,
    with_varying_gain,
)
from quakedesign.guarantees.exact.guarantee_files import guarantee_text, parse_guarantee
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search import aperiodic_search as unclocked
from quakedesign.guarantees.search import linear_design as design
from quakedesign.guarantees.search.aperiodic_search import aperiodic_guarantee, unclocked_estimate
from quakedesign.lyapunov.exact.claim import Verdict
from quakedesign.plant import uncertain_plant

FILE = Path(__file__).parents[3] / "proofs" / "certificates" / "guarantee_no-clock_lab-fault.json"


@cache
def stored():
    return parse_guarantee(FILE.read_text())


def found(rate_limited=False, **changes):
    task = replace(uncertain_plant(load_fault("lab-fault"), rate_limited=rate_limited))
    return aperiodic_guarantee(task, replace(stored().sampled_loop, **changes))


@pytest.fixture(autouse=True)
def few(monkeypatch):
    """Fewer facets: a little larger bounds, in a third of the time."""
    monkeypatch.setattr(unclocked, "_MANY", 60)


def test_a_set_is_found_that_both_prove_a_little_more_than_the_stored_one():
    claim = best_guarantee(stored().task, stored().sampled_loop)
    assert claim.check() is Verdict.PROVED
    assert parse_guarantee(guarantee_text(claim)).check() is Verdict.PROVED
    assert (
        stored().claims.slip_rate_error <= claim.claims.slip_rate_error <= F("1.15") * stored().claims.slip_rate_error
    )
    assert with_varying_gain(claim) is claim


def test_a_narrow_range_comes_near_what_is_proved_by_a_clock():
    held, step = stored().sampled_loop, F(1, 500)
    clock = guarantee(stored().task, replace(held, step=step, longest_step=F(0)))
    near = found(step=step * F(99, 100), longest_step=step)
    assert F("0.98") * clock.claims.slip_rate_error <= near.claims.slip_rate_error
    assert near.claims.slip_rate_error <= F("1.4") * clock.claims.slip_rate_error


@pytest.mark.parametrize("changes", [{"slip_noise": F(1, 10**8)}, {"rate_noise": F(1, 10**5)}])
def test_noise_counts(changes):
    quiet, noisy = found(), found(**changes)
    assert noisy.check() is Verdict.PROVED
    assert noisy.claims.slip_rate_error > F("1.005") * quiet.claims.slip_rate_error


def test_a_disturbance_of_bounded_rate_has_less():
    slower = found(rate_limited=True)
    assert slower.check() is Verdict.PROVED
    assert slower.claims.slip_rate_error < F("0.95") * found().claims.slip_rate_error


def test_a_range_that_is_too_wide_has_none_with_its_small_gain():
    none = found(longest_step=F(1, 200))
    assert isinstance(none, NoProof)
    assert "small gain" in none.reason or "no invariant set" in none.reason
    assert unclocked_estimate(stored().task, replace(stored().sampled_loop, longest_step=F(1, 20))) is None


def test_the_estimate_of_a_search_is_near_what_is_proved():
    guessed = unclocked_estimate(stored().task, stored().sampled_loop).bounds
    assert float(guessed.slip_rate_error) == pytest.approx(float(stored().claims.slip_rate_error), rel=0.3)
    none = unclocked_estimate(stored().task, replace(stored().sampled_loop, longest_step=F(1, 250)))
    assert none is None or isinstance(none.bounds, NoProof)


@pytest.mark.slow
def test_a_design_has_a_law_for_the_middle_of_the_range(monkeypatch):
    monkeypatch.setattr(design, "_FEWER", 12)
    task, around = uncertain_plant(load_fault("lab-fault")), {"longest_step": F(1, 500)}
    claim = design_sampled_law(task, F(1, 1000), objective="peak", setup=ExactSetup(**around))
    assert isinstance(claim, TrackingProof)
    assert claim.claims.slip_rate_error < F("1.6") * stored().claims.slip_rate_error
    assert claim.sampled_loop.longest_step == F(1, 500)


def test_a_law_of_the_slip_alone_has_too_many_states():
    task, around = uncertain_plant(load_fault("lab-fault")), {"longest_step": F(1, 500)}
    assert (
        "slip and slip rate" in design_sampled_law(task, F(1, 1000), measured="slip", setup=ExactSetup(**around)).reason
    )
    held = replace(stored().sampled_loop, law=longer(stored().sampled_loop.law))
    assert "too many states" in aperiodic_guarantee(task, held).reason
    assert unclocked_estimate(task, held) is None


def longer(law):
    """The same law with an integral of the slip that it does not use."""
    zero = F(0)
    return replace(
        law,
        states=(*law.states, "z"),
        update=(*((*row, zero) for row in law.update), (*[zero] * len(law.states), F(1, 2))),
        measured=(*law.measured, (F(1), zero)),
        output=(*law.output, zero),
        applied=(*law.applied, zero),
    )


def test_the_farthest_points_are_those_of_all_pushes():
    points = unclocked._farthest(
        np.eye(2), np.eye(2), [np.diag([0.5, 0.25]), np.diag([0.25, 0.5])], [np.array([[1.0, 0]]), np.array([[0, 1.0]])]
    )
    assert points.tolist() == [[1.5, 0], [0, 1.5]]
