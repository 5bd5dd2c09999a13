"""A slow input gain in both checkers: against each other, against sums by hand, and against plants that slip."""

import copy
import json
from dataclasses import replace
from fractions import Fraction as F
from functools import cache
from math import ceil, exp

import numpy as np
import pytest
from scipy.linalg import expm
from standalone_guarantee import checker

from quakedesign.errors import CertificateError, ParameterError
from quakedesign.exact import UpperBound
from quakedesign.fault import load_fault
from quakedesign.guarantees import NoProof, SampledLoop, TrackingProof, VaryingGain, guarantee
from quakedesign.guarantees.exact import tracking_proof as statement
from quakedesign.guarantees.exact.guarantee_files import guarantee_text, parse_guarantee
from quakedesign.guarantees.exact.small_gain import Bounds, grown, varying_gain_norms
from quakedesign.laws import ErrorModel, NominalModel, disturbance_estimate
from quakedesign.lyapunov.exact.claim import Verdict
from quakedesign.plant import uncertain_plant

STEP, SLOW = F("0.184"), VaryingGain(parts=2, growth=F(1, 4))
TASK = uncertain_plant(load_fault("real-fault"))
GAIN = F("2.282e-8")
LAW = disturbance_estimate(
    (F("7.8e8"), F("2.38e8")),
    F("0.1"),
    ErrorModel.delayed(((F(1), F(0)), (F("0.07"), F("0.752"))), ((F(0), F("0.16")),), GAIN),
)
HELD = SampledLoop(law=LAW, step=STEP)
BETA = tuple(map(float, TASK.beta))
SLOPE = TASK.friction.weakening * TASK.area_per_mass[1] / TASK.authority


@cache
def claim():
    return guarantee(TASK, HELD, SLOW)


def document():
    return json.loads(guarantee_text(claim()))


def test_both_prove_what_one_of_them_claims_and_a_gain_that_jumps_has_less():
    assert claim().check() is Verdict.PROVED
    assert "friction any function of the slip alone within" in checker.verify(document())[0]
    jumping = guarantee(TASK, HELD)
    assert claim().claims.slip_rate_error < F(9, 10) * jumping.claims.slip_rate_error
    more = guarantee(TASK, HELD, replace(SLOW, parts=4))
    assert more.claims.slip_rate_error < F(98, 100) * claim().claims.slip_rate_error


def test_without_its_key_the_claims_do_not_follow():
    raw = document()
    del raw["slow_gain"]
    with pytest.raises(checker.Refused, match="claim slip_error must follow"):
        checker.verify(raw)
    assert parse_guarantee(json.dumps(raw)).check() is Verdict.UNDECIDED


@pytest.mark.parametrize("key", ["slip_error", "slip_rate_error", "peak_slip_rate"])
def test_a_smaller_claim_is_refused_by_both(key):
    raw = document()
    raw["claims"][key] = str(F(raw["claims"][key]) * F(99, 100))
    with pytest.raises(checker.Refused):
        checker.verify(raw)
    assert parse_guarantee(json.dumps(raw)).check() is Verdict.UNDECIDED


CONTINUOUS = {"states": ["z"], "rates": [["0"]], "measured": [["1", "0"]], "output": ["1"], "feedback": ["-5", "-5"]}
REFUSED = [
    (("slow_gain", "parts"), 0),
    (("slow_gain", "parts"), 17),
    (("slow_gain", "parts"), True),
    (("slow_gain", "parts"), "2"),
    (("slow_gain", "parts"), 2.0),
    (("slow_gain", "growth"), "0"),
    (("slow_gain", "growth"), "-1/2"),
    (("slow_gain", "growth"), 1),
    (("slow_gain", "more"), "1"),
    (("slow_gain",), None),
    (("fault", "friction", "rate_slope"), "1/10"),
    (("loop",), CONTINUOUS),
]


@pytest.mark.parametrize(("path", "value"), REFUSED, ids=str)
def test_both_refuse_what_is_no_slow_gain(path, value):
    raw = document()
    holder = raw
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = value
    with pytest.raises(checker.Refused):
        checker.verify(copy.deepcopy(raw))
    with pytest.raises(CertificateError):
        parse_guarantee(json.dumps(raw))


