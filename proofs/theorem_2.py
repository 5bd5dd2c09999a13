"""Theorem 2, the e-LQR: the proof with a bound that the plant can meet. Run: ``python proofs/theorem_2.py``.

The equilibrium is that of a constant reference (ERRATA 8), W takes the place of GᵀG (ERRATA 7), B0 is constant and the
ΔB term belongs to a single input (ERRATA 9). The plant is the derived one, not typed in.
"""

from collections.abc import Iterator

import sympy as sp
from set_valued import SetValued
from steps import Step, cited, equal, printed, text, true

from quakedesign.laws import Signals, control_law
from quakedesign.symbolic import plant

r0 = sp.Symbol("r_0", real=True)
x1, x2, xi1, xi2 = X = (plant.x1, plant.x2, *sp.symbols("xi_1 xi_2", real=True))
y1, y2, eta1, eta2 = Y = sp.symbols("y_1 y_2 eta_1 eta_2", real=True)
gains = sp.symbols("k_1:5", positive=True)
phi0, phi_change = sp.symbols("phi^* Delta_phi", real=True)
mu0, mu_here = sp.symbols("mu_r0 mu_x", positive=True)
g1, g2, b, R = sp.symbols("g_1 g_2 b R", positive=True)
split = sp.Symbol("w", positive=True)
stress, N, k, eta = plant.sigma, plant.N_hat, plant.k_hat, plant.eta_hat


def acceleration(pressure: sp.Expr, slip: sp.Expr, rate: sp.Expr, friction: sp.Expr, push: sp.Expr) -> sp.Expr:
    """x2' of eq. shift with values in place of friction and disturbance."""
    f = plant.shifted_acceleration().replace(plant.mu, lambda *_: friction).replace(plant.disturbance, lambda *_: push)
    return f.subs({x1: slip, x2: rate, plant.p: pressure}, simultaneous=True)


def law(feedback: str) -> tuple[sp.Expr, tuple[sp.Expr, ...]]:
    """p and the rates of ξ of the e-LQR with symbols for its gains, from the law itself."""
    elqr = control_law("elqr")
    units = dict.fromkeys(elqr.gain_units, 1)
    one = [elqr(gains={name: int(name == chosen) for name in units}, feedback=feedback) for chosen in units]
    signals = Signals(slip=x1, slip_rate=x2, slip_error=x1 - r0, slip_rate_error=x2, integrals=(xi1, xi2))
    pressure = sum((g * part.pressure(signals) for g, part in zip(gains, one, strict=True)), start=sp.Integer(0))
    return sp.expand(pressure), one[0].integral_rates(signals)


def rest_pressure() -> sp.Expr:
    """p* [Pa] that holds the fault at rest at r0."""
    p = plant.p
    return sp.solve(acceleration(p, r0, sp.Integer(0), mu0, phi0), p)[0]


def equilibrium(feedback: str) -> dict[sp.Symbol, sp.Expr]:
    """x* of the loop for a constant reference; needs k4 ≠ 0."""
    pressure, rates = law(feedback)
    held = sp.solve([x2, *rates], [x1, x2, xi1], dict=True)[0]
    last = sp.solve(sp.Eq(pressure.subs(held), rest_pressure()), xi2)[0]
    return {**held, xi2: last}


def shifted(feedback: str) -> sp.Expr:
    """y2' about x*, with friction μ_x at the state and μ_r0 at x*, disturbance φ* + Δφ."""
    start = equilibrium(feedback)
    at = {x: start[x] + y for x, y in zip(X, Y, strict=True)}
    pressure = law(feedback)[0].subs(at, simultaneous=True)
    return sp.expand(acceleration(pressure, at[x1], at[x2], mu_here, phi0 + phi_change))


