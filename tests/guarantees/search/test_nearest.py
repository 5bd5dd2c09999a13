"""Where a design is not proved: which quantity fails, and the nearest value of it that will do."""

from dataclasses import replace
from fractions import Fraction as F
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from thinned import few

import quakedesign as qd
from quakedesign.fault import load_fault
from quakedesign.guarantees import NoProof, SampledLoop, TrackingGuarantee, TrackingProof, best_guarantee
from quakedesign.guarantees.exact.guarantee_files import parse_guarantee
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search import linear_design
from quakedesign.guarantees.search.compensated_search import design_compensated
from quakedesign.guarantees.search.default_designs import deadbeat, sampled_sliding_mode
from quakedesign.guarantees.search.float_bounds import distance
from quakedesign.guarantees.search.linear_design import (
    LinearLawSearch,
    design_sampled_law,
    longest_delay,
    longest_step,
    nearest_setup,
)
from quakedesign.laws import control_law
from quakedesign.loop.loop_setup import Pump
from quakedesign.lyapunov import Verdict
from quakedesign.plant import uncertain_plant

PROOFS = Path(__file__).parents[3] / "proofs" / "certificates"
REAL = load_fault("real-fault")
STEP = F("0.184")


@pytest.fixture(scope="module")
def task():
    return uncertain_plant(REAL)


@pytest.fixture(scope="module")
def sliding(task):
    return deadbeat(task, control_law("cta"))


def lines(found):
    return [line for line in found.lines() if line.startswith("with ")]


@pytest.mark.slow
@few("controller", ["elqr", "dia"], every=2)
def test_the_smallest_pump_that_will_do_is_named(controller):
    asked = Pump(least=F(-20 * 10**6), largest=F(3 * 10**6))
    found = qd.guarantee(REAL, controller=controller, step=STEP, saturation="3 MPa", withdrawal="20 MPa")
    assert not found.proved
    name, near = found.nearest
    assert (name, near.check()) == ("saturation", Verdict.PROVED)
    low, high = near.sampled_loop.pump.limits
    assert low == asked.least  # which was not too little
    assert asked.largest < high <= F(101, 100) * REAL_REST
    tighter = replace(
        near, sampled_loop=replace(near.sampled_loop, pump=replace(near.sampled_loop.pump, largest=high * F(999, 1000)))
    )
    assert tighter.check() is Verdict.UNDECIDED
    assert "a pump from -20 MPa or less to 14." in lines(found)[0]
    assert found.to_dict()["nearest"]["value"] == [str(low), str(high)]


REAL_REST = (
    uncertain_plant(REAL).rest_pressure[1] + F(3, 10) * 10**6
)  # p* at most, and what no design needs more than that


@pytest.mark.parametrize("pressed", [True, False])
def test_the_pressure_is_the_reason_where_it_alone_fails(pressed, monkeypatch, task):
    """Without a slowly varying gain the pressure fails or the gain does; with one the gain does."""
    slow, plain = (
        NoProof(reason="small gain 2"),
        NoProof(reason="opens", only_pressure_fails=True) if pressed else NoProof(reason="1"),
    )
    monkeypatch.setattr(linear_design, "varying_gain", lambda task, held: "slow")
    monkeypatch.setattr(linear_design, "guarantee", lambda task, held, gain=None: slow if gain else plain)
    found = best_guarantee(task, LinearLawSearch().low_pressure_loop(task, F(1, 2)))
    assert found is (plain if pressed else slow)


@pytest.mark.slow
def test_the_largest_disturbance_that_does_not_open_the_fault_is_named():
    pushed = replace(REAL, disturbance=replace(REAL.disturbance, amplitude=2000 * REAL.disturbance.amplitude))
    found = qd.guarantee(pushed, step=F("0.1"))
    assert found.proof.reason.endswith(": the fault may open")
    name, near = found.nearest
    assert (name, near.check()) == ("amplitude", Verdict.PROVED)
    assert 0 < near.task.amplitude < uncertain_plant(pushed).amplitude
    more = best_guarantee(replace(near.task, amplitude=near.task.amplitude * F(9, 8)), near.sampled_loop)
    assert isinstance(more, NoProof)
    assert more.only_pressure_fails
    assert lines(found)[0].startswith("with a disturbance of at most 0.")
    assert found.to_dict()["nearest"]["value"] == str(near.task.amplitude)


