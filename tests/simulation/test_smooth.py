"""Stiff equations under a ramp against their closed form, however late they begin."""

import casadi as ca
import numpy as np
import pytest

from quakedesign.simulation.smooth_integration import Ramp, SmoothProblem

FAST = 1e-5


def problem():
    """y' = load − y/FAST."""
    y, load = ca.SX.sym("y"), ca.SX.sym("load")
    rates = load - y / FAST
    return SmoothProblem(ca.Function("rates", [y, load], [rates, ca.jacobian(rates, y)]), np.array([1.0]), 0, 10.0)


def follow(times, method, *, every_step=False):
    load = Ramp(times[0], (3.0,), (2.0,))
    return problem().integrate(np.array([1.0]), load, np.array(times), every_step=every_step, method=method, rtol=1e-8)


@pytest.mark.parametrize("begin", [0.0, 1e12])
@pytest.mark.parametrize("method", ["radau", "cvodes"])
def test_steps_may_be_shorter_than_what_floats_of_the_time_tell_apart(begin, method):
    """Long after the start y = FAST·(3 + 2t) − 2·FAST²; at 1e12 s floats are 1.2e-4 s apart."""
    found = follow([begin, begin + 0.5, begin + 1.0], method)
    assert found.time.tolist() == [begin, begin + 0.5, begin + 1.0]
    expected = [FAST * (3 + 2 * t) - 2 * FAST**2 for t in (0.5, 1.0)]
    assert found.values[0, 1:] == pytest.approx(expected, abs=1e-7 * FAST)


def test_the_last_step_ends_at_the_last_instant():
    begin, end = 0.1, 0.45
    found = follow([begin, end], "radau", every_step=True)
    assert found.time[0] == begin
    assert found.time[-1] == end
    assert begin + (end - begin) != end


def test_an_event_late_on_the_clock_is_followed_in_steps_that_the_clock_cannot_tell_apart():
    """y' = y²(1 − y)/c waits for 1e9 s and rises in 1e-7 s, where floats are 1.2e-7 s apart.

    From ε it reaches 1/2 after c[1/ε − ln(ε/(1 − ε)) − 2], by separation of variables; here in z = ln y.
    """
    fast, small = 1e-7, 1e-16
    z, load = ca.SX.sym("z"), ca.SX.sym("load")
    rates = ca.exp(z) * (1 - ca.exp(z)) / fast
    function = ca.Function("rates", [z, load], [rates, ca.jacobian(rates, z)])
    late = SmoothProblem(function, np.array([1.0]), 0, np.log(0.5))
    half = fast * (1 / small - np.log(small / (1 - small)) - 2)
    for instants in ([0.0, 2 * half], [0.0, half / 2, 1.5 * half, 2 * half]):
        setting = {"every_step": len(instants) == 2, "method": "radau", "rtol": 1e-9}
        found = late.integrate(np.array([np.log(small)]), Ramp(0.0, (0.0,), (0.0,)), np.array(instants), **setting)
        assert found.crossings == pytest.approx([half], rel=1e-6)
        assert found.values[0, -1] == pytest.approx(0.0, abs=1e-8)
        assert np.all(np.diff(found.time) >= 0)
    assert found.time.tolist() == instants
    assert np.exp(found.values[0, 1]) == pytest.approx(2 * small, rel=1e-6)
