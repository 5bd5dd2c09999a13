"""The proofs of the two theorems run, and what they state agrees with numbers computed another way."""

import importlib
import random
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from scipy.linalg import solve_continuous_are
from thinned import few

from quakedesign import load_fault
from quakedesign.symbolic import plant

PROOFS = Path(__file__).parents[2] / "proofs"
sys.path.insert(0, str(PROOFS))
steps, theorem_1, theorem_2 = map(importlib.import_module, ("steps", "theorem_1", "theorem_2"))

TINY = mp.mpf(10) ** -25


@pytest.mark.slow
@few(
    ("script", "expected"),
    [
        (
            "theorem_1.py",
            (
                "The 2-DIA loop is a homogeneous inclusion",
                "V̇, differentiated along the loop in φ, is the expression of the paper",
                "So γ1 > k_I1 is necessary and sufficient",
                "On S1, β drops out",
                "On S1 ∩ S2 the largest value",
                "ERRATA 5",
                "ERRATA 27",
            ),
        ),
        (
            "theorem_2.py",
            (
                "x* = (r0, 0, 0, ξ2*)",
                "with σ' − p* in place of σ'",
                "for x = (1, −g1/g2), Gx = 0",
                "the ΔB term is minus a square",
                "With Q = Q0 + R·W the squares complete",
                "With two inputs it need not be",
            ),
        ),
    ],
    every=2,
)
def test_the_script_prints_a_numbered_proof(script, expected):
    run = subprocess.run(
        [sys.executable, "-W", "error", PROOFS / script], capture_output=True, text=True, check=True, encoding="utf-8"
    )
    assert not run.stderr
    numbers = [line.split(".")[0] for line in run.stdout.splitlines() if line[:1].isdigit()]
    assert numbers == [str(i + 1) for i in range(len(numbers))]
    assert len(numbers) > 15
    for words in expected:
        assert words in run.stdout


@pytest.mark.slow
def test_every_step_says_on_what_it_rests_and_little_is_cited():
    for proof in (theorem_1.proof(), theorem_2.proof()):
        assert {step.basis for step in proof} <= {"identity", "sign", "point", "cited"}
        assert sum(step.basis == "cited" for step in proof) <= 2
        assert all(step.claim and (step.formula or step.basis == "identity") for step in proof)


def test_a_false_step_cannot_be_made():
    x = sp.Symbol("x", positive=True)
    with pytest.raises(AssertionError, match="the difference is"):
        steps.equal("wrong", x, 2 * x)
    for fact in (False, sp.false, x > 1, None, 1):
        with pytest.raises(AssertionError):
            steps.true("not known", fact)


def test_a_changed_sign_in_the_printed_derivative_is_noticed(monkeypatch):
    right = theorem_1.printed_derivative()
    monkeypatch.setattr(theorem_1, "printed_derivative", lambda: right - 2 * theorem_1.phi2**2)
    with pytest.raises(AssertionError, match="differentiated along the loop"):
        theorem_1.proof()


# ------------------------------------------------- Theorem 1, written again in plain numbers


def signed(v, a):
    return mp.sign(v) * abs(v) ** a if v else mp.mpf(0)


with mp.workdps(60):
    THIRD, HALF = mp.mpf(1) / 3, mp.mpf(1) / 2
NAMES = ("k_I1", "k_I2", "k_I3", "k_I4", "beta", "hdot", "gamma_1")


def loop(e, v, lam=1, inner=HALF):
    """Eq. clsystem2."""
    k1, k2, k3, k4, beta, hdot, _ = v
    lam = mp.mpf(lam)
    nested = signed(e[1], 3 * HALF) + lam**inner * k1 ** (3 * HALF) * e[0]
    return (
        e[1],
        beta * (-(lam**HALF) * k2 * signed(nested, THIRD) + e[2]),
        -lam * k3 * signed(e[0] + lam**-HALF * k4 * signed(e[1], 3 * HALF), 0) + hdot,
    )


