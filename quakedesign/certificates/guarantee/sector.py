"""Whether the root of an implicit step lies between two lines for all errors of a size, in ball arithmetic.

**Statement.** w solves 0 ∈ w − e2 + q(e1 + T_s·w, w). For |e1| ≤ E and |e2| ≤ R: −γ1·u − ε ≤ w ≤ −γ0·u + ε where u =
e1/T_s ≥ 0, and the same mirrored where e1 ≤ 0.

**Proof.** F(w) = w − e2 + q is strongly monotone, so w is at most ω wherever F(ω) holds a number that is not negative.
For e2 ≤ R and 0 ≤ u ≤ E/T_s take ω = ε − γ0·u, where e1 + T_s·ω = T_s(ε + (1 − γ0)u). As q is odd, the lower line is
the upper one of −e1: ω = ε + γ1·u, e1 + T_s·ω = T_s(ε − (1 − γ1)u). On a part of the range of u both arguments of q
are at least the smaller of their ends, and q never falls, with ⌈0⌋⁰ taken as 1; parts are halved until that shows ω − R
+ q ≥ 0 on each, or too small. ∎
"""

from fractions import Fraction
from typing import Any

from flint import arb, ctx

from quakedesign.certificates.guarantee.ball_matrices import ball
from quakedesign.loop import ImplicitRoot, Power

Range = tuple[Fraction, Fraction]

_BITS = 128
_HALVINGS = 10


def holds(root: ImplicitRoot, step: Fraction, slip: Fraction, rate: Fraction) -> bool:
    """Whether the lines are shown to enclose the root for |e1| ≤ slip [m] and |e2| ≤ rate [m/s]; False: not shown."""
    last = slip / step
    low, high = root.slopes
    with ctx.workprec(_BITS):
        return all(
            _above(root, step, rate, (away, along), (Fraction(0), last), _HALVINGS)
            for away, along in ((1 - low, -low), (high - 1, high))
        )


def _above(root: ImplicitRoot, step: Fraction, rate: Fraction, slopes: Range, part: Range, halvings: int) -> bool:
    """Whether a line stays above the root on a part of the range of u."""
    ahead, end = (root.remainder + min(slope * u for u in part) for slope in slopes)
    if _least(root.pull, _below(step * ahead), _below(end)) + ball(end - rate) >= 0:
        return True
    middle = (part[0] + part[1]) / 2
    return halvings > 0 and all(
        _above(root, step, rate, slopes, half, halvings - 1) for half in ((part[0], middle), (middle, part[1]))
    )


def _least(terms: tuple[Power, ...], slip: Any, rate: Any) -> Any:
    """Lower bound of q at given arguments, or larger ones; the bound and the arguments are exact balls."""
    total = arb(0)
    for term in terms:
        inner = {"slip": slip, "rate": rate}
        value = inner[term.argument] if isinstance(term.argument, str) else _least(term.argument, slip, rate)
        size = abs(value).root(term.exponent.denominator) if value != 0 else value
        total += (
            ball(term.factor[0]) * size**term.exponent.numerator
            if value >= 0
            else -(ball(term.factor[1]) * size**term.exponent.numerator)
        )
    return total.lower()


def _below(value: Fraction) -> Any:
    return ball(value).lower()