@pytest.mark.slow
def test_a_law_of_less_pressure_is_designed_where_the_usual_one_asks_for_too_much(task):
    """What the usual one asks for is more than it needs at this T_s."""
    step = F("0.5")
    usual = design_sampled_law(task, step)
    low, high = usual.claims.pressures[-1]
    leaner = best_guarantee(task, LinearLawSearch().low_pressure_loop(task, step)).claims.pressures[-1]
    assert low < leaner[0] <= leaner[1] < high
    pump = Pump(least=(low + leaner[0]) / 2, largest=(high + leaner[1]) / 2)
    assert isinstance(best_guarantee(task, replace(usual.sampled_loop, pump=pump)), NoProof)
    assert design_sampled_law(task, step, setup=ExactSetup(pump=pump)).check() is Verdict.PROVED


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("delay", F(9, 80), "with a delay of 0.1125 s: "),
        ("delay", F(1, 3), "with a delay of 1/3 s: "),
        ("lag", F(1, 8), "with a lag of 0.125 s: "),
        ("diffusion", F(0), "without any diffusion time L^2/D: "),
        ("jitter", F(1, 3000), "with a jitter of at most 333 µs: "),
        ("averaging", F(1, 80), "with an averaging time of at most 12.5 ms: "),
        ("delay_jitter", F(1, 80), "with a jitter of the delay of at most 12.5 ms: "),
    ],
)
@pytest.mark.parametrize("given", [False, True])
def test_a_nearest_value_is_a_bound_only_where_smaller_values_are_covered(name, value, said, given, task):
    """A guarantee is of one delay, lag or path; a jitter and a time of averages are bounds of what may happen."""
    law = qd.SampledLaw.from_gains([3e8, 2.5e8, 5e7], step="0.184").law
    stored = parse_guarantee((PROOFS / "guarantee_real-fault.json").read_text(encoding="utf-8"))
    near = replace(stored, sampled_loop=SampledLoop(law=law, step=STEP, **{name: value}))
    found = TrackingGuarantee(fault=REAL, proof=NoProof(reason="x"), nearest=(name, near), given=given)
    assert found.lines()[1].startswith(f"{'this law ' if given else ''}{said}")


@pytest.mark.slow
def test_the_share_of_the_box_that_will_do_is_named():
    wide = REAL.with_box("ten-percent")
    name, near = nearest_setup(uncertain_plant(wide), F("0.85"))
    assert (name, near.check()) == ("box", Verdict.PROVED)
    assert 0 < near.task.spreads[0] == near.task.spreads[2] < F(1, 10)
    found = TrackingGuarantee(fault=wide, proof=NoProof(reason="x"), nearest=("box", near))
    assert "with the box of +-" in lines(found)[0]
    paper = replace(near, task=replace(near.task, spreads=(F(0), F(0), F(0))))
    assert lines(replace(found, nearest=("box", paper)))[0].startswith("with the box paper: ")
    assert found.to_dict()["nearest"]["value"] == [str(v) for v in near.task.spreads]


@pytest.mark.slow
def test_the_longest_interval_that_will_do_is_named():
    found = qd.guarantee(REAL, step=F("0.2"), longest_step=F("0.9"))
    assert not found.proved
    name, near = found.nearest
    assert (name, near.check()) == ("longest_step", Verdict.PROVED)
    assert F("0.4") < near.sampled_loop.longest_step < F("0.9")
    assert lines(found)[0].startswith("with a longest interval of at most")


@pytest.mark.slow
def test_a_sliding_mode_that_is_late_is_told_the_longest_delay(sliding, task):
    found = qd.guarantee(REAL, controller="cta", step=STEP, delay=F("0.3"))
    name, near = found.nearest
    assert (found.proved, name, near.check()) == (False, "delay", Verdict.PROVED)
    assert near.sampled_loop.delay >= F(9, 10) * longest_delay(task, STEP, kind=sliding).sampled_loop.delay
    assert found.shorter is None or found.shorter.check() is Verdict.PROVED


@pytest.mark.slow
def test_the_longest_step_of_sliding_modes_is_within_a_tenth_of_the_best_of_all_weights(sliding, task):
    """No weight and B0 of a fine grid come near to a guarantee at a T_s a tenth longer."""
    step = longest_step(task, kind=sliding).guarantee.sampled_loop.step
    ratios = np.linspace(0.5, 1.2, 15)
    longer = step * F(10, 9)
    for weight, ratio in product(np.linspace(0.02, 0.6, 30), ratios):
        held = sliding.sampled_loop(task, np.array([weight, ratio]), longer)
        assert distance(task, held)[0] >= 1
    assert isinstance(design_compensated(task, sliding.controller, longer).proof, NoProof)


@pytest.mark.slow
def test_every_command_says_the_same_longest_step_of_sliding_modes(sliding, task):
    longest = longest_step(task, kind=sliding).guarantee.sampled_loop.step
    for step in (STEP, F(2)):
        assert sampled_sliding_mode(task, sliding.controller, step)[1].longest_step == longest
    found = qd.guarantee(REAL, controller="cta", step=F(2))
    assert (found.proved, found.shorter.sampled_loop.step) == (False, longest)
    assert found.lines()[0].startswith("not guaranteed at T_s = 2 s")
    between = qd.guarantee(REAL, controller="cta", step=F("0.7"))  # which the usual weights miss
    assert isinstance(design_compensated(task, sliding.controller, F("0.7")).proof, NoProof)
    assert isinstance(between.proof, TrackingProof)
    assert between.compensation.controller.sampling.step == F("0.7")
