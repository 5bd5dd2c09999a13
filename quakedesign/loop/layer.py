"""Flow through the rock between well and fault: slow modes exactly, and a bound of all the others.

**Statement.** Let ∂p/∂t = D∂²p/∂x² in a layer of length L, without pressure at first, with the pressure u at the well
and without outflow at the fault, and τ = L²/D. With λ_n = ((2n + 1)π/2)²/τ and c_n = (4/π)(−1)ⁿ/(2n + 1) the pressure
in the fault t after a unit step of u is 1 − Σ c_n·e^{−λ_n·t} (Carslaw and Jaeger, Conduction of Heat in Solids, 1959,
sec. 3.4), Σ c_n = 1. So it is Σ_{n<N} c_n·z_n + (1 − Σ_{n<N} c_n)u + R with z_n′ = λ_n(u − z_n) and what is left out,
R(t) = Σ_k Δu_k·E(t − t_k) over the steps of u, E(t) = −Σ_{n≥N} c_n·e^{−λ_n·t}. These terms alternate and shrink, so
|E(t)| ≤ |c_N|e^{−λ_N·t}.

**In rationals.** π is replaced by π̂ = π(1 − δ), 0 ≤ δ ≤ 10⁻²⁰, so λ̂_n = λ_n(1 − δ)² and ĉ_n = c_n/(1 − δ), which adds
to |E(t)| at most Σ_{n<N} |c_n|(2δ + 3δλ̂_n·t)e^{−λ̂_n·t} ≤ 6Nδe^{−λ̂_0·t/2}.

- *A well whose pressure is held*, with a step at most every T: |R(t)| ≤ max|Δu_k|·(h·e^{−λ̂_N·θ} + f), θ the time since
  the last step, h = |ĉ_N|(1 + 1/(λ̂_N·T)) and f = 6Nδ(1 + τ/T), since Σ_{k≥0} e^{−xk} ≤ 1 + 1/x.
- *A well whose pressure moves*: |R(t)| ≤ max|u′|·∫|E| ≤ max|u′|(|ĉ_N|/λ̂_N + 6Nδτ). ∎
"""

from dataclasses import dataclass
from fractions import Fraction

MODES = 8
_PI = Fraction("3.14159265358979323846")  # π̂
_SHORT = Fraction(1, 10**20)  # δ


@dataclass(frozen=True, slots=True, kw_only=True)
class Layer:
    """The rock between well and fault.

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

    def left_out(self, step: Fraction) -> tuple[Fraction, Fraction, Fraction]:
        """h [-], λ̂_N [1/s] and f [-] of a well that steps at most every `step` [s]."""
        rate, rounding = self.rate(MODES), 6 * MODES * _SHORT
        return abs(self.share(MODES)) * (1 + 1 / (rate * step)), rate, rounding * (1 + self.time / step)

    @property
    def left_out_in_all(self) -> Fraction:
        """Bound of ∫|E| [s]."""
        return abs(self.share(MODES)) / self.rate(MODES) + 6 * MODES * _SHORT * self.time

    @property
    def area(self) -> Fraction:
        """A = −∫E [s], exactly; see `known_area`."""
        return self.time / 2 - sum((self.share(n) / self.rate(n) for n in range(MODES)), Fraction(0))

    @property
    def awaited_in_all(self) -> Fraction:
        """Bound of ∫|F| [s²], F(t) = −∫E from t on."""
        return abs(self.share(MODES)) / self.rate(MODES) ** 2 + 6 * MODES * _SHORT * self.time**2
