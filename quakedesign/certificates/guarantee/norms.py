"""L1 norms of a periodic loop: how large an output can get under an input that is bounded by 1, in ball arithmetic.

**Statement.** Let x′ = Ax + b·w between jumps, x(0) = 0, and w be measurable with |w| ≤ W on [0, t]. Then |cx(t)| ≤
g·W with the g that `norms` returns for the part of the period in which t lies.

**Proof.** x(t) = ∫₀ᵗ Φ(t, τ)b·w(τ)dτ, so |cx(t)| ≤ W·∫|cΦ(t, τ)b|dτ over [0, t], which grows when the loop is
continued periodically to the past and the integral taken over (−∞, t]. That integral is bounded from above in parts:

- *A piece of length h of a flow.* y(σ) = row·e^{Aσ}b is within (σ − α)(β − σ)/2·max|y″| of its chord on [α, β], so
  ∫|y| ≤ h(|y(α)| + |y(β)|)/2 + h³/12·max|y″|, and |y″| ≤ |row|·|A²e^{Aσ}b| with absolute values entry by entry.
- *All periods before.* With Ψ the map of one period, N(c) = Σ_k ‖cΨᵏU‖₁; the columns U are the ends of the pieces of
  one period, weighted, and one column for every entry of the remainders. Terms up to k < K = 2^J are summed. Let y_j
  be that sum for the unit row e_j, z_j the whole one and D = |Ψᴷ|. Then z ≤ y + Dz, and Dy ≤ q·y with q < 1 gives z ≤
  y/(1 − q): sums over blocks of K periods are at most y, Dy, D²y … . So N(c) ≤ partial sum + |cΨᴷ|·y/(1 − q).
- *Between two phases α < β of the output.* ce^{Aθ} is within (β − α)²/8·max|cA²e^{Aσ}| of the chord of its ends, and N
  is convex: at most the larger end and N of the remainder. The flow since the last jump adds ∫₀^θ|ce^{Aσ}b|dσ, whose
  derivative has the Lipschitz constant max|cAe^{Aσ}b|: it is within (β − α)²/8 times that of its chord. Both together
  are below a chord plus remainders, hence at most the larger of the two ends plus remainders. ∎

**Sampled inputs.** Where Σ j·w_k enters with the jumps at kT and |w_k| ≤ W for every k up to t, |cx(t)| ≤ W·Σ|cΦ(t,
kT)j|: the same with a sum in place of the integral. A period has the one column e^{Aτ}j without a remainder, the flow
since the last jump adds |ce^{Aθ}j|, which is within (β − α)²/8·max|cA²e^{Aσ}j| of its chord.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from itertools import accumulate, pairwise
from operator import add, mul
from typing import Any

from flint import arb, arb_mat, ctx

from quakedesign.certificates.guarantee.ball_matrices import (
    absolute,
    ball,
    beside,
    column,
    identity,
    majorant,
    matrix,
    upper,
)
from quakedesign.errors import ParameterError
from quakedesign.loop import PeriodicLoop

_BITS = 128
_PIECES = 8
_SMALL = Fraction(1, 1 << 8)  # share of the sums that the tail may be
_MOST_DOUBLINGS = 13
_ZERO = Fraction(0)


def norms(loop: PeriodicLoop) -> Mapping[tuple[str, str], tuple[Fraction, ...]]:
    """Gains of every (output, input), rounded up, one for each part of the period; the same parts for all.

    Raises
    ------
    ParameterError
        When the nominal loop is not found to be stable within 8192 periods.
    """
    with ctx.workprec(_BITS):
        flow = matrix(loop.flow)
        rows = matrix(tuple(loop.outputs.values()))
        found: dict[tuple[str, str], tuple[Fraction, ...]] = {}
        for name, entry in (loop.inputs | loop.sampled).items():
            sudden = name in loop.sampled
            entries = [column(entry), *[column(entry) * (not sudden)] * (len(loop.segments) - 1)]
            parts = zip(loop.segments, entries, strict=True)
            flows = [_Flow.of(flow, matrix(s.jump), s.duration / _PIECES, b, sudden=sudden) for s, b in parts]
            gains = _gains(flows, _Past.of(flows), rows)
            found |= {
                (output, name): tuple(map(upper, worst)) for output, worst in zip(loop.outputs, gains, strict=True)
            }
        return found


@dataclass(frozen=True, slots=True)
class _Flow:
    """One segment in balls.

    Attributes
    ----------
    jump, step, whole : arb_mat
        J, e^{Ah} of one piece, and e^{Aτ}J of the segment.
    piece : arb
        h.
    response : list of arb_mat
        e^{Ahi}b at the ends of the pieces.
    curvature, slope : list of arb_mat
        Upper bounds of |A²e^{Aσ}b| and |Ae^{Aσ}b| on every piece.
    square, within : arb_mat
        A², and an upper bound of |e^{Aσ}| on the first piece: e^{Mh} with |A| off the diagonal and max(A, 0) on it.
    sudden : bool
        Whether b enters with the jump alone.
    """

    jump: Any
    step: Any
    whole: Any
    piece: Any
    response: list[Any]
    curvature: list[Any]
    slope: list[Any]
    square: Any
    within: Any
    sudden: bool

    @classmethod
    def of(cls, flow: Any, jump: Any, piece: Fraction, entry: Any, *, sudden: bool) -> "_Flow":
        h = ball(piece)
        step, within = (flow * h).exp(), absolute((majorant(flow) * h).exp())
        response = list(accumulate([step] * _PIECES, lambda now, e: e * now, initial=entry))
        return cls(
            jump=jump,
            step=step,
            whole=reduce(mul, [step] * _PIECES) * jump,
            piece=h,
            response=response,
            curvature=[within * absolute(flow * (flow * now)) for now in response[:-1]],
            slope=[within * absolute(flow * now) for now in response[:-1]],
            square=flow * flow,
            within=within,
            sudden=sudden,
        )

    def columns(self, later: Any) -> tuple[list[Any], Any]:
        """Weighted ends of the pieces, mapped by what comes later, and the remainders' entries."""
        if self.sudden:
            return [later * self.response[-1]], column((_ZERO,) * later.nrows())
        half = self.piece / 2
        ends = [later * now * (half if i in (0, _PIECES) else self.piece) for i, now in enumerate(self.response)]
        rest = absolute(later) * reduce(add, self.curvature)
        return ends, absolute(rest * (self.piece**3 / 12))


