"""L1 norms in continuous time against closed forms and against the norms of a loop with jumps that do nothing."""

from dataclasses import replace
from fractions import Fraction as F
from math import exp, pi, sqrt, tanh

import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.guarantees.exact.norms import flow_norms, norms
from quakedesign.loop import PeriodicLoop, Segment, continuous_loop, exact_integrals
from quakedesign.plant import uncertain_plant

GAINS = tuple(map(F, ("2640677339", "523784305.9", "2647975129", "957074176.5")))


def gain(flow, entry, row):
    loop = PeriodicLoop(
        states=tuple(f"x{i}" for i in range(len(flow))),
        flow=tuple(tuple(map(F, line)) for line in flow),
        segments=(),
        inputs={"w": tuple(map(F, entry))},
        outputs={"y": tuple(map(F, row))},
    )
    (found,) = flow_norms(loop)["y", "w"]
    return float(found)


def just_above(found, exact, share=1e-3):
    return exact <= found <= exact * (1 + share)


@pytest.mark.parametrize("rate", ["1/1000000", "1", "1000000"])
def test_a_lag_has_the_gain_of_its_time_whatever_that_is(rate):
    """∫ e^{−λt} dt = 1/λ."""
    assert just_above(gain([[-F(rate)]], [1], [1]), 1 / float(F(rate)))
    assert just_above(gain([[-F(rate), 0], [0, -2]], [1, 1], [1, 0]), 1 / float(F(rate)))


def test_a_fast_and_a_slow_mode_that_oppose_each_other():
    """e^{−t} − e^{−10⁶t} ≥ 0 has the integral 1 − 10⁻⁶; e^{−t} − 2e^{−10⁶t} is zero at t₀ = ln 2/(10⁶ − 1)."""
    modes = [[-1, 0], [0, -1000000]]
    assert just_above(gain(modes, [1, 1], [1, -1]), 1 - 1e-6)
    fast, start = 1e6, 0.6931471805599453 / (1e6 - 1)
    rise, fall = 2 * (1 - exp(-fast * start)) / fast - (1 - exp(-start)), exp(-start) - 2 * exp(-fast * start) / fast
    assert just_above(gain(modes, [1, 1], [1, -2]), rise + fall)


def test_an_oscillator_that_changes_sign_for_ever():
    """y″ + y′/10 + y = w has the gain coth(πζ/(2√(1 − ζ²))), ζ = 1/20."""
    exact = 1 / tanh(pi / 20 / 2 / sqrt(1 - 1 / 400))
    assert just_above(gain([[0, 1], [-1, "-1/10"]], [0, 1], [1, 0]), exact, 0.03)


def test_a_double_pole():
    """∫ t·e^{−t} dt = 1 and ∫ |1 − t|e^{−t} dt = 2/e."""
    assert just_above(gain([[0, 1], [-1, -2]], [0, 1], [1, 0]), 1)
    assert just_above(gain([[0, 1], [-1, -2]], [0, 1], [0, 1]), 2 * exp(-1))


@pytest.mark.parametrize("flow", [[[1]], [[0]], [[0, 1], [-1, 0]], [[0, 1], [0, -1]]])
def test_a_loop_that_is_not_stable_has_no_gain(flow):
    with pytest.raises(ParameterError, match="stable"):
        gain(flow, [1] * len(flow), [1] * len(flow))


def test_the_e_lqr_has_the_gains_of_a_loop_with_jumps_that_do_nothing():
    """Another algorithm: periods of 40 ms, all their phases, summed in the past."""
    task = uncertain_plant(load_fault("real-fault"))
    loop = continuous_loop(exact_integrals(GAINS), task.model, task.authority)
    still = tuple(tuple(F(i == j) for j in range(4)) for i in range(4))
    other = norms(replace(loop, segments=(Segment(jump=still, duration=F(1, 25)),)))
    for key, (found,) in flow_norms(loop).items():
        assert found == pytest.approx(float(max(other[key])), rel=0.02)
