"""The explicit scheme against the law of the paper, stepped by hand."""

import numpy as np

from quakedesign.fault import load_fault
from quakedesign.laws import control_law
from quakedesign.simulation import simulate

REAL = load_fault("real-fault")


def test_the_two_cta_is_stepped_forward():
    divisor = 2353 / 125000000000
    law = control_law("cta").from_values(("7", "5", "2.3", "1.1"), scale="1/1000", divisor="2353/125000000000")
    run = simulate(REAL, law, scheme="explicit", duration=100 * 0.184, samples=100, compiled=False)
    e1, e2, xi = run.slip_error, run.slip_rate_error, run.integrals[0]
    scale = 1e-3
    nu = -(scale ** (2 / 3)) * 7 * np.cbrt(e1) - np.sqrt(scale) * 5 * np.sign(e2) * np.sqrt(np.abs(e2)) + xi
    assert np.allclose(run.pressure, nu / divisor, rtol=1e-12, atol=1e-9)
    rate = -scale * 2.3 * np.sign(e1) - scale * 1.1 * np.sign(e2)
    assert np.allclose(np.diff(xi), 0.184 * rate[:-1], rtol=1e-9, atol=1e-18)
    assert xi[0] == 0
