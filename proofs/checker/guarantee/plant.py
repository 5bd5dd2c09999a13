"""Verify certificate files of the kind ``uncertain_plant`` (FORMAT.md) with the Python standard library alone.

A linear plant with sectors, loads and disturbances under a sampled linear law of several signals. A checker forms the
loop and upper sums of its impulse responses, all inputs at once, and the numbers of the file must satisfy the
small-gain condition.
"""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any

from .matrices import BITS, Fixed, exponential, fixed, unit
from .reading import Row, entries, keys, lower, matrix, need, number, row, upper

MOST, MOST_LAW, MOST_LOOP, MOST_PIECES, MOST_PERIODS = 40, 48, 96, 64, 8
AT_ONCE, LEFT, FAINT = (8, 256), 1024, 60  # periods in columns; 1/LEFT may remain; raised by max*2^-FAINT
MOST_WORK = 12 * 10**8
BEYOND = 64  # times MOST_WORK: work of the periods within which powers of the map must become small
SWEEPS = 8  # of the choice of units
COARSE, PLACE, HALF = 58, 128, 64  # bits of entries that are multiplied at once, and of the places of their products


@dataclass
class Sector:
    """phi(y, t) between low*y and high*y, y a row over states and controls; for |y| <= `within` only, if given."""

    entry: Row
    line: Row
    low: Fraction
    high: Fraction
    within: Fraction | None


@dataclass
class Plant:
    """The plant as the file states it."""

    A: list[Row]
    B: list[Row]
    C: list[Row]
    disturbances: list[tuple[Row, Fraction]]
    loads: list[tuple[Row, Row, Fraction]]
    sectors: list[Sector]
    noise: Row
    start: Row
    outputs: list[Row]


@dataclass
class Law:
    """The law as the file states it."""

    step: Fraction
    delay: Fraction
    A: list[Row]
    B: list[Row]
    C: list[Row]
    D: list[Row]


@dataclass
class Loop:
    """Flow, jumps with the times that follow, columns of inputs, noise and initial conditions, bounded rows."""

    flow: list[Row]
    segments: list[tuple[list[Row], Fraction]]
    inputs: list[Row]
    told: list[Row]
    start: list[Row]
    rows: list[Row]


def verify(document: dict[str, Any]) -> list[str]:
    """Verify the claims of a parsed file; the statement, line by line.

    Raises
    ------
    Refused
        When a rule is broken, or a claim does not follow.
    """
    keys(document, "the file", "format", "kind", "plant", "law", "pieces", "inputs", "claims")
    plant = read_plant(document["plant"])
    law = read_law(document["law"], len(plant.C), len(plant.B[0]))
    pieces = document["pieces"]
    need(type(pieces) is int and 1 <= pieces <= MOST_PIECES, f"pieces must be 1 to {MOST_PIECES}")
    names = [f"output_{i + 1}" for i in range(len(plant.outputs))]
    names += [f"control_{i + 1}" for i in range(len(plant.B[0]))]
    keys(document["claims"], "claims", *names)
    claims = [number(document["claims"][name], name) for name in names]
    numbers = row(document["inputs"], "inputs", len(plant.sectors))
    bounds = rows_of(plant, responses(loop_of(plant, law), pieces), numbers)
    count = len(plant.outputs)
    for sector, bound, most in zip(plant.sectors, bounds[count:], numbers, strict=False):
        half = (sector.high - sector.low) / 2
        need(not half or half * bound < most, "the inputs of the sectors must satisfy the small-gain condition")
        need(sector.within is None or bound < sector.within, "an argument must stay within the bound of its sector")
    found = bounds[:count] + bounds[count + len(plant.sectors) :]
    need(all(a <= b for a, b in zip(found, claims, strict=True)), "the claims must follow from the rest")
    return [*statement(plant, law, names, claims), *entries(document)]


