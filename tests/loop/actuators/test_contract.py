"""What every stage must do, and the chain that they form."""

import math

import casadi as ca
import numpy as np
import pytest
from own_parts import Smoothing

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.laws import control_law
from quakedesign.loop import Actuator, Delay, Diffusion, Lag, Quantisation, RateLimit, Saturation, stages
from quakedesign.loop.actuators.base import FlowStage, SampledStage
from quakedesign.simulation import simulate

EXAMPLES = {
    stage.name: stage
    for stage in (
        Delay(samples=3),
        Quantisation(quantum=0.25),
        Saturation(lowest=-2.0, highest=1.5),
        RateLimit(rate=2.0),
        Lag(time_constant=0.5),
        Diffusion(length=2.0, diffusivity=3.0, storage=0.1),
        Smoothing(),  # a user's
    )
}
REAL = load_fault("real-fault")
LAW = control_law("cta").from_values(("7", "5", "2.3", "1.1"), scale="1/1000", divisor="2353/125000000000")


def evaluate(stage, memory, pressure, step=0.1):
    """One call of a stage with floats, through CasADi."""
    x, p = ca.SX.sym("x", len(stage.start)), ca.SX.sym("p")
    if isinstance(stage, SampledStage):
        out, after = stage.apply(stage.numbers, ca.vertsplit(x), p, step)
    else:
        out, after = stage.output(stage.numbers, ca.vertsplit(x), p), stage.rates(stage.numbers, ca.vertsplit(x), p)
    found = ca.Function("stage", [x, p], [ca.SX(out), ca.vertcat(*after)])(memory, pressure)
    return float(found[0]), found[1].full().ravel()


def test_all_stages_are_found_and_have_an_example():
    assert stages() == {name: type(stage) for name, stage in EXAMPLES.items() if name != Smoothing.name}


@pytest.mark.parametrize("name", EXAMPLES)
def test_nothing_asked_for_leaves_a_stage_at_rest(name):
    stage = EXAMPLES[name]
    out, after = evaluate(stage, stage.start, 0.0)
    assert out == 0
    assert not np.any(after)
    assert all(math.isfinite(number) for number in stage.numbers)


@pytest.mark.parametrize("name", EXAMPLES)
def test_a_stage_passes_a_lasting_pressure_on(name):
    """1 is a multiple of the quantum and inside the limits; every stage ends there."""
    stage = EXAMPLES[name]
    if isinstance(stage, SampledStage):
        memory = stage.start
        for _ in range(20):
            out, memory = evaluate(stage, memory, 1.0)
    else:
        assert isinstance(stage, FlowStage)
        out, rates = evaluate(stage, np.ones(len(stage.start)), 1.0)
        assert np.allclose(rates, 0, atol=1e-12)
    assert out == pytest.approx(1.0)


@pytest.mark.parametrize("name", [n for n, s in EXAMPLES.items() if isinstance(s, FlowStage)])
def test_the_fastest_rate_is_the_largest_eigenvalue(name):
    stage = EXAMPLES[name]
    x = ca.SX.sym("x", len(stage.start))
    jacobian = ca.Function("j", [x], [ca.jacobian(ca.vertcat(*stage.rates(stage.numbers, ca.vertsplit(x), 0.0)), x)])
    assert stage.fastest == pytest.approx(max(abs(np.linalg.eigvals(jacobian(0).full()))), rel=1e-9)


def test_sampled_stages_act_in_order_on_one_sample():
    chain = Actuator(stages=(Saturation(lowest=-2.0, highest=1.5), Quantisation(quantum=1.0), Delay(samples=1)))
    held, excess, memory = chain.hold([-2.0, 1.5, 1.0], [ca.DM(7)], ca.DM(9.0), 0.1)
    assert (float(held), float(excess), float(memory[0])) == (7.0, 7.5, 2.0)


def test_flowing_stages_feed_each_other():
    chain = Actuator(stages=(Lag(time_constant=0.5), Lag(time_constant=0.25)))
    rates, pressure, signals = chain.flow([2.0, 4.0], [3.0, 1.0], 5.0)
    assert (rates, pressure, signals) == ([4.0, 8.0], 1.0, {})


def run(actuator, **options):
    return simulate(
        REAL, LAW, actuator=actuator, duration=options.pop("count", 300) * 0.184, samples=10**6, compiled=False,
        scheme=options.pop("scheme", "explicit"), **options,
    )  # fmt: skip


def test_an_empty_chain_changes_nothing():
    bare, empty = run(None), run(Actuator())
    assert np.array_equal(bare.slip, empty.slip)
    assert set(bare.signals()) == set(empty.signals())


