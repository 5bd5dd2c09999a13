"""Sectors of friction laws from outside the package, which may strengthen with slip."""

from dataclasses import dataclass, field, replace
from fractions import Fraction as F

import numpy as np
import pytest
import sympy as sp

import quakedesign as qd
from quakedesign.certificates.linear_premises import rest_pressure, sectors
from quakedesign.certificates.matched import (
    Errors,
    initial_perturbation,
    largest_matched_rate,
    largest_sensitivities,
    least_authority,
    static_friction,
)
from quakedesign.fault.friction import FrictionLaw, friction_law
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


def test_a_design_for_a_hardening_law_is_proved_over_both_signs():
    design = qd.design(hardening(), "elqr")
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
