"""How long a sampling time may be, how much of a setup a design stands, and designs continued from others."""

from dataclasses import fields, replace
from fractions import Fraction as F
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import quakedesign as qd
from quakedesign.fault import load_fault
from quakedesign.guarantees import NoProof, TrackingProof, design_sampled_law, guarantee
from quakedesign.guarantees.exact.guarantee_files import parse_guarantee
from quakedesign.guarantees.exact.sampled_loop import PLAIN, ExactSetup
from quakedesign.guarantees.search import linear_design as longest_times
from quakedesign.guarantees.search.linear_design import (
    Closest,
    design_near_longer_step,
    longest_delay,
    longest_step,
    nearest_setup,
    with_lowest_rate,
)
from quakedesign.loop.loop_setup import Pump
from quakedesign.lyapunov import Verdict
from quakedesign.plant import uncertain_plant

REAL = load_fault("real-fault")
LAGGING = Path(__file__).parents[2] / "data" / "lagging_fault.toml"


@pytest.fixture(scope="module")
def task():
    return uncertain_plant(REAL)


@pytest.fixture(scope="module")
def longest(task):
    return longest_step(task)


def vars_of(setup):
    return {part.name: getattr(setup, part.name) for part in fields(setup)}


@pytest.fixture
def searched(monkeypatch):
    """Searches whose small gain at a time t is (t/longest)^1.2, and of a setup (1 + value)·t; what was tried."""
    tried = []

    def install(longest, *, proved=1.0, misses=()):
        def closest(task, step, *, near=None, measured="slip-and-rate", setup=PLAIN):
            much = sum(value for value in vars_of(setup).values() if isinstance(value, F | int))
            tried.append((step, much, None if near is None else float(near[0])))
            small = float(step * (1 + much) / longest) ** 1.2
            if len(tried) in misses and near is None:
                return NoProof(reason="none")
            held = SimpleNamespace(step=step, **vars_of(setup))
            return Closest(small if small < 1 else 1 + small, np.array([float(step)]), held)

        def best(task, held):
            if held.step > proved * longest:
                return NoProof(reason="too long")
            found = object.__new__(TrackingProof)
            object.__setattr__(found, "sampled_loop", held)
            return found

        monkeypatch.setattr(longest_times, "closest", closest)
        monkeypatch.setattr(longest_times, "best_guarantee", best)
        return tried

    return install


@pytest.mark.parametrize("longest", ["3/10", "1", "7", "90"])
def test_the_longest_step_is_found_within_a_tenth_from_any_side(task, searched, longest):
    tried = searched(F(longest))
    found = longest_step(task)
    assert F(9, 10) * F(longest) <= found.guarantee.sampled_loop.step <= F(longest)
    assert len(tried) <= 12
    # each law is sought near that of the longest time that had one before
    good = [float(step) for step, *_ in tried if step <= F(longest)]
    for (_, _, near), before in zip(tried[1:], range(1, len(tried)), strict=True):
        known = [float(step) for step, *_ in tried[:before] if step <= F(longest)]
        assert near == (known[-1] if known else None)
    assert good


def test_where_an_estimate_is_too_hopeful_the_time_goes_back_until_one_is_proved(task, searched):
    searched(F(1), proved=0.8)
    assert F(7, 10) <= longest_step(task).guarantee.sampled_loop.step <= F(8, 10)


def test_no_step_has_a_design_where_shorter_ones_bring_nothing(task, searched):
    searched(F(1, 10**9))
    assert longest_step(task) is None


@pytest.mark.parametrize("most", ["1/10", "1/2", "6"])
def test_the_longest_delay_is_found_within_a_tenth(task, searched, most):
    """(1 + delay)·T_s is 1 at the longest of T_s = 1 s."""
    searched(1 + F(most))
    found = longest_delay(task, F(1))
    assert F(9, 10) * F(most) <= found.sampled_loop.delay <= F(most)


def test_the_quantity_of_a_setup_that_fails_is_named_with_the_most_that_is_proved(task, searched):
    searched(F(3, 2))
    name, found = nearest_setup(task, F(1), setup=ExactSetup(delay=F(4), slip_noise=F(0)))
    assert name == "delay"
    assert F(9, 20) <= found.sampled_loop.delay <= F(1, 2)
    assert nearest_setup(task, F(1)) is None
    assert nearest_setup(task, F(2), setup=ExactSetup(delay=F(4))) is None  # T_s itself is too long


