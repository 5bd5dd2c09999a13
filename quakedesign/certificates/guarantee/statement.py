"""A guarantee: a fault, the loop that runs, and what its outputs never exceed."""

from dataclasses import dataclass, replace
from fractions import Fraction
from math import ceil, floor, log10
from typing import TYPE_CHECKING, Any, ClassVar, TypedDict, cast

from quakedesign import loop as loops
from quakedesign.bounds import LowerBound, UpperBound
from quakedesign.certificates.claim import Verdict
from quakedesign.certificates.guarantee import sector
from quakedesign.certificates.guarantee.inputs import Gains
from quakedesign.certificates.guarantee.pump import Pump
from quakedesign.certificates.guarantee.slow_gain import SlowGain, slow_gains
from quakedesign.certificates.guarantee.small_gain import Bounds, NoGuarantee, best_bounds, certified_bounds
from quakedesign.certificates.guarantee.task import Task
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.loop import (
    NOISES,
    Instants,
    Layer,
    LinearLaw,
    Model,
    PeriodicLoop,
    RestLimit,
    held_loop,
    starts,
    with_known_area,
)
from quakedesign.rationals import six_digits

if TYPE_CHECKING:
    from quakedesign.loop import SampledController

_DIGITS = 4
_NOISE_WORDS = {
    "slip_noise": "with any noise of at most {:.6g} m in the measured slip",
    "rate_noise": "with any noise of at most {:.6g} m/s in the measured slip rate",
}
_MARGIN = Fraction(1001, 1000)  # so that another way to bound the same integrals proves the same claim
_RESTS = Fraction(1, 100)  # of the largest rate of the reference: below that a fault counts as at rest
_ENDS = ("least_pressure", "largest_pressure", "least_asked", "largest_asked")
_TURNS = 32  # of claims that follow from themselves
_RAMPS, _RAMP_ROOM = 6, Fraction(21, 20)  # times of a pump that are tried, and what each has more than the last needed
_FIRST = Fraction(1, 64)  # of a step, the first of them


