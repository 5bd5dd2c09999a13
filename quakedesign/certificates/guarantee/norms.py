"""L1 norms of a periodic loop: how large an output can get under an input that is bounded by 1, in ball arithmetic.

**Statement.** Let x′ = Ax + b·w between jumps, x(0) = 0, and w be measurable with |w| ≤ W on [0, t]. Then |cx(t)| ≤
g·W with the g that `norms` returns for the part of the period in which t lies.

**Proof.** x(t) = ∫₀ᵗ Φ(t, τ)b·w(τ)dτ, so |cx(t)| ≤ W·∫|cΦ(t, τ)b|dτ over [0, t], which grows when the loop is
continued periodically to the past and the integral taken over (−∞, t]. That integral is bounded from above in parts:

- *A piece of length h of a flow.* y(σ) = row·e^{Aσ}b is within (σ − α)(β − σ)/2·max|y″| of its chord on [α, β], so
  ∫|y| ≤ h(|y(α)| + |y(β)|)/2 + h³/12·max|y″|, and |y″| ≤ |row|·|A²e^{Aσ}b| with absolute values entry by entry.
- *All periods before.* With Ψ the map of one period, N(c) = Σ_k ‖cΨᵏU‖₁; the columns U are the ends of the pieces of
  one period, weighted, and one column for every entry of the remainders. Terms up to k < K = 2^J are summed. Let W be
  any invertible matrix, y_j that sum for its row j, z_j the whole one and D = |WΨᴷW⁻¹|. Sums over one block of K
  periods, two and so on are at most y, y + Dy, …, so if y + Dx ≤ x, then z ≤ x, and N(c) ≤ partial sum + |cΨᴷW⁻¹|·x.
  Rows of W are unit rows but for one, along which the slowest mode is seen alone: what is left of
  that mode after K periods counts as it is, and K need not outlast it.
- *Between two phases α < β of the output.* ce^{Aθ} is within (β − α)²/8·max|cA²e^{Aσ}| of the chord of its ends, and N
  is convex: at most the larger end and N of the remainder. The flow since the last jump adds ∫₀^θ|ce^{Aσ}b|dσ, whose
  derivative has the Lipschitz constant max|cAe^{Aσ}b|: it is within (β − α)²/8 times that of its chord. Both together
  are below a chord plus remainders, hence at most the larger of the two ends plus remainders. ∎

**Sampled inputs.** Where Σ j·w_k enters with the jumps at kT and |w_k| ≤ W for every k up to t, |cx(t)| ≤ W·Σ|cΦ(t,
kT)j|: the same with a sum in place of the integral. A period has the one column e^{Aτ}j without a remainder, the flow
since the last jump adds |ce^{Aθ}j|, which is within (β − α)²/8·max|cA²e^{Aσ}j| of its chord.

**Fading inputs.** Where |w(τ)| ≤ W·ω(τ) with a weight ω of the phase, let Ω ≥ ∫ω and Ω′ ≥ ∫(τ − α)ω over a piece that
begins at α. There |cΦ(t, τ)b| ≤ |cΦ(t, α)b| + (τ − α)·max|cΦA·b|, so Ω|cΦ(t, α)b| + Ω′·max|…| stands in place of
the trapezoidal sum. Of the flow since the last jump, a piece that has passed adds Ω|ce^{A(θ − α)}b|, which is within (β
− α)²/8·Ω·max|cA²e^{Aσ}b| of its chord, and Ω′ times the largest slope; the piece in which θ lies adds at most
Ω·max|ce^{Aσ}b|. Since e^{−x} ≤ 1/(1 + x + x²/2 + x³/6 + x⁴/24) = E(x), the weight he^{−λθ} + f has Ω = hE(λα)·min(1/λ,
ℓ) + fℓ and Ω′ = hE(λα)·min(1/λ², ℓ²/2) + fℓ²/2 on a piece of length ℓ.

**Pulses.** Where w is there from `early` before a jump J to `late` after it, an impulse of it at −σ or σ has become
Je^{Aσ}b or e^{−Aσ}b, after the jump, within σ·max|JAe^{A·}b| of Jb or σ·max|Ae^{−A·}b| of b. As the area before the
jump, over `before`, and that after it, over `after`, are W in all, what comes of both is at most the larger of what
`before`·Jb and `after`·b become, and of these remainders. With x and y for the two that is |x + y|/2 + |x − y|/2: two
columns that enter with the jump. Before the jump |c·b| + `early`·max|cAe^{A·}b|, times `before`, is added to the
outputs of the pieces that `early` reaches.

**At once.** What an input of size 1 adds to an output at the same instant is added to the gain, whatever its weight.
"""

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from itertools import accumulate
from operator import mul
from typing import Any

