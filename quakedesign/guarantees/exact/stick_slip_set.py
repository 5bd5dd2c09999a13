"""Invariant polytope of the sampled loop on the stick–slip plant, in ball arithmetic.

**Plant.** Let y = x2 ≥ 0 be the slip rate, p*(x1) the pressure that balances the fault at rest at slip x1, b·β(x1) =
μN̂, and U = p*(x1) − p at a sample; p is constant until the next sample, a time T (T_s) later. For the slip ξ since the
sample

    y′ = −w·y + G(ξ) + φ + λ,   G(0) = −bβU,   G′(ξ) ∈ [S⁻, S⁺],   λ ≥ 0, λy = 0,

with w the damping, φ the disturbance, |φ| ≤ H, λ the reaction of the fault at rest, and S⁻ ≤ 0 ≤ S⁺ (the range is
widened to contain 0); k̂, N̂, b, β, φ1 and μ* are those of `quakedesign.plant.fault_plant`. This is exact: G(ξ) =
N̂μ(x1)(p − σ′) + N̂μ*σ′ − κx1, κ = k̂ − φ1, has the slope −κ − N̂μ′(σ′ − p). While the fault rests, its state is
constant. Backward slip is excluded while the shear force per mass N̂μ*σ′ − κx1 + φ is positive, which is checked.

**Two maps.** Let the block rest within a period. If G ≥ −H, the reaction keeps φ + λ = −G within [−H, H]: the motion is
one of the plant without stick under an admissible disturbance, with y ≥ 0. If G < −H, no disturbance releases the block
before the next sample, and the period ends with y = 0. So each period follows either the *sliding* map, with y ≥ 0 and
ξ ≥ 0 at its end, or the *rest* map with a slip δ until the last stop.

**Sliding map.** Let S = (G(ξ) − G(0))/ξ, S0 the midpoint and δS half the width of [S⁻, S⁺], w0 and δw likewise, and y
without argument the slip rate at the sample. ξ(T) and y(T) are linear in (y, bβU) and the input a(t) = φ + λ + (S −
S0)ξ(t) − (w − w0)y(t), |a(t)| ≤ H + δS·ξ(t) + δw·y(t). Until then ξ(t) ≤ (t·y + t²/2·(H − bβU))/(1 − S⁺T²/2) and y(t) ≤
y + t(H − bβU) + S⁺t·ξ(t), for w ≥ 0.

**Rest map.** Let τ = θT be any time with 1/2 + wT/24 ≤ θ ≤ 1, w the least damping, and f(t) = (1 − e^{−w(τ−t)})/w. As y
= 0 at the stop, integration by parts gives, for the damping w, δ = f(0)y + ∫f·(G + φ)dt up to the stop. Before the stop
G ≤ −H + |S⁻|(δ − ξ); this bound minus G is not negative and decreases with the slip. As f decreases, and ∫f dt ≥ 0 up
to the stop by the lower limit of θ, G may be replaced by its bound. So, with ε for larger damping,

    δ·(1 − |S⁻|T²/2 − ε) ≤ f(0)·y + 2H·(e^{wx} − 1 − wx)/w²,   x = (1 − θ)T,

where ε = (w⁺ − w⁻)·(e^{wx} − 1)/w, [w⁻, w⁺] the range of the damping. Moreover, G(δ) ≤ −H gives the condition of rest,
b·β_max·U ≥ H − |S⁻|δ.

The possible δ and U depend on r′ at the sample. The condition of rest is taken at the least r′, where it is weakest; so
both ends of the range of r′ suffice.

**Reference.** r(t + T) − r(t) is within max|r″|T²/2 of T·r′ and never negative. It may be 0 for r′ up to max|r″|T/2. So
where a facet function n_l·z (*Law*) after the period decreases with this increment, the end r′ = 0 covers all these r′.

**Input gain.** Let n3 be the third entry of a facet's normal, −s/(bβ) the chord slope of p* in the period, m1 the
factor of ξ in the facet function after a slide, which contains −n3·s/(bβ), X1 [s²] the slip in a period due to a
constant unit force per mass, and J the contribution of the ranges of slope and damping to the factor of H − bβU
(FORMAT.md, *Sliding map*). For β between its ends let ψ be the chord of 1/β minus 1/β. Where U ≥ 0, m1·ξ ≤ M·ξ +
(|n3·s|ψ/b)·ξ, with M the chord of m1 and ξ ≥ 0. β·M is at least the chord of β·m1 minus β|n3·s|ψ/b. So in −bU·β·M·X1
the chord of β·m1 may replace β·M if the term −bβU·X1 of the ξ in (|n3·s|ψ/b)·ξ is omitted; the same holds for J. Where
U < 0 replace m1 by the chord of β·m1, divided by β: all terms with U are convex in β, and |n3·s|ψ/b enters the terms
with y and H alone.

**Sliding mode.** The target rate is r′ + ω, ω the solution of the implicit step. That step is shown to be deadbeat, ω =
−e/T, for every measured slip error and slip rate of the polytope. Then the law is the linear one with return_rate =
1/T, whose states stay in the polytope.

**Law.** The law is `StickSlipLaw`, D its level. In a period d = D + p*(x1) changes by the law's update of D and, as p*
changes with the slip, by −σξ [Pa], σ = s/(bβ). State at the samples: z = (e1, y, d). A polytope {z: n_l·z ≤ 1, y ≥ 0}
is invariant if no facet function exceeds 1 after either map. A facet function after a map is linear on a polytope; its
maximum is bounded by multipliers of three or four constraints, which a file names.

**Noise.** The measured slip is x + n, |n| ≤ N, rest_slip ≥ 2N; the slip rate is measured exactly, including whether it
is 0. Let e1 = x1 − r + N, and let d exclude the noise term m·n of the same sample; m is slip_gain and c is return_rate.
Then this noise acts in one period alone: v is the target rate for r′ + c(N − n) in place of r′, a value in [0, max r′ +
2cN]; the reference moves up to 2cNT less than T times this value; U is m·n larger. Where the innovation is limited, it
adds between −mTv⁺/2 − m(rest_slip + 2N) and −mTv⁺/2 to d, and never less than the unlimited innovation would; otherwise
d contains no noise. Initially e1 = N and d = 0, as x⁻ (the slip measured one sample before) = 0 and the first
innovation, n, is not limited. The check requires more: the states (N, 0, d) with all d from 0 to m·N must lie in the
polytope.

**Aperiodic sampling.** Each interval between samples is any h from T to T_m; T is a constant of the law. The bound of a
facet after a slide is, for one state and one choice of ends, V(h) = l(h) + ∫|g(s)|A(h − s)ds over [0, h]. Here l is the
part without a, g the response of the facet function to an impulse of a, and A(t) = H + δS·ξ̂ + δw·ŷ bounds |a|, with
the bounds ξ̂, ŷ above as functions of t. A ≥ 0 is required up to T_m, also beyond the end of the actual interval, so
that one formula of V is valid for all h. g is Lipschitz, so V″ ≥ −B almost everywhere, and V is below its chord over an
interval of length Δ = (T_m − T)/4 plus Δ²B/8: bounds at the five values T, T + Δ, …, T_m of h suffice, with B from
|l″|, |g′|A(0), |g|·|A′| and ∫|g|·|A″|. After the rest map the bound is convex in h, so both ends suffice. A shorter
period that ends at rest can be extended to T_m, as nothing releases the block in the added time; so the bound for T_m
of the slip until a stop covers it.

**Peaks.** Between samples y is at most the slip rate of the motion under the largest force with the constant slope S⁺ ≥
0 and the least damping w⁻ ≥ 0. For that motion y″ = −w⁻y′ + S⁺y, which excludes an interior maximum; so y is at most
the larger of its initial value and the final value of that motion. e1 lies within max r′·T of its values at the
samples.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain, product
from math import comb
from typing import Any

import numpy as np
from flint import arb, ctx, fmpq

from quakedesign.errors import ParameterError
from quakedesign.exact import LowerBound, UpperBound, fraction_of, shortly
from quakedesign.files import Json
from quakedesign.guarantees.exact.norms import absolute, ball, majorant, matrix
from quakedesign.guarantees.exact.small_gain import sector_is_valid
from quakedesign.guarantees.exact.tracking_proof import above
from quakedesign.laws.implicit_root import ImplicitStep
from quakedesign.laws.stick_slip_law import StickSlipLaw
from quakedesign.plant.fault_plant import FaultPlant, Range

BITS = 128
NODES = 16  # pieces of a period, for integrals of impulse responses
LINES = 5  # number of bounds of the slip until a stop, minus 1
PIECES = 4  # equal parts of the range of sampling intervals
MOST_FACETS, MOST_BASES = 400, 40_000
_GRAIN = 2.0**-40  # of multipliers
_FLAT = 1e-12  # volume below which the normals of a vertex count as dependent
_NEAR = 1e-6  # relative distance of a proposed vertex from its polytope
_ZERO = Fraction(0)

# e1 is cut into slices at 0 and at ρ/c, ρ = max r′ + 2cN, c the return rate. A combination is (slice, whether the
# target rate v is positive, q1, q0), with r′ = q1·c·e1 + q0·ρ; this r′ includes the noise (*Noise*).
SLICES = 3
COMBINATIONS = (
    (0, True, 0, 0),
    (0, True, 0, 1),
    (1, True, 1, 0),
    (1, True, 0, 1),
    (1, False, 0, 0),
    (2, False, 0, 0),
    (2, False, 0, 1),
)
LEAST = (0, 0, 2, 2, 4, 5, 5)
"""Per combination, that with the least r′ in its slice and for its sign of v: its condition of rest is the weakest."""
# the rest map also needs the largest r′ of (1, v ≤ 0), c·e1
_AT_REST = (*zip(LEAST, COMBINATIONS, strict=True), (4, (1, False, 1, 0)))
Basis = tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class StickSlipPolytope:
    """Invariant polytope, with the multipliers and bases that prove its invariance.

    Attributes
    ----------
    facets : tuple of rows
        n_l, three entries each [1/m, s/m, 1/Pa]; each of the first five bounds one of +e1, y, +d, −e1, −d.
    multipliers : tuple of rows
        Five numbers for each facet. First: multiplier of y ≥ 0 at the end of a period [s/m], 0 or more. Second: 1 to
        set negative factors of ξ and y there to 0, as ξ ≥ 0 and y ≥ 0; else 0. Third and fourth: the same two for a
        limited innovation, where y = 0 and the multiplier may have either sign. Fifth: weight of the innovation at
        rest, from 0 to 1.
    sliding : tuple of tuple of Basis
        For each of the 3 slices its vertices, each by the indices of three constraints: facets, then y ≥ 0, then the
        ends of the slice.
    resting : tuple of tuple of Basis
        For each of the 7 combinations its vertices in (e1, y, d, δ), each by four constraints: the same, then δ ≥ 0,
        the condition of rest, then bounds of δ.

    Raises
    ------
    ParameterError
        When dimensions do not match, there are too many facets or bases, the first five facets are not along the axes,
        or a multiplier is out of its range.
    """

    facets: tuple[tuple[Fraction, ...], ...]
    multipliers: tuple[tuple[Fraction, ...], ...]
    sliding: tuple[tuple[Basis, ...], ...]
    resting: tuple[tuple[Basis, ...], ...]

    def __post_init__(self) -> None:
        count = len(self.facets)
        bases = [(basis, 3) for line in self.sliding for basis in line]
        bases += [(basis, 4) for line in self.resting for basis in line]
        axes = tuple((index, sign) for index, sign in ((0, 1), (1, 1), (2, 1), (0, -1), (2, -1)))
        conditions = {
            f"have 5 to {MOST_FACETS} facets": 5 <= count <= MOST_FACETS,
            "have facets of 3 entries": {len(row) for row in self.facets} == {3},
            "begin with facets along +e1, +y, +d, -e1 and -d alone": all(
                row[index : index + 1] and row[index] * sign > 0 and sum(map(bool, row)) == 1
                for row, (index, sign) in zip(self.facets, axes, strict=False)
            ),
            "have 5 multipliers for each facet": [len(row) for row in self.multipliers] == [5] * count,
            "have a first multiplier of 0 or more, a second and fourth of 0 or 1, and a fifth from 0 to 1": all(
                len(row) == 5 and row[0] >= 0 <= row[4] <= 1 and row[1] in (0, 1) and row[3] in (0, 1)
                for row in self.multipliers
            ),
            f"have bases for {SLICES} slices and {len(COMBINATIONS)} combinations": (
                len(self.sliding) == SLICES
                and len(self.resting) == len(COMBINATIONS)
                and all((*self.sliding, *self.resting))
            ),
            "have bases of 3 constraints for slices and of 4 for combinations, by indices of 0 or more": all(
                len(basis) == size and min(basis) >= 0 for basis, size in bases
            ),
            f"have at most {MOST_BASES} bases": len(bases) <= MOST_BASES,
        }
        for condition, fits in conditions.items():
            if not fits:
                raise ParameterError(f"a polytope of the stick-slip plant must {condition}. Search for it again.")

    @property
    def box(self) -> tuple[Fraction, ...]:
        """Bounds of +e1 [m], y [m/s], +d [Pa], −e1 [m] and −d [Pa]."""
        return tuple(1 / abs(sum(row, _ZERO)) for row in self.facets[:5])


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledStickSlip:
    """A sampled law on the stick–slip plant, with zero-order hold over T_s.

    Attributes
    ----------
    law : StickSlipLaw
    step : Fraction
        T_s [s].
    slip_noise : Fraction
        Bound of the measurement error of the slip [m], at most half of the law's rest_slip. The slip rate is exact.
    longest_step : Fraction
        Longest interval of aperiodic sampling, with `step` as the shortest [s]; 0 for periodic sampling.

    Raises
    ------
    ParameterError
        For a step that is not positive, a longest step that is not larger, noise out of its range, or a sliding mode
        with other gains than a deadbeat step has, or with aperiodic sampling.
    """

    law: StickSlipLaw
    step: Fraction
    slip_noise: Fraction = _ZERO
    longest_step: Fraction = _ZERO

    def __post_init__(self) -> None:
        if self.step <= 0:
            raise ParameterError(f"T_s must be positive, got {shortly(self.step)} s")
        if self.longest_step and (self.longest_step <= self.step or self.law.pull):
            raise ParameterError(
                f"longest_step must be 0 or above T_s, {shortly(self.step)} s, and 0 for a sliding mode, got "
                f"{shortly(self.longest_step)} s"
            )
        if not 0 <= 2 * self.slip_noise <= self.law.rest_slip:
            raise ParameterError(
                f"slip_noise must be from 0 to half of rest_slip, {shortly(self.law.rest_slip / 2)} m. "
                f"Received {shortly(self.slip_noise)} m. Increase rest_slip."
            )
        deadbeat = self.law.rate_gain == self.law.target_gain and self.law.return_rate * self.step == 1
        if self.law.pull and not deadbeat:
            raise ParameterError(
                "a sliding mode must have target_gain = rate_gain and return_rate = 1/T_s, got "
                f"{shortly(self.law.target_gain)} and {shortly(self.law.rate_gain)} Pa s/m, and "
                f"{shortly(self.law.return_rate)} 1/s"
            )

    @property
    def noise(self) -> dict[str, Fraction]:
        """Bounds of measurement errors, as `SampledLoop.noise`."""
        return {"slip_noise": self.slip_noise} if self.slip_noise else {}

    @property
    def longest(self) -> Fraction:
        """Longest interval between samples [s]."""
        return self.longest_step or self.step

    @property
    def intervals(self) -> tuple[Fraction, ...]:
        """Sampling intervals whose check covers all intervals [s]."""
        if not self.longest_step:
            return (self.step,)
        return tuple(self.step + (self.longest_step - self.step) * i / PIECES for i in range(PIECES + 1))

    @property
    def target_noise(self) -> Fraction:
        """Largest contribution of noise to the reference rate in the law [m/s]."""
        return 2 * self.law.return_rate * self.slip_noise

    @property
    def pressure_noise(self) -> Fraction:
        """Largest contribution of noise to U [Pa]."""
        return self.law.slip_gain * self.slip_noise

    def errors(self, task: FaultPlant, slip: Fraction, rate: Fraction) -> tuple[Fraction, Fraction]:
        """Bounds of the measured slip error [m] and slip-rate error [m/s], from those of slip error and slip rate."""
        return slip + self.slip_noise, max(rate, task.reference_rates[0])

    @property
    def path(self) -> dict[str, Fraction]:
        """Delay, lag and diffusion [s], as `SampledLoop.path`: none."""
        return {}

    @property
    def initial_errors(self) -> tuple[Fraction, Fraction]:
        """Bounds [m, m/s], as `SampledLoop.initial_errors`: 0 at rest."""
        return Fraction(0), Fraction(0)


@dataclass(frozen=True, slots=True, kw_only=True)
class StickSlipClaims:
    """Bounds of slip error, slip rate and pressure, as proved or as claimed.

    Attributes
    ----------
    slip_behind, slip_ahead : UpperBound
        Largest distances of the slip behind and ahead of the reference [m].
    peak_slip_rate : UpperBound
        [m/s].
    least_pressure, largest_pressure : LowerBound, UpperBound
        [Pa].
    """

    slip_behind: UpperBound
    slip_ahead: UpperBound
    peak_slip_rate: UpperBound
    least_pressure: LowerBound
    largest_pressure: UpperBound

    @property
    def slip_error(self) -> UpperBound:
        """Absolute value of slip minus reference [m]."""
        return max(self.slip_behind, self.slip_ahead)

    @property
    def pressures(self) -> tuple[tuple[LowerBound, UpperBound], ...]:
        """In the fault [Pa], as `Claims.pressures`."""
        return ((self.least_pressure, self.largest_pressure),)

    def rounded(self) -> "StickSlipClaims":
        """Rounded outward to four digits."""
        return StickSlipClaims(
            slip_behind=UpperBound(above(self.slip_behind)),
            slip_ahead=UpperBound(above(self.slip_ahead)),
            peak_slip_rate=UpperBound(above(self.peak_slip_rate)),
            least_pressure=LowerBound(-above(-self.least_pressure)),
            largest_pressure=UpperBound(above(self.largest_pressure)),
        )

    def follow(self, proved: "StickSlipClaims") -> bool:
        """Whether these claims follow from what is proved."""
        return (
            self.slip_behind >= proved.slip_behind
            and self.slip_ahead >= proved.slip_ahead
            and self.peak_slip_rate >= proved.peak_slip_rate
            and self.least_pressure <= proved.least_pressure
            and self.largest_pressure >= proved.largest_pressure
        )

    def to_dict(self) -> Json:
        """Exact numbers as strings, SI."""
        return {
            "slip_behind": self.slip_behind.exact,
            "slip_ahead": self.slip_ahead.exact,
            "peak_slip_rate": self.peak_slip_rate.exact,
            "pressure": [self.least_pressure.exact, self.largest_pressure.exact],
        }


@dataclass(frozen=True, slots=True)
class Numbers:
    """Number type: floats for a search, balls for a proof; arrays have the same operations."""

    number: Callable[[Fraction], Any]
    exponential: Callable[[tuple[tuple[Fraction, ...], ...]], list[list[arb]]]
    bent: Callable[[tuple[tuple[Fraction, ...], ...], Fraction], tuple[tuple[Any, Any], ...]]
    array: Callable[[object], np.ndarray]
    middle: Callable[[np.ndarray], np.ndarray]

    def without(self, values: np.ndarray, flags: np.ndarray) -> np.ndarray:
        """Values, with 0 in place of flagged values that are certainly negative."""
        return np.where(flags & (values < 0).astype(bool), self.number(_ZERO), values)


def _ball_exponential(rows: tuple[tuple[Fraction, ...], ...]) -> list[list[arb]]:
    exponential: list[list[arb]] = matrix(rows).exp().tolist()
    return exponential


def curvature(flow: tuple[tuple[Fraction, ...], ...], step: Fraction) -> tuple[tuple[Any, Any], ...]:
    """Bounds of |(A^k e^{Aτ})_12| and |(A^k e^{Aτ})_22| for 0 ≤ τ ≤ T, k = 0 to 2."""
    a = matrix(flow)
    within = absolute((majorant(a) * ball(step)).exp())
    powers = (within, absolute(a) * within, absolute(a * a) * within)
    return tuple((power[0, 1].upper(), power[1, 1].upper()) for power in powers)


def _ball_array(values: object) -> np.ndarray:
    table = np.array(values, dtype=object)
    return np.asarray(np.vectorize(lambda v: ball(v) if isinstance(v, Fraction) else arb(v), otypes=[object])(table))


def _ball_middle(values: np.ndarray) -> np.ndarray:
    return np.asarray(np.vectorize(float, otypes=[float])(values))


def _exact(value: Any) -> fmpq:
    number = Fraction(value)
    return fmpq(number.numerator, number.denominator)


def _exact_array(values: object) -> np.ndarray:
    return np.asarray(np.vectorize(_exact, otypes=[object])(np.array(values, dtype=object)))


BALLS = Numbers(ball, _ball_exponential, curvature, _ball_array, _ball_middle)
EXACT = Numbers(_exact, _ball_exponential, curvature, _exact_array, _ball_middle)
"""Exact rationals, for computations without exponentials."""


# ----------------------------------------------------------------------
# Numbers of one period.


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranges:
    """Ranges of the plant on a set of states, exact.

    Attributes
    ----------
    slope, damping : (Fraction, Fraction)
        [S⁻, S⁺] [1/s²], [w⁻, w⁺] [1/s].
    chord : (Fraction, Fraction)
        Range of bβσ [1/s²].
    rest_pressure : (Fraction, Fraction)
        p* [Pa].
    """

    slope: Range
    damping: Range
    chord: Range
    rest_pressure: Range


def ranges(task: FaultPlant, ahead: Fraction, feedback: Range, moved: Fraction) -> Ranges:
    """Ranges of the plant for bounds of slip and of U = p* − p [Pa].

    The slip is at most `ahead` [m] beyond the target, and grows by at most `moved` [m] in a period.

    β ≥ 1 changes within a period by at most N̂|μ′|/b·`moved`, so |σ| exceeds |S*|/(bβ), S* the chord slope of G for p =
    p*, by at most this fraction.

    Raises
    ------
    ParameterError
        Where the theorem does not hold: the fault may open or slip backward, or its damping may be negative.
    """
    wide = replace(task, target_slip=task.target_slip + ahead)
    low, high = wide.stress
    stress = min(low, low + feedback[0]), max(high, high + feedback[1])
    slope, chord, damping = task.slip_slopes(stress), task.slip_slopes((low, high)), task.rate_slopes(stress)
    if stress[0] <= 0:
        raise ParameterError("the fault may open: its effective normal stress may reach 0 Pa")
    if damping[0] < 0:
        raise ParameterError("friction may weaken with the slip rate by more than the damping: w may be negative")
    stiffness = max(task.stiffness[1] - task.growths[0], _ZERO)
    load = task.area_per_mass[0] * task.friction.static * task.normal_stress
    if load <= stiffness * wide.target_slip + task.amplitude:
        raise ParameterError("the shear stress may reverse, so that the fault might slip backward")
    change = max(task.friction.weakening, task.friction.strengthening) * task.area_per_mass[1] / task.authority
    chord = (1 + change * moved) * chord[0], (1 + change * moved) * chord[1]
    slope, chord = ((min(pair[0], _ZERO), max(pair[1], _ZERO)) for pair in (slope, chord))
    rest = task.normal_stress - high, task.normal_stress - low
    return Ranges(slope=slope, damping=damping, chord=chord, rest_pressure=rest)


def stop_bounds(
    task: FaultPlant, sampled_loop: SampledStickSlip, plant: Ranges
) -> tuple[tuple[Fraction, Fraction], ...]:
    """Pairs (g, h) with δ ≤ g·y + h for the slip δ [m] until a last stop within a period.

    Upper bounds of the exponentials, τ = θT: (1 − e^{−wτ})/w ≤ τ − wτ²/2 + w²τ³/6, (e^{wx} − 1 − wx)/w² ≤ x²/2/(1 −
    wx/3) and (e^{wx} − 1)/w ≤ x/(1 − wx/2).

    Raises
    ------
    ParameterError
        For a period that is too long for the damping and the slope of friction.
    """
    step, amplitude = sampled_loop.longest, task.amplitude
    low, high = plant.damping
    least = Fraction(1, 2) + low * step / 24
    pairs = []
    for i in range(LINES + 1):
        share = least + (1 - least) * i / LINES
        tau, x = share * step, (1 - share) * step
        factor = 1 + plant.slope[0] * step**2 / 2 - (high - low) * x / (1 - low * x / 2)
        if least >= 1 or low * x >= 1 or factor <= 0:
            raise ParameterError(
                "T_s, or the longest interval of aperiodic sampling, is too long, for this damping and friction slope, "
                "to bound the slip until a stop"
            )
        start = tau - low * tau**2 / 2 + low**2 * tau**3 / 6
        pairs.append((start / factor, amplitude * x**2 / (1 - low * x / 3) / factor))
    return tuple(pairs)


@dataclass(frozen=True, slots=True, kw_only=True)
class Period:
    """One sampling interval in the number type of a back end; SI units."""

    back: Numbers
    task: FaultPlant
    sampled_loop: SampledStickSlip
    plant: Ranges
    interval: Fraction
    of_rate: tuple[Any, Any]  # ξ and y at the end, per initial y
    of_force: tuple[Any, Any]  # and per constant force
    impulses: tuple[np.ndarray, np.ndarray]  # ξ and y after an impulse, at the nodes
    weights: np.ndarray  # integrals of the hat functions of the nodes times t^j, j = 0 to 3
    bent: tuple[Any, Any]  # bounds of the second derivatives of the impulse responses of ξ and y
    margin: tuple[Any, ...]  # for factors of ξ and y: excess of a bound between two checked intervals

    @classmethod
    def deciding(
        cls,
        back: Numbers,
        task: FaultPlant,
        sampled_loop: SampledStickSlip,
        plant: Ranges,
        rate: Fraction,
        feedback: Range,
    ) -> "list[Period]":
        """Periods whose check covers all intervals, for bounds of the slip rate [m/s] and of U [Pa]."""
        zero, one = _ZERO, Fraction(1)
        slope, damping = (sum(pair, _ZERO) / 2 for pair in (plant.slope, plant.damping))
        flow = (zero, one), (slope, -damping)
        tall = (*((*row, entry) for row, entry in zip(flow, (zero, one), strict=True)), (zero, zero, zero))
        sizes, periods = back.bent(flow, sampled_loop.longest), []
        margin = _margin(back, task, sampled_loop, plant, sizes, rate, feedback)
        for interval in sampled_loop.intervals:
            whole = back.exponential(tuple(tuple(v * interval for v in row) for row in tall))
            ends = [tuple(tuple(v * interval / NODES * i for v in row) for row in flow) for i in range(NODES + 1)]
            nodes, h = list(map(back.exponential, ends)), interval / NODES
            period = cls(
                back=back,
                task=task,
                sampled_loop=sampled_loop,
                plant=plant,
                interval=interval,
                of_rate=(whole[0][1], whole[1][1]),
                of_force=(whole[0][2], whole[1][2]),
                impulses=(back.array([node[0][1] for node in nodes]), back.array([node[1][1] for node in nodes])),
                weights=back.array([[weight * h ** (j + 1) for weight in line] for j, line in enumerate(_WEIGHTS)]),
                bent=sizes[2],
                margin=margin,
            )
            periods.append(period)
        return periods

    def integrals(self, of_slip: np.ndarray, of_rate: np.ndarray) -> list[np.ndarray]:
        """∫h(t)·t^j dt, j = 0 to 3, with h(t) ≥ |g(T − t)| for an impulse response g.

        On a piece of length ℓ, h is the chord of |g| plus ℓ²/8·max|g″|. All integrals use this one function, since a
        factor of a single integral may be negative.
        """
        number, h = self.back.number, self.interval / NODES
        above = (abs(of_slip) * self.bent[0] + abs(of_rate) * self.bent[1]) * number(h**2 / 8)
        sizes = abs(of_slip[:, None] * self.impulses[0] + of_rate[:, None] * self.impulses[1]) + above[:, None]
        sizes = sizes[:, ::-1]  # from the start of the period on
        total = 0 * sizes[:, :1]
        for size, weights in zip(sizes.T, self.weights.T, strict=True):
            total = total + size[:, None] * weights
        return list(total.T)

    def range_effects(self, whole: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Contribution of the ranges of slope and damping to the factors of y and H − bβU."""
        number, plant = self.back.number, self.plant
        growth = 1 / (1 - plant.slope[1] * self.sampled_loop.longest**2 / 2)
        per_slip = number((plant.slope[1] - plant.slope[0]) / 2 * growth)
        per_rate, steepest = number((plant.damping[1] - plant.damping[0]) / 2), number(plant.slope[1] * growth)
        of_rate = per_slip * whole[1] + per_rate * (whole[0] + steepest * whole[2])
        return of_rate, (per_slip * whole[2] + per_rate * steepest * whole[3]) / 2 + per_rate * whole[1]


