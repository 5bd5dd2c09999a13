"""Held rate-and-state faults: the loop between samples against equations that are typed in again."""

import dataclasses
import math
from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.special import lambertw

from quakedesign.errors import ParameterError
from quakedesign.fault import Reference, load_fault
from quakedesign.fault.friction import friction_law
from quakedesign.loop import LinearLaw, sliding_loop
from quakedesign.simulation.slow_sliding import Tide, _Loop, simulate_sliding
from quakedesign.symbolic import derive
from quakedesign.synthesis.linear.plant.sliding_model import growth_rate, sliding_model
from quakedesign.synthesis.linear.sampled.slow_sliding import sliding_law

A, B, D, V, MU, NORMAL = 0.010, 0.015, 1e-3, 1.2e-6, 0.6, 50e6
STIFFNESS, DAMPING = 30e9 / 5e3, 5e14 / 25e6
STEP, PATH = Fraction(40), Fraction(833)


def fault(name="rate-and-state-aging", rate=V, **changes):
    parameters = {
        "reference_coefficient": MU,
        "direct_effect": A,
        "evolution_effect": B,
        "critical_slip": D,
        "reference_rate": V,
        "slowest_rate": 1e-14,
        "fastest_rate": 10.0,
    }
    task = Reference(target_slip=rate * 5e5, operation_time=5e5)
    given = {"friction": friction_law(name)(**(parameters | changes)), "reference": task, "sampling_time": 40.0}
    return dataclasses.replace(load_fault("real-fault"), **given)


def test_the_instability_is_that_of_the_linearised_fault():
    (fastest, *_) = sorted((z.real for z in derive(fault()).eigenvalues), reverse=True)
    assert growth_rate(sliding_model(fault())) == pytest.approx(fastest, rel=1e-4)
    kappa = STIFFNESS * D / NORMAL
    assert growth_rate(sliding_model(fault())) == pytest.approx((B - A - kappa) / A * V / D, rel=0.1)


@pytest.mark.parametrize("name", ["rate-and-state-aging", "rate-and-state-slip", "regularised-rate-and-state"])
def test_the_model_has_the_numbers_of_the_fault(name):
    model = sliding_model(fault(name))
    assert float(model.direct) == pytest.approx(A, rel=1e-12)
    assert float(model.evolution) == pytest.approx(B, rel=1e-12)
    assert float(model.state_rate) == pytest.approx(V / D, rel=1e-12)
    assert float(model.strength) == pytest.approx(NORMAL * A + DAMPING * V, rel=1e-12)
    assert float(model.coefficient) == pytest.approx(MU, rel=1e-12)


@pytest.mark.parametrize("path", [Fraction(0), PATH, 4 * PATH])
def test_the_law_makes_the_sampled_loop_stable(path):
    """With twice as many modes of the layer as the law knows."""
    model = sliding_model(fault())
    loop = sliding_loop(sliding_law(model, STEP, diffusion=path), model, STEP, diffusion=path)
    free = sliding_loop(asking_for(0), model, STEP, diffusion=path)
    (held, uncontrolled) = (
        np.max(np.abs(np.linalg.eigvals(expm(np.array(x.flow, float) * 40) @ np.array(x.segments[0].jump, float))))
        for x in (loop, free)
    )
    assert held < 0.998
    assert uncontrolled == pytest.approx(math.exp(40 * growth_rate(model)), rel=1e-9)


def test_the_law_rests_where_it_asks_for_a_constant_pressure():
    """Exactly: z = (0, 0, p …, −μp) is left by an update without errors, and asks for p."""
    model = sliding_model(fault())
    law = sliding_law(model, STEP, diffusion=PATH)
    states = [Fraction(0)] * 2 + [Fraction(1)] * 4 + [-model.coefficient]
    after = [sum((v * s for v, s in zip(row, states, strict=True)), Fraction(0)) for row in law.update]
    assert after == states
    asked = sum((v * s for v, s in zip(law.output, states, strict=True)), Fraction(0))
    assert asked == Fraction(NORMAL)
    assert law.of_slip_alone


def asking_for(pressure):
    """A law that adds up pressure·T_s every sample without looking; 0 for none."""
    zero, one = Fraction(0), Fraction(1)
    own = ((one, zero), (zero, one)) if not pressure else ((one, Fraction(pressure)), (zero, one))
    return LinearLaw(
        states=("level", "seen"), update=own, measured=((zero, zero), (zero, zero)), output=(one, zero),
        feedback=(zero, zero),
    )  # fmt: skip


