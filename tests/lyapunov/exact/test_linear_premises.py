"""Sectors of friction laws from outside the package, which may strengthen with slip."""

from dataclasses import dataclass, field, replace
from fractions import Fraction as F
from typing import ClassVar

import numpy as np
import pytest
import sympy as sp

import quakedesign as qd
from quakedesign.errors import ParameterError
from quakedesign.fault import Disturbance, FrictionLaw, UncertaintyBox, friction_law
from quakedesign.laws import published
from quakedesign.laws.elqr import PressureLimits
from quakedesign.lyapunov import Certificate, Loop
from quakedesign.lyapunov.exact.perturbation_bounds import (
    Errors,
    equilibrium_pressure,
    initial_perturbation,
    largest_matched_rate,
    largest_sensitivities,
    least_authority,
    parameter_ranges,
    rest_pressure,
    sectors,
    static_friction,
)
from quakedesign.lyapunov.exact.premises import linear_premises
from quakedesign.plant import uncertain_plant
from quakedesign.symbolic import plant
from quakedesign.symbolic.friction_bounds import friction_bounds

REAL = qd.load_fault("real-fault")


@dataclass(frozen=True, kw_only=True)
class Hardening(FrictionLaw):
    """Friction that grows with slip from its static value to a larger one."""

    name = "hardening"
    source = "test"
    domain = "slip >= 0"
    residual: float = field(metadata={"unit": "", "symbol": "m_0"})
    gain: float = field(metadata={"unit": "", "symbol": "D"})
    critical_slip: float = field(metadata={"unit": "m", "symbol": "d_c"})

    def coefficient(self, slip, rate, *state):
        """Friction coefficient [-]."""
        return self.residual + self.gain * (1 - sp.exp(-slip / self.critical_slip))

    def extended(self, slip, rate, *state):
        """Friction coefficient [-], held at its static value for slip < 0."""
        return self.coefficient(sp.Max(slip, 0), rate)

    @property
    def bounds(self):
        """Static and largest friction coefficient [-]."""
        return self.residual, self.residual + self.gain

    @property
    def slip_slope(self):
        """Largest chord slope [1/m]."""
        return self.gain / self.critical_slip

    @property
    def rate_slope(self):
        """Zero [s/m]."""
        return 0


def hardening():
    return replace(REAL, friction=Hardening(residual=0.2, gain=0.3, critical_slip=0.05))


@pytest.mark.parametrize("name", ["exponential-slip-weakening", "linear-slip-weakening", "slip-rate-weakening"])
def test_the_laws_of_the_package_only_weaken(name):
    scale = {"critical_rate": 0.1} if "rate" in name else {"critical_slip": 0.1}
    fault = replace(REAL, friction=friction_law(name)(residual=0.2, drop=0.1, **scale))
    assert friction_bounds(fault.friction).weakens
    assert static_friction(fault) == F(3, 10)


def test_the_chords_of_a_hardening_law_are_inside_the_sectors():
    fault, rng = hardening(), np.random.default_rng(1)
    assert not friction_bounds(fault.friction).weakens
    k, N, stress = 30e9 / 2500 / 5000**2, 1 / (2500 * 5000), 50e6
    found = sectors(fault)
    low, high = rest_pressure(fault, (F(0), F(3, 4)))

    def mu(x):
        return 0.2 + 0.3 * (1 - np.exp(-max(x, 0) / 0.05))

    for r in rng.uniform(0, 0.75, 40):
        p = stress - (0.2 * N * stress - k * r) / (mu(r) * N)  # at rest: (mu* - mu) N stress - k r + mu N p = 0
        assert float(low) <= p <= float(high)
        for x in rng.uniform(-0.2, 1, 20):
            chord = -N * (stress - p) * (mu(x) - mu(r)) / (x - r) - k
            assert float(found.slip[0]) <= chord <= float(found.slip[1])


def test_the_slope_of_a_hardening_law_has_either_sign():
    assert parameter_ranges(hardening())[plant.slip_slope] == (-6, 6)


@dataclass(frozen=True, kw_only=True)
class Started(Hardening):
    """Friction that grows from a number of its own."""

    name = "started"
    start: ClassVar[sp.Expr] = sp.sqrt(2) / 4

    def coefficient(self, slip, rate, *state):
        """Friction coefficient [-]."""
        return self.start - self.residual + super().coefficient(slip, rate)

    @property
    def bounds(self):
        """Static and largest friction coefficient [-]."""
        return self.start, self.start + self.gain


