"""Sampled loop of an uncertain plant and a linear multivariable law; response bounds.

Chapters: the loop in exact matrices; L1 norms of all outputs for all inputs at once, in ball arithmetic.
"""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from itertools import pairwise
from typing import Any

from flint import arb, arb_mat, ctx, fmpq, fmpq_mat

from quakedesign.errors import ParameterError
from quakedesign.exact import apart, end_of, shortly
from quakedesign.guarantees.exact.norms import absolute, ball, beside, column, identity, majorant, matrix
from quakedesign.plant.plant_values import ExactSector, Matrix, Row, SlowLoad, unit

# ----------------------------------------------------------------------
# The loop: states of the plant, of the law, controls on their way, controls that act.

MOST_PERIODS = 8
MOST_LOOP_STATES = 96


@dataclass(frozen=True, slots=True, kw_only=True)
class MatrixLaw:
    """Sampled law u = Cz + Dy, z⁺ = Az + By with z = 0 at first; u acts `delay` later."""

    step: Fraction
    delay: Fraction
    update: Matrix
    measured: Matrix
    output: Matrix
    feedback: Matrix

    def __post_init__(self) -> None:
        if self.step <= 0 or not 0 <= self.delay <= MOST_PERIODS * self.step:
            received, most = apart(self.delay, MOST_PERIODS * self.step)
            raise ParameterError(
                f"a law needs a positive step and a delay of 0 to {MOST_PERIODS} steps, here {most} s. Received the "
                f"step {shortly(self.step)} s and the delay {received} s."
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantLoop:
    """x′ = Fx + Σ b·w between jumps, the first jump at t = 0, with the rows that are bounded.

    Attributes
    ----------
    flow : Matrix
    segments : tuple of (Matrix, Fraction)
        Jump and the time [s] that follows it.
    inputs : tuple of Row
        Columns of inputs that flow: disturbances, loads, sectors.
    sampled : tuple of Row
        Columns of noise, which enters with the first jump.
    start : tuple of Row
        Columns of the box of starts.
    rows : tuple of Row
        Outputs, arguments of sectors, controls.
    """

    flow: Matrix
    segments: tuple[tuple[Matrix, Fraction], ...]
    inputs: tuple[Row, ...]
    sampled: tuple[Row, ...]
    start: tuple[Row, ...]
    rows: tuple[Row, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearPart:
    """An uncertain plant in exact numbers, as a certificate states it."""

    A: Matrix
    B: Matrix
    C: Matrix
    disturbances: tuple[tuple[Row, Fraction], ...]
    loads: tuple[SlowLoad, ...]
    sectors: tuple[ExactSector, ...]
    noise: Row
    start: Row
    outputs: Matrix

    def loop(self, law: MatrixLaw) -> PlantLoop:
        """Loop about the balance of the loads, each sector at its middle.

        Raises
        ------
        ParameterError
            For sizes that do not fit, too many states, or a load that the law cannot hold.
        """
        n, m, q, zero = len(self.A), len(self.B[0]), len(law.update), Fraction(0)
        seen = len(self.C)
        for name, entries, height, width in (
            ("A", law.update, q, q),
            ("B", law.measured, q, seen),
            ("C", law.output, m, q),
            ("D", law.feedback, m, seen),
        ):
            if [len(row) for row in entries] != [width] * height:
                raise ParameterError(
                    f"matrix {name} of a law for this plant must be {height} x {width}, as {seen} signals are measured "
                    f"and there are {m} controls. Received {len(entries)} rows of "
                    f"{', '.join(map(str, sorted({len(row) for row in entries}))) or 'no'} entries."
                )
        part = law.delay % law.step
        waiting = int(law.delay // law.step) + (part > 0)
        size = n + q + m * (waiting + 1)
        if size > MOST_LOOP_STATES:
            raise ParameterError(f"a loop must have at most {MOST_LOOP_STATES} states. Received {size}.")
        first = size - m
        flow = [[zero] * size for _ in range(size)]
        for i in range(n):
            flow[i][:n], flow[i][first:] = self.A[i], self.B[i]
        for sector in self.sectors:
            middle = sum(sector.slopes, zero) / 2
            for i, entered in enumerate(sector.entry):
                for j, weight in enumerate(sector.row):
                    flow[i][j if j < n else first + j - n] += middle * entered * weight
        jump = [list(unit(size, i)) for i in range(size)]
        for target, own, fed in (
            *((n + i, law.update[i], law.measured[i]) for i in range(q)),
            *((n + q + k, law.output[k], law.feedback[k]) for k in range(m)),
        ):
            line = [sum((fed[a] * self.C[a][j] for a in range(seen) if fed[a]), zero) for j in range(n)]
            jump[target] = [*line, *own, *[zero] * (size - n - q)]
        for place in range(n + q + m, size if not part else first):  # controls on their way move one place on
            jump[place] = list(unit(size, place - m))
        arrival = [list(unit(size, i if i < first else i - m)) for i in range(size)]
        segments = [(jump, part or law.step), *([(arrival, law.step - part)] if part else [])]
        rows = [(*row, *[zero] * (size - n)) for row in self.outputs]
        rows += [(*s.row[:n], *[zero] * (first - n), *s.row[n:]) for s in self.sectors]
        rows += [unit(size, first + k) for k in range(m)]
        columns = [(*entry, *[zero] * (size - n)) for entry, _ in self.disturbances]
        columns += [self._moved(load, law, waiting + 1) for load in self.loads]
        columns += [(*s.entry, *[zero] * (size - n)) for s in self.sectors]
        noise_columns = [
            (*[zero] * n, *(row[a] for row in (*law.measured, *law.feedback)), *[zero] * (size - n - q - m))
            for a in range(seen)
            if self.noise[a]
        ]
        return PlantLoop(
            flow=tuple(map(tuple, flow)),
            segments=tuple((tuple(map(tuple, one)), time) for one, time in segments),
            inputs=tuple(columns),
            sampled=tuple(noise_columns),
            start=tuple(tuple(v * s for v in unit(size, i)) for i, s in enumerate(self.start) if s),
            rows=tuple(rows),
        )

    def _moved(self, load: SlowLoad, law: MatrixLaw, places: int) -> Row:
        """Effect of a load rate on the states, which are relative to the equilibrium."""
        q, zero = len(law.update), Fraction(0)
        rows = [[*(v - (i == j) for j, v in enumerate(row)), zero] for i, row in enumerate(law.update)]
        rows += [[*row, e] for row, e in zip(law.output, load.control, strict=True)]
        steady = solved(rows, q)
        return (*(-v for v in load.shift), *(-v for v in steady), *[-v for v in load.control] * places)


def solved(rows: Sequence[Sequence[Fraction]], unknowns: int) -> Row:
    """Some solution of linear equations, each a row with its right-hand side last.

    Raises
    ------
    ParameterError
        When there is none.
    """
    if not rows or not unknowns:
        consistent, solution = all(row[-1] == 0 for row in rows), [Fraction(0)] * unknowns
    else:
        reduced, rank = fmpq_mat([[fmpq(v.numerator, v.denominator) for v in row] for row in rows]).rref()
        solution, consistent = [Fraction(0)] * unknowns, True
        for i in range(rank):
            pivot = next(j for j in range(unknowns + 1) if reduced[i, j] != 0)
            consistent = consistent and pivot < unknowns
            if pivot < unknowns:
                solution[pivot] = Fraction(int(reduced[i, unknowns].p), int(reduced[i, unknowns].q))
    if not consistent:
        raise ParameterError(
            "a law must hold every load without an error at balance. Received a law without integral action for one. "
            "Add an integral, or an estimate of the load."
        )
    return tuple(solution)


# ----------------------------------------------------------------------
# L1 norms of all rows for all inputs at once. The statements and their proofs are those of `norms`; but here the
# remainders of all inputs are bounded by the sums for unit columns, which are formed once, and periods are followed by
# rows: with P_k = rows·Ψᵏ the sums of |P_k·columns| over k < K are formed, and what is left is bounded by x with
# y + |Ψᴷ|x ≤ x, y those sums for unit rows.

_BITS = (128, 256)  # of the balls; more where fewer do not show that the loop forgets
_AT_ONCE = 8  # periods
_MOST_WORK = 12 * 10**8
_BEYOND = 64  # times as many periods as may be followed, within which the map of one that forgets is small
_LEFT = Fraction(1, 1024)
_ROOM = Fraction((1 << 20) + 1, 1 << 20)
_FAINT = Fraction(1, 1 << 60)


@dataclass(frozen=True, slots=True)
class ResponseBounds:
    """Bounds of every row: per flowing input, per sampled input, and of the initial states."""

    inputs: tuple[Row, ...]
    sampled: tuple[Row, ...]
    start: Row


def response_bounds(loop: PlantLoop, pieces: int) -> ResponseBounds:
    """L1 norms and free response of a loop, each flow cut into equal pieces.

    Raises
    ------
    ParameterError
        When the loop is not found to be stable, or takes too long.
    """
    *few, most = _BITS
    for bits in few:
        with ctx.workprec(bits), suppress(ParameterError):
            return _AllResponses(loop, pieces).bounds()
    with ctx.workprec(most):
        return _AllResponses(loop, pieces).bounds()


class _AllResponses:
    """Matrices of one loop in balls."""

    def __init__(self, loop: PlantLoop, pieces: int) -> None:
        self.loop, self.pieces, self.size = loop, pieces, len(loop.flow)
        self.flow, self.rows = matrix(loop.flow), matrix(loop.rows)
        self.square = self.flow * self.flow
        kinds: dict[Row, int] = {}
        self.kind = [kinds.setdefault(entry, len(kinds)) for entry in loop.inputs]
        self.entries = [column(entry) for entry in kinds]
        self.kinds = len(kinds)
        self.jumps = [matrix(jump) for jump, _ in loop.segments]
        self.lengths = [ball(time / pieces) for _, time in loop.segments]
        self.steps = [(self.flow * h).exp() for h in self.lengths]
        self.powers = [self._powers(step) for step in self.steps]
        self.near = [absolute((majorant(self.flow) * h).exp()) for h in self.lengths]
        self.within = [absolute((majorant(self.flow) * (h * pieces)).exp()) for h in self.lengths]

    def _powers(self, step: Any) -> list[Any]:
        powers = [identity(self.size)]
        for _ in range(self.pieces):
            powers.append(step * powers[-1])
        return powers

    def bounds(self) -> ResponseBounds:
        """The bounds."""
        wholes = [powers[-1] * jump for powers, jump in zip(self.powers, self.jumps, strict=True)]
        earlier, period = [identity(self.size)], identity(self.size)
        for whole in wholes:
            period = whole * period
            earlier.append(period)
        later, after = [identity(self.size)], identity(self.size)
        for whole in reversed(wholes[1:]):
            after = after * whole
            later.insert(0, after)
        blocks, rests = zip(*(self._own(s, later[s]) for s in range(len(wholes))), strict=True)
        first, first_rests = self._own(0, identity(self.size)) if len(wholes) > 1 else ([], [])
        # all periods before: groups of columns for every input, units for the remainders
        own = [beside([block[i] for block in blocks]) for i in range(self.kinds)]
        own += [later[0] * self.powers[0][-1] * column(entry) for entry in self.loop.sampled]
        left = [reduce(lambda a, b: a + b, (rest[i] for rest in rests)) for i in range(self.kinds)]
        left += [arb_mat(self.size, 1)] * len(self.loop.sampled)
        rows = [
            _above([self.rows * power for power in powers] + [identity(self.size)]) * jump * before
            for powers, jump, before in zip(self.powers, self.jumps, earlier, strict=False)
        ]
        sums, free = self._all_periods(_above([*rows, identity(self.size)]), period, own, left)
        count = len(self.loop.rows)
        places = (self.pieces + 1) * count + self.size
        inputs = [[Fraction(0)] * count for _ in own]
        start = [Fraction(0)] * count
        for s in range(len(rows)):
            span = range(s * places, (s + 1) * places)
            before = [[sums[r][i] for r in span] for i in range(len(own))]
            if s:  # what entered earlier in this period
                seen = _above([self.rows * power for power in self.powers[s]] + [identity(self.size)]) * self.jumps[s]
                for i in range(self.kinds):
                    near, rest = absolute(seen * first[i]), absolute(seen) * first_rests[i]
                    before[i] = [
                        v + sum(line, arb(0)) + rest[r, 0]
                        for r, (v, line) in enumerate(zip(before[i], near.tolist(), strict=True))
                    ]
            for i in range(len(own)):
                peaks = self._peaks(s, i, before[i])
                inputs[i] = [max(a, b) for a, b in zip(inputs[i], peaks, strict=True)]
            if self.loop.start:
                peaks = self._chorded(s, [free[r] for r in span], None)
                start = [max(a, b) for a, b in zip(start, peaks, strict=True)]
        return ResponseBounds(
            inputs=tuple(tuple(inputs[kind]) for kind in self.kind),
            sampled=tuple(map(tuple, inputs[self.kinds :])),
            start=tuple(start),
        )

    def _own(self, s: int, later: Any) -> tuple[list[Any], list[Any]]:
        """Columns and remainder of every flowing input over one segment, at the end of the period."""
        h, powers = self.lengths[s], self.powers[s]
        columns, rests = [], []
        for entry in self.entries:
            ends = [power * entry for power in powers]
            widths = [h / 2, *[h] * (self.pieces - 1), h / 2]
            columns.append(later * beside([end * width for end, width in zip(ends, widths, strict=True)]))
            bends = (self.near[s] * absolute(self.square * end) for end in ends[:-1])
            rest = reduce(lambda a, b: a + b, bends) * (h**3 / 12)
            rests.append(absolute(later) * rest)
        return columns, rests

    def _all_periods(
        self, rows: Any, period: Any, own: list[Any], left: list[Any]
    ) -> tuple[list[list[Any]], list[Any]]:
        """Sums over all periods by row and input, and the largest free response by row."""
        size, groups = self.size, [block.ncols() for block in own]
        start = [column(entry) for entry in self.loop.start]
        columns = beside([*own, identity(size), *start])
        ends = [0, *_accumulated([*groups, *[1] * size, len(start)])]
        now, height, width = rows, rows.nrows(), columns.ncols()
        sums = [[arb(0)] * (len(groups) + size) for _ in range(height)]
        free = [arb(0)] * height
        turned = [columns]  # after some periods: products of many maps, one after another, would lose all digits
        for _ in range(_AT_ONCE - 1):
            turned.append(period * turned[-1])
        leap, check, done = period**_AT_ONCE, _AT_ONCE, 0
        _require_fading(leap, height * size * (width + size))
        while True:
            if check * height * size * (width + size) > _MOST_WORK:
                raise _unstable()
            for _ in range((check - done) // _AT_ONCE):
                for late in turned:
                    for r, line in enumerate((now * late).tolist()):
                        parts = [sum(map(abs, line[a:b]), arb(0)) for a, b in pairwise(ends)]
                        sums[r] = [a + b for a, b in zip(sums[r], parts[:-1], strict=True)]
                        free[r] = free[r].max(parts[-1])
                now = now * leap
            done, check = check, 2 * check
            units = range(height - size, height)
            far = absolute(arb_mat([now.tolist()[r] for r in units]))
            if not all(v < 1 << 80 for v in far.entries()):
                raise _unstable()
            totals = [self._total(sums, i, left) for i in range(len(own))]
            wholes = [_raised([totals[i][r] for r in units]) for i in range(len(own))]
            most = _raised([free[r] for r in units])
            if all(_fades(far, part) for part in wholes) and (not start or _fades(far, most)):
                break
        beyond = absolute(now)
        for i, part in enumerate(wholes):
            solution = _bounded(far, part)
            more = (beyond * arb_mat([[v] for v in solution])).entries()
            totals[i] = [(a + b).abs_upper() for a, b in zip(totals[i], more, strict=True)]
        if start:
            most = [(v * ball(_ROOM)).abs_upper() for v in most]
            if not all(a <= b for a, b in zip((far * arb_mat([[v] for v in most])).entries(), most, strict=True)):
                raise _unstable()
            more = (beyond * arb_mat([[v] for v in most])).entries()
            free = [a.max(b).abs_upper() for a, b in zip(free, more, strict=True)]
        return [[totals[i][r] for i in range(len(own))] for r in range(height)], free

    def _total(self, sums: list[list[Any]], i: int, left: list[Any]) -> list[Any]:
        """Sums for an input with its remainders, by those for unit columns."""
        count, rest = len(left), left[i].entries()
        used = [j for j, v in enumerate(rest) if not v.is_zero()]
        return [line[i] + sum((line[count + j] * rest[j] for j in used), arb(0)) for line in sums]

    def _peaks(self, s: int, i: int, before: list[Any]) -> list[Fraction]:
        """Bounds of all rows in a segment for an input, from what came before it."""
        count, h = len(self.loop.rows), self.lengths[s]
        if i >= self.kinds:
            entry = column(self.loop.sampled[i - self.kinds])
            entry = entry if s == 0 else self.jumps[1] * self.powers[0][-1] * entry
            since = [absolute(self.rows * (power * entry)).entries() for power in self.powers[s]]
            bend = (absolute(self.rows * self.square) * self.within[s] * absolute(entry)).entries()
            return self._chorded(s, before, (since, bend), sampled=True)
        entry = self.entries[i]
        heights = [absolute(self.rows * (power * entry)).entries() for power in self.powers[s]]
        bend = (absolute(self.rows * self.square) * self.within[s] * absolute(entry)).entries()
        slope = (absolute(self.rows * self.flow) * self.within[s] * absolute(entry)).entries()
        since = [[arb(0)] * count]
        for a, b in pairwise(heights):
            since.append(
                [t + (x + y) * h / 2 + c * h**3 / 12 for t, x, y, c in zip(since[-1], a, b, bend, strict=True)]
            )
        return self._chorded(s, before, (since, slope))

    def _chorded(self, s: int, before: list[Any], since: Any, *, sampled: bool = False) -> list[Fraction]:
        """Largest of all pieces: of both ends, with what chords leave out."""
        count, h = len(self.loop.rows), self.lengths[s]
        units = arb_mat([[v] for v in before[-self.size :]])
        bent = (absolute(self.rows * self.square) * self.within[s] * units).entries()
        ends = [before[i * count : (i + 1) * count] for i in range(self.pieces + 1)]
        if since is not None:
            ends = [[a + b for a, b in zip(*pair, strict=True)] for pair in zip(ends, since[0], strict=True)]
            bent = [a + b for a, b in zip(bent, since[1], strict=True)]
        peaks = [reduce(arb.max, values) for values in zip(*ends, strict=True)]
        return [end_of((peak + b * h**2 / 8).upper()) for peak, b in zip(peaks, bent, strict=True)]


def _accumulated(counts: Iterable[int]) -> list[int]:
    sums: list[int] = []
    for count in counts:
        sums.append(count + (sums[-1] if sums else 0))
    return sums


def _above(parts: list[Any]) -> Any:
    return arb_mat([list(row) for part in parts for row in part.tolist()])


def _raised(part: list[Any]) -> list[Any]:
    """Bounds of which none is 0, each a little larger."""
    faint = reduce(arb.max, part) * ball(_FAINT)
    return [(v + faint).abs_upper() for v in part]


def _fades(far: Any, part: list[Any]) -> bool:
    """Whether what a map leaves of bounds is a small share."""
    later = (far * arb_mat([[v] for v in part])).entries()
    return all(a <= b * ball(_LEFT) for a, b in zip(later, part, strict=True))


def _bounded(far: Any, part: list[Any]) -> list[Any]:
    """Some x with part + far·x ≤ x."""
    bounds = [(v * ball(1 + 2 * _LEFT)).abs_upper() for v in part]
    later = (far * arb_mat([[v] for v in bounds])).entries()
    if not all(a + b <= x for a, b, x in zip(part, later, bounds, strict=True)):
        raise _unstable()
    return bounds


def _require_fading(leap: Any, work: int) -> None:
    """Reject a map of several periods that has no small power within the work limit."""
    power, periods = leap, _AT_ONCE
    while not all(v < 1 for v in absolute(power).entries()):
        if periods * work > _BEYOND * _MOST_WORK or not all(v < 1 << 80 for v in absolute(power).entries()):
            raise _unstable()
        power, periods = power * power, 2 * periods


def _unstable() -> ParameterError:
    return ParameterError(
        "the nominal loop must be stable, and forget its past soon. Received a loop of which this is not proved. "
        "Change the law or the step."
    )
