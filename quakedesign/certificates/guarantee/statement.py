"""A guarantee: a fault, the loop that runs, and what its outputs never exceed."""

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, ClassVar

from quakedesign.bounds import LowerBound, UpperBound
from quakedesign.certificates.claim import Verdict
from quakedesign.certificates.guarantee import sector
from quakedesign.certificates.guarantee.claims import MARGIN, Claims, above
from quakedesign.certificates.guarantee.held import Held
from quakedesign.certificates.guarantee.inputs import Gains
from quakedesign.certificates.guarantee.invariant_set import Reach, reached_bounds
from quakedesign.certificates.guarantee.slow_gain import SlowGain, slow_gains
from quakedesign.certificates.guarantee.small_gain import Bounds, NoGuarantee, best_bounds, certified_bounds
from quakedesign.certificates.guarantee.task import Task
from quakedesign.errors import ParameterError
from quakedesign.loop import PeriodicLoop, RestLimit
from quakedesign.rationals import six_digits

if TYPE_CHECKING:
    from quakedesign.loop import SampledController

_NOISE_WORDS = {
    "slip_noise": "with any noise of at most {:.6g} m in the measured slip",
    "rate_noise": "with any noise of at most {:.6g} m/s in the measured slip rate",
}
_RESTS = Fraction(1, 100)  # of the largest rate of the reference: below that a fault counts as at rest
_TURNS, _LEAPS = 32, 16  # of claims that follow from themselves: by small steps first, then by leaps
_LEAP = Fraction(6, 5)
_RAMPS, _RAMP_ROOM = 6, Fraction(21, 20)  # times of a pump that are tried, and what each has more than the last needed
_FIRST = Fraction(1, 64)  # of a step, the first of them


@dataclass(frozen=True, slots=True, kw_only=True)
class Guarantee:
    """Claims about one loop on one task; `check` decides them.

    Attributes
    ----------
    task : Task
    held : Held
    claims : Claims
    slow_gain : SlowGain, optional
        How the proof uses that the input gain is slow; None for one that lets it jump.
    reach : Reach, optional
        Of samples that follow no clock, the set that the loop never leaves; None for others.
    covers, lasts : str
        For what it holds, and for how long, in short.
    """

    task: Task
    held: Held
    claims: Claims
    slow_gain: SlowGain | None = None
    reach: Reach | None = None
    covers: ClassVar[str] = (
        "every friction law of the box and every disturbance up to the stated size, for a plant continued to negative "
        "slip rates"
    )
    lasts: ClassVar[str] = "for ever"

    def __repr__(self) -> str:
        held, claims = self.held, self.claims
        errors = f"|e1| <= {claims.slip_error:.4g} m, |e2| <= {claims.slip_rate_error:.4g} m/s"
        most = f" to {six_digits(held.longest_step)}" if held.longest_step else ""
        return f"Guarantee({self.task.name} held over {six_digits(held.step)}{most} s: {errors})"

    @property
    def peak_slip_rate(self) -> UpperBound:
        """What the slip rate never exceeds [m/s]."""
        return self.claims.peak_slip_rate

    @property
    def loop(self) -> PeriodicLoop:
        """Nominal error loop."""
        return self.held.loop(self.task)

    @property
    def rest_limit(self) -> RestLimit | None:
        """A limit that the valve's pressure never reaches; None where nothing is claimed of it, or the law not told.

        What the law asks for acts a delay later, while the reference moves on. A fault that moves by less than its
        measurement tells, or by a hundredth of the reference's largest rate, rests. Pressures that are
        claimed never to be passed are not, either, unless the fault slips faster than is claimed.
        """
        held, (low, high), (*fault, (least, largest)) = self.held, self.task.rest_pressure, self.claims.pressures
        if not held.law.applied or (not fault and (held.lag or held.diffusion)):
            return None
        away = max(largest - high, low - least)
        per_slip = max(map(abs, self.task.slip_chord)) / self.task.authority
        late = per_slip * (held.delay + held.jitter + held.delay_jitter + held.ramp) * self.task.reference_rates[0]
        width = above(2 * away + late)
        resolution = above(2 * held.slip_noise + _RESTS * self.task.reference_rates[0] * held.step)
        most = max(held.step, held.longest_step) + 2 * held.off
        return RestLimit(
            width=width,
            per_slip=above(per_slip),
            resolution=resolution,
            least=Fraction(least),
            largest=Fraction(largest),
            fastest=above(2 * held.slip_noise + self.claims.peak_slip_rate * most),
        )

    @property
    def slip_acceleration(self) -> UpperBound:
        """What |e1″| never exceeds [m/s²], from |p − p*| as the claims of the pressure follow from it."""
        task, claims, (low, high) = self.task, self.claims, self.task.rest_pressure
        away = max(claims.largest_pressure - high, low - claims.least_pressure)
        slip, rate = (max(map(abs, chord)) for chord in (task.slip_chord, task.rate_chord))
        moved = slip * claims.slip_error + rate * claims.slip_rate_error + task.beta[1] * task.authority * away
        return UpperBound(moved + task.amplitude + task.reference_force)

    @property
    def controller(self) -> "SampledController":
        """The law for `simulate`, as that of `Held`, with its limit against windup."""
        return replace(self.held.controller, rest_limit=self.rest_limit)

    def bounds(self) -> Bounds | NoGuarantee:
        """What the theorem gives, computed anew."""
        if self.slow_gain is None:
            return _bounds(self.task, self.held, self.loop, self.reach)
        gains = _slow_gains(self.task, self.held, self.slow_gain)
        if isinstance(gains, NoGuarantee):
            return gains
        return _slow_bounds(self.task, self.held, self.slow_gain, gains, self.claims.slip_error)

    def check(self) -> Verdict:
        """PROVED if the theorem gives the claims, in ball arithmetic; else UNDECIDED."""
        bounds = self.bounds()
        if isinstance(bounds, NoGuarantee) or not _root_within(self.task, self.held, self.claims):
            return Verdict.UNDECIDED
        if _beyond_the_pump(self.held, self.claims):
            return Verdict.UNDECIDED
        if self.slow_gain is not None and not bounds.slip_error < self.claims.slip_error:
            return Verdict.UNDECIDED
        return self.claims.verdict(self.task, bounds)

    def sentence(self) -> str:
        """What is guaranteed, for people."""
        held = self.held
        when = f"held over {_seconds(held.step)}"
        if held.longest_step:
            shortest, longest = UpperBound(held.step), LowerBound(held.longest_step)
            when = f"held over anything from {shortest:.6g} s to {longest:.6g} s, by no clock"
        when += f", {_seconds(held.delay)} late" if held.delay else ""
        when += f", through a lag of {_seconds(held.lag)}" if held.lag else ""
        when += f", through rock of L^2/D = {_seconds(held.diffusion)} from well to fault" if held.diffusion else ""
        when += ", with the slip alone measured" if held.law.of_slip_alone else ""
        for name, bound in ((name, bound) for name, bound in held.noise.items() if bound):
            when += f", {_NOISE_WORDS[name].format(LowerBound(bound))}"
        mean = LowerBound(held.averaging)
        when += f", each measurement a mean over {mean:.6g} s around its time" if mean else ""
        when += _off_schedule(held.jitter, held.jitter + held.delay_jitter)
        when += f", {held.pump.words()}" if held.pump else ""
        return sentence_of(self.task, self.claims, when, _start(*held.start))


