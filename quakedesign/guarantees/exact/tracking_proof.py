"""Proofs of tracking on the plant without stick: claims, their check, and the statement.

Chapters: claims about a loop; proof of a sampled loop; peaks of the idealised loop in continuous time. The theorem is
in `quakedesign.guarantees.exact.small_gain`, the ranges of the plant in `quakedesign.plant.fault_plant`.
"""

from collections.abc import Mapping
from dataclasses import fields, replace
from fractions import Fraction
from math import ceil, floor, log10
from typing import TYPE_CHECKING, Any, ClassVar

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.exact import Bound, LowerBound, UpperBound, six_digits
from quakedesign.files import Json
from quakedesign.guarantees.exact import small_gain
from quakedesign.guarantees.exact.invariant_set import InvariantPolytope, reached_bounds
from quakedesign.guarantees.exact.proof import NoProof, Proof
from quakedesign.guarantees.exact.sampled_loop import Gains, SampledLoop
from quakedesign.guarantees.exact.small_gain import (
    Bounds,
    VaryingGain,
    best_bounds,
    certified_bounds,
    varying_gain_norms,
)
from quakedesign.laws import ImplicitStep, RestLimit
from quakedesign.loop import ContinuousLaw, PeriodicLoop, continuous_loop
from quakedesign.lyapunov.exact.certificate_files import GUARANTEE
from quakedesign.plant.fault_plant import FaultPlant

if TYPE_CHECKING:
    from quakedesign.laws import SampledController


# ----------------------------------------------------------------------
# Claims about a loop, and their verdict from bounds.

