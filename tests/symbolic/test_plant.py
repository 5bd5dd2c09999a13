"""Plant and error dynamics against a derivation by hand, and against finite differences in 50 digits."""

import mpmath
import pytest
import sympy as sp

from quakedesign.fault import load_fault
from quakedesign.symbolic import plant
from quakedesign.symbolic.plant import N_hat, eta_hat, k_hat, mu_star, p, rate_slope, sigma, slip_slope, t, x1, x2

M = mpmath.mpf
# Any smooth friction, disturbance and trajectory will do; numbers of order one.
SIGMA, N, K, ETA, DIVISOR = M("1.7"), M("0.6"), M("0.9"), M("0.4"), M("0.35")
STATIC = M("0.47")


def friction(slip, rate):
    return M("0.3") + M("0.12") * mpmath.exp(-slip / 2) + M("0.05") * mpmath.cos(rate)


def force(slip, rate, time):
    return M("0.2") * mpmath.sin(2 * time) + M("0.3") * slip - M("0.1") * rate


def target(time):
    return mpmath.sin(time) + time**2 / 5


def error(time):
    return mpmath.exp(-time) * mpmath.cos(3 * time) / 2


def acceleration(slip, rate, pressure, time=None):
    """Eq. shift, typed in by hand."""
    value = friction(slip, rate)
    outside = 0 if time is None else force(slip, rate, time)
    return -(value - STATIC) * N * SIGMA + value * N * pressure - K * slip - ETA * rate + outside


def matched(time):
    """h of eq. esystem3, typed in by hand, along the trajectory."""
    r, dr, ddr = (mpmath.diff(target, time, n) for n in (0, 1, 2))
    slip, rate = error(time) + r, mpmath.diff(error, time) + dr
    beta = friction(slip, rate) * N / DIVISOR
    return (acceleration(slip, rate, 0, time) - ddr) / beta


NUMBERS = {sigma: SIGMA, N_hat: N, k_hat: K, eta_hat: ETA, plant.divisor: DIVISOR, mu_star: STATIC}


def numeric(expression, values):
    known = {key: sp.Float(str(mpmath.nstr(value, 48)), 50) for key, value in (NUMBERS | values).items()}
    result = sp.N(sp.sympify(expression).subs(known), 45)
    assert result.is_Float, result
    return M(str(result))


def test_the_force_balance_is_eq_springmodel():
    balance = plant.force_balance()
    z, v, a, far, time = (*sp.symbols("z v a delta_far", real=True), t)
    by_hand = (
        -plant.mu(z, v) * plant.A * (sigma - p)
        + plant.k * (far - z)
        - plant.eta * v
        + plant.m * plant.disturbance(z, v, time)
    )
    assert sp.expand(balance.rhs - by_hand) == 0
    assert balance.lhs == plant.m * a


def test_the_shifted_plant_is_eq_shift():
    friction_at = plant.mu(x1, x2)
    by_hand = (
        -(friction_at - mu_star) * N_hat * sigma
        + friction_at * N_hat * p
        - k_hat * x1
        - eta_hat * x2
        + plant.disturbance(x1, x2, t)
    )
    assert sp.expand(plant.shifted_acceleration() - by_hand) == 0


def test_the_origin_is_an_equilibrium_without_pressure_and_disturbance():
    rest = plant.shifted_acceleration().subs({x1: 0, x2: 0, p: 0})
    rest = rest.replace(plant.disturbance, lambda *_: sp.Integer(0))
    assert sp.simplify(rest.subs(plant.mu(0, 0), mu_star)) == 0


def test_the_error_dynamics_are_eq_esystem3():
    r = plant.reference(t)
    slip, rate = plant.e1 + r, plant.e2 + r.diff(t)
    beta = plant.mu(slip, rate) * N_hat / plant.divisor
    h = (
        -(plant.mu(slip, rate) - mu_star) * N_hat * sigma
        - k_hat * slip
        - eta_hat * rate
        + plant.disturbance(slip, rate, t)
        - r.diff(t, 2)
    ) / beta
    found = plant.error_dynamics()
    assert sp.simplify(found.beta - beta) == 0
    assert sp.simplify(found.h - h) == 0
    assert r"\beta" in found._repr_latex_()


def test_the_jacobian_by_hand():
    # ERRATA 1: both friction slopes are multiplied by N̂(σ' − p); the print has −η̂ − μ_x2
    stress = N_hat * (sigma - p)
    by_hand = sp.Matrix([[0, 1], [-k_hat - stress * slip_slope, -eta_hat - stress * rate_slope]])
    assert sp.simplify(plant.jacobian() - by_hand) == sp.zeros(2, 2)
    assert sp.simplify(plant.jacobian()[1, 1] - (-eta_hat - rate_slope)) != 0


@pytest.mark.parametrize("pressure", ["0", "0.8", "-2.5"])
def test_the_jacobian_against_finite_differences(pressure):
    with mpmath.workdps(50):
        step = M(10) ** -25
        slopes = {slip_slope: M("-0.06"), rate_slope: M(0)}  # of `friction` at the origin, by hand
        ours = plant.jacobian().subs({key: sp.Float(str(v), 50) for key, v in slopes.items()})
        for column, (a, b) in enumerate(((step, 0), (0, step))):
            change = (acceleration(a, b, M(pressure)) - acceleration(-a, -b, M(pressure))) / (2 * step)
            assert abs(numeric(ours[1, column], {p: M(pressure)}) - change) < M(10) ** -20


