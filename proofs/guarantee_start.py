"""A start away from rest: bounds of every output of the free response, from every point of a box (FORMAT.md)."""

from collections.abc import Iterator
from fractions import Fraction

from guarantee_gains import in_even_units
from guarantee_impulse_sums import DOUBLINGS, MAX_WORK, SHARE, Flow, cut, seen_alone, slowest
from guarantee_loop import Loop
from guarantee_numbers import BITS, Fixed, fixed
from guarantee_reading import Refused, Row, need

FAINT = 60  # bits below the largest bound, by which all are raised so that none is 0


def start_gains(loop: Loop) -> list[list[Fraction]]:
    """Bounds of every output on every piece of the period, as those of an input of size 1."""
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
    """States at the beginning of K periods; W^-1 after them, and what no W times a state exceeds, ever.

    K = 2^j periods, until a 1024th of these bounds is left but for the slowest mode, which has to fall.
    """
    size, count = len(start.rows), len(start.rows[0])
    period = flows[0].whole
    for flow in flows[1:]:
        period = flow.whole * period
    row, columns, even = slowest(period), start, [1 << BITS] * count
    for _ in range(DOUBLINGS):
        width = 2 * len(columns.rows[0])
        need(2 * width * size * (size + rows) <= MAX_WORK, "the loop must forget its start sooner: it takes too long")
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
    raise Refused(f"the nominal loop must be stable, and seen to be within {2**DOUBLINGS} periods")


def product(line: list[int], values: list[int]) -> Fraction:
    """Of a row of sizes and a column."""
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
