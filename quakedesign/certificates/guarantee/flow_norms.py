"""L1 norms of a loop in continuous time: how large an output can get under an input that is bounded by 1.

**Statement.** Let x′ = Ax + b·w, x(0) = 0, and w be measurable with |w| ≤ W on [0, t]. Then |cx(t)| ≤ g·W with the g
that `flow_norms` returns.

**Proof.** |cx(t)| ≤ W·∫₀^∞|ce^{Aσ}b|dσ. Time is cut into stretches of 64 equal pieces, those of every stretch twice as
long as those of the one before, so that fast and slow modes cost the same.

- *A piece of length h from α on.* y(σ) = ce^{Aσ}b is within (σ − α)(α + h − σ)/2·max|y″| of its chord, so its part of
  the integral is at most h(|y(α)| + |y(α + h)|)/2 + h³/12·max|y″|, and |y″| ≤ |c|·V·|A²e^{Aα}b| for every V ≥ |e^{Aδ}|,
  0 ≤ δ ≤ h, entry by entry. V = e^{Mh} for the first pieces, M = |A| off the diagonal and max(A, 0) on it; if V serves
  h, then max(V, |e^{Ah}|V) serves 2h.
- *The rest.* Let S be the sums up to T for c and every unit column e_j in place of b, and S|e^{AT}| ≤ q·S with q < 1.
  Sums over later spans of T are at most q·S, q²·S …, so ∫₀^∞|ce^{Aσ}e_j|dσ ≤ S_j/(1 − q), and what is left out for b
  is at most S|e^{AT}b|/(1 − q). ∎
"""

from collections.abc import Mapping
from fractions import Fraction
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

_BITS = 256
_HALVINGS = 6  # 2^6 pieces in a stretch
_SMALL = Fraction(1, 1 << 12)  # q
_MOST_STRETCHES = 128
_HUGE = 1 << _BITS  # that only an unstable loop grows to


def flow_norms(loop: PeriodicLoop) -> Mapping[tuple[str, str], tuple[Fraction, ...]]:
    """Gain of every (output, input) of a loop without jumps, rounded up, in a tuple of one: it has no parts.

    Raises
    ------
    ParameterError
        When the nominal loop is not found to be stable.
    """
    with ctx.workprec(_BITS):
        flow, rows = matrix(loop.flow), matrix(tuple(loop.outputs.values()))
        size = flow.nrows()
        state = beside([identity(size), *(column(entry) for entry in loop.inputs.values())])
        sums, state = _sums(flow, rows, state)
        late = absolute(_columns(state, size, state.ncols()))
        rest = _columns(sums, 0, size) * late / (1 - ball(_SMALL))
        return {
            (output, name): (upper(sums[i, size + j] + rest[i, j]),)
            for j, name in enumerate(loop.inputs)
            for i, output in enumerate(loop.outputs)
        }


def _sums(flow: Any, rows: Any, state: Any) -> tuple[Any, Any]:
    """Bounds of the integrals up to T for every column of `state`, which begins with the unit columns; e^{AT}·state."""
    size, square, sums = flow.nrows(), flow * flow, arb_mat(rows.nrows(), state.ncols())
    largest = max(sum(row, arb(0)).abs_upper() for row in absolute(flow).tolist())
    piece = arb(1)
    while not piece * largest < ball(_SMALL):
        piece /= 2
    step, within = (flow * piece).exp(), absolute((majorant(flow) * piece).exp())
    for _ in range(_MOST_STRETCHES):
        starts, power = [state], step
        for _ in range(_HALVINGS):
            starts, power = [*starts, *(power * now for now in starts)], power * power
        for now, following in zip(starts, [*starts[1:], power * state], strict=True):
            sums += (absolute(rows * now) + absolute(rows * following)) * (piece / 2)
            sums += absolute(rows) * within * absolute(square * now) * (piece**3 / 12)
        state = power * state
        units = _columns(sums, 0, size)
        far = units * absolute(_columns(state, 0, size))
        if all(a <= b * ball(_SMALL) for a, b in zip(far.entries(), units.entries(), strict=True)):
            return sums, state
        if not all(v < _HUGE for v in absolute(state).entries()):
            break
        within = _larger(within, absolute(step) * within)
        step, piece = step * step, 2 * piece
    raise ParameterError("the nominal loop must be stable. Received one that is not seen to be. Change the gains.")


def _columns(whole: Any, first: int, end: int) -> Any:
    return arb_mat([row[first:end] for row in whole.tolist()])


def _larger(one: Any, other: Any) -> Any:
    pairs = zip(one.entries(), other.entries(), strict=True)
    return arb_mat(one.nrows(), one.ncols(), [a.max(b) for a, b in pairs])
