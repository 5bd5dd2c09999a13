"""The matched perturbation against the worst friction and the largest disturbance of the box, each where it counts."""

from dataclasses import replace
from fractions import Fraction as F
from itertools import product

import numpy as np
import pytest
import sympy as sp

import quakedesign as qd
from quakedesign.fault import Disturbance, friction_law
from quakedesign.laws.feed_forward import feed_forward
from quakedesign.lyapunov.exact.perturbation_bounds import (
    Errors,
    _reference_values,
    initial_perturbation,
    largest_matched_rate,
    largest_sensitivities,
    least_authority,
    parameter_ranges,
    sensitivity_expressions,
    stage,
    static_friction,
)
from quakedesign.symbolic import plant

REAL = qd.load_fault("real-fault")


def worst_rate(fault, push):
    """Largest |h'| [m/s³] for a constant disturbance and friction that falls as steeply as the box allows, by hand.

    h = (−(μ − μ*)N̂σ' − k̂r − η̂r' + φ − r'')·divisor/(μN̂), and friction ends its fall where r' is largest.
    """
    law, task, N, load = fault.friction, fault.reference, fault.authority, fault.effective_normal_stress
    s = np.linspace(0, 1, 40001)
    powers = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    r, dr, ddr = (powers.deriv(n)(s) * task.target_slip / task.operation_time**n for n in (0, 1, 2))
    begin = task.target_slip / 2 - law.critical_slip
    mu = law.residual + law.drop * np.clip(1 - (r - begin) / law.critical_slip, 0, 1)
    force = -(mu - mu[0]) * N * load - fault.specific_stiffness * r - fault.specific_damping * dr + push - ddr
    h = float(least_authority(fault)) * force / (mu * N)
    return float(np.abs(np.gradient(h, s * task.operation_time)).max())


@pytest.mark.parametrize(
    ("disturbance", "push"),
    [(Disturbance(), 0.0), (Disturbance(constant=20.0), 20.0), (Disturbance(constant=-20.0), -20.0)],
    ids=["the slope in slip", "a push forward", "a push backward"],
)
def test_the_bound_is_close_to_what_the_worst_friction_reaches(disturbance, push):
    # 20 m/s² are five times what friction carries, so that half of φ, or half the slope, would be far too little
    fault = REAL.with_disturbance(disturbance)
    bound = float(largest_matched_rate(fault, least_authority(fault), Errors(), pieces=400))
    assert 0.7 * bound < worst_rate(fault, push) <= bound


@pytest.mark.parametrize("push", [20.0, -20.0])
def test_at_the_start_the_whole_disturbance_over_beta_is_there(push):
    # β = μ*N̂/divisor at x = 0
    fault = REAL.with_disturbance(Disturbance(constant=push))
    static = fault.friction.residual + fault.friction.drop
    expected = abs(push) * float(least_authority(fault)) / (static * fault.authority)
    assert float(initial_perturbation(fault, least_authority(fault))) == pytest.approx(expected, rel=1e-12)


def test_a_larger_authority_than_the_least_is_no_smaller_a_start():
    wide = replace(REAL, box=REAL.with_box("ten-percent").box).with_disturbance(Disturbance(constant=1.0))
    static, least = wide.friction.residual + wide.friction.drop, wide.authority * 0.9
    expected = float(least_authority(wide)) / (static * least)
    assert float(initial_perturbation(wide, least_authority(wide))) == pytest.approx(expected, rel=1e-12)


# ---------------------------------------------------------------- every corner of what is not known, by brute force


