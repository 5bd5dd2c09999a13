"""What is there near a jump alone, in both checkers, against the worst of courses that are followed in floats."""

from fractions import Fraction as F

import numpy as np
import pytest
from scipy.linalg import expm
from standalone_guarantee import checker

from quakedesign.guarantees.exact.norms import norms
from quakedesign.guarantees.search.float_bounds import gains_of
from quakedesign.loop import PeriodicLoop, Pulse, Segment

FINE = tuple(F(i, 16) for i in range(17))
FLOW = ((F(0), F(1), F(0)), (F(-1, 2), F(-1), F(3, 2)), (F(0), F(0), F(-2)))
SAMPLE = ((F(1), F(0), F(0)), (F(0), F(1), F(0)), (F(-2, 3), F(-1, 2), F(1, 4)))
STILL = tuple(tuple(F(i == j) for j in range(3)) for i in range(3))
ROWS = {"first": (F(1), F(0), F(0)), "second": (F(0), F(1), F(0)), "third": (F(1, 3), F(-1), F(2))}
ENTRY = (F(0), F(1), F(1, 5))


def loop_of(pulse, jumps, durations):
    parts = [Segment(jump=j, duration=t, ends=FINE, past_ends=FINE) for j, t in zip(jumps, durations, strict=True)]
    names = ("a", "b", "c")
    return PeriodicLoop(states=names, flow=FLOW, segments=tuple(parts), inputs={}, outputs=ROWS, pulses={"w": pulse})


def theirs_of(loop, pulse):
    lists = [([list(line) for line in part.jump], part.duration) for part in loop.segments]
    rows = [list(row) for row in ROWS.values()]
    plain = checker.Loop([list(line) for line in FLOW], lists, rows, [], None, loop.period, cuts=FINE, past_cuts=FINE)
    given = checker.Pulse(pulse.first, pulse.early, pulse.late, pulse.before, pulse.after)
    return checker.gains(plain, list(pulse.entry), False, pulse=given)


def worst_course(loop, pulse, grain=200, periods=40):
    """For every output at every time of the last period: of every pulse the one place that counts most, added up.

    An impulse of the area of its side at any time of the window, before the jump or after it; those near the end, as
    far as they have been there.
    """
    flow, rows = np.array(FLOW, float), np.array([*ROWS.values()], float)
    times = np.cumsum([0, *(float(part.duration) for part in loop.segments)])
    step = times[-1] / grain
    starts = zip(times[:-1], loop.segments, strict=True)
    once, jumps = expm(flow * step), {round(t / step): np.array(part.jump, float) for t, part in starts}
    origin = round(times[pulse.first] / step)
    late, early = (round(float(v) / step) for v in (pulse.late, pulse.early))
    now, owner, best = np.zeros((3, 0)), np.zeros(0, int), np.zeros((3, grain))
    entry = np.array(pulse.entry, float)[:, None]
    for k in range(periods * grain):
        now = jumps.get(k % grain, np.eye(3)) @ now
        since = (k - origin) % grain
        if since < late:
            now, owner = np.hstack([now, float(pulse.after) * entry]), np.append(owner, k - since)
        if grain - since <= early:
            now, owner = np.hstack([now, float(pulse.before) * entry]), np.append(owner, k - since + grain)
        if k // grain == periods - 1:
            seen = np.abs(rows @ now)
            best[:, k % grain] = np.sum([seen[:, owner == one].max(axis=1) for one in set(owner)], axis=0)
        now = once @ now
    return best


TURN = ((F(1), F(0), F(0)), (F(0), F(4, 5), F(0)), (F(0), F(1, 4), F(1)))
PERIODS = {
    1: ((SAMPLE,), (F(1),)),
    2: ((SAMPLE, STILL), (F(2, 5), F(3, 5))),
    3: ((SAMPLE, STILL, TURN), (F(3, 10), F(3, 10), F(2, 5))),
}


