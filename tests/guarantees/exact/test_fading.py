"""What fades after a jump, in both checkers, against closed forms: bounds above, and close where pieces are fine."""

import json
from fractions import Fraction as F
from math import exp
from pathlib import Path

import numpy as np
import pytest
from standalone_guarantee import checker

from quakedesign.guarantees.exact.guarantee_files import parse_guarantee
from quakedesign.guarantees.exact.norms import norms
from quakedesign.guarantees.exact.small_gain import bounds_from
from quakedesign.loop import Fading, PeriodicLoop, Segment

PROOFS = Path(__file__).parents[3] / "proofs"
FILE = PROOFS / "certificates" / "guarantee_real-fault.json"

FINE = tuple(F(i, 32) for i in range(33))


def gains_of_both(flow, jumps, durations, entry, row, *, first=0, height=1, rate=1, floor=0):
    """For weights height·e^{−rate·θ} + floor since the jump of the segment `first`."""
    rows = lambda table: tuple(tuple(map(F, line)) for line in table)  # noqa: E731
    parts = [
        Segment(jump=rows(jump), duration=F(time), ends=FINE, past_ends=FINE)
        for jump, time in zip(jumps, durations, strict=True)
    ]
    fading = Fading(entry=tuple(map(F, entry)), first=first, height=F(height), rate=F(rate), floor=F(floor))
    loop = PeriodicLoop(
        states=tuple(f"x{i}" for i in range(len(flow))),
        flow=rows(flow),
        segments=tuple(parts),
        inputs={},
        outputs={"y": tuple(map(F, row))},
        fading={"w": fading},
    )
    lists = [([list(line) for line in part.jump], part.duration) for part in parts]
    fade = checker.Fade(first, fading.height, fading.rate, fading.floor)
    theirs = checker.Loop(
        [list(line) for line in loop.flow], lists, [list(map(F, row))], [], None, loop.period,
        cuts=FINE, past_cuts=FINE, fade=fade,
    )  # fmt: skip
    (found,) = checker.gains(theirs, list(fading.entry), False, fade)
    return np.array(norms(loop)["y", "w"], float), np.array(found, float)


def just_above(found, exact, share=0.05):
    """Both alike, nowhere below the exact gains, and above by less than a share of the largest."""
    ours, theirs = found
    return (
        np.allclose(ours, theirs, rtol=1e-9)
        and all(exact * (1 - 1e-9) <= ours)
        and all(ours <= exact + share * max(exact))
    )


ENDS = np.arange(1, 33) / 32


@pytest.mark.parametrize(("rate", "floor"), [(1, 0), (4, 0), (1, "1/3"), (40, 0)])
def test_an_integrator_that_is_reset_adds_up_the_weight(rate, floor):
    found = gains_of_both([[0]], [[[0]]], [1], [1], [1], rate=rate, floor=floor)
    exact = (1 - np.exp(-rate * ENDS)) / rate + float(F(floor)) * ENDS
    assert just_above(found, exact, 0.13 if rate < 40 else 0.8)


def test_the_past_of_a_lag_that_is_halved_at_every_sample():
    """x′ = −x + w with w = e^{−3θ}: one period leaves ∫₀¹ e^{−(1 − θ)}e^{−3θ}dθ = (e^{−1} − e^{−3})/2, times 1/2 …"""
    found = gains_of_both([[-1]], [[["1/2"]]], [1], [1], [1], rate=3)
    before = (exp(-1) - exp(-3)) / 2 / (1 - exp(-1) / 2)
    own = lambda t: (np.exp(-t) - np.exp(-3 * t)) / 2  # noqa: E731
    starts = ENDS - 1 / 32
    exact = np.maximum(before / 2 * np.exp(-ENDS) + own(ENDS), before / 2 * np.exp(-starts) + own(starts))
    assert just_above(found, exact, 0.1)


def test_a_response_that_grows_counts_what_entered_earlier_for_more():
    """y = x1, x1′ = x2, x2′ = w: ∫(t − θ)e^{−2θ}dθ = t/2 − (1 − e^{−2t})/4, reset at every sample."""
    found = gains_of_both([[0, 1], [0, 0]], [[[0, 0], [0, 0]]], ["3/2"], [0, 1], [1, 0], rate=2)
    t = 1.5 * ENDS
    assert just_above(found, t / 2 - (1 - np.exp(-2 * t)) / 4, 0.12)


