"""Drift of the far end and a user's perturbation, against closed forms and against the fault's own disturbance."""

import dataclasses
import math
import pickle

import numpy as np
import pytest
import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.fault import Disturbance, load_fault
from quakedesign.laws import published
from quakedesign.simulation import simulate
from quakedesign.simulation.closed_loop import Load

REAL = load_fault("real-fault")
QUIET = REAL.with_disturbance(Disturbance())
slip, slip_rate, time = sp.symbols("slip slip_rate time")


def test_a_drifting_far_end_pulls_a_linear_fault_along():
    """x1'' + 2d x1' + ω²x1 = ω²v_∞t from rest: v_∞(t − 2d/ω² + e^(−dt)(…)), by SymPy's own solver."""
    linear = dataclasses.replace(QUIET, friction=dataclasses.replace(REAL.friction, drop=0.0))
    drift = 3e-8
    run = simulate(linear, step=0.01, duration=12.0, samples=24, load=Load(drift=drift))
    t, x = sp.Symbol("t", positive=True), sp.Function("x")
    d, w2 = sp.Rational(str(REAL.specific_damping)), sp.Rational(str(REAL.specific_stiffness))
    solved = sp.dsolve(
        x(t).diff(t, 2) + d * x(t).diff(t) + w2 * x(t) - w2 * t, x(t), ics={x(0): 0, x(t).diff(t).subs(t, 0): 0}
    ).rhs
    expected = [drift * float(sp.re(solved.subs(t, sp.Rational(str(now))).evalf(30))) for now in run.time]
    assert np.allclose(run.slip, expected, rtol=1e-8, atol=1e-20)
    assert run.provenance["drift"] == drift


def test_the_pushes_of_drift_and_law_meet_in_h():
    """ERRATA 24: the residual of the shifted system is k̂v_∞t, so β·h grows by it."""
    drift, instants = 1e-6, 10
    controller = published("real-fault")["elqr"]
    runs = [simulate(QUIET, controller, duration=60.0, samples=instants, load=Load(drift=v)) for v in (0.0, drift)]
    moved = runs[1]
    from quakedesign.simulation.closed_loop import ClosedLoop

    loop = ClosedLoop(QUIET, controller)
    for i in range(1, len(moved.time)):
        reference = loop.reference(moved.time[i])
        h, mu = (float(v) for v in loop.perturbation(moved.time[i], [moved.slip[i], moved.slip_rate[i]], reference))
        beta = mu * REAL.authority / float(loop.divisor)
        growth = beta * (moved.matched_perturbation[i] - h)
        assert growth == pytest.approx(REAL.specific_stiffness * drift * moved.time[i], rel=1e-7)


def test_a_perturbation_may_repeat_the_faults_own_disturbance():
    own = simulate(REAL, published("real-fault")["elqr"], duration=100.0, samples=50)
    same = Load(perturbation=sp.Float(3.2e-4) * sp.sin(sp.Float(0.69) * time) + sp.Float(3.2e-6) * slip)
    other = simulate(QUIET, published("real-fault")["elqr"], duration=100.0, samples=50, load=same)
    assert np.allclose(own.slip, other.slip, rtol=1e-9, atol=1e-9 * np.max(np.abs(own.slip)))
    assert other.energy.disturbance == pytest.approx(own.energy.disturbance, rel=1e-6)


def test_a_perturbation_of_the_slip_rate_damps():
    """φ̂_e = −c·x2 is a dashpot: the same motion as with η̂ + c."""
    extra = 0.25 * REAL.specific_damping
    stiffer = dataclasses.replace(REAL, damping=1.25 * REAL.damping)
    run = simulate(REAL, step=0.02, duration=30.0, load=Load(perturbation=-sp.Float(extra) * slip_rate))
    assert np.allclose(run.slip, simulate(stiffer, step=0.02, duration=30.0).slip, rtol=1e-9, atol=1e-18)


def test_the_reference_rests_after_the_operation_whatever_pulls():
    brief = dataclasses.replace(
        QUIET, reference=dataclasses.replace(REAL.reference, target_slip=1e-3, operation_time=200.0)
    )
    run = simulate(brief, published("real-fault")["elqr"], duration=300.0, samples=300, load=Load(drift=1e-9))
    after = run.time > 200.0
    assert np.allclose(run.reference[after], 1e-3, rtol=1e-14, atol=0)
    assert np.all(run.reference_rate[after] == 0)


def test_a_load_travels_between_processes():
    load = Load(drift=1e-9, perturbation=sp.exp(-time) * slip)
    assert pickle.loads(pickle.dumps(load)) == load
    assert load.acceleration.free_symbols


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ({"drift": -1e-9}, "drift must be zero or positive"),
        ({"drift": math.nan}, "drift"),
        ({"perturbation": sp.Symbol("pressure")}, "slip, slip_rate, time"),
        ({"perturbation": "__import__('os')"}, "perturbation of Load must be an Expr or None"),
        ({"perturbation": [1, 2]}, "perturbation of Load must be an Expr or None"),
    ],
)
def test_a_meaningless_load_is_refused(entries, said):
    with pytest.raises(ParameterError, match=said):
        Load(**entries)