def twisting_loop(e, v, lam=1):
    """Eq. clsystem1."""
    k1, k2, k3, k4, beta, hdot, _ = v
    lam = mp.mpf(lam)
    nu = -(lam ** (2 * THIRD)) * k1 * signed(e[0], THIRD) - lam**HALF * k2 * signed(e[1], HALF) + e[2]
    return e[1], beta * nu, -lam * k3 * signed(e[0], 0) - lam * k4 * signed(e[1], 0) + hdot


def V(phi, v):
    k1, gamma = v[0], v[-1]
    return (
        3 * gamma / 5 * abs(phi[0]) ** (mp.mpf(5) / 3)
        + phi[0] * phi[1]
        + 2 * k1 ** (-3 * HALF) / 5 * abs(phi[1]) ** (mp.mpf(5) / 2)
        + abs(phi[2]) ** 5 / 5
    )


def to_phi(e, v):
    third = e[2] / (v[0] ** HALF * v[1])
    return e[0] - third**3, e[1], third


def draw(seed):
    numbers = random.Random(seed)
    values = [mp.mpf(numbers.uniform(0.3, 3)) for _ in NAMES]
    values[3], values[5] = mp.mpf(numbers.uniform(-2, 2)), mp.mpf(numbers.uniform(-1, 1))
    return [mp.mpf(numbers.uniform(-2, 2)) for _ in range(3)], values


def evaluated(expression, phi, v):
    return compiled(expression)(*phi, *v)


@lru_cache
def compiled(expression):
    symbols = [*theorem_1.PHI, *(s for n in NAMES for s in [named(n)])]
    own = {"SignedPower": signed, "AbsolutePower": lambda x, a: abs(x) ** a}
    return sp.lambdify(symbols, expression, [own, "mpmath"])


def named(name):
    return next(
        s
        for s in (
            theorem_1.kI1,
            theorem_1.kI2,
            theorem_1.kI3,
            theorem_1.kI4,
            theorem_1.beta,
            theorem_1.rate,
            theorem_1.gamma,
        )
        if s.name == name
    )


@few("seed", range(10), every=2)
def test_v_dot_is_the_slope_of_v_along_the_loop_at_fifty_digits(seed):
    with mp.workdps(50):
        e, v = draw(seed)
        flow = loop(e, v)
        expected = mp.diff(lambda t: V(to_phi([a + t * b for a, b in zip(e, flow, strict=True)], v), v), 0)
        for expression in (theorem_1.derivative().expression, theorem_1.printed_derivative()):
            assert abs(evaluated(expression, to_phi(e, v), v) - expected) < TINY * (1 + abs(expected))


@pytest.mark.parametrize("seed", range(6))
def test_the_restriction_to_s1_is_v_dot_there(seed):
    with mp.workdps(50):
        phi, v = draw(seed)
        phi[0] = -(v[0] ** (-3 * HALF)) * signed(phi[1], 3 * HALF)
        e = (phi[0] + phi[2] ** 3, phi[1], v[0] ** HALF * v[1] * phi[2])
        flow = loop(e, v)
        expected = mp.diff(lambda t: V(to_phi([a + t * b for a, b in zip(e, flow, strict=True)], v), v), 0)
        got = evaluated(theorem_1.printed_on_s1(), phi, v)
        assert abs(got - expected) < TINY * (1 + abs(expected))


@pytest.mark.parametrize("seed", range(6))
def test_the_scaled_loops_are_the_loops_in_z(seed):
    with mp.workdps(50):
        z, v = draw(seed)
        lam = mp.mpf(random.Random(seed + 50).uniform(0.2, 30))
        more = [*v[:5], lam * v[5], v[6]]
        for field in (loop, twisting_loop):
            moved = [lam * f for f in field([x / lam for x in z], v)]
            assert all(abs(a - b) < TINY * (1 + abs(a)) for a, b in zip(moved, field(z, more, lam), strict=True))
        printed = loop(z, more, lam, inner=THIRD)
        assert abs(lam * loop([x / lam for x in z], v)[1] - printed[1]) > 1e-6


