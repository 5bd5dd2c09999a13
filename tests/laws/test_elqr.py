"""e-LQR: eqs. double_integrator and u, and its loop."""

import numpy as np
import pytest
import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.laws import Signals, control_law

ELQR = control_law("elqr")
x1, x2, a, b, xi1, xi2 = sp.symbols("x1 x2 a b xi1 xi2", real=True)
SIGNALS = Signals(slip=x1, slip_rate=x2, slip_error=a, slip_rate_error=b, integrals=(xi1, xi2))


def test_feedback_of_the_state_is_the_print_and_of_the_error_the_remedy():
    # ERRATA 29
    state = ELQR.from_values((2, 3, 5, 7), feedback="state")
    error = ELQR.from_values((2, 3, 5, 7))
    assert sp.expand(state.pressure(SIGNALS) + 2 * x1 + 3 * x2 + 5 * xi1 + 7 * xi2) == 0
    assert sp.expand(error.pressure(SIGNALS) + 2 * a + 3 * b + 5 * xi1 + 7 * xi2) == 0
    assert error.feedback == "error"
    assert state.integral_rates(SIGNALS) == error.integral_rates(SIGNALS) == (a, xi1)


def test_another_feedback_is_refused():
    with pytest.raises(ParameterError, match=r"feedback must be one of error, state\. Received 'output'"):
        ELQR.from_values((1, 1, 1, 1), feedback="output")


def test_the_loop_is_the_companion_matrix_of_its_characteristic_polynomial():
    # λ⁴ + (w + βb k2)λ³ + (βb k1 − s)λ² + βb k3 λ + βb k4 = 0
    loop = ELQR.loop_field()
    matrix = sp.Matrix([[rate.diff(state) for state in loop.states] for rate in loop.field.values()])
    (beta, s, w), (authority,), gains = loop.uncertain, loop.constants, loop.gains
    lam = sp.Symbol("lam")
    k1, k2, k3, k4 = gains
    by_hand = lam**4 + (w + beta * authority * k2) * lam**3 + (beta * authority * k1 - s) * lam**2
    by_hand += beta * authority * (k3 * lam + k4)
    assert sp.expand(matrix.charpoly(lam).as_expr() - by_hand) == 0
    assert np.all(np.array(list(loop.states.values())) == 1)
