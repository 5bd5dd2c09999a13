"""Coupled blocks beside equations typed anew and SciPy: fields, a cycle, runs under a law, and events."""

from dataclasses import replace
from fractions import Fraction as F
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import quakedesign as qd
from quakedesign.errors import ParameterError
from quakedesign.guarantees.exact.plant_loop import MatrixLaw
from quakedesign.simulation.coupled_sliders import (
    CoupledSliders,
    SlidersRun,
    natural_cycles,
    simulate_sampled_blocks,
)

ALIKE = qd.load_chain(Path(__file__).parents[1] / "data" / "three_sliding_blocks.toml")
LENGTHS, STRESSES, SLIPS = (4000.0, 5000.0, 6000.0), np.array([50e6, 45e6, 55e6]), np.array([8e-3, 8e-3, 12e-3])
CHAIN = replace(
    ALIKE,
    wells=(2000.0, 6500.0, 12_000.0),
    blocks=tuple(
        replace(
            block,
            length=length,
            effective_normal_stress=float(stress),
            friction=replace(block.friction, critical_slip=float(slip)),
        )
        for block, length, stress, slip in zip(ALIKE.blocks, LENGTHS, STRESSES, SLIPS, strict=True)
    ),
)
A, B, V0, MU = 0.010, 0.015, 1e-6, 0.6
G, RHO, LENGTH, DAMPING = 32.04e9, 2670.0, 15e3, 1.0405e15 / 15e3**2


def stiffness(lengths):
    """Of the far end, G/L, and of neighbours: G·L over distance and length, per slip between them."""
    middles = np.cumsum(lengths) - np.array(lengths) / 2
    S = np.diag([G / LENGTH] * 3)
    for i, j in ((0, 1), (1, 2)):
        for a, b in ((i, j), (j, i)):
            pull = G * LENGTH / (middles[j] - middles[i]) / lengths[a]
            S[a, b], S[a, a] = S[a, b] - pull, S[a, a] + pull
    return S


def quasi_dynamic(ln_v, ln_theta, S, stress, slip, far, p=0.0, p_rate=0.0, pushed=0.0, alpha=0.0):
    """(ln v)' and (ln θ)' from the derivative of Nμ + Hv = τ - S(x - far) + s; θ' has −αθN'/(bN) more."""
    v, theta = np.exp(ln_v), np.exp(ln_theta)
    N, mu = stress - p, MU + A * np.log(v / V0) + B * np.log(V0 * theta / slip)
    aged = 1 / theta - v / slip + alpha / B * p_rate / N
    return (pushed - S @ (v - far) + p_rate * mu - N * B * aged) / (N * A + DAMPING * v), aged


def test_the_field_is_that_of_the_equations():
    """With pressures of wells behind a lag, a planned pressure and a stress; without mass and with it."""
    random = np.random.default_rng(1)
    load = np.array([1e-9, 2e6, 3.0])
    blocks = (replace(b, friction=replace(b.friction, stress_sensitivity=0.2)) for b in CHAIN.blocks)
    chain = replace(CHAIN, blocks=tuple(blocks))
    for mass in (0.0, RHO * LENGTH):
        sliders = CoupledSliders.of(chain, lag=800.0, inertia=mass > 0)
        assert sliders.mass == pytest.approx(mass)
        for _ in range(5):
            behind, u = random.normal(size=3), random.normal(size=3) * 1e6
            ln_v, h, s, s_rate = (random.normal(size=3) * size for size in (3.0, 1e5, 1e4, 10.0))
            ln_v, ln_theta = ln_v - 14, random.normal(size=3) + 14
            prestress = random.normal(size=3) * 1e7 if mass else np.empty(0)
            y = np.concatenate([behind, ln_v, ln_theta, h])
            found = np.array(sliders.field(y, np.concatenate([load, prestress, u]), s, s_rate)).ravel()
            S, p, p_rate = stiffness(LENGTHS), 2e6 + h, 3.0 + (u - h) / 800
            first, aged = quasi_dynamic(ln_v, ln_theta, S, STRESSES, SLIPS, 1e-9, p, p_rate, s_rate, 0.2)
            if mass:
                v, theta = np.exp(ln_v), np.exp(ln_theta)
                mu = MU + A * np.log(v / V0) + B * np.log(V0 * theta / SLIPS)
                first = (prestress - S @ behind + s - (STRESSES - p) * mu - DAMPING * v) / (mass * v)
            wanted = np.concatenate([np.exp(ln_v) - 1e-9, first, aged, (u - h) / 800])
            assert found == pytest.approx(wanted, rel=1e-9)


