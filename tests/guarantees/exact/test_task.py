"""Ranges of the error loop against the package's other derivation and against courses of the friction law itself."""

from dataclasses import dataclass, replace
from fractions import Fraction as F

import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault import Disturbance, friction_law, load_fault
from quakedesign.fault.friction.weakening import ExponentialSlipWeakening
from quakedesign.lyapunov.exact import perturbation_bounds as matched
from quakedesign.lyapunov.exact.perturbation_bounds import rest_pressure, sectors
from quakedesign.plant import uncertain_plant
from quakedesign.symbolic import plant

FAULTS = [("real-fault", None), ("lab-fault", None), ("real-fault", "ten-percent"), ("lab-fault", "ten-percent")]


@pytest.mark.parametrize(("name", "box"), FAULTS)
def test_closed_forms_are_inside_the_bounds_found_by_subdivision_and_close(name, box):
    fault = load_fault(name, box=box)
    task, other = uncertain_plant(fault), sectors(fault)
    assert (task.authority, task.beta) == (other.authority, other.beta)
    assert task.rate_chord == other.rate
    assert other.slip[0] <= task.slip_chord[0]
    assert 0 <= other.slip[1] - task.slip_chord[1] <= other.slip[1] / 50
    whole = rest_pressure(fault, (F(0), F(str(fault.reference.target_slip))))
    assert whole[0] <= task.rest_pressure[0] <= task.rest_pressure[1] <= whole[1]
    assert whole[1] - whole[0] <= F(11, 10) * (task.rest_pressure[1] - task.rest_pressure[0])


@pytest.mark.parametrize("name", ["real-fault", "lab-fault"])
def test_reference_rates_are_those_of_the_quintic(name):
    """15/8·d/t and 10/√3·d/t²."""
    fault = load_fault(name)
    task = uncertain_plant(fault)
    first, second = task.reference_rates
    assert F(15, 8) <= first * task.operation_time / task.target_slip <= F(15, 8) * F(1001, 1000)
    assert F(100, 3) <= (second * task.operation_time**2 / task.target_slip) ** 2 <= F(100, 3) * F(1001, 1000)


@pytest.mark.parametrize("name", ["real-fault", "lab-fault"])
def test_the_fault_s_own_law_stays_inside_the_ranges(name):
    """Chords, β and p* of the exponential law at 20 000 pairs of slip and reference, from its own formula."""
    fault = load_fault(name)
    task, law, random = uncertain_plant(fault), fault.friction, np.random.default_rng(1)
    r = fault.reference.target_slip * random.random(20_000)
    x = np.abs(r + fault.reference.target_slip * random.standard_normal(20_000) * 10.0 ** random.uniform(-6, 0, 20_000))
    mu = lambda slip: law.residual + law.drop * np.exp(-slip / law.critical_slip)  # noqa: E731
    area, k, growth = fault.authority, fault.specific_stiffness, fault.disturbance.slip_growth
    stress = (area * mu(0) * fault.effective_normal_stress - (k - growth) * r) / (area * mu(r))
    chord = -area * stress * (mu(x) - mu(r)) / (x - r) - k + growth
    assert float(task.slip_chord[0]) <= chord.min()
    assert chord.max() <= float(task.slip_chord[1])
    assert float(task.stress[0]) <= stress.min()
    assert stress.max() <= float(task.stress[1])
    beta = mu(x) * area / float(task.authority)
    assert beta.min() >= 1
    assert beta.max() <= float(task.beta[1])
    slope = area * stress * law.drop / law.critical_slip * np.exp(-r / law.critical_slip) - k + growth
    drift = np.abs(slope) * float(task.reference_rates[0]) / (mu(r) * area / float(task.authority))
    assert drift.max() <= float(task.drift)


def test_the_jerk_is_that_of_the_quintic():
    """60·d/t³ at both ends."""
    task = uncertain_plant(load_fault("real-fault"))
    assert F(60) <= task.reference_jerk * task.operation_time**3 / task.target_slip <= F(60) * F(1001, 1000)
    task.require_smooth_reference()
    with pytest.raises(ParameterError, match="without acceleration"):
        replace(task, shape=(F(0), F(0), F(3), F(-2))).require_smooth_reference()