def sentence_of(task: Task, claims: Claims, when: str, start: str = "from rest") -> str:
    """What is claimed of a task, for people; `when` says how the pressure follows the law.

    Bounds of what is claimed are rounded up, those of the disturbances and starts for which it is claimed down.
    """
    stress = LowerBound(task.amplitude / task.area_per_mass[1])
    kind = f"for every disturbance of at most {LowerBound(task.amplitude):.3g} m/s^2 ({stress.quantity('Pa')} of shear)"
    if task.change is not None:
        kind += f" that starts at 0 and changes by at most {LowerBound(task.change):.3g} m/s^3 (class rate)"
    if not task.amplitude:
        kind = "without disturbance"
    pressures = [f"between {low.quantity('Pa')} and {high.quantity('Pa')}" for low, high in claims.pressures]
    largest = claims.largest_step
    step = "" if largest is None else f", that asked for changes by at most {largest.quantity('Pa')} a sample"
    return (
        f"{start}, {when}, {kind}, for all friction and constant parameters of the box: "
        f"the slip rate never exceeds {claims.peak_slip_rate:.3g} m/s, the slip stays within "
        f"{claims.slip_error:.3g} m of the reference, the pressure {', at the valve '.join(pressures)}{step} "
        "(for a plant continued to negative slip rates)"
    )


def guarantee(
    task: Task, held: Held, slow_gain: SlowGain | None = None, reach: Reach | None = None
) -> Guarantee | NoGuarantee:
    """Tightest rounded claims about a loop, or why there are none; of a pump of some rate, with a ramp that will do.

    Samples that follow no clock need a reach, and have no slow gain.

    Raises
    ------
    ParameterError
        For a loop without a steady state, or a slow gain and friction of the slip rate.
    """
    if reach is not None:
        bounds = _bounds(task, held, held.loop(task), reach)
        return (
            bounds if isinstance(bounds, NoGuarantee) else _of_claims(task, held, _rounded(task, bounds), reach=reach)
        )
    if held.pump is None or held.pump.rate is None or held.ramp:
        return _proved(task, held, slow_gain)
    ramp, longest = _FIRST * held.step, held.longest_ramp
    found = _proved(task, replace(held, ramp=ramp), slow_gain)
    for _ in range(_RAMPS):
        if isinstance(found, Guarantee) or found.needs is None or ramp == longest:
            break
        if slow := held.pump.too_slow(UpperBound(found.needs), longest):
            return replace(found, reason=slow)
        ramp = min(above(found.needs / held.pump.rate * _RAMP_ROOM), longest)
        found = _proved(task, replace(held, ramp=ramp), slow_gain)
    return found


