"""The compensated step as matrices: against its recursion, written out, and against the run of the scheme itself."""

from fractions import Fraction as F

import numpy as np
import pytest

from quakedesign import simulate
from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.guarantees.search.compensated_search import implicit_pull
from quakedesign.laws import ImplicitStep, Power, compensated, control_law
from quakedesign.laws.implicit_root import pulled, step_solution
from quakedesign.loop import simulation_scheme

STEP, AUTHORITY, WEIGHT = F("0.184"), F("2.25e-8"), F("0.3")
GAIN = STEP * AUTHORITY
ROOT = ImplicitStep(pull=(Power(factor=(F(1), F(1)), exponent=F(0), argument="slip"),))


def matrices(law):
    return (np.array(rows, dtype=float) for rows in (law.update, law.measured, law.output, law.feedback))


def test_the_matrices_are_the_recursion():
    f, g, c, d = matrices(compensated(ROOT, WEIGHT, GAIN))
    random = np.random.default_rng(1)
    z, before, asked, estimate = np.zeros(3), 0.0, 0.0, 0.0
    for _ in range(20):
        y = e1, e2, w = random.standard_normal(3)
        estimate = 0.7 * estimate + 0.3 * ((e2 - before) / float(GAIN) - asked)
        before, asked = e2, (w - e2) / float(GAIN) - estimate
        assert c @ z + d @ y == pytest.approx(asked, rel=1e-12)
        z = f @ z + g @ y
        assert e1 != e2


@pytest.mark.parametrize("scale", ["1", "0.1"])
def test_the_scheme_asks_for_the_pressure_of_the_matrices(scale):
    """400 samples of a run of the 2-CTA, errors in and pressures out; the root is found anew by bisection."""
    fault = load_fault("real-fault")
    law = control_law("cta").from_values(("7", "5", "2.3", "1.1"), scale=scale, divisor=F(2353, 125000000000))
    scheme = simulation_scheme("compensated", weight=0.3, authority=float(AUTHORITY))
    run = simulate(fault, law, scheme=scheme, duration=400 * 0.184, samples=401, compiled=False)
    f, g, c, d = matrices(compensated(ROOT, WEIGHT, GAIN))
    z, found, k, step = np.zeros(3), [], float(GAIN / law.divisor), float(STEP)
    k1, k2, k3, k4 = (v * k * float(law.scale) ** p for v, p in zip((7, 5, 2.3, 1.1), (2 / 3, 0.5, 1, 1), strict=True))

    def excess(w, e1, e2):
        end = e1 + step * w
        smooth = w - e2 + k1 * np.cbrt(end) + k2 * np.sign(w) * abs(w) ** 0.5
        return smooth + step * (k3 * np.sign(end) + k4 * np.sign(w))

    for e1, e2 in zip(run.slip_error, run.slip_rate_error, strict=True):
        low, high = -1.0, 1.0
        for _ in range(100):
            middle = (low + high) / 2
            low, high = (low, middle) if excess(middle, e1, e2) > 0 else (middle, high)
        y = np.array([e1, e2, low])
        found.append(c @ z + d @ y)
        z = f @ z + g @ y
    assert np.abs(run.pressure).max() > 1e3
    assert np.abs(np.array(found) - run.pressure)[:-1].max() < 1e-9 * np.abs(run.pressure).max()


def test_floats_of_a_sum_of_powers():
    nested = (Power(factor=(F(1), F(3)), exponent=F(3, 2), argument="rate"),)
    terms = (Power(factor=(F(2), F(2)), exponent=F(1, 3), argument=nested), *ROOT.pull)
    assert pulled(terms, -1.0, 4.0) == pytest.approx(2 * 16 ** (1 / 3) - 1)
    assert list(pulled(terms, np.array([0.0, 1.0]), np.array([0.0, -4.0]))) == pytest.approx([0, 1 - 2 * 16 ** (1 / 3)])


def test_a_weight_of_one_forgets_the_estimate():
    assert compensated(ROOT, F(1), GAIN).update[2] == (-1, -1, 0)


@pytest.mark.parametrize(
    ("weight", "gain", "said"),
    [
        (F(0), GAIN, r"^weight of a compensated step must be above 0 and at most 1\. Received 0\."),
        (1 + F(1, 10**8), GAIN, r"^weight of a compensated step .* Received 1\.00000001\."),
        (WEIGHT, F(0), r"^the input gain of a model must be positive\. Received 0 "),
    ],
)
def test_impossible_weights_and_gains_are_refused(weight, gain, said):
    with pytest.raises(ParameterError, match=said):
        compensated(ROOT, weight, gain)


def test_roots_in_arrays_solve_their_equation():
    """Away from the jump w − e2 + q vanishes; at the jump e1 + T·w is 0 and the sides of the sign differ in sign."""
    law = control_law("cta").from_values(("7", "5", "2.3", "1.1"), scale="0.1", divisor=F(2353, 125000000000))
    pull, step = implicit_pull(law, STEP, AUTHORITY), float(STEP)
    random = np.random.default_rng(2)
    e1, e2 = random.standard_normal((2, 400)) * 10.0 ** random.uniform(-8, 0, (2, 400))
    w = step_solution(pull, step, e1, e2)
    held = np.abs(e1 + step * w) <= 4e-16 * np.abs(e1)
    assert 40 < held.sum() < 360
    residual = np.abs(w - e2 + pulled(pull, e1 + step * w, w))[~held & (w != 0)]
    assert np.all((residual < 1e-9) | (np.abs(w[~held & (w != 0)]) < 1e-14))
    sides = [w - e2 + pulled(pull, sign * np.full(400, 1e-300), w) for sign in (1, -1)]
    assert np.all((sides[0] >= 0)[held])
    assert np.all((sides[1] <= 0)[held])