def _margin(
    back: Numbers,
    task: FaultPlant,
    sampled_loop: SampledStickSlip,
    plant: Ranges,
    sizes: tuple[tuple[Any, Any], ...],
    rate: Fraction,
    feedback: Range,
) -> tuple[Any, ...]:
    """Bounds of Δ²/8·|V″| for factors of ξ and y, Δ the distance between checked intervals.

    `sizes` are bounds of the impulse responses of ξ and y and of their first two derivatives.
    """
    number, longest, most = back.number, sampled_loop.longest, task.beta[1] * task.authority
    step = (longest - sampled_loop.step) / PIECES
    still = task.reference_rates[1] * longest / 2 + sampled_loop.target_noise
    pushed = most * (max(map(abs, feedback)) + sampled_loop.law.target_gain * still + sampled_loop.pressure_noise)
    growth = 1 / (1 - plant.slope[1] * longest**2 / 2)
    per_slip, per_rate = (plant.slope[1] - plant.slope[0]) / 2 * growth, (plant.damping[1] - plant.damping[0]) / 2
    force = task.amplitude + pushed
    first, later = task.amplitude + per_rate * rate, per_rate * force
    last = longest * force * (per_slip + 3 * per_rate * plant.slope[1] * growth * longest)
    own, moved, bent = sizes
    return tuple(
        number(step**2 / 8) * (c * number(rate) + b * number(pushed + first) + a * number(later + last))
        for a, b, c in zip(own, moved, bent, strict=True)
    )


