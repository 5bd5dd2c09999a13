"""What no controller can do with a fault in slow sliding, of its linearisation: two theorems, in ball arithmetic.

The plant is the nominal one about sliding at V, linearised at the pressure 0, without inertia (`SlidingModel` with
c = c_z = 1): slip error x, y = ln(v/V), z = ln(θ/θ_ss), pressure error q = p − p*, any measurable shear stress |d| ≤ D;
x(0) = z(0) = 0 and

    x′ = Vy,   z′ = −ρ(y + z),   Sy = −Kx − Wz + μq + d.

Controllers are any: linear or not, with memory, knowing plant, errors and stress exactly up to the sample.

**Theorem 1 (surprise).** If pressures are decided at samples T apart, no controller keeps |y| below D·h(t) for any
0 ≤ t < T, h the response of y to a unit step of d with q = 0: h(0) = 1/S.
*Proof.* Take d = D for ever, and the course on which it turns to −D just after a sample. All that is decided at this
sample or before is the same, so q is, until the next one. The two courses of y then differ by 2D·h(t) at t after the
turn, and one of them is at least D·h(t) in size. ∎  By continuity t = T may be taken as well.

**Theorem 2 (push).** Let λ > 0 be an eigenvalue without control, G the transfer function of the path from well to
fault, whose impulse response is not negative, and q the path's answer to the well's u, |u| ≤ P. If a stress d = D
begins while x = z = u = 0 and u stays 0 until T later, no controller keeps x and z bounded if D·e^{λT} > μP·G(λ).
*Proof.* The plant is controllable from y, so that a left eigenvector w can be scaled to give ζ = w·(x, z) with
ζ′ = λζ + μq + d. With what u up to now will still do, η: η′ = λη + μG(λ)u + D, η(0) = 0. Until T η grows to
D(e^{λT} − 1)/λ, and then η′ ≥ λη + D − μG(λ)P > 0 for ever: η grows exponentially. What differs from ζ is bounded. ∎
"""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from flint import arb_mat, ctx

from quakedesign.bounds import LowerBound
from quakedesign.certificates.guarantee.ball_matrices import ball
from quakedesign.loop import SlidingModel
from quakedesign.rationals import end_of

_BITS = 128
_ZERO, _ONE = Fraction(0), Fraction(1)


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingPush:
    """A linearised fault in slow sliding and the stress that may push it.

    Attributes
    ----------
    model : SlidingModel
        With c = c_z = 1.
    amplitude : Fraction
        D [Pa], positive.
    """

    model: SlidingModel
    amplitude: Fraction

    @property
    def authority(self) -> Fraction:
        """μ [-], what a pressure is worth beside a stress."""
        return self.model.coefficient

    @property
    def _ratios(self) -> tuple[Fraction, Fraction]:
        """κ = KV/(ρS) and β = W/S."""
        model = self.model
        return model.stiffness * model.rate / (model.state_rate * model.strength), model.weakening / model.strength

    @property
    def grows(self) -> bool:
        """Whether there is a real λ > 0: both eigenvalues are ρ times the roots of s² + (1 + κ − β)s + κ."""
        kappa, beta = self._ratios
        return beta > 1 + kappa and (beta - 1 - kappa) ** 2 >= 4 * kappa

    @property
    def pole(self) -> Any:
        """The largest λ [1/s]."""
        kappa, beta = self._ratios
        trace = beta - 1 - kappa
        return ball(self.model.state_rate) * (ball(trace) + ball(trace**2 - 4 * kappa).sqrt()) / 2

    def smallest_rate_error(self, step: Fraction) -> LowerBound:
        """V·D·h [m/s] of theorem 1 for samples a step [s] apart, the larger of both ends of a period."""
        kappa, beta = self._ratios
        flow = ((-kappa, -beta, _ONE), (kappa, beta - 1, -_ONE), (_ZERO, _ZERO, _ZERO))
        with ctx.workprec(_BITS):
            time = ball(step * self.model.state_rate)
            moved = (arb_mat([[ball(v) * time for v in row] for row in flow])).exp()
            late = 1 - ball(kappa) * moved[0, 2] - ball(beta) * moved[1, 2]
            share = max(_ONE, end_of(late.lower()))
        return LowerBound(self.model.rate * self.amplitude / self.model.strength * share)
