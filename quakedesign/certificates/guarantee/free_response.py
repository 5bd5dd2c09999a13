"""How far a start away from 0 takes a periodic loop without inputs: the sup of its free response, in ball arithmetic.

**Statement.** Let x′ = Ax between jumps and x(0) = Σ θ_i·s_i with |θ_i| ≤ 1, just before the first jump. Then |cx(t)| ≤
g with the g that `free_peaks` returns for the part of the period in which t lies.

**Proof.** Let X have the columns s_i and Ψ be the map of one period, so that |cx(t)| is at most the sum of the absolute
values of the entries of cΦ(θ)ΨᵏX, θ after the beginning of period k.

- *Between two phases α < β.* ce^{Aσ}y is within (β − α)²/8·max|cA²e^{Aσ}y| of the chord of its ends, for every column
  y, and the sum of the absolute values of chords is convex: at most the larger of both ends plus the remainders.
- *Periods.* Those with k < K = 2^J are looked at one by one. Let W be any invertible matrix, m at least the sums of the
  absolute values of every row of WΨᵏX for all k < K, and D = |WΨᴷW⁻¹|. If Dm ≤ m, these sums are at most m for k < 2K,
  3K and so on, that is, for all k, and those of cΦ(θ)ΨᵏX at most |cΦ(θ)ΨᴷW⁻¹|m for all k ≥ K. W is that of `norms`:
  the slowest mode, seen alone, only has to fall. All of m is raised by 2⁻⁶⁰ of its largest entry, so that none is 0. ∎
"""

from collections.abc import Iterator, Mapping
from fractions import Fraction
from functools import lru_cache, reduce
from itertools import accumulate
from operator import mul
from typing import Any

from flint import arb, arb_mat, ctx

from quakedesign.certificates.guarantee.ball_matrices import absolute, ball, beside, column, identity, matrix, upper
from quakedesign.certificates.guarantee.responses import Flow
from quakedesign.certificates.guarantee.slowest_mode import MOST_DOUBLINGS, seen_alone, slowest, unstable
from quakedesign.loop import PeriodicLoop

Group = tuple[Any, list[Any]]

START = "start"
_BITS = 128
_SMALL = Fraction(1, 1 << 10)  # share of m that is left of it after K periods, but for the slowest mode
_FAINT = Fraction(1, 1 << 60)


@lru_cache(maxsize=128)
def free_peaks(loop: PeriodicLoop) -> Mapping[str, tuple[Fraction, ...]]:
    """Bound of every output from every start of a loop, rounded up, one for each part of the period, as in `norms`.

    Raises
    ------
    ParameterError
        When the loop is not found to be stable within 4096 periods.
    """
    with ctx.workprec(_BITS):
        generator, rows = matrix(loop.flow), matrix(tuple(loop.outputs.values()))
        flows = [Flow.of(generator, part, past=False) for part in loop.segments]
        groups = _followed(flows, beside([column(s) for s in loop.start]))
        largest: list[list[Any]] = [[] for _ in loop.outputs]
        for flow in flows:
            for parts in zip(*(_pieces(flow, rows, *group) for group in groups), strict=True):
                for peaks, bounds in zip(largest, zip(*parts, strict=True), strict=True):
                    peaks.append(reduce(arb.max, bounds))
            groups = [(flow.whole * columns, weights) for columns, weights in groups]
        return {output: tuple(map(upper, peaks)) for output, peaks in zip(loop.outputs, largest, strict=True)}


def _followed(flows: list[Flow], start: Any) -> list[Group]:
    """ΨᵏX for all k < K, and ΨᴷW⁻¹ with m; K is so large that little is left but the slowest mode."""
    even = [arb(1)] * start.ncols()
    columns, power = start, reduce(lambda now, flow: flow.whole * now, flows, identity(start.nrows()))
    slow = slowest(flows)
    for _ in range(MOST_DOUBLINGS):
        columns, power = beside([columns, power * columns]), power * power
        place, seen, back = seen_alone(slow, _peaks(absolute(columns), even))
        most = [v.abs_upper() for v in _peaks(absolute(seen * columns), even)]
        most = [(v + max(most) * ball(_FAINT)).abs_upper() for v in most]
        far = power * back
        left = absolute(seen * far)
        quick = [v * (i != place) for i, v in enumerate(most)]
        if _after(left, most, most, Fraction(1)) and _after(left, quick, most, _SMALL):
            return [(columns, even), (far, most)]
    raise unstable()


def _after(left: Any, now: list[Any], most: list[Any], share: Fraction) -> bool:
    """Whether what a map leaves is at most a share."""
    later = (left * arb_mat([[v] for v in now])).entries()
    return all(a <= b * ball(share) for a, b in zip(later, most, strict=True))


def _peaks(sizes: Any, weights: list[Any]) -> list[Any]:
    """Of every row, the largest weighted sum of a group of columns, as many as there are weights."""
    return [reduce(arb.max, _sums(row, weights)) for row in sizes.tolist()]


def _sums(row: list[Any], weights: list[Any]) -> list[Any]:
    groups = (row[i : i + len(weights)] for i in range(0, len(row), len(weights)))
    return [sum((v * w for v, w in zip(group, weights, strict=True)), arb(0)) for group in groups]


def _pieces(flow: Flow, rows: Any, columns: Any, weights: list[Any]) -> Iterator[list[Any]]:
    """Bound of every output in every piece, from groups of columns just before the jump."""
    phases, columns = list(accumulate(flow.steps, mul, initial=rows)), flow.jump * columns
    ends = [absolute(phase * columns) for phase in phases]
    for i, phase in enumerate(phases[:-1]):
        bends = absolute(phase * flow.square) * flow.within[i] * absolute(columns) * flow.chord(i)
        lines = zip(ends[i].tolist(), ends[i + 1].tolist(), bends.tolist(), strict=True)
        yield [
            reduce(arb.max, (a.max(b) + more for a, b, more in zip(*(_sums(v, weights) for v in line), strict=True)))
            for line in lines
        ]
