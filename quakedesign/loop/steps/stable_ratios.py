"""For which input gains the compensated loop is stable near the origin, depending on the weight of its estimate.

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

import sympy as sp

from quakedesign.rationals import rational

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
    import numpy as np

    coefficients = [2, (2 * share + 3) * gain - 6, 6 - (share + 4) * gain, (share + 1) * gain - 2]
    return float(max(abs(np.roots(coefficients))))


def stable_ratios(share: float | str | Fraction) -> tuple[Fraction, Fraction]:
    """Ratios β/β0 [-] between which the loop is stable, for a weight in (0, 1]; exact."""
    a = rational(share, "weight")
    return 4 * a / ((a + 1) * (a + 2)), 4 / (a + 2)
