"""What a certificate of the linear feedback needs of a fault, by hand: sectors, premises."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest
import sympy as sp

import quakedesign as qd
from quakedesign.errors import CertificateError, ParameterError
from quakedesign.exact import rational, to_sympy
from quakedesign.fault import Disturbance, UncertaintyBox, friction_law, load_fault
from quakedesign.laws import published
from quakedesign.lyapunov import Certificate, Loop
from quakedesign.lyapunov.exact import perturbation_bounds as bounds
from quakedesign.lyapunov.exact.perturbation_bounds import sectors
from quakedesign.lyapunov.exact.premises import Premise, linear_premises
from quakedesign.plant import uncertain_plant
from quakedesign.symbolic import plant
from quakedesign.symbolic.enclosure import upper_bound
from quakedesign.symbolic.friction_bounds import friction_bounds

REAL = qd.load_fault("real-fault")
LAW = published("real-fault")["elqr"]
TARGET, DURATION = 0.785, 663012.0
PEAK_RATE = 15 / 8 * TARGET / DURATION
"""Largest derivative of d(10 s^3 - 15 s^4 + 6 s^5), at s = 1/2."""


def disturbed(**parts):
    return REAL.with_disturbance(Disturbance(**parts))


# ---------------------------------------------------------------- premises of the linear feedback


def linear(**ranges):
    """Certificate, without a proof, for the published gains over given sectors."""
    needed = sectors(REAL)
    loop = Loop(
        law="elqr",
        gains=dict(LAW.gains),
        constants={"b": needed.authority},
        states={"e1": 1},
        domain="reals",
        uncertain=needed.ranges() | ranges,
        field={"e1": ()},
    )
    return Certificate(loop=loop)


def holding(**ranges):
    return {p.name: p.holds for p in linear_premises(REAL, LAW, linear(**ranges))}


def test_exactly_the_needed_sectors_are_enough():
    found = holding()
    assert found["control_coefficient"]
    assert found["friction_slope"]
    assert not found["constant_reference"]
    assert not found["vanishing_disturbance"]


@pytest.mark.parametrize("name", ["s", "w", "beta"])
@pytest.mark.parametrize("end", [0, 1])
def test_a_sector_that_is_smaller_at_one_end_is_not(name, end):
    low, high = sectors(REAL).ranges()[name]
    middle = (low + high) / 2 if low < high else low + (F(1, 100) if end == 0 else F(-1, 100))
    smaller = (middle, max(high, middle)) if end == 0 else (min(low, middle), middle)
    premise = "control_coefficient" if name == "beta" else "friction_slope"
    assert not holding(**{name: smaller})[premise]
    wider = {"s": (F(-100), F(100)), "w": (F(-100), F(100)), "beta": (F(1, 100), F(100))}
    assert holding(**wider)[premise]


def test_a_certificate_about_something_else_is_refused():
    one = linear()
    for changes in (
        {"law": "other"},
        {"gains": dict(LAW.gains) | {"k1": F(1)}},
        {"constants": {"b": F(1)}},
        {"constants": {}},
    ):
        with pytest.raises(CertificateError, match="law, gains or control authority of the certificate differ"):
            linear_premises(REAL, LAW, replace(one, loop=replace(one.loop, **changes)))
    assert not any(p.holds for p in linear_premises(REAL, LAW, None))


def test_the_reference_asks_for_its_peak_rate():
    found = {p.name: p for p in linear_premises(REAL, LAW, linear())}
    assert found["constant_reference"].required == pytest.approx(PEAK_RATE, rel=1e-12)
    assert found["constant_reference"].certified == found["vanishing_disturbance"].certified == 0
    assert found["vanishing_disturbance"].required == pytest.approx(3.2e-4)


# ---------------------------------------------------------------- sectors


def test_sectors_by_hand_with_a_growing_disturbance_and_every_width():
    """k = 0.48, eta = 1.6 and N = 8e-8, each a tenth up and down; chord N' stress slope, slope 0.1/0.27635."""
    fault = disturbed(slip_growth=0.125, rate_growth=0.25).with_box("ten-percent")
    found = sectors(fault)
    chord = 1.1 * 8e-8 * float(found.largest_effective_stress) * 0.1 / 0.27635
    assert float(found.slip[0]) == pytest.approx(-0.48 * 1.1 + 0.125, rel=1e-12)
    assert float(found.slip[1]) == pytest.approx(chord - 0.48 * 0.9 + 0.125, rel=1e-9)
    assert found.rate == (F(8, 5) * F(9, 10) - F(1, 4), F(8, 5) * F(11, 10) - F(1, 4))
    assert found.authority == F("0.2353") * 8 * F(9, 10) / 10**8
    rows = [max(abs(float(s) + 0.48) for s in found.slip), max(abs(float(w) - 1.6) for w in found.rate)]
    assert [float(bound * found.authority) for bound in found.row_bounds] == pytest.approx(rows, rel=1e-9)
    assert found.ranges() == {"beta": found.beta, "s": found.slip, "w": found.rate}


