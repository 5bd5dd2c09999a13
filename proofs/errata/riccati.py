"""Rows 6 to 11: the bound on the uncertainty behind the e-LQR, and the point about which it holds."""

from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import product

import control
import numpy as np
import sympy as sp
from scipy.linalg import expm
from scipy.optimize import minimize_scalar

from quakedesign import load_fault
from quakedesign.laws import Signals, control_law
from quakedesign.lyapunov.exact.perturbation_bounds import least_authority
from quakedesign.plant import uncertain_plant
from quakedesign.studies.errata import ErrataRow, Finding
from quakedesign.symbolic import plant

FAULT = load_fault("real-fault")
MEGA = 1e6  # p in MPa, as Q0 = 1e-6·I needs it
B_LEAST = FAULT.friction.residual * FAULT.authority * MEGA  # μ_res·N̂ [m/(s² MPa)]
LOAD = FAULT.authority * FAULT.effective_normal_stress  # N̂σ' [m/s²]
SPRING, DAMPING = FAULT.specific_stiffness, FAULT.specific_damping
BETAS = (1.0, FAULT.friction.bounds[1] / FAULT.friction.bounds[0])


def open_loop(spring: float = SPRING, damping: float = DAMPING) -> np.ndarray:
    """Nominal plant with double integral action, states x1, x2, ξ1, ξ2."""
    return np.array([[0, 1, 0, 0], [-spring, -damping, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0]], dtype=float)


