"""The loop as matrices, against a schedule written out by hand."""

from dataclasses import replace
from fractions import Fraction as F
from random import Random

import numpy as np
import pytest
from scipy.linalg import expm
from thinned import few

from quakedesign.errors import ParameterError
from quakedesign.laws import (
    NOISES,
    ErrorModel,
    ImplicitStep,
    LinearLaw,
    NominalModel,
    Power,
    compensated,
    disturbance_estimate,
    slip_observer,
    summed_integrals,
)
from quakedesign.laws.sampled_law import steady_states
from quakedesign.loop import sampled_error_loop
from quakedesign.loop.error_loop import starts
from quakedesign.loop.periodic import Instants, Pulse

STEP = F(1, 5)
MODEL = NominalModel(slip=F(1, 2), rate=F(3, 2), gain=F(12, 5))
AUTHORITY = F(2)
PROPORTIONAL = LinearLaw(states=(), update=(), measured=(), output=(), feedback=(F(-3), F(-2)))
ESTIMATE = disturbance_estimate(
    (F(4), F(2)), F(2, 5), ErrorModel.delayed(((F(1), F(0)), (F(1, 12), F(3, 4))), ((F(0), F(1, 6)),), F(2))
)
OBSERVER = slip_observer(
    (F(4), F(2)),
    (F("0.9"), F(4), F(2)),
    ErrorModel.delayed(((F("1.01"), F("0.17")), (F("0.09"), F("0.75"))), ((F("0.018"), F("0.17")),), F(2)),
)
INTEGRALS = summed_integrals((F(4), F(2), F(1), F(1, 10)), STEP)


def run_matrices(loop, periods, push):
    """e1, e2 at the ends of periods under a constant acceleration, by the loop's matrices."""
    flow, entry = np.array(loop.flow, float), np.array(loop.inputs["acceleration"], float)
    whole = np.zeros((len(flow) + 1, len(flow) + 1))
    whole[:-1, :-1], whole[:-1, -1] = flow, push * entry
    state, found = np.r_[np.zeros(len(flow)), 1.0], []
    for _ in range(periods):
        for segment in loop.segments:
            state[:-1] = np.array(segment.jump, float) @ state[:-1]
            state = expm(whole * float(segment.duration)) @ state
        found.append(state[:2].copy())
    return np.array(found)


def run_by_hand(law, periods, push, delay, lag, step=float(STEP), fine=4000, noise=None):
    """The same by small Euler–midpoint steps and a list of times at which pressures arrive."""
    s, w, gain = float(MODEL.slip), float(MODEL.rate), float(MODEL.gain)
    c, d = np.array(law.output, float), np.array(law.feedback, float)
    f, g = np.array(law.update, float).reshape(len(c), len(c)), np.array(law.measured, float).reshape(len(c), 2)
    e, z, valve, fault, arrivals, found = np.zeros(2), np.zeros(len(c)), 0.0, 0.0, [], []
    h = step / fine
    for k in range(periods):
        told = e if noise is None else e + noise[k]
        asked = c @ z + d @ told
        z = f @ z + g @ told
        arrivals.append((k * fine + round(delay / h), asked))
        for i in range(k * fine, (k + 1) * fine):
            while arrivals and arrivals[0][0] <= i:
                valve = arrivals.pop(0)[1]
            ahead = valve + (fault - valve) * np.exp(-h / lag) if lag else valve
            middle = (fault + ahead) / 2 if lag else valve
            fault = ahead
            half = e + h / 2 * np.array([e[1], s * e[0] - w * e[1] + gain * middle + push])
            e = e + h * np.array([half[1], s * half[0] - w * half[1] + gain * middle + push])
        found.append(e)
    return np.array(found)


@pytest.mark.parametrize(
    "law", [PROPORTIONAL, ESTIMATE, INTEGRALS, OBSERVER], ids=["proportional", "estimate", "integrals", "observer"]
)
@few(("delay", "lag"), [("0", "0"), ("1/5", "0"), ("3/20", "0"), ("27/100", "1/10"), ("0", "1/4")], every=2)
def test_matrices_do_what_the_schedule_says(law, delay, lag):
    with_integral = law if law.states else INTEGRALS
    loop = sampled_error_loop(with_integral, MODEL, AUTHORITY, STEP, delay=F(delay), lag=F(lag))
    seen = run_by_hand(with_integral, 6, 0.3, float(F(delay)), float(F(lag)))
    # the loop's gain is that of b(p − p*), the plant's that of p
    assert np.allclose(run_matrices(loop, 6, 0.3), seen, rtol=1e-5, atol=1e-8)