@cache
def cycles_by_hand():
    """LSODA on the equations typed anew: times at which the fastest block passes 10 nm/s, slips there and after it."""
    S, far = stiffness(LENGTHS), 1e-9
    theta = SLIPS / far * (1 + np.arange(1, 4) / 3)

    def rates(_, y):
        first, aged = quasi_dynamic(y[3:6], y[6:], S, STRESSES, SLIPS, far)
        return np.concatenate([np.exp(y[3:6]) - far, first, aged])

    def passing(_, y):
        return y[3:6].max() - np.log(1e-8)

    start, sizes = np.concatenate([np.zeros(3), np.log([far] * 3), np.log(theta)]), np.repeat([8e-3, 1.0], [3, 6])
    run = solve_ivp(rates, (0, 1e10), start, "LSODA", events=passing, rtol=1e-10, atol=1e-10 * sizes)
    assert run.success
    at, values = run.t_events[0], run.y_events[0]
    return at, values[:, :3] + far * at[:, None]


@pytest.mark.slow
def test_cycles_of_blocks_that_differ_are_those_of_another_integrator():
    """A whole cycle and more: recurrence intervals and slips of all blocks in every event."""
    run = natural_cycles(CHAIN, 1e10, loading_rate=1e-9)
    times, slips = cycles_by_hand()
    events = run.events()
    ends = np.array([(event.onset, event.arrest) for event in events[:-1]])
    assert len(times) >= 4  # a passing up and one down for every event
    assert ends.ravel() == pytest.approx(times[: 2 * len(ends)], rel=1e-6)
    assert np.diff(ends[:, 0]) == pytest.approx(np.diff(times[: 2 * len(ends) : 2]), rel=1e-6)
    moved = np.array([event.slip for event in events[:-1]])
    wanted = slips[1 : 2 * len(ends) : 2] - slips[: 2 * len(ends) : 2]
    assert moved.min() > 0.5
    assert moved == pytest.approx(wanted, rel=2e-5)


def test_blocks_that_are_alike_in_all_move_as_one():
    """The cycle of a single block by `simulate_state`, whose stretch and clock are others."""
    from quakedesign.simulation import simulate_state
    from quakedesign.simulation.coupled_sliders import simulate_sliders

    older, duration = 1.5 * 8e6, 5e9
    sliders = CoupledSliders.of(ALIKE)
    start = sliders.start([1e-9] * 3, [older] * 3)
    run = simulate_sliders(sliders, start, duration, loading_rate=1e-9, onset_rate=1e-8, method="dop853")
    one = simulate_state(
        ALIKE.fault, 1e-9, duration=duration, inertia=False, start_rate=1e-9, start_state=(older,), method="dop853"
    )
    (event, *_), spread = run.events(), np.ptp(run.slip, axis=1)
    assert spread.max() < 1e-6
    assert run.onsets == pytest.approx(one.onsets, rel=1e-6)
    assert len(one.event_slips) >= 1
    assert event.slip == pytest.approx([one.event_slips[0]] * 3, rel=1e-4)


def test_events_are_counted_from_the_fastest_block():
    times = np.arange(6.0)
    rates = np.array([[1, 1], [1, 3], [5, 1], [1, 1], [1, 1], [1, 9.0]])
    run = SlidersRun(
        times=times,
        slip=np.cumsum(rates, axis=0),
        slip_rate=rates,
        state=rates,
        pressure=np.empty((6, 0)),
        reference=times,
        onsets=np.array([0.5, 4.125]),
        onset_rate=2.0,
        loading_rate=0.0,
        evaluations=0,
    )
    first, second = run.events(np.array([2e15, 1e15]))
    assert (first.onset, first.arrest) == (0.5, 2.75)
    assert first.slip == pytest.approx([7.75 - 1.5, 5.75 - 2.5])  # by straight lines between the instants
    assert first.peak_slip_rate == (5, 3)
    moment = 2e15 * 6.25 + 1e15 * 3.25
    assert first.magnitude == pytest.approx(2 / 3 * np.log10(moment) - 6.07, abs=1e-3)
    assert (second.arrest, second.slip, second.magnitude) == (None, None, None)


LAW = MatrixLaw(
    step=F(400),
    delay=F(0),
    update=(),
    measured=(),
    output=((),) * 3,
    feedback=tuple(tuple(F(-1000) * (i == j) for j in range(3)) for i in range(3)),
)