def statement(plant: Plant, law: Law, names: list[str], claims: Row) -> list[str]:
    """What was verified, in ASCII; all entries of the file follow it."""
    where = "from |x_i| <= start_i" if any(plant.start) else "from rest"
    sizes = ", ".join(lower(size) for _, size in plant.disturbances) or "none"
    return [
        f"plant with {len(plant.A)} states, {len(plant.B[0])} controls, {len(plant.sectors)} sectors, "
        f"{len(plant.loads)} loads; law with {len(law.A)} states, every {law.step} s, {law.delay} s late",
        f"disturbances of at most {sizes}; {where}, for all t >= 0",
        ", ".join(f"|{name}| <= {upper(bound)}" for name, bound in zip(names, claims, strict=True)),
    ]


def listed(value: Any, where: str) -> list[Any]:
    """A list of bounded length."""
    need(type(value) is list and len(value) <= MOST, f"{where} must be a list of at most {MOST}")
    return value  # type: ignore[no-any-return]


def table(value: Any, where: str, width: int) -> list[Row]:
    """A matrix of at most MOST rows."""
    need(type(value) is list and len(value) <= MOST, f"{where} must have at most {MOST} rows")
    return matrix(value, where, len(value), width)


def read_plant(value: Any) -> Plant:
    """Read the plant."""
    parts = ("A", "B", "C", "disturbances", "loads", "sectors", "noise", "start", "outputs")
    given = keys(value, "plant", *parts)
    need(type(given["A"]) is list and 1 <= len(given["A"]) <= MOST, f"A must have 1 to {MOST} rows")
    n = len(given["A"])
    need(
        type(given["B"]) is list and len(given["B"]) == n and type(given["B"][0]) is list,
        "B must have one row per state",
    )
    m = len(given["B"][0])
    need(1 <= m <= MOST, f"B must have 1 to {MOST} columns")
    C = table(given["C"], "C", n)
    disturbances, loads, sectors = [], [], []
    for one in listed(given["disturbances"], "disturbances"):
        keys(one, "a disturbance", "entry", "size")
        disturbances.append((row(one["entry"], "entry", n), number(one["size"], "size")))
    for one in listed(given["loads"], "loads"):
        keys(one, "a load", "control", "shift", "rate")
        shift, rate = row(one["shift"], "shift", n), number(one["rate"], "rate")
        need(rate >= 0 and not any(dot(line, shift) for line in C), "a load needs rate >= 0 and C*shift = 0")
        loads.append((row(one["control"], "control", m), shift, rate))
    for one in listed(given["sectors"], "sectors"):
        bounded = type(one) is dict and "within" in one
        keys(one, "a sector", "entry", "row", "slopes", *["within"] * bounded)
        low, high = row(one["slopes"], "slopes", 2)
        line = row(one["row"], "row", n + m)
        within = number(one["within"], "within") if bounded else None
        need(low <= high, "slopes must be in order")
        need(within is None or (within > 0 and not any(line[n:])), "within must be > 0, of a row of the states alone")
        sectors.append(Sector(row(one["entry"], "entry", n), line, low, high, within))
    noise, start = row(given["noise"], "noise", len(C)), row(given["start"], "start", n)
    need(min([*noise, *start, *(size for _, size in disturbances)]) >= 0, "sizes must be >= 0")
    A, B = matrix(given["A"], "A", n, n), matrix(given["B"], "B", n, m)
    return Plant(A, B, C, disturbances, loads, sectors, noise, start, table(given["outputs"], "outputs", n))


def read_law(value: Any, seen: int, controls: int) -> Law:
    """Read the law."""
    given = keys(value, "law", "step", "delay", "A", "B", "C", "D")
    step, delay = number(given["step"], "step"), number(given["delay"], "delay")
    need(step > 0 and 0 <= delay <= MOST_PERIODS * step, "step must be > 0, delay 0 to 8 steps")
    need(type(given["A"]) is list and len(given["A"]) <= MOST_LAW, f"a law has at most {MOST_LAW} states")
    q = len(given["A"])
    A, B = matrix(given["A"], "A of the law", q, q), matrix(given["B"], "B of the law", q, seen)
    C, D = matrix(given["C"], "C of the law", controls, q), matrix(given["D"], "D of the law", controls, seen)
    return Law(step, delay, A, B, C, D)


def dot(left: Sequence[Fraction], right: Sequence[Fraction]) -> Fraction:
    """Product of two rows."""
    return sum((a * b for a, b in zip(left, right, strict=True) if a and b), Fraction(0))