def test_friction_at_rest_is_exact_for_a_decimal_or_a_fraction_and_rounded_for_a_root(monkeypatch):
    law = Started(residual=0.2, gain=0.3, critical_slip=0.05)
    assert abs(8 * static_friction(with_friction(law)) ** 2 - 1) < F(1, 10**48)
    for start, exact in ((sp.Float(0.2353), F("0.2353")), (sp.Rational(1, 3), F(1, 3))):
        monkeypatch.setattr(Started, "start", start)
        assert static_friction(with_friction(law)) == exact


def test_a_design_for_a_hardening_law_is_proved_over_both_signs():
    design = qd.design(hardening(), "elqr", continuous=True)
    assert str(design.verdict) == "proved"
    assert design.certificate.loop.uncertain["s"][0] < -20


def test_the_matched_perturbation_of_a_law_that_strengthens_is_covered():
    # h = (−(μ − μ*)N̂σ' − k̂x1 − η̂x2 + φ − r'')·divisor/(μN̂), with μ* = μ(0, 0) = 0.2 typed in by hand
    fault = hardening()
    divisor, N, load = float(least_authority(fault)), fault.authority, fault.effective_normal_stress
    task, w, stiff, damp = fault.reference, fault.disturbance, fault.specific_stiffness, fault.specific_damping
    powers = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])

    def h(t, phase, e1=0.0, e2=0.0):
        s = t / task.operation_time
        r, dr, ddr = (powers.deriv(n)(s) * task.target_slip / task.operation_time**n for n in (0, 1, 2))
        x1, x2 = r + e1, dr + e2
        mu = 0.2 + 0.3 * (1 - np.exp(-x1 / 0.05))
        push = w.amplitude * np.sin(w.frequency * t + phase) + w.slip_growth * x1 + w.rate_growth * x2
        return divisor * (-(mu - 0.2) * N * load - stiff * x1 - damp * x2 + push - ddr) / (mu * N)

    t = np.linspace(1, task.operation_time - 1, 20001)
    step = 1e-2
    phases = np.linspace(0, 2 * np.pi, 37)
    rates = max(np.abs(h(t + step, p) - h(t - step, p)).max() / (2 * step) for p in phases)
    assert rates <= float(largest_matched_rate(fault, least_authority(fault), Errors(), pieces=400))
    first, second = (float(v) for v in largest_sensitivities(fault, least_authority(fault), Errors(), pieces=400))
    small = 1e-7
    assert max(np.abs(h(t, p, e1=small) - h(t, p, e1=-small)).max() for p in phases) <= 2 * small * first
    assert max(np.abs(h(t, p, e2=small) - h(t, p, e2=-small)).max() for p in phases) <= 2 * small * second
    assert float(initial_perturbation(fault, least_authority(fault))) >= w.amplitude * divisor / (0.2 * N) * (1 - 1e-12)


# ---------------------------------------------------------------- pressure at rest, by hand
# k = 0.48 1/s^2, N = 8e-8 m^2/kg, stress 50 MPa: p* = stress (1 - mu*/mu) + ((k - g) r - drift) / (mu N)

STIFFNESS, AUTHORITY, STRESS = 0.48, 8e-8, 50e6


def with_friction(law, growth=0.0, **parts):
    return replace(
        REAL, friction=law, disturbance=Disturbance(slip_growth=growth, amplitude=0.5, frequency=1.0), **parts
    )


def flat():
    """Friction of 0.25 that falls by a part in 1e12, so that the spring alone counts: p* = 24 MPa/m r at rest."""
    return with_friction(friction_law("exponential-slip-weakening")(residual=0.25, drop=2.5e-13, critical_slip=1.0))


def weakening(growth=0.0):
    return with_friction(friction_law("exponential-slip-weakening")(residual=0.2, drop=0.1, critical_slip=0.25), growth)


def ends(pair):
    return tuple(float(end) for end in pair)


