"""For which input gains the loop of the scheme compensated is stable near the origin, by the weight a of it.

Near the origin the powers below one are steep, and the implicit step ends at e1⁺ = 0, that is at w = −e1/T_s. In units
of T_s and β0 the controller then asks for u = −(e1 + e2) − d, the true plant moves by e2⁺ = e2 + bu and
e1⁺ = e1 + e2 + bu/2 with b = β/β0, and the estimate with weight a by
d⁺ = (1 − a)d + a(e2 − e2⁻ − u⁻). This loop is linear. Two of its eigenvalues are zero, the others are the roots of

    2z³ + (2ab + 3b − 6)z² + (6 − ab − 4b)z + (ab + b − 2).

By Jury's criterion they lie inside the unit circle if and only if

    4a/((a + 1)(a + 2)) < b < 4/(a + 2):

at the upper end a root reaches −1, at the lower one a complex pair leaves. For a = 1/2 these are 8/15 and 8/5, a range
of 3; for a = 1 they are 2/3 and 4/3, a range of 2; without an estimate the upper end is 2. Friction alone lets β vary
by μ_max/μ_res, 1.425 for the faults of the paper: with β0 the smallest β, the weight 1 must chatter as long as β is
above 4/3, and the weight 1/2 does not. Noise of the slip rate reaches the estimate with the gain a/(T_sβ0).
"""

from fractions import Fraction

import numpy as np
import pytest
import sympy as sp

weight, ratio, z = sp.symbols("a b z", positive=True)


def characteristic() -> sp.Poly:
    """Characteristic polynomial in z of the loop, from its matrix in (e1, e2, u⁻, d, e2⁻)."""
    estimate = sp.Matrix([[0, weight, -weight, 1 - weight, -weight]])
    control = sp.Matrix([[-1, -1, 0, 0, 0]]) - estimate
    slip = sp.Matrix([[1, 1, 0, 0, 0]]) + ratio / 2 * control
    rate = sp.Matrix([[0, 1, 0, 0, 0]]) + ratio * control
    loop = sp.Matrix.vstack(slip, rate, control, estimate, sp.Matrix([[0, 1, 0, 0, 0]]))
    return sp.Poly((z * sp.eye(5) - loop).det(), z)


def growth(share: float, gain: float) -> float:
    """Largest modulus of an eigenvalue [-] for a weight and a ratio β/β0."""
    coefficients = [2, (2 * share + 3) * gain - 6, 6 - (share + 4) * gain, (share + 1) * gain - 2]
    return float(max(abs(np.roots(coefficients))))


def stable_ratios(share: str) -> tuple[Fraction, Fraction]:
    """Ratios β/β0 [-] between which the loop is stable, for a weight in (0, 1]; exact."""
    a = Fraction(share)
    return 4 * a / ((a + 1) * (a + 2)), 4 / (a + 2)


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
