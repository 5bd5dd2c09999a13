"""The area of a layer's fast modes: against sums of many modes, and a loop that has them all as states of its own."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.special import erfc

from quakedesign.laws import LinearLaw, NominalModel
from quakedesign.loop import DiffusionPath, sampled_error_loop, with_response_area
from quakedesign.loop.diffusion_path import MODES

TIME, STEP, AUTHORITY, GAIN = F(3, 2), F(1, 5), F(2), F(6, 5)
LAYER = DiffusionPath(time=TIME)
MODEL = NominalModel(slip=F(1, 2), rate=F(3, 2), gain=GAIN * AUTHORITY)
MANY = 400
ODD = 2 * np.arange(MANY) + 1
RATES, SHARES = (ODD * np.pi / 2) ** 2 / float(TIME), 4 / np.pi * (-1.0) ** np.arange(MANY) / ODD
LAW = LinearLaw(
    states=("z",), update=((F(1),),), measured=((F(1), F(1, 7)),), output=(F(-3, 10),), feedback=(F(-1), F(-2))
)


def awaited(t):
    """F by all its modes."""
    return np.exp(-np.multiply.outer(t, RATES[MODES:])) @ (SHARES / RATES)[MODES:]


def test_the_area_is_that_of_what_a_step_leaves_out():
    """By the closed form in erfc, which knows of no modes, and by the sum over all other modes."""
    t = np.linspace(1e-9, 0.3, 400_001)
    step = 2 * sum((-1) ** n * erfc((2 * n + 1) / 2 / np.sqrt(t / float(TIME))) for n in range(12))
    kept = 1 - np.exp(-np.multiply.outer(t, RATES[:MODES])) @ SHARES[:MODES]
    assert np.trapezoid(kept - step, t) == pytest.approx(float(LAYER.area), rel=1e-6)
    rest = (SHARES / RATES)[MODES:]
    assert rest[:-1].sum() + rest[-1] / 2 == pytest.approx(float(LAYER.area), rel=1e-7)  # they alternate


def loop_of(lag, delay):
    plain = sampled_error_loop(LAW, MODEL, AUTHORITY, STEP, diffusion=TIME, lag=lag, delay=delay)
    return plain, with_response_area(plain, GAIN, LAYER)


@pytest.mark.parametrize(("lag", "delay"), [(F(0), F(0)), (F(0), F(3, 20)), (F(0), F(1, 5)), (F(1, 30), F(0))])
def test_what_is_awaited_is_below_its_bound_and_near_it(lag, delay):
    """Of steps of one sign at every sample, or of a well that rises evenly: bY over the share, against left_out."""
    plain, loop = loop_of(lag, delay)
    share = loop.feedthrough["slip_rate_error", "awaited"] / GAIN
    left = max(loop.outputs["left_out"])
    if lag:  # behind = lag for u' = -1
        t = np.linspace(0, 0.05, 2001)
        assert 0.4 < np.trapezoid(np.abs(awaited(t)), t) / float(share * left * lag) <= 1
        assert loop.fading == {}
        return
    fading = loop.fading["awaited"]
    assert fading.first == plain.fading["left_out"].first
    for theta in [*np.linspace(0, 2 / float(fading.rate), 5), *np.linspace(0, float(STEP), 9)]:
        whole = np.abs(awaited(theta + float(STEP) * np.arange(60))).sum()
        bound = float(share * left) * (float(fading.height) * np.exp(-float(fading.rate) * theta) + float(fading.floor))
        assert (0.2 if theta * float(fading.rate) <= 2 else 0) < whole / bound <= 1
    assert fading.height + fading.floor == 1


def courses(loop, extended, extra, pushes):
    """States at the samples under a push a that is constant over every period; `extended`: flow and jumps."""
    flow, jumps = extended
    x, found = np.zeros(len(flow)), []
    steps = [
        expm(np.block([[flow, extra[:, None]], [np.zeros(len(flow) + 1)]]) * float(p.duration)) for p in loop.segments
    ]
    for a in pushes:
        found.append(x)
        for jump, step in zip(jumps, steps, strict=True):
            x = (step @ [*(jump @ x), a])[:-1]
    return np.array(found)


@pytest.mark.parametrize(("lag", "delay"), [(F(0), F(0)), (F(0), F(3, 20)), (F(0), F(1, 5)), (F(1, 30), F(0))])
def test_a_loop_with_all_modes_is_the_loop_with_kicks_and_what_is_awaited(lag, delay):
    """The fast modes as states: in one loop they push the fault, in the other they say what is awaited."""
    plain, loop = loop_of(lag, delay)
    own, fast = len(loop.states), MANY - MODES
    first, valve = loop.states.index("layer0"), loop.states.index("valve")
    size = own + fast

    def extended(flow, segments):
        """As the slow ones are moved by valve or well: fast modes, in coordinates less the well's pressure."""
        whole = np.zeros((size, size))
        whole[:own, :own] = np.array(flow, float)
        whole[own:, :own] = [np.where(np.arange(own) == first, 0, whole[first, :own])] * fast
        whole[range(own, size), range(own, size)] = -RATES[MODES:]
        jumps = []
        for segment in segments:
            jump = np.eye(size)
            jump[:own, :own] = np.array(segment.jump, float)
            jump[own:, :own] = jump[first, :own] - np.eye(own)[first]
            jumps.append(jump)
        return whole, jumps

    true_flow, true_jumps = extended(plain.flow, plain.segments)
    true_flow[1, own:] = float(GAIN) * SHARES[MODES:]
    with_kicks = extended(loop.flow, loop.segments)
    share = float(loop.feedthrough["slip_rate_error", "awaited"] / GAIN)
    said = np.zeros(size)  # bY over the share: all that the steps so far will still bring, -(z - u) c/rate
    said[own:] = -(SHARES / RATES)[MODES:] / share
    entry = np.array(loop.inputs.get("awaited") or loop.fading["awaited"].entry, float)
    with_kicks[0][:own] += np.outer(entry, said)
    late = float(loop.fading["awaited"].weight(loop.segments[-1].duration)) if loop.fading else 1.0
    with_kicks[1][0][:own] += np.outer(np.array(loop.sampled["awaited_told"], float) / late, said)
    pushes = np.random.default_rng(2).choice([-1.0, 1.0], 60)
    extra = np.eye(size)[1]
    truth = courses(plain, (true_flow, true_jumps), extra, pushes)
    found = courses(loop, with_kicks, extra, pushes)
    found[:, 1] += float(GAIN) * share * (found @ said)
    scale = np.abs(truth).max(axis=0)[: valve + 1]
    assert np.abs(np.diff(truth[:, valve])).max() > 0.1 * scale[valve]
    assert np.all(np.abs(found - truth)[:, : valve + 1].max(axis=0) <= 1e-6 * scale)
    without = courses(plain, extended(plain.flow, plain.segments), extra, pushes)  # what the modes leave out matters
    assert np.abs(without - truth)[:, 1].max() > 1e-4 * scale[1]


