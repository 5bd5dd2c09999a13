"""Rows 1 to 4, 24 and 26: the plant, its linearisation and its constants."""

import math
from collections.abc import Callable

import mpmath as mp
import numpy as np
import sympy as sp

from quakedesign import derive, load_fault
from quakedesign.studies.errata import ErrataRow, Finding
from quakedesign.symbolic import plant


# Any smooth friction will do for a derivative; this one depends on slip and slip rate.
def friction(x, v):
    """1/3 + e^{−3x}/10 − log(1 + v² + v/2)/7, with the slopes −3/10 and −1/14 at the origin."""
    return mp.mpf(1) / 3 + mp.exp(-3 * x) / 10 - mp.log(1 + v**2 + v / 2) / 7


def printed_entries(k, eta, N, effective, slope, rate_slope):
    """Lower row of the Jacobian as the paper prints it (without pressure in either entry)."""
    return -k - N * effective["without p"] * slope, -eta - rate_slope


def correct_entries(k, eta, N, effective, slope, rate_slope):
    """Lower row of the Jacobian with the effective stress σ' − p in both entries."""
    return -k - N * effective["with p"] * slope, -eta - N * effective["with p"] * rate_slope


def row_01(entries: Callable = correct_entries) -> Finding:
    """Compare a formula for the Jacobian with mpmath derivatives of the force balance, 50 digits, random constants."""
    worst = {entries: mp.mpf(0), printed_entries: mp.mpf(0)}
    rng = np.random.default_rng(1)
    with mp.workdps(50):
        for _ in range(20):
            mass, k, eta, area, sigma, p = (mp.mpf(int(n)) / 64 for n in rng.integers(1, 400, size=6))
            rest = k * 2 + friction(0, 0) * area * (sigma - p)  # spring force that holds the block at x1 = 0

            def acceleration(x, v, mass=mass, k=k, eta=eta, area=area, stress=sigma - p, rest=rest):
                return (-friction(x, v) * area * stress + rest - k * (x + 2) - eta * v) / mass

            true = [mp.diff(acceleration, (0, 0), n) for n in ((1, 0), (0, 1))]
            stress = {"with p": sigma - p, "without p": sigma}
            for formula in worst:
                said = formula(k / mass, eta / mass, area / mass, stress, mp.mpf(-3) / 10, mp.mpf(-1) / 14)
                worst[formula] = max(worst[formula], *(abs(a - b) for a, b in zip(true, said, strict=True)))
    symbols = (plant.k_hat, plant.eta_hat, plant.N_hat)
    stress = {"with p": plant.sigma - plant.p, "without p": plant.sigma}
    derived = plant.jacobian()[1, :] - sp.Matrix([entries(*symbols, stress, plant.slip_slope, plant.rate_slope)])
    agrees = derived.applyfunc(sp.expand).is_zero_matrix
    right, wrong = float(worst[entries]), float(worst[printed_entries])
    return Finding(
        bool(right < 1e-25 < wrong and agrees),
        f"20 random plants: error against mpmath derivatives at most {right:.0e}, of the printed entries {wrong:.3g}",
    )


def either(determinant, trace):
    """Unstable when either condition holds."""
    return (determinant < 0) | (trace > 0)


def row_02(unstable: Callable = either) -> Finding:
    """Compare the rule with the eigenvalues of 4000 random plants, and with the pole of the paper's own fault."""
    lower = np.random.default_rng(2).normal(size=(4000, 2))
    matrices = np.zeros((4000, 2, 2))
    matrices[:, 0, 1], matrices[:, 1] = 1, lower
    growing = np.linalg.eigvals(matrices).real.max(axis=1) > 0
    wrong = int((unstable(-lower[:, 0], lower[:, 1]) != growing).sum())
    both = int((((-lower[:, 0] < 0) & (lower[:, 1] > 0)) != growing).sum())
    fault = load_fault("real-fault")
    law = fault.friction
    stiffness = fault.specific_stiffness - fault.authority * fault.effective_normal_stress * law.slip_slope
    pole = max(np.roots([1, fault.specific_damping, stiffness]).real)
    called = bool(unstable(stiffness, -fault.specific_damping)) and derive(fault).unstable
    return Finding(
        wrong == 0 and both > 0 and called and round(pole, 3) == 0.468,
        f"{wrong} of 4000 random plants misclassified ({both} with 'and'); the real fault's pole is {pole:+.4f} 1/s",
    )


def row_03(power: int = 1) -> Finding:
    """Take k = G·L^power through ω_n = √(k/m); k̄ = G/L_ac and k = k̄L_ac² fix the power, printed ω_n and λ_t test it."""
    length, modulus = sp.symbols("L G", positive=True)
    exact = sp.simplify(modulus / length * length**2 - modulus * length**power) == 0
    pace, swapped = {}, {}
    for name in ("real-fault", "lab-fault"):
        fault = load_fault(name)
        mass = fault.density * fault.length**3
        pace[name] = math.sqrt(fault.shear_modulus * fault.length**power / mass)
        swapped[name] = math.sqrt(fault.shear_modulus / fault.length / mass)
    ratio = pace["lab-fault"] / pace["real-fault"]
    printed = 184.17
    double = 2 * load_fault("lab-fault").shear_modulus * 0.1
    holds = exact and round(pace["real-fault"], 2) == 0.69 and abs(ratio / printed - 1) < 1e-4
    return Finding(
        holds and round(double / 1000, 1) == 45.1,
        f"ω_n = {pace['real-fault']:.3f} and {pace['lab-fault']:.1f} rad/s, ratio {ratio:.2f} = λ_t; with G/L_ac "
        f"{swapped['real-fault']:.1e} rad/s; 2·G·L_ac = {double / 1000:.1f} N/mm is the footnote's double interface",
    )