_DIGITS = 4
_ENDS = ("least_pressure", "largest_pressure", "least_asked", "largest_asked")
MARGIN = Fraction(1001, 1000)  # the standalone checker has slightly larger bounds, but must prove the same claims


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Claims:
    """Claimed bounds of errors and pressures, for all t ≥ 0.

    Attributes
    ----------
    slip_error : UpperBound
        Slip minus reference, absolute value [m].
    slip_rate_error : UpperBound
        [m/s].
    peak_slip_rate : UpperBound
        Slip rate, absolute value [m/s].
    least_pressure : LowerBound
        [Pa].
    largest_pressure : UpperBound
        [Pa].
    least_asked, largest_asked : LowerBound and UpperBound, optional
        Range of the pressure at the valve [Pa]; None where it equals that in the fault.
    largest_step : UpperBound, optional
        Change of the commanded pressure between samples [Pa]; None where it is not needed.
    """

    slip_error: UpperBound
    slip_rate_error: UpperBound
    peak_slip_rate: UpperBound
    least_pressure: LowerBound
    largest_pressure: UpperBound
    least_asked: LowerBound | None = None
    largest_asked: UpperBound | None = None
    largest_step: UpperBound | None = None

    @classmethod
    def of(cls, task: FaultPlant, bounds: Bounds) -> "Claims":
        """Tightest claims that bounds support."""
        low, high = task.rest_pressure
        pressure = bounds.push / task.authority
        commanded = None if bounds.valve_push is None else bounds.valve_push / task.authority
        return cls(
            slip_error=UpperBound(bounds.slip_error),
            slip_rate_error=UpperBound(bounds.slip_rate_error),
            peak_slip_rate=UpperBound(bounds.slip_rate_error + task.reference_rates[0]),
            least_pressure=LowerBound(low - pressure),
            largest_pressure=UpperBound(high + pressure),
            least_asked=None if commanded is None else LowerBound(low - commanded),
            largest_asked=None if commanded is None else UpperBound(high + commanded),
            largest_step=None if bounds.stepped is None else UpperBound(bounds.stepped / task.authority),
        )

    @property
    def by_name(self) -> Mapping[str, Bound]:
        """Claimed bounds by name, SI."""
        named = {part.name: getattr(self, part.name) for part in fields(self)}
        return {name: bound for name, bound in named.items() if bound is not None}

    @property
    def pressures(self) -> tuple[tuple[LowerBound, UpperBound], ...]:
        """Range of the pressure in the fault and, if it differs, at the valve [Pa]."""
        fault = self.least_pressure, self.largest_pressure
        if self.least_asked is None or self.largest_asked is None:
            return (fault,)
        return fault, (self.least_asked, self.largest_asked)

    def to_dict(self) -> Json:
        """Exact numbers as strings, SI."""
        return {
            "slip_error": self.slip_error.exact,
            "slip_rate_error": self.slip_rate_error.exact,
            "peak_slip_rate": self.peak_slip_rate.exact,
            **{
                name: [low.exact, high.exact]
                for name, (low, high) in zip(("pressure", "asked_pressure"), self.pressures, strict=False)
            },
            **({} if self.largest_step is None else {"largest_step": self.largest_step.exact}),
        }

    def rounded(self) -> "Claims":
        """Slightly weaker claims with few digits."""
        step = self.largest_step
        ends: list[Any] = [end for low, high in self.pressures for end in _wider(low, high)]
        return Claims(
            slip_error=UpperBound(above(self.slip_error * MARGIN)),
            slip_rate_error=UpperBound(above(self.slip_rate_error * MARGIN)),
            peak_slip_rate=UpperBound(above(self.peak_slip_rate * MARGIN)),
            largest_step=None if step is None else UpperBound(above(step * MARGIN)),
            **dict(zip(_ENDS, ends, strict=False)),
        )

    def follow(self, task: FaultPlant, bounds: Bounds) -> bool:
        """Whether the claims follow from the bounds, and the fault stays closed."""
        tightest = Claims.of(task, bounds)
        return self.covers(tightest) and not tightest.opening_reason(task)

    def opening_reason(self, task: FaultPlant) -> str:
        """Reason why the fault may open; empty if the pressure stays below σ′."""
        if self.largest_pressure < task.normal_stress:
            return ""
        return (
            f"the pressure may rise to {self.largest_pressure.quantity('Pa')}, and the effective normal stress is "
            f"{LowerBound(task.normal_stress).quantity('Pa')}: the fault may open"
        )

    def covers(self, other: "Claims") -> bool:
        """Whether these claims follow from others."""
        return (
            self.slip_error >= other.slip_error
            and self.slip_rate_error >= other.slip_rate_error
            and self.peak_slip_rate >= other.peak_slip_rate
            and len(self.pressures) <= len(other.pressures)
            and _covers(self.largest_step, other.largest_step)
            and all(
                low <= least and high >= largest
                for (low, high), (least, largest) in zip(self.pressures, other.pressures, strict=False)
            )
        )


def _covers(step: UpperBound | None, other: UpperBound | None) -> bool:
    """Whether a claimed bound of pressure changes between samples follows from another."""
    return step is None or (other is not None and step >= other)


def _wider(low: LowerBound, high: UpperBound) -> tuple[LowerBound, UpperBound]:
    margin = (high - low) * (MARGIN - 1)
    return LowerBound(-above(margin - low)), UpperBound(above(high + margin))


def above(value: Fraction) -> Fraction:
    """Rational of four digits, not below a given one."""
    if not value:
        return value
    scale = Fraction(10) ** (floor(log10(abs(value))) - _DIGITS + 1)
    return ceil(value / scale) * scale


# ----------------------------------------------------------------------
# Guarantee of a sampled loop: fault, loop, and bounds of its outputs.