def corners(fault, errors, weakens=True):
    """Values of all that h depends on, at the corners of their ranges and on grids of stage and friction; mu* and D.

    Ranges typed in by hand: the law's bounds and slopes, half-widths of the box, plus and minus the disturbance and its
    rate, plus and minus the errors.
    """
    law, task, w, box = fault.friction, fault.reference, fault.disturbance, fault.box
    least, most = law.bounds
    slopes = (-float(law.slip_slope), 0.0 if weakens else float(law.slip_slope))
    rates = (-float(law.rate_slope), float(law.rate_slope))
    s = np.linspace(0, 1, 81)[:, None]
    mu = np.linspace(float(least), float(most), 9)[None, :]
    powers = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    r = [powers.deriv(n)(s) * task.target_slip / task.operation_time**n for n in range(4)]
    push, change = abs(w.constant) + w.amplitude, w.amplitude * w.frequency
    plants = [
        [value * (1 + sign * float(width)) for sign in (-1, 1)]
        for value, width in (
            (fault.specific_stiffness, box.stiffness),
            (fault.specific_damping, box.damping),
            (fault.authority, box.authority),
        )
    ]
    sides = [(-float(v), float(v)) for v in (errors.slip, errors.rate, errors.acceleration, push, change)]
    for e1, e2, e3, phi, phi_t, m, q, k, eta, N in product(*map(dict.fromkeys, (*sides, slopes, rates, *plants))):
        x1, x2, x3 = r[0] + e1, r[1] + e2, r[2] + e3
        yield mu, x1, x2, x3, r[2], r[3], phi + w.slip_growth * x1 + w.rate_growth * x2, phi_t, m, q, k, eta, N


def worst(fault, errors, weakens=True):
    """Largest |h'|, |dh/de1| and |dh/de2| for h = D (-(mu - mu*) N stress - k x1 - eta x2 + phi - r'')/(mu N)."""
    start, D, stress = float(static_friction(fault)), float(least_authority(fault)), fault.effective_normal_stress
    slip, rate, found = fault.disturbance.slip_growth, fault.disturbance.rate_growth, np.zeros(3)
    for mu, x1, x2, x3, jerk2, jerk3, phi, phi_t, m, q, k, eta, N in corners(fault, errors, weakens):
        force = -(mu - start) * N * stress - k * x1 - eta * x2 + phi - jerk2
        bend = -(stress + force / (mu * N)) / mu  # for a unit of the slope of mu
        of_slip, of_rate = D * (bend * m + (slip - k) / (mu * N)), D * (bend * q + (rate - eta) / (mu * N))
        whole = of_slip * x2 + of_rate * x3 + D * (phi_t - jerk3) / (mu * N)
        found = np.maximum(found, [np.abs(part).max() for part in np.broadcast_arrays(whole, of_slip, of_rate)])
    return found


def faulty(law, target=2.0, duration=1000.0, **disturbance):
    task = replace(REAL.reference, target_slip=target, operation_time=duration)
    fault = replace(REAL, friction=law, reference=task, sampling_time=1e-4 * duration)
    return replace(fault, disturbance=Disturbance(**disturbance))


