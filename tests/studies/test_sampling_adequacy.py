"""Whether T_s is short enough, against eigenvalues of the plant on a grid of the box."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from thinned import few

from quakedesign.fault import Disturbance, friction_law, load_fault
from quakedesign.studies.fault_facts import fault_sentences, sampling_adequacy, sampling_sentence

REAL, LAB = load_fault("real-fault"), load_fault("lab-fault")
UNDERSAMPLED = load_fault(Path(__file__).parent.parent / "data" / "undersampled_fault.toml")


def growing(slope, damping):
    poles = np.linalg.eigvals([[0.0, 1.0], [slope, -damping]])
    return max((abs(z) for z in poles if z.real > 0), default=0.0)


def test_the_pole_is_that_of_the_steepest_friction_at_the_largest_effective_stress():
    """Closed form of x2'' = s·x1 − w·x2 with s = N̂Δμ/d_c·(σ' − p) − k̂ at the least p of the task, box `paper`."""
    law, task = REAL.friction, REAL.reference
    slip = np.linspace(0, task.target_slip, 100_001)
    low, high = law.bounds
    friction = np.maximum(low, high - law.drop / law.critical_slip * slip)
    push = REAL.specific_stiffness - REAL.disturbance.slip_growth
    stress = (high * REAL.effective_normal_stress - push * slip / REAL.authority) / friction
    slope = REAL.authority * law.drop / law.critical_slip * stress.max() - push
    found = sampling_adequacy(REAL)
    assert found.over_box
    exact = growing(slope, REAL.specific_damping)
    assert exact * (1 - 1e-9) <= found.pole <= exact * 1.0005  # the chords of a guarantee, not looser ones
    pole = math.ceil(found.pole * 1e4) / 1e4
    assert f"times the unstable pole, at most {pole:g} 1/s over" in sampling_sentence(found)
    assert found.adequate
    assert "T_s = 0.184 s is adequate: " in sampling_sentence(found)
    assert "guarantee" not in sampling_sentence(found)


def test_the_fault_that_is_sampled_too_slowly_is_told_which_step_would_do():
    """Its nominal pole is 13.15 1/s at rest; the box is wider."""
    found = sampling_adequacy(UNDERSAMPLED)
    nominal = growing(0.15 / 0.005 * 25e6 * UNDERSAMPLED.authority - UNDERSAMPLED.specific_stiffness, 1e13 / 8.775e12)
    assert nominal == pytest.approx(13.15, abs=0.005)
    assert nominal < found.pole < 1.3 * nominal
    assert found.pole_times_step == found.pole * 0.1 > 1
    assert not found.adequate
    assert "is TOO LONG by" in sampling_sentence(found)
    assert sampling_sentence(found).endswith("; the command guarantee may still find a proof at this T_s")
    finer = sampling_adequacy(replace(UNDERSAMPLED, sampling_time=found.adequate_step * 0.999))
    assert finer.adequate
    assert not sampling_adequacy(replace(UNDERSAMPLED, sampling_time=found.adequate_step * 1.001)).adequate


def test_a_fault_that_does_not_run_away_bears_any_step():
    stable = replace(REAL, friction=replace(REAL.friction, drop=0.0), disturbance=Disturbance())
    found = sampling_adequacy(stable)
    assert (found.pole, found.pole_times_step, found.adequate, found.adequate_step) == (0.0, 0.0, True, None)


def test_a_pair_that_swings_counts_by_its_modulus():
    """Friction that weakens with the slip rate only: λ² + wλ + k̂ with w < 0, |λ|² = k̂."""
    law = friction_law("slip-rate-weakening")(residual=0.2, drop=0.2, critical_rate=1e-3)
    found = sampling_adequacy(replace(REAL, friction=law, damping=1e10, disturbance=Disturbance()))
    assert found.over_box
    assert found.pole >= REAL.natural_frequency


@pytest.mark.parametrize("width", [None, 5e3])
def test_friction_with_a_state_is_judged_in_slow_sliding_along_its_task(width):
    """λ² + (κ − β + 1)ρλ + κρ² with κ = KD/S, β = Nb/S, S = Na + HV and ρ = V/D, at the rate V of the task."""
    fault = replace(load_fault("crustal-patch"), width=width)
    law, v = fault.friction, 1e-6
    normal, ageing = 50e6, v / law.critical_slip
    strength = normal * law.direct_effect + fault.damping / fault.area * v
    kappa = fault.stiffness / fault.area * law.critical_slip / strength
    beta = normal * law.evolution_effect / strength
    roots = np.roots([1.0, (kappa - beta + 1) * ageing, kappa * ageing**2])
    found = sampling_adequacy(fault)
    assert not found.over_box
    assert found.pole == pytest.approx(max(abs(roots)), rel=1e-9)
    assert min(roots.real) > 0


@few(("factor", "said"), [(0.49, True), (0.51, False), (1.99, False), (2.1, True)], every=2)
def test_a_state_asks_for_a_sampling_time_of_its_own_when_that_of_the_fault_is_far_off(factor, said):
    """A twentieth of D_c/V, where what a run-away allows is much longer."""
    patch = load_fault("crustal-patch")
    step = patch.friction.critical_slip * patch.reference.operation_time / (20 * patch.reference.target_slip)
    lines = fault_sentences(replace(patch, sampling_time=factor * step))
    assert (f"for a guarantee of slow sliding choose sampling_time near D_c/(20 V) = {step:g} s" in lines) is said


@pytest.mark.slow
def test_each_pole_of_a_fault_with_a_state_is_told_with_the_rate_that_it_is_about():
    said = fault_sentences(load_fault("crustal-patch"))
    (poles,) = (line for line in said if "eigenvalues" in line)
    (sampled,) = (line for line in said if line.startswith("T_s = "))
    assert poles.endswith("1/s about steady sliding at 1e-09 m/s")
    assert sampled.endswith("; the pole is that about steady sliding at 1e-06 m/s")
    assert not any("about steady sliding" in line for line in fault_sentences(load_fault("real-fault")))
