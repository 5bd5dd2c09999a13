"""Friction that heals at rest: closed forms of the release, files, and what is proved."""

import dataclasses
import math
from fractions import Fraction as F

import casadi as ca
import numpy as np
import pytest

import quakedesign as qd
from quakedesign.errors import ParameterError
from quakedesign.fault import Disturbance, fault_toml, load_fault
from quakedesign.simulation import Load, natural_earthquake, simulate
from quakedesign.simulation.stick_slip_plant import StickSlipLoop

REAL = load_fault("real-fault")
CONSTANT = dataclasses.replace(REAL, damping=0.0, friction=dataclasses.replace(REAL.friction, drop=0.0))
HELD = 1e-3  # m/s², by which healing holds the block
SLOW = 0.2  # rad/s, of the push


def healing(fault, excess):
    return dataclasses.replace(fault, friction=dataclasses.replace(fault.friction, healing=excess))


def pushed(size):
    """A block that heals, under a sine."""
    per_excess = CONSTANT.authority * CONSTANT.effective_normal_stress
    block = healing(CONSTANT, HELD / per_excess)
    return block.with_disturbance(Disturbance(amplitude=size, frequency=SLOW))


def test_a_block_is_held_until_the_push_exceeds_what_healing_adds():
    run = simulate(pushed(0.999 * HELD), step=1e-2, duration=10.0, samples=1000)
    assert np.all(run.slip == 0)
    assert run.metrics.time_at_rest_fraction == 1


def test_a_release_loses_what_held_the_block():
    """x'' = −ω²x + a·sin(ft) from the release on, at rest at first: a particular and a free solution.

    Right after the release the acceleration is that by which healing held the block.
    """
    size, omega = 2 * HELD, CONSTANT.natural_frequency
    run = simulate(pushed(size), step=1e-3, duration=4.5, samples=4500)
    start = math.asin(0.5) / SLOW
    particular = size / (omega**2 - SLOW**2)
    t = run.time - start
    sine, cosine = -particular * math.sin(SLOW * start), -particular * SLOW * math.cos(SLOW * start) / omega
    free = particular * np.sin(SLOW * run.time) + sine * np.cos(omega * t) + cosine * np.sin(omega * t)
    expected = np.where(t > 0, free, 0.0)
    assert np.all(run.slip[t < -1e-3] == 0)
    assert run.slip == pytest.approx(expected, abs=1e-6 * expected.max())
    early = (t > 0.01) & (t < 0.05)
    assert run.slip[early] == pytest.approx(HELD * t[early] ** 2 / 2, rel=2e-2)


def test_a_driven_block_slips_in_events_of_one_size():
    """With u = vt − x, ω²u grows to Δ at rest; then u'' = −ω²u until u' = v, where u = −Δ/ω²: 2Δ/ω² + vτ an event."""
    rate, omega = 1e-4, CONSTANT.natural_frequency
    block = pushed(0.0).with_disturbance(Disturbance())
    reload = 2 * HELD / (omega**2 * rate)
    tau = 2 * (math.pi - math.atan(HELD / (omega * rate))) / omega
    run = simulate(block, step=5e-3, duration=3.2 * reload, samples=20_000, load=Load(drift=rate))
    event = 2 * HELD / omega**2 + rate * tau
    rests = np.unique(run.slip[(run.slip_rate == 0)].round(9))
    assert rests == pytest.approx(event * np.arange(len(rests)), rel=1e-5)
    assert len(rests) >= 3
    releases = run.time[1:][(run.slip_rate[1:] > 0) & (run.slip_rate[:-1] == 0)]
    assert releases[:2] == pytest.approx([reload / 2, reload / 2 + tau + reload], rel=1e-3)


SHARE = 0.25  # of the strength in slip, that healing adds


def resting(push):
    """A block at rest with a load of 1 + push strengths of its friction in slip."""
    unit = CONSTANT.friction.residual * CONSTANT.authority * CONSTANT.effective_normal_stress
    block = healing(CONSTANT, SHARE * CONSTANT.friction.residual)
    return StickSlipLoop(block.with_disturbance(Disturbance(constant=push * unit))), unit