@pytest.mark.parametrize("friction", [{"rate_slope": "1/1000000000"}, {}])
def test_a_gain_that_may_jump_or_acts_at_once_is_not_slow_whatever_is_claimed(friction):
    raw = document()
    raw["fault"]["friction"] |= friction
    raw["loop"] = raw["loop"] if friction else CONTINUOUS
    with pytest.raises(checker.Refused, match="slow_gain needs friction of the slip alone and a sampled law"):
        checker.verify(copy.deepcopy(raw))
    with pytest.raises(
        CertificateError, match=r"input gain needs friction that depends on the slip alone|unknown field `slow_gain`"
    ):
        parse_guarantee(json.dumps(raw))


@pytest.mark.parametrize("parts", [1, 16])
def test_one_to_sixteen_parts_are_read_by_both(parts):
    raw = document()
    raw["slow_gain"]["parts"] = parts
    assert parse_guarantee(json.dumps(raw)).varying_gain.parts == parts
    task = checker.read_task(raw)
    assert checker.read_slow(raw["slow_gain"], task, checker.read_loop(raw["loop"], task)).parts == parts


def test_the_spread_is_half_a_part_and_what_slip_and_reference_add():
    """κ = weakening·N̂/b; E = 1 mm, r′ the reference's largest rate."""
    found, e = SLOW.spread(TASK, F(1, 1000)), F(1, 1000)
    assert SLOPE == TASK.friction.weakening / TASK.friction.least  # N̂ is one number here
    assert found.present == (TASK.beta[1] - 1) / 4 + 2 * SLOPE * e
    assert float(found.past) == pytest.approx(float(SLOPE * TASK.reference_rates[0]) / (np.e * 0.25), rel=1e-4)
    assert float(found.past) > float(SLOPE * TASK.reference_rates[0]) / (np.e * 0.25)


def test_the_models_are_the_middles_of_the_parts():
    low, high = BETA
    middles = [float(model.gain / TASK.authority) for model in replace(SLOW, parts=4).models(TASK)]
    assert middles == pytest.approx([low + (high - low) * (2 * k + 1) / 8 for k in range(4)], rel=1e-12)
    sheared = replace(TASK, friction=replace(TASK.friction, rate_slope=F(1, 10)))
    with pytest.raises(ParameterError, match="friction that depends on the slip alone"):
        SLOW.models(sheared)


def response(model, growth):
    """∫e^{ασ}|e2's response|dσ to the acceleration, at a sample, by midpoint sums over 150 periods."""
    loop, pieces = HELD.loop(TASK, model), 32
    flow, jump = np.array(loop.flow, float), np.array(loop.segments[0].jump, float)
    h = float(STEP) / pieces
    small, half = expm(flow * h), expm(flow * h / 2)
    row, total = np.eye(len(flow))[1], 0.0
    for k in range(150 * pieces):
        if k and k % pieces == 0:
            row = row @ jump
        total += h * np.exp(growth * h * (k + 0.5)) * abs(row @ half[:, 1])
        row = row @ small
    return total


def test_gains_of_the_past_are_those_of_responses_that_count_more():
    model = SLOW.models(TASK)[1]
    loop = HELD.loop(TASK, model)
    for growth in (F(1, 10**6), F(1, 5)):
        found = varying_gain_norms([loop], growth)["slip_rate_error", "aged"]
        expected = response(model, float(growth))
        assert expected * 0.999 <= float(found[-1]) <= expected * 1.02
    assert grown(loop, F(1)).flow[1][2:] == loop.flow[1][2:]


def test_both_find_the_same_gains_of_every_part():
    raw = document()
    task = checker.read_task(raw)
    loop = checker.read_loop(raw["loop"], task)
    theirs = checker.slow_gains(task, loop, checker.Slow(2, F(1, 4)))
    ours = varying_gain_norms([HELD.loop(TASK, model) for model in SLOW.models(TASK)], F(1, 4))
    for column, name in enumerate(("acceleration", "drift", "aged")):
        for line, output in enumerate(("slip_error", "slip_rate_error", "push")):
            assert [float(v) for v in theirs[column][line]] == pytest.approx(
                [float(v) for v in ours[output, name]], rel=1e-6
            )


def test_a_claim_that_no_bound_stays_below_is_not_proved(monkeypatch):
    """Bounds as large as the claim on the slip error: the argument needs less."""
    for share, verdict in ((1, Verdict.UNDECIDED), (F(999, 1000), Verdict.PROVED)):
        bounds = Bounds(slip_error=share * F(1, 10), slip_rate_error=F(0), push=F(0), small_gain=F(1, 2))
        monkeypatch.setattr(statement, "best_bounds", lambda *_, bounds=bounds: bounds)
        claims = replace(statement.Claims.of(TASK, bounds), slip_error=UpperBound(F(1, 10)))
        assert TrackingProof(task=TASK, sampled_loop=HELD, claims=claims, varying_gain=SLOW).check() is verdict
    raw = document()
    for share, fails in ((1, True), (F(999, 1000), False)):
        slip = share * F(raw["claims"]["slip_error"])
        monkeypatch.setattr(checker, "bounds", lambda *_, slip=slip: ([slip, F(0), F(0)], F(1, 2)))
        if fails:
            with pytest.raises(checker.Refused, match="must stay below its claim"):
                checker.verify(raw)
        else:
            assert checker.verify(raw)