def _weights() -> list[list[Fraction]]:
    """Integrals of hat functions at 0 to NODES times t^j, j = 0 to 3."""
    weights = [[_ZERO] * (NODES + 1) for _ in range(4)]
    for j, line in enumerate(weights):
        for i, k in product(range(NODES), range(j + 1)):
            line[i] += Fraction(comb(j, k) * i ** (j - k), (k + 1) * (k + 2))
            line[i + 1] += Fraction(comb(j, k) * i ** (j - k), k + 2)
    return weights


_WEIGHTS = _weights()


def gap(beta: Range) -> Fraction:
    """Bound of the chord of 1/β over its range minus 1/β: (β1 − β0)²/(4β0²β1)."""
    return (beta[1] - beta[0]) ** 2 / (4 * beta[0] ** 2 * beta[1])


# ----------------------------------------------------------------------
# Images of the facets after one period: linear functions to be bounded on polytopes.


@dataclass(frozen=True, slots=True)
class Rows:
    """Functions c·z + k of facets on the polytope of a slice (3 entries) or combination (4).

    Attributes
    ----------
    place : int
        Index of the slice, or `SLICES` plus that of the combination.
    which : ndarray of int
        Indices of the facets.
    factors, constants : ndarray
    cut : bool
        Whether the innovation of the slip is limited in the sliding map.
    """

    place: int
    which: np.ndarray
    factors: np.ndarray
    constants: np.ndarray
    cut: bool = False


