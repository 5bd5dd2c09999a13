"""Noise and bandwidth of the transducer."""

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.stats import kstest

from quakedesign.errors import ParameterError
from quakedesign.loop.sensing import Transducer

STEP = 1e-3


def pass_on(stage, slips):
    memory, slip = ca.SX.sym("memory", len(stage.start)), ca.SX.sym("slip")
    seen, after = stage.pass_on([*map(ca.SX, stage.numbers(STEP))], ca.vertsplit(memory), slip)
    function = ca.Function("stage", [memory, slip], [ca.vertcat(*after), seen]).mapaccum(len(slips))
    return function(list(stage.start), np.reshape(slips, (1, -1)))[1].full().ravel()


def test_noise_is_normal_white_and_of_the_stated_deviation():
    found = pass_on(Transducer(deviation=3e-6, seed=5), np.full(20000, 0.002)) - 0.002
    assert kstest(found / 3e-6, "norm").pvalue > 0.01
    assert abs(np.corrcoef(found[1:], found[:-1])[0, 1]) < 4 / math.sqrt(20000)


def test_a_seed_says_everything():
    once, again, other = (pass_on(Transducer(deviation=1e-6, seed=s), np.zeros(50)) for s in (1, 1, 2))
    assert (once == again).all()
    assert (once != other).all()


def test_the_bandwidth_is_where_the_power_is_halved():
    time = STEP * np.arange(20000)
    found = pass_on(Transducer(bandwidth=2.0), np.sin(2 * np.pi * 2.0 * time))[10000:]
    assert np.max(np.abs(found)) == pytest.approx(1 / math.sqrt(2), rel=0.01)


def test_a_held_slip_is_followed_exactly():
    found = pass_on(Transducer(bandwidth=10.0), np.ones(100))
    assert found == pytest.approx(1 - np.exp(-2 * np.pi * 10 * STEP * np.arange(1, 101)), rel=1e-12)


def test_without_noise_and_limit_of_bandwidth_nothing_happens():
    stage = Transducer()
    assert stage.start == ()
    assert (pass_on(stage, [0.1, 0.2]) == [0.1, 0.2]).all()


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"deviation": -1.0}, "deviation"),
        ({"quantum": -1.0}, "quantum"),
        ({"bandwidth": 0.0}, "bandwidth"),
        ({"bandwidth": math.nan}, "bandwidth"),
    ],
)
def test_what_cannot_be_is_refused(settings, named):
    with pytest.raises(ParameterError, match=named):
        Transducer(**settings)


def test_a_reading_is_the_nearest_multiple_of_the_quantum():
    slips = np.linspace(-3e-6, 3e-6, 401)
    found = pass_on(Transducer(quantum=1e-7), slips)
    assert np.rint(found / 1e-7) == pytest.approx(found / 1e-7, abs=1e-9)
    assert np.max(np.abs(found - slips)) <= 0.5e-7 * (1 + 1e-9)


def test_what_is_rounded_is_the_noisy_slip_behind_the_filter():
    """With noise of many quanta rounding adds q²/12 to its variance (Bennett 1948)."""
    noisy = Transducer(deviation=1e-6, bandwidth=50.0, seed=3)
    smooth, found = (pass_on(stage, np.full(20000, 1e-3)) for stage in (noisy, replace(noisy, quantum=1e-6)))
    assert np.std(found - smooth) == pytest.approx(1e-6 / math.sqrt(12), rel=0.02)
    assert abs(np.mean(found - smooth)) < 4e-6 / math.sqrt(12 * 20000)
