"""The upper sums of FORMAT.md in floats, term by term, and what both checkers find for the same loops."""

from dataclasses import dataclass
from fractions import Fraction as F
from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm
from standalone_guarantee import checker

from quakedesign.guarantees.exact.norms import norms
from quakedesign.loop import Fading, PeriodicLoop, Segment

FLOW = ((F(-1), F(2), F(0)), (F(-2), F(-3), F(1)), (F(0), F(1, 2), F(1, 4)))
JUMPS = (
    ((F(1), F(0), F(1, 4)), (F(0), F(1), F(0)), (F(1, 5), F(-1, 3), F(1, 2))),
    ((F(1, 2), F(1, 4), F(0)), (F(0), F(1), F(1)), (F(1, 3), F(0), F(-1, 2))),
    ((F(1), F(0), F(0)), (F(1, 6), F(3, 4), F(0)), (F(0), F(-1, 4), F(1))),
)
TIMES = (F(1, 2), F(2), F(5, 4))
CUTS, PAST_CUTS = (F(0), F(1, 5), F(1, 2), F(1)), (F(0), F(1, 3), F(1))
ENTRY = (F(1), F(0), F(-2))
OUTPUTS = ((F(1), F(0), F(2)), (F(0), F(-3), F(1)))
HEIGHT, RATE, FLOOR = F(5, 4), F(3, 2), F(1, 8)


@dataclass
class Sums:
    """A loop and an input, which flows, comes with the first jump alone (`sudden`) or fades after the jump `first`."""

    count: int
    sudden: bool = False
    first: int | None = None

    def __post_init__(self):
        self.a, self.b = np.array(FLOW, float), np.array(ENTRY, float)
        self.major = np.abs(self.a)
        np.fill_diagonal(self.major, np.maximum(np.diag(self.a), 0))
        self.jumps, self.times = np.array(JUMPS, float), [float(time) for time in TIMES]

    def over(self, time):
        return expm(self.a * time)

    def most(self, vector, time):
        """Of |e^{Aσ}x| up to this time."""
        return expm(self.major * time) @ np.abs(vector)

    def whole(self, segment):
        return self.over(self.times[segment]) @ self.jumps[segment]

    def weight(self, segment, start, length):
        """Ω and Ω′ of a piece, from the sum that is below e^x."""
        turns = (segment - self.first) % self.count
        age = sum(self.times[(self.first + i) % self.count] for i in range(turns)) + start
        x = float(RATE) * age
        height = float(HEIGHT) / (1 + x + x**2 / 2 + x**3 / 6 + x**4 / 24)
        floor, rate = float(FLOOR), float(RATE)
        moment = height * min(1 / rate**2, length**2 / 2) + floor * length**2 / 2
        return height * min(1 / rate, length) + floor * length, moment

    def left(self, segment):
        """Columns at the end of a segment of what entered in it, and their remainder."""
        time = self.times[segment]
        ends = [float(cut) * time for cut in PAST_CUTS]
        zero = np.zeros(len(self.b))
        if self.sudden:
            return [zero if segment else self.over(time) @ self.b], zero
        columns, rest = [], zero
        for start, end in pairwise(ends):
            h = end - start
            if self.first is None:
                columns += [self.over(t) @ self.b * h / 2 for t in (start, end)]
                rest = rest + h**3 / 12 * self.most(self.a @ self.a @ self.over(start) @ self.b, h)
            else:
                mass, moment = self.weight(segment, start, h)
                columns.append(mass * self.over(time - start) @ self.b)
                rest = rest + moment * self.most(self.a @ self.over(time - end) @ self.b, h)
        return columns, rest

    def rows_of(self, row, columns, rest):
        return sum(abs(row @ column) for column in columns) + np.abs(row) @ rest

    def period(self):
        """Map of one period, columns of all that entered in it, remainders."""
        size = len(self.b)
        later, columns, rest = np.eye(size), [], np.zeros(size)
        for segment in reversed(range(self.count)):
            own, remainder = self.left(segment)
            columns += [later @ column for column in own]
            rest, later = rest + np.abs(later) @ remainder, later @ self.whole(segment)
        return later, columns, rest

    def seen(self, period, columns, rest):
        """Unit rows but for what is left after 2^12 periods, in place of the one that counts most, and its number."""
        left = period
        for _ in range(12):
            left = left @ left
            left = left / np.abs(left).max()
        row = left[np.abs(left).max(axis=1).argmax()]
        place = np.argmax(np.abs(row) * [self.rows_of(unit, columns, rest) for unit in np.eye(len(row))])
        found = np.eye(len(row))
        found[place] = row / row[place]
        return found, place

    def past(self, row):
        """All earlier periods: 2, 4, 8 … of them until the 1024th part is left but for the slowest mode."""
        period, columns, rest = self.period()
        seen, place = self.seen(period, columns, rest)
        sums = lambda line, count: sum(  # noqa: E731
            self.rows_of(line @ np.linalg.matrix_power(period, k), columns, rest) for k in range(count)
        )
        count = 2
        while True:
            units = np.array([sums(line, count) for line in seen])
            far = np.linalg.matrix_power(period, count) @ np.linalg.inv(seen)
            left = np.abs(seen @ far)
            if (np.delete(left, place, axis=1) @ np.delete(units, place) <= units / 1024).all():
                return sums(row, count) + np.abs(row @ far) @ np.linalg.solve(np.eye(len(left)) - left, units)
            count *= 2

    def before(self, row, segment):
        """What entered before the jump of a segment, for a row that acts there."""
        total = 0.0
        for earlier in reversed(range(segment)):
            total += self.rows_of(row, *self.left(earlier))
            row = row @ self.whole(earlier)
        return total + self.past(row)

    def since(self, row, segment, number):
        """What entered since the jump: bounds at both ends of a piece, and what is more."""
        ends = [float(cut) * self.times[segment] for cut in CUTS]
        start, end = ends[number : number + 2]
        h, b, c = end - start, self.b, np.abs(row)
        seen = lambda t: abs(row @ self.over(t) @ b)  # noqa: E731
        bent = lambda t, h: c @ self.most(self.a @ self.a @ self.over(t) @ b, h)  # noqa: E731
        if self.sudden:
            return (0.0, 0.0, 0.0) if segment else (seen(start), seen(end), h**2 / 8 * bent(start, h))
        if self.first is None:
            pieces = list(pairwise(ends[: number + 2]))
            areas = [(seen(s) + seen(e)) * (e - s) / 2 + (e - s) ** 3 / 12 * bent(s, e - s) for s, e in pieces]
            slope = c @ self.most(self.a @ self.over(start) @ b, h)
            return sum(areas[:-1]), sum(areas), h**2 / 8 * slope
        first = last = 0.0
        more = self.weight(segment, start, h)[0] * (max(seen(0), seen(h)) + h**2 / 8 * bent(0, h))
        for s, e in pairwise(ends[: number + 1]):
            mass, moment = self.weight(segment, s, e - s)
            first, last = first + mass * seen(start - s), last + mass * seen(end - s)
            steep = self.most(self.most(self.a @ self.over(start - e) @ b, h), e - s)
            more += mass * h**2 / 8 * bent(start - s, h) + moment * c @ steep
        return first, last, more

    def gains(self, row):
        found = []
        for segment in range(self.count):
            jump = self.jumps[segment]
            units = np.array([self.before(line, segment) for line in jump])
            for number, (a, b) in enumerate(pairwise(float(cut) * self.times[segment] for cut in CUTS)):
                first, last, more = self.since(row, segment, number)
                at = [self.before(row @ self.over(t) @ jump, segment) for t in (a, b)]
                bent = self.most(units, b - a) @ np.abs(row @ self.over(a) @ self.a @ self.a)
                found.append(max(at[0] + first, at[1] + last) + more + (b - a) ** 2 / 8 * bent)
        return found