@pytest.mark.parametrize("share", ["0.8", "0.999", "1", "1.001", "2"])
def test_v_is_positive_exactly_when_gamma_exceeds_k(share):
    """Least V on the curve |φ|_r = const of the plane φ3 = 0, by a scan and a golden search."""
    k = mp.mpf("1.7")
    v = [k, 1, 1, 0, 1, 0, mp.mpf(share) * k]

    def value(angle):
        c, s = mp.cos(angle), mp.sin(angle)
        return V((signed(c, 3), signed(s, 2), 0), v)

    with mp.workdps(30):
        grid = [2 * mp.pi * i / 720 for i in range(720)]
        start = min(grid, key=value)
        low, high, golden = start - mp.mpf("0.01"), start + mp.mpf("0.01"), (mp.sqrt(5) - 1) / 2
        for _ in range(120):
            a, b = high - golden * (high - low), low + golden * (high - low)
            low, high = (low, b) if value(a) < value(b) else (a, high)
        least = value((low + high) / 2)
        if share == "1":
            assert abs(least) < mp.mpf(10) ** -20
        else:
            assert (least > 0) == (mp.mpf(share) > 1)


@pytest.mark.parametrize("seed", range(5))
def test_the_closed_form_for_the_integral_gain_makes_v_dot_negative_on_s1(seed):
    """k̃_I3 at 99 % of the proof's bounds; φ2, φ3 and the ends of h' sampled."""
    numbers = random.Random(seed)
    k1, k2, k4, share = numbers.uniform(0.5, 3), numbers.uniform(1, 9), numbers.uniform(-2, 2), numbers.uniform(0, 0.9)
    gamma = k1 * numbers.uniform(1.05, 4)
    g, m = gamma / k1 - 1, abs(k4 - k1**-1.5) ** (2 / 3)
    kt3 = 0.99 * min(4 * (1 - share) / (9 * g * (1 + share) ** 2), g / ((1 + share) * (3 * g * m + m**2)))
    k3 = kt3 * k1**0.5 * k2
    on_s1 = theorem_1.printed_on_s1()
    for _ in range(200):
        phi2, phi3 = numbers.gauss(0, 1), numbers.gauss(0, 1)
        phi1 = -(k1**-1.5) * signed(phi2, 1.5)
        for end in (-1, 1):
            v = [k1, k2, k3, k4, 1, end * share * k3, gamma]
            assert evaluated(on_s1, (phi1, phi2, phi3), v) < 0


@pytest.mark.parametrize(("beta", "expected"), [(1, 0.060), (1.425, 0.010)])
def test_the_paper_v_does_not_certify_the_published_gains(beta, expected):
    """ERRATA 27, from the loop in plain numbers."""
    v = [mp.mpf(2), mp.mpf(5), mp.mpf("1.44e-4"), mp.mpf(0), mp.mpf(beta), mp.mpf(0), mp.mpf("2.01")]
    with mp.workdps(50):
        phi = [mp.mpf("0.2"), mp.mpf("0.2"), mp.mpf(1)]
        e = (phi[0] + phi[2] ** 3, phi[1], v[0] ** HALF * v[1] * phi[2])
        flow = loop(e, v)
        slope = mp.diff(lambda t: V(to_phi([a + t * b for a, b in zip(e, flow, strict=True)], v), v), 0)
    assert float(slope) == pytest.approx(expected, abs=5e-4)


# ------------------------------------------------- Theorem 2 in plain numbers