_NOISE_WORDS = {
    "slip_noise": "with any noise of at most {:.6g} m in the measured slip",
    "rate_noise": "with any noise of at most {:.6g} m/s in the measured slip rate",
}
_RESTS = Fraction(1, 100)  # a fault counts as at rest below this share of the largest reference rate
_TURNS, _LEAPS = 32, 16  # fixed-point iterations of claims: with small steps first, then with large ones
_LEAP = Fraction(6, 5)
_RAMPS, _RAMP_ROOM = (
    6,
    Fraction(21, 20),
)  # most ramp times tried after the first; ratio of the next to the time required
_FIRST = Fraction(1, 64)  # first ramp time divided by T_s


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class TrackingProof(Proof[Bounds]):
    """Claims about one loop on one task, on the plant without stick; `check` decides them.

    Attributes
    ----------
    task : FaultPlant
    sampled_loop : SampledLoop
    claims : Claims
    varying_gain : VaryingGain, optional
        Slowly varying input gain of the proof; None for an arbitrary input gain.
    invariant_set : InvariantPolytope, optional
        Invariant set for aperiodic sampling; None for periodic sampling.
    """

    kind: ClassVar[str] = GUARANTEE
    plant: ClassVar[str] = "printed"
    scope: ClassVar[str] = "on the plant without stick"
    task: FaultPlant
    sampled_loop: SampledLoop
    claims: Claims
    varying_gain: VaryingGain | None = None
    invariant_set: InvariantPolytope | None = None

    def __repr__(self) -> str:
        sampled_loop, claims = self.sampled_loop, self.claims
        errors = f"|e1| <= {claims.slip_error:.4g} m, |e2| <= {claims.slip_rate_error:.4g} m/s"
        most = f" to {six_digits(sampled_loop.longest_step)}" if sampled_loop.longest_step else ""
        return f"TrackingProof({self.task.name} held over {six_digits(sampled_loop.step)}{most} s: {errors})"

    @property
    def peak_slip_rate(self) -> UpperBound:
        """Bound of the slip rate [m/s], for all t ≥ 0."""
        return self.claims.peak_slip_rate

    @property
    def valve_pressures(self) -> tuple[LowerBound, UpperBound]:
        """Least and largest pressure at the valve [Pa]."""
        return self.claims.pressures[-1]

    @property
    def bounds(self) -> Mapping[str, Bound]:
        """Claims by name, SI; `least_asked` and `largest_asked` are at the valve."""
        return self.claims.by_name

    @property
    def implicit_step(self) -> ImplicitStep | None:
        """Implicit step of the law."""
        return self.sampled_loop.law.implicit_step

    @property
    def loop(self) -> PeriodicLoop:
        """Nominal error loop."""
        return self.sampled_loop.loop(self.task)

    @property
    def rest_limit(self) -> RestLimit | None:
        """Pressure limit at rest that the valve pressure never reaches, or None.

        None without a claim at the valve, or without `applied` in the law.

        Its `width` allows for the motion of the reference during the delay. A fault counts as at rest if its measured
        motion may be noise, or is slower than 1/100 of the largest reference rate. The claimed range of pressure is a
        limit too, unless the fault slips faster than is claimed.
        """
        sampled_loop, (low, high), (*fault, (least, largest)) = (
            self.sampled_loop,
            self.task.rest_pressure,
            self.claims.pressures,
        )
        if not sampled_loop.law.applied or (not fault and (sampled_loop.lag or sampled_loop.diffusion)):
            return None
        away = max(largest - high, low - least)
        per_slip = max(map(abs, self.task.slip_chord)) / self.task.authority
        late = (
            per_slip
            * (sampled_loop.delay + sampled_loop.jitter + sampled_loop.delay_jitter + sampled_loop.ramp)
            * self.task.reference_rates[0]
        )
        width = above(2 * away + late)
        resolution = above(2 * sampled_loop.slip_noise + _RESTS * self.task.reference_rates[0] * sampled_loop.step)
        most = max(sampled_loop.step, sampled_loop.longest_step) + 2 * sampled_loop.timing_error
        return RestLimit(
            width=width,
            per_slip=above(per_slip),
            resolution=resolution,
            least=Fraction(least),
            largest=Fraction(largest),
            fastest=above(2 * sampled_loop.slip_noise + self.claims.peak_slip_rate * most),
        )

    @property
    def slip_acceleration(self) -> UpperBound:
        """Bound of |e1″| [m/s²], from |p − p*| of the pressure claims."""
        task, claims, (low, high) = self.task, self.claims, self.task.rest_pressure
        away = max(claims.largest_pressure - high, low - claims.least_pressure)
        slip, rate = (max(map(abs, chord)) for chord in (task.slip_chord, task.rate_chord))
        moved = slip * claims.slip_error + rate * claims.slip_rate_error + task.beta[1] * task.authority * away
        return UpperBound(moved + task.amplitude + task.reference_force)

    @property
    def controller(self) -> "SampledController":
        """Law for `simulate` with its limit against windup."""
        return replace(self.sampled_loop.controller, rest_limit=self.rest_limit)

    def theorem_bounds(self) -> Bounds | NoProof:
        """Bounds that the theorem gives."""
        if self.varying_gain is None:
            return _bounds(self.task, self.sampled_loop, self.loop, self.invariant_set)
        gains = _varying_gain_norms(self.task, self.sampled_loop, self.varying_gain)
        if isinstance(gains, NoProof):
            return gains
        return _bounds_with_varying_gain(self.task, self.sampled_loop, self.varying_gain, gains, self.claims.slip_error)

    def follows_from(self, bounds: Bounds) -> bool:
        """Whether the claims follow, and respect the sector of an implicit step and the limits of the pump."""
        return (
            _step_within(self.task, self.sampled_loop, self.claims)
            and not _beyond_the_pump(self.sampled_loop, self.claims)
            and (self.varying_gain is None or bounds.slip_error < self.claims.slip_error)
            and self.claims.follow(self.task, bounds)
        )

    def to_dict(self) -> Json:
        """Exact claims as strings, SI."""
        return self.claims.to_dict()

    def sentence(self) -> str:
        """Statement of the guarantee as text."""
        sampled_loop = self.sampled_loop
        when = f"with zero-order hold over {_seconds(sampled_loop.step)}"
        if sampled_loop.longest_step:
            shortest, longest = UpperBound(sampled_loop.step), LowerBound(sampled_loop.longest_step)
            when = f"with zero-order hold over sampling intervals from {shortest:.6g} s to {longest:.6g} s in any order"
        when += f", with a delay of {_seconds(sampled_loop.delay)}" if sampled_loop.delay else ""
        when += f", through a lag of {_seconds(sampled_loop.lag)}" if sampled_loop.lag else ""
        when += (
            f", through a diffusion path of L^2/D = {_seconds(sampled_loop.diffusion)}"
            if sampled_loop.diffusion
            else ""
        )
        alone = sampled_loop.law.of_slip_alone
        when += ", with the slip alone measured" if alone and sampled_loop.noise.get("slip_noise") else ""
        for name, bound in ((name, bound) for name, bound in sampled_loop.noise.items() if bound):
            when += f", {_NOISE_WORDS[name].format(LowerBound(bound))}"
        measured = {"slip_noise": "the slip alone"} if alone else {"slip_noise": "slip", "rate_noise": "slip rate"}
        exact = [signal for name, signal in measured.items() if not sampled_loop.noise.get(name)]
        when += f", with exact measurements of {' and '.join(exact)}" if exact else ""
        mean = LowerBound(sampled_loop.averaging)
        when += f", each measurement averaged over {mean:.6g} s around its instant" if mean else ""
        when += _off_schedule(sampled_loop.jitter, sampled_loop.jitter + sampled_loop.delay_jitter)
        when += f", {sampled_loop.pump.words()}" if sampled_loop.pump else ""
        return sentence_of(self.task, self.claims, when, _start(*sampled_loop.initial_errors))