def feedback_row(
    sampled_loop: SampledStickSlip, fastest: Fraction, combination: tuple[int, bool, int, int]
) -> tuple[tuple[Fraction, Fraction, Fraction], Fraction, tuple[Fraction, Fraction]]:
    """Factors of (e1, y, d) in U and its constant [Pa], and slope and intercept of r′ in e1."""
    law = sampled_loop.law
    slope, end = law.return_rate * combination[2], fastest * combination[3]
    row = -law.target_gain * (slope - law.return_rate), law.rate_gain, Fraction(1)
    return row, -law.target_gain * end, (slope, end)


@dataclass(frozen=True, slots=True)
class _Carried:
    """Effect of law and reference on the facets in a combination, without the plant."""

    place: int
    feedback: tuple[Fraction, Fraction, Fraction]
    feedback0: Fraction
    of_error: np.ndarray
    constant: np.ndarray
    rising: np.ndarray  # factor of r′ itself
    standstill: np.ndarray  # largest r′ at which r may stand still, if the end r′ = 0 is taken and n1 > 0; else 0

    def moved(self, pushed: np.ndarray | int, which: np.ndarray) -> np.ndarray:
        """Contribution of r′ where the reference may stand still; `pushed` is the plant's factor of −r′."""
        rising = self.rising[which] - pushed
        return np.asarray(self.standstill[which] * (rising + abs(rising)) / 2)