def loop_of(plant: Plant, law: Law) -> Loop:
    """The loop: states of the plant and the law, delayed controls, the latest first, controls that act."""
    n, m, q = len(plant.A), len(plant.B[0]), len(law.A)
    part = law.delay % law.step
    queue = int(law.delay // law.step) + (1 if part else 0)
    acting = n + q + m * queue
    size = acting + m
    need(size <= MOST_LOOP, f"the loop must have at most {MOST_LOOP} states")

    def spread(states: Sequence[Fraction], acts: Sequence[Fraction], own: Sequence[Fraction] = ()) -> Row:
        middle = [*own, *[Fraction(0)] * (q - len(own) + m * queue)]
        return [*states, *middle, *acts]

    none = [Fraction(0)] * m
    flow = [spread(a, b) for a, b in zip(plant.A, plant.B, strict=True)] + [[Fraction(0)] * size] * (size - n)
    for sector in plant.sectors:
        mean = (sector.low + sector.high) / 2
        line = spread(sector.line[:n], sector.line[n:])
        flow = [
            [v + mean * e * w for v, w in zip(old, line, strict=True)] if e else old
            for e, old in zip([*sector.entry, *[Fraction(0)] * (size - n)], flow, strict=True)
        ]
    seen = list(zip(*plant.C, strict=True)) if plant.C else [()] * n
    asked = [spread([dot(d, c) for c in seen], none, own) for own, d in zip(law.C, law.D, strict=True)]
    known = [spread([dot(b, c) for c in seen], none, own) for own, b in zip(law.A, law.B, strict=True)]
    units = unit(size)
    waiting = [units[n + q + i] for i in range(m * queue)]  # rows that read delayed controls
    jump = [*units[:n], *known, *(asked + waiting)[: m * queue], *((asked + waiting)[-m:] if not part else units[-m:])]
    segments = [(jump, part or law.step)]
    if part:
        segments.append(([*units[:acting], *waiting[-m:]], law.step - part))
    rest = [Fraction(0)] * (size - n)
    inputs = [[*entry, *rest] for entry, _ in plant.disturbances]
    for control, shift, _ in plant.loads:
        steady = balance(law, control)
        inputs.append([-v for v in (*shift, *steady, *control * (queue + 1))])
    inputs += [[*sector.entry, *rest] for sector in plant.sectors]
    told = []
    for k, noise in enumerate(plant.noise):
        if noise:
            enters = [*(line[k] for line in law.B), *(line[k] for line in law.D)]
            told.append([Fraction(0)] * n + enters + [Fraction(0)] * (size - n - q - m))
    start = [[s * v for v in units[i]] for i, s in enumerate(plant.start) if s]
    rows = [spread(line, none) for line in plant.outputs]
    rows += [spread(sector.line[:n], sector.line[n:]) for sector in plant.sectors]
    return Loop(flow, segments, inputs, told, start, rows + units[acting:])


def balance(law: Law, control: Row) -> Row:
    """An equilibrium of the law that commands this control, by elimination."""
    q = len(law.A)
    lines = [[*(v - (i == j) for j, v in enumerate(line)), Fraction(0)] for i, line in enumerate(law.A)]
    lines += [[*line, wanted] for line, wanted in zip(law.C, control, strict=True)]
    pivots: list[tuple[int, Row]] = []
    for place in range(q):
        chosen = next((line for line in lines if line[place]), None)
        if chosen is not None:
            chosen = [v / chosen[place] for v in chosen]
            lines = [[a - line[place] * c for a, c in zip(line, chosen, strict=True)] for line in lines]
            pivots.append((place, chosen))
    need(not any(line[q] for line in lines), "the law must balance every load at zero error")
    found = [Fraction(0)] * q
    for place, line in reversed(pivots):
        found[place] = line[q] - dot(line[:q], found)
    return found


def rows_of(plant: Plant, found: "Responses", numbers: Row) -> Row:
    """Bounds of all rows by the sizes of all inputs."""
    sizes = [size for _, size in plant.disturbances] + [rate for *_, rate in plant.loads]
    sizes += [
        most if sector.high > sector.low else Fraction(0) for sector, most in zip(plant.sectors, numbers, strict=True)
    ]
    noises = [size for size in plant.noise if size]
    need(min(numbers, default=Fraction(0)) >= 0, "inputs of the sectors must be >= 0")
    return [
        first + dot(gains, sizes) + dot(heard, noises)
        for first, gains, heard in zip(found.start, found.inputs, found.told, strict=True)
    ]


# ---------------------------------------------------------------- upper sums of impulse responses


@dataclass
class Responses:
    """Bounds of every row: for the box of initial conditions, each input and each noise of size 1."""

    start: Row
    inputs: list[Row]
    told: list[Row]


@dataclass
class Segment:
    """A jump and the flow after it in pieces: powers of e^{Ah}, bounds of |e^{A.}| on a piece and on all of it."""

    jump: Fixed
    h: Fraction
    powers: list[Fixed]
    near: Fixed
    within: Fixed

    @property
    def whole(self) -> Fixed:
        """Map of the jump and the flow."""
        return self.powers[-1] * self.jump


def segment_of(flow: list[Row], jump: list[Row], time: Fraction, pieces: int) -> Segment:
    """Cut a flow into pieces."""
    most = [[max(v, Fraction(0)) if i == j else abs(v) for j, v in enumerate(line)] for i, line in enumerate(flow)]
    step, powers = exponential(flow, time / pieces), [fixed(unit(len(flow)))]
    for _ in range(pieces):
        powers.append(step * powers[-1])
    near, within = (exponential(most, t).size() for t in (time / pieces, time))
    return Segment(fixed(jump), time / pieces, powers, near, within)


class Sums:
    """Upper sums of one loop: of the rows at all ends of pieces, applied to the state before a period."""

    def __init__(self, loop: Loop, pieces: int) -> None:
        self.loop, self.size, self.count, self.pieces = loop, len(loop.flow), len(loop.rows), pieces
        self.flow, self.rows, self.unit = fixed(loop.flow), fixed(loop.rows), fixed(unit(len(loop.flow)))
        self.square = self.flow * self.flow
        self.segments = [segment_of(loop.flow, jump, time, pieces) for jump, time in loop.segments]
        kinds: dict[tuple[Fraction, ...], int] = {}
        self.kind = [kinds.setdefault(tuple(entry), len(kinds)) for entry in loop.inputs]
        self.entries = [fixed([[v] for v in entry]) for entry in kinds]
        self.told = [fixed([[v] for v in entry]) for entry in loop.told]

    def found(self) -> Responses:
        """All bounds."""
        first, *more = self.segments
        earlier, period = [self.unit], first.whole
        for part in more:
            earlier.append(period)
            period = part.whole * period
        stacks = [self.stack(part) * before for part, before in zip(self.segments, earlier, strict=True)]
        last = more[0].whole if more else self.unit
        inner = [self.own(first, entry) for entry in self.entries]
        own, rests = [last * block for block, _ in inner], [(last.size() * rest).size() for _, rest in inner]
        for part in more:
            late = [self.own(part, entry) for entry in self.entries]
            own = [a.beside(b) for a, (b, _) in zip(own, late, strict=True)]
            rests = [a + b for a, (_, b) in zip(rests, late, strict=True)]
        own += [last * (first.powers[-1] * entry) for entry in self.told]
        rests += [Fixed([[0]] * self.size)] * len(self.told)
        sums, free = self.periods(stacks[0].above(*stacks[1:], self.unit), period, own, rests)
        gains = [[Fraction(0)] * self.count for _ in own]
        start, height = [Fraction(0)] * self.count, len(stacks[0].rows)
        for s, part in enumerate(self.segments):
            span = slice(s * height, (s + 1) * height)
            for i, total in enumerate(sums):
                before = total[span]
                if s and i < len(inner):  # what entered earlier in this period
                    seen, (block, rest) = self.stack(part), inner[i]
                    near, far = (seen * block).sums(), (seen.size() * rest).sums()
                    before = [a + b + c for a, b, c in zip(before, near, far, strict=True)]
                gains[i] = list(map(max, gains[i], self.peaks(part, i, before, s)))
            if self.loop.start:
                start = list(map(max, start, self.chords(part, free[span])))
        flowing = [gains[kind] for kind in self.kind]
        told = gains[len(inner) :]
        return Responses(start, by_row(flowing, self.count), by_row(told, self.count))

    def stack(self, part: Segment) -> Fixed:
        """Rows at the ends of pieces, and unit rows, after the jump of a segment, acting before it."""
        ends = [self.rows * power for power in part.powers]
        return ends[0].above(*ends[1:], self.unit) * part.jump

    def own(self, part: Segment, entry: Fixed) -> tuple[Fixed, Fixed]:
        """Columns of an input over a segment, at its end, and a bound of their quadrature error."""
        ends, h = [power * entry for power in part.powers], part.h
        widths = [h / 2, *[h] * (self.pieces - 1), h / 2]
        blocks = [end.scaled(width) for end, width in zip(ends, widths, strict=True)]
        bends = [(part.near * (self.square * end).size()).size() for end in ends[:-1]]
        rest = Fixed([[sum(v[0] for v in lines)] for lines in zip(*(bend.rows for bend in bends), strict=True)])
        return blocks[0].beside(*blocks[1:]), rest.scaled(h**3 / 12).size()

    def periods(
        self, rows: Fixed, period: Fixed, own: list[Fixed], rests: list[Fixed]
    ) -> tuple[list[list[int]], list[int]]:
        """Sums of every row over all periods, one list for every input; the largest free response of every row."""
        starts = [fixed([[v] for v in entry]) for entry in self.loop.start]
        blocks = [*own, self.unit, *starts]
        now, groups = blocks[0].beside(*blocks[1:]), []
        widths = [*(len(block.rows[0]) for block in own), *[1] * self.size]
        ends = [0]
        for width in widths:
            ends.append(ends[-1] + width)
        height = len(rows.rows)
        each = height * self.size * (len(now.rows[0]) + self.size)  # work of a period
        need(AT_ONCE[0] * each <= MOST_WORK, "the loop must be smaller, or its flow cut into fewer pieces")
        turned, leap = [now], period  # products of few powers: a long product of maps loses all digits
        while len(turned) < AT_ONCE[0] or (
            2 * len(turned) * each <= MOST_WORK and len(turned) < AT_ONCE[1] and not shrinks(leap)
        ):
            turned, leap = turned + [leap * one for one in turned], leap * leap
        at_once = len(turned)
        groups = [[(t, a, b) for t in range(at_once)] for a, b in pairwise(ends)]
        groups += [[(t, ends[-1], len(now.rows[0]))] for t in range(at_once)] if starts else []
        lines = [[v for group in groups for t, a, b in group for v in turned[t].rows[j][a:b]] for j in range(self.size)]
        columns = Fixed(lines, max(one.error for one in turned))
        lengths = [sum(b - a for _, a, b in group) for group in groups]
        known, done, until = rows, 0, at_once
        require_fading(leap, at_once, each)
        totals, free = [[0] * len(widths) for _ in rows.rows], [0] * height
        while True:
            need(until * each <= MOST_WORK, "the nominal loop must be stable and decay fast")
            for _ in range((until - done) // at_once):
                for r, found in enumerate(grouped(known, columns, lengths)):
                    totals[r] = [a + b for a, b in zip(totals[r], found, strict=False)]
                    free[r] = max([free[r], *found[len(widths) :]])
                known = known * leap
            done, until = until, 2 * until
            far = Fixed(known.rows[-self.size :], known.error).size()
            sums = [self.whole(totals, i, rest, len(own)) for i, rest in enumerate(rests)]
            parts = [raised(total[-self.size :]) for total in sums]
            most = raised(free[-self.size :])
            if all(fades(far, part) for part in [*parts, *([most] if starts else [])]):
                break
        beyond = known.size()
        for i, part in enumerate(parts):
            wide = [v + 2 * v // LEFT + 1 for v in part]
            closed = zip(part, times(far, wide), wide, strict=True)
            need(all(a + b <= x for a, b, x in closed), "the nominal loop must be stable and decay")
            sums[i] = [a + b for a, b in zip(sums[i], times(beyond, wide), strict=True)]
        if starts:
            need(all(a <= b for a, b in zip(times(far, most), most, strict=True)), "the free response must decay")
            free = list(map(max, free, times(beyond, most)))
        return sums, free

    def whole(self, totals: list[list[int]], i: int, rest: Fixed, count: int) -> list[int]:
        """Sums for an input, including the quadrature error of its columns, bounded by the sums for unit columns."""
        used = [(count + j, v) for j, (v,) in enumerate(rest.rows) if v]
        return [line[i] + sum((line[j] * v >> BITS) + 1 for j, v in used) for line in totals]

    def peaks(self, part: Segment, i: int, before: list[int], s: int) -> Row:
        """Bounds of all rows in a segment for an input, from sums before the segment."""
        flowing = i < len(self.entries)
        entry = self.entries[i] if flowing else self.told[i - len(self.entries)]
        if s and not flowing:
            entry = part.jump * (self.segments[0].powers[-1] * entry)
        heights = [(self.rows * (power * entry)).sums() for power in part.powers]
        bend = ((self.rows * self.square).size() * part.within * entry.size()).sums()
        if not flowing:
            return self.chords(part, before, heights, bend)
        slope = ((self.rows * self.flow).size() * part.within * entry.size()).sums()
        since, h = [[0] * self.count], part.h
        for a, b in pairwise(heights):
            news = zip(since[-1], a, b, bend, strict=True)
            since.append([t + over((x + y), h / 2) + over(c, h**3 / 12) for t, x, y, c in news])
        return self.chords(part, before, since, slope)

    def chords(
        self, part: Segment, before: list[int], since: list[list[int]] | None = None, bend: list[int] | None = None
    ) -> Row:
        """The larger of both ends of every piece, plus the error of chords."""
        units = Fixed([[v] for v in before[-self.size :]])
        bent = ((self.rows * self.square).size() * part.within * units).sums()
        bent = [a + b for a, b in zip(bent, bend or [0] * self.count, strict=True)]
        found = [0] * self.count
        for place in range(self.pieces + 1):
            end = before[place * self.count : (place + 1) * self.count]
            added = since[place] if since else [0] * self.count
            found = [max(f, a + b) for f, a, b in zip(found, end, added, strict=True)]
        return [Fraction(f + over(b, part.h**2 / 8), 1 << BITS) for f, b in zip(found, bent, strict=True)]


def responses(loop: Loop, pieces: int) -> Responses:
    """Bounds of all rows of a loop."""
    return Sums(in_even_units(loop), pieces).found()


def in_even_units(loop: Loop) -> Loop:
    """The loop with its states in units, powers of 2, in which rows and columns of its maps are of one size."""
    size = len(loop.flow)
    maps = [loop.flow, *(jump for jump, _ in loop.segments)]
    times = [sum(time for _, time in loop.segments), *[Fraction(1)] * len(loop.segments)]
    sizes = [
        [sum((abs(m[i][j]) * t for m, t in zip(maps, times, strict=True)), Fraction(0)) for j in range(size)]
        for i in range(size)
    ]
    powers = [0] * size
    for _ in range(SWEEPS):
        for i in range(size):
            others = [j for j in range(size) if j != i]
            line = sum(shifted(sizes[i][j], powers[j] - powers[i]) for j in others)
            under = sum(shifted(sizes[j][i], powers[i] - powers[j]) for j in others)
            if line and under:
                powers[i] += (bits(line) - bits(under)) // 2
    units = [Fraction(2) ** power for power in powers]

    def turned(table: list[Row]) -> list[Row]:
        return [[v * u / own for v, u in zip(line, units, strict=True)] for line, own in zip(table, units, strict=True)]

    def entered(columns: list[Row]) -> list[Row]:
        return [[v / u for v, u in zip(column, units, strict=True)] for column in columns]

    return Loop(
        turned(loop.flow),
        [(turned(jump), time) for jump, time in loop.segments],
        entered(loop.inputs),
        entered(loop.told),
        entered(loop.start),
        [[v * u for v, u in zip(line, units, strict=True)] for line in loop.rows],
    )


def bits(value: Fraction) -> int:
    """About log2 of a positive number."""
    return value.numerator.bit_length() - value.denominator.bit_length()


def shifted(value: Fraction, power: int) -> Fraction:
    """Times a power of 2."""
    return value * Fraction(2) ** power


def by_row(gains: list[Row], count: int) -> list[Row]:
    """One list for every row, of all inputs."""
    return [[line[r] for line in gains] for r in range(count)]


def over(value: int, factor: Fraction) -> int:
    """Times a number that is not negative, rounded up."""
    return -(-value * factor.numerator // factor.denominator)


def times(far: Fixed, part: list[int]) -> list[int]:
    """Product of a matrix of sizes and bounds, rounded up."""
    return [(sum(map(int.__mul__, line, part)) >> BITS) + 1 for line in far.rows]


def raised(part: list[int]) -> list[int]:
    """Bounds of which none is 0."""
    faint = (max(part) >> FAINT) + 1
    return [v + faint for v in part]


def shrinks(leap: Fixed) -> bool:
    """Whether a map makes every vector smaller in the maximum norm."""
    return max(map(sum, leap.size().rows)) < 1 << BITS


def require_fading(leap: Fixed, periods: int, work: int) -> None:
    """Refuse a map of some periods whose powers stay large, far beyond the periods that are followed."""
    power = leap
    while max(map(max, power.size().rows)) >> BITS:
        need(periods * work <= BEYOND * MOST_WORK, "the nominal loop must be stable and decay fast")
        need(max(map(max, power.size().rows)) >> BITS + 80 == 0, "the nominal loop must be stable")
        power, periods = power * power, 2 * periods


def fades(far: Fixed, part: list[int]) -> bool:
    """Whether only a small share of bounds remains."""
    return all(a * LEFT <= b for a, b in zip(times(far, part), part, strict=True))


def grouped(left: Fixed, right: Fixed, lengths: list[int]) -> Iterator[list[int]]:
    """For every row of `left` upper bounds of its sums of absolute values over groups of columns of `right`.

    Many columns at once, side by side in one long integer. Each row of `right` is cut to COARSE bits, with a power of 2
    for its size in the column of `left` that meets it, and each row of `left` to as many; the upper half of a place is
    read. With l = l' + d and r = r' + e the error of a product is at most |l|*e + d*|r'|.
    """
    count = sum(lengths)
    cuts = [max(max(map(abs, line)).bit_length() - COARSE, 0) for line in right.rows]
    places, tall = [], []
    ones = int.from_bytes(struct.pack(f"<{2 * count}Q", *[1, 0] * count), "little")
    for line, cut in zip(right.rows, cuts, strict=True):
        near = [v >> cut for v in line]
        tall.append(max(map(abs, near)) + 1)
        shifted = [v + (1 << COARSE + 1) for v in near]
        packed = int.from_bytes(struct.pack(f"<{2 * count}Q", *(x for v in shifted for x in (v, 0))), "little")
        places.append(packed - (ones << COARSE + 1))
    ends = [0]
    for length in lengths:
        ends.append(ends[-1] + length)
    signs = ones << PLACE - 1
    for line in left.rows:
        moved = [v << cut for v, cut in zip(line, cuts, strict=True)]
        own = max(max(map(abs, moved)).bit_length() - COARSE, 0)
        near = [v >> own for v in moved]
        total = sum(map(int.__mul__, near, places)) + signs ^ signs  # every place for itself, in two's complement
        halves = struct.unpack(f"<{2 * count}q", total.to_bytes(count * PLACE // 8, "little"))[1::2]
        off = sum(abs(v) * ((1 << cut) + right.error) for v, cut in zip(line, cuts, strict=True))
        off += sum(((1 << own) + (left.error << cut)) * most for cut, most in zip(cuts, tall, strict=True))
        off += sum(left.error * right.error for _ in cuts)
        yield [
            ((sum(map(abs, halves[a:b])) + b - a << HALF + own) + (b - a) * off >> BITS) + 1 for a, b in pairwise(ends)
        ]