def sentence_of(task: FaultPlant, claims: Claims, when: str, start: str = "from rest") -> str:
    """Statement of the claims about a task as text; `when` describes the loop setup.

    Claimed bounds are rounded outward; bounds of disturbances and initial errors are rounded down.
    """
    stress = LowerBound(task.amplitude / task.area_per_mass[1])
    kind = f"for every disturbance of at most {LowerBound(task.amplitude):.3g} m/s^2 ({stress.quantity('Pa')} of shear)"
    if task.change is not None:
        kind += f" that starts at 0 and changes by at most {LowerBound(task.change):.3g} m/s^3 (class rate)"
    if not task.amplitude:
        kind = "without disturbance"
    pressures = [f"between {low.quantity('Pa')} and {high.quantity('Pa')}" for low, high in claims.pressures]
    largest = claims.largest_step
    step = "" if largest is None else f", commanded changes of at most {largest.quantity('Pa')} a sample"
    return (
        f"on the plant without stick, {start}, {when}, {kind}, "
        f"for every friction law and all constant parameters of the box: "
        f"the slip rate never exceeds {claims.peak_slip_rate.quantity('m/s')}, the slip stays within "
        f"{claims.slip_error.quantity('m')} of the reference, the pressure {', at the valve '.join(pressures)}{step}, "
        "for all t >= 0"
    )


