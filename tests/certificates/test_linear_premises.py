"""Sectors of friction laws from outside the package, which may strengthen with slip."""

from dataclasses import dataclass, field, replace
from fractions import Fraction as F

import numpy as np
import pytest
import sympy as sp

import quakedesign as qd
from quakedesign.certificates.linear_premises import only_weakens, rest_pressure, sectors, static_friction
from quakedesign.fault.friction import FrictionLaw, friction_law

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
    assert only_weakens(fault)
    assert static_friction(fault) == F(3, 10)


def test_the_chords_of_a_hardening_law_are_inside_the_sectors():
    fault, rng = hardening(), np.random.default_rng(1)
    assert not only_weakens(fault)
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