@pytest.mark.parametrize(
    ("push", "pressure", "rate", "stress"),
    [
        (-0.5, 0.0, 0.0, 0.5),
        (0.1, 0.0, 0.0, 1.1),
        (0.5, 0.0, 0.0, 1 + SHARE),
        (-0.5, 0.2, 0.0, 0.5),
        (0.5, 0.2, 0.0, 0.8 * (1 + SHARE)),
        (0.5, 0.0, 1e-9, 1.0),
    ],
)
def test_at_rest_the_shear_stress_is_the_load_up_to_the_strength_with_healing(push, pressure, rate, stress):
    """In units of the strength in slip without pressure; a fault that slides has lost its healing."""
    loop, _ = resting(push)
    sigma, friction = CONSTANT.effective_normal_stress, CONSTANT.friction.residual
    found = loop.shear_stress(0.0, ca.DM([0.0, rate]), pressure * sigma, friction)
    assert float(found) / (friction * sigma) == pytest.approx(stress, rel=1e-9)


@pytest.mark.parametrize("pressure", [0.0, 0.2])
def test_the_loads_between_which_it_rests_are_twice_the_strength_with_healing_apart(pressure):
    loop, unit = resting(0.1)
    forward, backward = loop.resting_load(0.0, ca.DM(0.0), pressure * CONSTANT.effective_normal_stress)
    strength = (1 - pressure) * (1 + SHARE)
    assert float(forward) / unit == pytest.approx(1.1 - strength, rel=1e-9)
    assert float(backward) / unit == pytest.approx(1.1 + strength, rel=1e-9)


@pytest.mark.parametrize(("push", "reverses"), [(-2.1, False), (-2.3, True)])
def test_healing_holds_the_block_backward_too(push, reverses):
    """A load of -1.1 and of -1.3 strengths, against 1.25 of them."""
    loop, _ = resting(push)
    assert bool(float(loop.reversing(0.0, ca.DM([0.0, 0.0]), 0.0))) == reverses
    assert not float(loop.reversing(0.0, ca.DM([0.0, 1e-9]), 0.0))


def test_a_natural_earthquake_begins_as_it_is_released():
    healed = natural_earthquake(healing(REAL, 1e-4))
    assert healed.metrics.peak_slip_rate == pytest.approx(natural_earthquake(REAL).metrics.peak_slip_rate, rel=1e-12)


def test_a_fault_file_has_it_in_its_friction(tmp_path):
    path = tmp_path / "fault.toml"
    path.write_text(fault_toml(healing(REAL, 2e-4)), encoding="utf-8")
    assert "healing = 0.0002" in path.read_text()
    assert load_fault(path).friction.healing == 2e-4
    assert "healing" not in fault_toml(REAL)
    with pytest.raises(ParameterError, match="healing"):
        healing(REAL, -1e-4)


@pytest.mark.slow
def test_a_guarantee_counts_healing_beside_the_whole_disturbance():
    """Its task has the disturbance that both are worth: H + N̂Δμ_h(σ' − p) with the least pressure that is claimed."""
    fault = healing(REAL, 2e-5)
    answer = qd.guarantee(fault)
    found, plain = answer.proof, qd.guarantee(REAL).proof
    assert found.healing == F(2, 10**5)
    worth = F(1, 2500 * 5000) * found.healing * (50_000_000 - F(found.claims.least_pressure))
    assert plain.task.amplitude + worth <= found.task.amplitude <= plain.task.amplitude + F(11, 10) * worth
    assert plain.claims.peak_slip_rate < found.claims.peak_slip_rate < F(3, 2) * plain.claims.peak_slip_rate
    assert str(found.check()) == "proved"
    assert "and friction at rest up to 2e-05 above friction in slip" in found.sentence()
    too_much = dataclasses.replace(found, healing=F(1, 1000))
    assert str(too_much.check()) == "undecided"
    run = simulate(fault, found.controller, duration=2000.0)
    assert run.metrics.peak_slip_rate < float(found.claims.peak_slip_rate)


@pytest.mark.slow
def test_a_guarantee_on_the_plant_without_stick_says_that_healing_is_not_covered():
    lines = qd.guarantee(healing(REAL, 1e-4), plant="printed").lines()
    assert any(line.startswith("not covered: friction at rest up to 0.0001 above") for line in lines)
