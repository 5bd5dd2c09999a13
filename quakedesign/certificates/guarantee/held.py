"""A law as it runs around a fault: what a guarantee is about besides the fault."""

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any, TypedDict, cast

from quakedesign import loop as loops
from quakedesign.certificates.guarantee.pump import Pump
from quakedesign.certificates.guarantee.task import Task
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.loop import NOISES, Instants, Layer, LinearLaw, Model, PeriodicLoop, held_loop, starts, with_known_area
from quakedesign.rationals import shortly

if TYPE_CHECKING:
    from quakedesign.loop import SampledController


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
    longest_step: Fraction


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
    longest_step : Fraction
        Where samples follow no clock: each comes `step` to this after the last [s]; 0 where they do.

    Raises
    ------
    ParameterError
        For a negative bound, noise of a slip rate that the law does not measure, or samples that follow no clock with
        anything but noise around the law.
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
    longest_step: Fraction = Fraction(0)

    def __post_init__(self) -> None:
        if min(self.start) < 0:
            raise ParameterError(
                "initial slip and slip rate are bounds of both signs, 0 or more. Received "
                f"{shortly(self.initial_slip)} m and {shortly(self.initial_slip_rate)} m/s. Leave out the sign."
            )
        if min(self.slip_noise, self.rate_noise) < 0:
            raise ParameterError(
                "a bound of noise must be 0 or more. Received "
                f"{shortly(self.slip_noise)} m and {shortly(self.rate_noise)} m/s. Check their signs."
            )
        if min(self.jitter, self.delay_jitter, self.averaging, self.ramp) < 0:
            raise ParameterError(
                f"jitter must be 0 or more, and averaging too. Received {shortly(self.jitter)} s, of the delay "
                f"{shortly(self.delay_jitter)} s, and {shortly(self.averaging)} s. Leave out the sign."
            )
        if self.rate_noise and self.law.of_slip_alone:
            raise ParameterError(
                "noise of the slip rate needs a law that measures it. Received "
                f"{shortly(self.rate_noise)} m/s and a law of the slip alone. Leave it out."
            )
        if self.longest_step:
            self._require_no_clock()

    def _require_no_clock(self) -> None:
        """Refuse intervals that are no range, and what asks for a schedule or a start at rest."""
        if self.longest_step <= self.step:
            raise ParameterError(
                "the longest step must be longer than the step, the shortest one. Received "
                f"{shortly(self.longest_step)} s and {shortly(self.step)} s. Exchange them, or leave it out."
            )
        first = (v for row in self.law.first for v in row)
        times = (self.ramp, self.jitter, self.delay_jitter, self.averaging)
        if (
            any((*self.path.values(), *self.start, *times, *first))
            or self.law.root is not None
            or (self.pump and self.pump.rate)
        ):
            raise ParameterError(
                "samples that follow no clock are known from rest, of a linear law whose pressure acts at once. "
                "Received a longest step beside a delay, a lag, rock, a start, jitter, means, the rate of a pump or an "
                "implicit step. Leave one of them out."
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
    def slack(self) -> Fraction:
        """By how much an interval from sample to sample may be longer than the shortest [s]; 0 with a clock."""
        return max(self.longest_step - self.step, Fraction(0))

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
        return loops.SampledController(law=self.law, step=self.step, **self.path, longest=self.longest_step)

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
