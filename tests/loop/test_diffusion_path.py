"""The rock between well and fault: modes against closed forms, and what they leave out."""

from fractions import Fraction as F
from itertools import pairwise

import numpy as np
import pytest
from mpmath import mp
from scipy.special import erfc

from quakedesign.errors import ParameterError
from quakedesign.laws import LinearLaw, NominalModel, summed_integrals
from quakedesign.loop import Diffusion, DiffusionPath, Fading, sampled_error_loop
from quakedesign.loop.diffusion_path import MODES

TIME = F(3, 2)
LAYER = DiffusionPath(time=TIME)
MODEL = NominalModel(slip=F(1, 2), rate=F(3, 2), gain=F(12, 5))


def step_response(t):
    """2 Σ (−1)ⁿ erfc((2n + 1)/(2√(t/τ))), which converges where the sum of modes does not."""
    return 2 * sum((-1) ** n * erfc((2 * n + 1) / 2 / np.sqrt(t / float(TIME))) for n in range(40))


def of_modes(t):
    shares, rates = (np.array([float(f(n)) for n in range(MODES)]) for f in (LAYER.share, LAYER.rate))
    return 1 - np.exp(-np.multiply.outer(t, rates)) @ shares


def test_what_the_modes_leave_out_of_a_step_is_below_its_bound_and_near_it():
    high, rate, floor = LAYER.truncation_bound(F(10**6))  # steps so far apart that there is one
    found = []
    for t in np.geomspace(1e-5, 0.1, 60):
        left, bound = abs(step_response(t) - of_modes(t)), float(high) * np.exp(-float(rate) * t) + float(floor)
        assert left <= bound + 1e-14
        found.append(left / bound)
    assert max(found) > 0.95


def test_steps_at_every_sample_that_all_add_up_are_below_the_bound():
    step, late = F(1, 500), np.linspace(0, 1 / 500, 20)
    high, rate, floor = LAYER.truncation_bound(step)
    for theta in late[1:]:
        since = theta + np.arange(2000) / 500
        whole = np.abs(step_response(since) - of_modes(since)).sum()
        assert 0.4 < whole / (float(high) * np.exp(-float(rate) * theta) + float(floor)) <= 1


def test_a_well_that_rises_evenly_leaves_out_less_than_the_bound_of_its_integral():
    points = np.linspace(1e-7, 0.2, 20000)
    area = np.trapezoid(np.abs(step_response(points) - of_modes(points)), points)
    assert 0.4 * float(LAYER.truncation_integral) < area <= float(LAYER.truncation_integral)


def test_rationals_stand_for_pi_as_closely_as_their_bound_says():
    """All modes, each with its own error, at times up to 20 L²/D, below f of one step."""
    with mp.workdps(60):
        floor = 6 * MODES * mp.mpf(10) ** -20
        for t in (0, F(1, 1000), F(1, 10), 1, 10, 30):
            off = mp.mpf(0)
            for n in range(MODES):
                true = ((2 * n + 1) * mp.pi / 2) ** 2 / 1.5
                near, share = (mp.mpf(v.numerator) / v.denominator for v in (LAYER.rate(n), LAYER.share(n)))
                assert near <= true
                assert abs(share) >= 4 / mp.pi / (2 * n + 1)
                off += abs(share * mp.exp(-near * t) - (-1) ** n * 4 / mp.pi / (2 * n + 1) * mp.exp(-true * t))
            assert off <= floor


def loop_of(law, **more):
    return sampled_error_loop(law, MODEL, F(2), F(1, 5), diffusion=TIME, **more)


@pytest.mark.parametrize("frequency", [1e-2, 0.3, 2.0])
@pytest.mark.parametrize("lag", [F(0), F(1, 10)])
def test_the_loop_hears_the_well_through_one_over_cosh(frequency, lag):
    """Push over valve at a frequency, the modes and their direct rest: 1/(1 + s·lag)/cosh √(sτ)."""
    loop = loop_of(summed_integrals((F(1), F(1), F(1), F(1)), F(1, 5)), lag=lag)
    flow, push = np.array(loop.flow, float), np.array(loop.outputs["push"], float)
    valve, s = loop.states.index("valve"), 1j * frequency
    behind = range(valve + 1, valve + 1 + MODES + (lag > 0))
    inner = flow[np.ix_(behind, behind)]
    stays = [float(not lag or name == "behind") for name in loop.states[valve + 1 :]][: len(behind)]
    followed = np.linalg.solve(s * np.eye(len(behind)) - inner, -s * np.array(stays))
    found = push[valve] + push[behind] @ followed
    exact = 1 / (1 + s * float(lag)) / np.cosh(np.sqrt(s * float(TIME)))
    rises = frequency / abs(1 + s * float(lag))
    assert abs(found - exact) <= rises * float(LAYER.truncation_integral)


