"""Delay with jitter: how old the pressure is that acts."""

import casadi as ca
import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.loop import Actuator, Delay, Quantisation

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


@pytest.mark.parametrize(
    "settings",
    [
        {"jitter": -1},
        {"jitter": 0.5},
        {"jitter": True},
        {"jitter": 101},
        {"jitter": 1, "seed": -1},
    ],
)
def test_what_cannot_be_is_refused(settings):
    with pytest.raises(ParameterError, match=r"whole number"):
        Delay(samples=1, **settings)


def test_a_whole_number_of_numpy_is_one_of_python():
    """Times a tuple, NumPy's would be a product of numbers."""
    assert type(Delay(samples=1, jitter=np.int64(1)).jitter) is int


@pytest.mark.parametrize("part", [-1e-300, 1.0, 1.5, float("nan")])
def test_a_part_is_less_than_a_whole_sample(part):
    with pytest.raises(ParameterError, match="part of a delay must be at least 0 and below 1"):
        Delay(samples=1, part=part)


@pytest.mark.parametrize(
    ("step", "delay", "samples", "part"),
    [
        (0.5, 0.0, 0, 0.0),
        (0.5, 1.25, 2, 0.5),
        (0.1, 0.3, 3, 0.0),  # whose quotient is below 3 in floats
        (1.0, 3 + 0.75e-9, 3, 0.0),
        (1.0, 3 - 0.75e-9, 3, 0.0),
        (1.0, 3 + 1.5e-9, 3, 1.5e-9),
        (1.0, 3 - 1.5e-9, 2, 1 - 1.5e-9),
        (1.0, 1e-9, 0, 0.0),
        (1.0, 1.5e-9, 0, 1.5e-9),
        (0.25, 25.0, 100, 0.0),
    ],
)
def test_a_time_is_so_many_periods_to_a_billionth_of_one_and_a_part(step, delay, samples, part):
    found = Delay.from_options(step, delay=delay)
    assert (found.samples, found.jitter, found.seed) == (samples, 0, 0)
    assert found.part == pytest.approx(part, rel=0, abs=4e-15)
    assert (found.part == 0) is (part == 0)


@pytest.mark.parametrize("delay", [-1e-9, 0.2500001 * 100, 26.0, float("nan"), float("inf")])
def test_a_time_is_at_most_a_hundred_periods(delay):
    with pytest.raises(ParameterError, match=r"delay must be 0 to 100 sampling periods of 0\.25 s"):
        Delay.from_options(0.25, delay=delay)


def test_jitter_is_asked_for_with_a_delay_or_without():
    assert Delay.from_options(0.25, delay=0.5, jitter=3) == Delay(samples=2, jitter=3)
    (without,) = (option.default for option in Delay.options if option.name == "delay")
    assert Delay.from_options(0.25, delay=without, jitter=100) == Delay(samples=0, jitter=100)


def test_a_delay_comes_before_what_the_pump_does():
    quantised, delayed = Quantisation(quantum=1.0), Delay(samples=1)
    assert Actuator(stages=(quantised,)).completed(Actuator(stages=(delayed,))).stages == (delayed, quantised)


def test_before_the_delay_nothing_is_injected():
    assert Delay(samples=3).start == (0.0, 0.0, 0.0)
    assert Delay(samples=1, jitter=2).start[:4] == (0.0, 0.0, 0.0, 1.0)
