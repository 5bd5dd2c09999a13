"""The premise of Theorem 2 as printed and as it must be, side by side.

The printed test asks whether K is optimal for a Q ≥ Q0 + R·GᵀG with the printed row G, the sound one whether it is for
a Q ≥ Q0 + R·W (ERRATA 6, 7). Neither looks at a pole: a K that the printed test accepts may leave an unstable plant in
the box.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from flint import arb

from quakedesign.certificates.guarantee.ball_matrices import ball, identity, matrix
from quakedesign.certificates.premises import least_authority, plant_ranges
from quakedesign.fault import Fault
from quakedesign.rationals import end_of, fraction_of, rational
from quakedesign.symbolic import plant
from quakedesign.symbolic.friction_bounds import friction_bounds
from quakedesign.synthesis.linear.analysis.inverse_optimality import InverseOptimality, inverse_optimality
from quakedesign.synthesis.linear.plant.problem import FeedbackLoop, LinearProblem, Vertex, loop_matrix
from quakedesign.synthesis.linear.plant.rational_matrices import (
    Matrix,
    definite,
    lyapunov,
    times,
    total,
)

Range = tuple[Fraction, Fraction]


@dataclass(frozen=True, slots=True, kw_only=True)
class BothTests:
    """What the printed and the sound test say about one K.

    Attributes
    ----------
    printed, sound : InverseOptimality
    unstable_at : (Fraction, Fraction, Fraction) or None
        A vertex (β, s [1/s²], w [1/s]) of the box at which the loop is not asymptotically stable, exactly (Routh).
    growth : Fraction or None
        Rigorous lower bound on the factor by which a switched plant of the box grows a period; above 1 a refutation.
    """

    printed: InverseOptimality
    sound: InverseOptimality
    unstable_at: Vertex | None
    growth: Fraction | None = None

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "printed": self.printed.to_dict(),
            "sound": self.sound.to_dict(),
            "unstable_at": [float(v) for v in self.unstable_at] if self.unstable_at else None,
            "growth": float(self.growth) if self.growth else None,
        }

    def table(self) -> str:
        """Markdown table of both tests and of what the plant does."""
        fate = "stable at every constant vertex"
        if self.unstable_at:
            fate = "unstable at β = {:.4g}, s = {:.4g}, w = {:.4g}".format(*map(float, self.unstable_at))
        elif self.growth and self.growth > 1:
            fate += f", but a switched plant grows {float(self.growth):.4g}-fold a period"
        return (
            "| test | verdict |\n|---|---|\n"
            f"| printed, Q ≥ Q0 + R·GᵀG | {self.printed.verdict} |\n"
            f"| sound, Q ≥ Q0 + R·W | {self.sound.verdict} |\n"
            f"| the loop itself | {fate} |\n"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Switching:
    """A periodic plant of a box: vertices and how long each lasts [s]."""

    vertices: tuple[Vertex, ...]
    durations: tuple[Fraction, ...]


def printed_row(fault: Fault) -> Range:
    """G of eq. lipschitz2 as printed: μ_x1σ'ΔN̂ in place of μ_x1(σ'N̂)_max, no friction in the second entry."""
    ranges, values = plant_ranges(fault), plant.plant_values(fault)

    def spread(symbol: Any) -> Fraction:
        nominal = fraction_of(values[symbol])
        return max(ranges[symbol][1] - nominal, nominal - ranges[symbol][0])

    weakening, stress = friction_bounds(fault.friction).slip_slope, ranges[plant.sigma][1]
    b, growth = least_authority(fault), fault.disturbance
    first = spread(plant.k_hat) + weakening * stress * spread(plant.N_hat) + abs(rational(growth.slip_growth))
    return first / b, (spread(plant.eta_hat) + abs(rational(growth.rate_growth))) / b


def both_tests(
    problem: LinearProblem, gains: Sequence[Fraction], printed: Range, switching: Switching | None = None
) -> BothTests:
    """Judge one K by the printed and by the sound test, and look at the loop itself.

    Parameters
    ----------
    problem : LinearProblem
    gains : sequence of 4 Fraction
        K, in the units of the problem.
    printed : (Fraction, Fraction)
        G as printed, see `printed_row`.
    switching : Switching, optional
        A plant of the box that changes in time.
    """
    return BothTests(
        printed=inverse_optimality(problem, gains, printed=printed),
        sound=inverse_optimality(problem, gains),
        unstable_at=FeedbackLoop(gains=gains, sectors=problem.sectors).unstable_vertex(),
        growth=switched_growth(problem, gains, switching) if switching else None,
    )


def switched_growth(problem: LinearProblem, gains: Sequence[Fraction], switching: Switching) -> Fraction:
    """Rigorous lower bound on the spectral radius of one period, in ball arithmetic.

    |trace Mⁿ| ≤ 4ϱⁿ bounds the spectral radius ϱ of the 4 × 4 period M from below.
    """
    period = identity(4)
    for vertex, duration in zip(switching.vertices, switching.durations, strict=True):
        loop = loop_matrix(vertex, problem.sectors.authority, gains)
        period = (matrix(loop) * ball(duration)).exp() * period
    power, best, n = period, Fraction(0), 1
    for _ in range(7):
        power, n = power * power, 2 * n
        best = max(best, end_of(((abs(power.trace()) / 4) ** (arb(1) / n)).lower()))
    return best


def decreases(
    problem: LinearProblem, gains: Sequence[Fraction], theta: Matrix, *, rate: Fraction = Fraction(0)
) -> bool:
    """Whether V = xᵀΘx is positive and V̇ < −2aV at every vertex, hence over the whole box; exact.

    V̇ is affine in β, s and w each, so that the vertices suffice, for parameters that vary in time as well.

    Parameters
    ----------
    problem : LinearProblem
    gains : sequence of 4 Fraction
    theta : matrix (4 × 4)
    rate : Fraction
        a [1/s].
    """
    held = times(-2 * rate, theta)
    return definite(theta) and all(
        definite(total(times(-1, lyapunov(problem.loop(v, gains), theta)), held)) for v in problem.vertices()
    )
