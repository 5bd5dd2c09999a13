"""The matched perturbation against the worst friction and the largest disturbance of the box, each where it counts."""

from dataclasses import replace

import numpy as np
import pytest

import quakedesign as qd
from quakedesign.certificates.matched import Errors, initial_perturbation, largest_matched_rate, least_authority
from quakedesign.fault import Disturbance

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