from flint import arb, arb_mat, ctx

from quakedesign.certificates.guarantee.ball_matrices import (
    absolute,
    ball,
    beside,
    identity,
    matrix,
    upper,
)
from quakedesign.certificates.guarantee.free_response import START, free_peaks
from quakedesign.certificates.guarantee.responses import Flow, Response, responses
from quakedesign.certificates.guarantee.slowest_mode import MOST_DOUBLINGS, seen_alone, slowest, unstable
from quakedesign.loop import PeriodicLoop

_BITS = 128
_SMALL = Fraction(1, 1 << 10)  # share of the sums that the tail may be, but for the slowest mode
_MOST_SUMS = 5 * 10**7  # products for one input: half of what the standalone checker takes before it gives up
_ROOM = Fraction((1 << 32) + 1, 1 << 32)  # for sums that are solved for to bound themselves


def norms(loop: PeriodicLoop) -> dict[tuple[str, str], tuple[Fraction, ...]]:
    """Gains of every (output, input), rounded up, one for each part of the period; the same parts for all.

    A start that is not 0 is one input more, `free_response.START`, of size 1. Gains of loops that came before are
    remembered: a proof is found, checked, told and written of one loop.

    Raises
    ------
    ParameterError
        When the nominal loop is not found to be stable within 4096 periods.
    """
    gains = dict(_norms(replace(loop, start=())))
    return gains | {(output, START): peaks for output, peaks in free_peaks(loop).items()} if loop.start else gains


@lru_cache(maxsize=128)
def _norms(loop: PeriodicLoop) -> dict[tuple[str, str], tuple[Fraction, ...]]:
    with ctx.workprec(_BITS):
        flow = matrix(loop.flow)
        rows = matrix(tuple(loop.outputs.values()))
        bounds: dict[tuple[str, str], tuple[Fraction, ...]] = {}
        flows, earlier = ([Flow.of(flow, part, past=past) for part in loop.segments] for past in (False, True))
        slow = slowest(earlier)
        places = sum(rows.nrows() * (len(part.lengths) + 1) + rows.ncols() for part in flows)
        for name in (*loop.inputs, *loop.sampled, *loop.fading, *loop.pulses):
            gains = _gains(responses(loop, flows, name), _Past.of(responses(loop, earlier, name), slow, places), rows)
            bounds |= {
                (output, name): tuple(map(upper, worst)) for output, worst in zip(loop.outputs, gains, strict=True)
            }
        return bounds | {key: tuple(v + size for v in bounds[key]) for key, size in loop.at_once.items()}


