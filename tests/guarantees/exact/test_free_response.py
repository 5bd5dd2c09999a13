"""Starts away from rest: free responses against closed forms, in both checkers; files, forgeries, refusals."""

import copy
import json
from dataclasses import replace
from fractions import Fraction as F
from functools import cache
from math import exp, sqrt
from pathlib import Path

import numpy as np
import pytest
from flint import arb
from scipy.linalg import expm
from standalone_guarantee import checker

from quakedesign.errors import CertificateError, ParameterError
from quakedesign.guarantees import SampledLoop, TrackingProof, guarantee
from quakedesign.guarantees.exact.guarantee_files import guarantee_text, parse_guarantee
from quakedesign.guarantees.exact.norms import free_peaks, norms
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search.lqg import THROUGH_PATH, family_of
from quakedesign.laws import ImplicitStep, Power, compensated
from quakedesign.loop import PeriodicLoop, Segment
from quakedesign.lyapunov.exact.claim import Verdict

PROOFS = Path(__file__).parents[3] / "proofs" / "certificates"


def peaks(flow, jumps, durations, starts, row):
    """Bounds in every part of the period, of both checkers, which agree."""
    rows = lambda table: tuple(tuple(map(F, line)) for line in table)  # noqa: E731
    parts = zip(map(rows, jumps), map(F, durations), strict=True)
    loop = PeriodicLoop(
        states=tuple(f"x{i}" for i in range(len(flow))),
        flow=rows(flow),
        segments=tuple(Segment(jump=jump, duration=time) for jump, time in parts),
        inputs={},
        outputs={"y": tuple(map(F, row))},
        start=rows(starts),
    )
    ours = np.array(norms(loop)["y", "start"], float)
    events = [([list(line) for line in part.jump], part.duration) for part in loop.segments]
    flows, outputs = [list(line) for line in loop.flow], [list(loop.outputs["y"])]
    theirs = checker.Loop(flows, events, outputs, [], None, loop.period, start=[list(s) for s in loop.start])
    (found,) = checker.start_gains(theirs)
    assert np.allclose(ours, np.array(found, float), rtol=1e-9, atol=1e-25)
    return ours


def just_above(found, exact, share=2e-3):
    exact = np.array(exact)
    return bool(np.all(exact * (1 - 1e-12) <= found) and np.all(found <= exact * (1 + share)))


def test_a_lag_that_is_halved_at_every_sample_is_largest_in_its_first_period():
    ends = np.arange(8) / 16
    assert just_above(peaks([[-1]], [[["1/2"]]], ["1/2"], [[3]], [1]), 1.5 * np.exp(-ends))


def test_an_output_that_grows_first_is_found_where_it_is_largest():
    """x → qx, y → x + qy, q = 0.9: k·q^(k−1) is largest at k = 9 and 10."""
    found = peaks([[0, 0], [0, 0]], [[["9/10", 0], [1, "9/10"]]], [1], [[1, 0]], [0, 1])
    assert just_above(found, [9 * 0.9**8] * 8)


def test_what_the_slowest_mode_does_much_later_counts():
    """x → qx, y → (1 − q)x + y/2, q = 1 − 2⁻¹⁵: (1 − q)(qᵏ − 2⁻ᵏ)/(q − 1/2) is largest after some periods."""
    q = 1 - 2.0**-15
    found = peaks([[0, 0], [0, 0]], [[["32767/32768", 0], ["1/32768", "1/2"]]], [1], [[1, 0]], [0, 1])
    assert just_above(found, [max((1 - q) * (q**k - 0.5**k) / (q - 0.5) for k in range(64))] * 8, share=1e-5)


