"""Sampled loop of a guarantee: law, loop setup, pump limits, and inputs with their bounds.

The inputs are acceleration, drift, implicit step, noise, initial condition and truncation error of the diffusion modes.
The derivation of their bounds is in `quakedesign.guarantees.exact.small_gain`.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from quakedesign import laws
from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.exact import shortly
from quakedesign.guarantees.exact.norms import START
from quakedesign.laws import NOISES, ImplicitStep, LinearLaw, NominalModel
from quakedesign.loop import DiffusionPath, Instants, PeriodicLoop, sampled_error_loop, starts, with_response_area
from quakedesign.loop.loop_setup import LoopSetup, Pump
from quakedesign.plant.fault_plant import FaultPlant

if TYPE_CHECKING:
    from quakedesign.laws import SampledController


# ----------------------------------------------------------------------
# A sampled law with its loop setup: together with the fault, the subject of a guarantee.


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class ExactSetup:
    """Loop setup of a proof in exact numbers; the law and T_s are in `SampledLoop`.

    Attributes
    ----------
    delay, lag : Fraction
        [s].
    diffusion : Fraction
        L²/D of the diffusion path between well and fault [s]; 0 for none.
    slip_noise, rate_noise : Fraction
        Bounds of the measurement errors of slip [m] and slip rate [m/s], which may be any functions of time.
    initial_slip, initial_slip_rate : Fraction
        Bounds of the absolute initial slip [m] and slip rate [m/s]; those of the reference are 0.
    jitter, delay_jitter : Fraction
        Largest timing error that a measurement and its pressure share [s], and largest additional one of the pressure
        alone [s].
    averaging : Fraction
        Averaging time [s]: each measurement except the first is a mean over times that differ from its nominal instant
        by at most half the averaging time.
    pump : Pump, optional
        Limits at the valve, which the loop must never exceed.
    ramp : Fraction
        Longest duration of a pressure change of the pump [s].
    longest_step : Fraction
        Aperiodic sampling: longest interval between samples [s], T_s the shortest; 0 for periodic sampling.
    """

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

    @classmethod
    def of(cls, setup: LoopSetup) -> "ExactSetup":
        """Exact loop setup; the delay counts from the middle of the averaging time."""
        own = {part.name for part in fields(ExactSetup)} - {"averaging", "ramp"}
        shared: dict[str, Any] = {name: getattr(setup, name) for name in own}
        shared["delay"] += setup.averaging_time / 2
        return ExactSetup(**shared, averaging=setup.averaging_time)

    @property
    def setup(self) -> "ExactSetup":
        """Loop setup alone, without the ramp time of this law."""
        return replace(ExactSetup(**{part.name: getattr(self, part.name) for part in fields(ExactSetup)}), ramp=_ZERO)

    @property
    def path(self) -> dict[str, Any]:
        """Delay, lag and L²/D [s] between law and fault."""
        return {"delay": self.delay, "lag": self.lag, "diffusion": self.diffusion}

    def with_law(self, law: LinearLaw, step: Fraction) -> "SampledLoop":
        """A law in this setup, with zero-order hold over T_s [s]."""
        return SampledLoop(law=law, step=step, **{part.name: getattr(self, part.name) for part in fields(ExactSetup)})


PLAIN = ExactSetup()
"""Setup without delay, path, noise or timing errors."""


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class SampledLoop(ExactSetup):
    """A sampled law with zero-order hold over T_s in its loop setup, see `ExactSetup`.

    Attributes
    ----------
    law : LinearLaw
    step : Fraction
        T_s [s].

    Raises
    ------
    ParameterError
        For a negative bound, noise of a slip rate that the law does not measure, or aperiodic sampling with initial
        errors, delay, lag, diffusion path, jitter, averaging or a rate limit of the pump.
    """

    law: LinearLaw
    step: Fraction

    def __post_init__(self) -> None:
        if min(self.initial_errors) < 0:
            raise ParameterError(
                "bounds of the initial slip and slip rate errors must be 0 or more. Received "
                f"{shortly(self.initial_slip)} m and {shortly(self.initial_slip_rate)} m/s. Give absolute values."
            )
        if min(self.slip_noise, self.rate_noise) < 0:
            raise ParameterError(
                "bounds of slip noise and rate noise must be 0 or more. Received "
                f"{shortly(self.slip_noise)} m and {shortly(self.rate_noise)} m/s. Give absolute values."
            )
        if min(self.jitter, self.delay_jitter, self.averaging, self.ramp) < 0:
            raise ParameterError(
                f"jitter, delay jitter, averaging and ramp must be 0 or more. Received {shortly(self.jitter)} s, "
                f"{shortly(self.delay_jitter)} s, {shortly(self.averaging)} s and {shortly(self.ramp)} s. "
                "Give absolute values."
            )
        if self.rate_noise and self.law.of_slip_alone:
            raise ParameterError(
                "rate noise needs a law that measures the slip rate. Received the rate noise "
                f"{shortly(self.rate_noise)} m/s for a law of the slip alone. Omit the rate noise."
            )
        if self.law.of_reference and (self.diffusion or self.longest_step or self.law.implicit_step is not None):
            raise ParameterError(
                "a law that uses slip, slip rate or reference directly has no guarantee with a diffusion path, "
                f"aperiodic sampling or an implicit step. Received diffusion {shortly(self.diffusion)} s, longest_step "
                f"{shortly(self.longest_step)} s and {'an' if self.law.implicit_step else 'no'} implicit step. Use "
                "slip_error and slip_rate_error alone, or omit these."
            )
        if self.longest_step:
            self._require_aperiodic()

    def _require_aperiodic(self) -> None:
        """Reject an empty range of intervals, and a setup that needs periodic sampling."""
        if self.longest_step <= self.step:
            raise ParameterError(
                "the longest step must exceed the step, which is the shortest sampling interval. Received "
                f"{shortly(self.longest_step)} s and the step {shortly(self.step)} s. Swap them, or omit the "
                "longest step."
            )
        first = (v for row in self.law.first for v in row)
        times = (self.ramp, self.jitter, self.delay_jitter, self.averaging)
        if (
            any((*self.path.values(), *self.initial_errors, *times, *first))
            or self.law.implicit_step is not None
            or (self.pump and self.pump.rate)
        ):
            raise ParameterError(
                "aperiodic sampling needs a linear law whose states start at 0, zero initial errors, and no delay, "
                "lag, diffusion path, jitter, averaging, pump rate limit or implicit step. Received longest_step "
                f"{shortly(self.longest_step)} s for a loop that violates this. Omit longest_step, or change the loop."
            )

    @property
    def initial_errors(self) -> tuple[Fraction, Fraction]:
        """Bounds of the initial errors [m], [m/s]; 0 and 0 at rest."""
        return self.initial_slip, self.initial_slip_rate

    @property
    def noise(self) -> dict[str, Fraction]:
        """Bounds of the measurement noise by name of the input; with a timing error also those that are 0."""
        measured = (NOISES[:1] if self.law.of_slip_alone else NOISES) if self.timing_error else ()
        return {name: bound for name in NOISES if (bound := getattr(self, name)) or name in measured}

    @property
    def timing_error(self) -> Fraction:
        """Largest timing error of a measurement [s]."""
        return self.jitter + self.averaging / 2

    @property
    def instants(self) -> Instants | None:
        """Timing errors of the loop; None for exact timing and pressures without a ramp."""
        if not (self.timing_error or self.delay_jitter or (self.pump and self.pump.rate)):
            return None
        return Instants(measured=self.timing_error, arrived=self.jitter + self.delay_jitter, ramp=self.ramp)

    @property
    def slack(self) -> Fraction:
        """Longest minus shortest sampling interval [s]; 0 for periodic sampling."""
        return max(self.longest_step - self.step, Fraction(0))

    @property
    def longest_ramp(self) -> Fraction:
        """Longest duration of a pressure change that ends before the next sample and the next change [s]."""
        error, part = self.jitter + self.delay_jitter, self.delay % self.step
        return min(self.step - part - error, self.step - 2 * error)

    def measured_errors(self, task: FaultPlant, errors: tuple[Fraction, Fraction]) -> tuple[Fraction, Fraction]:
        """Bounds of the measured errors from those of the true errors at any time [m], [m/s].

        A mistimed measurement may be compared with the reference at the nominal instant, so that its motion counts.
        """
        parts = zip(errors, (self.slip_noise, self.rate_noise), task.reference_rates, strict=True)
        slip, rate = (error + noise + self.timing_error * motion for error, noise, motion in parts)
        return slip, rate

    @property
    def controller(self) -> "SampledController":
        """Law for `simulate` with the scheme ``explicit``, T_s, delay, lag and diffusion path.

        Raises
        ------
        UnsupportedError
            For a law with an implicit step: a sliding mode runs with its own controller and scheme.
        """
        if self.law.implicit_step is not None:
            raise UnsupportedError(
                "a certificate of a sliding mode states the implicit step, not the gains. Received a law with an "
                "implicit step. Use the controller of the design, or its gains, scale, weight and authority in the "
                "scheme compensated."
            )
        return laws.SampledController(law=self.law, step=self.step, **self.path, longest=self.longest_step)

    def loop(self, task: FaultPlant, model: NominalModel | None = None) -> PeriodicLoop:
        """Nominal error loop of a fault on its reference, with the model of the fault or another one."""
        loop = sampled_error_loop(
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
            loop = with_response_area(loop, gain, DiffusionPath(time=self.diffusion))
        box = starts(self.law, len(loop.states), self.initial_errors, (self.slip_noise, self.rate_noise))
        return replace(loop, start=box)


# ----------------------------------------------------------------------
# Inputs of a nominal loop and their bounds: acceleration, drift, implicit step, noise, start, truncation error.
#
# The bounds are derived in `quakedesign.guarantees.exact.small_gain`.

Gains = Mapping[tuple[str, str], tuple[Any, ...]]
NOISELESS: Mapping[str, Fraction] = MappingProxyType({})
LATE = "late"
_ZERO = Fraction(0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """An input of the nominal loop, and its bound F + Σ c_y·|y| over outputs y.

    Attributes
    ----------
    name : str
    constant : Fraction
        F, in the unit of the input.
    coefficients : mapping of str to Fraction
        c_y by the output.
    """

    name: str
    constant: Fraction
    coefficients: Mapping[str, Fraction]

    def rounded(self) -> "Channel":
        """The channel in floats, for estimates: float products are twenty times as fast."""
        shares: Mapping[str, Any] = {output: float(share) for output, share in self.coefficients.items()}
        own: Any = float(self.constant)
        return Channel(name=self.name, constant=own, coefficients=shares)


@dataclass(frozen=True, slots=True, kw_only=True)
class GainSpread:
    """Deviation of the input gain from that of a nominal loop [-].

    Attributes
    ----------
    present : Fraction
        Largest deviation at the present time.
    past : Fraction
        Largest further deviation at a time σ ago, divided by e^{ασ}.
    """

    present: Fraction
    past: Fraction


def channels_of(
    task: FaultPlant,
    implicit_step: ImplicitStep | None,
    step: Fraction,
    noise: Mapping[str, Fraction] = NOISELESS,
    spread: GainSpread | None = None,
    jitter: Fraction = _ZERO,
) -> tuple[Channel, ...]:
    """Inputs of the nominal loop of a fault that tracks its reference, with their bounds.

    `noise` bounds the noise inputs of the loop; `jitter` [s] is the timing error of the measurements.
    """
    force, drift, coupling = _task_inputs(task)
    half, implicit, aged = task.half_ranges, [], []
    if spread is not None:
        half = {**half, "push": spread.present}
        aged.append(Channel(name="aged", constant=_ZERO, coefficients={"push": spread.past}))
    if implicit_step is not None:
        share = implicit_step.half_range / step
        own = implicit_step.remainder + share * (noise.get("slip_noise", _ZERO) + jitter * task.reference_rates[0])
        implicit.append(Channel(name="root", constant=own, coefficients={"slip_error": share}))
    return (
        Channel(name="acceleration", constant=force, coefficients=half),
        Channel(name="drift", constant=drift, coefficients={"slip_rate_error": coupling}),
        *implicit,
        *aged,
        *_measurement_errors(task, noise, jitter),
    )


def _measurement_errors(task: FaultPlant, noise: Mapping[str, Fraction], jitter: Fraction) -> Iterator[Channel]:
    """Measurement errors at the nominal instants: noise, and motion during the timing error."""
    forces = _task_inputs(task)[0]
    slopes = [max(map(abs, ends)) for ends in (task.slip_chord, task.rate_chord, task.beta)]
    moves = {
        "slip_noise": (_ZERO, {"slip_rate_error": Fraction(1)}),
        "rate_noise": (forces, dict(zip(task.half_ranges, slopes, strict=True))),
    }
    for name, rate in zip(NOISES, task.reference_rates, strict=True):
        if name in noise:
            force, shares = moves[name]
            motion = {output: jitter * share for output, share in shares.items()} if jitter else {}
            yield Channel(name=name, constant=noise[name] + jitter * (rate + force), coefficients=motion)


def reference_channels(task: FaultPlant, names: Collection[str]) -> Iterator[Channel]:
    """Channels of reference, initial state and late pressures, as far as `names` contains them."""
    for name in ("reference", "reference_rate"):
        if name in names:
            yield Channel(name=name, constant=task.reference_rates[0], coefficients={})
    if "reference_acceleration" in names:
        yield Channel(name="reference_acceleration", constant=task.reference_rates[1], coefficients={})
    if "reference_jerk" in names:
        yield Channel(name="reference_jerk", constant=task.reference_jerk, coefficients={})
    if START in names:
        yield Channel(name=START, constant=Fraction(1), coefficients={})
    if LATE in names:
        yield Channel(name=LATE, constant=_ZERO, coefficients={"stepped": Fraction(1)})


def through_diffusion(channels: Sequence[Channel], gains: Gains) -> Iterator[Channel]:
    """Inputs of a loop with a diffusion path.

    Without a lag the truncation error fades after each step, and is a separate input; with a lag it is part of the
    acceleration.
    """
    fades = ("left_out", "left_out") in gains
    for channel in channels:
        share = {"left_out": channel.coefficients["push"]} if "push" in channel.coefficients else {}
        if fades and channel.name == "acceleration":
            yield from (channel, Channel(name="left_out", constant=_ZERO, coefficients=share))
        else:
            yield replace(channel, coefficients={**channel.coefficients, **share})
    for name in ("awaited", "awaited_told"):
        yield Channel(name=name, constant=_ZERO, coefficients={"left_out": Fraction(1)})


def _task_inputs(task: FaultPlant) -> tuple[Fraction, Fraction, Fraction]:
    """Bounds F of the acceleration [m/s²] and the drift [m/s³], and share of the slip-rate error [1/s²]."""
    if task.change is None:
        return task.reference_force + task.amplitude, task.drift, _ZERO
    law = task.friction
    if law.rate_slope:
        middle, half = (task.beta[0] + task.beta[1]) / 2, task.half_ranges["push"]
        return task.reference_force + half / middle * task.amplitude, task.drift + task.change / middle, _ZERO
    coupling = task.amplitude * max(law.weakening, law.strengthening) * task.area_per_mass[1] / task.authority
    return task.reference_force, task.drift + task.change + coupling * task.reference_rates[0], coupling
