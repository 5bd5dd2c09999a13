"""Aperiodic sampling: an invariant set of the state at the samples, as a file states it (FORMAT.md)."""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any

from .bounds import inputs
from .impulse_sums import majorant
from .loop import Loop
from .matrices import BITS, Fixed, column, exponential, fixed, unit
from .reading import Row, keys, matrix, need, row
from .task import Task

MAX_FACETS, MAX_PIECES, MAX_ENTRIES, MAX_BASES, TOO_LARGE = 400, 32, 6, 4000, 10**20
SOONEST = 4  # pieces of the shortest interval
Basis = tuple[int, ...]


@dataclass
class Reach:
    """Bounds of the inputs, rows h with |h x| <= 1 in the set, and the rows that bound each row at ends of pieces."""

    inputs: Row
    facets: list[Row]
    at_samples: list[list[Basis]]
    between: list[list[Basis]]


def read_reach(value: Any, loop: Loop) -> Reach:
    """Read the set and its bases, in the dimensions of the loop."""
    given = keys(value, "reach", "inputs", "facets", "at_samples", "between")
    size, facets = len(reduced(loop.events[0][0])[0]), given["facets"]
    need(type(facets) is list and size <= len(facets) <= MAX_FACETS, f"reach needs {size} to {MAX_FACETS} facets")
    bounds = row(given["inputs"], "inputs", len(loop.inputs))
    need(min(bounds) >= 0, "bounds of the inputs must be >= 0")
    lines = matrix(facets, "facets", len(facets), size)
    need(size <= MAX_ENTRIES, f"facets must have at most {MAX_ENTRIES} entries")
    ordinary = all(max(abs(v.numerator), v.denominator) < TOO_LARGE for line in lines for v in line)
    need(ordinary, "numbers in facets must have at most 20 digits")
    counts = [("at_samples", len(lines)), ("between", len(loop.outputs))]
    at_samples, between = (read_bases(given[name], name, count, size, len(lines)) for name, count in counts)
    need(sum(map(len, [*at_samples, *between])) <= MAX_BASES, f"there must be at most {MAX_BASES} bases")
    return Reach(bounds, lines, at_samples, between)


def read_bases(value: Any, what: str, count: int, size: int, facets: int) -> list[list[Basis]]:
    """Read the indices of facets for every row, at the ends of as many pieces for all of them."""
    need(type(value) is list and len(value) == count, f"{what} must have {count} rows")
    need(all(type(line) is list for line in value), f"{what} must be rows")
    need(2 <= len(value[0]) <= MAX_PIECES + 1, f"{what} must have 1 to {MAX_PIECES} pieces")
    need(len({*map(len, value)}) == 1, f"{what} must have the same pieces in every row")
    for basis in (basis for line in value for basis in line):
        need(type(basis) is list and len(basis) == size, f"{what} must name {size} facets each time")
        need(all(type(i) is int and 0 <= i < facets for i in basis), f"{what} must name facets by their numbers")
    return [[tuple(basis) for basis in line] for line in value]


def bounds_within(task: Task, loop: Loop, reach: Reach) -> tuple[Row, Fraction]:
    """Bounds of |e1|, |e2| and b|p - p*|, and the largest share of an input that comes from outputs."""
    peaks = Between(loop, reach).outputs(reach)
    half = [(high - low) / 2 for low, high in (task.s, task.w, task.beta)]
    force, drift, coupling, shifted = inputs(task, half[2])
    own = [force, drift, *(loop.noise[k] for k in loop.told)]
    of_force = sum(c * v for c, v in zip(half, peaks, strict=True))
    shares = [of_force, coupling * peaks[1], *[Fraction(0)] * len(loop.told)]
    for least, share, bound in zip(own, shares, reach.inputs, strict=True):
        need(least + share <= bound, "the inputs must stay within the bounds that reach gives")
    parts = zip(shares, reach.inputs, strict=True)
    small = max((share / bound for share, bound in parts if bound), default=Fraction(0))
    return [peaks[0], peaks[1], peaks[2] + shifted], small


def reduced(event: list[Row]) -> tuple[list[Row], list[Row]]:
    """B and C with CB the map of a sample: its reduced rows that are not zero, and its columns at their pivots."""
    rows, pivots = [list(line) for line in event], list[int]()
    for place in range(len(event[0])):
        found = next((i for i in range(len(pivots), len(rows)) if rows[i][place]), None)
        if found is None:
            continue
        top = len(pivots)
        rows[top], rows[found] = rows[found], rows[top]
        rows[top] = [v / rows[top][place] for v in rows[top]]
        for i, line in enumerate(rows):
            if i != top and line[place]:
                rows[i] = [v - line[place] * p for v, p in zip(line, rows[top], strict=True)]
        pivots.append(place)
    return rows[: len(pivots)], [[line[i] for i in pivots] for line in event]