def answer(A: np.ndarray, b: float, Q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """K and Θ of the Riccati equation with R = 1."""
    K, theta, _ = control.lqr(A, b * np.array([[0.0], [1], [0], [0]]), Q, [[1.0]], method="scipy")
    return K, theta


def closed(A: np.ndarray, b: float, K: np.ndarray, slip: float, rate: float, beta: float = 1.0) -> np.ndarray:
    """Loop matrix with x2' = … + slip·x1 + rate·x2 + β·b·p."""
    M = A.copy()
    M[1] += [slip, rate, 0, 0] - beta * b * K[0]
    return M


def fastest(matrices: Sequence[np.ndarray]) -> float:
    """Largest real part of an eigenvalue [1/s]."""
    return max(float(np.linalg.eigvals(M).real.max()) for M in matrices)


def decrease(matrices: Sequence[np.ndarray], theta: np.ndarray, Q0: np.ndarray) -> float:
    """Least eigenvalue of −(MᵀΘ + ΘM) − Q0 over the matrices: not negative when V̇ ≤ −xᵀQ0x for all of them."""
    return min(float(np.linalg.eigvalsh(-(M.T @ theta + theta @ M) - Q0).min()) for M in matrices)


def row_06(load: float = LOAD) -> Finding:
    """Design with g1 = load·slope/b for Q0 = 1e-6·I, once as printed (ΔN̂ = 0, hence load = 0); test all vertices."""
    A, slope, Q0 = open_loop(), FAULT.friction.slip_slope, 1e-6 * np.eye(4)
    poles, answers, origin = [], [], []
    for used in (load, 0.0):
        K, theta = answer(A, B_LEAST, Q0 + np.diag([(used * slope / B_LEAST) ** 2, 0, 0, 0]))
        loops = [closed(A, B_LEAST, K, s, 0, beta) for s, beta in product((0, LOAD * slope), BETAS)]
        poles.append(fastest(loops))
        origin.append(fastest([closed(A, B_LEAST, K, LOAD * slope, 0, BETAS[1])]))
        answers.append(decrease(loops, theta, Q0) / np.linalg.norm(theta))
    x = np.linspace(1e-6, 2, 4001)
    law = FAULT.friction
    bounded = np.all(law.drop * (1 - np.exp(-x / law.critical_slip)) * LOAD <= load * slope * x * (1 + 1e-12))
    return Finding(
        bool(poles[0] < 0 and answers[0] > -1e-9 and round(origin[1], 2) == 0.45 and bounded),
        f"with ΔN̂ = 0 a pole at {origin[1]:+.4f} 1/s at the origin (β = {BETAS[1]:.3f}); with (σ'N̂)_max "
        f"{origin[0]:+.4f} there, {poles[0]:+.4f} at worst, and V̇ ≤ −xᵀQ0x at every vertex "
        f"up to rounding (relative margin {answers[0]:.0e})",
    )


def diagonal_bound(g1: float, g2: float, split: float) -> np.ndarray:
    """W = diag(g1²/w, g2²/(1−w), 0, 0)."""
    return np.diag([g1**2 / split, g2**2 / (1 - split), 0, 0])


# Δη̂ stays at −1; Δk̂ is −1 while the block leaves and +1 while it returns [s].
SOFT, STIFF = 1.861, 1.025


def row_07(bound: Callable = diagonal_bound) -> Finding:
    """Switch Δk̂ between ±1 in the loop that Theorem 2 as printed calls exponentially stable, k̂ = 1, η̂ = 0.1, b = 1."""
    A, Q0 = open_loop(1, 0.1), 1e-4 * np.eye(4)
    corners = list(product((-1, 1), repeat=2))

    def design(W):
        K, theta = answer(A, 1, Q0 + W)
        loops = {pair: closed(A, 1, K, -pair[0], -pair[1]) for pair in corners}
        cycle = expm(loops[1, -1] * STIFF) @ expm(loops[-1, -1] * SOFT)
        return fastest(list(loops.values())), decrease(list(loops.values()), theta, Q0), spectral_radius(cycle), theta

    split = minimize_scalar(lambda w: design(bound(1, 1, w))[3].trace(), bounds=(0.05, 0.95), method="bounded").x
    worst, _, growth, _ = design(np.array([[1, 1, 0, 0]]).T @ np.array([[1, 1, 0, 0]]))
    _, margin, kept, _ = design(bound(1, 1, split))
    x = np.random.default_rng(7).normal(size=(20000, 2))
    W = bound(1, 1, split)[:2, :2]
    covers = np.all(np.abs(x).sum(axis=1) ** 2 <= np.einsum("ni,ij,nj->n", x, W, x) * (1 + 1e-12))
    until = np.log(48) / np.log(growth) * (SOFT + STIFF) if growth > 1 else np.inf
    return Finding(
        bool(worst < 0 and growth > 1.2 and covers and margin > -1e-9 and kept < 1),
        f"every constant vertex stable (slowest {worst:+.4f} 1/s), yet switching Δk̂ = ∓1 every {SOFT} and {STIFF} s at "
        f"Δη̂ = −1 multiplies x by {growth:.3f} per period: ×48 after {until:.0f} s. With W (w = {split:.2f}) the same "
        f"period gives {kept:.3f} and V̇ ≤ −xᵀQ0x at every vertex up to rounding (least eigenvalue {margin:+.0e})",
    )


def spectral_radius(matrix: np.ndarray) -> float:
    """Largest modulus of an eigenvalue."""
    return float(np.abs(np.linalg.eigvals(matrix)).max())


def correct_rest_pressure(friction, N, sigma, k, r0, start, phi):
    """p* = −[(μ* − μ(r0))N̂σ' − k̂r0 + φ*]/(μ(r0)N̂)."""
    return -((start - friction) * N * sigma - k * r0 + phi) / (friction * N)


def row_08(rest: Callable = correct_rest_pressure) -> Finding:
    """Solve the shifted plant for its equilibrium at r0, shift to it, and compare linear weakening with the bound."""
    r0, y, q, phi, value, moved = sp.symbols("r_0 y q phi mu_0 mu_1", positive=True)
    balance = plant.shifted_acceleration().replace(plant.disturbance, lambda *_: phi)
    at = balance.replace(plant.mu, lambda *_: value).subs({plant.x1: r0, plant.x2: 0})
    still = sp.solve(at, plant.p)[0]
    symbols = (value, plant.N_hat, plant.sigma, plant.k_hat, r0, plant.mu_star, phi)
    same = sp.simplify(still - rest(*symbols)) == 0
    increment = balance.replace(plant.mu, lambda *_: moved).subs({plant.x1: r0 + y, plant.p: rest(*symbols) + q})
    target = -(moved - value) * plant.N_hat * (plant.sigma - rest(*symbols)) + moved * plant.N_hat * q
    shifted = sp.simplify(increment - target + plant.k_hat * y + plant.eta_hat * plant.x2) == 0
    integral, free = loop_at_rest(still, r0)
    r = np.linspace(0, FAULT.reference.target_slip, 20001)
    law = FAULT.friction
    friction = law.residual + law.drop * np.exp(-r / law.critical_slip)
    lowest = float(
        rest(friction, FAULT.authority, FAULT.effective_normal_stress, SPRING, r, law.bounds[1], 0 * r).min()
    )
    enclosed = float(uncertain_plant(FAULT).stress[1]) >= FAULT.effective_normal_stress - lowest
    straight = law.bounds[1] - law.slip_slope * 0.2
    far = float(rest(straight, FAULT.authority, FAULT.effective_normal_stress, SPRING, 0.2, law.bounds[1], 0))
    return Finding(
        bool(same and shifted and enclosed and integral == -r0 and free and round(lowest / MEGA, 2) == -5.67),
        f"p* reaches {lowest / MEGA:.2f} MPa on the real fault; for linear weakening at r0 = 0.2 m the increment of "
        f"friction exceeds the printed bound by a factor of {1 - far / FAULT.effective_normal_stress:.3f}; "
        f"at the origin ξ1' = {integral}, and an equilibrium at r0 needs k4 ≠ 0",
    )


def loop_at_rest(still: sp.Expr, r0: sp.Symbol) -> tuple[sp.Expr, bool]:
    """ξ1' of the toolkit's e-LQR at the origin, and whether ξ2* of an equilibrium at r0 exists iff k4 ≠ 0."""
    law = control_law("elqr").from_values((1, 1, 1, 1), feedback="state")
    origin = Signals(slip=0, slip_rate=0, slip_error=-r0, slip_rate_error=0, integrals=(0, 0))
    k1, k4, xi2 = sp.symbols("k1 k4 xi2")
    found = sp.solve(sp.Eq(-k1 * r0 - k4 * xi2, still), xi2)
    return law.integral_rates(origin)[0], len(found) == 1 and sp.denom(sp.together(found[0])).has(k4)


def row_09(nominal: Fraction | None = None) -> Finding:
    """Sign of ΔB over the ten-percent box for B0 with nominal and with least authority; two inputs, non-diagonal R."""
    fault = load_fault("real-fault").with_box("ten-percent")
    low, high = (Fraction(str(v)) for v in fault.friction.bounds)
    mean = Fraction(1, 12_500_000)  # N̂ = 1/(ρL_ac) = 1/(2500·5000)
    ends = [friction * mean * share for friction in (low, high) for share in (Fraction(9, 10), Fraction(11, 10))]
    used = low * min(Fraction(9, 10), Fraction(11, 10)) * mean if nominal is None else nominal
    least, printed = min(ends) - used, min(ends) - low * mean
    B0, step, weight = sp.Matrix([0, used, 0, 0]), sp.Symbol("dB", positive=True), sp.Symbol("R", positive=True)
    square = B0 * sp.Matrix([[0, step, 0, 0]]) / weight
    single = square == square.T and all(v.is_nonnegative for v in square)
    R = np.linalg.inv(np.array([[1, 0.9], [0.9, 1]]))
    pair = np.eye(2) @ np.linalg.inv(R) @ np.diag([1.0, 0.0])
    two = float(np.linalg.eigvalsh((pair + pair.T) / 2).min())
    return Finding(
        bool(least == 0 and printed < 0 and single and two < 0 and used == least_authority(fault)),
        f"ten-percent box: least ΔB {float(printed):+.2e} m²/kg with μ_res·N̂, {float(least):+.0e} with "
        f"μ_res·N̂_min; two inputs with R^−1 = [[1, 0.9], [0.9, 1]] and ΔB = diag(1, 0) ≥ 0 give an "
        f"eigenvalue {two:+.3f}",
    )


def row_10(rate_load: float = LOAD) -> Finding:
    """Let friction weaken with slip rate, μ_x2 = −0.6 s/m, and design with and without it in the second entry of G."""
    A, weakening, Q0 = open_loop(), 0.6, 1e-6 * np.eye(4)
    loops: list[float] = []
    margins: list[float] = []
    for used in (rate_load, 0.0):
        K, theta = answer(A, B_LEAST, Q0 + np.diag([0, (used * weakening / B_LEAST) ** 2, 0, 0]))
        found = [closed(A, B_LEAST, K, 0, s, beta) for s, beta in product((0, LOAD * weakening), BETAS)]
        loops.append(fastest(found))
        margins.append(decrease(found, theta, Q0) / float(np.linalg.norm(theta)))
    half = LOAD * weakening / 2  # friction lies between 0 and the weakening: centre the nominal plant between them
    centred = open_loop(damping=DAMPING - half)
    K, theta = answer(centred, B_LEAST, Q0 + np.diag([0, (half / B_LEAST) ** 2, 0, 0]))
    vertices = [closed(centred, B_LEAST, K, 0, s, beta) for s, beta in product((-half, half), BETAS)]
    full = answer(A, B_LEAST, Q0 + np.diag([0, (2 * half / B_LEAST) ** 2, 0, 0]))[0]
    return Finding(
        bool(loops[0] < 0 < loops[1] and margins[0] > -1e-9 and decrease(vertices, theta, Q0) > -1e-9 * theta.max()),
        f"without friction in g2 the worst pole is {loops[1]:+.3f} 1/s, with it {loops[0]:+.4f} 1/s; the one-sided "
        f"bound needs |K| = {np.linalg.norm(K):.1f} instead of {np.linalg.norm(full):.1f} MPa (per m, m/s …)",
    )


def row_11(bound: Callable = lambda g1, g2, x1, x2: g1 * abs(x1) + g2 * abs(x2)) -> Finding:
    """Test the bound on disturbances of linear growth; drive the paper's loop with its sine: it does not settle."""
    g1, g2 = 3.2e-6, 1e-3
    x = np.random.default_rng(11).normal(size=(5000, 2)) * [1, g1 / g2]
    forces = np.stack([s1 * g1 * x[:, 0] + s2 * g2 * x[:, 1] for s1, s2 in product((-1, 1), repeat=2)])
    allowed = bound(g1, g2, x[:, 0], x[:, 1])
    covered = bool(np.all(np.abs(forces) <= allowed * (1 + 1e-12)))
    printed = int(np.sum(np.abs(forces).max(axis=0) > np.abs(g1 * x[:, 0] + g2 * x[:, 1]) * (1 + 1e-12)))
    excess = FAULT.disturbance.amplitude - bound(g1, g2, 0.0, 0.0)
    K = np.array([[1.88e9, 5.79e8, 1.02e6, 18.52]]) / MEGA
    loop = closed(open_loop(), B_LEAST, K, 0, 0)
    system = control.ss(loop, np.array([[0.0], [1], [0], [0]]), np.eye(4)[:1], 0)
    gain = abs(system(1j * FAULT.disturbance.frequency)) * FAULT.disturbance.amplitude
    period = 2 * np.pi / FAULT.disturbance.frequency
    time = np.linspace(0, 200 * period, 40001)
    run = control.forced_response(
        system, time, FAULT.disturbance.amplitude * np.sin(FAULT.disturbance.frequency * time)
    )
    late = float(np.abs(run.outputs[-2000:] - run.outputs[-2000:].mean()).max())
    return Finding(
        bool(covered and printed > 0 and excess > 0 and abs(late / gain - 1) < 0.01 and late > 0),
        f"{printed} of 5000 points violate the printed bound, none the sum of both; at the origin the sine exceeds "
        f"every such bound by {excess:.1e} m/s², and x1 keeps oscillating with amplitude {late:.3g} m (frequency "
        f"response: {gain:.3g} m)",
    )


ROWS = (
    ErrataRow(
        number=6,
        printed="G contains μ_x1^max σ′ΔN̂_max",
        correct="μ_x1^max (σ′N̂)_max",
        kind="counterexample",
        check=row_06,
    ),
    ErrataRow(
        number=7,
        printed="‖h‖ ≤ ‖Gx_a‖ with G = [g1 g2 0 0]",
        correct="h² ≤ x_aᵀWx_a, W = diag(g1²/w, g2²/(1−w), 0, 0), 0 < w < 1",
        kind="counterexample",
        check=row_07,
    ),
    ErrataRow(
        number=8,
        printed="r_ξ dropped, the origin exponentially stable for r = r0",
        correct="shift to (r0, 0, 0, ξ2*), σ′ becomes σ′−p*, p* = −[(μ*−μ(r0))N̂σ′ − k̂r0 + φ*]/(μ(r0)N̂)",
        kind="symbolic identity",
        check=row_08,
    ),
    ErrataRow(
        number=9,
        printed="B0 = [0; [μ_res N̂; 0; 0]",
        correct="B0 = [0; μ_res·N̂_min; 0; 0], constant; the sign argument needs a single input",
        kind="counterexample",
        check=row_09,
    ),
    ErrataRow(
        number=10,
        printed="second entry of G without friction",
        correct="add N̂_max(σ′−p*)L_μ2; one-sided is tighter for rate weakening",
        kind="counterexample",
        check=row_10,
    ),
    ErrataRow(
        number=11,
        printed="|φ_e| ≤ |φ1e x1 + φ2e x2|, then a sine",
        correct="|φ_e| ≤ φ1e|x1| + φ2e|x2|; a sine needs an input-to-state bound",
        kind="counterexample",
        check=row_11,
    ),
)