def test_a_search_near_another_law_that_finds_none_begins_anew(task, monkeypatch, searched):
    tried = searched(F(8, 5))
    plain = longest_times.closest

    def stuck(task, step, *, near=None, **more):
        found = plain(task, step, near=near, **more)
        return found if near is None else NoProof(reason="stuck")

    monkeypatch.setattr(longest_times, "closest", stuck)
    assert nearest_setup(task, F(1), setup=ExactSetup(delay=F(4)))[1].sampled_loop.delay >= F(1, 2)
    assert None in [near for _, much, near in tried if much]


def test_the_longest_step_of_the_real_fault_is_that_of_the_theorem(longest):
    """Long searches with many starts proved 0.95 s, none 1.0 s; the search before ended at 0.755 s."""
    assert F("0.88") <= longest.guarantee.sampled_loop.step < F("1.1")
    assert longest.guarantee.check() is Verdict.PROVED


def test_it_does_not_depend_on_the_sampling_time_of_the_fault(longest):
    for other in (0.01, 3.0):
        assert longest_times._first_step(
            uncertain_plant(replace(REAL, sampling_time=other))
        ) == longest_times._first_step(longest.guarantee.task)


def test_a_design_that_is_missed_at_its_step_is_continued_from_a_longer_one(task, longest):
    found = design_near_longer_step(task, F("0.87"), longest)
    assert (found.sampled_loop.step, found.check()) == (F("0.87"), Verdict.PROVED)
    assert design_near_longer_step(task, 2 * longest.guarantee.sampled_loop.step, longest) is None
    assert design_near_longer_step(task, F("0.87"), None) is None


@pytest.mark.slow
def test_every_command_proves_what_the_longest_step_says(task, longest):
    step = F("0.9")
    assert isinstance(design_sampled_law(task, step), NoProof)  # by itself it is missed
    assert qd.guarantee(REAL, step=step).proved
    none = qd.guarantee(REAL, step=F(3))
    assert not none.proved
    assert none.shorter.sampled_loop.step == longest.guarantee.sampled_loop.step
    assert f"with T_s = {float(longest.guarantee.sampled_loop.step):g} s" in none.lines()[1]


@pytest.mark.slow
def test_behind_a_lag_with_noise_what_was_proved_at_0_22_s_is_found():
    setup = ExactSetup(lag=F("0.3"), slip_noise=F(5, 10**6))
    found = longest_step(uncertain_plant(load_fault(LAGGING)), measured="slip", setup=setup)
    assert found.guarantee.sampled_loop.step >= F("0.22")
    assert found.guarantee.check() is Verdict.PROVED


@pytest.mark.slow
def test_the_rate_of_a_pump_that_would_do_is_named():
    setup = {"measured": "slip", "lag": F("0.3"), "slip_noise": F(5, 10**6), "rate_limit": F(2 * 10**6)}
    found = qd.guarantee(load_fault(LAGGING), step=F("0.2"), **setup)
    name, near = found.nearest
    assert (found.proved, name) == (False, "rate_limit")
    assert near.check() is Verdict.PROVED
    assert near.sampled_loop.pump.rate < 10**9
    assert any(line.startswith("with a pump of at least") for line in found.lines())
    assert found.to_dict()["nearest"]["value"] == str(near.sampled_loop.pump.rate)


def test_the_lowest_rate_makes_the_largest_change_within_the_ramp():
    path = Path(__file__).parents[3] / "proofs" / "certificates" / "guarantee_real-fault.json"
    stored = parse_guarantee(path.read_text())
    any_rate = replace(stored.sampled_loop, pump=Pump(rate=F(10**30)), ramp=stored.sampled_loop.step / 16)
    fast = guarantee(stored.task, any_rate)
    slow = with_lowest_rate(fast)
    needed = fast.claims.largest_step / any_rate.ramp
    assert needed <= slow.sampled_loop.pump.rate <= needed * F(1001, 1000)
    assert slow.check() is Verdict.PROVED
    assert (
        replace(slow, sampled_loop=replace(slow.sampled_loop, pump=Pump(rate=needed * F(999, 1000)))).check()
        is Verdict.UNDECIDED
    )
    assert with_lowest_rate(stored) is stored