def test_only_slip_rate_its_measurement_and_what_enters_are_changed():
    plain, loop = loop_of(F(0), F(0))
    back = replace(loop, feedthrough={}, sampled={}, fading={"left_out": loop.fading["left_out"]})
    kicked, jump = loop.segments[0].jump, plain.segments[0].jump
    assert replace(back, segments=plain.segments) == plain
    stepped = loop.states.index("stepped")
    assert kicked[1] == tuple(v - GAIN * LAYER.area * d for v, d in zip(jump[1], jump[stepped], strict=True))
    assert (*kicked[:1], *kicked[2:]) == (*jump[:1], *jump[2:])
    with_lag = loop_of(F(1, 30), F(0))
    behind = with_lag[1].states.index("behind")
    rows = [[row[behind] for row in one.flow] for one in with_lag]
    assert rows[1][1] - rows[0][1] == 30 * GAIN * LAYER.area
    assert set(with_lag[1].inputs) == {"acceleration", "drift", "awaited"}


def test_bounds_contain_the_rounding_of_rates_and_shares():
    """6Nδτ² of the statement; and with steps h/λ + f·τ over h + f, each with its own part of the sum."""
    rounding = 6 * MODES * F(1, 10**20)
    assert LAYER.response_integral == abs(LAYER.share(MODES)) / LAYER.rate(MODES) ** 2 + rounding * TIME**2
    loop = loop_of(F(0), F(0))[1]
    height, rate, floor = LAYER.truncation_bound(STEP)
    assert floor > 0
    most = height / rate + floor * TIME
    assert loop.feedthrough["slip_rate_error", "awaited"] == GAIN * most / (height + floor)
    assert loop.fading["awaited"].height == height / rate / most
    assert loop.fading["awaited"].floor == floor * TIME / most


@pytest.mark.parametrize("lag", [F(0), F(1, 30)])
def test_the_law_measures_the_slip_rate_with_what_is_awaited(lag):
    """z takes 1/7 of the measured slip rate, the pressure −2 of it; the slip rate itself does not jump."""
    _, loop = loop_of(lag, F(0))
    told = dict(zip(loop.states, loop.sampled["awaited_told"], strict=True))
    own = loop.feedthrough["slip_rate_error", "awaited"]
    late = own if lag else own * loop.fading["awaited"].weight(STEP)
    assert told["z"] == late / 7
    assert told["valve"] == -2 * AUTHORITY * late
    assert told["e1"] == 0
    area = 0 if lag else LAYER.area  # with steps at the well, the jump of the pressure moves the slip rate
    assert told["e2"] == 2 * AUTHORITY * late * GAIN * area