def test_instability_is_an_alternative_with_pressure():
    # ERRATA 2: k̂ < −N̂(σ'−p)μ_x1 or η̂ < −N̂(σ'−p)μ_x2
    stress = N_hat * (sigma - p)
    condition = plant.instability()
    assert isinstance(condition, sp.Or)
    limits = {c.lhs: c.rhs for c in (c.canonical for c in condition.args)}
    assert set(limits) == {k_hat, eta_hat}
    assert sp.simplify(limits[k_hat] + stress * slip_slope) == 0
    assert sp.simplify(limits[eta_hat] + stress * rate_slope) == 0


@pytest.mark.parametrize("softening", ["-3", "-0.1", "0.5"])
@pytest.mark.parametrize("weakening", ["-2", "-0.1", "0.5"])
def test_instability_is_a_root_in_the_right_half_plane(softening, weakening):
    values = {k_hat: "0.5", eta_hat: "0.4", N_hat: "0.7", sigma: "2", p: "-0.5"}
    values |= {slip_slope: softening, rate_slope: weakening}
    values = {key: sp.Rational(v) for key, v in values.items()}
    J = plant.jacobian().subs(values)
    root = mpmath.polyroots([1, -float(J.trace()), float(J.det())], maxsteps=200)
    assert bool(plant.instability().subs(values)) == (max(mpmath.re(r) for r in root) > 0)


def test_withdrawal_can_destabilise():
    # ERRATA 1: pressure p < 0 raises the softening N̂(σ' − p)|μ_x1|
    values = {k_hat: 1, eta_hat: 1, N_hat: 1, sigma: 1, slip_slope: sp.Rational(-4, 5), rate_slope: 0}
    condition = plant.instability().subs(values)
    assert not condition.subs(p, 0)
    assert condition.subs(p, -1)


@pytest.mark.slow
@pytest.mark.parametrize("time", ["0.1", "0.9", "2.3"])
def test_the_rate_of_h_is_its_derivative_along_a_trajectory(time):
    with mpmath.workdps(50):
        time = M(time)
        r, dr, ddr, dddr = (mpmath.diff(target, time, n) for n in range(4))
        e, de, dde = (mpmath.diff(error, time, n) for n in range(3))
        slip, rate = e + r, de + dr
        values = {
            plant.e1: e,
            plant.e2: de,
            plant.acceleration_error: dde,
            plant.r0: r,
            plant.r1: dr,
            plant.r2: ddr,
            plant.r3: dddr,
            plant.friction_value: friction(slip, rate),
            slip_slope: M("-0.06") * mpmath.exp(-slip / 2),
            rate_slope: M("-0.05") * mpmath.sin(rate),
            plant.phi: force(slip, rate, time),
            plant.phi_t: M("0.4") * mpmath.cos(2 * time),
            plant.phi_1: M("0.3"),
            plant.phi_2: M("-0.1"),
        }
        oracle = (matched(time + M(10) ** -8) - matched(time - M(10) ** -8)) / (2 * M(10) ** -8)
        assert abs(numeric(plant.matched_rate(), values) - oracle) < M(10) ** -10 * abs(oracle)


def test_the_rate_of_h_is_affine_in_what_drives_it():
    # ERRATA 16: the control enters through e2'
    rate = plant.matched_rate()
    for symbol in (plant.acceleration_error, plant.r3, plant.phi_t):
        assert sp.simplify(rate.diff(symbol, 2)) == 0
        assert sp.simplify(rate.diff(symbol)) != 0


def test_numbers_of_a_fault_are_exact():
    # G/(ρL²) = 30e9/(2500·25e6) = 12/25; η/(ρL³) = 8/5; 1/(ρL) = 1/12500000
    values = plant.plant_values(load_fault("real-fault"))
    assert values == {
        k_hat: sp.Rational(12, 25),
        eta_hat: sp.Rational(8, 5),
        N_hat: sp.Rational(1, 12500000),
        sigma: sp.Integer(50000000),
    }


def test_a_law_and_a_disturbance_replace_their_names():
    fault = load_fault("real-fault")
    full = plant.with_disturbance(plant.with_law(plant.shifted_acceleration(), fault.friction.exact()), fault)
    numbers = full.subs(plant.plant_values(fault)).subs({x1: sp.Rational(1, 5), x2: sp.Rational(1, 10), p: 10**6, t: 3})
    # by hand, in SI, with mpmath
    mu = M("0.2353") + M("0.1") * mpmath.exp(M("-0.2") / M("0.27635"))
    by_hand = -(mu - M("0.3353")) * 4 + mu * M("0.08") - M("0.096") - M("0.16")
    by_hand += M("3.2e-4") * mpmath.sin(M("2.07")) + M("6.4e-7")
    assert float(numbers) == pytest.approx(float(by_hand), rel=1e-12)


def test_the_extended_law_holds_friction_at_negative_slip():
    law = load_fault("real-fault").friction.exact()
    force_ = plant.with_law(plant.mu(x1, x2), law, extended=True)
    assert force_.subs(x1, -1) == force_.subs(x1, 0) == sp.Rational(3353, 10000)