@pytest.mark.parametrize("law", [ESTIMATE, INTEGRALS], ids=["estimate", "integrals"])
@pytest.mark.parametrize("delay", ["0", "1/5", "3/20"])
def test_a_step_of_p_star_is_a_jump_of_the_states_by_their_steady_values(law, delay):
    """A loop that rests at p* = 0 when p* steps to 1: by hand that is a push of −gain for ever."""
    loop = sampled_error_loop(law, MODEL, AUTHORITY, STEP, delay=F(delay))
    state, found = AUTHORITY * np.array(loop.inputs["drift"], float), []
    for _ in range(8):
        for segment in loop.segments:
            state = expm(np.array(loop.flow, float) * float(segment.duration)) @ np.array(segment.jump, float) @ state
        found.append(state[:2])
    assert np.allclose(found, run_by_hand(law, 8, -float(MODEL.gain), float(F(delay)), 0.0), rtol=1e-5, atol=1e-8)


def run_implicit(law, periods, push, delay, ends, noise, fine=2000):
    """By hand with y = (e1, e2, w), w by a rule of e1, e2 and the number of the sample."""
    s, w, gain, step = float(MODEL.slip), float(MODEL.rate), float(MODEL.gain), float(STEP)
    c, d, f, g = (np.array(v, float) for v in (law.output, law.feedback, law.update, law.measured))
    e, z, valve, arrivals, found, h = np.zeros(2), np.zeros(len(c)), 0.0, [], [], step / fine
    for k in range(periods):
        told = e + noise[k]
        y = np.array([*told, ends(told, k)])
        arrivals.append((k * fine + round(delay / h), c @ z + d @ y))
        z = f @ z + g @ y
        for i in range(k * fine, (k + 1) * fine):
            while arrivals and arrivals[0][0] <= i:
                valve = arrivals.pop(0)[1]
            half = e + h / 2 * np.array([e[1], s * e[0] - w * e[1] + gain * valve + push])
            e = e + h * np.array([half[1], s * half[0] - w * half[1] + gain * valve + push])
        found.append(e)
    return np.array(found)


@few("law", [ESTIMATE, OBSERVER], ids=["estimate", "observer"], every=2)
@pytest.mark.parametrize(("delay", "lag"), [("0", "0"), ("1/5", "0"), ("3/20", "0"), ("27/100", "1/10")])
def test_what_is_measured_may_be_off(law, delay, lag):
    """The law is told e + n: by hand, and by two sampled inputs."""
    random = np.random.default_rng(5)
    noise = random.standard_normal((6, 2))
    loop = sampled_error_loop(law, MODEL, AUTHORITY, STEP, delay=F(delay), lag=F(lag), noisy=NOISES)
    assert tuple(loop.sampled) == NOISES
    flow, heard = np.array(loop.flow, float), np.array([loop.sampled[name] for name in NOISES], float)
    state, found = np.zeros(len(flow)), []
    for off in noise:
        for number, segment in enumerate(loop.segments):
            state = np.array(segment.jump, float) @ state + (off @ heard if number == 0 else 0)
            state = expm(flow * float(segment.duration)) @ state
        found.append(state[:2])
    by_hand = run_by_hand(law, 6, 0.0, float(F(delay)), float(F(lag)), noise=noise)
    assert np.allclose(found, by_hand, rtol=1e-5, atol=1e-7)


def test_only_the_noise_that_is_asked_for_is_an_input():
    loop = sampled_error_loop(ESTIMATE, MODEL, AUTHORITY, STEP, noisy=("rate_noise",))
    assert tuple(loop.sampled) == ("rate_noise",)
    assert sampled_error_loop(ESTIMATE, MODEL, AUTHORITY, STEP).sampled == {}


ROOT = ImplicitStep(
    pull=(Power(factor=(F(1), F(1)), exponent=F(0), argument="slip"),), slopes=(F("0.8"), F(1)), remainder=F(1, 10)
)