@pytest.mark.parametrize("nominal", [True, False])
def test_the_spring_alone_asks_for_a_pressure_that_grows_with_the_slip(nominal):
    found = rest_pressure(flat(), (F(1, 2), F(2)), nominal=nominal)
    assert ends(found) == pytest.approx((12e6, 48e6), rel=1e-9)
    assert found[0] <= 12_000_000 <= 48_000_000 <= found[1]


def test_a_drift_lowers_the_pressure_by_all_of_it():
    # 1/50 m/s^2 over mu N = 2e-8: 1 MPa
    assert ends(rest_pressure(flat(), (F(1, 2), F(2)), drift=F(1, 50))) == pytest.approx((11e6, 48e6), rel=1e-8)


def test_a_single_reference_has_a_pressure_too():
    assert ends(rest_pressure(flat(), (F(2), F(2)))) == pytest.approx((48e6, 48e6), rel=1e-9)
    assert ends(rest_pressure(flat(), (F(2), F(2)), nominal=True)) == pytest.approx((48e6, 48e6), rel=1e-9)


def test_growth_of_the_disturbance_unloads_the_spring():
    fault = replace(flat(), disturbance=Disturbance(slip_growth=0.24))
    assert ends(rest_pressure(fault, (F(0), F(2)))) == pytest.approx((0, 24e6), rel=1e-9, abs=1)


def test_any_friction_of_the_box_from_the_static_value_down_along_the_slope():
    # up to 0.1 m: mu in [0.3 - 0.4*0.1, 0.3] whatever the slip; up to 1 m it may reach 0.2
    one = ends(rest_pressure(weakening(), (F(0), F(1, 10)), pieces=1))
    assert one == pytest.approx((STRESS * (1 - 0.3 / 0.26), STIFFNESS * 0.1 / (0.3 * AUTHORITY)), rel=0.1)  # balls
    assert one[0] <= STRESS * (1 - 0.3 / 0.26) * (1 - 1e-12)
    least = ends(rest_pressure(weakening(), (F(0), F(1)), pieces=1))
    assert least[0] == pytest.approx(STRESS * (1 - 0.3 / 0.2), rel=1e-6)


def test_friction_that_grows_is_taken_up_along_the_slope_and_not_beyond_its_largest():
    # from 0.2, slope 6 1/m: at 10 mm within [0.2, 0.26] (not below the least), at 1 m at most 0.5
    for slip, most in ((F(1, 100), 0.26), (F(1), 0.5)):
        high = STRESS * (1 - 0.2 / most) + (STIFFNESS - 3.2e-6) * float(slip) / (most * AUTHORITY)
        found = rest_pressure(hardening(), (slip, slip))
        other = STIFFNESS * float(slip) / (0.2 * AUTHORITY)  # friction that has not grown
        assert ends(found) == pytest.approx(sorted((high, other)), rel=1e-4)


def test_the_nominal_range_is_that_of_the_law_within_a_ten_thousandth():
    # falls to its smallest value between 0 and 3 m, and grows to its largest at 3 m
    slip = np.linspace(0, 3, 300_001)
    for growth in (0.0, 0.125):
        mu = 0.2 + 0.1 * np.exp(-slip / 0.25)
        exact = STRESS * (1 - 0.3 / mu) + (STIFFNESS - growth) * slip / (mu * AUTHORITY)
        low, high = ends(equilibrium_pressure(weakening(growth), F(3)))
        room = 1.001e-4 * (exact.max() - exact.min())
        assert exact.min() - room <= low <= exact.min() + 1e-3
        assert exact.max() - 1e-3 <= high <= exact.max() + room
        assert slip[0] < slip[exact.argmin()] < slip[-1]


def test_at_rest_friction_does_not_depend_on_the_rate():
    law = friction_law("slip-rate-weakening")(residual=0.2, drop=0.05, critical_rate=0.5)
    assert ends(equilibrium_pressure(with_friction(law), F(2))) == pytest.approx((0, 48e6), rel=1.1e-4, abs=5e3)


