"""Smooth loops to a tolerance, against scipy's implicit methods; what is not smooth is refused."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from thinned import few

from quakedesign.errors import ParameterError, SimulationError
from quakedesign.fault import Disturbance, friction_law, load_fault
from quakedesign.laws import published
from quakedesign.simulation import simulate, smooth_integration
from quakedesign.simulation.closed_loop import Load, Variation

REAL = load_fault("real-fault")
ADAPTIVE = ("cvodes", "idas")


def field(fault, gains):
    """Eqs. shift and ref and the linear law, typed in again in floats."""
    law, task, load = fault.friction, fault.reference, fault.disturbance
    static = (law.residual + law.drop) * fault.effective_normal_stress

    def rates(t, y):
        stage = min(t / task.operation_time, 1.0)
        reference = task.target_slip * stage**3 * (10 - 15 * stage + 6 * stage**2)
        pressure = -float(np.dot(gains, y))
        coefficient = law.residual + law.drop * math.exp(-max(y[0], 0.0) / law.critical_slip)
        friction = coefficient * (fault.effective_normal_stress - pressure) - static
        shaking = load.constant + load.amplitude * math.sin(load.frequency * t) + load.slip_growth * y[0]
        spring = fault.specific_stiffness * y[0] + fault.specific_damping * y[1]
        return [y[1], shaking - fault.authority * friction - spring, y[0] - reference, y[2]]

    return rates


def oracle(fault, gains, run, method, rtol, start=(0.0, 0.0)):
    scale = np.array([np.max(np.abs(run.slip)), np.max(np.abs(run.slip_rate)), 1e-6, 1e-3])
    options = {"method": method, "rtol": rtol, "atol": scale * rtol * 1e-2, "max_step": 1.0}
    return solve_ivp(field(fault, gains), (0, run.time[-1]), [*start, 0.0, 0.0], t_eval=run.time, **options).y


@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize(
    ("scipy_method", "rtol"), [pytest.param("Radau", 1e-8, marks=pytest.mark.slow), ("LSODA", 1e-10)]
)
def test_the_linear_law_agrees_with_scipy(method, scipy_method, rtol):
    controller = published("real-fault")["elqr"]
    run = simulate(REAL, controller, duration=150.0, samples=50, method=method, rtol=1e-11, plant="printed")
    expected = oracle(REAL, [float(g) for g in controller.gains.values()], run, scipy_method, rtol)
    assert np.max(np.abs(run.slip - expected[0])) < 1e-7 * np.max(np.abs(expected[0]))
    assert np.max(np.abs(run.slip_rate - expected[1])) < 1e-7 * np.max(np.abs(expected[1]))


@pytest.mark.parametrize("method", ADAPTIVE)
@few(("scipy_method", "rtol"), [("Radau", 1e-9), ("LSODA", 1e-10)], every=2)
def test_an_earthquake_agrees_with_scipy(method, scipy_method, rtol):
    """Uncontrolled, from a nudge over the event into rest: four decades of slip."""
    fault = REAL.with_disturbance(Disturbance(constant=1e-5))
    run = simulate(fault, step=0.1, duration=60.0, samples=60, method=method, rtol=1e-11, plant="printed")
    expected = oracle(fault, [0.0] * 4, run, scipy_method, rtol)
    assert run.slip[-1] > 0.7
    assert np.max(np.abs(run.slip - expected[0])) < 1e-7 * run.slip[-1]


@pytest.mark.parametrize(("method", "step"), [("dormand-prince", 0.01), ("cvodes", None)])
def test_a_start_away_from_rest_agrees_with_scipy(method, step):
    controller, start = published("real-fault")["elqr"], (7.5e-3, 2e-3)
    begin = {"initial_slip": start[0], "initial_slip_rate": start[1]}
    run = simulate(
        REAL, controller, duration=60.0, samples=30, method=method, step=step, rtol=1e-11, **begin, plant="printed"
    )
    expected = oracle(REAL, [float(g) for g in controller.gains.values()], run, "LSODA", 1e-10, start)
    assert (run.slip[0], run.slip_rate[0]) == start
    assert np.max(np.abs(run.slip - expected[0])) < 1e-7 * np.max(np.abs(expected[0]))
    assert run.energy.kinetic == pytest.approx(REAL.mass * (expected[1][-1] ** 2 - start[1] ** 2) / 2, rel=1e-6)
    assert run.energy.relative_residual < 1e-7
    assert {name: run.provenance[name] for name in begin} == begin


@pytest.mark.parametrize("wrong", [{"initial_slip": -1e-9}, {"initial_slip_rate": math.inf}])
def test_a_start_outside_the_model_is_refused(wrong):
    with pytest.raises(ParameterError, match=f"{next(iter(wrong))} must be zero or positive, and finite"):
        simulate(REAL, duration=1.0, **wrong)


@pytest.mark.slow
@pytest.mark.parametrize("method", ADAPTIVE)
def test_the_whole_task_agrees_with_scipy(method):
    controller = published("real-fault")["elqr"]
    run = simulate(
        REAL, controller, step=1.0, duration=20000.0, samples=200, method=method, rtol=1e-11, plant="printed"
    )
    expected = oracle(REAL, [float(g) for g in controller.gains.values()], run, "LSODA", 1e-10)
    assert np.max(np.abs(run.slip - expected[0])) < 1e-7 * np.max(np.abs(expected[0]))
    assert run.energy.relative_residual < 1e-7


@pytest.mark.parametrize("method", ADAPTIVE)
def test_the_run_is_watched_as_one_with_a_fixed_step_is(method, monkeypatch):
    """Pieces of a chunk, metrics, events, works and kept instants; only the numerical error differs."""
    monkeypatch.setattr(smooth_integration, "CHUNK", 100)
    setting = {"step": 0.02, "duration": 8.4, "samples": 7}
    fixed = simulate(REAL, published("real-fault")["elqr"], **setting, plant="printed")
    run = simulate(REAL, published("real-fault")["elqr"], method=method, rtol=1e-11, **setting, plant="printed")
    assert np.array_equal(run.time, fixed.time)
    assert run.events == fixed.events
    expected, found = fixed.metrics.to_dict(), run.metrics.to_dict()
    assert set(expected) == set(found)
    for name in set(expected) - {"seconds"}:
        assert found[name] == (expected[name] and pytest.approx(expected[name], rel=1e-4)), name
    for name in ("frictional", "viscous", "injection", "elastic"):
        assert getattr(run.energy, name) == pytest.approx(getattr(fixed.energy, name), rel=1e-5)
    assert run.provenance["rtol"] == 1e-11


def test_variation_and_load_reach_the_field():
    """Against the same loop with a fixed step."""
    more = {
        "variation": Variation(weakening=0.5),
        "load": Load(drift=1e-6, perturbation=1e-4 * sp.cos(sp.Symbol("time")) - sp.Symbol("slip_rate") / 100),
    }
    setting = {"step": 0.01, "duration": 20.0, "samples": 20, **more}
    fixed, run = (
        simulate(REAL, published("real-fault")["elqr"], method=m, **setting, plant="printed") for m in ("rk4", "cvodes")
    )
    assert np.max(np.abs(run.slip - fixed.slip)) < 1e-6 * np.max(np.abs(fixed.slip))


@pytest.mark.parametrize("method", ADAPTIVE)
def test_a_law_that_jumps_is_refused(method):
    for law in ("cta", "dia"):
        with pytest.raises(ParameterError, match=rf"method {method} .*discontinuous law {law}.*dormand-prince"):
            simulate(REAL, published("real-fault")[law], duration=10.0, method=method, plant="printed")
    with pytest.raises(ParameterError, match=r"plant stick-slip.*set-valued"):
        simulate(REAL, duration=10.0, method=method, plant="stick-slip")
    with pytest.raises(ParameterError, match=r"checkpoint needs a fixed step"):
        simulate(REAL, duration=10.0, method=method, checkpoint="any", plant="printed")


def test_a_sampled_law_is_refused():
    with pytest.raises(ParameterError, match=r"scheme explicit, with zero-order hold"):
        simulate(
            REAL, published("real-fault")["elqr"], duration=10.0, method="cvodes", scheme="explicit", plant="printed"
        )


@few("method", ADAPTIVE, every=2)
def test_a_diverging_loop_says_when_as_with_a_fixed_step(method, capfd):
    good = published("real-fault")["elqr"]
    bad = dataclasses.replace(good, gains={name: -value for name, value in good.gains.items()})
    fixed = simulate(REAL, bad, duration=4000.0, plant="printed")
    run = simulate(REAL, bad, duration=4000.0, method=method, plant="printed")
    assert run.events["opening"] == pytest.approx(fixed.events["opening"], abs=0.4)
    assert run.events["diverged"] == pytest.approx(fixed.events["diverged"], abs=0.4)
    assert run.metrics.peak_slip_rate is None
    assert run.energy is None
    assert np.all(np.isfinite(run.slip))


def test_a_solver_that_stops_without_divergence_is_an_error(capfd):
    """A perturbation with a pole at t = 3.5 s."""
    pole = 1e-3 / (sp.Symbol("time") - sp.Rational(7, 2)) ** 2
    with pytest.raises(SimulationError, match=r"cvodes stopped at t = .* s"):
        simulate(REAL, step=0.1, duration=10.0, method="cvodes", load=Load(perturbation=pole), plant="printed")


def test_friction_of_the_slip_rate_is_followed_too():
    law = friction_law("slip-rate-weakening")(residual=0.2353, drop=0.1, critical_rate=0.1)
    fault = dataclasses.replace(REAL, friction=law)
    setting = {"step": 0.01, "duration": 20.0, "samples": 20}
    fixed, run = (simulate(fault, method=m, **setting, plant="printed") for m in ("dormand-prince", "idas"))
    assert np.max(np.abs(run.slip - fixed.slip)) < 1e-5 * np.max(np.abs(fixed.slip))


def test_where_the_solver_stops_it_is_tried_over_fewer_steps_and_then_no_longer_over_more(monkeypatch):
    tried = []

    def piece(recorder, method, rtol, count):
        def vectors(vector):
            tried.append(count)
            if count > 1:
                raise smooth_integration.StoppedError("step too small")
            return vector[:, None] + 1

        return vectors

    def parts(vector):
        return SimpleNamespace(counter=vector[0], watched={"diverged": -1.0})

    monkeypatch.setattr(smooth_integration, "_piece", piece)
    recorder, heard = SimpleNamespace(parts=parts, step=1.0), []
    found = smooth_integration.smooth_march(recorder, None, 1e-6, [0.0], [0, 20, 40], heard.append)
    assert found.tolist() == [[0.0, 20.0, 40.0]]
    assert tried == [40, 2] + [1] * 40
    assert heard == [k / 40 for k in range(1, 41)]
