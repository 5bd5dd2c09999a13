"""The energy budget against closed forms; and that it closes with the order of the integrator."""

import dataclasses
import json
import math

import numpy as np
import pytest
import sympy as sp

from quakedesign.fault import Disturbance, load_fault
from quakedesign.laws import published
from quakedesign.simulation import natural_earthquake, simulate
from quakedesign.simulation.closed_loop import EnergyBudget, Load, Variation

REAL = load_fault("real-fault")
BLOCK = dataclasses.replace(REAL, damping=0.0, friction=dataclasses.replace(REAL.friction, drop=0.0))
STRENGTH = BLOCK.friction.residual * BLOCK.authority * BLOCK.effective_normal_stress  # of constant friction [m/s²]
FREQUENCY, MASS, STIFFNESS = BLOCK.natural_frequency, BLOCK.mass, BLOCK.stiffness
FRICTION = BLOCK.friction.residual * BLOCK.area * BLOCK.effective_normal_stress  # [N]


def pushed(fault, **load):
    return fault.with_disturbance(Disturbance(**load))


@pytest.mark.parametrize("method", ["dormand-prince", "cvodes"])
def test_a_free_oscillation_only_trades_energy(method):
    """Constant friction that is linear in the smooth plant: x1 = X(1 − cos ωt) under a constant push kX/m."""
    size, time = 0.01, 7.3 / FREQUENCY
    run = simulate(
        pushed(BLOCK, constant=size * FREQUENCY**2),
        step=time / 2000,
        duration=time,
        method=method,
        rtol=1e-12,
        plant="printed",
    )
    slip, rate = size * (1 - math.cos(7.3)), size * FREQUENCY * math.sin(7.3)
    found = run.energy
    assert found.kinetic == pytest.approx(MASS * rate**2 / 2, rel=1e-8)
    assert found.elastic == pytest.approx(-FRICTION * slip + STIFFNESS * slip**2 / 2, rel=1e-8)
    assert found.frictional == pytest.approx(FRICTION * slip, rel=1e-8)
    assert found.disturbance == pytest.approx(STIFFNESS * size * slip, rel=1e-8)
    assert found.viscous == found.injection == found.far_field == 0
    assert found.relative_residual < 1e-9


def test_a_block_that_slides_and_rests_has_turned_all_into_heat_of_its_path():
    """A push of 9.3 μN moves it by twice 9.3 μN/k within half a period; at rest nothing moves."""
    half = math.pi / FREQUENCY
    run = simulate(
        pushed(BLOCK, constant=9.3 * STRENGTH), step=half / 160.4, duration=2 * half, samples=10, plant="stick-slip"
    )
    unit = FRICTION / STIFFNESS
    assert run.energy.frictional == pytest.approx(FRICTION * 18.6 * unit, rel=1e-9)
    assert run.energy.kinetic == 0
    assert run.energy.disturbance == pytest.approx(9.3 * FRICTION * 18.6 * unit, rel=1e-9)
    assert run.energy.relative_residual < 1e-9


def test_a_dashpot_takes_what_a_closed_form_says():
    """Critically or more damped, under a constant push: x2 = (a/q) e^(−dt) sinh(qt), ∫x2² by SymPy's integral."""
    linear = dataclasses.replace(REAL, friction=dataclasses.replace(REAL.friction, drop=0.0))
    time = 8.0
    run = simulate(pushed(linear, constant=1e-3), step=0.01, duration=time)
    d = REAL.specific_damping / 2
    q = math.sqrt(d**2 - REAL.natural_frequency**2)
    t = sp.Symbol("t", positive=True)
    squared = (sp.Float(1e-3, 30) / sp.Float(q, 30)) ** 2 * (sp.exp(-2 * d * t) * sp.sinh(q * t) ** 2).rewrite(sp.exp)
    dissipated = float(sp.Integral(squared, (t, 0, run.time[-1])).evalf(15)) * linear.damping
    assert run.energy.viscous == pytest.approx(dissipated, rel=1e-7)


