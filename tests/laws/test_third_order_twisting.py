"""3-CTA: the loop, typed in from the literature."""

import numpy as np
import pytest

from quakedesign.laws import law
from quakedesign.symbolic.casadi_printer import to_numpy


def test_the_loop_is_a_chain_of_three_integrators_under_continuous_twisting():
    loop = law("cta3").loop_field()
    k = (1.0, 2.0, 2.5, 0.05, 0.03, 0.01)
    beta, d = 1.3, -0.4
    values = dict(zip((*loop.gains, *loop.uncertain), (*k, beta, d), strict=True))
    for x in np.random.default_rng(3).uniform(-2, 2, (10, 4)):
        found = to_numpy(list(loop.field.values()), values | dict(zip(loop.states, x, strict=True)))
        size, sign = np.abs(x), np.sign(x)
        nu = -k[0] * size[0] ** 0.25 * sign[0] - k[1] * np.cbrt(x[1]) - k[2] * size[2] ** 0.5 * sign[2]
        expected = [x[1], x[2], beta * (nu + x[3]), -np.dot(k[3:], sign[:3]) + d]
        assert [float(v) for v in found] == pytest.approx(expected, rel=1e-12)
