"""The linear design problem of one fault, and its nondimensional twin, in exact numbers."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from quakedesign.certificates.sectors import Sectors, sectors
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.rationals import fraction_of, rational
from quakedesign.symbolic import plant
from quakedesign.synthesis.linear.plant.rational_matrices import Matrix, characteristic, congruent, hurwitz

Vertex = tuple[Fraction, Fraction, Fraction]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scales:
    """Units in which a problem is solved.

    Attributes
    ----------
    time : Fraction
        [s].
    slip : Fraction
        [m].
    pressure : Fraction
        [Pa].
    """

    time: Fraction
    slip: Fraction
    pressure: Fraction

    @property
    def states(self) -> tuple[Fraction, ...]:
        """Units of x1 [m], x2 [m/s], ξ1 [m s], ξ2 [m s²]."""
        return tuple(self.slip * self.time**n for n in (0, -1, 1, 2))

    def gains_outside(self, gains: Sequence[Fraction | float]) -> tuple[Fraction, ...]:
        """Gains in SI (4) of nondimensional ones."""
        return tuple(Fraction(k) * self.pressure / u for k, u in zip(gains, self.states, strict=True))

    def gains_inside(self, gains: Sequence[Fraction | float]) -> tuple[Fraction, ...]:
        """Nondimensional gains (4) of those in SI."""
        return tuple(Fraction(k) * u / self.pressure for k, u in zip(gains, self.states, strict=True))

    def form_inside(self, matrix: Sequence[Sequence[Fraction | float]]) -> Matrix:
        """Matrix (4 × 4) of the quadratic form xᵀMx in nondimensional states."""
        return congruent(matrix, self.states)

    def form_outside(self, matrix: Sequence[Sequence[Fraction | float]]) -> Matrix:
        """Matrix (4 × 4) of a nondimensional quadratic form in SI states."""
        return congruent(matrix, [1 / u for u in self.states])


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearProblem:
    """x1' = x2, x2' = s·x1 − w·x2 + β·b·p with s, w, β anywhere in their ranges; ξ1' = x1, ξ2' = ξ1.

    Attributes
    ----------
    stiffness : Fraction
        Nominal k̂ [1/s²]: the nominal plant has s = −k̂.
    damping : Fraction
        Nominal η̂ [1/s].
    sectors : Sectors
        Ranges, authority b, and g1, g2 with |h| ≤ g1|x1| + g2|x2| about the nominal plant.

    Raises
    ------
    ParameterError
        For an authority that is not positive, or β below 1 (B0 must be the least, ERRATA 9).
    """

    stiffness: Fraction
    damping: Fraction
    sectors: Sectors

    def __post_init__(self) -> None:
        if self.sectors.authority <= 0 or self.sectors.beta[0] < 1:
            raise ParameterError(
                "authority must be positive and the least: beta from 1 upwards. Received "
                f"b = {float(self.sectors.authority):.4g}, beta from {float(self.sectors.beta[0]):.4g}. "
                "Take b = min(mu N) (ERRATA 9)."
            )

    @classmethod
    def of(cls, fault: Fault) -> "LinearProblem":
        """Problem of a fault over its uncertainty box, about any constant reference up to the target slip."""
        values = {symbol: fraction_of(v) for symbol, v in plant.plant_values(fault).items()}
        return cls(stiffness=values[plant.k_hat], damping=values[plant.eta_hat], sectors=sectors(fault))

    @property
    def bounds(self) -> tuple[Fraction, Fraction]:
        """g1 [Pa/m] and g2 [Pa·s/m]."""
        return self.sectors.row_bounds

    def scales(self, slip: Fraction | float | str = 1) -> Scales:
        """Units that make ω_n and the authority 1: time 1/ω_n, a slip [m], pressure slip·ω_n²/b."""
        k, eta = float(self.stiffness), float(self.damping)
        pace = math.sqrt(k) if k > 0 else max(abs(eta), math.sqrt(max(map(abs, map(float, self.sectors.slip)))), 1e-300)
        time, size = rational(f"{1 / pace:.13e}"), rational(slip, "slip")
        return Scales(time=time, slip=size, pressure=size / time**2 / self.sectors.authority)

    def nondimensional(self, scales: Scales) -> "LinearProblem":
        """Return the same problem in other units, exactly."""
        t, old = scales.time, self.sectors
        g1, g2 = old.row_bounds
        authority = old.authority * scales.pressure * t**2 / scales.slip
        return LinearProblem(
            stiffness=self.stiffness * t**2,
            damping=self.damping * t,
            sectors=Sectors(
                authority=authority,
                beta=old.beta,
                slip=(old.slip[0] * t**2, old.slip[1] * t**2),
                rate=(old.rate[0] * t, old.rate[1] * t),
                row_bounds=(g1 * scales.slip / scales.pressure, g2 * scales.slip / t / scales.pressure),
                largest_effective_stress=old.largest_effective_stress / scales.pressure,
            ),
        )

    def vertices(self) -> list[Vertex]:
        """Different corners (β, s, w) of the ranges."""
        return self.sectors.vertices()

    def nominal(self) -> Matrix:
        """A0 (4 × 4) of the nominal plant with both integrals."""
        return loop_matrix((Fraction(0), -self.stiffness, self.damping), self.sectors.authority, (Fraction(0),) * 4)

    def loop(self, vertex: Vertex, gains: Sequence[Fraction]) -> Matrix:
        """Matrix (4 × 4) of the loop with p = −Kx at (β, s, w)."""
        return loop_matrix(vertex, self.sectors.authority, gains)


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedbackLoop:
    """The loop of p = −Kx, also about a moving reference: e1' = e2, e2' = s·e1 − w·e2 − βb(k1e1 + k2e2 + ζ) + force.

    ζ' = k3e1 + χ + drift and χ' = k4e1 + drift_rate, where ζ = k3ξ1 + k4ξ2 + p*(r) and χ = k4ξ1, each plus what the
    law feeds forward of the reference. The substitution removes every large term: the loop sees only
    force = φ_e − r″ − w·r′, drift = dp*(r)/dt and, for feedback on the state, drift_rate = k1r″ + k2r‴.

    Attributes
    ----------
    gains : sequence of 4 Fraction
        k1 … k4 in SI.
    sectors : Sectors
        b and the ranges of β, s and w, which may change at any time.
    """

    gains: Sequence[Fraction]
    sectors: Sectors

    def matrix(self, vertex: Vertex) -> Matrix:
        """Matrix (4 × 4) at constant (β, s, w)."""
        return loop_matrix(vertex, self.sectors.authority, self.gains)

    def stable(self, vertex: Vertex) -> bool:
        """Whether it is asymptotically stable with constant parameters, exactly (Routh, Hurwitz)."""
        return hurwitz(characteristic(self.matrix(vertex)))

    def unstable_vertex(self) -> Vertex | None:
        """Vertex whose constant loop is not asymptotically stable; None when all are."""
        return next((vertex for vertex in self.sectors.vertices() if not self.stable(vertex)), None)


def loop_matrix(vertex: Vertex, authority: Fraction, gains: Sequence[Fraction]) -> Matrix:
    """Matrix (4 × 4) of x1' = x2, x2' = s·x1 − w·x2 − β·b·Kx, ξ1' = x1, ξ2' = ξ1."""
    beta, s, w = vertex
    push = [-beta * authority * k for k in gains]
    zero, one = Fraction(0), Fraction(1)
    return (
        (zero, one, zero, zero),
        (push[0] + s, push[1] - w, push[2], push[3]),
        (one, zero, zero, zero),
        (zero, zero, one, zero),
    )