@pytest.mark.parametrize("delay", ["0", "1/5", "3/20", "27/100"])
@pytest.mark.parametrize("noisy", [(), NOISES], ids=["quiet", "noisy"])
def test_the_end_of_an_implicit_step_is_a_line_and_a_sampled_input(delay, noisy):
    """w = −0.9(e1 + n1)/T_s + v_k with any v_k, e2 + n2 measured: by matrices and by hand."""
    law, random = compensated(ROOT, F(2, 5), F(1, 4)), np.random.default_rng(4)
    kicks, slope, noise = random.standard_normal(6), 0.9 / float(STEP), random.standard_normal((6, 2)) * len(noisy)
    loop = sampled_error_loop(law, MODEL, AUTHORITY, STEP, delay=F(delay), noisy=noisy)
    heard = np.array([loop.sampled[name] for name in noisy], float).reshape(len(noisy), len(loop.flow))
    flow, entry = np.array(loop.flow, float), np.array(loop.sampled["root"], float)
    whole = np.zeros((len(flow) + 1, len(flow) + 1))
    whole[:-1, :-1], whole[:-1, -1] = flow, 0.3 * np.array(loop.inputs["acceleration"], float)
    state, found = np.r_[np.zeros(len(flow)), 1.0], []
    for kick, off in zip(kicks, noise, strict=True):
        for number, segment in enumerate(loop.segments):
            sudden = kick * entry + off[: len(noisy)] @ heard
            state[:-1] = np.array(segment.jump, float) @ state[:-1] + (sudden if number == 0 else 0)
            state = expm(whole * float(segment.duration)) @ state
        found.append(state[:2].copy())
    by_hand = run_implicit(law, 6, 0.3, float(F(delay)), lambda e, k: -slope * e[0] + kicks[k], noise)
    assert np.allclose(found, by_hand, rtol=1e-5, atol=1e-7)


def test_a_law_without_integral_action_is_refused():
    with pytest.raises(ParameterError, match="constant pressure"):
        sampled_error_loop(PROPORTIONAL, MODEL, AUTHORITY, STEP)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"step": F(0)}, r"^step of a loop must be positive\. Received 0 s"),
        ({"step": F(-1), "delay": F(-8)}, r"^step of a loop must be positive\. Received -1 s"),
        ({"delay": F(9)}, r"^delay must be 0 to 8 steps, here 1\.6 s\. Received 9 s\. Shorten the delay"),
        ({"step": F(1), "delay": 8 + F(1, 10**9)}, r"here 8 s\. Received 8\.000000001 s"),
        ({"delay": F(-1, 9)}, r"^delay must be 0 to 8 steps, .* Received -0\.111111 s\. Omit the minus sign"),
        ({"lag": F(-1)}, r"^lag must be 0 or more\. Received -1 s"),
        ({"step": F(32), "diffusion": 1 - F(1, 10**8)}, r"= 1 s\. Received 0\.99999999 s"),
    ],
)
def test_times_that_make_no_loop_are_refused(wrong, said):
    given = {"step": STEP} | wrong
    with pytest.raises(ParameterError, match=said):
        sampled_error_loop(ESTIMATE, MODEL, AUTHORITY, **given)


def test_a_law_of_the_reference_moves_its_states_with_it():
    """z1⁺ = z1 + e1, z2⁺ = z2/2 + r and p = −4(e1 + r) − 2(e2 + r′) − 5z1 + 3z2, in MPa: at rest z2 = 2r, and p is that
    at r = 0 for 5z1 = 6r − 4r."""
    law = LinearLaw(
        states=("sum", "mean"),
        update=((F(1), F(0)), (F(0), F(1, 2))),
        measured=((F(1), F(0)), (F(0), F(0))),
        output=(F(-5), F(3)),
        feedback=(F(-4), F(-2)),
        of_reference=((F(0), F(0)), (F(1), F(0)), (F(-4), F(-2))),
    )
    loop = sampled_error_loop(law, MODEL, AUTHORITY, STEP)
    assert named(loop, loop.inputs["reference"]) == {"sum": F(-2, 5), "mean": -2}
    assert named(loop, loop.sampled["reference_rate"]) == {"valve": -2 * AUTHORITY}
    without = sampled_error_loop(replace(law, of_reference=()), MODEL, AUTHORITY, STEP)
    assert "reference" not in without.inputs
    assert replace(loop, inputs=without.inputs, sampled={}) == without


LATE = Instants(measured=F(1, 50), arrived=F(1, 40), ramp=F(3, 80))


