"""Sampled loop of an uncertain plant and a linear multivariable law; response bounds.

Chapters: the loop in exact matrices; L1 norms of all outputs for all inputs at once, in ball arithmetic.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from itertools import accumulate, pairwise
from operator import add, mul

from flint import arb, arb_mat, ctx, fmpq, fmpq_mat

from quakedesign.errors import ParameterError
from quakedesign.exact import apart, shortly
from quakedesign.guarantees.exact.norms import (
    BALLS,
    absolute,
    ball,
    column,
    hstack,
    identity,
    larger,
    majorant,
    matrix,
    not_above,
    row_sums,
    scaled,
    upper,
    vstack,
)
from quakedesign.plant.plant_values import ExactSector, Matrix, Row, SlowLoad, unit

# ----------------------------------------------------------------------
# The loop: states of the plant and of the law, delayed controls, acting controls.

MOST_PERIODS = 8
MOST_LOOP_STATES = 96


@dataclass(frozen=True, slots=True, kw_only=True)
class MatrixLaw:
    """Sampled law u = Cz + Dy, z⁺ = Az + By with z = 0 initially, period `step` [s]; u acts `delay` [s] later."""

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
    """x′ = Fx + Σ b·w between jumps, the first jump at t = 0, and the rows to be bounded.

    Attributes
    ----------
    flow : Matrix
    segments : tuple of (Matrix, Fraction)
        Jump and the time [s] that follows it.
    inputs : tuple of Row
        Columns of inputs of the flow: disturbances, loads, sectors.
    sampled : tuple of Row
        Columns of noise, which enters with the first jump.
    start : tuple of Row
        Columns of the box of initial states.
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
        """Loop relative to the equilibrium under the loads, each sector at its midpoint.

        Raises
        ------
        ParameterError
            For dimensions that do not match, too many states, or a load that the law cannot balance.
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
        for place in range(n + q + m, size if not part else first):  # delayed controls move one place on
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
    reduced, rank = fmpq_mat([[fmpq(v.numerator, v.denominator) for v in row] for row in rows]).rref()
    pivots = [next(j for j in range(unknowns + 1) if reduced[i, j] != 0) for i in range(rank)]
    if unknowns in pivots:
        raise ParameterError(
            "a law must balance every load at zero error. Received a law without integral action for one load. "
            "Add an integral, or an estimate of the load."
        )
    solution = [Fraction(0)] * unknowns
    for i, pivot in enumerate(pivots):
        solution[pivot] = Fraction(int(reduced[i, unknowns].p), int(reduced[i, unknowns].q))
    return tuple(solution)


# ----------------------------------------------------------------------
# L1 norms of all rows for all inputs at once. Statements and proofs are those of `norms`, with two differences. Sums
# for unit columns, computed once, bound the remainders of all inputs. And rows are multiplied by the map Ψ of one
# period: P_k = rows·Ψᵏ. The sum of |P_k·columns| over k < K is computed. The sum over k ≥ K is at most |P_K|x for any x
# with y + |Ψᴷ|x ≤ x, y the computed sum for unit rows.

_BITS = (128, 256)  # precision of balls; the larger if the smaller does not show decay
_AT_ONCE = 8  # periods
_MOST_WORK = 12 * 10**8
_BEYOND = 64  # multiple of the work limit; a power of the map must be small before it is reached
_LEFT = Fraction(1, 1024)
_FAINT = Fraction(1, 1 << 60)


@dataclass(frozen=True, slots=True)
class ResponseBounds:
    """Bounds of every row: for each input of the flow, each sampled input, and the initial states."""

    inputs: tuple[Row, ...]
    sampled: tuple[Row, ...]
    start: Row


def response_bounds(loop: PlantLoop, pieces: int) -> ResponseBounds:
    """L1 norms and free response of a loop, each flow cut into equal pieces.

    Raises
    ------
    ParameterError
        When the loop is not proved to be stable, or exceeds the work limit.
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
        self.powers = [
            list(accumulate([step] * pieces, lambda now, more: more * now, initial=identity(self.size)))
            for step in self.steps
        ]
        self.near = [absolute((majorant(self.flow) * h).exp()) for h in self.lengths]
        self.within = [absolute((majorant(self.flow) * (h * pieces)).exp()) for h in self.lengths]

    def bounds(self) -> ResponseBounds:
        """L1 norms and free response."""
        wholes = [powers[-1] * jump for powers, jump in zip(self.powers, self.jumps, strict=True)]
        *earlier, period = accumulate(wholes, lambda now, whole: whole * now, initial=identity(self.size))
        later = list(accumulate(wholes[:0:-1], mul, initial=identity(self.size)))[::-1]
        blocks, rests = zip(*(self._own(s, later[s]) for s in range(len(wholes))), strict=True)
        # all earlier periods: the columns of every input, and unit columns that bound the remainders
        own = [hstack([block[i] for block in blocks]) for i in range(self.kinds)]
        own += [later[0] * self.powers[0][-1] * column(entry) for entry in self.loop.sampled]
        left = [reduce(add, (rest[i] for rest in rests)) for i in range(self.kinds)]
        left += [arb_mat(self.size, 1)] * len(self.loop.sampled)
        seen = [vstack([*(self.rows * v for v in powers), identity(self.size)]) for powers in self.powers]
        rows = [part * jump * before for part, jump, before in zip(seen, self.jumps, earlier, strict=True)]
        sums, free = self._all_periods(vstack([*rows, identity(self.size)]), period, own, left)
        peaks, places = [], seen[0].nrows()
        for s in range(len(wholes)):
            before = [BALLS.part(total, s * places, (s + 1) * places) for total in [*sums, free]]
            if s:  # inputs earlier in this period
                first, first_rests = self._own(0, identity(self.size))
                now = seen[s] * self.jumps[s]
                for i, (near, rest) in enumerate(zip(first, first_rests, strict=True)):
                    before[i] = before[i] + row_sums(absolute(now * near)) + absolute(now) * rest
            peaks.append([self._peaks(s, i, total) for i, total in enumerate(before)])
        *inputs, start = (tuple(map(max, zip(*lines, strict=True))) for lines in zip(*peaks, strict=True))
        return ResponseBounds(
            inputs=tuple(inputs[kind] for kind in self.kind), sampled=tuple(inputs[self.kinds :]), start=start
        )

    def _own(self, s: int, later: arb_mat) -> tuple[list[arb_mat], list[arb_mat]]:
        """Columns and remainder of every input of the flow over one segment, at the end of the period."""
        h, columns, rests = self.lengths[s], [], []
        for entry in self.entries:
            ends = [power * entry for power in self.powers[s]]
            columns.append(later * scaled(hstack(ends), [h / 2, *[h] * (self.pieces - 1), h / 2]))
            bends = (self.near[s] * absolute(self.square * end) for end in ends[:-1])
            rests.append(absolute(later) * (reduce(add, bends) * (h**3 / 12)))
        return columns, rests

    def _all_periods(
        self, rows: arb_mat, period: arb_mat, own: list[arb_mat], left: list[arb_mat]
    ) -> tuple[list[arb_mat], arb_mat]:
        """Sums over all periods of every row for every input, and the largest free response of every row."""
        size, start = self.size, [column(entry) for entry in self.loop.start]
        columns = hstack([*own, identity(size), *start])
        ends = list(accumulate([*(block.ncols() for block in own), *[1] * size, len(start)], initial=0))
        now, height, width = rows, rows.nrows(), columns.ncols()
        sums, free = arb_mat(height, len(ends) - 1), arb_mat(height, 1)
        # several periods at once: long products of single maps would lose all precision
        turned = list(accumulate([period] * (_AT_ONCE - 1), lambda late, once: once * late, initial=columns))
        leap, check, done = period**_AT_ONCE, _AT_ONCE, 0
        _require_fading(leap, height * size * (width + size))
        while True:
            if check * height * size * (width + size) > _MOST_WORK:
                raise _unstable()
            for _ in range((check - done) // _AT_ONCE):
                for late in turned:
                    table = (now * late).tolist()
                    lines = [[sum(map(abs, line[a:b]), arb(0)) for a, b in pairwise(ends)] for line in table]
                    sums, free = sums + arb_mat(lines), larger(free, arb_mat([line[-1:] for line in lines]))
                now = now * leap
            done, check = check, 2 * check
            far = absolute(BALLS.part(now, height - size, height))
            if not all(v < 1 << 80 for v in far.entries()):  # lost precision: more periods cannot show decay
                raise _unstable()
            totals = [_total(sums, i, len(own), rest) for i, rest in enumerate(left)]
            wholes = [_raised(BALLS.part(total, height - size, height)) for total in totals]
            most = _raised(BALLS.part(free, height - size, height))
            if all(not_above(far * part, part * ball(_LEFT)) for part in [*wholes, most]):
                break
        # With far·part ≤ ε·part, ε = 2⁻¹⁰, x = (1 + 2ε)·part satisfies part + far·x ≤ x; and far·most ≤ most.
        beyond = absolute(now)
        totals = [
            absolute(total + beyond * part * ball(1 + 2 * _LEFT)) for total, part in zip(totals, wholes, strict=True)
        ]
        return totals, absolute(larger(free, beyond * most))

    def _peaks(self, s: int, i: int, before: arb_mat) -> Row:
        """Bounds of all rows in a segment for input `i`; the last `i` stands for the initial states.

        `before` is the contribution of all earlier times.

        The largest of all pieces: the larger end plus the remainder of the chord.
        """
        count, h, kinds = len(self.loop.rows), self.lengths[s], self.kinds
        bends = absolute(self.rows * self.square) * self.within[s]
        bent = bends * BALLS.part(before, before.nrows() - self.size, before.nrows())
        ends = [BALLS.part(before, k * count, (k + 1) * count) for k in range(self.pieces + 1)]
        if i < kinds + len(self.loop.sampled):
            entry = self.entries[i] if i < kinds else column(self.loop.sampled[i - kinds])
            if s and i >= kinds:
                entry = self.jumps[1] * self.powers[0][-1] * entry
            since = [absolute(self.rows * (power * entry)) for power in self.powers[s]]
            more = bends * absolute(entry)
            if i < kinds:
                parts = ((a + b) * h / 2 for a, b in pairwise(since))
                since = list(accumulate(parts, lambda t, part: t + part + more * h**3 / 12, initial=arb_mat(count, 1)))
                bent = bent + absolute(self.rows * self.flow) * self.within[s] * absolute(entry)
            else:
                bent = bent + more
            ends = list(map(add, ends, since))
        return tuple(map(upper, (reduce(larger, ends) + bent * h**2 / 8).entries()))


def _total(sums: arb_mat, i: int, count: int, rest: arb_mat) -> arb_mat:
    """Sums for an input plus its remainders, which the sums for unit columns bound."""
    used = [(count + j, v) for j, v in enumerate(rest.entries()) if not v.is_zero()]
    return arb_mat([[line[i] + sum((line[j] * v for j, v in used), arb(0))] for line in sums.tolist()])


def _raised(part: arb_mat) -> arb_mat:
    """Slightly larger bounds, none of which is 0."""
    faint = reduce(arb.max, part.entries()) * ball(_FAINT)
    return arb_mat([[(v + faint).abs_upper()] for v in part.entries()])


def _require_fading(leap: arb_mat, work: int) -> None:
    """Reject a map of several periods if none of its powers within the work limit is small."""
    power, periods = leap, _AT_ONCE
    while not all(v < 1 for v in absolute(power).entries()):
        if periods * work > _BEYOND * _MOST_WORK or not all(v < 1 << 80 for v in absolute(power).entries()):
            raise _unstable()
        power, periods = power * power, 2 * periods


def _unstable() -> ParameterError:
    return ParameterError(
        "the nominal loop must be stable and decay fast. Received a loop for which this is not proved. "
        "Change the law or the step."
    )