@pytest.mark.parametrize("averaged", [False, True])
def test_a_run_under_a_law_is_that_of_radau_on_equations_typed_anew(averaged):
    """p = −1000·error MPa/m behind a lag, planned pressure, a sine on every block; the stress at t = 0 acts at once."""
    chain, law, shares, weights = CHAIN, LAW, np.eye(3), np.eye(3)
    if averaged:
        chain = replace(CHAIN, wells=(4000.0, 12000.0))
        law = replace(LAW, output=((),) * 2, feedback=((F(-1000), F(0)), (F(0), F(-1000))))
        part = (6500 - 4000) / 8000  # of the second well in the middle of block 2
        shares = np.array([[1, 0], [1 - part, part], [0, 1]])
        weights = (shares / shares.sum(axis=0)).T
    V, lag, size, turn, periods = 1e-6, 800.0, 2e4, 2 * np.pi / 3e4, 60
    run = simulate_sampled_blocks(chain, law, lag=lag, stress=size, period=3e4, duration=400.0 * periods)
    S, phases = stiffness(LENGTHS), 2 * np.pi * np.arange(3) / 3
    per_slip = G / LENGTH / MU  # μ* = μ_0 at V = V_0
    ln_theta, x, h, ends = np.log(SLIPS / V), np.zeros(3), np.zeros(len(weights)), []
    ln_v = np.log([solved_rate(i, size * np.sin(phases[i]), V) for i in range(3)])
    for k in range(periods):
        u = -1e9 * (weights @ x - V * 400 * k)

        def rates(t, y, u=u):
            pushed = size * turn * np.cos(turn * t + phases)
            p = per_slip * V * t + shares @ y[9:]
            flowing = (u - y[9:]) / lag
            first, aged = quasi_dynamic(
                y[3:6], y[6:9], S, STRESSES, SLIPS, 0.0, p, per_slip * V + shares @ flowing, pushed
            )
            return np.concatenate([np.exp(y[3:6]), first, aged, flowing])

        y = np.concatenate([x, ln_v, ln_theta, h])
        atol = np.concatenate([np.full(3, 1e-12), np.full(6, 1e-10), np.full(len(h), 1e-4)])
        y = solve_ivp(rates, (400.0 * k, 400.0 * (k + 1)), y, "Radau", rtol=1e-10, atol=atol).y[:, -1]
        x, ln_v, ln_theta, h = y[:3], y[3:6], y[6:9], y[9:]
        ends.append(y)
    ends = np.array(ends)
    assert run.times[::4] == pytest.approx(400.0 * np.arange(periods + 1))
    assert run.slip[4::4] == pytest.approx(ends[:, :3], rel=1e-7, abs=1e-9)
    assert np.log(run.slip_rate[4::4]) == pytest.approx(ends[:, 3:6], abs=1e-6)
    assert np.log(run.state[4::4]) == pytest.approx(ends[:, 6:9], abs=1e-6)
    assert run.pressure[4::4] == pytest.approx(ends[:, 9:], rel=1e-6, abs=1)
    assert np.ptp(np.log(run.slip_rate)) > 0.05


def solved_rate(i, pushed, V):
    """v with σ'(μ_0 + a ln(v/V)) + Hv = σ'μ_0 + HV + s, by bisection."""
    low, high = V * 1e-3, V * 1e3
    for _ in range(200):
        middle = np.sqrt(low * high)
        above = STRESSES[i] * A * np.log(middle / V) + DAMPING * (middle - V) > pushed
        low, high = (low, middle) if above else (middle, high)
    return np.sqrt(low * high)


def test_friction_without_a_state_is_refused():
    memoryless = qd.load_chain(Path(__file__).parents[1] / "data" / "three_blocks.toml")
    with pytest.raises(ParameterError, match=r"need friction with one state\. Received exponential-slip-weakening"):
        natural_cycles(memoryless, 1e6, loading_rate=1e-9)


@pytest.mark.parametrize(("duration", "far"), [(1e30, 1e-20), (1e14, 1e-9)])
def test_runs_that_never_end_are_refused(duration, far):
    with pytest.raises(ParameterError, match="Shorten the duration"):
        natural_cycles(CHAIN, duration, loading_rate=far)
    with pytest.raises(ParameterError, match="at most 100000 sampling periods"):
        simulate_sampled_blocks(CHAIN, LAW, lag=800.0, duration=duration)