@pytest.mark.parametrize(("delay", "lag"), [("0", "0"), ("1/20", "0"), ("1/5", "1/4"), ("27/100", "1/4")])
def test_a_late_pressure_is_a_pulse_about_its_arrival(delay, lag):
    """It enters where the valve does: e2 with the gain of the push, or the lag. The drift goes on meanwhile."""
    given = {"delay": F(delay), "lag": F(lag)}
    loop = sampled_error_loop(INTEGRALS, MODEL, AUTHORITY, STEP, **given, instants=LATE)
    (pulse,) = loop.pulses.values()
    entry = named(loop, pulse.entry)
    assert entry == ({"behind": 4} if F(lag) else {"e2": F(12, 5) / 2})
    assert pulse == Pulse(
        entry=pulse.entry,
        first=0 if F(delay) % STEP == 0 else 1,
        early=F(1, 40),
        late=F(1, 16),
        before=F(1, 40),
        after=F(1, 40) + F(3, 160),
    )
    assert loop.feedthrough == {("asked" if F(lag) else "push", "drift"): F(1, 16)}
    assert named(loop, loop.outputs["stepped"]) == {"stepped": 1}


def test_without_late_pressures_there_is_no_pulse():
    for instants in (Instants(), Instants(measured=F(1, 50))):
        loop = sampled_error_loop(INTEGRALS, MODEL, AUTHORITY, STEP, instants=instants)
        assert loop.pulses == loop.feedthrough == {}
        assert named(loop, loop.outputs["stepped"]) == {"stepped": 1}
    assert "stepped" not in sampled_error_loop(INTEGRALS, MODEL, AUTHORITY, STEP).outputs


def test_timing_errors_stay_within_the_interval_and_have_no_diffusion_path():
    with pytest.raises(ParameterError, match="must begin and end between two samples"):
        sampled_error_loop(INTEGRALS, MODEL, AUTHORITY, STEP, delay=F(1, 50), instants=LATE)
    with pytest.raises(ParameterError, match=r"no guarantee with a diffusion path covers .* Received L\^2/D = 3 s"):
        sampled_error_loop(INTEGRALS, MODEL, AUTHORITY, STEP, diffusion=F(3), instants=LATE)


def test_a_loop_starts_with_errors_and_with_what_its_law_makes_of_measured_ones():
    first = replace(INTEGRALS, first=((F(2), F(0)), (F(0), F(3))))
    assert starts(first, 6, (F(5), F(7)), (F(1, 2), F(0))) == (
        (5, 0, 10, 0, 0, 0),
        (0, 7, 0, 21, 0, 0),
        (0, 0, 1, 0, 0, 0),
    )
    assert starts(INTEGRALS, 6, (F(5), F(0)), (F(1), F(1))) == ((5, 0, 0, 0, 0, 0),)


def test_sizes_that_do_not_fit_are_refused():
    with pytest.raises(ParameterError, match="linear law"):
        LinearLaw(states=("z",), update=(), measured=(), output=(F(1),), feedback=(F(1), F(0)))


@pytest.mark.parametrize(("delay", "ages"), [("0", 0), ("1/5", 1), ("3/20", 1), ("27/100", 2)])
def test_a_law_that_knows_the_delay_expects_what_comes(delay, ages):
    """On the plant of its own model, disturbance and all, the predicted slip rate is the measured one."""
    period, late = float(STEP), float(F(delay))
    whole, part = divmod(F(delay), STEP)
    flow = np.array([[0, 1, 0], [0.5, -1.5, 1], [0, 0, 0]])
    pushed = lambda t: expm(flow * t)[:2, 2]  # noqa: E731
    pushes = [np.zeros(2)] * (ages + 1)
    pushes[int(whole)] = pushed(period - float(part))
    if part:
        pushes[int(whole) + 1] = pushed(period) - pushes[int(whole)]
    ahead = [pushed(min(j * period, late)) - pushed((j - 1) * period) for j in range(1, ages + 1)]
    rows = lambda m: tuple(tuple(map(F, row)) for row in m)  # noqa: E731
    arrival = np.column_stack([expm(flow * late)[:2, :2], *(float(MODEL.gain) * v for v in ahead)])
    law = disturbance_estimate(
        tuple(map(F, np.array([4, 2]) @ arrival)),
        F(2, 5),
        ErrorModel.delayed(rows(expm(flow * period)[:2, :2]), rows(pushes), MODEL.gain),
    )
    assert np.allclose(
        run_matrices(sampled_error_loop(law, MODEL, AUTHORITY, STEP, delay=F(delay)), 120, 0.3)[-1], 0, atol=1e-9
    )
    # a constant disturbance is known after the first samples: the innovation decays with 1 − a alone
    z, e, asked, found = np.zeros(len(law.output)), np.zeros(2), [0.0] * (ages + 1), []
    f, g, c, d = (np.array(m, float) for m in (law.update, law.measured, law.output, law.feedback))
    for _ in range(30):
        found.append(e[1] - z[0])
        asked = [c @ z + d @ e, *asked][: ages + 1]
        z = f @ z + g @ e
        arrived = asked[int(whole)]
        before = asked[int(whole) + 1] if part else arrived
        for duration, p in ((float(part), before), (period - float(part), arrived)):
            e = expm(flow * duration)[:2, :2] @ e + pushed(duration) * (float(MODEL.gain) * p + 0.3)
    assert np.allclose(np.array(found[2:]) / found[1:-1], 0.6, atol=1e-6)


