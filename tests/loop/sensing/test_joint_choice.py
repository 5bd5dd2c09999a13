"""The joint condition on bound and sampling period, against loops that track and loops that do not."""

import json
import math
from dataclasses import replace

import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.laws import control_law, published
from quakedesign.loop import simulation_scheme
from quakedesign.loop.sensing import Differentiator, OutputFeedback, joint_condition, smallest_bound
from quakedesign.loop.sensing.choice import pressure_difference
from quakedesign.simulation import simulate

LAB = load_fault("lab-fault")
PUBLISHED = published("lab-fault")
IDLE = control_law("elqr")(gains=dict.fromkeys(PUBLISHED["elqr"].gain_units, 0))
ACCELERATION = {1e-5: 0.073, 1e-4: 3.0}  # of the sampled 2-CTA with exact states [m/s²]


def tracks(differentiator):
    scheme = simulation_scheme("explicit", measurement=OutputFeedback(differentiator=differentiator))
    options = {"step": differentiator.step, "scheme": scheme, "plant": "printed"}
    run = simulate(LAB, PUBLISHED["cta"], duration=1.0, samples=50, **options)
    return run.metrics is not None and run.metrics.max_slip_error < 1e-5


def test_the_swing_of_a_linear_law_is_its_gains_times_the_errors():
    assert pressure_difference(PUBLISHED["elqr"], 1e-6, 1e-3) == pytest.approx(4.17e8 * 1e-6 + 6.94e5 * 1e-3)


@pytest.mark.parametrize("signs", [(1, 1), (1, -1), (-1, 1), (-1, -1)])
def test_errors_of_either_sign_are_thought_of(signs):
    gains = dict.fromkeys(PUBLISHED["elqr"].gain_units, 0)
    slip, rate, *_ = gains
    law = control_law("elqr")(gains=gains | {slip: 3 * 10**8 * signs[0], rate: 7 * 10**5 * signs[1]})
    assert pressure_difference(law, 1e-6, 1e-3) == pytest.approx(300 + 700, rel=1e-12)


def test_without_a_pressure_the_bound_is_the_acceleration_which_it_must_exceed():
    """Up to 1e12, and to the last digits: halving 24 decades as often as floats can tell."""
    d = Differentiator(bound=0.25, step=1e-4)
    at, below = (joint_condition(LAB, IDLE, d, acceleration=a) for a in (0.25, math.nextafter(0.25, 0)))
    assert (at.required, at.ratio, at.holds, below.holds) == (0.25, 1.0, False, True)
    assert at.to_dict()["required"] == 0.25
    assert (at.slip_error, at.rate_error) == (below.slip_error, below.rate_error)
    for acceleration in (1e-9, 0.0035, 73.0, 0.9e12):
        assert smallest_bound(LAB, IDLE, d, acceleration=acceleration) == pytest.approx(acceleration, rel=1e-13)
    assert smallest_bound(LAB, IDLE, d, acceleration=1.1e12) is None


def test_unless_told_there_is_no_noise():
    d = Differentiator(bound=100.0, step=1e-4)
    assert joint_condition(LAB, IDLE, d, acceleration=1.0) == joint_condition(LAB, IDLE, d, acceleration=1.0, noise=0.0)
    assert smallest_bound(LAB, PUBLISHED["cta"], d, acceleration=3.0) == smallest_bound(
        LAB, PUBLISHED["cta"], d, acceleration=3.0, noise=0.0
    )


def test_the_swing_of_the_sliding_mode_is_that_of_its_powers_astride_the_origin():
    a, b = 1e-9, 1e-6
    nu = 7.5 * 500 ** (2 / 3) * 2 * (a / 2) ** (1 / 3) + 5 * 500**0.5 * 2 * (b / 2) ** 0.5
    assert pressure_difference(PUBLISHED["cta"], a, b) == pytest.approx(nu * 1385 / 4, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("step", "discretisation"), [(1e-5, "homogeneous"), (1e-4, "homogeneous"), (1e-4, "implicit")])
def test_the_loop_tracks_from_the_smallest_bound_on_and_is_lost_well_below(step, discretisation):
    d = Differentiator(bound=1.0, step=step, discretisation=discretisation)
    least = smallest_bound(LAB, PUBLISHED["cta"], d, acceleration=ACCELERATION[step])
    assert tracks(replace(d, bound=1.5 * least))
    assert not tracks(replace(d, bound=least / 8))


def test_for_a_linear_law_the_sampling_period_decides():
    explicit, implicit = (
        Differentiator(bound=1.0, step=1e-4, discretisation=name) for name in ("homogeneous", "implicit")
    )
    law = PUBLISHED["elqr"]
    assert smallest_bound(LAB, law, explicit, acceleration=0.0035) is None
    assert smallest_bound(LAB, law, implicit, acceleration=0.0035) == pytest.approx(0.0035, rel=0.2)
    assert smallest_bound(LAB, law, replace(implicit, step=1e-3), acceleration=0.0035) is None


def test_a_second_derivative_that_jumps_meets_no_bound_on_the_third():
    d = Differentiator(bound=1e9, step=1e-5, order=2, filter_order=2)
    found = joint_condition(LAB, PUBLISHED["elqr"], d, acceleration=0.0035)
    assert (found.required, found.ratio, found.holds) == (math.inf, math.inf, False)
    assert json.loads(json.dumps(found.to_dict(), allow_nan=False))["ratio"] is None
    with pytest.raises(ParameterError, match="order must be 1"):
        smallest_bound(LAB, PUBLISHED["elqr"], d, acceleration=0.0035)


def test_noise_asks_for_more():
    d = Differentiator(bound=100.0, step=1e-4)
    quiet, loud = (joint_condition(LAB, PUBLISHED["cta"], d, acceleration=3.0, noise=n) for n in (0.0, 1e-5))
    assert quiet.holds
    assert quiet.ratio == pytest.approx(quiet.required / 100)
    assert loud.required > quiet.required
    assert loud.rate_error > quiet.rate_error
    with pytest.raises(ParameterError, match="acceleration"):
        joint_condition(LAB, PUBLISHED["cta"], d, acceleration=-1.0)
