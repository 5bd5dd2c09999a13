"""Laws for far wells are found from near ones on; where there is none, the answer says which V or well has a proof."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from quakedesign.exact import UpperBound
from quakedesign.fault import Fault, Reference, friction_law
from quakedesign.guarantees import NoProof, SampledLoop, SlidingClaims, SlidingProof
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search import sliding_design
from quakedesign.guarantees.search.sliding_design import (
    LOG_RATES,
    FarthestWell,
    admissible_step,
    farthest,
    possible_remedy,
    searched_sliding,
)
from quakedesign.guarantees.sliding_result import _beyond
from quakedesign.laws import LinearLaw
from quakedesign.plant import WHOLE, slow_sliding_plant
from quakedesign.studies.performance_limits import limits

GOUGE = friction_law("rate-and-state-aging")(
    reference_coefficient=0.6,
    direct_effect=0.008,
    evolution_effect=0.0125,
    critical_slip=6e-5,
    reference_rate=1e-9,
    slowest_rate=1e-20,
    fastest_rate=10.0,
)
FAULT = Fault(
    name="far",
    density=2600.0,
    shear_modulus=30e9,
    length=4000.0,
    damping=7.06e13,
    effective_normal_stress=40e6,
    friction=GOUGE,
    reference=Reference(target_slip=0.05, operation_time=552000.0),
    sampling_time=33.0,
    source="a test",
)
TASK, STEP = slow_sliding_plant(FAULT, Fraction(1)), Fraction(33)
CLAIMS = SlidingClaims(**{name: UpperBound(Fraction(1)) for name in SlidingClaims.__dataclass_fields__})


def held(noise):
    law = LinearLaw(states=(), update=(), measured=(), output=(), feedback=(Fraction(1), Fraction(0)))
    return SampledLoop(law=law, step=STEP, diffusion=Fraction(500), slip_noise=noise)


def proved(task, held, log_rate):
    return SlidingProof(task=task, sampled_loop=held, cuts=WHOLE, claims=CLAIMS)


@pytest.mark.slow
def test_a_law_for_a_far_well_is_found_from_nearer_ones_on():
    """L²/D is 3.8 D_c/V, through which the usual starts lead to no law."""
    setup = ExactSetup(diffusion=Fraction(2531))
    assert searched_sliding(TASK, STEP, LOG_RATES[-1], setup)[0] is None
    reach = farthest(TASK, STEP, setup, stressed=False)
    assert reach.share == 1
    assert (reach.sampled_loop.diffusion, reach.sampled_loop.step) == (2531, 33)


def test_where_a_well_is_too_far_a_slower_task_and_a_nearer_well_are_named():
    setup = ExactSetup(diffusion=Fraction(20000))
    reach = farthest(TASK, STEP, setup, stressed=False, most=Fraction(1, 40))
    assert reach.share == Fraction(1, 40)
    said = possible_remedy(FAULT, TASK, reach, setup, proved, spread=Fraction(0))
    assert "at this V for L^2/D = 500 s with T_s = 33 s under a stress of at most 1 Pa" in said
    # 40 times slower with 5 % spare: 552000 s · 42 = 2.3e7 s, D_c/(20 V) = 6e-5 · 2.3e7/(20 · 0.05) s
    assert "operation_time = '2.3e+07 s', sampling_time = '1300 s'" in said
    assert "for V = 2.17e-09 m/s" in said
    assert "extrapolated" not in said
    known = replace(FAULT, friction=replace(GOUGE, slowest_rate=1e-8, reference_rate=1e-8))
    said = possible_remedy(known, TASK, reach, setup, proved, spread=Fraction(0))
    assert "(but V = 2.17e-09 m/s is below the rates of the working range" in said

    def unproved(task, held, log_rate):
        return NoProof(reason="")

    assert possible_remedy(FAULT, TASK, reach, setup, unproved, spread=Fraction(0)).startswith("a smaller spread")


def test_where_the_slip_noise_is_too_large_a_smaller_one_is_named(monkeypatch):
    """Found at a hundredth: a tenth is tried before, and none after that."""
    reach = FarthestWell(share=Fraction(1, 40), sampled_loop=held(Fraction(1, 10**7)), numbers=np.zeros(9))
    monkeypatch.setattr(sliding_design, "searched_sliding", lambda *_, **__: (None, np.zeros(9)))
    setup = ExactSetup(diffusion=Fraction(20000), slip_noise=Fraction(1, 10**7))
    for most, said in (
        (Fraction(1, 10**7), "a proof was found at this V for L^2/D = 500 s"),
        (Fraction(1, 10**9), "a proof was found with slip noise of at most 1 nm at this V for L^2/D = 500 s"),
        (Fraction(0), "a proof was found with exact measurements of slip at this V for L^2/D = 500 s"),
        (Fraction(-1), "a smaller spread, stress or noise may help"),
    ):
        tried = []

        def up_to(task, held, log_rate, most=most, tried=tried):
            tried.append(held.slip_noise)
            return proved(task, held, log_rate) if held.slip_noise <= most else NoProof(reason="")

        assert possible_remedy(FAULT, TASK, reach, setup, up_to, spread=Fraction(0)).startswith(said)
        assert tried[0] == Fraction(1, 10**7)


def test_where_no_law_is_found_near_the_fault_nothing_is_promised():
    reach = farthest(replace(TASK, stress=Fraction(10**9)), STEP, ExactSetup(lag=Fraction(600)), stressed=False)
    assert (reach.share, reach.sampled_loop) == (0, None)
    assert possible_remedy(FAULT, TASK, reach, {}, proved, spread=Fraction(0)).startswith(
        "no guarantee was found even with a much shorter path"
    )


def test_a_well_that_no_controller_reaches_the_fault_through_is_said_to_be_one():
    """From the same L²/D on as `limits` says with T_s = 33 s, but for what T_s makes of it."""
    found = limits(FAULT, stress=1e4, prove=False).largest_diffusion_time.impossible_beyond
    assert _beyond(FAULT, Fraction(10**4), ExactSetup(diffusion=found * Fraction(999, 1000))) == ""
    assert _beyond(FAULT, Fraction(10**4), ExactSetup(lag=found * 2)) == ""
    said = _beyond(FAULT, Fraction(10**4), ExactSetup(diffusion=found * Fraction(21, 20)))
    assert said.startswith("no controller whose pressure stays within 40 MPa of what the reference needs")


@pytest.mark.parametrize(("step", "suits"), [(20, 20), (60, 60), (15, 33), (120, 33)])
def test_a_sampling_time_is_kept_within_twice_what_suits(step, suits):
    assert admissible_step(TASK, Fraction(step)) == suits
