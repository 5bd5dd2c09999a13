"""Runs of several blocks beside an integrator with events of rest and slip, and beside what is proved."""

from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import quakedesign as qd
from quakedesign.errors import ParameterError
from quakedesign.guarantees.exact.plant_loop import MatrixLaw
from quakedesign.simulation import simulate_blocks

CHAIN = qd.load_chain(Path(__file__).parents[1] / "data" / "three_blocks.toml")
STEP, MASS = 0.184, 2500 * 5000.0  # per area
STIFFNESS, DAMPING = 30e9 / 5000 / MASS, 5e14 / 25e6 / MASS
STRESS = np.array([50e6, 45e6, 50e6])


@cache
def proved():
    found = qd.guarantee(CHAIN).proof
    assert found.available
    return found


def hurried(seconds):
    """The same blocks with a task of so many seconds, and a slip that grows as fast as in half a day."""
    task = replace(CHAIN.fault.reference, operation_time=seconds, target_slip=2e-5 * seconds)
    return replace(CHAIN, fault=replace(CHAIN.fault, reference=task))


def friction(x):
    """Of the three blocks, written out."""
    exponential = 0.2353 + 0.1 * np.exp(-np.maximum(x[:2], 0) / 0.27635)
    return np.array([*exponential, 0.25 + 0.08 * max(0, 1 - max(x[2], 0) / 0.3)])


def with_events(chain, law, periods):
    """Slips at the samples; each block rests until its load passes its strength, and slides until it stops."""
    F, G, H, law_feedback = (
        np.array(part, dtype=float) for part in (law.update, law.measured, law.output, law.feedback)
    )
    pulls = np.zeros((3, 3))
    for i, j, K in chain.springs:
        pulls[i, j], pulls[i, i] = float(K), pulls[i, i] - float(K)
    static = friction(np.zeros(3))
    D, (a, b, c), (w1, w2, w3) = chain.diffusivity, (1000, 2750, 4250), chain.wells

    def flowing(q, p):
        """Of blocks of 2, 1.5 and 1.5 km with wells between their middles, by hand: the first rate for each point."""
        return [
            D / 2000 * (p[0] - q[0]) / (w1 - a),
            D / 1500 * ((p[0] - q[1]) / (b - w1) + (p[1] - q[1]) / (w2 - b)),
            D / 1500 * ((p[1] - q[2]) / (c - w2) + (p[2] - q[2]) / (w3 - c)),
        ]

    task, phases = chain.fault.reference, 2 * np.pi * np.arange(3) / 3

    def net(t, x, v, p):
        drive = static * STRESS / MASS - STIFFNESS * x + pulls @ x - DAMPING * v + 3.2e-6 * x
        return drive + 3.2e-4 * np.sin(0.69 * t + phases) - friction(x) * (STRESS - p) / MASS

    x, v, z, slips, q = np.zeros(3), np.zeros(3), np.zeros(len(F)), [], np.zeros(3)
    shares = np.array(chain.shares, dtype=float)
    for k in range(periods):
        t, end = k * STEP, (k + 1) * STEP
        stage = min(t / task.operation_time, 1)
        r = task.target_slip * stage**3 * (10 - 15 * stage + 6 * stage**2)
        moved = task.target_slip / task.operation_time * 30 * stage**2 * (1 - stage) ** 2
        y = np.array([*(x - r), *(v - moved)])
        p, z = H @ z + law_feedback @ y, F @ z + G @ y
        q = q if D else shares @ p
        slides = (v > 0) | (net(t, x, v, q) > 0)
        while end - t > 1e-12:

            def rates(at, state, p=p, slides=slides):
                v, q = state[3:6], state[6:]
                return [*(v * slides), *(net(at, state[:3], v, q) * slides), *(flowing(q, p) if D else np.zeros(3))]

            def event(i, slides=slides):
                def turned(at, state):
                    return state[3 + i] if slides[i] else net(at, state[:3], state[3:6], state[6:])[i]

                turned.terminal, turned.direction = True, -1 if slides[i] else 1
                return turned

            events = [event(i) for i in range(3)]
            run = solve_ivp(rates, (t, end), np.array([*x, *v, *q]), events=events, rtol=1e-9, atol=1e-15)
            t, x, v, q = run.t[-1], run.y[:3, -1], run.y[3:6, -1], run.y[6:, -1]
            switched = np.array([len(times) > 0 for times in run.t_events])
            v, slides = np.where(slides & ~switched, v, 0), slides ^ switched
        slips.append(x)
    return np.array(slips)