def test_the_drift_is_that_of_the_worst_friction_but_for_a_tenth():
    # friction falls as steeply as the box allows and ends where r' is largest; p* by hand from the balance at rest
    fault = load_fault("real-fault")
    law, N, sigma, task = fault.friction, fault.authority, fault.effective_normal_stress, fault.reference
    s = np.linspace(0, 1, 200001)
    r = task.target_slip * s**3 * (10 - 15 * s + 6 * s**2)
    begin = task.target_slip / 2 - law.critical_slip
    assert begin > 0
    mu = law.residual + law.drop * np.clip(1 - (r - begin) / law.critical_slip, 0, 1)
    spring = fault.specific_stiffness - fault.disturbance.slip_growth
    rest = ((mu - mu[0]) * N * sigma + spring * r) / (mu * N)
    worst = np.abs(np.gradient(rest, s * task.operation_time)).max()
    bound = float(uncertain_plant(fault).drift / uncertain_plant(fault).authority)
    assert 0.9 * bound < worst <= bound


def test_friction_that_strengthens_or_depends_on_the_rate_widens_the_ranges():
    fault = load_fault("real-fault")
    plain = uncertain_plant(fault)
    both = replace(plain, friction=replace(plain.friction, strengthening=plain.friction.weakening, rate_slope=F(1, 10)))
    assert both.slip_chord[0] < plain.slip_chord[0]
    assert both.rate_chord[0] < plain.rate_chord[0] == plain.rate_chord[1] < both.rate_chord[1]


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"density": F(-1)}, "density of .* must be positive"),
        ({"amplitude": F(-1)}, "amplitude of .* must be 0 or more"),
        ({"spreads": (F(1), F(0), F(0))}, "spread of stiffness .* must be from 0 to below 1"),
        ({"shape": (F(0), F(1))}, "shape"),  # begins with a jump of the slip rate
        ({"shape": (F(0), F(0), F(9), F(-8))}, "shape"),  # ends with one
        ({"shape": (F(0), F(0), F(33), F(-62), F(30))}, "shape"),  # falls near the end
    ],
)
def test_data_that_the_derivation_does_not_cover_are_refused(change, match):
    with pytest.raises(ParameterError, match=match):
        replace(uncertain_plant(load_fault("real-fault")), **change)


def test_the_class_rate_needs_a_start_at_zero():
    fault = load_fault("real-fault").with_disturbance(Disturbance(constant=1e-4, amplitude=1e-4, frequency=0.5))
    assert uncertain_plant(fault).amplitude == F(2, 10**4)
    with pytest.raises(ParameterError, match="is 0 at t = 0"):
        uncertain_plant(fault, rate_limited=True)


def test_bounds_of_the_disturbance_are_those_of_the_decimals():
    """3.2e-4·0.69; and 0.1 + 0.7 and 0.7·0.1, which floats make less than 0.8 and 0.07."""
    fault = load_fault("real-fault")
    assert (uncertain_plant(fault).change, uncertain_plant(fault, rate_limited=True).change) == (None, F("2.208e-4"))
    constant = fault.with_disturbance(Disturbance(constant=-0.1, amplitude=0.7))
    assert uncertain_plant(constant).amplitude == F("0.8")
    shaken = fault.with_disturbance(Disturbance(amplitude=0.7, frequency=0.1))
    assert uncertain_plant(shaken, rate_limited=True).change == F("0.07")
    assert matched.parameter_ranges(constant)[plant.phi] == (F("-0.8"), F("0.8"))
    assert matched.parameter_ranges(shaken)[plant.phi_t] == (F("-0.07"), F("0.07"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Hardening(ExponentialSlipWeakening):
    """The exponential law with the drop as a rise: friction grows with slip."""

    def coefficient(self, slip, rate, *state):
        """Friction coefficient [-] for slip ≥ 0."""
        return 2 * self.residual + self.drop - super(Hardening, self).coefficient(slip, rate)

    @property
    def bounds(self):
        """At rest and after all slip."""
        return self.residual, self.residual + self.drop


def test_friction_that_grows_with_slip_strengthens_by_its_slope():
    fault = load_fault("real-fault")
    law = fault.friction
    rising = Hardening(residual=law.residual, drop=law.drop, critical_slip=law.critical_slip)
    assert uncertain_plant(fault).friction.strengthening == 0
    slope = F(str(law.drop)) / F(str(law.critical_slip))
    for one, strengthening in ((law, 0), (rising, slope)):
        found = uncertain_plant(replace(fault, friction=one)).friction
        assert slope <= found.weakening <= slope * (1 + F(1, 10**8))
        assert strengthening <= found.strengthening <= strengthening * (1 + F(1, 10**8))


def test_friction_with_a_state_is_refused():
    law = friction_law("rate-and-state-aging")(
        reference_coefficient=0.6, direct_effect=0.01, evolution_effect=0.015, critical_slip=1e-3,
        reference_rate=1e-6, slowest_rate=1e-9, fastest_rate=1e-3,
    )  # fmt: skip
    with pytest.raises(ParameterError, match="guarantee of tracking needs"):
        uncertain_plant(replace(load_fault("real-fault"), friction=law))