def test_the_fault_gets_what_the_stages_leave():
    """Rounded to 10 kPa, cut at ±0.2 MPa, two samples late: what NumPy makes of the law's own pressure."""
    stages_used = (Delay(samples=2), Quantisation(quantum=1e4), Saturation(lowest=-2e5, highest=2e5))
    found = run(Actuator(stages=stages_used), plant="printed")
    nu = -(1e-3 ** (2 / 3)) * 7 * np.cbrt(found.slip_error)
    nu -= np.sqrt(1e-3 * np.abs(found.slip_rate_error)) * 5 * np.sign(found.slip_rate_error)
    asked = np.concatenate([[0, 0], (nu + found.integrals[0])[:-2]]) / float(LAW.divisor)
    expected = np.clip(1e4 * np.floor(asked / 1e4 + 0.5), -2e5, 2e5)
    assert np.array_equal(found.pressure, expected)
    assert np.array_equal(found.signals()["well_pressure"][0], expected)
    assert {0.0, 2e5, -2e5} < set(np.abs(expected) * np.sign(expected))


def test_integral_states_do_not_wind_up_at_a_limit():
    """Where the pump is at its limit the integral state moves toward the inside only."""
    found = run(Actuator(stages=(Saturation(lowest=-1e4, highest=1e4),)), count=400)
    free = run(None, count=400)
    at_limit = np.abs(found.pressure) == 1e4
    moves = np.diff(found.integrals[0])
    nu = -(1e-3 ** (2 / 3)) * 7 * np.cbrt(found.slip_error)
    nu -= np.sqrt(1e-3 * np.abs(found.slip_rate_error)) * 5 * np.sign(found.slip_rate_error)
    excess = (nu + found.integrals[0]) / float(LAW.divisor) - found.pressure
    assert np.count_nonzero(at_limit) > 50
    assert np.all((moves * excess[:-1] <= 0)[at_limit[:-1]])
    assert np.any(np.diff(free.integrals[0])[at_limit[:-1]] != 0)


def test_the_pressure_changes_no_faster_than_the_limit():
    found = run(Actuator(stages=(RateLimit(rate=1e5),)))
    assert np.max(np.abs(np.diff(found.pressure))) <= 1e5 * 0.184 * (1 + 1e-12)


def test_the_lag_follows_its_closed_form_within_every_sample():
    found = run(Actuator(stages=(Lag(time_constant=0.3),)), substeps=2)
    well = found.signals()["well_pressure"][0]
    share = math.exp(-0.184 / 0.3)
    expected = share * found.pressure[:-1] + (1 - share) * well[:-1]
    assert np.allclose(found.pressure[1:], expected, rtol=0, atol=1e-4 * np.max(np.abs(well)))


def test_signals_of_the_actuator_carry_units():
    found = run(Actuator(stages=(Diffusion(length=10.0, diffusivity=90.0, storage=1e-6, cells=2),)), count=10)
    units = {name: unit for name, (_, _, unit) in found.signals().items()}
    assert units | {"well_pressure": "Pa", "injected_volume": "m^3", "flow_rate": "m^3/s"} == units
    assert "injected_volume" in found.to_xarray()
    assert "diffusivity=90.0" in found.provenance["actuator"]


@pytest.mark.parametrize("scheme", ["implicit", "compensated"])
def test_a_coulomb_plant_takes_the_actuator_too(scheme):
    found = run(Actuator(stages=(Lag(time_constant=0.2),)), scheme=scheme, plant="stick-slip", count=60)
    assert np.all(np.isfinite(found.pressure))


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Delay(samples=-1), "whole number"),
        (lambda: Delay(samples=1.0), "whole number"),
        (lambda: Delay(samples=1, part=1.0), "below 1"),
        (lambda: Delay(samples=1, part=-0.1), "below 1"),
        (lambda: Actuator(stages=(Delay(samples=1, part=0.5), Delay(samples=0, part=0.5))), "between samples"),
        (lambda: Quantisation(quantum=0.0), "quantum"),
        (lambda: Saturation(lowest=1.0, highest=2.0), "0 between"),
        (lambda: Saturation(lowest=-math.inf, highest=2.0), "finite"),
        (lambda: RateLimit(rate=-1.0), "rate"),
        (lambda: Lag(time_constant=math.nan), "time_constant"),
        (lambda: Diffusion(length=0.0, diffusivity=1.0, storage=1.0), "length"),
        (lambda: Diffusion(length=1.0, diffusivity=1.0, storage=1.0, cells=0), "cells"),
        (lambda: Actuator(stages=(Lag(time_constant=1.0), Delay(samples=1))), "come first"),
        (lambda: Actuator(stages=("lag",)), "stages of Actuator must be a tuple of a Stage"),
        (lambda: Actuator(stages=(EXAMPLES["diffusion"], EXAMPLES["diffusion"])), "store"),
        (lambda: run(Actuator(stages=(Lag(time_constant=1e-3),))), "substep"),
    ],
)
def test_what_makes_no_sense_is_refused(make, said):
    with pytest.raises(ParameterError, match=said):
        make()