def row_04(constant: float = 0.0) -> Finding:
    """Take M_w of both faults from M0 = L³Δτ and compare their difference with ⅔log10 λ_M0 − constant."""
    moments = []
    for name in ("real-fault", "lab-fault"):
        fault = load_fault(name)
        moments.append(fault.length**3 * fault.friction.drop * fault.effective_normal_stress)
    magnitudes = [2 / 3 * math.log10(moment) - 6.07 for moment in moments]
    difference, ratio = magnitudes[0] - magnitudes[1], magnitudes[0] / magnitudes[1]
    said = 2 / 3 * math.log10(moments[0] / moments[1]) - constant
    return Finding(
        abs(difference - said) < 1e-12 and round(difference, 3) == 11.044,
        f"M_w = {magnitudes[0]:.2f} and {magnitudes[1]:.2f}: difference {difference:.3f}, quotient {ratio:.2f}; "
        f"the printed factor is {difference - 6.07:.2f}",
    )


def row_24(residual: Callable = lambda k, v, t: k * v * t) -> Finding:
    """Shift the balance with a moving far end by the equilibrium at t = 0 and see what is left at the origin."""
    t, N, sigma, k, eta, v, friction = sp.symbols("t N sigma k eta v mu", positive=True)
    z, rate = sp.symbols("z rate")
    acceleration = -friction * N * sigma + k * (v * t - z) + eta * (v - rate)
    rest = sp.solve(acceleration.subs({rate: 0, t: 0}), z)[0]
    left = sp.simplify(acceleration.subs({z: rest, rate: 0}) - residual(k, v, t))
    fault = load_fault("real-fault")
    rates = fault.reference.operation_time * fault.specific_stiffness
    plate = 1e-9  # a fast plate boundary, 3.2 cm a year
    return Finding(
        left == 0 and sp.simplify(acceleration.subs({z: rest, rate: 0})) != 0,
        f"residual − k̂v∞t = {left}; a plate rate of 1 nm/s (3.2 cm/year) adds {rates * plate:.2g} m/s² over the real "
        f"fault's task, against {fault.disturbance.amplitude:.2g} m/s² of the sine",
    )


def next_rest(name: str) -> mp.mpf:
    """Smallest positive root [m] of (μ(0) − μ(x))σ'A = kx, by bracketing in mpmath."""
    fault = load_fault(name)
    law, area = fault.friction, mp.mpf(fault.length) ** 2

    def drive(x):
        fall = law.drop * (1 - mp.exp(-x / law.critical_slip))
        return fall * fault.effective_normal_stress * area - mp.mpf(fault.shear_modulus) * fault.length * x

    furthest = law.drop * fault.effective_normal_stress * area / (mp.mpf(fault.shear_modulus) * fault.length)
    return mp.findroot(drive, (furthest / 10, furthest), solver="anderson")


def row_26(rest: tuple[float, float] = (7.098e-3, 0.7846)) -> Finding:
    """Solve the statics of both faults; evaluate the printed reference past its end."""
    found = float(next_rest("lab-fault")), float(next_rest("real-fault"))
    agrees = all(abs(a / b - 1) < 1e-4 for a, b in zip(found, rest, strict=True))
    toolkit = [load_fault(name).rest_slip for name in ("lab-fault", "real-fault")]
    agrees = agrees and np.allclose(found, toolkit, rtol=1e-10)
    late = 2**3 * (10 - 15 * 2 + 6 * 2**2)
    return Finding(
        bool(agrees and found[0] < 7.5e-3 and late > 1),
        f"next equilibrium at {found[0] * 1e3:.3f} mm and {found[1] * 1e3:.1f} mm, below 7.5 mm; "
        f"r(2t_op) = {late} d_max",
    )


ROWS = (
    ErrataRow(
        number=1,
        printed="J22 = −η̂ − ∂μ/∂x2, J21 with σ′ alone",
        correct="J22 = −η̂ − N̂(σ′−p)∂μ/∂x2, J21 = −k̂ − N̂(σ′−p)∂μ/∂x1",
        kind="symbolic identity",
        check=row_01,
    ),
    ErrataRow(
        number=2,
        printed="unstable when k < −Aσ′μ_x1, η < −mμ_x2 (a comma, not 'or')",
        correct="k < −A(σ′−p)μ_x1 or η < −A(σ′−p)μ_x2",
        kind="counterexample",
        check=row_02,
    ),
    ErrataRow(number=3, printed="k = G/L_ac", correct="k = G·L_ac", kind="numeric reproduction", check=row_03),
    ErrataRow(
        number=4,
        printed="λ_Mw = ⅔log10 λ_M0 − 6.07, as a ratio",
        correct="M_w differs by ⅔log10 λ_M0; there is no ratio",
        kind="numeric reproduction",
        check=row_04,
    ),
    ErrataRow(
        number=24,
        printed="δ∞ = v∞t with a fixed equilibrium",
        correct="the shifted system keeps the residual k̂v∞t",
        kind="symbolic identity",
        check=row_24,
    ),
    ErrataRow(
        number=26,
        printed="d_max = 7.1 mm and 7.5 mm; r(t) for every t",
        correct="the next static equilibrium is at 7.098 mm (784.6 mm); r stays constant after t_op",
        kind="numeric reproduction",
        check=row_26,
    ),
)
