"""Rows 12 and 13: which friction laws meet the premises of the paper, and where."""

from collections.abc import Callable

import mpmath as mp
import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp

from quakedesign import load_fault
from quakedesign.studies.errata import ErrataRow, Finding

FAULT = load_fault("real-fault")


def held(law, slip):
    """μ(x1), with μ = μ_max for x1 < 0."""
    return law.residual + law.drop * np.exp(-np.maximum(slip, 0) / law.critical_slip)


def printed_law(law, slip):
    """μ(x1) as printed, for every slip."""
    return law.residual + law.drop * np.exp(-slip / law.critical_slip)


def row_12(friction: Callable = held) -> Finding:
    """Drive the fault backwards with a quarter period of the paper's sine; evaluate the law on both sides of x1 = 0."""
    law = FAULT.friction
    slip = np.linspace(-3, 3, 6001)
    low, high = law.bounds
    values, slopes = friction(law, slip), np.diff(friction(law, slip)) / np.diff(slip)
    inside = low <= values.min() and values.max() <= high * (1 + 1e-15)
    inside = inside and np.abs(slopes).max() <= law.drop / law.critical_slip
    toolkit = [float(law.extended(sp.Float(x), sp.Integer(0))) for x in (-1.0, 0.3)]
    agrees = np.allclose(toolkit, friction(law, np.array([-1.0, 0.3])), rtol=1e-12)
    run = backwards()
    wrong = printed_law(law, np.array([-1.0]))[0]
    steep = law.drop / law.critical_slip * np.exp(1 / law.critical_slip)
    return Finding(
        bool(inside and agrees and run < 0 and wrong > high),
        f"from rest under −3.2e-4 sin(0.69t) m/s² the slip reaches {run:.2e} m < 0; at −1 m the printed law gives "
        f"{wrong:.2f} > μ_max = {high:.4f} with slope {steep:.2f}/m; with μ = μ_max for x1 < 0 both bounds hold",
    )


def backwards() -> float:
    """Least slip [m] of the uncontrolled printed plant in 2 s under the paper's sine with the opposite sign."""
    law, load = FAULT.friction, FAULT.authority * FAULT.effective_normal_stress
    shake = FAULT.disturbance

    def field(t, x):
        friction = printed_law(law, x[0]) - law.bounds[1]
        push = -shake.amplitude * np.sin(shake.frequency * t)
        return [x[1], -friction * load - FAULT.specific_stiffness * x[0] - FAULT.specific_damping * x[1] + push]

    return float(solve_ivp(field, (0, 2), [0, 0], rtol=1e-9, atol=1e-15).y[0].min())


# Typical laboratory values for granite: Marone (1998), Annu. Rev. Earth Planet. Sci. 26, 643.
F0, DIRECT, EVOLUTION, V0, SLIP = (mp.mpf(v) for v in ("0.6", "0.015", "0.02", "1e-6", "1e-4"))


def logarithmic(V, theta):
    """Rate-and-state friction in its logarithmic form."""
    return F0 + DIRECT * mp.log(V / V0) + EVOLUTION * mp.log(V0 * theta / SLIP)


def regularised(V, theta):
    """The arcsinh form (Lapusta and others, 2000), which exists at V = 0."""
    return DIRECT * mp.asinh(V / (2 * V0) * mp.exp((F0 + EVOLUTION * mp.log(V0 * theta / SLIP)) / DIRECT))


def row_13(slowest: str = "1e-12") -> Finding:
    """Evaluate both forms towards zero slip rate; find the bounds on a working range; count the order of the plant."""
    theta = SLIP / V0
    with mp.workdps(50):
        dives = logarithmic(mp.mpf("1e-60"), theta)
        standing = regularised(mp.mpf(0), theta)
        slope = mp.diff(lambda v: regularised(v, theta), 0)
        reached = mp.mpf("1e-24")
        least = regularised(mp.mpf(slowest), theta)
        both = abs(regularised(V0, theta) - logarithmic(V0, theta))
    ageing = 1 - 0 * theta / SLIP
    order = characteristic_order()
    holds = dives < 0 and standing == 0 and slope > 1e15 and least > mp.mpf("0.3") and ageing == 1 and order == 3
    return Finding(
        bool(holds and both < 1e-15 and regularised(reached, theta) < least),
        f"logarithmic μ(1e-60 m/s) = {float(dives):.2f}; regularised μ(0) = {float(standing):.0f} with slope "
        f"{float(slope):.1e} s/m; for V ≥ {slowest} m/s μ ≥ {float(least):.3f} at θ ≥ {float(theta):.0f} s; "
        f"ageing at V = 0 gives θ' = {float(ageing):.0f}, no equilibrium; the plant has order {order}",
    )


def characteristic_order() -> int:
    """Degree of the characteristic polynomial of spring, mass and ageing friction about steady sliding, det ≠ 0."""
    V, state, x, m, k, N, a, b, d, s = sp.symbols("V theta x m k N a b d s", positive=True)
    friction = a * sp.log(V) + b * sp.log(state)
    field = sp.Matrix([V, -(N * friction + k * x) / m, 1 - V * state / d])
    J = field.jacobian([x, V, state]).subs(state, d / V)
    polynomial = sp.Poly((s * sp.eye(3) - J).det(), s)
    return polynomial.degree() if sp.simplify(polynomial.coeff_monomial(1)) != 0 else 0


ROWS = (
    ErrataRow(
        number=12,
        printed="μ_res − Δμ e^{−x1/d_c} satisfies the friction bounds",
        correct="only for x1 ≥ 0, which is not invariant; set μ = μ_max for x1 < 0",
        kind="counterexample",
        check=row_12,
    ),
    ErrataRow(
        number=13,
        printed="rate-and-state friction satisfies the friction bounds",
        correct="only on a working range V ≥ V_min > 0, with a friction state: a third-order plant",
        kind="counterexample",
        check=row_13,
    ),
)