def oracle(law, name, tide, count):
    """Slip error and ln(v/V) at every sample: balance of forces by Lambert's function, LSODA between samples."""
    ramp = STIFFNESS * V / MU
    z, held, x, w, found = np.zeros(len(law.output)), 0.0, 0.0, 0.0, []
    update, fed, output = (np.array(part, float) for part in (law.update, law.measured, law.output))

    def rate(t, x, w, held):
        normal = NORMAL - ramp * t - held
        stress = (
            NORMAL * MU
            + DAMPING * V
            + STIFFNESS * (-V * t - x)
            + tide.amplitude * math.sin(2 * math.pi * t / tide.period)
        )
        driving = stress / normal - MU - B * w
        scale = A * normal / DAMPING
        return math.log(scale / V * lambertw(math.exp(driving / A) * V / scale).real)

    def field(t, state, held):
        y = rate(t, *state, held)
        grown = math.exp(-state[1]) - math.exp(y) if name.endswith("aging") else -math.exp(y) * (y + state[1])
        return [V * math.expm1(y), V / D * grown]

    for k in range(count):
        held = float(output @ z) + float(law.feedback[0]) * x
        z = update @ z + fed[:, 0] * x
        part = solve_ivp(
            field, (40.0 * k, 40.0 * (k + 1)), [x, w], method="LSODA", args=(held,), rtol=1e-10, atol=1e-15
        )
        x, w = part.y[:, -1]
        found.append((x, rate(40.0 * (k + 1), x, w, held)))
    return np.array(found).T


@pytest.mark.parametrize("name", ["rate-and-state-aging", "rate-and-state-slip"])
def test_a_held_run_agrees_with_an_independent_integrator(name):
    law, tide = sliding_law(sliding_model(fault(name)), STEP), Tide(amplitude=160e3, period=3000.0)
    run = simulate_sliding(fault(name), law, STEP, tide=tide, duration=3000.0)
    error, log_rate = oracle(law, name, tide, 75)
    assert np.max(np.abs(log_rate)) > 0.02
    assert run.slip_error[4::4] == pytest.approx(error, abs=1e-6 * np.max(np.abs(error)))
    assert np.log(run.slip_rate[4::4] / V) == pytest.approx(log_rate, abs=1e-6)
    assert run.pressure == pytest.approx(STIFFNESS * V / MU * run.time + run.asked, abs=1e-6)


def test_a_step_goes_through_the_layer_as_in_carslaw_and_jaeger():
    """1 − (4/π)Σ(−1)ⁿ/(2n + 1)e^(−((2n + 1)π/2)²t/τ) after a unit step of the well."""
    loop = _Loop.of(fault(), PATH, Tide(), inertia=False)
    for share in (0.05, 0.2, 1.0):
        time = share * float(PATH)
        n = np.arange(200)
        terms = (-1.0) ** n / (2 * n + 1) * np.exp(-(((2 * n + 1) * math.pi / 2) ** 2) * share)
        pressure = loop.pressure(0.0, 1.0, time, np.zeros(24))
        assert pressure == pytest.approx(1 - 4 / math.pi * np.sum(terms), abs=1e-9)


def test_control_holds_what_runs_away_without_it():
    tide, model = Tide(amplitude=1e3, period=4000.0), sliding_model(fault())
    held = simulate_sliding(
        fault(), sliding_law(model, STEP, diffusion=PATH), STEP, diffusion=PATH, tide=tide, duration=15000.0
    )
    free = simulate_sliding(fault(), asking_for(0), STEP, tide=tide, duration=8000.0)
    assert held.outcome.kind == "tracked"
    assert np.max(np.abs(np.log(held.slip_rate / V))) < 0.01
    assert np.max(np.abs(np.log(free.slip_rate / V))) > 0.2


def test_with_inertia_a_held_run_is_the_same_to_a_thousandth():
    tide, law = Tide(amplitude=10e3, period=3000.0), sliding_law(sliding_model(fault()), STEP)
    runs = [simulate_sliding(fault(), law, STEP, tide=tide, duration=1200.0, inertia=x) for x in (True, False)]
    size = np.max(np.abs(runs[1].slip_error))
    assert runs[0].slip_error == pytest.approx(runs[1].slip_error, abs=1e-3 * size)


def test_a_law_that_asks_for_all_of_the_normal_stress_opens_the_fault():
    greedy = dataclasses.replace(asking_for(0), feedback=(Fraction(10) ** 15, Fraction(0)))
    run = simulate_sliding(fault(), greedy, STEP, tide=Tide(amplitude=40e3, period=1000.0), duration=4000.0)
    assert run.outcome.kind == "opened"
    assert run.opened == pytest.approx(run.time[-1], rel=1e-12)


def test_a_run_can_be_handed_on_and_others_are_refused():
    law = sliding_law(sliding_model(fault()), STEP)
    run = simulate_sliding(fault(), law, STEP, duration=80.0)
    assert run.to_xarray()["slip_error"].attrs["units"] == "m"
    assert len(run.time) == 9
    with pytest.raises(ParameterError, match="friction with one state"):
        simulate_sliding(load_fault("real-fault"), law, STEP)
    with pytest.raises(ParameterError, match="method must be one of"):
        simulate_sliding(fault(), law, STEP, method="radau")
    with pytest.raises(ParameterError, match="stress must be zero or positive"):
        Tide(amplitude=-1.0)