def test_a_slip_error_that_moves_the_gain_without_end_is_said(monkeypatch):
    tried = []

    def grows(task, held, slow_gain, gains, slip_error):
        tried.append(slip_error)
        return Bounds(slip_error=2 * slip_error + 1, slip_rate_error=F(0), push=F(0), small_gain=F(1, 2))

    monkeypatch.setattr(statement, "_bounds_with_varying_gain", grows)
    found = guarantee(TASK, HELD, SLOW)
    assert isinstance(found, NoProof)
    none, bounds = "none of the slip errors tried, up to ", " m, bounds the change of the input gain"
    printed = found.reason.removeprefix(none).removesuffix(bounds)
    assert F(9, 10) * max(tried) < F(printed) <= max(tried)


def test_a_loop_that_is_not_stable_at_an_end_of_the_range_has_none():
    wild = replace(HELD, law=replace(LAW, feedback=tuple(9 * v for v in LAW.feedback)))
    assert isinstance(guarantee(TASK, wild, SLOW), NoProof)
    fast = replace(SLOW, growth=F(50))
    assert "not stable" in guarantee(TASK, HELD, fast).reason


@pytest.mark.parametrize("steepness", [1, 500])
def test_no_plant_whose_friction_falls_with_slip_leaves_the_bounds(steepness):
    """β = μ(r + e1)N̂/b is a function of the slip, a zigzag with the largest slope; φ and s switch at random.

    The steep one changes by a tenth of its range within the errors that are claimed.
    """
    task = TASK
    found = _bounds_with(task, replace(SLOW, parts=4), SLOPE * steepness)
    random, courses, pieces = np.random.default_rng(3), 400, 8
    kept, fed, out, back = (np.array(m, float) for m in (LAW.update, LAW.measured, LAW.output, LAW.feedback))
    b, s, w = float(task.authority), tuple(map(float, task.slip_chord)), float(task.rate_chord[0])
    force, h, kappa = float(task.amplitude), float(STEP) / pieces, float(SLOPE * steepness)
    e, z = np.zeros((2, courses)), np.zeros((2, courses))
    middle = random.uniform(*BETA, courses)
    width = BETA[1] - BETA[0]
    flips = np.cumsum(random.random((40 * pieces, 2, courses)) < 10.0 ** random.uniform(-2.5, 0, courses), axis=0) % 2
    largest = np.zeros(2)
    for k in range(40 * pieces):
        if k % pieces == 0:
            v = b * (out @ z + back @ e)
            z = kept @ z + fed @ e
        way, slope = 2.0 * flips[k, 0] - 1, np.asarray(s)[flips[k, 1]]

        def rate(x, v=v, way=way, slope=slope):
            place = (kappa * x[0] + middle - BETA[0]) / width  # a zigzag of slope κ between the ends of the range
            beta = BETA[0] + width * np.abs((place + 1) % 2 - 1)
            return np.array([x[1], slope * x[0] - w * x[1] + beta * v + way * force])

        k1 = rate(e)
        k2 = rate(e + h / 2 * k1)
        k3 = rate(e + h / 2 * k2)
        e = e + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(e + h * k3))
        largest = np.maximum(largest, np.abs(e).max(axis=1))
    assert largest[0] <= found.slip_error
    assert 0.4 * float(found.slip_rate_error) <= largest[1] <= found.slip_rate_error


def _bounds_with(task, slow, slope):
    """Fixed point of the bounds for a slope κ of the input gain alone."""
    gains = varying_gain_norms([HELD.loop(task, model) for model in slow.models(task)], slow.growth)
    slip = F(0)
    for _ in range(40):
        half = (task.beta[1] - task.beta[0]) / (2 * slow.parts) + 2 * slope * slip
        spread = replace(slow.spread(task, F(0)), present=half)
        found = statement.best_bounds(task, gains, None, STEP, {}, spread)
        slip = F(f"{float(found.slip_error):.3e}") * F(1001, 1000)
    assert slip > found.slip_error
    return found