def _proved(task: Task, held: Held, slow_gain: SlowGain | None) -> Guarantee | NoGuarantee:
    claims = _claims(task, held) if slow_gain is None else _slow_claims(task, held, slow_gain)
    return claims if isinstance(claims, NoGuarantee) else _of_claims(task, held, claims, slow_gain)


def _of_claims(
    task: Task, held: Held, claims: Claims, slow_gain: SlowGain | None = None, reach: Reach | None = None
) -> Guarantee | NoGuarantee:
    """What is claimed, or what speaks against it."""
    if not _root_within(task, held, claims):
        errors = f"errors up to {claims.slip_error:.3g} m and {claims.slip_rate_error:.3g} m/s"
        return NoGuarantee(reason=f"the root of the implicit step leaves its range at {errors}", small_gain=None)
    if reason := claims.opens(task) or _beyond_the_pump(held, claims):
        slow = held.pump is not None and bool(held.pump.too_slow(claims.largest_step, held.ramp))
        return NoGuarantee(reason=reason, small_gain=None, needs=claims.largest_step if slow else None)
    return Guarantee(task=task, held=held, claims=claims, slow_gain=slow_gain, reach=reach)


def _claims(task: Task, held: Held) -> Claims | NoGuarantee:
    bounds = _bounds(task, held, held.loop(task))
    return bounds if isinstance(bounds, NoGuarantee) else _rounded(task, bounds)


def _rounded(task: Task, bounds: Bounds) -> Claims:
    return Claims.of(task, bounds).rounded()


def _slow_claims(task: Task, held: Held, slow_gain: SlowGain) -> Claims | NoGuarantee:
    """Claims on whose slip error the gain's spread rests that they follow from."""
    gains, slip_error = _slow_gains(task, held, slow_gain), Fraction(0)
    if isinstance(gains, NoGuarantee):
        return gains
    for turn in range(_TURNS + _LEAPS):
        bounds = _slow_bounds(task, held, slow_gain, gains, slip_error)
        if isinstance(bounds, NoGuarantee):
            return bounds
        claims = _rounded(task, bounds)
        if claims.slip_error <= slip_error:
            return claims
        slip_error = above(max(claims.slip_error * MARGIN, _LEAP * slip_error * (turn >= _TURNS)))
    reason = f"the slip error that moves the input gain, beyond {UpperBound(slip_error):.2g} m, moves it further"
    return NoGuarantee(reason=reason, small_gain=None)


def _slow_gains(task: Task, held: Held, slow_gain: SlowGain) -> Gains | NoGuarantee:
    if held.longest_step:
        return NoGuarantee(reason="samples that follow no clock have no slow gain", small_gain=None)
    loops = tuple(held.loop(task, model) for model in slow_gain.models(task))
    try:
        return slow_gains(loops, slow_gain.growth)
    except ParameterError:
        return _unstable(held)


def _slow_bounds(
    task: Task, held: Held, slow_gain: SlowGain, gains: Gains, slip_error: Fraction
) -> Bounds | NoGuarantee:
    spread = slow_gain.spread(task, slip_error)
    return best_bounds(task, gains, held.law.root, held.step, held.noise, spread, held.off)


def _root_within(task: Task, held: Held, claims: Claims) -> bool:
    """Whether an implicit root, if there is one, is as said wherever the claims hold."""
    root = held.law.root
    errors = held.told(task, (claims.slip_error, claims.slip_rate_error))
    return root is None or sector.holds(root, held.step, *errors)


def _beyond_the_pump(held: Held, claims: Claims) -> str:
    """Why the pump cannot do what is claimed; empty where it can."""
    if held.pump is None:
        return ""
    return held.pump.exceeded(*claims.pressures[-1]) or held.pump.too_slow(claims.largest_step, held.ramp)


def _bounds(task: Task, held: Held, loop: PeriodicLoop, reach: Reach | None = None) -> Bounds | NoGuarantee:
    if reach is not None and not held.longest_step:
        return NoGuarantee(reason="samples that follow a clock need no set", small_gain=None)
    if reach is not None:
        return reached_bounds(task, held, reach)
    if held.longest_step:
        return NoGuarantee(reason="samples that follow no clock need a set that the loop never leaves", small_gain=None)
    try:
        return certified_bounds(task, loop, held.law.root, held.noise, held.off)
    except ParameterError:
        return _unstable(held)


def _unstable(held: Held) -> NoGuarantee:
    reason = f"held over {_seconds(held.step)} even the nominal loop is not stable, or too slow to be seen so"
    return NoGuarantee(reason=reason, small_gain=None)


def _off_schedule(measured: Fraction, arrived: Fraction) -> str:
    """Said of jitter; nothing where there is none."""
    each = f", each measurement within {LowerBound(measured):.6g} s of its instant" if measured else ""
    return each + (f", each pressure within {LowerBound(arrived):.6g} s of when it is due" if arrived else "")


def _start(slip: Fraction, rate: Fraction) -> str:
    if not (slip or rate):
        return "from rest"
    return f"from every start within {LowerBound(slip):.6g} m and {LowerBound(rate):.6g} m/s of rest"


def _seconds(value: Fraction) -> str:
    return f"{UpperBound(value):.6g} s"