def equilibrium_steps() -> Iterator[Step]:
    """The origin is no equilibrium for r0 ≠ 0; x* is, and the loop about it has σ' − p* in place of σ'."""
    _, rates = law("state")
    claim = "At the origin ξ1' = −r0: for r0 ≠ 0 the origin is no equilibrium."
    yield equal(claim, rates[0].subs({x1: 0}), -r0)
    printed_pressure = -((plant.mu_star - mu0) * N * stress - k * r0 + phi0) / (mu0 * N)
    yield equal("The pressure p* that holds the fault at rest at r0:", rest_pressure(), printed_pressure)
    p_star = rest_pressure()
    ends = {
        "state": (-(p_star + gains[0] * r0) / gains[3], "−(p* + k1 r0)/k4"),
        "error": (-p_star / gains[3], "−p*/k4"),
    }
    for feedback, (last, shown) in ends.items():
        start = equilibrium(feedback)
        same = [start[x1] - r0, start[x2], start[xi1], sp.simplify(start[xi2] - last)]
        claim = f"With feedback of the {feedback} the loop rests at x*, if k4 ≠ 0."
        yield true(claim, same == [0, 0, 0, 0], f"x* = (r0, 0, 0, ξ2*), ξ2* = {shown}", "identity")
    linear = -sum((g * y for g, y in zip(gains, Y, strict=True)), start=sp.Integer(0))
    wanted = -(mu_here - mu0) * N * (stress - p_star) - k * y1 - eta * y2 + phi_change + mu_here * N * linear
    for feedback in ("state", "error"):
        claim = f"About x* ({feedback} feedback) the loop is the one about the origin, with σ' − p* in place of σ':"
        shown = "y2' = −(μ_x − μ_r0) N̂ (σ' − p*) − k̂ y1 − η̂ y2 + Δφ − μ_x N̂ K y"
        rest = sp.simplify(shifted(feedback) - wanted)
        yield true(claim, rest == 0, shown, "identity")
    k0, eta0, control = sp.symbols("k_0 eta_0 u", real=True)
    h = -((k - k0) * y1 + (eta - eta0) * y2 + (mu_here - mu0) * N * (stress - p_star) - phi_change) / b
    nominal = -k0 * y1 - eta0 * y2 + b * (control + h) + (mu_here * N - b) * control
    free = -(mu_here - mu0) * N * (stress - p_star) - k * y1 - eta * y2 + phi_change + mu_here * N * control
    claim = "With b = μ_res N̂_min and a nominal k̂0, η̂0 this is y' = A0y + ΔB u + B0(u + h), Δb = μN̂ − b ≥ 0, u = −Ky:"
    shown = "h = −[Δk̂ y1 + Δη̂ y2 + (μ_x − μ_r0) N̂ (σ' − p*) − Δφ]/b,  h = 0 at y = 0"
    yield true(claim, sp.simplify(nominal - free) == 0, shown, "identity")


def bound_steps() -> Iterator[Step]:
    """|h| ≤ g1|y1| + g2|y2| and what it means for a quadratic bound."""
    names = ("Delta_k", "Delta_eta", "c_1", "c_2", "f_1", "f_2")
    dk, deta, c1, c2, f1, f2 = sp.symbols(names, real=True)
    tops = sp.symbols([f"{n}^max" for n in names], positive=True)
    h = -(dk * y1 + deta * y2 + c1 * y1 + c2 * y2 - f1 * y1 - f2 * y2) / b
    values = SetValued(
        expression=h, intervals={s: (-t, t) for s, t in zip((dk, deta, c1, c2, f1, f2), tops, strict=True)}
    )
    first, second = (tops[0] + tops[2] + tops[4]) / b, (tops[1] + tops[3] + tops[5]) / b
    claim = (
        "With Δk̂, Δη̂, friction's chords c1 = N̂(σ' − p*)L_μ1, c2 = N̂(σ' − p*)L_μ2 and the disturbance's f1, f2, each in "
        "[−max, max], b = μ_res N̂_min, the largest h is g1|y1| + g2|y2| (ERRATA 6, 8, 9, 10, 11):"
    )
    yield equal(claim, values.upper, first * sp.Abs(y1) + second * sp.Abs(y2))
    G = sp.Matrix([[g1, g2, 0, 0]])
    x = sp.Matrix([1, -g1 / g2, 0, 0])
    extreme = {dk: b * g1, deta: -b * g2, c1: 0, c2: 0, f1: 0, f2: 0}
    worst = h.subs({**extreme, y1: x[0], y2: x[1]})
    yield equal("The row G = [g1 g2 0 0] fails: for x = (1, −g1/g2), Gx = 0", (G * x)[0], sp.Integer(0))
    claim = "while a plant with Δk̂ at its maximum and Δη̂ at its minimum has h = −(g1x1 − g2x2) ≠ 0 there (ERRATA 7)."
    yield true(claim, sp.simplify(worst) == -2 * g1, f"h = {text(sp.simplify(worst))}", "point")
    a1, a2 = sp.symbols("a_1 a_2", nonnegative=True)
    excess = g1**2 * a1**2 / split + g2**2 * a2**2 / (1 - split) - (g1 * a1 + g2 * a2) ** 2
    square = ((1 - split) * g1 * a1 - split * g2 * a2) ** 2 / (split * (1 - split))
    claim = "W = diag(g1²/w, g2²/(1 − w), 0, 0) with 0 < w < 1 works: xᵀWx − (g1|x1| + g2|x2|)² is a square,"
    yield true(claim, sp.simplify(excess - square) == 0, f"{text(square)}, a_i = |x_i|", "identity")
    claim = "and zero on a line, so that no entry of W can be lowered alone."
    on_line = square.subs({a1: split * g2, a2: (1 - split) * g1})
    yield equal(claim, on_line, sp.Integer(0), "(1 − w) g1 a1 = w g2 a2")


def matrices() -> tuple[sp.Matrix, sp.Matrix, sp.Matrix, sp.Matrix]:
    """A0, B0, ΔB and a general symmetric Θ."""
    k0, eta0 = sp.symbols("k_0 eta_0", positive=True)
    delta = sp.Symbol("Delta_b", nonnegative=True)
    A0 = sp.Matrix([[0, 1, 0, 0], [-k0, -eta0, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0]])
    B0, dB = sp.Matrix([0, b, 0, 0]), sp.Matrix([0, delta, 0, 0])
    theta = sp.Matrix(4, 4, lambda i, j: sp.Symbol(f"theta_{min(i, j) + 1}{max(i, j) + 1}", real=True))
    return A0, B0, dB, theta


