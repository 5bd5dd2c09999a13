"""Running means."""

import casadi as ca
import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.loop.sensing import Averaging


def pass_on(stage, slips):
    memory, slip = ca.SX.sym("memory", len(stage.start)), ca.SX.sym("slip")
    seen, after = stage.pass_on([], ca.vertsplit(memory), slip)
    function = ca.Function("stage", [memory, slip], [ca.vertcat(*after), seen]).mapaccum(len(slips))
    return function(list(stage.start), np.reshape(slips, (1, -1)))[1].full().ravel()


@pytest.mark.parametrize("samples", [1, 2, 5])
def test_it_is_the_mean_of_the_last_readings(samples):
    slips = np.random.default_rng(0).normal(size=40)
    wanted = np.convolve(slips, np.ones(samples) / samples)[:40]
    assert pass_on(Averaging(samples=samples), slips) == pytest.approx(wanted, abs=1e-15)


def test_noise_falls_with_the_root_and_a_ramp_lags_by_half_the_window():
    noise = np.random.default_rng(1).normal(size=40000)
    assert pass_on(Averaging(samples=16), noise)[16:].std() == pytest.approx(1 / 4, rel=0.03)
    assert pass_on(Averaging(samples=5), np.arange(20.0))[10:] == pytest.approx(np.arange(10.0, 20.0) - 2)


@pytest.mark.parametrize("samples", [0, 1001, True, 2.0])
def test_what_cannot_be_is_refused(samples):
    with pytest.raises(ParameterError, match=r"mean|samples of Averaging must be a whole number"):
        Averaging(samples=samples)
