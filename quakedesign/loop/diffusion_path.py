"""Pressure diffusion between well and fault: exact slow modes, bounded fast modes.

One-dimensional diffusion in a layer with a no-flow boundary at the fault (Carslaw and Jaeger, Conduction of Heat in
Solids, 1959, sec. 3.4). The first chapter proves a bound of the truncation error of the modes. The second includes this
error in the slip-rate error, as a known jump at each pressure step and a smaller remainder.
"""

from dataclasses import replace
from fractions import Fraction

from quakedesign.arguments import checked_dataclass
from quakedesign.laws.sampled_law import unit_row
from quakedesign.loop.periodic import Fading, PeriodicLoop

# ----------------------------------------------------------------------
# Diffusion between well and fault: exact slow modes, and a bound of the truncation error.
#
# **Statement.** Let ∂p/∂t = D∂²p/∂x² in a layer of length L, without pressure at first, with the pressure u at the well
# and without outflow at the fault, and τ = L²/D. With λ_n = ((2n + 1)π/2)²/τ and c_n = (4/π)(−1)ⁿ/(2n + 1) the pressure
# in the fault at the time t after a unit step of u is 1 − Σ c_n·e^{−λ_n·t} (Carslaw and Jaeger, Conduction of Heat in
# Solids, 1959, sec. 3.4), Σ c_n = 1. For any u this pressure is therefore Σ_{n<N} c_n·z_n + (1 − Σ_{n<N} c_n)u + R with
# z_n′ = λ_n(u − z_n) and the truncation error R(t) = Σ_k Δu_k·E(t − t_k) over the steps of u, E(t) = −Σ_{n≥N}
# c_n·e^{−λ_n·t}. The terms of E alternate in sign and decrease, so |E(t)| ≤ |c_N|e^{−λ_N·t}.
#
# **In rationals.** π is replaced by π̂ = π(1 − δ), 0 ≤ δ ≤ 10⁻²⁰, so λ̂_n = λ_n(1 − δ)² and ĉ_n = c_n/(1 − δ). This
# adds to |E(t)| at most Σ_{n<N} |c_n|(2δ + 3δλ̂_n·t)e^{−λ̂_n·t} ≤ 6Nδe^{−λ̂_0·t/2}.
#
# - *Zero-order hold at the well*, with steps at least T apart: |R(t)| ≤ max|Δu_k|·(h·e^{−λ̂_N·θ} + f), θ the time
#   since the last step, h = |ĉ_N|(1 + 1/(λ̂_N·T)) and f = 6Nδ(1 + τ/T), since Σ_{k≥0} e^{−xk} ≤ 1 + 1/x.
# - *Continuous pressure at the well*: |R(t)| ≤ max|u′|·∫|E| ≤ max|u′|(|ĉ_N|/λ̂_N + 6Nδτ). ∎

MODES = 8
_PI = Fraction("3.14159265358979323846")  # π̂
_PI_ERROR = Fraction(1, 10**20)  # δ


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class DiffusionPath:
    """Diffusion path between well and fault.

    Attributes
    ----------
    time : Fraction
        τ = L²/D [s], positive.
    """

    time: Fraction

    def rate(self, number: int) -> Fraction:
        """λ̂_n [1/s]."""
        return ((2 * number + 1) * _PI / 2) ** 2 / self.time

    def share(self, number: int) -> Fraction:
        """ĉ_n [-]."""
        return Fraction((-1) ** number * 4) / (_PI * (2 * number + 1))

    def truncation_bound(self, step: Fraction) -> tuple[Fraction, Fraction, Fraction]:
        """h [-], λ̂_N [1/s] and f [-] of a well whose pressure steps are at least `step` [s] apart."""
        rate, rounding = self.rate(MODES), 6 * MODES * _PI_ERROR
        return abs(self.share(MODES)) * (1 + 1 / (rate * step)), rate, rounding * (1 + self.time / step)

    @property
    def truncation_integral(self) -> Fraction:
        """Bound of ∫|E| [s]."""
        return abs(self.share(MODES)) / self.rate(MODES) + 6 * MODES * _PI_ERROR * self.time

    @property
    def area(self) -> Fraction:
        """A = −∫E [s], exactly; see the next section."""
        return self.time / 2 - sum((self.share(n) / self.rate(n) for n in range(MODES)), Fraction(0))

    @property
    def response_integral(self) -> Fraction:
        """Bound of ∫|F| [s²], F(t) = −∫_t^∞ E."""
        return abs(self.share(MODES)) / self.rate(MODES) ** 2 + 6 * MODES * _PI_ERROR * self.time**2