def simulated(valves, step, cells):
    """Pressure in the fault at the ends of periods, by the cells that simulations have, in many small steps."""
    layer, memory, found = Diffusion.of_time(float(TIME), cells=cells), np.zeros(cells), []
    whole = np.array([layer.rates(layer.numbers, list(unit), 0.0) for unit in np.eye(cells)]).T
    entry = np.array(layer.rates(layer.numbers, [0.0] * cells, 1.0))
    values, vectors = np.linalg.eigh(whole)
    grown = vectors @ np.diag(np.exp(values * step)) @ vectors.T
    for valve in valves:
        rest = -np.linalg.solve(whole, entry) * valve
        memory = rest + grown @ (memory - rest)
        found.append(layer.output(layer.numbers, list(memory), valve))
    return np.array(found)


def test_the_loop_and_the_actuator_of_simulations_agree_on_the_same_pressures():
    """The actuator's cells are off by at most 0.25/N² of each step (`Diffusion`), the modes by what they leave out."""
    valves = np.random.default_rng(3).choice([-1.0, 1.0], 40)
    law = summed_integrals((F(1), F(1), F(1), F(1)), F(1, 5))
    loop = loop_of(law)
    modes = [i for i, name in enumerate(loop.states) if name.startswith("layer")]
    rates, push = -np.array(loop.flow, float)[modes, modes], np.array(loop.outputs["push"], float)[modes]
    behind, before, found = np.zeros(MODES), 0.0, []
    for valve in valves:
        behind = (behind - (valve - before)) * np.exp(-rates / 5)
        before = valve
        found.append(valve + push @ behind)
    errors = [np.abs(np.array(found) - simulated(valves, 0.2, cells)).max() for cells in (16, 32, 64)]
    assert errors[0] <= 0.25 / 16**2 * np.abs(np.diff(valves, prepend=0)).sum()
    assert all(fine < coarse / 3 for coarse, fine in pairwise(errors))
    assert errors[2] < 2e-4


def test_the_valve_s_step_is_kept_and_everything_behind_it_stays_while_it_jumps():
    law = LinearLaw(
        states=("z",), update=((F(1),),), measured=((F(1), F(0)),), output=(F(-3),), feedback=(F(-5), F(-7))
    )
    for delay in (F(0), F(1, 10), F(1, 5)):
        loop = loop_of(law, delay=delay)
        place = {name: i for i, name in enumerate(loop.states)}
        state = [F(v + 2, v + 3) for v in range(len(loop.states))]
        arrives = loop.segments[1 if delay == F(1, 10) else 0].jump
        after = [sum((v * x for v, x in zip(row, state, strict=True)), F(0)) for row in arrives]
        change = after[place["valve"]] - state[place["valve"]]
        assert change
        assert after[place["stepped"]] == change
        for n in range(MODES):
            where = place[f"layer{n}"]
            assert after[where] + after[place["valve"]] == state[where] + state[place["valve"]]
        assert loop.fading["left_out"].first == (1 if delay == F(1, 10) else 0)


def test_a_layer_that_is_faster_than_bounds_can_follow_is_refused():
    law = summed_integrals((F(1), F(1), F(1), F(1)), F(1, 5))
    fastest = sampled_error_loop(law, MODEL, F(2), F(1, 5), diffusion=F(1, 160))
    assert fastest.states == ("e1", "e2", "xi1", "xi2", "valve", *LAYERS, "stepped")
    for time in (F(1, 161), F(-1)):
        with pytest.raises(ParameterError, match="at least T_s/32"):
            sampled_error_loop(law, MODEL, F(2), F(1, 5), diffusion=time)


def test_a_reference_that_moves_moves_no_mode_against_the_valve():
    loop = loop_of(summed_integrals((F(1), F(1), F(1), F(1)), F(1, 5)))
    assert loop.inputs["drift"][loop.states.index("valve") :] == (-1, *[0] * (MODES + 1))


