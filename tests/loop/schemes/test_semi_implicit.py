"""The semi-implicit scheme against the same inclusion, searched over all of its pieces by hand."""

import numpy as np
import pytest

from quakedesign.fault import load_fault
from quakedesign.laws import control_law
from quakedesign.simulation import simulate

REAL = load_fault("real-fault")
STEP = 0.184


def end_rate(e1, e2, xi, scale):
    """w = c − T(A·Sgn(e1 + Tw) + B·Sgn(w)): on the pieces between the jumps, or at one of them."""
    first = scale ** (2 / 3) * 7 * np.cbrt(abs(e1)) + STEP * scale * 2.3
    second = np.sqrt(scale * abs(e2)) * 5 + STEP * scale * 1.1
    free = e2 + STEP * xi
    for a in (-1, 1):
        for b in (-1, 1):
            w = free - STEP * (a * first + b * second)
            if np.sign(e1 + STEP * w) == a and np.sign(w) == b:
                return w
    for w in (0.0, -e1 / STEP):
        if w == 0:
            rest, size = free - STEP * np.sign(e1) * first, STEP * second
        else:
            rest, size = free - w - STEP * np.sign(w) * second, STEP * first
        if abs(rest) <= size:
            return w
    raise AssertionError("the pieces cover the line")


@pytest.mark.parametrize("scale", ["1/4000", "1/10"])
def test_the_pressure_is_that_of_the_piecewise_linear_inclusion(scale):
    law = control_law("cta").from_values(("7", "5", "2.3", "1.1"), scale=scale, divisor="2353/125000000000")
    run = simulate(REAL, law, scheme="semi-implicit", duration=300 * STEP, samples=300, compiled=False)
    number = float(law.scale)
    ends = [end_rate(*x, number) for x in zip(run.slip_error, run.slip_rate_error, run.integrals[0], strict=True)]
    expected = (np.array(ends) - run.slip_rate_error) / STEP / float(law.divisor)
    assert np.allclose(run.pressure, expected, rtol=1e-9, atol=1e-7)
    assert np.max(np.abs(run.pressure)) > 1e3