@pytest.mark.slow
def test_slips_are_those_of_an_integrator_with_events():
    chain, periods = hurried(1000 * STEP), 1000
    exact = with_events(chain, proved().law, periods)
    assert exact[-1].min() > 1e-3
    apart = []
    for substeps in (20, 80):
        run = simulate_blocks(chain, proved().law, duration=periods * STEP, substeps=substeps)
        assert len(run.times) == periods
        assert run.times == pytest.approx(STEP * np.arange(1, periods + 1))
        apart.append(np.abs(run.slip - exact).max())
    assert apart[1] < 5e-7
    assert apart[1] < 0.5 * apart[0]


@pytest.mark.slow
def test_slips_where_the_pressure_diffuses_are_those_of_an_integrator_with_events():
    chain, duration = replace(hurried(1000 * STEP), wells=(1400.0, 3500.0, 4600.0), diffusivity=2e6), 10.5 * STEP
    exact = with_events(chain, proved().law, 10)
    few, many, steady = (
        np.abs(simulate_blocks(one, proved().law, duration=duration, substeps=substeps).slip - exact).max()
        for one, substeps in ((chain, 20), (chain, 80), (replace(chain, diffusivity=None), 80))
    )
    assert many < 1e-7
    assert many < 0.5 * few
    assert steady > 10 * many


def test_a_run_stays_within_what_is_proved_and_counts_its_figures():
    run = simulate_blocks(CHAIN, proved().law, duration=3 * 3600)
    claims = [float(v) for v in proved().claims.outputs]
    assert (run.slip_error <= claims[:3]).all()
    assert (run.slip_rate_error <= claims[3:]).all()
    assert (run.slip_error >= np.abs(run.slip - run.reference[:, None]).max(axis=0) * (1 - 1e-9)).all()
    assert (run.slip_rate >= 0).all()
    assert run.slip_rate.max(axis=0) == pytest.approx(run.slip_rate_error, rel=0.3)
    assert (np.diff(run.slip, axis=0) >= 0).all()
    assert ((0 < run.rest) & (run.rest < 1)).all()
    assert not run.reversed
    assert not run.opened
    facts = run.to_dict()
    assert facts["least_pressure"] == run.pressure.min(axis=0).tolist()
    assert facts["duration"] == pytest.approx(3 * 3600, abs=run.times[0])


def test_without_a_law_that_acts_the_blocks_run_away():
    """The same blocks with a law that asks for nothing: an earthquake of centimetres a second."""
    law = replace(proved().law, output=((0,) * 6,) * 3, feedback=((0,) * 6,) * 3)
    run = simulate_blocks(CHAIN, law, duration=400)
    assert run.slip_rate.max() > 0.05
    assert (run.slip[-1] > 0.3).all()


def test_a_law_of_two_wells_reads_the_averages_of_its_wells():
    """p = -1e9*y, one number a well: the first pressures are those of the averages after one period at rest, less r."""
    two = replace(CHAIN, wells=(1000.0, 4000.0))
    zero, one = Fraction(0), Fraction(-(10**9))
    law = MatrixLaw(
        step=Fraction("0.184"),
        delay=zero,
        update=(),
        measured=(),
        output=((), ()),
        feedback=((one, zero, zero, zero), (zero, one, zero, zero)),
    )
    run = simulate_blocks(two, law, duration=400)
    k = len(run.times) - 2
    averages = [12 / 17 * run.slip[k, 0] + 5 / 17 * run.slip[k, 1], 7 / 19 * run.slip[k, 1] + 12 / 19 * run.slip[k, 2]]
    assert run.slip[k].max() > 1e-9
    assert run.pressure[k + 1] == pytest.approx(-1e9 * (np.array(averages) - run.reference[k]), rel=1e-9, abs=1e-6)


@pytest.mark.parametrize(("given", "received"), [({"duration": 0.1}, "0.1 s"), ({"substeps": 0}, "0")])
def test_times_without_meaning_are_refused(given, received):
    with pytest.raises(ParameterError, match=f"Received .*{received}"):
        simulate_blocks(CHAIN, proved().law, **given)