CASES = {
    "flowing": Sums(2),
    "flowing, one flow": Sums(1),
    "sudden": Sums(3, sudden=True),
    "fading": Sums(1, first=0),
    "fading after the second": Sums(2, first=1),
    "fading after the second of three": Sums(3, first=1),
    "fading after the last of three": Sums(3, first=2),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_both_checkers_add_up_what_is_written(case):
    jumps, times = JUMPS[: case.count], TIMES[: case.count]
    fading = (
        {}
        if case.first is None
        else {"w": Fading(entry=ENTRY, first=case.first, height=HEIGHT, rate=RATE, floor=FLOOR)}
    )
    flowing = not case.sudden and not fading
    ours = norms(
        PeriodicLoop(
            states=("x", "y", "z"),
            flow=FLOW,
            segments=tuple(
                Segment(jump=jump, duration=time, ends=CUTS, past_ends=PAST_CUTS)
                for jump, time in zip(jumps, times, strict=True)
            ),
            inputs={"w": ENTRY} if flowing else {},
            outputs=dict(zip("pq", OUTPUTS, strict=True)),
            sampled={"w": ENTRY} if case.sudden else {},
            fading=fading,
        )
    )
    fade = checker.Fade(case.first, HEIGHT, RATE, FLOOR) if fading else None
    lists = lambda rows: [list(line) for line in rows]  # noqa: E731
    loop = checker.Loop(
        lists(FLOW), [(lists(jump), time) for jump, time in zip(jumps, times, strict=True)], lists(OUTPUTS), [], None,
        F(0), cuts=CUTS, past_cuts=PAST_CUTS, fade=fade,
    )  # fmt: skip
    theirs = checker.gains(loop, list(ENTRY), case.sudden, fade)
    for name, row, found in zip("pq", OUTPUTS, theirs, strict=True):
        written = case.gains(np.array(row, float))
        assert np.allclose(np.array(found, float), written, rtol=1e-9, atol=0)
        assert np.allclose(np.array(ours[name, "w"], float), written, rtol=1e-9, atol=0)


def flows_of(entry, fade=None):
    """One flow of a chain and, apart from it, a state that drives another one."""
    chain = [[F(j in (i, i + 1) and i != 2) for j in range(5)] for i in range(5)]
    loop = checker.Loop(chain, [(checker.unit(5), F(1))], [], [], None, F(1))
    (flow,) = checker.cut(loop, CUTS, list(map(F, entry)), False, fade)
    return flow


@pytest.mark.parametrize(("entry", "moved"), [((0, 0, 1, 0, 0), {0, 1}), ((0, 0, 0, 0, 1), {3, 4}), ((0,) * 5, set())])
def test_only_what_the_flow_moves_has_a_remainder(entry, moved):
    """Columns are work: one for every end of a piece, and one for every such state."""
    flow = flows_of(entry)
    assert flow.moved == moved
    assert len(checker.pieces(flow, None).rows[0]) == len(CUTS) + len(moved)


@pytest.mark.parametrize("fade", [None, checker.Fade(0, HEIGHT, RATE, FLOOR)])
def test_nothing_has_passed_before_the_first_piece(fade):
    first, *_ = checker.since_event(flows_of((0, 0, 1, 0, 0), fade), checker.fixed(checker.unit(5)))
    assert first[0] == [0] * 5
    assert not fade or first[1] == [0] * 5