# ----------------------------------------------------------------------
# Effect of the fast modes of a diffusion path on the slip rate at each pressure step: a known jump, and a remainder.
#
# **Statement.** Let R be the error of truncating the series after the modes n < N (previous section), E that of a unit
# step, and A = τ/2 − Σ_{n<N} ĉ_n/λ̂_n. Then ∫E = −A exactly. With F(t) = −∫_t^∞ E, Y = Σ_k Δu_k·F(t − t_k) over the
# past steps, and e2 = x2 + β0·b·Y, the loop e1′ = e2, e2′ = s0·e1 − w0·e2 + β0·b·(v/b + R) + a is equivalent to
#
#     e1′ = x2 + β0·bY,   x2′ = s0·e1 − w0·x2 + β0·v + a − w0·β0·bY,   x2 ← x2 − β0·A·bΔu_k at every step.
#
# *Proof.* ∫₀^∞ Σ c_n·e^{−λ_n·t}dt = τ/2, since 1/cosh √(sτ) = 1 − sτ/2 + …; so F(0) = A, and R − Y′ = −A·Σ_k Δu_k·δ(t −
# t_k). ∎ Y, the future effect of the past steps, is unknown like R, but its bound is that of R over λ_N, and no
# derivative of Y occurs in the loop.
#
# **Bounds.** |F(t)| ≤ |ĉ_N|/λ̂_N·e^{−λ̂_N·t} + 6Nδτ·e^{−λ̂_0·t/2}: the terms c_n/λ_n·e^{−λ_n·t} alternate and decrease
# as those of E, and the errors of ĉ_n and λ̂_n add at most 6Nδ·e^{−λ̂_0·t/2} to |E|, 2/λ̂_0 < τ.
#
# - *Zero-order hold at the well*: |Y| ≤ max|Δu_k|·(h/λ̂_N·e^{−λ̂_N·θ} + f·τ) with θ, h and f of the previous section.
# - *Continuous pressure at the well*: with Y = ∫u′(σ)F(t − σ)dσ there are no jumps, but R = Y′ − A·u′, so that
#   A·bu′ is subtracted from v, and |Y| ≤ max|u′|·(|ĉ_N|/λ̂_N² + 6Nδτ²). ∎


def with_response_area(loop: PeriodicLoop, gain: Fraction, path: DiffusionPath) -> PeriodicLoop:
    """A loop of `sampled_error_loop` through a diffusion path, with x2 in place of e2, and Y in place of β0·R.

    The input ``awaited`` [m/s²] is bY divided by a time, the ratio of the bounds of |bY| and |bR|. Its bound is
    therefore that of bR: the output ``left_out``, multiplied by the decaying weight of the input if the well has a
    zero-order hold. The sampled input ``awaited_told`` is the part of bY in the measurements, divided by the same time.

    Parameters
    ----------
    loop : PeriodicLoop
    gain : Fraction
        β0 [-].
    path : DiffusionPath
        Diffusion path between well and fault.
    """
    size, slip_rate = len(loop.states), loop.states.index("e2")
    *others, last = loop.segments
    if loop.fading:
        share, fading = _share_and_fading(loop, path)
        step = last.jump[loop.states.index("stepped")]
        kicked = [list(row) for row in last.jump]
        kicked[slip_rate] = [v - gain * path.area * d for v, d in zip(kicked[slip_rate], step, strict=True)]
        last = replace(last, jump=tuple(map(tuple, kicked)))
        late = fading.weight(last.duration)  # at the sample, which comes before the next step
    else:
        share, fading, late = path.response_integral / path.truncation_integral, None, Fraction(1)
        behind = loop.states.index("behind")
        flow = [list(row) for row in loop.flow]
        flow[slip_rate][behind] -= gain * path.area * flow[behind][behind]
        loop = replace(loop, flow=tuple(map(tuple, flow)))
    segments = (*others, last)
    measured = tuple(row[slip_rate] - (i == slip_rate) for i, row in enumerate(segments[0].jump))
    own = gain * share
    entry = unit_row(size, {loop.states.index("e1"): own, slip_rate: own * loop.flow[slip_rate][slip_rate]})
    return replace(
        loop,
        segments=segments,
        inputs=loop.inputs if fading else {**loop.inputs, "awaited": entry},
        sampled={**loop.sampled, "awaited_told": tuple(own * late * v for v in measured)},
        fading={**loop.fading, "awaited": replace(fading, entry=entry)} if fading else {},
        feedthrough={("slip_rate_error", "awaited"): own},
    )


def _share_and_fading(loop: PeriodicLoop, path: DiffusionPath) -> tuple[Fraction, Fading]:
    """Bound of |bY| divided by that of |bR| [s], and the decay of |bY|."""
    (own,) = loop.fading.values()
    height, rate, floor = path.truncation_bound(loop.period)
    awaited = height / rate, floor * path.time
    most = sum(awaited)
    return most / (height + floor), replace(own, height=awaited[0] / most, floor=awaited[1] / most)