def decrease_steps() -> Iterator[Step]:
    """V̇ for V = yᵀΘy, its three parts, and their signs."""
    A0, B0, dB, T = matrices()
    y, h = sp.Matrix(Y), sp.Symbol("h", real=True)
    p = (-(B0.T * T * y) / R)[0]
    flow = A0 * y + dB * p + B0 * (p + h)
    rate = (flow.T * T * y + y.T * T * flow)[0]
    riccati = A0.T * T + T * A0 - T * B0 * B0.T * T / R
    half = (B0 * dB.T + dB * B0.T) / (2 * R)
    parts = [
        (y.T * riccati * y)[0],
        (-2 * y.T * T * half * T * y)[0],
        (-y.T * T * B0 * B0.T * T * y)[0] / R + 2 * h * (y.T * T * B0)[0],
    ]
    claim = "V̇ = yᵀ(A0ᵀΘ + ΘA0 − ΘB0R⁻¹B0ᵀΘ)y − 2yᵀΘ sym(B0R⁻¹ΔBᵀ)Θy − yᵀΘB0R⁻¹B0ᵀΘy + 2yᵀΘB0h, for any symmetric Θ."
    yield equal(claim, rate, sum(parts), "−yᵀQy by the Riccati equation, a ΔB term, and the terms of z = R^(−1/2)B0ᵀΘy")
    second = (T * y)[1]
    delta = dB[1]
    claim = "With one input the ΔB term is minus a square, since b, R > 0 and Δb = μN̂ − b ≥ 0 (ERRATA 9):"
    yield equal(claim, parts[1], -2 * b * delta / R * second**2, "−2(b Δb/R) ((Θy)₂)²")
    symmetric = B0 * dB.T
    claim = "B0R⁻¹ΔBᵀ is then symmetric and positive semidefinite: its only entry is bΔb/R."
    yield true(claim, symmetric == symmetric.T and bool(delta.is_nonnegative), "", "identity")
    weight = sp.Matrix([[2, 1], [1, 1]])
    several = weight.inv() * sp.diag(1, 0)
    both = (several + several.T) / 2
    claim = "With two inputs it need not be: B0 = I, R = [[2, 1], [1, 1]] > 0, ΔB = diag(1, 0) ≥ 0."
    fact = weight.is_positive_definite and both.det() < 0
    yield true(claim, bool(fact), f"det sym(B0R⁻¹ΔBᵀ) = {both.det()} < 0: indefinite", "point")
    yield from squares_steps(T, B0)


def squares_steps(T: sp.Matrix, B0: sp.Matrix) -> Iterator[Step]:
    """Completion of squares with Q = Q0 + R·W."""
    y, h = sp.Matrix(Y), sp.Symbol("h", real=True)
    W = sp.diag(g1**2 / split, g2**2 / (1 - split), 0, 0)
    z = (B0.T * T * y)[0] / sp.sqrt(R)
    quadratic = (y.T * W * y)[0]
    left = -R * quadratic - z**2 + 2 * z * sp.sqrt(R) * h
    claim = "With Q = Q0 + R·W the squares complete: V̇ + yᵀQ0y ≤ −R yᵀWy − z² + 2zR^(1/2)h, which is"
    shown = "−R (yᵀWy − h²) − (z − R^(1/2) h)² ≤ 0, as h² ≤ (g1|y1| + g2|y2|)² ≤ yᵀWy"
    yield equal(claim, left, -R * (quadratic - h**2) - (z - sp.sqrt(R) * h) ** 2, shown)
    G, free = sp.Matrix([[g1, g2, 0, 0]]), sp.Symbol("z", real=True)
    with_print = -R * (G * y)[0] ** 2 - free**2 + 2 * free * sp.sqrt(R) * h
    value = with_print.subs({y1: 1, y2: -g1 / g2, h: -2 * g1}).subs(free, -2 * g1 * sp.sqrt(R))
    claim = "With GᵀG they do not: at y = (1, −g1/g2, ξ1, ξ2), h = −2g1, ξ such that z = R^(1/2)h, what is left is"
    yield equal(claim, value, 4 * R * g1**2)
    yield cited(
        "V̇ ≤ −yᵀQ0y ≤ −(λ_min(Q0)/λ_max(Θ)) V: x* is globally exponentially stable.",
        "Khalil (2002), Nonlinear Systems, theorem 4.10; the premises must hold globally: a friction bounded with its "
        "chords also for x1 < 0 (ERRATA 12), a slip rate that does not reverse (ERRATA 14)",
    )


def proof() -> list[Step]:
    """All steps, each asserted while it is made."""
    return [step for part in (equilibrium_steps, bound_steps, decrease_steps) for step in part()]


if __name__ == "__main__":
    print(printed("Theorem 2: the e-LQR holds the fault at a constant reference, exponentially", proof()))
