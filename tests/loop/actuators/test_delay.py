"""Delay with jitter: how old the pressure is that acts."""

import casadi as ca
import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.loop.actuators import Delay

COUNT = 4000


def ages(stage):
    """Age [samples] of what acts at every sample, from the second hundred on: sample k asks for the pressure k."""
    memory, asked = ca.SX.sym("memory", len(stage.start)), ca.SX.sym("asked")
    acting, after = stage.apply(stage.numbers, ca.vertsplit(memory), asked, 1e-3)
    function = ca.Function("stage", [memory, asked], [ca.vertcat(*after), acting]).mapaccum(COUNT)
    found = function(list(stage.start), np.arange(1, COUNT + 1).reshape(1, -1))[1].full().ravel()
    return (np.arange(1, COUNT + 1) - found)[100:]


def test_without_jitter_the_age_is_the_delay():
    assert set(ages(Delay(samples=2))) == {2}


def test_one_or_two_samples_are_equally_likely_and_independent():
    found = ages(Delay(samples=1, jitter=1, seed=4)) - 1
    assert set(found) == {0, 1}
    assert np.mean(found) == pytest.approx(0.5, abs=4 * 0.5 / np.sqrt(len(found)))
    assert abs(np.corrcoef(found[1:], found[:-1])[0, 1]) < 4 / np.sqrt(len(found))


def test_what_has_acted_is_not_followed_by_anything_older():
    found = ages(Delay(samples=1, jitter=5, seed=2))
    assert set(found) == {1, 2, 3, 4, 5, 6}
    assert np.max(np.diff(found)) <= 1


def test_a_seed_says_everything():
    first, again, other = (ages(Delay(samples=0, jitter=1, seed=seed)) for seed in (1, 1, 2))
    assert (first == again).all()
    assert (first != other).any()


@pytest.mark.parametrize("settings", [{"jitter": -1}, {"jitter": 0.5}, {"jitter": 101}, {"jitter": 1, "seed": -1}])
def test_what_cannot_be_is_refused(settings):
    with pytest.raises(ParameterError, match=r"whole number"):
        Delay(samples=1, **settings)