PI = F(314159265358979323846, 10**20)
SHARES = [F(4 * (-1) ** n, 2 * n + 1) / PI for n in range(9)]
RATES = [(F(2 * n + 1, 2) * PI) ** 2 * F(2, 3) for n in range(9)]
SHORT = F(48, 10**20)
ASKED = {"e1": -8, "e2": -4, "xi1": -2, "xi2": F(-1, 5)}
LAYERS = [f"layer{n}" for n in range(8)]
LATER = {name: {name: 1, "valve": 1} | {k: -v for k, v in ASKED.items()} for name in ["behind", *LAYERS]}
ARRIVES = {"valve": {"waiting1": 1}, "stepped": {"waiting1": 1, "valve": -1}}
ARRIVES |= {name: {name: 1, "valve": 1, "waiting1": -1} for name in ["behind", *LAYERS]}
QUEUED = {"waiting0": ASKED, "waiting1": {"waiting0": 1}}
CASES = {
    "neither": ("0", "0", [LATER | {"valve": ASKED, "stepped": ASKED | {"valve": -1}}]),
    "lag": ("0", "1/4", [LATER | {"valve": ASKED} | {name: {name: 1} for name in LAYERS}]),
    "delay": ("27/100", "0", [QUEUED, ARRIVES]),
    "delay and lag": ("27/100", "1/10", [QUEUED, ARRIVES | {name: {name: 1} for name in LAYERS}]),
}


def named(loop, row):
    """The entries of a row that are not zero, by the names of states."""
    return {name: v for name, v in zip(loop.states, row, strict=True) if v}


@pytest.mark.parametrize(("delay", "lag", "jumps"), CASES.values(), ids=CASES)
def test_matrices_say_what_moves_where(delay, lag, jumps):
    """Row by row; states and inputs without a layer are those of `test_held`."""
    lag, delay, step = F(lag), F(delay), F(1, 5)
    loop = loop_of(summed_integrals((F(4), F(2), F(1), F(1, 10)), step), delay=delay, lag=lag)
    waiting, stepped, behind = (
        ["waiting0", "waiting1"] if delay else [],
        [] if lag else ["stepped"],
        ["behind"] * (lag > 0),
    )
    assert loop.states == ("e1", "e2", "xi1", "xi2", *waiting, "valve", *behind, *LAYERS, *stepped)
    push = {"valve": 1, **dict.fromkeys(behind, 1), **dict(zip(LAYERS, SHARES[:8], strict=True))}
    flow = {name: named(loop, row) for name, row in zip(loop.states, loop.flow, strict=True)}
    assert flow.pop("e1") == {"e2": 1}
    assert flow.pop("e2") == {"e1": F(1, 2), "e2": F(-3, 2)} | {name: v * F(6, 5) for name, v in push.items()}
    assert flow.pop("behind", None) == ({"behind": -1 / lag} if lag else None)
    for name, rate in zip(LAYERS, RATES[:8], strict=True):
        assert flow.pop(name) == {name: -rate, **({"behind": 1 / lag} if lag else {})}
    assert not any(flow.values())
    sums = {"xi1": {"xi1": 1, "e1": step}, "xi2": {"xi2": 1, "xi1": step}}
    for number, (segment, moved) in enumerate(zip(loop.segments, jumps, strict=True)):
        moved = {name: {name: 1} for name in loop.states} | ({} if number else sums) | moved
        found = {name: named(loop, row) for name, row in zip(loop.states, segment.jump, strict=True)}
        if number == 0 and delay and stepped:
            assert found.pop("stepped") == {"stepped": 1}  # until the next one arrives
        assert found == {name: moved[name] for name in found}
    assert [segment.duration for segment in loop.segments] == ([F(7, 100), F(13, 100)] if delay else [step])
    lengths = [F(v, 128) for v in (1, 2, 3, 4, 5, 7, 10, 14, 18, 20, 22, 22)]
    for segment in loop.segments:
        assert segment.pieces() == tuple(segment.duration * v for v in lengths)
        assert segment.pieces(past=True) == (segment.duration / 2,) * 2
    assert {name: named(loop, row) for name, row in loop.inputs.items()} == {
        "acceleration": {"e2": 1},
        "drift": {"xi2": 5, **dict.fromkeys([*waiting, "valve"], -1)},
    }
    outputs = {"slip_error": {"e1": 1}, "slip_rate_error": {"e2": 1}, "push": push, "asked": {"valve": 1}}
    if lag:
        left, fading = {"behind": (SHARES[8] / RATES[8] + SHORT * TIME) / lag}, {}
    else:
        height, floor = SHARES[8] * (1 + 1 / (RATES[8] * step)), SHORT * (1 + TIME / step)
        left, first = {"stepped": height + floor}, 1 if delay else 0
        shares = {"height": height / (height + floor), "floor": floor / (height + floor)}
        fading = {"left_out": Fading(entry=loop.inputs["acceleration"], first=first, rate=RATES[8], **shares)}
    assert {name: named(loop, row) for name, row in loop.outputs.items()} == outputs | {"left_out": left}
    assert loop.fading == fading
