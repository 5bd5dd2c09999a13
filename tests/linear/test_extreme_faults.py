"""Faults far from any that exist: proved where the theory proves, or refused with a reason."""

import json
from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest
from thinned import few

import quakedesign as qd
from quakedesign.laws.elqr import ExtendedLQR
from quakedesign.linear.linear_problem import LinearProblem, diagonal
from quakedesign.linear.riccati import riccati_design
from quakedesign.linear.robust_stability import finished_exactly, robust_stability, sector_loop
from quakedesign.linear.verdict import judge
from quakedesign.lyapunov import Verdict
from quakedesign.sos.exact import work_budget as work

REAL = qd.load_fault("real-fault")


def variants():
    friction = REAL.friction
    return {
        "hardly damped": replace(REAL, damping=1e-12),
        "overdamped": replace(REAL, damping=REAL.damping * 1e6),
        "sampled fast": replace(REAL, sampling_time=1e-9),
        "stress of 1e12 Pa": replace(REAL, effective_normal_stress=1e12),
        "residual of 1e-6": replace(REAL, friction=replace(friction, residual=1e-6)),
    }


@few("name", list(variants()), every=3)
def test_the_riccati_design_is_proved(name):
    # the theorem proves every Riccati design with the sound bound: only rounding can stand in the way
    fault = variants()[name]
    design = qd.design(fault, "elqr", continuous=True)
    assert design.verdict is Verdict.PROVED
    assert design.certificate.check() is Verdict.PROVED
    problem, rng = LinearProblem.of(fault), np.random.default_rng(3)
    gains = tuple(design.gains.values())
    units = np.array([1.0, fault.sampling_time**-1, fault.sampling_time, fault.sampling_time**2])
    for _ in range(50):
        ranges = (problem.sectors.beta, problem.sectors.slip, problem.sectors.rate)
        point = tuple(F(rng.uniform(float(a), float(b))) for a, b in ranges)
        loop = np.array([[float(v) for v in row] for row in problem.loop(point, gains)])
        poles = np.linalg.eigvals(loop * units[None, :] / units[:, None])
        assert poles.real.max() < 1e-9 * np.abs(poles).max()


def test_the_fastest_certificate_is_no_slower_than_the_one_with_the_largest_margin():
    fault = variants()["overdamped"]
    loop = sector_loop(riccati_design(fault).controller, LinearProblem.of(fault).sectors)
    assert robust_stability(loop, fastest=True).claims["rate"] >= robust_stability(loop).claims["rate"]


def test_a_form_that_does_not_decrease_is_no_certificate(monkeypatch):
    loop = sector_loop(riccati_design(REAL).controller, LinearProblem.of(REAL).sectors)
    assert finished_exactly(loop, diagonal((F(1),) * 4)) is None
    monkeypatch.setattr(work, "STEPS", 0)  # or that takes too long to check
    assert finished_exactly(loop, diagonal((F(1),) * 4)) is None


def test_time_scales_out_of_reach_are_undecided_with_a_reason():
    design = qd.design(replace(REAL, length=1e-6), "elqr", continuous=True)
    assert design.verdict is Verdict.UNDECIDED
    assert "Riccati equation" in design.details["reason"]


@pytest.mark.parametrize("gains", [("0", "0", "0", "0"), ("1.88e9", "5.79e8", "1.02e6", "0"), ("0", "0", "0", "1")])
def test_gains_that_are_zero_are_refuted_without_a_warning(gains):
    judged = judge(REAL, ExtendedLQR.from_values(gains)).to_dict()
    assert judged["verdict"] == "refuted"
    assert judged["held"]["verdict"] == "refuted"
    json.dumps(judged, allow_nan=False)
