"""L1 norms: bounds of every output for an input of size 1, for an initial condition, and with a diffusion path.

With R the error of omitting the modes n >= MODES (FORMAT.md, Diffusion path), -A its integral after a unit step, and
-Y what the steps so far will still add to the integral of R, x2 = e2 - beta0*b*Y takes the place of e2 in the loop.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from math import ceil

from .impulse_sums import DOUBLINGS, MAX_WORK, SHARE, Flow, Near, cut, integral, majorant, past, seen_alone, slowest
from .loop import MODES, SHORT, Fade, Loop, Pulse, mode_rate, mode_share
from .matrices import BITS, Fixed, column, exponential, fixed, unit
from .reading import Refused, Row, need

STRETCHES, PARTS = 128, 6  # of time without samples, each of 2^PARTS pieces
Sums = list[int]  # one for every output, in units of 2^-BITS
LATE = 1 << 12  # sums end when what remains is below 1/4096 of them


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
    """Sums since the event, in every piece: bounds at both ends, and of the excess over both in between."""
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
    """The same for a fading input: pieces that have passed, and the most that the present one may add."""
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
    """The same for a pulse: the larger of both its sides, and its part before the next event."""
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
    """The same without events, for all t: stretches of pieces, each twice as long as the one before."""
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
    raise Refused("the nominal loop must be stable, as shown by its sums")


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
        gains(loop, entry, place > 1 + loop.referred and place != fades, *[loop.fade] * (place == fades))
        for place, entry in enumerate(loop.inputs)
    ]


FAINT = 60  # bits below the largest bound, by which all are raised so that none is 0


def start_gains(loop: Loop) -> list[list[Fraction]]:
    """Bounds of the free response of every output from the box of initial conditions, on every piece of the period."""
    entries = [in_even_units(loop, entry)[1] for entry in loop.start]
    loop, _ = in_even_units(loop, loop.start[0])
    flows = cut(loop, loop.cuts, [Fraction(0)] * len(loop.flow), False)
    start, outputs = fixed([list(line) for line in zip(*entries, strict=True)]), fixed(loop.outputs)
    now, far, most = followed(flows, start, len(outputs.rows) * len(loop.cuts))
    even = [1 << BITS] * len(entries)
    found: list[list[Fraction]] = [[] for _ in loop.outputs]
    for flow in flows:
        both = zip(on_pieces(flow, outputs, now, even), on_pieces(flow, outputs, far, most), strict=True)
        for near, late in both:
            for bounds, a, b in zip(found, near, late, strict=True):
                bounds.append(max(a, b) / (1 << BITS))
        now, far = flow.whole * now, flow.whole * far
    return found


def followed(flows: list[Flow], start: Fixed, rows: int) -> tuple[Fixed, Fixed, list[int]]:
    """States at the beginning of K periods; W^-1 after them, and a bound of W times the state for all later periods.

    K = 2^j periods, until 1/1024 of these bounds remains except for the slowest mode, which has to decay.
    """
    size, count = len(start.rows), len(start.rows[0])
    period = flows[0].whole
    for flow in flows[1:]:
        period = flow.whole * period
    row, columns, even = slowest(period), start, [1 << BITS] * count
    for _ in range(DOUBLINGS):
        width = 2 * len(columns.rows[0])
        need(2 * width * size * (size + rows) <= MAX_WORK, "the loop must decay faster: the check takes too long")
        columns, period = columns.beside(period * columns), period * period
        place, seen, back = seen_alone(row, largest(columns.size(), even))
        most = largest((seen * columns).size(), even)
        most = [v + (max(most) >> FAINT) + 1 for v in most]
        far = period * back
        left = (seen * far).size().rows
        quick = [v * (i != place) for i, v in enumerate(most)]
        falls = all(product(line, most) <= v for line, v in zip(left, most, strict=True))
        if falls and all(SHARE * product(line, quick) <= v for line, v in zip(left, most, strict=True)):
            return columns, far, most
    raise Refused(f"the nominal loop must be stable, as shown within {2**DOUBLINGS} periods")


def product(line: list[int], values: list[int]) -> Fraction:
    """Product of a row of sizes and a column."""
    return Fraction(sum(map(int.__mul__, line, values)), 1 << BITS)


def largest(sizes: Fixed, weights: list[int]) -> list[int]:
    """Of every row, the largest weighted sum of as many columns as there are weights, rounded up."""
    return [max(sums(line, weights)) for line in sizes.rows]


def sums(line: list[int], weights: list[int]) -> list[int]:
    """Weighted sums of one group of columns after another, rounded up."""
    count = len(weights)
    groups = (line[i : i + count] for i in range(0, len(line), count))
    return [(sum(map(int.__mul__, group, weights)) >> BITS) + 1 for group in groups]


def on_pieces(flow: Flow, outputs: Fixed, columns: Fixed, weights: list[int]) -> Iterator[Row]:
    """Bounds of all outputs in every piece, of the largest group of columns that stand before the event."""
    now, phase = flow.event * columns, outputs
    square = flow.generator * flow.generator
    for step, near, h in zip(flow.steps, flow.nears, flow.pieces, strict=True):
        following = phase * step
        bends = (((phase * square).size() * near).size() * now.size()).size().rows
        first, last = (phase * now).size().rows, (following * now).size().rows
        yield [
            max(max(a, b) + c * h**2 / 8 for a, b, c in zip(*(sums(line, weights) for line in lines), strict=True))
            for lines in zip(first, last, bends, strict=True)
        ]
        phase = following


@dataclass
class Awaited:
    """b*Y over its bound: its entry in the flow, its decay, its share of e2, its effect on the measurement."""

    entry: Row
    fade: Fade | None
    at_once: Fraction
    told: Row


def loop_gains(loop: Loop, gain: Fraction) -> list[list[Row]]:
    """Gains of every input: of the loop, of b*Y and its measurement with a diffusion path, of the initial condition."""
    found = []
    if loop.layer:
        loop, awaited = without_area(loop, gain)
        lines = gains(loop, awaited.entry, False, awaited.fade)
        lines[1] = [v + awaited.at_once for v in lines[1]]
        found = [lines, gains(loop, awaited.told, True)]
    own = input_gains(loop)
    if loop.pulse:
        found = [gains(loop, pulse_entry(loop, gain), False, pulse=loop.pulse)]
        seen = own[1][3 if loop.asked else 2]  # p* moves on while an earlier pressure is at the valve
        seen[:] = [v + loop.pulse.late for v in seen]
    return [*own, *found, *([start_gains(loop)] if loop.start else [])]


def pulse_entry(loop: Loop, gain: Fraction) -> Row:
    """Entry of a pressure at the valve: the slip rate, or the pressure behind a lag minus the valve's."""
    entry = [Fraction(0)] * len(loop.flow)
    if loop.asked:
        well = len(entry) - 2
        entry[well] = -loop.flow[well][well]
    else:
        entry[1] = gain
    return entry


