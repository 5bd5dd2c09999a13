"""Bad disturbances: feasible, as bad as the closed forms say, and never beyond a certified bound."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest
from mpmath import mp, quad

from quakedesign.errors import ParameterError
from quakedesign.synthesis.linear.disturbance_search import bang_bang, rate_limited, response, switched
from quakedesign.synthesis.linear.peak_search import find_peak_bound
from quakedesign.synthesis.linear.plant.polytope import ErrorLoop

LOOP = ErrorLoop(
    gains=(F(104), F(14), F(150), F(78)),
    authority=F(1),
    beta=(F(1), F(57, 40)),
    slip=(F(-1), F(29, 10)),
    rate=(F(23, 10), F(23, 10)),
)
# (z + 1)(z + 2)(z + 3)(z + 4) = z⁴ + 10z³ + 35z² + 50z + 24
KNOWN = ErrorLoop(
    gains=(F(35), F(9), F(50), F(24)), authority=F(1), beta=(F(1), F(1)), slip=(F(0), F(0)), rate=(F(1), F(1))
)
ONLY = (F(1), F(0), F(1))


def test_bang_bang_reaches_the_integral_of_the_impulse_response():
    # force → e1 is z²/((z+1)(z+2)(z+3)(z+4)): partial fractions by hand
    residues = {-1: mp.mpf(1) / 6, -2: mp.mpf(4) / -2, -3: mp.mpf(9) / 2, -4: mp.mpf(16) / -6}

    def impulse(t):
        return abs(sum(r * mp.exp(p * t) for p, r in residues.items()))

    exact = quad(impulse, [i * mp.mpf("0.05") for i in range(400)])
    found = bang_bang(KNOWN, ONLY, 3.0, "slip_error")
    assert found.peak == pytest.approx(3 * float(exact), rel=1e-3)
    assert found.peak <= 3 * float(exact) * (1 + 1e-9)
    assert np.abs(response(KNOWN, found, "slip_error")[-1]) == pytest.approx(found.peak, rel=1e-9)


def test_the_rate_limited_force_is_in_its_class_and_reaches_what_it_says():
    corner = next(LOOP.corners())
    found = rate_limited(LOOP, corner, 2.0, 3.0, "slip_rate_error")
    assert np.abs(found.force).max() <= 2 * (1 + 1e-9)
    assert np.abs(np.diff(found.force)).max() <= 3 * found.step * (1 + 1e-6)
    A = np.array([[float(v) for v in row] for row in LOOP.matrix(*corner)])
    x, times = np.zeros(4), np.arange(len(found.force)) * found.step
    fine = 20
    for k in range((len(times) - 1) * fine):
        t, h = k * found.step / fine, found.step / fine

        def rate(t, x):
            return A @ x + np.array([0, np.interp(t, times, found.force), 0, 0])

        a = rate(t, x)
        b = rate(t + h / 2, x + h / 2 * a)
        c = rate(t + h / 2, x + h / 2 * b)
        x = x + h / 6 * (a + 2 * b + 2 * c + rate(t + h, x + h * c))
    assert abs(x[1]) == pytest.approx(found.peak, rel=1e-4)


def test_the_rate_limited_class_lies_between_a_step_at_the_start_and_the_amplitude_class():
    corner = next(LOOP.corners())
    peaks = [rate_limited(LOOP, corner, 1.0, r, "slip_rate_error").peak for r in (1e-2, 1.0, 1e3)]
    A = np.array([[float(v) for v in row] for row in LOOP.matrix(*corner)])
    # e2 after a step in the force is the impulse response of the slip error: Σ residues of z²/D
    poles = np.linalg.eigvals(A)
    slopes = np.polyval(np.polyder(np.poly(A)), poles)
    times = np.linspace(0, 10, 20001)
    step = np.abs((np.exp(np.outer(times, poles)) @ (poles**2 / slopes)).real).max()
    assert peaks == sorted(peaks)
    assert step * 0.95 < peaks[0] < step * 1.02
    assert peaks[-1] == pytest.approx(bang_bang(LOOP, corner, 1.0, "slip_rate_error").peak, rel=0.05)


@pytest.mark.parametrize("output", ["slip_error", "slip_rate_error"])
def test_nothing_found_is_beyond_the_certified_bound(output):
    certified = float(find_peak_bound(LOOP, {"force": F(1)}, output).bound)
    limited = float(find_peak_bound(LOOP, {"force": F(1), "force_rate": F(1)}, output).bound)
    fixed = max(bang_bang(LOOP, c, 1.0, output).peak for c in LOOP.corners())
    free = [switched(LOOP, 1.0, output, seed) for seed in range(2)]
    slow = max(rate_limited(LOOP, c, 1.0, 1.0, output).peak for c in LOOP.corners())
    assert max(fixed, *(f.peak for f in free)) < certified < 4 * fixed
    assert slow < limited < 10 * slow
    assert max(f.peak for f in free) > 0.97 * fixed
    for f in free:
        assert np.abs(response(LOOP, f, output)).max() < certified


def test_an_unstable_loop_is_refused():
    weak = replace(LOOP, gains=tuple(-g for g in LOOP.gains))
    with pytest.raises(ParameterError, match="stable loop"):
        bang_bang(weak, next(weak.corners()), 1.0, "slip_error")
