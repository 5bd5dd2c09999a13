"""The simulated experiments against an independent integrator, closed forms and differences."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from quakedesign.fault import friction_law
from quakedesign.identification.experiment import Difference
from quakedesign.identification.identify import set_up
from quakedesign.identification.record import first_rate
from quakedesign.identification.sliding_experiment import step

SPECIFICATION = importlib.util.spec_from_file_location("synthetic_records", Path(__file__).with_name("synthetic.py"))
synthetic = importlib.util.module_from_spec(SPECIFICATION)
sys.modules[SPECIFICATION.name] = synthetic
SPECIFICATION.loader.exec_module(synthetic)


def experiment(made):
    """Experiment of a record without noise, and the true coordinates."""
    setup = set_up(made.noisy(0), friction_law(made.law), made.stiffness)
    values = made.true_at(getattr(setup.experiment.law, "reference_rate", None))
    return setup.experiment, setup.experiment.inward([values[c.name] for c in setup.experiment.coordinates])


def test_the_step_is_of_third_order():
    import casadi as ca

    def field(y):
        return ca.vertcat(y[1] * ca.sin(y[0]) - y[0], -(y[0] ** 2) - 3 * y[1])

    y, length = ca.SX.sym("y", 2), ca.SX.sym("length")
    one = ca.Function("one", [y, length], list(step(field, y, length)))
    exact = solve_ivp(
        lambda _, y: [y[1] * np.sin(y[0]) - y[0], -(y[0] ** 2) - 3 * y[1]], (0, 1), [1, 0.5], rtol=1e-12, atol=1e-13
    ).y[:, -1]
    errors = []
    for count in (20, 40):
        at = ca.DM([1, 0.5])
        for _ in range(count):
            at, _ = one(at, 1 / count)
        errors.append(np.max(np.abs(at.full().ravel() - exact)))
    assert 7 < errors[0] / errors[1] < 9
    assert np.all(one([3, 4], 0)[0].full().ravel() == [3, 4])


@pytest.mark.parametrize("kind", synthetic.KINDS)
def test_simulated_friction_is_that_of_an_independent_integrator(kind):
    made = synthetic.KINDS[kind]()
    simulated, truth = experiment(made)
    exact = made.friction if made.slip is None else made.friction[-len(simulated.slip) :]
    tolerance = 2e-6 if made.law.startswith("rate") else 0.17 / 2.5e-3 * 2e-6
    assert np.max(np.abs(simulated.resolved(truth, 1e-7).friction(truth) - exact)) < tolerance


@pytest.mark.parametrize("kind", synthetic.KINDS)
def test_slopes_are_those_of_differences(kind):
    simulated, truth = experiment(synthetic.KINDS[kind]())
    simulated = simulated.resolved(truth, 1e-5)
    slopes = simulated.slopes(truth)
    for i in range(len(truth)):
        moved = np.zeros(len(truth))
        moved[i] = 1e-5
        difference = (simulated.friction(truth + moved) - simulated.friction(truth - moved)) / 2e-5
        off = np.abs(difference - slopes[:, i]) > 1e-6 * np.max(np.abs(slopes[:, i]))
        assert off.sum() <= 1  # the sample at which a stick ends, where friction has a kink


def test_the_difference_of_effects_is_a_coordinate_like_any_other():
    simulated, truth = experiment(synthetic.KINDS["velocity steps, ageing"]())
    turned = Difference(whole=simulated, first=1, second=2)
    at = turned.difference(truth)
    assert at[1] == pytest.approx(0.008 - 0.010)
    np.testing.assert_allclose(turned.friction(at), simulated.friction(truth), rtol=1e-12)
    moved = np.array([0, 1e-7, 0, 0])
    difference = (turned.friction(at + moved) - turned.friction(at - moved)) / 2e-7
    np.testing.assert_allclose(difference, turned.slopes(at)[:, 1], rtol=1e-5, atol=1e-6)
    assert not np.any(np.isfinite(turned.friction(at - np.array([0, 0.009, 0, 0]))))


def test_a_spring_softer_than_friction_falls_holds_no_block():
    simulated, truth = experiment(synthetic.drawn())
    truth[3] = np.log(0.99 * 0.17 / 2.5e-3 * synthetic.NORMAL)
    assert not np.any(np.isfinite(simulated.friction(truth)))


def test_a_block_does_not_slip_back_when_the_load_point_returns():
    made = synthetic.drawn()
    simulated, truth = experiment(made)
    returned = np.concatenate([made.load_point, made.load_point[-1] - np.array([1e-4, 2e-4])])
    drawn = type(simulated)(
        law=simulated.law,
        load_point=returned,
        normal=np.full(len(returned), synthetic.NORMAL),
        coordinates=simulated.coordinates,
        stiffness=None,
    )
    friction = drawn.friction(truth)
    assert np.diff(friction)[-2:] == pytest.approx([-0.02, -0.02])
    assert drawn.slip(truth)[-1] == drawn.slip(truth)[-3]


def test_the_first_rate_is_that_before_the_first_step():
    time = np.arange(0, 100, 0.1)
    position = 1e-6 * np.minimum(time, 50) + 2e-6 * np.maximum(time - 50, 0)
    assert first_rate(time, position) == pytest.approx(1e-6, rel=1e-3)
    assert first_rate(time, np.round(position / 1e-6) * 1e-6) == pytest.approx(1e-6, rel=3e-2)
    noise = 1e-8 * np.random.default_rng(0).standard_normal(len(time))
    assert first_rate(time, position + noise) == pytest.approx(1e-6, rel=1e-3)
    late = np.array([0.0, 10.0, *range(11, 40)])  # two samples before the step, in uneven time
    assert first_rate(late, np.where(late <= 10, late, 10 * late - 90)) == pytest.approx(1)