def test_the_estimate_rests_on_the_disturbance_that_its_model_has():
    """With the model's own plant and a constant disturbance the level settles on it: p* = −d/gain, no error."""
    near = expm(np.array([[0, 1, 0], [0.5, -1.5, 1], [0, 0, 0]]) * 0.2)
    of_errors, of_command = (tuple(tuple(map(F, row)) for row in m) for m in (near[:2, :2], near[:2, 2:].T))
    model = ErrorModel.delayed(of_errors, of_command, MODEL.gain)
    law = disturbance_estimate((F(4), F(2)), F(2, 5), model)
    loop = sampled_error_loop(law, MODEL, AUTHORITY, STEP)
    assert np.allclose(run_matrices(loop, 80, 0.3)[-1], 0, atol=1e-9)


def test_the_longest_delay_is_eight_periods():
    loop = sampled_error_loop(ESTIMATE, MODEL, AUTHORITY, STEP, delay=8 * STEP)
    assert loop.states == ("e1", "e2", *ESTIMATE.states, *(f"waiting{i}" for i in range(8)), "valve")
    with pytest.raises(ParameterError, match="delay must be 0 to 8 steps"):
        sampled_error_loop(ESTIMATE, MODEL, AUTHORITY, STEP, delay=8 * STEP + F(1, 10**9))
    assert sampled_error_loop(ESTIMATE, MODEL, AUTHORITY, STEP, delay=F(1, 10**9)).segments[0].duration == F(1, 10**9)


def named(loop, row):
    """The entries of a row that are not zero, by the names of states."""
    return {name: v for name, v in zip(loop.states, row, strict=True) if v}


ASKED = {"e1": -8, "e2": -4, "xi1": -2, "xi2": F(-1, 5)}  # b·p of INTEGRALS
SUMS = {"xi1": {"xi1": 1, "e1": F(1, 5)}, "xi2": {"xi2": 1, "xi1": F(1, 5)}}
STAYS = {name: {name: 1} for name in ("e1", "e2", "valve", "behind")}
CASES = {
    "neither": ("0", "0", [{"valve": ASKED}]),
    "lag": ("0", "1/4", [{"valve": ASKED, "behind": {"behind": 1, "valve": 1} | {k: -v for k, v in ASKED.items()}}]),
    "delay of a period": ("1/5", "0", [{"waiting0": ASKED, "valve": {"waiting0": 1}}]),
    "delay and lag": (
        "27/100",
        "1/10",
        [
            {"waiting0": ASKED, "waiting1": {"waiting0": 1}},
            {"valve": {"waiting1": 1}, "behind": {"behind": 1, "valve": 1, "waiting1": -1}},
        ],
    ),
}