def guarantee(
    task: FaultPlant,
    sampled_loop: SampledLoop,
    varying_gain: VaryingGain | None = None,
    invariant_set: InvariantPolytope | None = None,
) -> TrackingProof | NoProof:
    """Tightest rounded claims about a loop, or the reason why there are none.

    For a pump with a rate limit the ramp time is increased until the pump can make every pressure change within it.

    Aperiodic sampling needs `invariant_set`, and excludes `varying_gain`.

    Raises
    ------
    ParameterError
        For a loop without a steady state, or a slowly varying gain if friction depends on the slip rate.
    """
    if invariant_set is not None:
        bounds = _bounds(task, sampled_loop, sampled_loop.loop(task), invariant_set)
        return (
            bounds
            if not bounds.available
            else _of_claims(task, sampled_loop, _rounded(task, bounds), invariant_set=invariant_set)
        )
    if sampled_loop.pump is None or sampled_loop.pump.rate is None or sampled_loop.ramp:
        return _proved(task, sampled_loop, varying_gain)
    ramp, longest = _FIRST * sampled_loop.step, sampled_loop.longest_ramp
    proof = _proved(task, replace(sampled_loop, ramp=ramp), varying_gain)
    for _ in range(_RAMPS):
        if proof.available or proof.required_change is None or ramp == longest:
            break
        if slow := sampled_loop.pump.too_slow(UpperBound(proof.required_change), longest):
            return replace(proof, reason=slow)
        ramp = min(above(proof.required_change / sampled_loop.pump.rate * _RAMP_ROOM), longest)
        proof = _proved(task, replace(sampled_loop, ramp=ramp), varying_gain)
    return proof


def _proved(task: FaultPlant, sampled_loop: SampledLoop, varying_gain: VaryingGain | None) -> TrackingProof | NoProof:
    claims = (
        _claims(task, sampled_loop)
        if varying_gain is None
        else _claims_with_varying_gain(task, sampled_loop, varying_gain)
    )
    return claims if isinstance(claims, NoProof) else _of_claims(task, sampled_loop, claims, varying_gain)


def _of_claims(
    task: FaultPlant,
    sampled_loop: SampledLoop,
    claims: Claims,
    varying_gain: VaryingGain | None = None,
    invariant_set: InvariantPolytope | None = None,
) -> TrackingProof | NoProof:
    """Claims, or the reason why there are none."""
    if not _step_within(task, sampled_loop, claims):
        errors = f"errors up to {claims.slip_error:.3g} m and {claims.slip_rate_error:.3g} m/s"
        return NoProof(reason=f"the implicit step leaves its sector at {errors}")
    if reason := claims.opening_reason(task) or _beyond_the_pump(sampled_loop, claims):
        slow = sampled_loop.pump is not None and bool(
            sampled_loop.pump.too_slow(claims.largest_step, sampled_loop.ramp)
        )
        return NoProof(
            reason=reason, required_change=claims.largest_step if slow else None, only_pressure_fails=not slow
        )
    return TrackingProof(
        task=task, sampled_loop=sampled_loop, claims=claims, varying_gain=varying_gain, invariant_set=invariant_set
    )