@dataclass(frozen=True, slots=True)
class _Past:
    """Everything before the first jump of a period: columns of K periods, and what bounds the rest."""

    parts: list[Response]
    columns: Any
    far: Any
    bound: Any

    @classmethod
    def of(cls, parts: list[Response], slow: list[Any], rows: int) -> "_Past":
        size = parts[0].of.jump.nrows()
        later, ends, rest = identity(size), list[Any](), arb_mat(size, 1)
        for part in reversed(parts):
            own, remainder = part.columns(later)
            ends, rest, later = [*own, *ends], rest + remainder, later * part.of.whole
        return cls._summed(parts, later, beside([*ends, _diagonal(rest)]), slow, rows)

    @classmethod
    def _summed(cls, parts: list[Response], period: Any, columns: Any, slow: list[Any], rows: int) -> "_Past":
        size = period.nrows()
        place, seen, back = seen_alone(slow, _row_sums(columns))
        sums = _row_sums(seen * columns)
        for _ in range(MOST_DOUBLINGS):
            if 2 * columns.ncols() * size * (size + rows) > _MOST_SUMS:
                break
            following = period * columns
            sums = [a + b for a, b in zip(sums, _row_sums(seen * following), strict=True)]
            columns, period = beside([columns, following]), period * period
            far = period * back
            left = absolute(seen * far)
            quick = _as_column([v * (i != place) for i, v in enumerate(sums)])
            shares = zip((left * quick).entries(), sums, strict=True)
            if all(a == 0 or a / b < ball(_SMALL) for a, b in shares):
                return cls(parts, columns, far, _whole(left, sums))
        raise unstable()

    def of_rows(self, rows: Any, segment: int) -> list[Any]:
        """N of every row that acts just before a segment: those before it in this period, and all that is earlier."""
        if segment == 0:
            near, far = _row_sums(rows * self.columns), absolute(rows * self.far) * self.bound
            return [a + b for a, b in zip(near, far.entries(), strict=True)]
        before = self.parts[segment - 1]
        ends, rest = before.columns(identity(rows.ncols()))
        own = _row_sums(rows * beside([*ends, _diagonal(rest)]))
        return [a + b for a, b in zip(own, self.of_rows(rows * before.of.whole, segment - 1), strict=True)]


def _whole(left: Any, sums: list[Any]) -> Any:
    """Some x with y + Dx ≤ x.

    Raises
    ------
    ParameterError
        When the one that is tried is none.
    """
    own, size = _as_column(sums), len(sums)
    try:
        solution = absolute((identity(size) - left).solve(own) * ball(_ROOM))
    except ZeroDivisionError:
        raise unstable() from None
    bounded = zip(own.entries(), (left * solution).entries(), solution.entries(), strict=True)
    if not all(y + far <= x for y, far, x in bounded):
        raise unstable()
    return solution


def _gains(parts: list[Response], past: _Past, outputs: Any) -> list[list[Any]]:
    """Bounds for every output, on every piece of every segment."""
    size, count = outputs.ncols(), outputs.nrows()
    gains: list[list[Any]] = [[] for _ in range(count)]
    for number, part in enumerate(parts):
        flow = part.of
        phases = list(accumulate(flow.steps, mul, initial=outputs))
        rows = _above([*phases, identity(size)]) * flow.jump
        before = past.of_rows(rows, number)
        units = _as_column(before[-size:])
        for k in range(count):
            row = arb_mat([outputs.tolist()[k]])
            for i, (start, end, more) in enumerate(part.since_jump(row)):
                bent = (absolute(phases[i] * flow.square) * flow.within[i] * units)[k, 0]
                larger = (before[i * count + k] + start).max(before[(i + 1) * count + k] + end)
                gains[k].append(larger + more + bent * flow.chord(i))
    return gains


def _as_column(values: list[Any]) -> Any:
    return arb_mat([[v] for v in values])


def _diagonal(column: Any) -> Any:
    """One column for every entry that is not zero."""
    kept = [i for i, v in enumerate(column.entries()) if not v.is_zero()]
    return arb_mat([[column[i, 0] if i == j else arb(0) for j in kept] for i in range(column.nrows())])


def _above(parts: list[Any]) -> Any:
    return arb_mat([list(row) for part in parts for row in part.tolist()])


def _row_sums(matrix: Any) -> list[Any]:
    return [sum(map(abs, row), arb(0)) for row in matrix.tolist()]
