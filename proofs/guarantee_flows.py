"""Upper sums of impulse responses over the pieces of a period, and over all periods before."""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from math import ceil

from guarantee_loop import Fade, Loop
from guarantee_numbers import Fixed, column, exponentials, fixed
from guarantee_reading import Refused, Row, need

DOUBLINGS = 12  # at most 4096 periods are summed
SHARE = 256  # what is left of the past after those is below a 256th
MAX_WORK = 3 * 10**7  # products of integers


@dataclass
class Flow:
    """One event and the flow after it, cut into pieces, for one input.

    It enters at every time, with the event alone (`sudden`), or less and less (`masses`, of every piece).
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

    def ends(self, start: int = 0) -> list[Fixed]:
        """Impulse response from the start of a piece on, at the ends of pieces."""
        found = [self.entry]
        for step in self.steps[start:]:
            found.append(step * found[-1])
        return found

    def slope(self, now: Fixed, i: int) -> Fixed:
        """Bound of the first derivative over a piece that begins like this."""
        return (self.nears[i] * (self.generator * now).size()).size()

    def bend(self, now: Fixed, i: int) -> Fixed:
        """The same of the second derivative."""
        return (self.nears[i] * (self.generator * (self.generator * now)).size()).size()


def cut(loop: Loop, cuts: Sequence[Fraction], entry: Row, sudden: bool, fade: Fade | None = None) -> list[Flow]:
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
    corner = [i for i, (v,) in enumerate(rest.rows) if v]
    diagonal = Fixed([[v if i == j else 0 for j in corner] for i, (v,) in enumerate(rest.rows)])
    first, *others = (end.scaled(weight) for end, weight in summed)
    return first.beside(*others, diagonal)


@dataclass
class Past:
    """All periods before: columns of many of them, and what bounds the rest."""

    columns: Fixed
    far: Fixed
    left: Fixed

    def of(self, rows: Fixed) -> list[int]:
        """Bounds of the integrals for every row; equal rows are done once."""
        once = list(dict.fromkeys(map(tuple, rows.rows)))
        different = Fixed([list(line) for line in once], rows.error)
        rest = ((different * self.far).size() * self.left).size()
        sums = zip((different * self.columns).sums(), rest.rows, strict=True)
        found = dict(zip(once, (near + far for near, (far,) in sums), strict=True))
        return [found[tuple(line)] for line in rows.rows]


def past(flows: list[Flow], rows: int) -> Past:
    """Sum 2^j periods until what is left is below a 256th of every unit row's sum."""
    *earlier, flow = flows
    period, columns = flow.whole, pieces(flow, None)
    for flow in reversed(earlier):
        columns, period = columns.beside(pieces(flow, period)), period * flow.whole
    size = len(period.rows)
    sums = columns.sums()
    for _ in range(DOUBLINGS):
        width = len(columns.rows[0])
        need(2 * width * size * (size + rows) <= MAX_WORK, "the loop must forget its past sooner: it takes too long")
        following = period * columns
        sums = [a + b for a, b in zip(sums, following.sums(), strict=True)]
        columns, period = columns.beside(following), period * period
        left = (period.size() * Fixed([[v] for v in sums])).size()
        if all(v * SHARE <= total for (v,), total in zip(left.rows, sums, strict=True)):
            return Past(columns, period, Fixed([[ceil(Fraction(v * SHARE, SHARE - 1))] for v in sums]))
    raise Refused(f"the nominal loop must be stable, and seen to be within {2**DOUBLINGS} periods")


def integral(flows: list[Flow], before: Past, rows: Fixed) -> list[int]:
    """Bounds for rows that act after the given flows of this period, and before the event of the next."""
    if not flows:
        return before.of(rows)
    own = (rows * pieces(flows[-1], None)).sums()
    return [a + b for a, b in zip(own, integral(flows[:-1], before, rows * flows[-1].whole), strict=True)]