_Combination = tuple[int, bool, int, int]


def _carried(
    back: Numbers,
    task: FaultPlant,
    sampled_loop: SampledStickSlip,
    step: Fraction,
    facets: np.ndarray,
    ends: Sequence[tuple[int, _Combination]],
) -> Iterator[_Carried]:
    number, law = back.number, sampled_loop.law
    n1, _, n3 = facets.T
    (fastest, bend), noise = task.reference_rates, sampled_loop.target_noise
    predicted = n3 * number(law.level_gain + law.slip_gain * sampled_loop.step / 2)
    for place, combination in ends:
        feedback, feedback0, (q1, q0) = feedback_row(sampled_loop, fastest + noise, combination)
        p1, p0 = (q1 - law.return_rate, q0) if combination[1] else (_ZERO, _ZERO)
        # r(t + T) - r(t) is within max|r''|T²/2 of T·r', and never negative: it may be 0 for r' up to max|r''|T/2. r'
        # in the law contains noise, so the reference may move `noise`·T less.
        moves = np.where(back.middle(n1) > 0, float(bool(q1 or q0)), 1.0)
        late = abs(n1) * number(bend * step**2 / 2) + (abs(n1) + n1) * number(noise * step / 2)
        late = back.array(moves.tolist()) * late
        of_error = n1 - n1 * number(step * q1) - predicted * number(p1)
        constant = late - n1 * number(step * q0) - predicted * number(p0)
        standstill = back.array((1 - moves).tolist()) * number(bend * sampled_loop.longest / 2 + noise)
        yield _Carried(place, feedback, feedback0, of_error, constant, -predicted * int(combination[1]), standstill)