@pytest.mark.parametrize(("events", "first"), [(1, 0), (2, 1), (3, 1), (3, 2)])
@pytest.mark.parametrize(("early", "late"), [("1/20", "1/20"), ("0", "1/8"), ("1/10", "0"), ("1/100", "1/50")])
def test_both_bound_the_worst_course_and_come_near(events, first, early, late):
    early, late = F(early), F(late)
    pulse = Pulse(entry=ENTRY, first=first, early=early, late=late, before=early, after=late * F(3, 4))
    loop = loop_of(pulse, *PERIODS[events])
    ours = np.array([norms(loop)[y, "w"] for y in ROWS], float)
    theirs = np.array([[float(v) for v in row] for row in theirs_of(loop, pulse)])
    assert np.allclose(ours, theirs, rtol=1e-6)
    seen = worst_course(loop, pulse).max(axis=1)
    assert np.all(seen <= ours.max(axis=1))
    assert np.all(ours.max(axis=1) <= (1.04 + 5 * float(max(early, late))) * seen)
    floats = gains_of(loop)
    assert np.allclose([max(floats[y, "w"]) for y in ROWS], seen, rtol=0.35)


@pytest.mark.parametrize(("events", "first"), [(2, 0), (2, 1), (3, 2)])
def test_both_bound_a_pulse_alike_in_pieces_of_different_lengths(events, first, monkeypatch):
    monkeypatch.setitem(globals(), "FINE", tuple(F(i, 128) for i in (0, 1, 6, 15, 32, 64, 106, 128)))
    pulse = Pulse(entry=ENTRY, first=first, early=F(1, 20), late=F(1, 10), before=F(1, 20), after=F(1, 12))
    loop = loop_of(pulse, *PERIODS[events])
    ours = np.array([norms(loop)[y, "w"] for y in ROWS], float)
    assert np.allclose(ours, [[float(v) for v in row] for row in theirs_of(loop, pulse)], rtol=1e-6)


@pytest.mark.parametrize("first", [0, 1])
def test_in_every_piece_both_bound_what_is_there(first):
    pulse = Pulse(entry=ENTRY, first=first, early=F(1, 10), late=F(1, 10), before=F(1, 10), after=F(1, 10))
    loop = loop_of(pulse, (SAMPLE, STILL), (F(1, 2), F(1, 2))) if first else loop_of(pulse, (SAMPLE,), (F(1),))
    seen = worst_course(loop, pulse, grain=160)
    pieces = 16 * len(loop.segments)
    each = seen.reshape(3, pieces, 160 // pieces).max(axis=2)
    for found in (
        np.array([norms(loop)[y, "w"] for y in ROWS], float),
        np.array([[float(v) for v in row] for row in theirs_of(loop, pulse)]),
    ):
        assert np.all(each <= found * (1 + 1e-12))


@pytest.mark.parametrize("asked", [False, True])
def test_the_steady_pressure_moves_on_while_another_pressure_is_at_the_valve(asked, monkeypatch):
    """In the checker: the drift of A + R more in the output at the valve, where what is late enters as well."""
    entered = []
    monkeypatch.setattr(checker, "gains", lambda *given, pulse=None: entered.append((given[1:], pulse)) or ones())
    ones = lambda: [[F(1)] for _ in range(4 + asked)]  # noqa: E731
    flow, pulse = [[F(0)] * 4 for _ in range(4)], checker.Pulse(0, F(1, 9), F(1, 7), F(1, 9), F(1, 8))
    flow[2][2] = F(-5)
    loop = checker.Loop(flow, [(checker.unit(4), F(1))], [[F(0)] * 4] * (4 + asked), [[F(1)]] * 3, None, F(1))
    loop = checker.replace(loop, asked=asked, stepped=True, pulse=pulse)
    found = [[line[0] for line in lines] for lines in checker.loop_gains(loop, F(3))]
    at = 3 if asked else 2
    assert found == [[1] * len(ones()), [1 + (i == at) * F(1, 7) for i in range(len(ones()))], *[[1] * len(ones())] * 2]
    assert entered[-1] == (([F(0), F(0), F(5), F(0)] if asked else [F(0), F(3), F(0), F(0)], False), pulse)
    assert [other for _, other in entered[:-1]] == [None] * 3