def test_what_comes_after_all_periods_that_are_looked_at_counts():
    """x → qx, y → (1 − q)x + ry, q = 1 − 2⁻³⁰, r = 3/5: largest after forty periods, when thirty-two are looked at."""
    q, r = F(2**30 - 1, 2**30), F(3, 5)
    found = peaks([[0, 0], [0, 0]], [[[q, 0], [1 - q, r]]], [1], [[1, 0]], [0, 1])
    exact = [(1 - q) * (q**k - r**k) / (q - r) for k in range(64)]
    assert max(exact[:33]) < max(exact) * (1 - F(1, 10**8))
    assert just_above(found, [float(max(exact))] * 8, share=1e-4)


@pytest.mark.parametrize(("grows", "falls"), [("2", "1/2"), ("1/2", "2"), ("1000001/1000000", "1/2")])
def test_modes_that_do_not_all_fall_leave_nothing_bounded(monkeypatch, grows, falls):
    """Both checkers, asked without what asks for stability before them."""
    jump = tuple(tuple(map(F, line)) for line in ((grows, 0), (0, falls)))
    flow, start = ((F(0),) * 2,) * 2, ((F(1), F(0)), (F(0), F(1)))
    part = Segment(jump=jump, duration=F(1))
    loop = PeriodicLoop(
        states=("x", "y"), flow=flow, segments=(part,), inputs={}, outputs={"y": (F(0), F(1))}, start=start
    )
    rows = lambda table: [list(line) for line in table]  # noqa: E731
    theirs = checker.Loop(rows(flow), [(rows(jump), F(1))], [[F(0), F(1)]], [], None, F(1), start=rows(start))
    for seen in (None, [arb(1), arb(0)]):  # and without its floats, which look for the slowest mode
        if seen:
            monkeypatch.setattr("quakedesign.guarantees.exact.norms.slowest", lambda _, seen=seen: seen)
        with pytest.raises(ParameterError, match="stable"):
            free_peaks(loop)
    with pytest.raises(checker.Refused, match="must be stable"):
        checker.start_gains(theirs)


