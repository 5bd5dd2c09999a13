"""Super-twisting: the loop, typed in from the literature."""

import numpy as np
import pytest

from quakedesign.laws import law
from quakedesign.symbolic.casadi_printer import to_numpy


def test_the_loop_is_that_of_levant():
    # s' = β(−k1 |s|^½ sign s + ξ), ξ' = −k2 sign s + d
    loop = law("super-twisting").loop_field()
    assert [s.name for s in loop.states] == ["e1", "e2"]
    k1, k2, beta, d = 1.5, 1.1, 1.3, -0.4
    values = dict(zip((*loop.gains, *loop.uncertain), (k1, k2, beta, d), strict=True))
    for s, xi in np.random.default_rng(3).uniform(-2, 2, (10, 2)):
        found = to_numpy(list(loop.field.values()), values | dict(zip(loop.states, (s, xi), strict=True)))
        expected = [beta * (-k1 * np.sqrt(abs(s)) * np.sign(s) + xi), -k2 * np.sign(s) + d]
        assert [float(v) for v in found] == pytest.approx(expected, rel=1e-12)