class Around(TypedDict, total=False):
    """What `Held` has besides the law and T_s; what is left out is 0, a pump without limits None."""

    delay: Fraction
    lag: Fraction
    diffusion: Fraction
    slip_noise: Fraction
    rate_noise: Fraction
    initial_slip: Fraction
    initial_slip_rate: Fraction
    jitter: Fraction
    delay_jitter: Fraction
    averaging: Fraction
    pump: Pump | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Held:
    """A law as it runs: once every T_s, its pressure held, late, through a lag and rock, from what it measures.

    Attributes
    ----------
    law : LinearLaw
    step, delay, lag : Fraction
        [s].
    diffusion : Fraction
        L²/D of the layer between well and fault [s]; 0 for none.
    slip_noise, rate_noise : Fraction
        Bounds of what measured slip and slip rate are off [m], [m/s], whatever the course.
    initial_slip, initial_slip_rate : Fraction
        Bounds of both at the start, where the reference has none, of either sign [m], [m/s].
    jitter, delay_jitter : Fraction
        By how much a measurement is early or late at most, its pressure with it [s], and the pressure besides.
    averaging : Fraction
        Each measurement but the first is a mean over a time around its own, at most half of this away [s].
    pump : Pump, optional
        Limits at the valve, which the loop must never reach.
    ramp : Fraction
        Time in which the pump goes from one pressure to the next, at most [s].

    Raises
    ------
    ParameterError
        For a negative bound, or noise of a slip rate that the law does not measure.
    """

    law: LinearLaw
    step: Fraction
    delay: Fraction = Fraction(0)
    lag: Fraction = Fraction(0)
    diffusion: Fraction = Fraction(0)
    slip_noise: Fraction = Fraction(0)
    rate_noise: Fraction = Fraction(0)
    initial_slip: Fraction = Fraction(0)
    initial_slip_rate: Fraction = Fraction(0)
    jitter: Fraction = Fraction(0)
    delay_jitter: Fraction = Fraction(0)
    averaging: Fraction = Fraction(0)
    pump: Pump | None = None
    ramp: Fraction = Fraction(0)

    def __post_init__(self) -> None:
        if min(self.start) < 0:
            raise ParameterError(
                "initial slip and slip rate are bounds of both signs, 0 or more. Received "
                f"{float(self.initial_slip):.4g} m and {float(self.initial_slip_rate):.4g} m/s. Leave out the sign."
            )
        if min(self.slip_noise, self.rate_noise) < 0:
            raise ParameterError(
                "a bound of noise must be 0 or more. Received "
                f"{float(self.slip_noise):.4g} m and {float(self.rate_noise):.4g} m/s. Check their signs."
            )
        if min(self.jitter, self.delay_jitter, self.averaging, self.ramp) < 0:
            raise ParameterError(
                f"jitter must be 0 or more, and averaging too. Received {float(self.jitter):.4g} s, of the delay "
                f"{float(self.delay_jitter):.4g} s, and {float(self.averaging):.4g} s. Leave out the sign."
            )
        if self.rate_noise and self.law.of_slip_alone:
            raise ParameterError(
                "noise of the slip rate needs a law that measures it. Received "
                f"{float(self.rate_noise):.4g} m/s and a law of the slip alone. Leave it out."
            )

    @property
    def around(self) -> Around:
        """All but law and T_s."""
        return cast(Around, {name: getattr(self, name) for name in Around.__annotations__})

    @property
    def path(self) -> dict[str, Any]:
        """Delay, lag and L²/D [s] between law and fault."""
        return {"delay": self.delay, "lag": self.lag, "diffusion": self.diffusion}

    @property
    def start(self) -> tuple[Fraction, Fraction]:
        """Bounds of the errors at the start [m], [m/s]; 0 and 0 at rest."""
        return self.initial_slip, self.initial_slip_rate

    @property
    def noise(self) -> dict[str, Fraction]:
        """Bounds of the noise that there is, by its input of the loop; with jitter all that is measured has some."""
        measured = (NOISES[0], *NOISES[1:] * (not self.law.of_slip_alone)) if self.off else ()
        return {name: bound for name in NOISES if (bound := getattr(self, name)) or name in measured}

    @property
    def off(self) -> Fraction:
        """How far from its instant a measurement may tell of, at most [s]."""
        return self.jitter + self.averaging / 2

    @property
    def instants(self) -> Instants | None:
        """How far those of the loop may be off; None where they are not, and a pressure may change at once."""
        if not (self.off or self.delay_jitter or (self.pump and self.pump.rate)):
            return None
        return Instants(measured=self.off, arrived=self.jitter + self.delay_jitter, ramp=self.ramp)

    @property
    def longest_ramp(self) -> Fraction:
        """Time after a pressure is due and before the next sample is [s]."""
        off, part = self.jitter + self.delay_jitter, self.delay % self.step
        return min(self.step - part - off, self.step - 2 * off)

    def told(self, task: Task, errors: tuple[Fraction, Fraction]) -> tuple[Fraction, Fraction]:
        """Bounds of the errors as the law is told them, from those of the true ones at any time [m], [m/s].

        A measurement that is early or late may be compared with the reference at its instant.
        """
        off = zip(errors, (self.slip_noise, self.rate_noise), task.reference_rates, strict=True)
        slip, rate = (error + noise + self.off * moves for error, noise, moves in off)
        return slip, rate

    @property
    def controller(self) -> "SampledController":
        """The law for `simulate`, with the scheme ``explicit``, the step T_s, and the delay, lag and rock around it.

        Raises
        ------
        UnsupportedError
            For a law with an implicit root, which is a controller of its own with a scheme.
        """
        if self.law.root is not None:
            raise UnsupportedError(
                "what is proved of a sliding mode tells its implicit root, not its gains. Received one. Take the "
                "controller of its design, or its gains, scale, weight and authority in the scheme compensated."
            )
        return loops.SampledController(law=self.law, step=self.step, **self.path)

    def loop(self, task: Task, model: Model | None = None) -> PeriodicLoop:
        """Nominal error loop on a task, of its model or another one."""
        loop = held_loop(
            self.law,
            model or task.model,
            task.authority,
            self.step,
            **self.path,
            noisy=self.noise,
            instants=self.instants,
        )
        if self.diffusion:
            gain = (model or task.model).gain / task.authority
            loop = with_known_area(loop, gain, Layer(time=self.diffusion))
        box = starts(self.law, len(loop.states), self.start, (self.slip_noise, self.rate_noise))
        return replace(loop, start=box)