def test_sums_of_the_standalone_checker_are_rounded_up():
    one = 1 << checker.BITS
    assert checker.sums([3, one - 1, 5, 7], [one // 2, 1]) == [3, 3]  # 5/2 less a little, and more


def two_halves():
    """Two states without flow that are halved at every sample, from 1 and 1/4."""
    half = [[F(1, 2), F(0)], [F(0), F(1, 2)]]
    return checker.Loop(
        [[F(0)] * 2] * 2, [(half, F(1))], [[F(1), F(0)]], [], None, F(1), start=[[F(1), F(0)], [F(0), F(1, 4)]]
    )


def test_later_periods_are_bounded_by_what_was_seen_raised_by_a_trifle_of_the_largest():
    loop = two_halves()
    flows = checker.cut(loop, loop.cuts, [F(0)] * 2, False)
    columns = checker.fixed([[F(1), F(0)], [F(0), F(1, 4)]])
    *_, most = checker.followed(flows, columns, 1)
    one = 1 << checker.BITS
    for found, seen in zip(most, (one, one // 4), strict=True):
        assert 0 <= found - seen - (one >> 60) < 2000  # errors of products, in units of 2^-192


def test_a_start_that_takes_too_much_work_is_refused(monkeypatch):
    assert checker.start_gains(two_halves())
    monkeypatch.setattr(checker, "MAX_WORK", 47)  # the first of twelve doublings needs 2·4·2·(2 + 9)
    with pytest.raises(checker.Refused, match="takes too long"):
        checker.start_gains(two_halves())


def test_a_box_counts_all_of_its_corners():
    """An integrator of an integrator, reset after a period: |x1| + θ|x2|, worst where their signs agree."""
    found = peaks([[0, 1], [0, 0]], [[[1, 0], [0, 1]], [[0, 0], [0, 0]]], [2, 1], [[3, 0], [0, -5]], [1, 0])
    assert just_above(found[:8], 3 + 5 * np.arange(1, 9) / 4)
    assert np.allclose(found[8:], 0, atol=1e-30)
    joined = peaks([[0, 1], [0, 0]], [[[1, 0], [0, 1]], [[0, 0], [0, 0]]], [2, 1], [[3, -5]], [1, 0])
    assert just_above(joined[:8], np.maximum(abs(3 - 5 * np.arange(8) / 4), abs(3 - 5 * np.arange(1, 9) / 4)))


def test_a_damped_swing_is_bounded_between_the_ends_of_pieces():
    """y″ + y′/10 + y = 0 from y′ = 1 has its largest value exp(−ζφ/√(1 − ζ²)), φ = arccos ζ, between two ends."""
    zeta = 1 / 20
    exact = exp(-zeta * np.arccos(zeta) / sqrt(1 - zeta**2))
    found = peaks([[0, 1], [-1, "-1/10"]], [[[1, 0], [0, 1]]], [2], [[0, 1]], [1, 0])
    assert exact <= max(found) <= 1.02 * exact


@pytest.mark.parametrize("factor", ["1", "11/10"])
def test_a_start_that_stays_or_grows_has_no_bound(factor):
    with pytest.raises(ParameterError, match="stable"):
        peaks([[0]], [[[factor]]], [1], [[1]], [1])
    theirs = checker.Loop([[F(0)]], [([[F(factor)]], F(1))], [[F(1)]], [], None, F(1), start=[[F(1)]])
    with pytest.raises(checker.Refused, match="stable"):
        checker.start_gains(theirs)


@cache
def stored(name="real-fault"):
    return parse_guarantee((PROOFS / f"guarantee_{name}.json").read_text())


@cache
def started(name="real-fault", slip="1e-5", rate="4e-5", slow=False):
    known = stored(name)
    held = replace(known.sampled_loop, initial_slip=F(slip), initial_slip_rate=F(rate))
    return guarantee(known.task, held, known.varying_gain if slow else None)


def exact_course(held, model, authority, error, count):
    """Errors and b·p of the nominal loop at 24 times in each of so many periods, from matrix exponentials, by hand."""
    law, gain, parts = held.law, float(model.gain), 24
    rows = lambda table: np.array(table, dtype=float)  # noqa: E731
    update, measured, output, feedback = map(rows, (law.update, law.measured, law.output, law.feedback))
    flow = np.array([[0, 1, 0], [float(model.slip), -float(model.rate), gain], [0, 0, 0]])
    step, z, e, seen = expm(flow * float(held.step) / parts), np.zeros(len(law.states)), np.array(error), []
    for _ in range(count):
        p, z = output @ z + feedback @ e, update @ z + measured @ e
        seen.append([*e, float(authority) * p])
        for _ in range(parts):
            e = (step @ [*e, p])[:2]
            seen.append([*e, float(authority) * p])
    return np.array(seen)


def test_without_disturbance_and_ranges_the_claims_are_the_peaks_of_the_free_response():
    """Friction without slopes or range, a task of a length of 1e-30 m: nothing is left but the start."""
    known = stored()
    friction = replace(known.task.friction, weakening=F(0), static=F("0.25"), least=F("0.25"), largest=F("0.25"))
    still = replace(known.task, friction=friction, amplitude=F(0), growths=(F(0), F(0)), target_slip=F(1, 10**30))
    held = replace(known.sampled_loop, initial_slip=F("1e-5"), initial_slip_rate=F("4e-5"))
    found = guarantee(still, held)
    ways = [np.array([1e-5, 4e-5]), np.array([1e-5, -4e-5])]
    seen = np.max([abs(exact_course(held, still.model, still.authority, e, 60)) for e in ways], axis=(0, 1))
    claimed = np.array(
        [found.claims.slip_error, found.claims.slip_rate_error, found.theorem_bounds().push], dtype=float
    )
    assert np.all(seen <= claimed)
    assert np.all(claimed <= 1.004 * seen)
    half = guarantee(still, replace(held, initial_slip=F("0.5e-5"), initial_slip_rate=F("2e-5")))
    assert float(half.theorem_bounds().slip_error) == pytest.approx(
        float(found.theorem_bounds().slip_error) / 2, rel=1e-12
    )


def test_a_larger_start_is_guaranteed_less_and_none_is_rest():
    known = stored()
    rest = guarantee(known.task, known.sampled_loop)
    near, far = started(), started(slip="2e-5", rate="8e-5")
    for name in ("slip_error", "slip_rate_error", "peak_slip_rate", "largest_pressure"):
        assert getattr(rest.claims, name) < getattr(near.claims, name) < getattr(far.claims, name)
    assert near.claims.least_pressure < rest.claims.least_pressure
    assert near.theorem_bounds().small_gain == pytest.approx(float(rest.theorem_bounds().small_gain), rel=1e-3)
    assert rest.sentence().startswith("on the plant without stick, from rest, with zero-order hold over")
    assert near.sentence().startswith(
        "on the plant without stick, from every initial state within 1e-05 m and 4e-05 m/s of rest, with zero"
    )


@pytest.mark.parametrize(("name", "slow"), [("real-fault", True), ("late_real-fault", False)])
def test_both_checkers_prove_the_file_and_say_from_where(name, slow):
    claim = started(name, slow=slow)
    text = guarantee_text(claim)
    assert parse_guarantee(text) == claim
    assert claim.check() is Verdict.PROVED
    assert "from initial |slip| <= 1e-05 m, |slip rate| <= 4e-05 m/s, along" in checker.verify(json.loads(text))[3]


def document():
    return json.loads(guarantee_text(started()))


def with_entry(raw, place, value):
    found = copy.deepcopy(raw)
    *path, last = place
    inner = found
    for key in path:
        inner = inner[key]
    inner[last] = value
    return found


FORGED = [
    (("start", "slip"), "11/1000000"),
    (("start", "rate"), "44/1000000"),
    (("claims", "slip_error"), F(99, 100)),
    (("claims", "slip_rate_error"), F(99, 100)),
    (("claims", "least_pressure"), F(99, 100)),
]


@pytest.mark.parametrize(("place", "value"), FORGED)
def test_a_larger_box_or_a_smaller_claim_does_not_follow(place, value):
    value = str(F(value) * F(document()["claims"][place[1]])) if place[0] == "claims" else str(F(value))
    raw = with_entry(document(), place, value)
    with pytest.raises(checker.Refused, match=r"must follow|must stay below"):
        checker.verify(raw)
    assert parse_guarantee(json.dumps(raw)).check() is Verdict.UNDECIDED


NEEDED = {"slip": "1/100000", "rate": "0"}
CONTINUOUS = {"states": ["z"], "rates": [["0"]], "measured": [["1", "0"]], "output": ["1"], "feedback": ["-5", "-5"]}
BROKEN = [
    (("start",), {"slip": "0", "rate": "0"}),
    (("start",), {"slip": "-1/100000", "rate": "1/10"}),
    (("start",), {"slip": "1/100000"}),
    (("start",), {**NEEDED, "law": "1"}),
    (("start",), [*NEEDED.values()]),
    (("start",), None),
    (("start", "rate"), 0),
    (("start", "rate"), "1e-5"),
    (("loop",), CONTINUOUS),
    (("loop", "first"), [["0", "1"]]),
    (("loop", "first"), [["0"], ["0"]]),
    (("loop", "first"), "0"),
    (("loop", "first"), [["0", "1"], ["0", 1]]),
]


@pytest.mark.parametrize(("place", "value"), BROKEN)
def test_what_is_no_start_is_refused_by_both(place, value):
    raw = with_entry(document(), place, value)
    with pytest.raises(checker.Refused):
        checker.verify(raw)
    with pytest.raises(CertificateError):
        parse_guarantee(json.dumps(raw))


def test_what_the_law_makes_at_first_of_the_errors_counts():
    """A law that begins with the slip rate it is told is not kicked by it; the claims of one do not serve the other."""
    raw = document()
    told = with_entry(raw, ("loop", "first"), [["0", "100"], ["0", "0"]])
    assert parse_guarantee(json.dumps(told)).sampled_loop.law.first == ((F(0), F(100)), (F(0), F(0)))
    with pytest.raises(checker.Refused, match=r"must follow|must stay below"):
        checker.verify(told)
    assert parse_guarantee(json.dumps(told)).check() is Verdict.UNDECIDED
    at_rest = with_entry({k: v for k, v in raw.items() if k != "start"}, ("loop", "first"), told["loop"]["first"])
    checker.verify(at_rest)
    assert parse_guarantee(json.dumps(at_rest)).check() is Verdict.PROVED


def test_an_implicit_step_begins_with_the_slip_rate_that_it_is_told_noise_included():
    pull = (Power(factor=(F(1), F(1)), exponent=F(0), argument="slip"),)
    law = compensated(ImplicitStep(pull=pull), F("0.3"), F("4e-9"))
    assert law.first == ((F(0), F(1)), (F(0), F(0)), (F(0), F(0)))
    cta = stored("cta_real-fault")
    held = replace(cta.sampled_loop, law=replace(cta.sampled_loop.law, first=law.first), rate_noise=F("1e-6"))
    assert held.loop(cta.task).start == ((F(0), F(0), F("1e-6"), *[F(0)] * 3),)
    noisy = guarantee(cta.task, held)
    assert (
        checker.verify(json.loads(guarantee_text(noisy)))[3].split("; ")[1]
        == "from rest, along the reference, for all t >= 0"
    )


@pytest.mark.parametrize("bound", ["initial_slip", "initial_slip_rate"])
def test_a_bound_has_no_sign(bound):
    with pytest.raises(ParameterError, match="bounds of the initial slip and slip rate errors must be 0 or more"):
        replace(stored().sampled_loop, **{bound: F(-1)})


def followed(loop, periods):
    """Largest outputs from the corners of a box, at 24 times in every flow, by matrix exponentials in floats."""
    flow, rows = np.array(loop.flow, dtype=float), np.array([*loop.outputs.values()], dtype=float)
    first, second = np.array(loop.start, dtype=float)
    now, largest = np.array([first + second, first - second]).T, np.zeros(len(rows))
    parts = [(np.array(part.jump, dtype=float), expm(flow * float(part.duration) / 24)) for part in loop.segments]
    for jump, step in parts * periods:
        now = jump @ now
        for _ in range(24):
            largest = np.maximum(largest, abs(rows @ now).max(axis=1))
            now = step @ now
    return largest


@pytest.mark.parametrize("around", [{"lag": F("0.1")}, {"delay": F("0.02")}])
def test_through_rock_and_late_both_bound_what_is_seen_of_the_free_response(around):
    task, step, around = stored().task, F("0.05"), {"diffusion": F(1), **around}
    law = family_of(task, step, "slip-and-rate", ExactSetup(**around)).law(np.array(THROUGH_PATH[0]))
    held = SampledLoop(law=law, step=step, initial_slip=F("1e-5"), initial_slip_rate=F("4e-5"), **around)
    loop = held.loop(task)
    raw = json.loads(guarantee_text(TrackingProof(task=task, sampled_loop=held, claims=stored().claims)))
    plain = checker.read_loop(raw["loop"], checker.read_task(raw), held.initial_errors)
    theirs = checker.start_gains(checker.without_area(plain, sum(task.beta) / 2)[0])
    ours = [max(peaks) for peaks in free_peaks(loop).values()]
    assert np.allclose(np.array(ours, float), [float(max(peaks)) for peaks in theirs], rtol=1e-9)
    seen = followed(loop, 160)
    assert np.all(seen * (1 - 1e-12) <= np.array(ours, float))
    assert np.all(np.array(ours, float) <= 1.02 * seen)