def test_a_weight_goes_on_through_the_jumps_after_its_own():
    """1 s, then the jump with which it begins, then 2 s: the weight of the first flow is that of 2 s to 3 s later."""
    found = gains_of_both([[0]], [[[1]], [["1/4"]]], [1, 2], [1], [1], first=1, rate="1/2")
    area = lambda a, b: 2 * (np.exp(-a / 2) - np.exp(-b / 2))  # noqa: E731
    before = (area(0, 2) + area(2, 3) / 4) / (1 - 1 / 4)
    first = before + area(2, 2 + ENDS)
    second = first[-1] / 4 + area(0, 2 * ENDS)
    assert just_above(found, np.concatenate([first, second]), 0.06)


def test_a_response_that_changes_sign_adds_up_its_size():
    """|sin| of the time since, by quadrature; sums of bounds of pieces are never less."""
    found = gains_of_both([[0, 1], [-1, 0]], [[[0, 0], [0, 0]]], [6], [0, 1], [1, 0], rate=1, floor="1/10")
    t = 6 * ENDS
    points = np.linspace(0, 1, 2001)
    exact = [np.trapezoid(np.abs(np.sin(s - s * points)) * (np.exp(-s * points) + 0.1), s * points) for s in t]
    assert just_above(found, np.array(exact), 0.35)


@pytest.mark.parametrize("fades", [True, False])
def test_what_is_left_out_comes_back_through_the_fault_in_both(fades, monkeypatch):
    """W = F + MW by hand in floats: half of β's range times the output left_out by itself, or within the acceleration.

    What is awaited and what the law is told of it are at most that output.
    """
    raw = json.loads(FILE.read_text())
    task, read = parse_guarantee(FILE.read_text()).task, checker.read_task(raw)
    outputs = ("slip_error", "slip_rate_error", "push", "left_out")
    table = {"acceleration": ("1/20", "2/5", 2, "1/4"), "drift": ("1/50", "1/12", "1/2", "1/9")}
    table |= {"left_out": ("1/60", "1/7", "1/3", "1/30")} if fades else {}
    table |= {"awaited": ("1/9", "1/8", "1/5", "1/11"), "awaited_told": ("1/70", "1/3", "1/40", "1/13")}
    gains = {(y, name): (F(v),) for name, row in table.items() for y, v in zip(outputs, row, strict=True)}
    ours = bounds_from(task, gains, None, F(1))
    fade = checker.Fade(0, F(1), F(1), F(0)) if fades else None
    loop = checker.Loop([], [([], F(1))], [[]] * 4, [[]] * (len(table) - 2), None, F(1), fade=fade, layer=F(1))
    monkeypatch.setattr(checker, "loop_gains", lambda *_: [[[F(v)] for v in row] for row in table.values()])
    (slip, rate, push), _ = checker.bounds(read, loop)
    assert (slip, rate, push) == (ours.slip_error, ours.slip_rate_error, ours.push)
    half = [float(task.half_ranges[y]) for y in outputs[:3]]
    shares = [[*half, 0.0 if fades else half[2]], [0.0] * 4]
    shares += [[0.0, 0.0, 0.0, v] for v in ((half[2], 1, 1) if fades else (1, 1))]
    numbers = np.array([[float(F(v)) for v in row] for row in table.values()])
    own = [float(task.reference_force + task.amplitude), float(task.drift), 0.0, 0.0, 0.0][: len(table)]
    sizes = np.linalg.solve(np.eye(len(table)) - np.array(shares) @ numbers.T, own)
    peaks = numbers.T @ sizes
    assert np.allclose([float(slip), float(rate), float(push)], [*peaks[:2], peaks[2] + peaks[3]], rtol=1e-9)


def test_what_is_awaited_fades_and_counts_at_once_and_what_is_told_is_sampled_in_both(monkeypatch):
    """Each asks its own gains for the same inputs, in the same order, and adds to that of the slip rate alone."""
    entered = []
    monkeypatch.setattr(checker, "gains", lambda *given: entered.append(given[1:]) or [[F(1)]] * 4)
    flow, rows = checker.zeros(5), checker.unit(5)
    loop = checker.Loop(
        flow, [(rows, F(1))], [rows[0], rows[1], rows[2], rows[4]], [rows[1], rows[2], rows[1]], None, F(1),
        fade=checker.Fade(0, F(1), F(1), F(0)), layer=F(3),
    )  # fmt: skip
    found = checker.loop_gains(loop, F(7))
    moved, awaited = checker.without_area(loop, F(7))
    assert entered == [
        (awaited.entry, False, awaited.fade), (awaited.told, True),
        (rows[1], False), (rows[2], False), (rows[1], False, loop.fade),
    ]  # fmt: skip
    assert [[line[0] for line in lines] for lines in found] == [[1] * 4] * 3 + [[1, 1 + awaited.at_once, 1, 1], [1] * 4]
    assert moved.events[0][0][1] == [0, 1, 0, 0, -7 * checker.area(F(3))]
    assert awaited.entry == [awaited.at_once, 0, 0, 0, 0]
