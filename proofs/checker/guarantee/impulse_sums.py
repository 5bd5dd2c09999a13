"""Upper sums of impulse responses over the pieces of a period, near its events, and over all periods before."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise
from math import ceil

from .loop import Fade, Loop, Pulse
from .matrices import BITS, Fixed, column, exponential, exponentials, fixed, sums_of_product
from .reading import Refused, Row, need


@dataclass
class Near:
    """A pulse in one flow: columns that begin with its event, each with a bound of its error in size.

    `ahead` is its part before the next event, over a time `reach`, and `soon` bounds the error of that in size.
    """

    sides: list[tuple[Fixed, Fixed]]
    ahead: Fixed | None
    soon: Fixed | None
    reach: Fraction

    def halves(self) -> tuple[Fixed, Fixed]:
        """Half the sum and half the difference of both sides, whose sizes add up to the larger; errors of both."""
        (one, off), (other, far) = self.sides
        less = Fixed([[-v for v in line] for line in other.rows], other.error)
        both = (one + other).beside(one + less).scaled(Fraction(1, 2))
        return both, Fixed([[max(*a, *b)] for a, b in zip(off.rows, far.rows, strict=True)])


def near_of(flow: list[Row], majorant: list[Row], event: Fixed, entry: Fixed, moved: Fixed, pulse: Pulse) -> Near:
    """Both sides of a pulse after its event; `moved` is A*entry.

    Before it, an impulse is within early*|J|*|e^{A.}|*|A*b| of J*b, after it within late*|e^{A.}|*|e^{-A*late}*A*b|.
    """
    before, after = event * entry, entry
    shifted = ((event.size() * exponential(majorant, pulse.early).size()).size() * moved.size()).size()
    back = (exponential([[-v for v in line] for line in flow], pulse.late) * moved).size()
    behind = (exponential(majorant, pulse.late).size() * back).size()
    sides = [
        (before.scaled(pulse.before), shifted.scaled(pulse.before * pulse.early).size()),
        (after.scaled(pulse.after), behind.scaled(pulse.after * pulse.late).size()),
    ]
    return Near(sides, None, None, Fraction(0))


def with_next(here: Near | None, majorant: list[Row], entry: Fixed, moved: Fixed, pulse: Pulse) -> Near:
    """The part before the next event as well: at most |c*b| + early*|c|*|e^{A.}|*|A*b|, over `before`."""
    soon = (exponential(majorant, pulse.early).size() * moved.size()).size()
    sides = here.sides if here else []
    scaled = soon.scaled(pulse.early * pulse.before).size()
    return Near(sides, entry.scaled(pulse.before), scaled, pulse.early)


DOUBLINGS = 12  # at most 4096 periods are summed
SHARE = 1024  # the past before those is below 1/1024, except for the slowest mode
IN_COLUMNS = 6  # doublings of columns, after which rows are doubled
TURNS, ROOM = 8, 1 << 40  # iterations for sums that bound themselves, and 1/ROOM added to them
MAX_WORK = 3 * 10**7  # products of integers
MAX_SUMS = 10**8  # the same for all earlier periods: twice the package's limit


@dataclass
class Flow:
    """One event and the flow after it, cut into pieces, for one input.

    It enters at every time, with the event alone (`sudden`), less and less (`masses`, of every piece), or near events.
    """

    event: Fixed
    pieces: Row
    steps: list[Fixed]
    nears: list[Fixed]
    whole: Fixed
    entry: Fixed
    generator: Fixed
    moved: set[int]
    sudden: bool
    masses: list[tuple[Fraction, Fraction]]
    responses: dict[int, list[Fixed]] = field(default_factory=dict)
    near: Near | None = None

    def ends(self, start: int = 0) -> list[Fixed]:
        """Impulse response from the start of a piece on, at the ends of pieces; computed once."""
        if start not in self.responses:
            found = [self.entry]
            for step in self.steps[start:]:
                found.append(step * found[-1])
            self.responses[start] = found
        return self.responses[start]

    def slope(self, now: Fixed, i: int) -> Fixed:
        """Bound of the first derivative over a piece that begins like this."""
        return (self.nears[i] * (self.generator * now).size()).size()

    def bend(self, now: Fixed, i: int) -> Fixed:
        """The same of the second derivative."""
        return (self.nears[i] * (self.generator * (self.generator * now)).size()).size()


def cut(
    loop: Loop, cuts: Sequence[Fraction], entry: Row, sudden: bool, fade: Fade | None = None, pulse: Pulse | None = None
) -> list[Flow]:
    """Flows with their pieces between the cuts, for one input."""
    flows = []
    generator = fixed(loop.flow)
    moved = {i for i, v in enumerate(entry) if v}  # by the flow, at least
    moved = following = {i for i, line in enumerate(loop.flow) if any(line[j] for j in moved)}
    while following:
        following = {i for i, line in enumerate(loop.flow) if any(line[j] for j in moved)} - moved
        moved = moved | following
    for place, (event, duration) in enumerate(loop.events):
        entry = [Fraction(0)] * len(entry) if sudden and place else entry
        lengths = [(b - a) * duration for a, b in pairwise(cuts)]
        steps = exponentials(loop.flow, lengths)
        nears = [near.size() for near in exponentials(majorant(loop.flow), lengths)]
        whole = fixed(event)
        for step in steps:
            whole = step * whole
        masses = []
        if fade:
            turned = loop.events[fade.event :] + loop.events[: fade.event]
            since = sum(length for _, length in turned[: (place - fade.event) % len(turned)])
            masses = [mass(fade, since + c * duration, h) for c, h in zip(cuts, lengths, strict=False)]
        flows.append(Flow(fixed(event), lengths, steps, nears, whole, column(entry), generator, moved, sudden, masses))
    return pulsed(loop, flows, pulse) if pulse else flows


def pulsed(loop: Loop, flows: list[Flow], pulse: Pulse) -> list[Flow]:
    """The same for an input near one event only."""
    most = majorant(loop.flow)
    for place, flow in enumerate(flows):
        moved, here = flow.generator * flow.entry, None
        if place == pulse.event:
            here = near_of(loop.flow, most, flow.event, flow.entry, moved, pulse)
        if (place + 1) % len(flows) == pulse.event:
            here = with_next(here, most, flow.entry, moved, pulse)
        flow.near = here or Near([], None, None, Fraction(0))
    return flows


def mass(fade: Fade, start: Fraction, length: Fraction) -> tuple[Fraction, Fraction]:
    """Bounds of the integral of the weight over a piece, and of its first moment about the start."""
    x = fade.rate * start
    height = fade.height / (1 + x + x**2 / 2 + x**3 / 6 + x**4 / 24)  # e^x is larger than this sum
    moment = height * min(1 / fade.rate**2, length**2 / 2) + fade.floor * length**2 / 2
    return height * min(1 / fade.rate, length) + fade.floor * length, moment


def majorant(flow: list[Row]) -> list[Row]:
    """M with |e^{Aδ}| ≤ e^{Mδ} ≤ e^{Mh} for 0 ≤ δ ≤ h: absolute values, on the diagonal no negative ones."""
    return [[max(v, Fraction(0)) if i == j else abs(v) for j, v in enumerate(line)] for i, line in enumerate(flow)]


def pieces(flow: Flow, later: Fixed | None) -> Fixed:
    """Columns whose sum of absolute values, after any row, bounds the integral over a flow that `later` may follow."""
    if flow.near:
        return near_pieces(flow, flow.near, later)
    ends = flow.ends()
    if flow.sudden:
        return later * ends[-1] if later else ends[-1]
    if flow.masses:
        summed = [(flow.ends(i)[-1], m) for i, (m, _) in enumerate(flow.masses)]
        rests = [(flow.slope(flow.ends(i + 1)[-1], i), m) for i, (_, m) in enumerate(flow.masses)]
    else:
        around = [a + b for a, b in pairwise([Fraction(0), *flow.pieces, Fraction(0)])]
        summed = [(end, width / 2) for end, width in zip(ends, around, strict=True)]
        rests = [(flow.bend(ends[i], i), h**3 / 12) for i, h in enumerate(flow.pieces)]
    bound = [sum(bent.rows[j][0] * weight for bent, weight in rests) for j in range(len(flow.event.rows))]
    rest = Fixed([[ceil(v) if j in flow.moved else 0] for j, v in enumerate(bound)])
    if later:
        summed, rest = [(later * end, weight) for end, weight in summed], (later.size() * rest).size()
    first, *others = (end.scaled(weight) for end, weight in summed)
    return first.beside(*others, diagonal(rest))


def diagonal(rest: Fixed) -> Fixed:
    """One column for every nonzero entry."""
    corner = [i for i, (v,) in enumerate(rest.rows) if v]
    return Fixed([[v if i == j else 0 for j in corner] for i, (v,) in enumerate(rest.rows)])


def near_pieces(flow: Flow, here: Near, later: Fixed | None) -> Fixed:
    """The same for a pulse: at most the larger of both its sides, plus their errors."""
    if not here.sides:
        return Fixed([[0] for _ in flow.event.rows])
    whole = flow.steps[0]
    for step in flow.steps[1:]:
        whole = step * whole
    whole = later * whole if later else whole
    columns, rest = here.halves()
    return (whole * columns).beside(diagonal((whole.size() * rest).size()))


@dataclass
class Past:
    """All earlier periods: columns of the latest, maps that turn them into columns of others, a bound of the rest."""

    columns: Fixed
    far: Fixed
    left: Fixed
    maps: tuple[Fixed, ...] = ()

    def of(self, rows: Fixed) -> list[int]:
        """Bounds of the integrals for every row; equal rows are done once."""
        once = list(dict.fromkeys(map(tuple, rows.rows)))
        different = Fixed([list(line) for line in once], rows.error)
        rest = ((different * self.far).size() * self.left).size()
        ahead = stacked(different, self.maps)
        sums = zip(folded(sums_of_product(ahead, self.columns), len(once)), rest.rows, strict=True)
        found = dict(zip(once, (near + far for near, (far,) in sums), strict=True))
        return [found[tuple(line)] for line in rows.rows]


def past(flows: list[Flow], rows: int) -> Past:
    """Sum 2^j periods until 1/1024 of every sum remains, and the remainder of the slowest mode, taken alone."""
    *earlier, flow = flows
    period, columns = flow.whole, pieces(flow, None)
    for flow in reversed(earlier):
        columns, period = columns.beside(pieces(flow, period)), period * flow.whole
    size = len(period.rows)
    place, seen, back = seen_alone(slowest(period), columns.sums())
    sums, rows_so_far, maps = sums_of_product(seen, columns), seen, tuple[Fixed, ...]()
    for doubling in range(DOUBLINGS):
        width = len(columns.rows[0])
        work = 2 * (width << len(maps)) * size * (size + rows)
        need(work <= MAX_SUMS, "the loop must decay faster: the check takes too long")
        if doubling < IN_COLUMNS:
            following = period * columns
            columns, more = columns.beside(following), sums_of_product(seen, following)
        else:
            following = rows_so_far * period
            more = folded(sums_of_product(following, columns), size)
            rows_so_far, maps = rows_so_far.above(following), (*maps, period)
        sums, period = [a + b for a, b in zip(sums, more, strict=True)], squared(period)
        far = period * back
        left = (seen * far).size()
        quick = Fixed([[v * (j != place)] for j, v in enumerate(sums)])
        if all(v * SHARE <= total for (v,), total in zip((left * quick).rows, sums, strict=True)):
            return Past(columns, far, whole_sums(left, sums, place), maps)
    raise Refused(f"the nominal loop must be stable, as shown within {2**DOUBLINGS} periods")


@lru_cache(maxsize=16)  # the same for all inputs of a loop
def stacked(rows: Fixed, maps: tuple[Fixed, ...]) -> Fixed:
    """Rows as they are and after each of the maps, above those after two of them, and so on."""
    if not maps:
        return rows
    fewer = stacked(rows, maps[:-1])
    return fewer.above(fewer * maps[-1])


@lru_cache(maxsize=64)
def squared(period: Fixed) -> Fixed:
    """Map of twice as many periods."""
    return period * period


def folded(sums: list[int], count: int) -> list[int]:
    """Sums of so many rows, of those that were stacked after one another."""
    return [sum(sums[i::count]) for i in range(count)]


@lru_cache(maxsize=4)
def slowest(period: Fixed) -> list[int]:
    """Left eigenvector of the slowest mode, if there is one: a row of a high power of the map, up to a factor.

    It is the row with the largest diagonal entry; diagonal entries are the same in all units of the states.
    """
    rows = period.rows
    for _ in range(DOUBLINGS):
        rows = [[sum(map(int.__mul__, line, entries)) for entries in zip(*rows, strict=True)] for line in rows]
        much = max(abs(v) for line in rows for v in line).bit_length() - BITS
        rows = [[v >> much if much > 0 else v << -much for v in line] for line in rows]
    return rows[max(range(len(rows)), key=lambda i: abs(rows[i][i]))]


def seen_alone(row: list[int], sums: list[int]) -> tuple[int, Fixed, Fixed]:
    """Unit rows W except for the given one, which replaces that of the largest contribution, and the inverse of W."""
    size = len(row)
    place = max(range(size), key=lambda i: abs(row[i]) * sums[i])
    seen, back = ([[(i == j) << BITS for j in range(size)] for i in range(size)] for _ in range(2))
    for j, v in enumerate(row):
        if j != place and row[place]:
            seen[place][j] = (v << BITS) // row[place]
            back[place][j] = -seen[place][j]
    return place, Fixed(seen), Fixed(back)


def whole_sums(left: Fixed, sums: list[int], place: int) -> Fixed:
    """Some x with y + Dx <= x for the sums y and D = `left`, one row of which may be large."""
    one, slow = 1 << BITS, left.rows[place][place]
    need(slow < one, "the nominal loop must be stable. Its slowest mode is not")
    found = list(sums)
    for _ in range(TURNS):
        own = [(y << BITS) + sum(map(int.__mul__, line, found)) for y, line in zip(sums, left.rows, strict=True)]
        own[place] = (own[place] - slow * found[place]) * one // (one - slow)
        found = [(v >> BITS) + 1 for v in own]
    found = [v + v // ROOM + 1 for v in found]
    closed = all(
        (y << BITS) + sum(map(int.__mul__, line, found)) <= v << BITS
        for y, line, v in zip(sums, left.rows, found, strict=True)
    )
    need(closed, "the nominal loop must be stable and decay")
    return Fixed([[v] for v in found])


def integral(flows: list[Flow], before: Past, rows: Fixed) -> list[int]:
    """Bounds for rows that act after the given flows of this period, and before the event of the next."""
    if not flows:
        return before.of(rows)
    own = (rows * pieces(flows[-1], None)).sums()
    return [a + b for a, b in zip(own, integral(flows[:-1], before, rows * flows[-1].whole), strict=True)]
