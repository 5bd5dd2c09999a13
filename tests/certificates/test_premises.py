"""Premises against a fault: rigorous bounds, compared with hand calculation and with dense sampling."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest

import quakedesign as qd
from quakedesign.certificates.linear_premises import effective_stress, linear_premises, sectors
from quakedesign.certificates.premises import (
    Errors,
    LevelSets,
    Premise,
    coefficient_range,
    largest_matched_rate,
    least_authority,
    sliding_mode_premises,
)
from quakedesign.controllers import control_law, published
from quakedesign.errors import CertificateError
from quakedesign.fault import Disturbance

ZERO = Errors(slip=F(0), rate=F(0), acceleration=F(0))


@pytest.fixture(scope="module")
def real():
    return qd.load_fault("real-fault")


@pytest.fixture(scope="module")
def proof():
    return qd.certify("cta", ("7", "5", "2.3", "1.1"), lipschitz=1, gain_range=(1, "57/40"))[1]


def test_the_divisor_is_residual_friction_times_the_smallest_authority(real):
    # N̂ = 1/(ρL) = 8e-8 m²/kg, μ_res = 0.2353
    assert least_authority(real) == F("0.2353") * F(8, 10**8)
    assert least_authority(real.with_box("ten-percent")) == F("0.2353") * F(8, 10**8) * F(9, 10)


def test_the_range_of_beta_is_that_of_the_errata(real):
    # ERRATA 15: β = μN̂ᴿ/(μ0ᴸN̂0ᴸ) = 6.5e-6 … 9.3e-6; with the designed divisor 1 … μ_max/μ_res
    low, high = coefficient_range(real, F(4, 1385))
    assert (float(low), float(high)) == pytest.approx((6.5e-6, 9.3e-6), rel=3e-3)
    assert coefficient_range(real, least_authority(real)) == (1, F(3353, 2353))


def sampled_rate(fault, divisor):
    """Largest |h'| on the reference for the fault's own friction law, by numpy; h typed in by hand."""
    law, load, task = fault.friction, fault.effective_normal_stress, fault.reference
    s = np.linspace(0, 1, 20001)
    r = task.target_slip * (10 * s**3 - 15 * s**4 + 6 * s**5)
    dr, ddr, dddr = (
        np.polynomial.Polynomial([0, 0, 0, 10, -15, 6]).deriv(n)(s) * task.target_slip / task.operation_time**n
        for n in (1, 2, 3)
    )
    mu = law.residual + law.drop * np.exp(-r / law.critical_slip)
    slope = -law.drop / law.critical_slip * np.exp(-r / law.critical_slip)
    N, k, eta, w = fault.authority, fault.specific_stiffness, fault.specific_damping, fault.disturbance
    largest = 0.0
    for phase in np.linspace(0, 2 * np.pi, 73):
        phi = w.amplitude * np.sin(phase) + w.slip_growth * r
        dphi = w.amplitude * w.frequency * np.cos(phase) + w.slip_growth * dr
        force = -(mu - law.residual - law.drop) * N * load - k * r - eta * dr + phi - ddr
        rate = -slope * dr * N * load - k * dr - eta * ddr + dphi - dddr
        h_rate = divisor * (rate / (mu * N) - force * slope * dr / (mu**2 * N))
        largest = max(largest, float(np.abs(h_rate).max()))
    return largest


@pytest.mark.parametrize("name", ["real-fault", "lab-fault"])
def test_the_rigorous_bound_covers_the_sampled_rate_and_is_not_loose(name):
    fault = qd.load_fault(name)
    divisor = least_authority(fault)
    rigorous = float(largest_matched_rate(fault, divisor, ZERO))
    sampled = sampled_rate(fault, float(divisor))
    assert sampled <= rigorous <= 1.1 * sampled


def test_without_disturbance_the_bound_is_that_of_the_moving_reference(real):
    # (N̂σ'|μ_x1|·μ*/μ + …)·max r' / β: at most N̂σ'·slope·(μ_max/μ_res)²·15/8·d_max/t_op plus the spring's share
    fault = real.with_disturbance(Disturbance())
    rigorous = float(largest_matched_rate(fault, least_authority(fault), ZERO))
    peak = 15 / 8 * 0.785 / 663012
    friction = 4.0 * 0.1 / 0.27635 * (0.3353 / 0.2353) * peak
    assert 0.1 * friction < rigorous < friction + 0.48 * peak * 2 + 1e-9


def test_the_published_cta_gains_exceed_their_bound_about_two_hundredfold(real):
    # ERRATA 15: 200 to 290 times for the 2-CTA, 120 to 175 for the 2-DIA
    laws = published("real-fault")
    premises, _ = sliding_mode_premises(real, laws["cta"], None)
    assert 200 < premises[0].ratio < 300
    assert not premises[0].holds
    premises, _ = sliding_mode_premises(real, laws["dia"], None)
    assert 120 < premises[0].ratio < 180


def test_a_premise_without_a_certificate_never_holds():
    premise = Premise(name="x", required=1.0, certified=2.0, unit="-", proved=False)
    assert premise.ratio == 0.5
    assert not premise.holds


def test_nothing_certified_has_no_ratio_and_does_not_hold():
    premise = Premise(name="x", required=1.0, certified=0.0, unit="-")
    assert premise.ratio is None
    assert not premise.holds
    assert Premise(name="x", required=0.0, certified=0.0, unit="-").holds


def test_level_sets_scale_with_lambda(proof):
    base, scaled = LevelSets(proof, F(1)).errors(F(1, 8)), LevelSets(proof, F(64)).errors(F(1, 8))
    assert (scaled.slip, scaled.rate, scaled.acceleration) == (64 * base.slip, 64 * base.rate, 64 * base.acceleration)


def test_level_sets_enclose_sampled_points_of_the_level(proof):
    from quakedesign.symbolic.terms import value

    level = 1.0
    bounds = LevelSets(proof, F(1)).errors(F(1))
    rng = np.random.default_rng(3)
    e = rng.normal(size=(3, 50000))
    total = np.zeros(50000)
    for term in proof.lyapunov:
        product = float(value(term, {}))
        for state, exponent, kind in term.factors:
            x = e[int(state[1]) - 1]
            product = product * np.abs(x) ** float(exponent) * (np.sign(x) if kind == "s" else 1)
        total += product
    # V(ε^r e) = ε⁵V(e): push every sample to the level
    epsilon = (level / total) ** 0.2
    assert np.abs(epsilon**3 * e[0]).max() <= float(bounds.slip)
    assert np.abs(epsilon**2 * e[1]).max() <= float(bounds.rate)


def test_the_larger_the_errors_the_larger_the_bound(real):
    divisor = least_authority(real)
    small = Errors(slip=F(1, 10**6), rate=F(1, 10**6), acceleration=F(1, 10**6))
    large = Errors(slip=F(1, 10**3), rate=F(1, 10**3), acceleration=F(1, 10**3))
    rates = [largest_matched_rate(real, divisor, e) for e in (ZERO, small, large)]
    assert rates == sorted(rates)
    # η̂·|e2'|/β enters with factor 1.6 (ERRATA 16)
    assert float(rates[2]) > 1.6e-3


def test_a_certificate_of_other_gains_is_refused(real, proof):
    other = control_law("cta").from_values(("7", "5", "2.3", "1.0"), divisor=least_authority(real))
    with pytest.raises(CertificateError, match="other gains"):
        sliding_mode_premises(real, other, proof)


def test_the_effective_stress_covers_the_withdrawal_of_the_errata(real):
    # ERRATA 8: p* down to −5.67 MPa for the fault's own law, so σ' − p* reaches 55.67 MPa; the box allows more
    stress, positive = effective_stress(real)
    assert positive
    assert 55.67e6 < stress < 80e6


def test_sectors_of_the_paper_box_by_hand(real):
    found = sectors(real)
    slope = 4.0 / 50e6 * float(found.largest_effective_stress) * 0.1 / 0.27635
    assert float(found.slip[1]) == pytest.approx(slope - 0.48 + 3.2e-6, rel=1e-9)
    assert float(found.slip[0]) == pytest.approx(-0.48 + 3.2e-6, rel=1e-9)
    assert found.rate == (F(8, 5), F(8, 5))
    assert found.beta == (1, F(3353, 2353))


def test_the_ten_percent_box_widens_every_sector(real):
    narrow, wide = sectors(real), sectors(real.with_box("ten-percent"))
    assert wide.slip[0] < narrow.slip[0] < narrow.slip[1] < wide.slip[1]
    assert wide.rate == (F(8, 5) * F(9, 10), F(8, 5) * F(11, 10))
    assert wide.beta == (1, F(3353, 2353) * F(11, 9))


def test_the_linear_certificate_does_not_claim_the_moving_reference_or_the_sine(real):
    design = qd.design(real, "elqr")
    by_name = {p.name: p for p in design.premises}
    assert by_name["friction_slope"].holds
    assert not by_name["constant_reference"].holds
    assert not by_name["vanishing_disturbance"].holds
    quiet = linear_premises(real.with_disturbance(Disturbance()), design.controller, None)
    assert {p.name: p for p in quiet}["vanishing_disturbance"].holds


def test_a_linear_certificate_of_another_fault_is_refused(real):
    design = qd.design(real, "elqr")
    with pytest.raises(CertificateError, match="another fault"):
        linear_premises(replace(real, density=2600.0), design.controller, design.certificate)