def sliding_rows(period: Period, facets: np.ndarray, multipliers: np.ndarray) -> Iterator[Rows]:
    """Images of the facets after a period of the sliding map.

    Parameters
    ----------
    period : Period
    facets, multipliers : ndarray
        In numbers of the back end; see `StickSlipPolytope`.
    """
    back, sampled_loop, task, plant = period.back, period.sampled_loop, period.task, period.plant
    number, law, step = back.number, sampled_loop.law, sampled_loop.step
    n1, n2, n3 = facets.T
    everyone, raised = np.arange(len(facets)), np.flatnonzero(back.middle(n3) > 0)
    level, slip, half = number(law.level_gain), number(law.slip_gain), number(step / 2)
    bound, off = number(task.amplitude), number(gap(task.beta) / task.authority)
    lone, none = back.array([Fraction(1)]), back.array([_ZERO])
    gaps = [
        (own + part[0]) * off
        for own, part in zip(
            (period.of_rate[0], period.of_force[0]), period.range_effects(period.integrals(lone, none)), strict=True
        )
    ]
    carried = list(_carried(back, task, sampled_loop, period.interval, facets, list(enumerate(COMBINATIONS))))
    gap_margin = period.margin[0] * off  # for the chord of 1/β minus 1/β
    for cut in (False, True):
        which = raised if cut else everyone
        a1, a2, a3, shares = n1[which], n2[which], n3[which], multipliers[which]
        flag = back.middle(shares[:, 3 if cut else 1]) == 1
        plain = a1 + a3 * (0 if cut else slip)
        of_rate = a2 + shares[:, 2] if cut else back.without(a2 + a3 * level, flag) + shares[:, 0]
        for end in plant.chord:
            chords = [number(end / (beta * task.authority)) for beta in task.beta]
            of_slips = [back.without(plain - a3 * chord, flag) for chord in chords]
            bent = (back.middle(of_slips[0]) != 0) | (back.middle(of_slips[1]) != 0)  # else ξ has no effect
            curved = back.array(bent.astype(float).tolist()) * abs(a3) * number(abs(end))
            for beta, of_slip in zip(task.beta, of_slips, strict=True):
                whole = period.integrals(of_slip, of_rate)
                of_y, of_force = period.range_effects(whole)
                own = of_slip * period.of_force[0] + of_rate * period.of_force[1] + of_force
                pushed = -number(beta * task.authority) * own
                of_y = of_y + curved * gaps[0] + of_slip * period.of_rate[0] + of_rate * period.of_rate[1]
                of_y = of_y if cut else of_y - a3 * slip * half
                force = bound * (whole[0] + of_force + curved * gaps[1])
                force = force + abs(pushed) * number(sampled_loop.pressure_noise)
                force = force + abs(of_slip) * period.margin[0] + abs(of_rate) * period.margin[1] + curved * gap_margin
                for part in carried:
                    factors = [pushed * number(v) for v in part.feedback]
                    columns = [part.of_error[which] + factors[0], of_y + factors[1], a3 + factors[2]]
                    constants = part.constant[which] + pushed * number(part.feedback0) + force
                    constants = constants + part.moved(pushed * number(law.target_gain), which)
                    yield Rows(COMBINATIONS[part.place][0], which, np.column_stack(columns), constants, cut)


def resting_rows(
    back: Numbers,
    task: FaultPlant,
    sampled_loop: SampledStickSlip,
    plant: Ranges,
    facets: np.ndarray,
    multipliers: np.ndarray,
) -> Iterator[Rows]:
    """Images of the facets after a period that ends at rest, in rational numbers."""
    number, law = back.number, sampled_loop.law
    n1, _, n3 = facets.T
    rises = back.middle(n3) > 0
    raised, lowered = np.flatnonzero(rises), np.flatnonzero(~rises)
    slip, half = number(law.slip_gain), number(sampled_loop.step / 2)
    ends = dict.fromkeys((sampled_loop.step, sampled_loop.longest))
    for part in chain(*(_carried(back, task, sampled_loop, interval, facets, _AT_REST) for interval in ends)):
        for end in plant.chord:
            chord = number(end / task.authority)
            for which, share in ((raised, 0), (raised, 1), (lowered, None)):
                a1, a3 = n1[which], n3[which]
                cut_off = a3 * slip * (multipliers[which][:, 4] if share is None else share)
                constants = part.constant[which] + part.moved(0, which)
                if share is None:  # n3 <= 0: a limited innovation is at least -T·v⁺/2 minus this
                    constants = constants + (cut_off - a3 * slip) * number(
                        sampled_loop.law.rest_slip + 2 * sampled_loop.slip_noise
                    )
                factors = np.column_stack([part.of_error[which], -cut_off * half, a3, a1 - a3 * chord + cut_off])
                yield Rows(SLICES + part.place, which, factors, constants)


# ----------------------------------------------------------------------
# Polytopes on which these functions are bounded: constraints Az ≤ b, exact.

Constraint = tuple[tuple[Fraction, ...], Fraction]