def test_a_normal_stress_that_turns_leaves_both_signs_of_the_chord():
    """At rest at r the fault bears (mu* N stress - k r)/(mu N), which is negative beyond 2.79 m."""
    near, far = (replace(REAL, reference=replace(REAL.reference, target_slip=slip)) for slip in (2.7, 5.0))
    assert float(sectors(near).slip[0]) == pytest.approx(-0.48 + 3.2e-6, rel=1e-9)
    found = sectors(far)
    chord = 8e-8 * float(found.largest_effective_stress) * 0.1 / 0.27635
    least = min((0.3353 * 4.0 - (0.48 - 3.2e-6) * 5.0) / mu for mu in (0.2353, 0.3353)) * 0.1 / 0.27635
    assert float(found.slip[0]) == pytest.approx(least - 0.48 + 3.2e-6, rel=1e-9)
    assert float(found.slip[1]) == pytest.approx(chord - 0.48 + 3.2e-6, rel=1e-9)


def test_the_stress_at_rest_by_hand():
    """Anything that weakens at most by slope * r from mu* and not below mu_res bears at most the value at the least."""
    stress = uncertain_plant(REAL).stress
    slip = np.append(np.linspace(0, TARGET, 20001), 0.27635)  # where friction reaches its least value
    least = np.maximum(0.2353, 0.3353 - 0.1 / 0.27635 * slip)
    exact = np.abs((0.3353 * 4.0 - (0.48 - 3.2e-6) * slip) / (least * 8e-8)).max()
    assert stress[0] > 0
    assert exact * (1 - 1e-9) <= float(stress[1]) <= exact * (1 + 1e-6)


@pytest.mark.parametrize("widths", [{}, {"stiffness": F(1, 10), "damping": F(1, 10), "authority": F(1, 10)}])
@pytest.mark.parametrize("name", ["real-fault", "lab-fault"])
def test_ball_arithmetic_encloses_the_ranges_of_the_plant_and_is_less_tight(name, widths):
    """A second derivation: friction in symbols, its stress at rest in balls. It was 0.35 % wider, never narrower."""
    fault = replace(load_fault(name), box=UncertaintyBox(name="own", **widths))
    ranges, start = bounds.plant_ranges(fault), to_sympy(bounds.static_friction(fault))
    known = {bounds._growth: to_sympy(rational(fault.disturbance.slip_growth)), bounds._drift: 0}
    net = bounds._net_stress().subs(known | {plant.mu_star: start})
    slope = to_sympy(friction_bounds(fault.friction).slip_slope)
    least = sp.Max(to_sympy(bounds.friction_range(fault)[0]), start - slope * bounds._r)
    box = {s: ranges[s] for s in (plant.k_hat, plant.N_hat, plant.sigma)}
    box |= {bounds._r: (F(0), rational(fault.reference.target_slip))}
    numerator = sp.collect(sp.expand(net * bounds._mu), bounds._r)
    enclosed = upper_bound(numerator / least, box, pieces=400)
    largest = sectors(fault).largest_effective_stress
    assert largest == max(map(abs, uncertain_plant(fault).stress))
    assert largest <= enclosed <= F(101, 100) * largest


def test_friction_that_weakens_with_the_rate_widens_the_damping_at_both_ends():
    law = friction_law("slip-rate-weakening")(residual=0.2, drop=0.1, critical_rate=0.5)
    found = sectors(replace(REAL, friction=law))
    chord = 8e-8 * float(found.largest_effective_stress) * float(law.rate_slope)
    assert chord > 0
    assert [float(end) for end in found.rate] == pytest.approx([1.6 - chord, 1.6 + chord], rel=1e-9)


def test_a_premise_holds_up_to_its_bound():
    def premise(required, certified, **more):
        return Premise(name="x", required=required, certified=certified, unit="-", **more)

    assert premise(1.0, 1.0).holds
    assert premise(1.0, 1.5).holds
    assert not premise(1.001, 1.0).holds
    assert not premise(1.6, 1.0).holds
    assert not premise(0.5, 1.0, proved=False).holds
    assert not premise(0.5, 1.0).measured
    assert premise(1.0, 4.0).ratio == 0.25
    assert premise(0.0, 1.0).ratio == 0


@pytest.mark.parametrize("name", ["beta", "slip", "rate"])
def test_each_range_of_sectors_is_in_order(name):
    found = sectors(REAL)
    point = {name: (F(1), F(1))}
    assert getattr(replace(found, **point), name) == (1, 1)
    with pytest.raises(ParameterError, match="ranges must be ordered"):
        replace(found, **{name: (F(1), F(999, 1000))})