def _claims(task: FaultPlant, sampled_loop: SampledLoop) -> Claims | NoProof:
    bounds = _bounds(task, sampled_loop, sampled_loop.loop(task))
    return bounds if not bounds.available else _rounded(task, bounds)


def _rounded(task: FaultPlant, bounds: Bounds) -> Claims:
    return Claims.of(task, bounds).rounded()


def _claims_with_varying_gain(
    task: FaultPlant, sampled_loop: SampledLoop, varying_gain: VaryingGain
) -> Claims | NoProof:
    """Claims from a fixed point: the slip error bounds the deviation of the input gain."""
    gains, slip_error = _varying_gain_norms(task, sampled_loop, varying_gain), Fraction(0)
    if isinstance(gains, NoProof):
        return gains
    for turn in range(_TURNS + _LEAPS):
        bounds = _bounds_with_varying_gain(task, sampled_loop, varying_gain, gains, slip_error)
        if not bounds.available:
            return bounds
        claims = _rounded(task, bounds)
        if claims.slip_error <= slip_error:
            return claims
        tried, slip_error = slip_error, above(max(claims.slip_error * MARGIN, _LEAP * slip_error * (turn >= _TURNS)))
    reason = f"none of the slip errors tried, up to {LowerBound(tried):.2g} m, bounds the change of the input gain"
    return NoProof(reason=reason)


def _varying_gain_norms(task: FaultPlant, sampled_loop: SampledLoop, varying_gain: VaryingGain) -> Gains | NoProof:
    if sampled_loop.longest_step:
        return NoProof(reason="aperiodic sampling has no guarantee with a slowly varying input gain")
    loops = tuple(sampled_loop.loop(task, model) for model in varying_gain.models(task))
    try:
        return varying_gain_norms(loops, varying_gain.growth)
    except ParameterError:
        return _unstable(sampled_loop)


def _bounds_with_varying_gain(
    task: FaultPlant, sampled_loop: SampledLoop, varying_gain: VaryingGain, gains: Gains, slip_error: Fraction
) -> Bounds | NoProof:
    spread = varying_gain.spread(task, slip_error)
    return best_bounds(
        task,
        gains,
        sampled_loop.law.implicit_step,
        sampled_loop.step,
        sampled_loop.noise,
        spread,
        sampled_loop.timing_error,
    )


def _step_within(task: FaultPlant, sampled_loop: SampledLoop, claims: Claims) -> bool:
    """Whether the sector of an implicit step, if there is one, is valid within the claims."""
    root = sampled_loop.law.implicit_step
    errors = sampled_loop.measured_errors(task, (claims.slip_error, claims.slip_rate_error))
    return root is None or small_gain.sector_is_valid(root, sampled_loop.step, *errors)


def _beyond_the_pump(sampled_loop: SampledLoop, claims: Claims) -> str:
    """Reason why the claims exceed a pump limit; empty if they do not."""
    if sampled_loop.pump is None:
        return ""
    return sampled_loop.pump.exceeded(*claims.pressures[-1]) or sampled_loop.pump.too_slow(
        claims.largest_step, sampled_loop.ramp
    )


def _bounds(
    task: FaultPlant, sampled_loop: SampledLoop, loop: PeriodicLoop, invariant_set: InvariantPolytope | None = None
) -> Bounds | NoProof:
    if invariant_set is not None and not sampled_loop.longest_step:
        return NoProof(reason="periodic sampling needs no invariant set")
    if invariant_set is not None:
        return reached_bounds(task, sampled_loop, invariant_set)
    if sampled_loop.longest_step:
        return NoProof(reason="aperiodic sampling needs an invariant set")
    try:
        return certified_bounds(
            task, loop, sampled_loop.law.implicit_step, sampled_loop.noise, sampled_loop.timing_error
        )
    except ParameterError:
        return _unstable(sampled_loop)