def slices(task: FaultPlant, sampled_loop: SampledStickSlip) -> tuple[tuple[Constraint, ...], ...]:
    """Ends of the three slices: e1 up to 0, from 0 to (max r′ + 2cN)/c, and above."""
    threshold, one = (task.reference_rates[0] + sampled_loop.target_noise) / sampled_loop.law.return_rate, Fraction(1)
    up, down = (one, _ZERO, _ZERO), (-one, _ZERO, _ZERO)
    return ((up, _ZERO),), ((down, _ZERO), (up, threshold)), ((down, -threshold),)


def polytopes(
    task: FaultPlant, sampled_loop: SampledStickSlip, facets: Sequence[tuple[Fraction, ...]], plant: Ranges | None
) -> list[list[Constraint]]:
    """Constraints of the 3 slices, and of the 7 combinations in (e1, y, d, δ) if `plant` is given.

    The condition of rest depends on r′. The condition at the least r′ holds wherever that at another r′ does, so that
    on its polytope the ends of r′ suffice.
    """
    one = Fraction(1)
    own: list[Constraint] = [(row, one) for row in facets]
    own.append(((_ZERO, -one, _ZERO), _ZERO))
    ends = slices(task, sampled_loop)
    flat = [[*own, *end] for end in ends]
    if plant is None:
        return flat
    stops = stop_bounds(task, sampled_loop, plant)
    most = task.beta[1] * task.authority
    excess = most * sampled_loop.pressure_noise - task.amplitude
    for combination in (COMBINATIONS[place] for place in LEAST):
        feedback = feedback_row(sampled_loop, _ZERO, combination)[0]  # the least r′ has no constant part
        larger = (*(-most * v for v in feedback), plant.slope[0])
        tall: list[Constraint] = [((*row, _ZERO), b) for row, b in flat[combination[0]]]
        tall += [((_ZERO, _ZERO, _ZERO, -one), _ZERO), (larger, excess)]
        tall += [((_ZERO, -g, _ZERO, one), h) for g, h in stops]
        flat.append(tall)
    return flat


