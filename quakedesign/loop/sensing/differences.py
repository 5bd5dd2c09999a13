"""What the implicit differentiator is, from rest, with a bound λ_d that is large enough: differences of readings.

With y = (w_1 … w_nf, z_0 … z_nd) as in `quakedesign.loop.sensing.differentiator_step`, let before a reading x be w = 0,
z_0 = x1 the reading before, and z_i = ∇ⁱx1/Tⁱ. Then b = y_1 + T(y_2 + … + T(z_0 − x + T·z_1 + …)) is
−T^nf·∇^(nd+1)x, and where |∇^(nd+1)x| ≤ λ̃_0·λ_d·T^(nd+1) the step gives s⁺ = 0. So w stays 0, z_0⁺ = x and, from
z_i⁺ = z_i + T·z_(i+1)⁺, z_(i+1)⁺ = ∇^(i+1)x/T^(i+1). At rest at slip 0 all of y is 0. By induction the differentiator
is this filter for ever, whatever n_f: its slip is the reading, its slip rate Σ ∇ʲx/(jT), 1 ≤ j ≤ n_d (`lag_free`), and
a law that it tells is a law of the slip alone, whose guarantee counts all of its errors.

With |x1″| ≤ A and readings within ε, |∇^(nd+1)x| ≤ c·A·T² + 2^(nd+1)·ε: x1‴, which does not exist where the pressure is
held, need not be bounded. ∇²x1 is the integral of x1″ with a triangle over two periods, so that c is the area of
∇^(nd−1) of triangles, in size: straight lines between binomials of either sign, c = 1 for n_d = 1 and 3/2 for n_d = 2.
"""

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from math import comb

from quakedesign.loop.laws import LinearLaw
from quakedesign.loop.sensing.coefficients import TABLES

ORDER = 2  # n_d as printed


def names_before(order: int = ORDER) -> tuple[str, ...]:
    """States that hold the readings before."""
    return tuple(f"reading_{i}" for i in range(1, order + 1))


def rate_shares(order: int = ORDER) -> tuple[Fraction, ...]:
    """Shares of the reading now, of the one before, and so on in T times the slip rate that is told."""
    return tuple(
        sum((Fraction((-1) ** back * comb(j, back), j) for j in range(1, order + 1)), Fraction(0))
        for back in range(order + 1)
    )


def told_by_differences(law: LinearLaw, step: Fraction, order: int = ORDER) -> LinearLaw:
    """A law of slip and slip rate, the latter told by differences of slips every T_s [s]: one of the slip alone."""
    now, *before = (share / step for share in rate_shares(order))
    zero, names = Fraction(0), names_before(order)

    def fed(seen: tuple[Fraction, ...]) -> tuple[Fraction, Fraction]:
        return seen[0] + seen[1] * now, zero

    def remembered(own: tuple[Fraction, ...], seen: tuple[Fraction, ...]) -> tuple[Fraction, ...]:
        return (*own, *(seen[1] * share for share in before))

    kept = [
        (*[zero] * len(law.states), *(Fraction(i == place) for i in range(order))) for place in range(-1, order - 1)
    ]
    return replace(
        law,
        states=(*law.states, *names),
        update=(*(remembered(own, seen) for own, seen in zip(law.update, law.measured, strict=True)), *kept),
        measured=(*map(fed, law.measured), *((Fraction(place == 0), zero) for place in range(order))),
        output=remembered(law.output, law.feedback),
        feedback=fed(law.feedback),
        applied=law.applied and (*law.applied, *[zero] * order),
    )


def least_bound(acceleration: Fraction, noise: Fraction, step: Fraction, order: int = ORDER) -> Fraction:
    """λ_d [m/s^(n_d+1)] from which on it is, for |x1″| [m/s²] and readings within noise [m], every T_s [s]."""
    least = min(Fraction(str(table[0])) for table in TABLES)
    corners = [0, *(comb(order - 1, j) for j in range(order)), 0]
    area = sum((Fraction(p**2 + q**2, 2 * (p + q)) for p, q in pairwise(corners)), Fraction(0))
    return Fraction((area * acceleration * step**2 + 2 ** (order + 1) * noise) / (least * step ** (order + 1)))