FLAT = friction_law("exponential-slip-weakening")(residual=0.25, drop=2.5e-13, critical_slip=1.0)
SLIP = friction_law("exponential-slip-weakening")(residual=0.25, drop=0.05, critical_slip=0.5)
RATE = friction_law("slip-rate-weakening")(residual=0.25, drop=0.05, critical_rate=0.5)
ALL = Errors(slip=F(1, 100), rate=F(1, 100), acceleration=F(1, 100))
CASES = {
    "growth in slip": (
        faulty(FLAT, slip_growth=1.0, rate_growth=0.0625, amplitude=0.25, frequency=0.125), ALL, 1.001
    ),
    "growth in rate": (
        faulty(FLAT, slip_growth=0.0625, rate_growth=0.125, amplitude=0.25, frequency=0.125), ALL, 1.001
    ),
    "a fast reference": (faulty(FLAT, duration=200.0, frequency=0.5, amplitude=0.001), Errors(), 1.01),
    "a moving reference": (faulty(FLAT, duration=200.0), Errors(acceleration=F(1, 10)), 1.01),
    "friction in slip": (faulty(SLIP, constant=20.0), Errors(), 1.02),
    "friction in slip, stretched": (
        faulty(SLIP, target=5.0, constant=0.5, slip_growth=0.75), Errors(rate=F(1, 1000)), 1.2
    ),
    "friction in slip, far errors": (
        faulty(SLIP, slip_growth=4.0, rate_growth=3.0), Errors(slip=F(1), rate=F(1, 2)), 1.2
    ),
    "friction in slip, at once": (faulty(SLIP, duration=4.0, rate_growth=3.0), Errors(), 1.25),
    "friction in rate": (faulty(RATE, target=5.0, constant=0.5), Errors(acceleration=F(1, 10)), 1.2),
    "friction in rate, pushed": (faulty(RATE, target=1.0, constant=20.0), Errors(acceleration=F(1, 10)), 1.001),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_the_bounds_are_those_of_the_worst_corner(name):
    fault, errors, room = CASES[name]
    divisor = least_authority(fault)
    bounds = largest_matched_rate(fault, divisor, errors), *largest_sensitivities(fault, divisor, errors, pieces=120)
    for bound, exact in zip(bounds, worst(fault, errors), strict=True):
        assert exact * (1 - 1e-9) <= float(bound) <= room * exact + 1e-12


def test_errors_are_zero_unless_told():
    assert Errors() == Errors(slip=F(0), rate=F(0), acceleration=F(0))
    assert set(Errors().ranges().values()) == {(0, 0)}


def test_friction_falls_or_turns_where_its_law_does():
    assert parameter_ranges(faulty(SLIP))[plant.slip_slope] == (F(-1, 10), 0)
    assert parameter_ranges(faulty(RATE))[plant.rate_slope][0] < 0 < parameter_ranges(faulty(RATE))[plant.rate_slope][1]


@pytest.mark.parametrize("name", ["none", "nominal"])
def test_sensitivities_are_the_derivatives_where_friction_and_disturbance_are_linear(name):
    """μ = 2/5 − 3·x1 − 7·x2 and φ = 1/9 + x1/11 + x2/13, so that chords and derivatives are the same."""
    fault, divisor = REAL, F(1, 10**8)
    given = feed_forward(name, fault, divisor)
    time, errors = sp.Rational(2, 7), {plant.e1: sp.Rational(1, 50), plant.e2: sp.Rational(1, 90)}
    r = [value.subs(stage, time) for value in _reference_values(fault).values()]
    x1, x2 = errors[plant.e1] + r[0], errors[plant.e2] + r[1]
    start = sp.Rational(*static_friction(fault).as_integer_ratio())
    hats = {plant.k_hat: sp.Rational(1, 2), plant.eta_hat: sp.Rational(5, 3), plant.N_hat: sp.Rational(1, 7),
            plant.sigma: 11, plant.mu_star: start}  # fmt: skip
    friction = sp.Rational(2, 5) - 3 * x1 - 7 * x2
    values = hats | errors | {
        stage: time, plant.friction_value: friction, plant.slip_slope: -3, plant.rate_slope: -7,
        plant.phi: sp.Rational(1, 9), plant.phi_1: sp.Rational(1, 11), plant.phi_2: sp.Rational(1, 13),
    }  # fmt: skip

    h = plant.matched_perturbation()
    h = h.replace(plant.mu, lambda z, v: sp.Rational(2, 5) - 3 * z - 7 * v)
    h = h.replace(plant.disturbance, lambda z, v, _: sp.Rational(1, 9) + z / 11 + v / 13)
    h = plant._named(h).subs(dict(zip((plant.r0, plant.r1, plant.r2), r, strict=False)))
    h += given.acceleration(plant.e1 + r[0], plant.e2 + r[1], r[2])
    h = h.subs(hats).subs(plant.divisor, sp.Rational(1, 10**8))
    for found, error in zip(sensitivity_expressions(fault, divisor, given), errors, strict=True):
        assert sp.simplify(found.subs(values) - h.diff(error).subs(errors)) == 0
