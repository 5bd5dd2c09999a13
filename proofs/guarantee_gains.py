"""L1 norms: bounds of every output for an input of size 1, from upper sums of impulse responses."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from math import ceil

from guarantee_impulse_sums import MAX_WORK, Flow, cut, integral, majorant, past
from guarantee_loop import Fade, Loop
from guarantee_near_events import Near, Pulse
from guarantee_numbers import BITS, Fixed, column, exponential, fixed, unit
from guarantee_reading import Refused, Row

STRETCHES, PARTS = 128, 6  # of time without samples, each of 2^PARTS pieces
Sums = list[int]  # one for every output, in units of 2^-BITS
LATE = 1 << 12  # what is left of the past after those is below a 4096th


def gains(
    loop: Loop, entry: Row, sudden: bool, fade: Fade | None = None, pulse: Pulse | None = None
) -> list[list[Fraction]]:
    """Bounds of every output for an input of size 1, on every piece of the period."""
    if not loop.events:
        return [[v] for v in flow_gains(loop, entry)]
    loop, entry = in_even_units(loop, entry)
    size, many = len(loop.flow), len(loop.outputs)
    flows, early = (cut(loop, cuts, entry, sudden, fade, pulse) for cuts in (loop.cuts, loop.past_cuts))
    start = fixed(loop.outputs)
    square = flows[0].generator * flows[0].generator
    before = past(early, len(flows) * (many * len(loop.cuts) + size))
    found: list[list[Fraction]] = [[] for _ in loop.outputs]
    for number_of, flow in enumerate(flows):
        phases = [start]
        for step in flow.steps:
            phases.append(phases[-1] * step)
        stack = phases[0].above(*phases[1:], fixed(unit(size))) * flow.event
        earlier = integral(early[:number_of], before, stack)
        units = Fixed([[v] for v in earlier[-size:]])
        news = list(since_event(flow, start))
        for i, h in enumerate(flow.pieces):
            bent = times((((phases[i] * square).size() * flow.nears[i]).size() * units).sums(), h**2 / 8)
            for k in range(many):
                first, last, more = (part[k] for part in news[i])
                larger = max(earlier[many * i + k] + first, earlier[many * (i + 1) + k] + last)
                found[k].append(Fraction(larger + more + bent[k], 1 << BITS))
    return found


def since_event(flow: Flow, outputs: Fixed) -> Iterator[tuple[Sums, Sums, Sums]]:
    """What came since the event, in every piece: bounds at both ends, and of what may lie above both of them."""
    if flow.near:
        yield from near_event(flow, flow.near, outputs)
        return
    ends, size = flow.ends(), outputs.size()
    heights = [(outputs * end).sums() for end in ends]
    total = [0] * len(size.rows)
    for i, h in enumerate(flow.pieces):
        bend, slope = (size * flow.bend(ends[i], i)).sums(), (size * flow.slope(ends[i], i)).sums()
        if flow.sudden:
            yield heights[i], heights[i + 1], times(bend, h**2 / 8)
        elif flow.masses:
            yield faded(flow, outputs, i)
        else:
            following = plus(total, times(plus(heights[i], heights[i + 1]), h / 2), times(bend, h**3 / 12))
            yield total, following, times(slope, h**2 / 8)
            total = following


def faded(flow: Flow, outputs: Fixed, i: int) -> tuple[Sums, Sums, Sums]:
    """The same of what fades: pieces that have passed, and all that the present one may bring."""
    size, chord = outputs.size(), flow.pieces[i] ** 2 / 8
    first = last = [0] * len(size.rows)
    ends = [(outputs * now).sums() for now in (flow.entry, flow.steps[i] * flow.entry)]
    bent = (size * flow.bend(flow.entry, i)).sums()
    more = times(plus(map(max, *ends), times(bent, chord)), flow.masses[i][0])
    for p, (heavy, moment) in enumerate(flow.masses[:i]):
        now, later = flow.ends(p)[i - p], flow.ends(p + 1)[i - p - 1]
        slope = (size * (flow.nears[p] * flow.slope(later, i)).size()).sums()
        bent = (size * flow.bend(now, i)).sums()
        first = plus(first, times((outputs * now).sums(), heavy))
        last = plus(last, times((outputs * (flow.steps[i] * now)).sums(), heavy))
        more = plus(more, times(bent, heavy * chord), times(slope, moment))
    return first, last, more


def near_event(flow: Flow, here: Near, outputs: Fixed) -> Iterator[tuple[Sums, Sums, Sums]]:
    """The same of a pulse: the larger of both its sides, and what is there before the next event already."""
    none, left, phase = [0] * len(outputs.rows), sum(flow.pieces), outputs
    square = flow.generator * flow.generator
    for step, h, within in zip(flow.steps, flow.pieces, flow.nears, strict=True):
        first, last, more, left = none, none, none, left - h
        following, bends = phase * step, ((phase * square).size() * within).size()
        for side, off in here.sides:
            bent, far = (bends * side.size()).sums(), ((phase.size() * within).size() * off).sums()
            first = list(map(max, first, (phase * side).sums()))
            last = list(map(max, last, (following * side).sums()))
            more = list(map(max, more, plus(times(bent, h**2 / 8), far)))
        phase = following
        if here.ahead and here.soon and left < here.reach:
            more = plus(more, (outputs * here.ahead).sums(), (outputs.size() * here.soon).sums())
        yield first, last, more


def times(sums: Sums, factor: Fraction) -> Sums:
    """Times a number that is not negative, rounded up."""
    return [-(-v * factor.numerator // factor.denominator) for v in sums]


def plus(*sums: Iterable[int]) -> Sums:
    """Entry by entry."""
    return list(map(sum, zip(*sums, strict=True)))


def flow_gains(loop: Loop, entry: Row) -> Row:
    """The same without events, for ever: stretches of pieces, each twice as long as the one before."""
    flow, outputs, now = balanced(loop, entry)
    size, piece = len(flow), Fraction(1)
    while max(sum(map(abs, line)) for line in flow) * piece > Fraction(1, 1 << PARTS):
        piece /= 2
    step, near = exponential(flow, piece), exponential(majorant(flow), piece).size()
    square, sums = fixed(flow) * fixed(flow), [[0] * (size + 1) for _ in outputs.rows]
    for _ in range(min(STRETCHES, MAX_WORK // (4 * size**2 * (size + 1) << PARTS))):
        ends, power = now, step
        for _ in range(PARTS):
            ends, power = ends.beside(power * ends), power * power
        now = power * now
        bends = ((outputs.size() * near).size() * (square * ends).size()).size()
        add_areas(sums, (outputs * ends.beside(now)).size(), bends, piece)
        late = (Fixed([line[:size] for line in sums]) * now.size()).size()
        pairs = list(zip(late.rows, sums, strict=True))
        if all(v * LATE <= total for far, line in pairs for v, total in zip(far[:size], line[:size], strict=True)):
            return [(line[size] + Fraction(LATE * far[size], LATE - 1)) / (1 << BITS) for far, line in pairs]
        further = (step.size() * near).size()
        near = Fixed([list(map(max, *lines)) for lines in zip(near.rows, further.rows, strict=True)])
        step, piece = step * step, 2 * piece
    raise Refused("the nominal loop must be stable, and seen to be")


def add_areas(sums: list[list[int]], heights: Fixed, bends: Fixed, piece: Fraction) -> None:
    """Add, to every entry of the sums, bounds of the integrals over all pieces whose ends have these heights."""
    for total, line, bent in zip(sums, heights.rows, bends.rows, strict=True):
        for i, bend in enumerate(bent):
            area = (line[i] + line[i + len(total)]) * piece / 2 + bend * piece**3 / 12
            total[i % len(total)] += ceil(area)


def balanced(loop: Loop, entry: Row) -> tuple[list[Row], Fixed, Fixed]:
    """A, outputs, and unit columns with the entry, in even units."""
    even, entry = in_even_units(loop, entry)
    return even.flow, fixed(even.outputs), fixed(unit(len(even.flow))).beside(column(entry))


def in_even_units(loop: Loop, entry: Row) -> tuple[Loop, Row]:
    """A loop and an input in units of the states that make the rows and columns of its maps alike."""
    maps = [loop.flow, *(line for line, _ in loop.events)]
    sizes = [[sum(map(abs, entries)) for entries in zip(*lines, strict=True)] for lines in zip(*maps, strict=True)]
    units = even_units(tuple(map(tuple, sizes)))
    flow, *jumps = [
        [[v * u / own for v, u in zip(line, units, strict=True)] for line, own in zip(lines, units, strict=True)]
        for lines in maps
    ]
    events = [(jump, time) for jump, (_, time) in zip(jumps, loop.events, strict=True)]
    outputs = [[v * u for v, u in zip(line, units, strict=True)] for line in loop.outputs]
    even = replace(loop, flow=flow, events=events, outputs=outputs)
    return even, [v / u for v, u in zip(entry, units, strict=True)]


@lru_cache(maxsize=4)
def even_units(table: tuple[tuple[Fraction, ...], ...]) -> Row:
    """Powers of 2 that make every row of a table u_i^-1 |t_ij| u_j about as large as its column."""
    sizes = [[(abs(v.numerator) << BITS) // v.denominator for v in line] for line in table]
    powers = [0] * len(sizes)
    for i in list(range(len(sizes))) * 16:
        others = [j for j in range(len(sizes)) if j != i]
        line = sum(shifted(sizes[i][j], powers[j] - powers[i]) for j in others)
        under = sum(shifted(sizes[j][i], powers[i] - powers[j]) for j in others)
        if line and under:
            powers[i] += (line.bit_length() - under.bit_length()) // 2
    return [Fraction(2) ** power for power in powers]


def shifted(value: int, power: int) -> int:
    """Times a power of 2."""
    return value << power if power >= 0 else value >> -power


def input_gains(loop: Loop) -> list[list[list[Fraction]]]:
    """Gains of every input."""
    fades = len(loop.inputs) - 1 if loop.fade else None
    return [
        gains(loop, entry, place > 1 and place != fades, *[loop.fade] * (place == fades))
        for place, entry in enumerate(loop.inputs)
    ]
