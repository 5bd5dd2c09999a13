"""The simulated experiments against an independent integrator, closed forms and differences."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from quakedesign.fault import friction_law
from quakedesign.identification.experiment import START_RATE, START_STATE, TREND, Difference, step
from quakedesign.identification.identify import set_up
from quakedesign.identification.loading import prepared
from quakedesign.identification.two_states import with_two_states

SPECIFICATION = importlib.util.spec_from_file_location("synthetic_records", Path(__file__).with_name("synthetic.py"))
synthetic = importlib.util.module_from_spec(SPECIFICATION)
sys.modules[SPECIFICATION.name] = synthetic
SPECIFICATION.loader.exec_module(synthetic)


def experiment(made):
    """Experiment of a record without noise, and the true coordinates."""
    record, loading = prepared(made.noisy(0))
    setup = set_up(record, friction_law(made.law), made.stiffness, loading)
    values = made.true_at(getattr(setup.experiment.law, "reference_rate", None))
    return setup.experiment, setup.experiment.near(values)


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
        moved[i] = 1e-5 if simulated.coordinates[i].logarithmic else 1e-7
        difference = (simulated.friction(truth + moved) - simulated.friction(truth - moved)) / (2 * moved[i])
        off = np.abs(difference - slopes[:, i]) > 1e-6 * np.max(np.abs(slopes[:, i]))
        assert off.sum() <= 1  # the sample at which a stick ends, where friction has a kink


def test_the_difference_of_effects_is_a_coordinate_like_any_other():
    simulated, truth = experiment(synthetic.KINDS["velocity steps, ageing"]())
    turned = Difference(whole=simulated, first=1, seconds=(2,))
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
    assert drawn.slip(truth)[0][-1] == drawn.slip(truth)[0][-3]


@pytest.mark.parametrize("kind", ["velocity steps, ageing", "slide-hold-slide, stiffness fitted"])
def test_slopes_by_trend_and_unsteady_beginning_are_those_of_differences(kind):
    made = synthetic.KINDS[kind]()
    record, loading = prepared(made.noisy(0))
    law = friction_law(made.law)
    plain, wide = (set_up(record, law, made.stiffness, loading, more).experiment for more in ((), (TREND, START_STATE)))
    values = made.true_at(plain.law.reference_rate)
    at = wide.near(values | {TREND: 30.0, START_STATE: 0.3, START_RATE: 0.2})
    wide = wide.resolved(at, 1e-5)
    slopes = wide.slopes(at)
    for i, coordinate in enumerate(wide.coordinates):
        moved = np.zeros(len(at))
        moved[i] = {TREND: 3e-4, "evolution_effect": 1e-7}.get(coordinate.name, 1e-5)
        difference = (wide.friction(at + moved) - wide.friction(at - moved)) / (2 * moved[i])
        np.testing.assert_allclose(difference, slopes[:, i], atol=1e-6 * np.max(np.abs(slopes[:, i])))
    steady = at.copy()
    steady[[-1, -2, -3]] = 0
    same = plain.resolved(plain.near(wide.outward(steady)), 1e-7).friction(plain.near(wide.outward(steady)))
    np.testing.assert_allclose(wide.resolved(steady, 1e-7).friction(steady), same, atol=1e-6)
    first = wide.friction(at)[0] - same[0]
    assert first == pytest.approx(0.3 * values["evolution_effect"] + 0.2 * values["direct_effect"])
    steady[-1] = 30.0
    path = record.load_point - record.load_point[0]
    np.testing.assert_allclose(wide.resolved(steady, 1e-7).friction(steady) - same, 30 * path, atol=2e-6)


def test_two_states_are_those_of_an_independent_integrator():
    """The second effect is negative; SciPy's Radau on equations written down here."""
    made = synthetic.KINDS["velocity steps, ageing"]()
    record, loading = prepared(made.noisy(0))
    experiment = set_up(record, with_two_states(made.law), made.stiffness, loading).experiment
    a, b, d, second, far, mu, k = 0.008, 0.010, 1e-5, -0.004, 6e-5, 0.6, 1e-3 / 1e-6
    told = {"direct_effect": a, "evolution_effect": b, "critical_slip": d, "second_effect": second, "second_slip": far}
    values = told | {"reference_coefficient": mu}
    at = experiment.near(values)
    found = experiment.resolved(at, 1e-7).friction(at)
    y, exact, begins = np.log([1e-6, d / 1e-6, far / 1e-6]), [], [*loading.pieces.begins, record.time[-1] + 1]

    def rates(speed):
        def of(_time, y):
            v, ages = np.exp(y[0]), np.exp(y[1:])
            change = 1 / ages - v / np.array([d, far])
            return [(k * (speed - v) - b * change[0] - second * change[1]) / a, *change]

        return of

    for begin, end, speed in zip(begins[:-1], begins[1:], loading.pieces.rates, strict=True):
        inside = record.time[(record.time >= begin) & (record.time < end)]
        run = solve_ivp(rates(speed), (begin, end), y, "Radau", t_eval=[*inside, end], rtol=1e-9, atol=1e-11)
        v, one, two = run.y[:, :-1]
        exact += (
            mu + a * (v - np.log(1e-6)) + b * (np.log(1e-6 / d) + one) + second * (np.log(1e-6 / far) + two)
        ).tolist()
        y = run.y[:, -1]
    np.testing.assert_allclose(found, exact, atol=3e-6)
