"""Every integrator to a tolerance must meet it on closed forms, stiff ones too, and refuse what it cannot do."""

import casadi as ca
import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.simulation import integrators
from quakedesign.simulation.integrators import StoppedError, adaptive_integrators, any_integrator

SHARES = np.arange(1, 41) / 40
STIFFNESS = 1e6


def problem(size, *outputs, parameters=0):
    time, y, p = ca.SX.sym("t"), ca.SX.sym("y", size), ca.SX.sym("p", parameters)
    return ca.Function("rates", [time, y, p], [ca.vertcat(*output(time, y, p)) for output in outputs])


# field, start, length, values at a time
PROBLEMS = {
    "decay": (lambda t, y, p: [-y], [1.0], 5.0, lambda t: [np.exp(-t)]),
    "oscillator": (lambda t, y, p: [y[1], -y[0]], [1.0, 0.0], 6.0, lambda t: [np.cos(t), -np.sin(t)]),
    "time": (lambda t, y, p: [-2 * t * y], [1.0], 2.0, lambda t: [np.exp(-(t**2))]),
    "stiff": (  # Prothero and Robinson (1974)
        lambda t, y, p: [-STIFFNESS * (y - ca.cos(t)) - ca.sin(t)],
        [1.0],
        6.0,
        lambda t: [np.cos(t)],
    ),
}


def error(name, case, rtol):
    field, start, length, exact = PROBLEMS[case]
    scales = np.ones(len(start))
    flow = adaptive_integrators()[name].flow(problem(len(start), field), scales, SHARES, rtol=rtol)
    values, _ = flow.follow(0.0, length, np.array(start))
    return np.max(np.abs(values - np.array(exact(SHARES * length))))


@pytest.mark.parametrize("case", PROBLEMS)
@pytest.mark.parametrize("name", adaptive_integrators())
def test_the_error_follows_the_tolerance(name, case):
    errors = [error(name, case, rtol) for rtol in (1e-5, 1e-8, 1e-11)]
    assert all(found < 300 * rtol for found, rtol in zip(errors, (1e-5, 1e-8, 1e-11), strict=True))
    assert errors[1] < 0.05 * errors[0]


@pytest.mark.parametrize("name", adaptive_integrators())
def test_it_answers_at_any_start_with_parameters_and_integrates_along(name):
    """y' = −p·y from t = 3 over 2 s, and ∫y² dt; sizes of 1e-9 and 1e9 do not matter."""
    rates = problem(2, lambda t, y, p: [-p[0] * y[0], t * 1e9], lambda t, y, p: [y[0] ** 2], parameters=1)
    flow = adaptive_integrators()[name].flow(rates, [1e-9, 1e9], [0.25, 1.0], rtol=1e-10, quadratures=1)
    values, integrals = flow.follow(3.0, 2.0, np.array([1e-9, 0.0]), [0.7])
    passed = np.array([0.5, 2.0])
    assert np.allclose(values[0], 1e-9 * np.exp(-0.7 * passed), rtol=1e-8, atol=0)
    assert np.allclose(values[1], 1e9 * ((3 + passed) ** 2 - 9) / 2, rtol=1e-8)
    assert np.allclose(integrals[0], 1e-18 * (1 - np.exp(-1.4 * passed)) / 1.4, rtol=1e-6, atol=0)


@pytest.mark.parametrize("name", adaptive_integrators())
def test_a_solution_that_ends_in_finite_time_stops_it(name, capfd):
    """y' = y² from 1 has no value at t = 1."""
    flow = adaptive_integrators()[name].flow(problem(1, lambda t, y, p: [y**2]), [1.0], [1.0], rtol=1e-8)
    with pytest.raises(StoppedError):
        flow.follow(0.0, 2.0, np.array([1.0]))


@pytest.mark.parametrize("name", adaptive_integrators())
@pytest.mark.parametrize("rtol", [0.0, 1e-14, 0.1, float("nan")])
def test_a_tolerance_that_means_nothing_is_refused(name, rtol):
    with pytest.raises(ParameterError, match="rtol must be"):
        adaptive_integrators()[name].flow(problem(1, lambda t, y, p: [y]), [1.0], [1.0], rtol=rtol)


@pytest.mark.parametrize("name", adaptive_integrators())
def test_names_and_sources_are_given(name):
    assert any_integrator(name).name == name
    assert any_integrator(name).source
    assert name not in integrators()


def test_both_kinds_are_listed_for_an_unknown_one():
    with pytest.raises(ParameterError, match=r"dormand-prince, rk4.*cvodes, idas.*'euler'"):
        any_integrator("euler")