def _unstable(sampled_loop: SampledLoop) -> NoProof:
    over = f"with zero-order hold over {_seconds(sampled_loop.step)}"
    return NoProof(reason=f"{over} even the nominal loop is not stable, or decays too slowly")


def _off_schedule(measured: Fraction, arrived: Fraction) -> str:
    """Part of the statement on jitter; empty without jitter."""
    each = f", each measurement within {LowerBound(measured):.6g} s of its instant" if measured else ""
    return each + (f", each pressure within {LowerBound(arrived):.6g} s of its due time" if arrived else "")


def _start(slip: Fraction, rate: Fraction) -> str:
    if not (slip or rate):
        return "from rest"
    return f"from every initial state within {LowerBound(slip):.6g} m and {LowerBound(rate):.6g} m/s of rest"


def _seconds(value: Fraction) -> str:
    return f"{UpperBound(value):.6g} s"


# ----------------------------------------------------------------------
# Peaks of the idealised loop in continuous time, with a pressure without delay: the same theorem.

WHEN = "in continuous time (pressure without sampling or delay)"
PREMISES = (
    "start at rest: x = 0, integrals 0; for the class rate a disturbance that starts at 0",
    "friction: any function of slip and slip rate within the bounds and chord slopes of the box",
    "k, eta, N anywhere in the box but constant",
    "pressure without sampling or delay; limits of the law, if any, lie outside the certified range of p",
    "friction opposes forward motion: the plant is linearly continued to negative slip rates (ERRATA 14)",
)


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class ContinuousProof(Proof[Bounds]):
    """Claims about a law in continuous time; `check` decides them.

    Attributes
    ----------
    task : FaultPlant
    law : ContinuousLaw
    claims : Claims
    """

    kind: ClassVar[str] = GUARANTEE
    sampled: ClassVar[bool] = False
    task: FaultPlant
    law: ContinuousLaw
    claims: Claims

    @property
    def loop(self) -> PeriodicLoop:
        """Nominal error loop."""
        return _loop(self.task, self.law)

    @property
    def bounds(self) -> Mapping[str, Bound]:
        """Claims by name, SI."""
        return self.claims.by_name

    def theorem_bounds(self) -> Bounds | NoProof:
        """Bounds that the theorem gives."""
        return _continuous_bounds(self.task, self.law)

    def follows_from(self, bounds: Bounds) -> bool:
        """Whether the claims follow, and the fault stays closed."""
        return self.claims.follow(self.task, bounds)

    def to_dict(self) -> Json:
        """Exact claims as strings, SI, and their assumptions."""
        kind = "amplitude" if self.task.change is None else "rate"
        return {"disturbance_class": kind, **self.claims.to_dict(), "premises": list(PREMISES)}

    def sentence(self) -> str:
        """Statement of the proved bounds as text."""
        return sentence_of(self.task, self.claims, f"{WHEN}, with exact measurements")


def continuous_peaks(task: FaultPlant, law: ContinuousLaw) -> ContinuousProof | NoProof:
    """Tightest rounded claims about a law in continuous time, or why there are none.

    Raises
    ------
    ParameterError
        For a law that cannot supply a constant pressure at zero error.
    """
    bounds = _continuous_bounds(task, law)
    if not bounds.available:
        return bounds
    claims = Claims.of(task, bounds).rounded()
    if reason := claims.opening_reason(task):
        return NoProof(reason=reason)
    return ContinuousProof(task=task, law=law, claims=claims)


def _loop(task: FaultPlant, law: ContinuousLaw) -> PeriodicLoop:
    """Nominal error loop; rejects a law that needs a smoother reference."""
    loop = continuous_loop(law, task.model, task.authority)
    if any(law.of_reference):
        task.require_smooth_reference()
    return loop


def _continuous_bounds(task: FaultPlant, law: ContinuousLaw) -> Bounds | NoProof:
    loop = _loop(task, law)
    try:
        return certified_bounds(task, loop)
    except ParameterError:
        reason = f"{WHEN} even the nominal loop is not stable, or decays too slowly"
        return NoProof(reason=reason)
