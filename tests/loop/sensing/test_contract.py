"""What everything that tells a law slip and slip rate must keep, that of users included."""

import math
import pickle

import casadi as ca
import numpy as np
import pytest
from own_parts import Backward, Offset

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.laws import control_law
from quakedesign.loop.sensing import Averaging, Differentiator, OutputFeedback, Sensor, Transducer
from quakedesign.loop.sensing.measurement import Measurement
from quakedesign.simulation import simulate

REAL = load_fault("real-fault")
STEP = REAL.sampling_time
LAW = control_law("elqr").from_values(("2e7", "2e7", "2e6", "2e4"))
ESTIMATE = Differentiator(bound=1e-3, step=STEP)
EXAMPLES = {
    "exact": (Measurement(), 0.0),
    "differentiator": (OutputFeedback(differentiator=ESTIMATE), 0.0),
    "averaging": (OutputFeedback(differentiator=ESTIMATE, stages=(Averaging(samples=3),)), 0.0),
    "transducer": (OutputFeedback(differentiator=ESTIMATE, stages=(Transducer(bandwidth=10.0),)), 0.0),
    "own stage": (OutputFeedback(differentiator=ESTIMATE, stages=(Offset(offset=0.25),)), 0.25),
    "own sensor": (Backward(period=STEP), 0.0),
}
NOISY = {
    "noise": Measurement(slip_noise=1e-6, rate_noise=1e-6, seed=4),
    "noisy transducer": OutputFeedback(differentiator=ESTIMATE, stages=(Transducer(deviation=1e-6, seed=4),)),
}
ALL = {name: sensor for name, (sensor, _) in EXAMPLES.items()} | NOISY


def told(sensor, motion):
    """Slip and slip rate that a law is told over samples of a motion."""
    memory, x = ca.SX.sym("memory", sensor.size), ca.SX.sym("x", 2)
    seen, after = sensor.measure([*map(ca.SX, sensor.numbers)], ca.vertsplit(memory), x)
    step = ca.Function("step", [memory, x], [seen, ca.vertcat(*after)])
    kept, found = ca.DM(sensor.start), []
    for state in motion:
        seen, kept = step(kept, state)
        found.append(seen.full().ravel())
    return np.array(found)


@pytest.mark.parametrize("name", ALL)
def test_it_is_a_value_whose_memory_keeps_its_size(name):
    sensor = ALL[name]
    assert isinstance(sensor, Sensor)
    assert pickle.loads(pickle.dumps(sensor)) == sensor
    assert sensor.size == len(sensor.start)
    assert all(math.isfinite(v) for v in (*sensor.numbers, *sensor.start))
    assert told(sensor, [[0.0, 0.0]] * 3).shape == (3, 2)
    assert sensor.software.software == sensor.software


@pytest.mark.parametrize("name", EXAMPLES)
def test_of_a_slip_that_stays_it_tells_the_slip_and_no_rate(name):
    sensor, offset = EXAMPLES[name]
    still = told(sensor, [[0.5, 0.0]] * 4000)
    assert still[-1] == pytest.approx([0.5 + offset, 0.0], abs=2e-4)


@pytest.mark.parametrize("name", ALL)
def test_one_that_needs_the_slip_alone_does_not_look_at_the_rate(name):
    sensor = ALL[name]
    one, other = (told(sensor, [[0.1 * k, rate] for k in range(5)]) for rate in (0.0, 7.0))
    assert np.array_equal(one, other) is sensor.of_slip_alone


@pytest.mark.parametrize("name", ALL)
def test_a_loop_runs_with_it(name):
    found = simulate(
        REAL, LAW, scheme="explicit", measurement=ALL[name], duration=50 * STEP, samples=50, compiled=False
    )
    assert np.all(np.isfinite(found.slip))


@pytest.mark.parametrize("name", ALL)
def test_one_made_for_a_step_refuses_another(name):
    sensor = ALL[name]
    if sensor.step is None:
        sensor.require_step(3 * STEP)
        return
    sensor.require_step(STEP)
    with pytest.raises(ParameterError, match="sampling period must be that of the sensor"):
        sensor.require_step(3 * STEP)