@dataclass(frozen=True, slots=True)
class _Past:
    """Everything before the first jump of a period: columns of K periods, and what bounds the rest."""

    columns: Any
    far: Any
    bound: Any

    @classmethod
    def of(cls, flows: list[_Flow]) -> "_Past":
        size = flows[0].jump.nrows()
        later, ends, rest = identity(size), list[Any](), arb_mat(size, 1)
        for flow in reversed(flows):
            own, remainder = flow.columns(later)
            ends, rest, later = [*own, *ends], rest + remainder, later * flow.whole
        return cls._summed(later, beside([*ends, _diagonal(rest)]))

    @classmethod
    def _summed(cls, period: Any, columns: Any) -> "_Past":
        sums = _row_sums(columns)
        for _ in range(_MOST_DOUBLINGS):
            following = period * columns
            sums = [a + b for a, b in zip(sums, _row_sums(following), strict=True)]
            columns, period = beside([columns, following]), period * period
            far = absolute(period) * _as_column(sums)
            shares = [a / b for a, b in zip(far.entries(), sums, strict=True) if not a == 0]
            if all(share < ball(_SMALL) for share in shares):
                return cls(columns, period, _as_column(sums) / (1 - ball(_SMALL)))
        raise ParameterError(
            f"the nominal loop must be stable. Received one that is not seen to be in {2**_MOST_DOUBLINGS} periods. "
            "Change the gains, or shorten T_s."
        )

    def of_rows(self, rows: Any) -> list[Any]:
        """N of every row."""
        near, far = _row_sums(rows * self.columns), absolute(rows * self.far) * self.bound
        return [a + b for a, b in zip(near, far.entries(), strict=True)]


def _gains(flows: list[_Flow], past: _Past, outputs: Any) -> list[list[Any]]:
    """Bounds for every output, on every piece of every segment."""
    size, count = outputs.ncols(), outputs.nrows()
    found: list[list[Any]] = [[] for _ in range(count)]
    for number, flow in enumerate(flows):
        phases = list(accumulate([flow.step] * _PIECES, mul, initial=outputs))
        rows = _above([*phases, identity(size)]) * flow.jump
        before = _before(flows[:number], past, rows)
        units = _as_column(before[-size:])
        for k in range(count):
            own = _since_jump(flow, outputs, k)
            total = [before[i * count + k] + own[i] for i in range(_PIECES + 1)]
            for i, (start, end) in enumerate(pairwise(total)):
                bent = (absolute(phases[i] * flow.square) * flow.within * units)[k, 0]
                bent += (absolute(outputs) * (flow.curvature if flow.sudden else flow.slope)[i])[k, 0]
                found[k].append(start.max(end) + bent * flow.piece**2 / 8)
    return found


def _before(flows: list[_Flow], past: _Past, rows: Any) -> list[Any]:
    """Bounds for rows that act just before a segment: the segments before it in this period, and the past."""
    if not flows:
        return past.of_rows(rows)
    ends, rest = flows[-1].columns(identity(rows.ncols()))
    own = _row_sums(rows * beside([*ends, _diagonal(rest)]))
    return [a + b for a, b in zip(own, _before(flows[:-1], past, rows * flows[-1].whole), strict=True)]


def _since_jump(flow: _Flow, outputs: Any, k: int) -> list[Any]:
    """∫|ce^{Aσ}b|dσ from the jump to the end of every piece, from 0 on; |ce^{Aσ}b| of what enters with the jump."""
    values = [abs((outputs * now)[k, 0]) for now in flow.response]
    if flow.sudden:
        return values
    bent = [(absolute(outputs) * now)[k, 0] for now in flow.curvature]
    pieces = [
        (a + b) * flow.piece / 2 + c * flow.piece**3 / 12 for (a, b), c in zip(pairwise(values), bent, strict=True)
    ]
    return list(accumulate(pieces, initial=arb(0)))


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