def without_area(loop: Loop, gain: Fraction) -> tuple[Loop, Awaited]:
    """The loop in x2, beta0 = gain: -gain*A times every pressure step of the well, or times its rate, enters x2."""
    last = next(i for i, v in enumerate(loop.outputs[3]) if v)  # the valve's last step, or the well less the valve
    kick = gain * area(loop.layer)
    flow, events = [list(line) for line in loop.flow], [([list(line) for line in jump], t) for jump, t in loop.events]
    if loop.fade:
        share, fade = held_share(loop, loop.fade.event)
        jump, rest = events[-1]
        jump[1] = [v - kick * step for v, step in zip(jump[1], jump[last], strict=True)]
        late = fade.weight(rest)
    else:
        share, fade, late = moving_share(loop.layer), None, Fraction(1)
        flow[1][last] -= kick * flow[last][last]
    own = gain * share
    told = [own * late * (line[1] - (i == 1)) for i, line in enumerate(events[0][0])]
    entry = [own * v for v in (1, flow[1][1], *[Fraction(0)] * (len(flow) - 2))]
    return replace(loop, flow=flow, events=events), Awaited(entry, fade, own, told)


def area(time: Fraction) -> Fraction:
    """A: time/2 is that of all modes."""
    return time / 2 - sum(mode_share(n) / mode_rate(n, time) for n in range(MODES))


def held_share(loop: Loop, event: int) -> tuple[Fraction, Fade]:
    """Bound of b*Y over that of b*R, for a well that steps once a period; how it fades."""
    rate, floor = mode_rate(MODES, loop.layer), 6 * MODES * SHORT * (1 + loop.layer / loop.step)
    height = abs(mode_share(MODES)) * (1 + 1 / (rate * loop.step))
    most = height / rate + floor * loop.layer
    fade = Fade(event, height / rate / most, rate, floor * loop.layer / most)
    return most / (height + floor), fade


def moving_share(time: Fraction) -> Fraction:
    """The same for a well that flows."""
    high, rate, floor = abs(mode_share(MODES)), mode_rate(MODES, time), 6 * MODES * SHORT
    return (high / rate**2 + floor * time**2) / (high / rate + floor * time)