@pytest.mark.parametrize(("delay", "lag", "jumps"), CASES.values(), ids=CASES)
def test_matrices_say_what_moves_where(delay, lag, jumps):
    """Row by row: what flows, what a sample and an arrival move, what enters and what is seen."""
    loop = sampled_error_loop(INTEGRALS, MODEL, AUTHORITY, STEP, delay=F(delay), lag=F(lag))
    waiting, pressures = [f"waiting{i}" for i in range(2 if len(jumps) == 2 else int(F(delay) / STEP))], ["valve"]
    pressures += ["behind"] if F(lag) else []
    assert loop.states == ("e1", "e2", "xi1", "xi2", *waiting, *pressures)
    flow = {name: named(loop, row) for name, row in zip(loop.states, loop.flow, strict=True)}
    assert flow.pop("e1") == {"e2": 1}
    assert flow.pop("e2") == {"e1": F(1, 2), "e2": F(-3, 2), **dict.fromkeys(pressures, F(6, 5))}
    assert flow.pop("behind", None) == ({"behind": -1 / F(lag)} if F(lag) else None)
    assert not any(flow.values())
    for number, (segment, moved) in enumerate(zip(loop.segments, jumps, strict=True)):
        stays = STAYS | ({name: {name: 1} for name in ("xi1", "xi2", *waiting)} if number else SUMS)
        expected = {name: (stays | moved)[name] for name in loop.states}
        assert {name: named(loop, row) for name, row in zip(loop.states, segment.jump, strict=True)} == expected
    parts = [F(delay) % STEP, STEP - F(delay) % STEP] if len(jumps) == 2 else [STEP]
    assert [segment.duration for segment in loop.segments] == parts
    for segment in loop.segments:
        assert segment.pieces(past=True) == (segment.duration / 8,) * 8
        first = segment.duration / (128 if F(lag) else 8)  # what a lag makes of a step is soon over
        assert segment.pieces()[0] == min(segment.pieces()) == first
    assert {name: named(loop, row) for name, row in loop.inputs.items()} == {
        "acceleration": {"e2": 1},
        "drift": {"xi2": 5, **dict.fromkeys([*waiting, "valve"], -1)},
    }
    assert {name: named(loop, row) for name, row in loop.outputs.items()} == {
        "slip_error": {"e1": 1},
        "slip_rate_error": {"e2": 1},
        "push": dict.fromkeys(pressures, 1),
        **({"asked": {"valve": 1}} if F(lag) else {}),
    }
    assert loop.sampled == {}


def test_the_end_of_an_implicit_step_is_its_line_and_what_is_beside_it():
    """w = v − 9/2·e1 in z⁺ = z + 3w and b·p = 2(−2e1 − 5e2 − z + 7w)."""
    law = LinearLaw(
        states=("z",),
        update=((F(1),),),
        measured=((F(0), F(0), F(3)),),
        output=(F(-1),),
        feedback=(F(-2), F(-5), F(7)),
        implicit_step=ROOT,
    )
    loop = sampled_error_loop(law, MODEL, AUTHORITY, STEP, noisy=("rate_noise", "slip_noise"))
    (segment,) = loop.segments
    moved = {name: named(loop, row) for name, row in zip(loop.states, segment.jump, strict=True)}
    assert moved["z"] == {"z": 1, "e1": F(-27, 2)}
    assert moved["valve"] == {"e1": -4 - 63, "e2": -10, "z": -2}
    assert {name: named(loop, row) for name, row in loop.sampled.items()} == {
        "root": {"z": 3, "valve": 14},
        "slip_noise": {"z": F(-27, 2), "valve": -67},
        "rate_noise": {"valve": -10},
    }
    assert sampled_error_loop(law, MODEL, AUTHORITY, STEP).sampled.keys() == {"root"}
    assert sampled_error_loop(INTEGRALS, MODEL, AUTHORITY, STEP, noisy=["slip_noise"]).sampled.keys() == {"slip_noise"}


def images(rows, vector):
    return tuple(sum(a * b for a, b in zip(row, vector, strict=True)) for row in rows)


@pytest.mark.parametrize("rank", [1, 2, 3])
def test_steady_states_solve_their_equations(rank):
    """Mz = v and Cz = p, by insertion, for M of any rank; a row that contradicts another leaves none."""
    random = Random(rank)
    some = lambda *size: [some(*size[1:]) for _ in range(size[0])] if size else F(random.randint(-9, 9), 4)  # noqa: E731
    for _ in range(20):
        basis, output, hidden = some(rank, 3), some(3), some(3)
        own = [images(zip(*basis, strict=True), weights) for weights in some(3, rank)]
        *rates, asked = images([*own, output], hidden)
        found = steady_states(own, output, rates, asked)
        assert images([*own, output], found) == (*rates, asked)
        with pytest.raises(ParameterError, match="constant pressure"):
            steady_states([*own, own[0]], output, [*rates, rates[0] + 1], asked)