def test_a_model_of_a_part_changes_the_pressure_alone():
    loop, other = (
        HELD.loop(TASK),
        HELD.loop(TASK, NominalModel(slip=TASK.model.slip, rate=TASK.model.rate, gain=TASK.authority)),
    )
    assert other.flow[1][-1] == 1
    assert loop.flow[1][:2] == other.flow[1][:2]
    assert loop.segments == other.segments


def test_the_spread_is_asked_for_by_hand(monkeypatch):
    """Half a part 2/8 and 2κE; κr′/(eα) with four digits of 1/e from above. Without parts there is none."""
    task = replace(_task_by_hand(), slope_of_beta=F(5), reference_rate=F(7), beta=(F(1), F(3)), change=None)
    slow, asked = checker.Slow(4, F(1, 11)), []
    monkeypatch.setattr(checker, "slow_gains", lambda *_: "slow")
    loop = checker.Loop([], [], [], [], None, F(0))
    monkeypatch.setattr(checker, "loop_gains", lambda _loop, gain: ("jumping", gain))
    monkeypatch.setattr(checker, "of_class", lambda _t, _l, *given: asked.append(given) or ([F(1)] * 3, F(1, 2)))
    for given in ((slow, F(1, 13)), (slow,), ()):
        assert checker.bounds(task, loop, *given) == ([1, 1, 1], F(1, 2))
    aged = 5 * 7 * 11 * F(ceil(10**4 * exp(-1)), 10**4)
    assert asked == [("slow", (F(1, 4) + F(10, 13), aged)), ("slow", (F(1, 4), aged)), (("jumping", 2), None)]


@pytest.mark.parametrize("asked", [False, True])
@pytest.mark.parametrize("outputs", [3, 4])
@pytest.mark.parametrize("spread", [None, (F(1, 3), F(1, 5))])
def test_the_inputs_solve_what_the_outputs_make_of_them(outputs, spread, asked):
    """W = F + S·G·W in floats, for gains by hand; the fourth output is what the modes of a layer leave out.

    That counts as v does, also in what is past, and wholly in what is awaited of it and told. The last one is what is
    asked for at the valve: it counts nowhere.
    """
    task, layer = _task_by_hand(), [0] * (outputs - 3)
    inputs = 2 + (spread is not None) + 2 * len(layer)
    outputs += asked
    found = [[[F(1, 30 + 7 * k + 3 * y * y)] for y in range(outputs)] for k in range(inputs)]
    gains = np.array([[float(found[k][y][0]) for k in range(inputs)] for y in range(outputs)])
    push = spread[0] if spread else F(1)
    shares = [[1 / 2, 3 / 2, float(push), *(float(push) for _ in layer)], [0, 0, 0, *layer]]
    shares += [[0, 0, 0, 1]] * 2 if layer else []
    shares += [[0, 0, float(spread[1]), *(float(spread[1]) for _ in layer)]] if spread else []
    shares = [[*row, 0] if asked else row for row in shares]
    own = np.array([2 + 1 / 2, 3, 0, 0, 0][:inputs])
    peaks = gains @ np.linalg.solve(np.eye(inputs) - np.array(shares, float) @ gains, own)
    loop = checker.Loop([], [([], F(1))], [[]] * outputs, [[]] * 2, None, F(1), layer=F(len(layer)), asked=asked)
    bounds, _ = checker.of_class(task, loop, found, spread)
    last = outputs - asked
    expected = [*peaks[:2], sum(peaks[2:last]), *peaks[last:]]
    assert [float(v) for v in bounds] == pytest.approx(expected, rel=1e-12)
    shifted, _ = checker.of_class(replace(task, change=F(0), amplitude=F(2)), loop, found, spread)
    still, _ = checker.of_class(replace(task, change=F(0), amplitude=F(0)), loop, found, spread)
    assert all(big - small >= 2 for big, small in zip(shifted[2:], still[2:], strict=True))  # p* by φ/(βb), β ≥ 1


def _task_by_hand():
    return checker.Task(
        name="", b=F(1), s=(F(0), F(1)), w=(F(0), F(3)), beta=(F(1), F(3)), normal_stress=F(9),
        rest=(F(0), F(0)), reference_rate=F(1),
        reference_acceleration=F(0), reference_jerk=F(0), smooth=True, reference_force=F(2), drift=F(3),
        amplitude=F(1, 2), change=None, slope_of_beta=F(1), steady_beta=True,
    )  # fmt: skip