def test_a_held_pressure_relieves_friction_of_its_share():
    """Constant friction under p: ∫μAp dx1 = μApx1, which the push of the pressure gives to the spring."""
    from quakedesign.loop import simulation_scheme
    from quakedesign.simulation import integrator
    from quakedesign.simulation.recorder import Recorder
    from quakedesign.simulation.run_settings import RunSetting as Setting
    from quakedesign.simulation.run_settings import loop_class, run
    from quakedesign.simulation.trajectory import OutcomeCriterion

    pressure, half = 2e6, math.pi / FREQUENCY
    setting = Setting.of(BLOCK, half / 400, half, 10, 0.0)
    loop = loop_class("stick-slip")(pushed(BLOCK), None, pressure)
    recorder = Recorder(loop, simulation_scheme("continuous"), setting.step)
    found = run(recorder, setting, integrator("dormand-prince"), OutcomeCriterion.of(BLOCK, None))
    slip = 2 * BLOCK.friction.residual * BLOCK.area * pressure / STIFFNESS
    relieved = BLOCK.friction.residual * BLOCK.area * pressure * slip
    assert found.slip[-1] == pytest.approx(slip, rel=1e-9)
    assert found.energy.injection == pytest.approx(relieved, rel=1e-9)
    assert found.energy.frictional == pytest.approx(FRICTION * slip - relieved, rel=1e-9)
    assert found.energy.relative_residual < 1e-12


def test_the_far_field_pays_for_what_it_pulls():
    """Steady sliding at v_∞ behind a drifting spring: all work is friction and nothing is stored beyond the start."""
    drift, time = 1e-3, 120.0
    light = dataclasses.replace(REAL, friction=dataclasses.replace(REAL.friction, drop=0.0))
    run = simulate(pushed(light), step=0.01, duration=time, load=Load(drift=drift), variation=Variation(), samples=10)
    assert run.slip_rate[-1] == pytest.approx(drift, rel=1e-9)
    assert run.energy.relative_residual < 1e-11
    # The dashpot joins block and far end, so that it carries nothing once they move together; it has seen the start.
    tension = FRICTION - light.damping * drift
    lag = light.damping * drift / light.stiffness  # of the block behind the far end once all is steady
    stretched = tension * lag + light.stiffness * lag**2 / 2
    assert drift * run.time[-1] - run.slip[-1] == pytest.approx(lag, rel=1e-9)
    assert run.energy.elastic == pytest.approx(stretched, rel=1e-9)
    assert run.energy.far_field == pytest.approx(FRICTION * drift * run.time[-1], rel=1e-2)


@pytest.mark.parametrize("plant", ["printed", "stick-slip"])
def test_it_closes_with_the_order_of_the_integrator(plant):
    pace = 1 / REAL.natural_frequency
    residuals = [
        simulate(
            pushed(REAL, constant=1e-3, amplitude=1e-3, frequency=0.3),
            step=share * pace,
            duration=12.3,
            plant=plant,
        ).energy.relative_residual
        for share in (0.1, 0.05, 0.025)
    ]
    assert residuals[0] > 16 * residuals[1]
    assert residuals[2] < 1e-8


def test_an_earthquake_closes_and_says_what_became_of_the_elastic_energy():
    run = natural_earthquake(REAL)
    assert run.energy.relative_residual < 1e-11
    assert run.energy.elastic < 0 < run.energy.frictional < -run.energy.elastic
    assert run.energy.frictional + run.energy.viscous == pytest.approx(-run.energy.elastic, rel=1e-9)
    assert json.loads(run.to_xarray().attrs["energy"])["viscous"] == run.energy.viscous


def test_a_smooth_controlled_run_closes_and_a_chattering_one_tells_on_itself():
    """At 184 ms the 2-CTA moves back and forth within single steps, so that no sum over them gives its work."""
    linear, sliding = (simulate(REAL, published("real-fault")[law], duration=500.0) for law in ("elqr", "cta"))
    assert linear.energy.relative_residual < 1e-4
    assert sliding.energy.relative_residual > 0.1
    finer = simulate(REAL, published("real-fault")["elqr"], step=0.0184, duration=500.0)
    assert finer.energy.relative_residual < 1e-4 * linear.energy.relative_residual


def test_a_budget_counts_its_own_residual():
    parts = {"kinetic": 1.0, "elastic": -5.0, "frictional": 3.0, "viscous": 1.5, "far_field": 0.25, "disturbance": 0.5}
    found = EnergyBudget(injection=7.0, **parts)
    assert found.residual == -0.25
    assert found.relative_residual == 0.25 / 7
    assert EnergyBudget.unit("viscous") == "J"
    assert EnergyBudget(injection=0.0, **dict.fromkeys(parts, 0.0)).relative_residual == 0
    assert np.isfinite(list(found.to_dict().values())).all()
