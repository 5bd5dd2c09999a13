"""Matrices of integers in units of 2^-BITS, each with a bound of its error, and their exponentials."""

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import chain, compress, count
from math import factorial, lcm

from .reading import Row, need

BITS = 192
MANY, COARSE, PLACE = 64, 60, 128  # columns that are multiplied at once, bits of their entries and of a product's place
LARGEST = 1 << 2 * BITS  # in units of 2^-BITS: larger entries are rejected


def zeros(size: int) -> list[Row]:
    """Square matrix of zeros."""
    return [[Fraction(0)] * size for _ in range(size)]


def unit(size: int) -> list[Row]:
    """Unit matrix."""
    return [[Fraction(i == j) for j in range(size)] for i in range(size)]


@dataclass
class Fixed:
    """Matrix of integers in units of 2^-BITS; no entry is farther from the true one than `error` units."""

    rows: list[list[int]]
    error: int = 0

    def __hash__(self) -> int:  # rows are never changed
        return hash((*map(tuple, self.rows), self.error))

    def __mul__(self, other: "Fixed") -> "Fixed":
        columns = list(zip(*other.rows, strict=True))
        if len(columns) >= MANY:
            exact = long_product(self.rows, other.rows)
        elif len(self.rows) >= MANY and columns:
            exact = zip(*long_product(columns, zip(*self.rows, strict=True)), strict=True)
        else:
            exact = (combined(line, other.rows, columns) for line in self.rows)
        rows = [[v >> BITS for v in line] for line in exact]
        widest = max(sum(map(abs, line)) for line in self.rows) + self.error * len(self.rows[0])
        tallest = max((sum(map(abs, column)) for column in columns), default=0)
        return bounded(Fixed(rows, (widest * other.error + tallest * self.error >> BITS) + 2))

    def __add__(self, other: "Fixed") -> "Fixed":
        rows = [[a + b for a, b in zip(*lines, strict=True)] for lines in zip(self.rows, other.rows, strict=True)]
        return Fixed(rows, self.error + other.error)

    def scaled(self, factor: Fraction) -> "Fixed":
        """Times a number that is not negative."""
        top, bottom = factor.numerator, factor.denominator
        return bounded(Fixed([[v * top // bottom for v in line] for line in self.rows], self.error * top // bottom + 2))

    def size(self) -> "Fixed":
        """Upper bounds of the absolute values, exact."""
        return Fixed([[abs(v) + self.error for v in line] for line in self.rows])

    def beside(self, *others: "Fixed") -> "Fixed":
        """Columns of several matrices side by side."""
        parts = (self, *others)
        rows = [[v for line in lines for v in line] for lines in zip(*(p.rows for p in parts), strict=True)]
        return Fixed(rows, max(p.error for p in parts))

    def above(self, *others: "Fixed") -> "Fixed":
        """Rows of several matrices, one after another."""
        parts = (self, *others)
        return Fixed([line for p in parts for line in p.rows], max(p.error for p in parts))

    def sums(self) -> list[int]:
        """Upper bounds of the sums of absolute values, row by row."""
        return [sum(map(abs, line)) + self.error * len(line) for line in self.rows]


def combined(line: list[int], rows: list[list[int]], columns: list[tuple[int, ...]]) -> list[int]:
    """A row times a matrix; most entries of a flow are 0."""
    few = list(filter(None, line))
    if 2 * len(few) > len(line):
        return [sum(map(int.__mul__, line, column)) for column in columns]
    picked = zip(*compress(rows, line), strict=True) if few else [()] * len(columns)
    return [sum(map(int.__mul__, few, entries)) for entries in picked]


def long_product(left: Iterable[Sequence[int]], right: Iterable[Sequence[int]]) -> list[list[int]]:
    """The same of all rows: many columns at once, side by side in one long integer in places of whole bytes."""
    left, right = list(left), list(right)
    count, bits = len(right[0]), [max(max(map(abs, line)) for line in m).bit_length() for m in (left, right)]
    width = (sum(bits) + len(right).bit_length()) // 8 + 1
    half = 1 << 8 * width - 1
    offset = int.from_bytes(half.to_bytes(width, "little") * count, "little")
    shifted = (b"".join([(v + half).to_bytes(width, "little") for v in line]) for line in right)
    places = [int.from_bytes(line, "little") - offset for line in shifted]
    found = [(sum(map(int.__mul__, line, places)) + offset).to_bytes(width * count, "little") for line in left]
    starts = range(0, width * count, width)
    return [[int.from_bytes(line[i : i + width], "little") - half for i in starts] for line in found]


def sums_of_product(left: Fixed, right: Fixed) -> list[int]:
    """What `(left * right).sums()` bounds, a little above it: many columns at once, side by side in one long integer.

    Entries are cut to 60 bits, those of `left` row by row; a place has 128 bits, of which the upper half is read. With
    l = l' + d and r = r' + e a sum of |l*r| is at most that of |l'*r'| and |l'| times all e and d times all |r|.
    """
    count, cut = len(right.rows[0]), cut_of(right.rows)
    if count < MANY or not cut:
        return (left * right).sums()
    ones = sum_of_places(count)
    places = [pack([(v >> cut) + (1 << COARSE + 1) for v in line]) - (ones << COARSE + 1) for line in right.rows]
    whole = sum(sum(map(abs, line)) + right.error * count for line in right.rows)
    found = []
    for line in left.rows:
        own = cut_of([line])
        near = [v >> own for v in line]
        signs = ones << PLACE - 1
        total = sum(map(int.__mul__, near, places)) + signs ^ signs  # every place for itself, in two's complement
        halves = struct.unpack(f"<{2 * count}q", total.to_bytes(count * PLACE // 8, "little"))[1::2]
        coarse = sum(map(abs, halves)) + count << PLACE // 2 + own + cut
        off = count * ((1 << cut) + right.error) * sum(map(abs, near)) << own
        found.append((coarse + off + ((1 << own) + left.error) * whole >> BITS) + 1)
    return found


def cut_of(rows: list[list[int]]) -> int:
    """How many bits the largest entry has beyond COARSE."""
    return max(max(*map(max, rows), ~min(map(min, rows))).bit_length() - COARSE, 0)


def pack(values: list[int]) -> int:
    """Integers of 64 bits, each at the beginning of its place."""
    return int.from_bytes(struct.pack(f"<{2 * len(values)}Q", *chain.from_iterable((v, 0) for v in values)), "little")


@lru_cache(maxsize=64)
def sum_of_places(count: int) -> int:
    """1 at every place."""
    return pack([1] * count)


def bounded(value: Fixed) -> Fixed:
    """Refuse numbers that only an unstable or absurd loop can have."""
    largest = max(map(abs, chain([value.error], *value.rows)))
    need(largest <= LARGEST, "the nominal loop must be stable, with numbers below 2^192")
    return value


def fixed(rows: Sequence[Sequence[Fraction]]) -> Fixed:
    """Nearest multiples below."""
    return bounded(Fixed([[(v.numerator << BITS) // v.denominator for v in line] for line in rows], 1))


def column(values: Sequence[Fraction]) -> Fixed:
    """One column."""
    return fixed([[v] for v in values])


def exponential(flow: list[Row], time: Fraction) -> Fixed:
    """e^{At} by a Taylor sum at t/2^j and squaring."""
    norm = max(sum(map(abs, line)) for line in flow) * time
    need(norm <= 1 << 12, "the flow between two events must have a norm of at most 4096")
    halvings = int(norm).bit_length()  # to a norm below 1
    base = fixed([[v * time / 2**halvings for v in line] for line in flow])
    term = total = fixed(unit(len(flow)))
    terms = next(n for n in count(2) if factorial(n) >> BITS + 1)
    for k in range(1, terms):
        term = (term * base).scaled(Fraction(1, k))
        total = total + term
    # the remainder after n terms is below 2/n!: less than the unit of error that the exact first term does not use
    for _ in range(halvings):
        total = total * total
    return total


def exponentials(flow: list[Row], times: Row) -> list[Fixed]:
    """The same of several times, as powers of that of the longest time that goes into all of them."""
    return shared_exponentials(tuple(map(tuple, flow)), tuple(times), BITS)


@lru_cache(maxsize=16)  # the same for all inputs of a loop
def shared_exponentials(flow: tuple[tuple[Fraction, ...], ...], times: tuple[Fraction, ...], _: int) -> list[Fixed]:
    """The same, computed once in so many bits."""
    grain = times[0] / lcm(*((times[0] / time).numerator for time in times))
    found = {1: exponential([list(line) for line in flow], grain)}

    def power(k: int) -> Fixed:
        if k not in found:
            half = power(k // 2)
            found[k] = half * half * found[1] if k % 2 else half * half
        return found[k]

    return [power(int(time / grain)) for time in times]
