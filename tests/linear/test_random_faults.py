"""Designs for random faults: five decades of length, stable and unstable, three friction laws, uncertain parameters."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest
from own.printed_theorem import inverse_optimality

import quakedesign as qd
from quakedesign.errors import ParameterError
from quakedesign.fault import Disturbance, Reference, UncertaintyBox, friction_law
from quakedesign.linear.linear_problem import LinearProblem
from quakedesign.linear.riccati import riccati_design
from quakedesign.lyapunov import Verdict

BASE = qd.load_fault("real-fault")
LAWS = ("exponential-slip-weakening", "linear-slip-weakening", "slip-rate-weakening")


def random_fault(rng):
    """A fault from a wide box; weakening from a tenth to fifty times the spring, damping ratio 0.01 to 5."""
    length, density = 10 ** rng.uniform(-1, 4), rng.uniform(1000, 3500)
    modulus, stress = 10 ** rng.uniform(5, 10.8), 10 ** rng.uniform(4.5, 8.5)
    pace = np.sqrt(modulus / density) / length
    residual, drop = rng.uniform(0.05, 0.8), rng.uniform(0.001, 0.5)
    slip = stress * drop * length / modulus / 10 ** rng.uniform(-1, 1.7)
    name = str(rng.choice(LAWS, p=[0.6, 0.2, 0.2]))
    scale = {"critical_rate": slip * pace} if name == "slip-rate-weakening" else {"critical_slip": slip}
    widths = {k: F(int(rng.integers(0, 21)), 100) for k in ("stiffness", "damping", "authority")}
    return replace(
        BASE,
        name="random",
        density=density,
        shear_modulus=modulus,
        length=length,
        damping=2 * 10 ** rng.uniform(-2, 0.7) * pace * density * length**3,
        effective_normal_stress=stress,
        friction=friction_law(name)(residual=residual, drop=drop, **scale),
        reference=Reference(
            target_slip=slip * 10 ** rng.uniform(-0.5, 0.7), operation_time=10 ** rng.uniform(3, 6) / pace
        ),
        sampling_time=10 ** rng.uniform(-2, -0.3) / pace,
        disturbance=Disturbance(
            amplitude=1e-3 * slip * pace**2,
            frequency=pace,
            slip_growth=rng.uniform(-0.05, 0.05) * pace**2,
            rate_growth=rng.uniform(-0.05, 0.05) * pace,
        ),
        box=UncertaintyBox(name="own", **widths),
    )


def judged(seed, count):
    """Number proved, of unstable plants, and the reasons for the rest."""
    rng, proved, unstable, reasons = np.random.default_rng(seed), 0, 0, []
    for _ in range(count):
        fault = random_fault(rng)
        problem = LinearProblem.of(fault)
        unstable += problem.sectors.slip[1] > 0 or problem.sectors.rate[0] < 0
        try:
            design = qd.design(fault, "elqr", continuous=True)
        except ParameterError as error:
            reasons.append(str(error))
            continue
        if design.verdict is Verdict.PROVED:
            proved += 1
            assert {p.name: p for p in design.premises}["friction_slope"].holds
        else:
            reasons.append(design.details.get("reason", ""))
    return proved, unstable, reasons


@pytest.mark.slow
def test_twelve_random_faults_are_designed_with_a_proof():
    proved, unstable, reasons = judged(2025, 12)
    assert proved >= 11
    assert 0 < unstable < 12
    assert all(reasons)


@pytest.mark.slow
def test_the_riccati_designs_of_random_faults_are_recognised_as_optimal():
    rng = np.random.default_rng(77)
    for _ in range(6):
        fault = random_fault(rng)
        gains = tuple(riccati_design(fault).controller.gains.values())
        assert inverse_optimality(LinearProblem.of(fault), gains).verdict is Verdict.PROVED


@pytest.mark.slow
def test_two_hundred_random_faults_are_designed_with_a_proof():
    proved, unstable, reasons = judged(2024, 200)
    assert proved >= 190
    assert 40 < unstable < 180
    assert all(reasons)
