import numpy as np
import pytest
import sympy as sp

from quakedesign.loop.steps.stable_ratios import characteristic, growth, ratio, stable_ratios, weight, z


def test_the_polynomial_is_the_one_stated():
    a, b = weight, ratio
    stated = 2 * z**3 + (2 * a * b + 3 * b - 6) * z**2 + (6 - a * b - 4 * b) * z + (a * b + b - 2)
    assert sp.expand(2 * characteristic().as_expr() - z**2 * stated) == 0


@pytest.mark.parametrize("share", ["1/10", "1/2", "3/4", "1"])
def test_the_ratios_are_where_an_eigenvalue_leaves_the_unit_circle(share):
    low, high = stable_ratios(share)
    size = float(sp.Rational(share))
    assert growth(size, float(low)) == pytest.approx(1, abs=1e-7)
    assert growth(size, float(high)) == pytest.approx(1, abs=1e-7)
    assert all(growth(size, gain) < 1 for gain in np.linspace(1.001 * float(low), 0.999 * float(high), 50))
    assert growth(size, 0.99 * float(low)) > 1
    assert growth(size, 1.01 * float(high)) > 1


def test_the_ratios_known_by_hand():
    assert stable_ratios("1/2") == (sp.Rational(8, 15), sp.Rational(8, 5))
    assert stable_ratios(1) == (sp.Rational(2, 3), sp.Rational(4, 3))


def iterate(share, gain, samples=400):
    """The loop itself, without its matrix."""
    e1, e2, held, before, estimate = 1.0, 0.3, 0.0, 0.3, 0.0
    for _ in range(samples):
        estimate += share * (e2 - before - held - estimate)
        held, before = -(e1 + e2) - estimate, e2
        e1, e2 = e1 + e2 + gain * held / 2, e2 + gain * held
    return abs(e1) + abs(e2)


@pytest.mark.parametrize(("share", "gain", "settles"), [(0.5, 1.425, True), (1.0, 1.425, False), (1.0, 1.2, True)])
def test_weight_one_chatters_at_the_largest_gain_of_the_paper(share, gain, settles):
    assert (iterate(share, gain) < 1e-9) is settles
    assert (growth(share, gain) < 1) is settles