@dataclass(frozen=True, slots=True, kw_only=True)
class Claims:
    """What is never exceeded.

    Attributes
    ----------
    slip_error : UpperBound
        Slip less reference, absolute value [m].
    slip_rate_error : UpperBound
        [m/s].
    peak_slip_rate : UpperBound
        Slip rate, absolute value [m/s].
    least_pressure : LowerBound
        [Pa].
    largest_pressure : UpperBound
        [Pa].
    least_asked, largest_asked : LowerBound and UpperBound, optional
        The same of the pressure at the valve [Pa]; None where that is the fault's.
    largest_step : UpperBound, optional
        Change of the pressure that is asked for from sample to sample [Pa]; None where it does not count.
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
    def of(cls, task: Task, bounds: Bounds) -> "Claims":
        """Tightest claims that bounds support."""
        low, high = task.rest_pressure
        push = bounds.push / task.authority
        asked = None if bounds.asked is None else bounds.asked / task.authority
        return cls(
            slip_error=UpperBound(bounds.slip_error),
            slip_rate_error=UpperBound(bounds.slip_rate_error),
            peak_slip_rate=UpperBound(bounds.slip_rate_error + task.reference_rates[0]),
            least_pressure=LowerBound(low - push),
            largest_pressure=UpperBound(high + push),
            least_asked=None if asked is None else LowerBound(low - asked),
            largest_asked=None if asked is None else UpperBound(high + asked),
            largest_step=None if bounds.stepped is None else UpperBound(bounds.stepped / task.authority),
        )

    @property
    def pressures(self) -> tuple[tuple[LowerBound, UpperBound], ...]:
        """In the fault, and at the valve where that is another one [Pa]."""
        fault = self.least_pressure, self.largest_pressure
        if self.least_asked is None or self.largest_asked is None:
            return (fault,)
        return fault, (self.least_asked, self.largest_asked)

    def to_dict(self) -> dict[str, Any]:
        """Exact numbers as texts, SI."""
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
        """The same, a little weaker and with few digits."""
        step = self.largest_step
        ends: list[Any] = [end for low, high in self.pressures for end in _wider(low, high)]
        return Claims(
            slip_error=UpperBound(_above(self.slip_error * _MARGIN)),
            slip_rate_error=UpperBound(_above(self.slip_rate_error * _MARGIN)),
            peak_slip_rate=UpperBound(_above(self.peak_slip_rate * _MARGIN)),
            largest_step=None if step is None else UpperBound(_above(step * _MARGIN)),
            **dict(zip(_ENDS, ends, strict=False)),
        )

    def verdict(self, task: Task, bounds: Bounds) -> Verdict:
        """PROVED if the claims follow from bounds under which the fault stays closed, else UNDECIDED."""
        tightest = Claims.of(task, bounds)
        return Verdict.PROVED if self.covers(tightest) and not tightest.opens(task) else Verdict.UNDECIDED

    def opens(self, task: Task) -> str:
        """Why the fault may open, where the plant is another one; empty where the pressure stays below σ′."""
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
    covers, lasts : str
        For what it holds, and for how long, in short.
    """

    task: Task
    held: Held
    claims: Claims
    slow_gain: SlowGain | None = None
    covers: ClassVar[str] = (
        "every friction law of the box and every disturbance up to the stated size, for a plant continued to negative "
        "slip rates"
    )
    lasts: ClassVar[str] = "for ever"

    def __repr__(self) -> str:
        held, claims = self.held, self.claims
        errors = f"|e1| <= {claims.slip_error:.4g} m, |e2| <= {claims.slip_rate_error:.4g} m/s"
        return f"Guarantee({self.task.name} held over {six_digits(held.step)} s: {errors})"

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
        measurement tells, or by a hundredth of the reference's largest rate, rests.
        """
        held, (low, high), (*fault, (least, largest)) = self.held, self.task.rest_pressure, self.claims.pressures
        if not held.law.applied or (not fault and (held.lag or held.diffusion)):
            return None
        away = max(largest - high, low - least)
        per_slip = max(map(abs, self.task.slip_chord)) / self.task.authority
        late = per_slip * (held.delay + held.jitter + held.delay_jitter + held.ramp) * self.task.reference_rates[0]
        width = _above(2 * away + late)
        resolution = _above(2 * held.slip_noise + _RESTS * self.task.reference_rates[0] * held.step)
        return RestLimit(width=width, per_slip=_above(per_slip), resolution=resolution)

    @property
    def controller(self) -> "SampledController":
        """The law for `simulate`, as that of `Held`, with its limit against windup."""
        return replace(self.held.controller, rest_limit=self.rest_limit)

    def bounds(self) -> Bounds | NoGuarantee:
        """What the theorem gives, computed anew."""
        if self.slow_gain is None:
            return _bounds(self.task, self.held, self.loop)
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


def guarantee(task: Task, held: Held, slow_gain: SlowGain | None = None) -> Guarantee | NoGuarantee:
    """Tightest rounded claims about a loop, or why there are none; of a pump of some rate, with a ramp that will do.

    Raises
    ------
    ParameterError
        For a loop without a steady state, or a slow gain and friction of the slip rate.
    """
    if held.pump is None or held.pump.rate is None or held.ramp:
        return _proved(task, held, slow_gain)
    found, longest = _proved(task, replace(held, ramp=_FIRST * held.step), slow_gain), held.longest_ramp
    for _ in range(_RAMPS):
        if isinstance(found, Guarantee) or found.needs is None:
            return found
        ramp = _above(found.needs / held.pump.rate * _RAMP_ROOM)
        if ramp > longest:
            return found
        found = _proved(task, replace(held, ramp=ramp), slow_gain)
    return found


def _proved(task: Task, held: Held, slow_gain: SlowGain | None) -> Guarantee | NoGuarantee:
    claims = _claims(task, held) if slow_gain is None else _slow_claims(task, held, slow_gain)
    if isinstance(claims, NoGuarantee):
        return claims
    if not _root_within(task, held, claims):
        errors = f"errors up to {claims.slip_error:.3g} m and {claims.slip_rate_error:.3g} m/s"
        return NoGuarantee(reason=f"the root of the implicit step leaves its range at {errors}", small_gain=None)
    if reason := claims.opens(task) or _beyond_the_pump(held, claims):
        slow = held.pump is not None and bool(held.pump.too_slow(claims.largest_step, held.ramp))
        return NoGuarantee(reason=reason, small_gain=None, needs=claims.largest_step if slow else None)
    return Guarantee(task=task, held=held, claims=claims, slow_gain=slow_gain)


def _claims(task: Task, held: Held) -> Claims | NoGuarantee:
    bounds = _bounds(task, held, held.loop(task))
    return bounds if isinstance(bounds, NoGuarantee) else Claims.of(task, bounds).rounded()


def _slow_claims(task: Task, held: Held, slow_gain: SlowGain) -> Claims | NoGuarantee:
    """Claims on whose slip error the gain's spread rests that they follow from."""
    gains, slip_error = _slow_gains(task, held, slow_gain), Fraction(0)
    if isinstance(gains, NoGuarantee):
        return gains
    for _ in range(_TURNS):
        bounds = _slow_bounds(task, held, slow_gain, gains, slip_error)
        if isinstance(bounds, NoGuarantee):
            return bounds
        claims = Claims.of(task, bounds).rounded()
        if claims.slip_error <= slip_error:
            return claims
        slip_error = _above(claims.slip_error * _MARGIN)
    reason = f"the slip error that moves the input gain, beyond {UpperBound(slip_error):.2g} m, moves it further"
    return NoGuarantee(reason=reason, small_gain=None)


def _slow_gains(task: Task, held: Held, slow_gain: SlowGain) -> Gains | NoGuarantee:
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


def _bounds(task: Task, held: Held, loop: PeriodicLoop) -> Bounds | NoGuarantee:
    try:
        return certified_bounds(task, loop, held.law.root, held.noise, held.off)
    except ParameterError:
        return _unstable(held)


def _unstable(held: Held) -> NoGuarantee:
    reason = f"held over {_seconds(held.step)} even the nominal loop is not stable, or too slow to be seen so"
    return NoGuarantee(reason=reason, small_gain=None)


def _covers(step: UpperBound | None, other: UpperBound | None) -> bool:
    """Whether a largest step follows from another."""
    return step is None or (other is not None and step >= other)


def _wider(low: LowerBound, high: UpperBound) -> tuple[LowerBound, UpperBound]:
    room = (high - low) * (_MARGIN - 1)
    return LowerBound(-_above(room - low)), UpperBound(_above(high + room))


def _above(value: Fraction) -> Fraction:
    """At least a rational, with four digits."""
    if not value:
        return value
    scale = Fraction(10) ** (floor(log10(abs(value))) - _DIGITS + 1)
    return ceil(value / scale) * scale


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
