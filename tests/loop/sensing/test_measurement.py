"""Noise of the measurement: the generator in whole numbers, and its statistics."""

import casadi as ca
import numpy as np
import pytest
from scipy.stats import kstest

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.loop.sensing.measurement import EXACT, Measurement
from quakedesign.simulation import simulate


def stream(measurement, count):
    """Measured values of a fault at rest."""
    state, x = ca.SX.sym("state", 2), ca.SX.sym("x", 2)
    seen, after = measurement.measure(list(measurement.numbers), ca.vertsplit(state), x)
    step = ca.Function("measure", [state, x], [seen, ca.vertcat(*after)])
    memory, found, kept = measurement.start, [], []
    for _ in range(count):
        value, memory = step(memory, [0, 0])
        found.append(value.full().ravel())
        kept.append(tuple(memory.full().ravel()))
    return np.array(found), kept


def test_the_generator_is_that_of_whole_numbers():
    measurement = Measurement(slip_noise=1.0, rate_noise=1.0, seed=5)
    a, b = map(int, measurement.start)
    for first, second in stream(measurement, 50)[1]:
        for _ in range(4):
            a, b = 40014 * a % 2147483563, 40692 * b % 2147483399
        assert (first, second) == (a, b)


def test_the_noise_is_normal_white_and_independent():
    values, _ = stream(Measurement(slip_noise=2.0, rate_noise=0.5, seed=1), 4000)
    for column, size in zip(values.T, (2.0, 0.5), strict=True):
        assert kstest(column / size, "norm").pvalue > 1e-3
        assert abs(np.corrcoef(column[1:], column[:-1])[0, 1]) < 0.06
    assert abs(np.corrcoef(values.T)[0, 1]) < 0.06


def test_bounded_noise_is_anything_within_its_bounds():
    values, _ = stream(Measurement(slip_noise=2.0, rate_noise=0.5, seed=1, bounded=True), 4000)
    for column, size in zip(values.T, (2.0, 0.5), strict=True):
        assert 0.99 * size < np.abs(column).max() <= size
        assert kstest(column / size, "uniform", (-1, 2)).pvalue > 1e-3
        assert abs(np.corrcoef(column[1:], column[:-1])[0, 1]) < 0.06
    assert abs(np.corrcoef(values.T)[0, 1]) < 0.06


def test_a_seed_fixes_the_run_and_another_one_changes_it():
    fault = load_fault("lab-fault")
    runs = [
        simulate(
            fault, scheme="explicit", duration=0.05, compiled=False, measurement=Measurement(slip_noise=1e-9, seed=s)
        )
        for s in (1, 1, 2)
    ]
    assert np.array_equal(runs[0].slip, runs[1].slip)
    assert Measurement(slip_noise=1.0, seed=1).start != Measurement(slip_noise=1.0, seed=2).start


def test_without_noise_nothing_is_carried():
    assert (EXACT.numbers, EXACT.start, EXACT.noisy) == ((), (), False)


@pytest.mark.parametrize("options", [{"slip_noise": -1.0}, {"rate_noise": float("nan")}, {"seed": -1}, {"seed": 1.5}])
def test_meaningless_noise_is_refused(options):
    with pytest.raises(ParameterError):
        Measurement(**options)
