"""Every integrator must converge at its order, and its tableau must be consistent."""

import math

import casadi as ca
import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.simulation import Integrator, integrator, integrators


def final_error(method, field, start, exact, steps, length):
    state, step = np.array(start), length / steps
    for number in range(steps):
        state = method.advance(lambda passed, y, k=number: field((k + passed) * step, y), state, step)
    return float(np.max(np.abs(state - exact)))


PROBLEMS = {
    "decay": (lambda t, y: -y, [1.0], [math.exp(-2)], 2.0),
    "oscillator": (lambda t, y: np.array([y[1], -y[0]]), [1.0, 0.0], [math.cos(3), -math.sin(3)], 3.0),
    "only time": (lambda t, y: np.array([math.cos(t)]), [0.0], [math.sin(2)], 2.0),
    "time and state": (lambda t, y: -2 * t * y, [1.0], [math.exp(-1)], 1.0),
}


@pytest.mark.parametrize("problem", PROBLEMS)
@pytest.mark.parametrize("name", integrators())
def test_the_error_falls_with_the_stated_order(name, problem):
    method = integrator(name)
    coarse, fine = (final_error(method, *PROBLEMS[problem][:3], steps, PROBLEMS[problem][3]) for steps in (20, 40))
    assert math.log2(coarse / fine) > method.order - 0.25


@pytest.mark.parametrize("name", integrators())
def test_names_and_sources_are_given(name):
    method = integrator(name)
    assert method.name == name
    assert method.source
    assert method.order >= 1


@pytest.mark.parametrize("name", integrators())
def test_a_tableau_is_consistent_in_exact_arithmetic(name):
    method = integrator(name)
    assert sum(method.weights) == 1
    assert [sum(row) for row in method.matrix] == list(method.nodes)
    for power in range(1, method.order):
        assert sum(b * c**power for b, c in zip(method.weights, method.nodes, strict=True)) * (power + 1) == 1


def test_the_tableau_gives_the_factor_of_a_decaying_step():
    """R(z) = Σ zⁿ/n! up to the order; the classic method has no other term."""
    method = integrator("rk4")
    A = np.array([[float(share) for share in row] + [0.0] * (4 - len(row)) for row in method.matrix])
    b = np.array([float(weight) for weight in method.weights])
    z = -0.7
    factor = 1 + z * b @ np.linalg.solve(np.eye(4) - z * A, np.ones(4))
    assert factor == pytest.approx(sum(z**n / math.factorial(n) for n in range(5)), rel=1e-14)
    assert method.advance(lambda _, y: -0.7 * y, 1.0, 1.0) == pytest.approx(factor, rel=1e-14)


def test_an_unknown_method_is_refused_with_the_list():
    with pytest.raises(ParameterError, match=r"dormand-prince, rk4.*'euler'"):
        integrator("euler")


def test_a_step_may_be_a_symbol_as_in_a_step_that_is_cut():
    """y' = -y over h by the classic method: 1 - h + h²/2 - h³/6 + h⁴/24."""
    assert issubclass(integrator("rk4"), Integrator)  # whose public name checks what it is called with
    h = ca.SX.sym("h")
    end = ca.Function("end", [h], [integrator("rk4").advance(lambda _, y: -y, ca.SX(1), h)])
    assert float(end(0.5)) == pytest.approx(1 - 0.5 + 0.5**2 / 2 - 0.5**3 / 6 + 0.5**4 / 24, rel=1e-14)