@dataclass(frozen=True, kw_only=True)
class Dipping(FrictionLaw):
    """Friction 0.3 - 0.8 s (1 - s) with s = min(slip, 1): at least 0.1, in terms that alone are not positive."""

    name = "dipping"
    source = "test"
    domain = "slip >= 0"
    static: float = field(metadata={"unit": "", "symbol": "m_0"})
    dip: float = field(metadata={"unit": "", "symbol": "D"})

    def coefficient(self, slip, rate, *state):
        """Friction coefficient [-]."""
        s = sp.Min(slip, 1)
        return self.static - self.dip * s * (1 - s)

    def extended(self, slip, rate, *state):
        """Friction coefficient [-], held at its static value for slip < 0."""
        return self.coefficient(sp.Max(slip, 0), rate)

    @property
    def bounds(self):
        """Static and smallest friction coefficient [-]."""
        return self.static - self.dip / 4, self.static

    @property
    def slip_slope(self):
        """Largest chord slope [1/m]."""
        return self.dip

    @property
    def rate_slope(self):
        """Zero [s/m]."""
        return 0


def test_an_enclosure_that_is_not_finite_is_refused():
    fault = with_friction(Dipping(static=0.3, dip=0.8))
    low, high = ends(rest_pressure(fault, (F(0), F(1)), nominal=True))
    slip = np.linspace(0, 1, 10_001)
    mu = 0.3 - 0.8 * slip * (1 - slip)
    exact = STRESS * (1 - 0.3 / mu) + STIFFNESS * slip / (mu * AUTHORITY)
    assert low <= exact.min() < exact.max() <= high
    with pytest.raises(ParameterError, match="the pressure at rest has no finite enclosure"):
        rest_pressure(fault, (F(0), F(1)), nominal=True, pieces=1)


# ---------------------------------------------------------------- sign of the effective stress, limits, widths


@pytest.mark.parametrize(
    ("target", "widths", "positive"),
    [
        (2.794166, {}, True),  # 0.3353*50 MPa against 6 MPa/m: 4 Pa are left
        (2.7941666, {}, True),  # 0.4 Pa
        (2.7941667, {}, False),  # -0.2 Pa
        (2.2, {"stiffness": F(1, 10), "authority": F(1, 10)}, True),
        (2.4, {"stiffness": F(1, 10), "authority": F(1, 10)}, False),  # 0.528 r / 7.2e-8 is more
        (2.6, {"stiffness": F(1, 10)}, False),
        (2.6, {"authority": F(1, 10)}, False),
        (2.5, {"stiffness": F(1, 10)}, True),
    ],
)
def test_the_effective_stress_stays_positive_for_the_worst_plant(target, widths, positive):
    fault = replace(
        REAL,
        reference=replace(REAL.reference, target_slip=target),
        box=UncertaintyBox(name="own", **widths),
        disturbance=Disturbance(),
    )
    assert (uncertain_plant(fault).stress[0] > 0) is positive


@pytest.mark.parametrize(("lowest", "highest", "worst"), [(-5, 200, 0), (-200, 10, 1), (-5, 30, 0), (-500, 500, 1)])
def test_the_limit_that_is_closest_to_the_pressure_at_rest_counts(lowest, highest, worst):
    fault = replace(weakening(), reference=replace(REAL.reference, target_slip=2.0))
    pressures = ends(rest_pressure(fault, (F(0), F(2))))
    limits = PressureLimits(lowest=F(lowest * 10**6), highest=F(highest * 10**6))
    law = replace(published("real-fault")["elqr"], limits=limits)
    found = {p.name: p for p in linear_premises(fault, law, None)}["pressure_at_rest"]
    assert float(found.required) == pytest.approx(abs(pressures[worst]), rel=1e-12)
    assert float(found.certified) == abs((lowest, highest)[worst]) * 1e6
    assert found.ratio > abs(pressures[1 - worst] / (lowest, highest)[1 - worst] / 1e6)


@pytest.mark.parametrize("end", [0, 1])
def test_a_range_of_the_damping_is_covered_at_both_ends(end):
    fault, law = REAL.with_box("ten-percent"), published("real-fault")["elqr"]
    needed = sectors(fault)

    def holds(**ranges):
        loop = Loop(
            law="elqr", gains=dict(law.gains), constants={"b": needed.authority}, states={"e1": 1}, domain="reals",
            uncertain=needed.ranges() | ranges, field={"e1": ()},
        )  # fmt: skip
        return {p.name: p.holds for p in linear_premises(fault, law, Certificate(loop=loop))}["friction_slope"]

    low, high = needed.rate
    assert low < high
    assert holds()
    assert not holds(w=((low + high) / 2, high) if end == 0 else (low, (low + high) / 2))