class Between:
    """Bounds of rows of the state from a sample to the next one."""

    def __init__(self, loop: Loop, reach: Reach) -> None:
        self.loop, self.facets = loop, reach.facets
        seen, kept = reduced(loop.events[0][0])
        self.seen, self.kept, self.flow = fixed(seen), fixed(kept), fixed(loop.flow)
        self.square = self.flow * self.flow
        entries = [(column(entry), bound) for entry, bound in zip(loop.inputs, reach.inputs, strict=True)]
        self.flowing, self.sampled = entries[:2], entries[2:]
        self.inverse = lru_cache(None)(self.inverse_of)
        self.step = lru_cache(None)(self.step_of)

    def outputs(self, reach: Reach) -> Row:
        """Bounds of the outputs; refused where the state may leave the set."""
        soonest, latest = self.loop.step, self.loop.longest
        ends = [soonest * i / SOONEST for i in range(SOONEST)] + even_ends(
            soonest, latest, len(reach.at_samples[0]) - 1
        )
        for facet, bases in zip(reach.facets, reach.at_samples, strict=True):
            leaves = self.largest(fixed([facet]) * self.seen, ends, bases) > 1
            need(not leaves, "the state at every sample must stay in the set")
        ends = even_ends(Fraction(0), latest, len(reach.between[0]) - 1)
        outputs = zip(self.loop.outputs, reach.between, strict=True)
        return [self.largest(fixed([output]), ends, bases) for output, bases in outputs]

    def largest(self, now: Fixed, ends: Row, bases: Sequence[Basis]) -> Fraction:
        """Bound of a row of the state at every time after a sample, from the end with the first of the bases on."""
        first, area, found = len(ends) - len(bases), Fraction(0), Fraction(0)
        for i, h in enumerate(end - start for start, end in pairwise(ends)):
            step, near = self.step(h)
            following = now * step
            bent, slope = (((now * flow).size() * near).size() for flow in (self.square, self.flow))
            low = self.height(now, bases[i - first]) + area if i >= first else Fraction(0)
            bend = bound_of(bent * self.state)
            for entry, bound in self.flowing:
                curve = bound_of(bent * entry.size())
                area += bound * ((bound_of(now * entry) + bound_of(following * entry)) * h / 2 + curve * h**3 / 12)
                bend += bound * bound_of(slope * entry.size())
            if i >= first:
                high = self.height(following, bases[i + 1 - first]) + area
                found = max(found, max(low, high) + bend * h**2 / 8)
            now = following
        return found

    def height(self, now: Fixed, basis: Basis) -> Fraction:
        """Bound of the row right after a sample, from that of the facets."""
        told = sum((bound * bound_of(now * entry) for entry, bound in self.sampled), Fraction(0))
        return told + bound_of(now * self.kept * self.inverse(basis))

    @cached_property
    def state(self) -> Fixed:
        """Bounds of the state right after a sample."""
        frame = Fixed([[v] for v in self.inverse(tuple(range(len(self.facets[0])))).sums()])
        found = (self.kept.size() * frame).size()
        for entry, bound in self.sampled:
            found = (found + entry.size().scaled(bound)).size()
        return found

    def step_of(self, time: Fraction) -> tuple[Fixed, Fixed]:
        """Map of the flow over a time, and a bound of it at any earlier time."""
        return exponential(self.loop.flow, time), exponential(majorant(self.loop.flow), time).size()

    def inverse_of(self, basis: Basis) -> Fixed:
        """Inverse of the matrix of some facets."""
        count = len(basis)
        lines = [[*self.facets[i], *ones] for i, ones in zip(basis, unit(count), strict=True)]
        rows = reduced(lines)[0]
        independent = [line[:count] for line in rows] == unit(count)
        need(independent, "the facets that bound a row must be independent")
        return fixed([line[count:] for line in rows])


def bound_of(value: Fixed) -> Fraction:
    """Upper bound of the sum of the absolute values of one row."""
    return Fraction(value.sums()[0], 1 << BITS)


def even_ends(start: Fraction, end: Fraction, pieces: int) -> Row:
    """Ends of equal pieces."""
    return [start + (end - start) * i / pieces for i in range(pieces + 1)]