class Verifier:
    """Bounds of linear functions on a polytope: multipliers proposed in floats, verified exactly."""

    def __init__(
        self,
        constraints: list[Constraint],
        bases: Sequence[Basis],
        sizes: Sequence[Fraction],
        *,
        place: int,
        facets: int,
    ) -> None:
        count = len(constraints)
        if any(place >= count for basis in bases for place in basis):
            raise ParameterError(f"bases of a polytope must name constraints by their numbers, from 0 to {count - 1}")
        slice_number = place if place < SLICES else COMBINATIONS[place - SLICES][0]
        self.sizes, self.sign = _exact_array(list(sizes)), -1 if slice_number == 0 else 1  # of e1
        self.rows = _exact_array([list(row) for row, _ in constraints])
        self.ends = _exact_array([end for _, end in constraints])
        self.last = facets + 2 if slice_number == 1 else None  # e1 <= (max r' + 2cN)/c, after y, e1 >= 0
        self.bases = np.array(bases)
        self.floats = _ball_middle(self.rows * self.sizes)
        self.lengths = lengths = np.linalg.norm(self.floats, axis=1)
        solvable = np.abs(np.linalg.det((self.floats / lengths[:, None])[self.bases])) > _FLAT
        self.bases = self.bases[solvable]
        if not len(self.bases):
            raise ParameterError("at least one basis of each polytope must have independent constraints")
        ends = _ball_middle(self.ends)
        self.vertices = np.linalg.solve(self.floats[self.bases], ends[self.bases][..., None])[..., 0]
        inside = (self.vertices @ self.floats.T <= ends + _NEAR * lengths).all(axis=1)
        if not inside.any():
            raise ParameterError("at least one basis of each polytope must give a vertex of it")
        self.bases, self.vertices = self.bases[inside], self.vertices[inside]

    def proposed(self, scaled: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Constraints at the best vertex, and their multipliers, in floats; at an optimum no multiplier is negative."""
        values = scaled @ self.vertices.T
        bases = self.bases[values.argmax(axis=1)]
        shares = np.linalg.solve(self.floats[bases].swapaxes(-1, -2), scaled[..., None])[..., 0]
        for row in np.flatnonzero((shares * self.lengths[bases]).min(axis=1) < -_NEAR * np.abs(scaled).max(axis=1)):
            top = values[row].max()  # where more constraints meet than a basis has, another basis may fit
            near = np.flatnonzero(values[row] >= top - _NEAR * abs(top))
            tried = np.linalg.solve(self.floats[self.bases[near]].swapaxes(-1, -2), scaled[row][:, None])[..., 0]
            best = (tried * self.lengths[self.bases[near]]).min(axis=1).argmax()
            bases[row], shares[row] = self.bases[near[best]], tried[best]
        return bases, shares

    def largest(self, factors: np.ndarray, constants: np.ndarray, which: np.ndarray | None = None) -> np.ndarray:
        """Upper bounds of c·z + k. If `which` names facets n, that of 1 + (c − n)·z + k is taken where it is smaller.

        It is valid as n·z ≤ 1, and the smaller one if a period changes nothing, as at rest: there the entries of c − n
        have signs opposite to those of e1, y and δ; δ is at most g·y by the last constraint, and e1 at most the end of
        its slice.
        """
        factors, off = _middles(factors)
        constants, above = _middles(constants)
        constants = constants + above
        bases, shares = self.proposed(_ball_middle(factors * self.sizes))
        shares = _exact_array(np.maximum(np.round(shares / _GRAIN) * _GRAIN, 0).tolist())
        left = factors - (shares[..., None] * self.rows[bases]).sum(axis=1)
        largest = (shares * self.ends[bases]).sum(axis=1) + self._rest(left, off)
        if which is not None:
            left = factors - self.rows[which]
            if left.shape[1] > 3:
                left[:, 1] = left[:, 1] - np.maximum(left[:, 3], 0) * self.rows[-1, 1]
                left[:, 3] = 0
            same = 1 + 0 * largest
            if self.last is not None:
                same, left[:, 0] = same + np.maximum(left[:, 0], 0) * self.ends[self.last], 0
            largest = np.minimum(largest, same + self._rest(left, off))
        return np.asarray(largest + constants)

    def _rest(self, left: np.ndarray, off: np.ndarray) -> np.ndarray:
        """Bound of left·z, each coefficient within `off`, by the signs of e1, y and δ."""
        left = left * np.array([self.sign, 1, 1, 1][: left.shape[1]])
        left[:, 2] = abs(left[:, 2])
        return np.asarray((np.maximum(left + off, 0) * self.sizes).sum(axis=1))


def _middles(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Exact midpoints and radii of balls; rationals have the radius 0."""
    if not isinstance(values.flat[0], arb):
        return values, 0 * values
    ends = [(value.mid().fmpq(), value.rad().fmpq()) for value in values.flat]
    middles, radii = (np.array(column, dtype=object).reshape(values.shape) for column in zip(*ends, strict=True))
    return middles, radii


def stick_slip_bounds(
    task: FaultPlant, sampled_loop: SampledStickSlip, invariant_set: StickSlipPolytope
) -> StickSlipClaims:
    """Bounds of the theorem.

    Raises
    ------
    ParameterError
        With the condition that fails.
    """
    try:
        with ctx.workprec(BITS), np.errstate(all="ignore"):
            return _bounds(task, sampled_loop, invariant_set)
    except ParameterError:
        raise
    except (ArithmeticError, ValueError, np.linalg.LinAlgError):  # floats cannot propose multipliers for such numbers
        raise ParameterError("numbers of the loop and its polytope must be within the range of floats") from None


def _bounds(task: FaultPlant, sampled_loop: SampledStickSlip, invariant_set: StickSlipPolytope) -> StickSlipClaims:
    ahead, rate, _, lag, _ = invariant_set.box
    if any(
        row[0] * sampled_loop.slip_noise + max(row[2], _ZERO) * sampled_loop.pressure_noise > 1
        for row in invariant_set.facets
    ):
        raise ParameterError("noise of the first measurement may put the loop outside of the polytope")
    fastest = task.reference_rates[0]
    moved = fastest * sampled_loop.longest
    behind, in_front = lag + sampled_loop.slip_noise + moved, ahead - sampled_loop.slip_noise + moved
    if sampled_loop.law.pull:
        root = ImplicitStep(pull=sampled_loop.law.pull)
        if not sector_is_valid(root, sampled_loop.step, *sampled_loop.errors(task, max(behind, in_front), rate)):
            raise ParameterError("the implicit step may not be deadbeat everywhere in the polytope")
    feedback = feedback_range(task, sampled_loop, invariant_set)
    plant = ranges(task, ahead + moved, feedback, rate * sampled_loop.longest)
    if plant.slope[1] * sampled_loop.longest**2 >= 1:
        raise ParameterError(
            "T_s, or the longest interval of aperiodic sampling, is too long for this weakening of friction"
        )
    deciding = verifiers(task, sampled_loop, invariant_set, plant)
    periods = Period.deciding(BALLS, task, sampled_loop, plant, rate, feedback)
    for rows in chain(*facet_rows(periods, invariant_set)):
        tops = deciding[rows.place].largest(rows.factors, rows.constants, rows.which)
        for facet, top in zip(rows.which, tops, strict=True):
            if not top <= 1:
                kind = "slides" if rows.place < SLICES else "ends at rest"
                raise ParameterError(f"the state may leave the polytope through facet {facet} in a period that {kind}")
    if _bracket(task, sampled_loop, plant, feedback[1]) > task.amplitude:
        raise ParameterError(
            "the amplitude of the disturbance is too small for this range of the input gain. A larger amplitude may "
            "have a proof, which covers this one"
        )
    return StickSlipClaims(
        slip_behind=UpperBound(behind),
        slip_ahead=UpperBound(in_front),
        peak_slip_rate=UpperBound(rate),
        least_pressure=LowerBound(plant.rest_pressure[0] - feedback[1]),
        largest_pressure=UpperBound(plant.rest_pressure[1] - feedback[0]),
    )


def _bracket(task: FaultPlant, sampled_loop: SampledStickSlip, plant: Ranges, feedback: Fraction) -> Fraction:
    """Largest decrease [m/s²] of the bound H + δS·ξ + δw·y of |a| if ξ, y and U belong to different β (*Input gain*).

    If this decrease is below H, the bound of |a| is not negative at either end of β, also where the response of a facet
    changes sign between them. For aperiodic sampling it is the decrease by all of U (β from 0) in the longest interval.
    """
    step, growth = sampled_loop.longest, 1 / (1 - plant.slope[1] * sampled_loop.longest**2 / 2)
    width, damping = (plant.slope[1] - plant.slope[0]) / 2, (plant.damping[1] - plant.damping[0]) / 2
    share = width * growth * step**2 / 2 + damping * step * (1 + plant.slope[1] * growth * step**2)
    least = _ZERO if sampled_loop.longest_step else task.beta[0]
    return share * task.authority * (task.beta[1] - least) * max(feedback, _ZERO)


def verifiers(
    task: FaultPlant, sampled_loop: SampledStickSlip, invariant_set: StickSlipPolytope, plant: Ranges | None
) -> list[Verifier]:
    """Verifiers of the 3 slices, and of the 7 combinations if `plant` is given."""
    ahead, rate, up, lag, down = invariant_set.box
    sizes, longest = [max(ahead, lag), rate, max(up, down)], _ZERO
    if plant:
        longest = max(min(g * rate + h for g, h in stop_bounds(task, sampled_loop, plant)), Fraction(1, 10**30))
        if task.amplitude + plant.slope[0] * longest < 0:
            raise ParameterError("the disturbance is too small for the condition of rest")
    bases = (*invariant_set.sliding, *(invariant_set.resting if plant else ()))
    return [
        Verifier(lines, basis, [*sizes, longest][: len(basis[0])], place=place, facets=len(invariant_set.facets))
        for place, (lines, basis) in enumerate(
            zip(polytopes(task, sampled_loop, invariant_set.facets, plant), bases, strict=True)
        )
    ]


def facet_rows(periods: Sequence[Period], invariant_set: StickSlipPolytope) -> Iterator[Iterator[Rows]]:
    """Images of the facets: for each period under the sliding map, in balls; then under the rest map, in rationals."""
    stored = [[list(row) for row in rows] for rows in (invariant_set.facets, invariant_set.multipliers)]
    for period in periods:
        yield sliding_rows(period, *map(_ball_array, stored))
    yield resting_rows(EXACT, periods[0].task, periods[0].sampled_loop, periods[0].plant, *map(_exact_array, stored))


def feedback_range(task: FaultPlant, sampled_loop: SampledStickSlip, invariant_set: StickSlipPolytope) -> Range:
    """Least and largest U = p* − p at a sample [Pa]."""
    law, fastest = sampled_loop.law, task.reference_rates[0] + sampled_loop.target_noise
    row = law.target_gain * law.return_rate, law.rate_gain, Fraction(1)
    factors = _exact_array([list(row), [-v for v in row]])
    constants = _exact_array([_ZERO, law.target_gain * fastest])
    tops = [one.largest(factors, constants) for one in verifiers(task, sampled_loop, invariant_set, None)]
    high, low = (fraction_of(max(line[i] for line in tops)) for i in (0, 1))
    return -low - sampled_loop.pressure_noise, high + sampled_loop.pressure_noise