def test_the_holding_pressure_of_the_real_fault_goes_down_to_the_published_value():
    """ERRATA 8: p* down to −5.67 MPa; a scan of the force balance of eq. shift."""
    fault = load_fault("real-fault")
    law, target = fault.friction, fault.reference.target_slip
    values, pressure = plant.plant_values(fault), theorem_2.rest_pressure()

    def held(slip):
        friction = float(law.coefficient(sp.Float(slip), sp.Integer(0)))
        start = float(law.coefficient(sp.Integer(0), sp.Integer(0)))
        at = {**values, plant.mu_star: start, theorem_2.mu0: friction, theorem_2.r0: slip, theorem_2.phi0: 0}
        return float(pressure.subs(at))

    pressures = [held(slip) for slip in np.linspace(0, target, 60)]
    assert min(pressures) == pytest.approx(-5.67e6, abs=0.005e6)


@pytest.mark.parametrize("feedback", ["state", "error"])
@few("seed", range(3), every=3)
def test_the_equilibrium_makes_all_rates_zero(feedback, seed):
    """The plant and the law in plain numbers, not from the toolkit."""
    draw_ = random.Random(seed).uniform
    k, eta, N, sigma, start, here, push, r = (draw_(0.3, 2) for _ in range(8))
    K = [draw_(0.5, 3) for _ in range(4)]
    at = {
        **{plant.k_hat: k, plant.eta_hat: eta, plant.N_hat: N, plant.sigma: sigma, plant.mu_star: start},
        **{theorem_2.mu0: here, theorem_2.phi0: push, theorem_2.r0: r},
        **dict(zip(theorem_2.gains, K, strict=True)),
    }
    x = [float(sp.sympify(v).subs(at)) for v in theorem_2.equilibrium(feedback).values()]
    names = [s.name for s in theorem_2.equilibrium(feedback)]
    state = dict(zip(names, x, strict=True))
    x1, x2, xi1, xi2 = state["x_1"], state["x_2"], state["xi_1"], state["xi_2"]
    p = -(K[0] * (x1 - (r if feedback == "error" else 0)) + K[1] * x2 + K[2] * xi1 + K[3] * xi2)
    rates = (x2, -(here - start) * N * sigma + here * N * p - k * x1 - eta * x2 + push, x1 - r, xi1)
    assert max(map(abs, rates)) < 1e-12


def design(g1, g2, R=0.7, printed=False):
    """Θ from the Riccati equation by SciPy, with W or with the printed GᵀG."""
    A, B = np.array([[0, 1, 0, 0], [-1.0, -0.1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0]]), np.array([[0], [1.0], [0], [0]])
    W = np.outer([g1, g2, 0, 0], [g1, g2, 0, 0]) if printed else np.diag([2 * g1**2, 2 * g2**2, 0, 0])
    Q0 = 1e-4 * np.eye(4)
    return A, B, Q0, solve_continuous_are(A, B, Q0 + R * W, [[R]]), R


@pytest.mark.parametrize("printed", [False, True], ids=["W", "GᵀG"])
def test_v_dot_stays_below_q0_with_w_and_not_with_the_printed_g(printed):
    """ERRATA 7's example, g1 = g2 = 1, Q0 = 1e-4·I: the worst h and Δb over random states."""
    A, B, Q0, theta, R = design(1.0, 1.0, printed=printed)
    numbers, worst = np.random.default_rng(4), -np.inf
    for _ in range(3000):
        y = numbers.normal(size=4) * (1, 1, 3, 3)
        p = -float((B.T @ theta @ y)[0]) / R
        for sign in (-1, 1):
            h, more = sign * (abs(y[0]) + abs(y[1])), numbers.choice([0.0, 0.4])
            flow = A @ y + B[:, 0] * (p + h) + B[:, 0] * more * p
            worst = max(worst, (2 * y @ theta @ flow + y @ Q0 @ y) / (y @ y))
    assert (worst > 1e-3) == printed


def test_two_inputs_can_make_the_term_indefinite():
    weight, more = np.array([[2.0, 1], [1, 1]]), np.diag([1.0, 0])
    product = np.linalg.inv(weight) @ more
    assert np.linalg.eigvalsh(weight).min() > 0
    assert np.linalg.eigvalsh(product + product.T).min() < -0.1
