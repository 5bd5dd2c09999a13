"""Limits of every controller as values, each beside what a designed one is proved to do."""

from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from quakedesign.bounds import Bound, LowerBound, UpperBound
from quakedesign.certificates.guarantee import Guarantee, task_of
from quakedesign.certificates.guarantee.held import Around
from quakedesign.certificates.impossibility import Noise, smallest_peak
from quakedesign.certificates.slow_sliding import SlidingGuarantee
from quakedesign.certificates.slow_sliding.push import SlidingPush
from quakedesign.errors import ParameterError, require_known
from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.simulation.memoryless_earthquake import natural_peak
from quakedesign.synthesis.guaranteed import MEASURED

_POINTS = 24  # of the curve of smallest peaks

KNOWING = "all controllers, linear or not, that know fault, slip, slip rate and disturbance exactly up to the sample"
TOLD = "all controllers, linear or not, that know the fault and are told up to the sample no more than {}"
WAITING = "all controllers, linear or not, all-knowing from the first sample after the disturbance begins"
QUANTITIES = {
    "peak_slip_rate_error": ("slip-rate error", "m/s"),
    "largest_step": ("T_s", "s"),
    "largest_delay": ("delay", "s"),
    "largest_diffusion_time": ("diffusion time L^2/D", "s"),
    "farthest_well": ("distance of the well", "m"),
    "smallest_pressure": ("withdrawal", "Pa"),
}
"""Title and unit of every limit, by the name of its field."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """One quantity, its limit for all controllers, and how far designed ones have a guarantee.

    Attributes
    ----------
    title : str
    unit : str
    impossible_beyond : LowerBound or UpperBound or None
        A LowerBound: nothing smaller is possible; an UpperBound: nothing larger; None: no limit is known.
    proved_up_to : LowerBound or UpperBound or None
        Of the designs that were tried, the best with a guarantee; None where none was found.
    holds_for : str
        Controllers for which it is impossible.
    """

    title: str
    unit: str
    impossible_beyond: Bound | None
    proved_up_to: Bound | None
    holds_for: str

    def to_dict(self) -> dict[str, str | None]:
        """Decimal texts, rounded outwards."""
        beyond, proved = self.impossible_beyond, self.proved_up_to
        return {
            "impossible_beyond": None if beyond is None else str(beyond),
            "proved_up_to": None if proved is None else str(proved),
            "unit": self.unit,
            "holds_for": self.holds_for,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """What controllers are told of slip and slip rate, at all times up to a sample.

    Attributes
    ----------
    measured : str
        ``slip-and-rate`` or ``slip``.
    slip_noise, rate_noise : Fraction
        Bounds of what measured slip and slip rate are off [m], [m/s], whatever the course.
    setup : Around
        What else is between law and fault, or off, for designs.

    Raises
    ------
    ParameterError
        For a negative bound, another name, or noise of a slip rate that is not measured.
    """

    measured: str = MEASURED[0]
    slip_noise: Fraction = Fraction(0)
    rate_noise: Fraction = Fraction(0)
    setup: Around = field(default_factory=Around)

    def __post_init__(self) -> None:
        require_known(self.measured, MEASURED[:2], "measured")
        noise = f"{float(self.slip_noise):.4g} m and {float(self.rate_noise):.4g} m/s"
        if min(self.slip_noise, self.rate_noise) < 0:
            raise ParameterError(f"a bound of noise must be 0 or more. Received {noise}. Check their signs.")
        if self._alone and self.rate_noise:
            raise ParameterError(
                f"noise of the slip rate needs one that is measured. Received {noise}, measured {self.measured}. Leave "
                "it out."
            )

    @property
    def _alone(self) -> bool:
        return self.measured == MEASURED[1]

    @property
    def noisy(self) -> bool:
        """Whether noise hides anything: what is known exactly of the slip rate tells as much as both."""
        return bool(self.slip_noise and (self._alone or self.rate_noise))

    @property
    def bounds(self) -> Noise:
        """Of `smallest_peak`."""
        return {"slip_noise": self.slip_noise, "rate_noise": None if self._alone else self.rate_noise}

    @property
    def around(self) -> dict[str, Any]:
        """Of a design."""
        noise = {"slip_noise": self.slip_noise, "rate_noise": self.rate_noise}
        return {**self.setup, "measured": self.measured, **noise}

    def words(self) -> str:
        """For people: rounded up, since who is told less can do less."""
        slip = f"the slip within {UpperBound(self.slip_noise).quantity('m')}"
        return slip if self._alone else f"{slip}, the slip rate within {UpperBound(self.rate_noise).quantity('m/s')}"

    def knowing(self) -> str:
        """Controllers for which a smallest slip-rate error holds."""
        return TOLD.format(self.words()) if self.noisy else KNOWING


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of a fault, for the worst friction and parameters of its box.

    Attributes
    ----------
    fault : Fault
    withdrawal : Fraction
        Largest withdrawal [Pa], P of −P ≤ p.
    diffusivity : Fraction
        [m²/s].
    slip_error : UpperBound or None
        Within which the smallest slip-rate error is meant [m]; None for any bounded slip error.
    peak_slip_rate_error, largest_step, largest_delay, largest_diffusion_time, farthest_well, smallest_pressure : Limit
        Each of the latter three and the delay at the fault's T_s.
    proved : tuple of Guarantee
        Of the designs without delay that were found on the way, by T_s.
    told : Told
        What controllers are told, for the slip-rate error and designs; all others may know everything.
    """

    fault: Fault
    withdrawal: Fraction
    diffusivity: Fraction
    slip_error: UpperBound | None
    peak_slip_rate_error: Limit
    largest_step: Limit
    largest_delay: Limit
    largest_diffusion_time: Limit
    farthest_well: Limit
    smallest_pressure: Limit
    proved: tuple[Guarantee, ...]
    told: Told

    def __repr__(self) -> str:
        return f"Limits({self.fault.name}: {', '.join(self.named())})"

    @property
    def against(self) -> str:
        """The disturbances that are meant."""
        return f"any disturbance of at most {float(self.fault.disturbance_bounds[0]):.6g} m/s^2"

    @property
    def achieved(self) -> list[tuple[Fraction, UpperBound]]:
        """T_s [s] and proved slip-rate error [m/s] of the designs that were found on the way, by T_s."""
        return sorted((g.held.step, g.claims.slip_rate_error) for g in self.proved)

    def named(self) -> dict[str, Limit]:
        """All limits by name."""
        return {name: getattr(self, name) for name in QUANTITIES}

    @property
    def natural_peak(self) -> float | None:
        """Slip rate [m/s] of the natural earthquake, which is simulated; None where there is none."""
        return natural_peak(self.fault)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, SI; what is proved as decimal texts, rounded outwards."""
        return {
            "fault": self.fault.name,
            "box": self.fault.box.name,
            "disturbance": float(self.fault.disturbance_bounds[0]),
            "class": "amplitude",
            "step": self.fault.sampling_time,
            "withdrawal": float(self.withdrawal),
            "diffusivity": float(self.diffusivity),
            "measured": self.told.measured,
            "slip_noise": str(self.told.slip_noise),
            "rate_noise": str(self.told.rate_noise),
            "slip_error": None if self.slip_error is None else str(self.slip_error),
            **{name: limit.to_dict() for name, limit in self.named().items()},
        }

    def smallest_peaks(self, *, told: bool = True) -> list[tuple[Fraction, LowerBound]]:
        """T_s [s] from a tenth of the fault's on, and the slip-rate error [m/s] that no controller goes below.

        Of controllers that are `told` no more than these, or that know everything.
        """
        task, noise = task_of(self.fault), (self.told if told else Told()).bounds
        peaks = [(step, smallest_peak(task, step, **noise)) for step in self._steps()]
        return [(step, peak.slip_rate_error) for step, peak in peaks if peak is not None]

    def _steps(self) -> list[Fraction]:
        first = rational(self.fault.sampling_time) / 10
        last = float(self.largest_step.impossible_beyond or 10_000 * first)
        ratio = max(last / float(first), 100.0) ** (1 / _POINTS)
        return [Fraction(f"{float(first) * ratio**i:.4g}") for i in range(_POINTS + 1)]


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingLimits(Limits):
    """Limits of a fault in slow sliding along its task, of its nominal plant linearised there.

    Attributes
    ----------
    push : SlidingPush
    guarantee : SlidingGuarantee or None
    rock : Fraction
        L²/D [s] of the well that was asked about; 0 without one.
    """

    push: SlidingPush
    guarantee: SlidingGuarantee | None
    rock: Fraction

    @property
    def beyond(self) -> bool:
        """Whether no controller can hold the fault through the rock that was asked about."""
        farthest = self.largest_diffusion_time.impossible_beyond
        return farthest is not None and self.rock > farthest

    @property
    def against(self) -> str:
        """The disturbances that are meant."""
        return f"any shear stress of at most {UpperBound(self.push.amplitude).quantity('Pa')}"

    @property
    def achieved(self) -> list[tuple[Fraction, UpperBound]]:
        """T_s [s] and proved slip-rate error [m/s] of the guarantee."""
        found = self.guarantee
        return [] if found is None else [(found.held.step, above_the_reference(found))]

    @property
    def natural_peak(self) -> float | None:
        """None: it takes a cycle to know."""
        return None

    def to_dict(self) -> dict[str, Any]:
        """Plain values, SI; what is proved as decimal texts, rounded outwards."""
        return Limits.to_dict(self) | {"disturbance": None, "stress": float(self.push.amplitude)}

    def smallest_peaks(self, *, told: bool = True) -> list[tuple[Fraction, LowerBound]]:
        """T_s [s] from a tenth of the fault's on, and the slip-rate error [m/s] that no controller goes below."""
        return [(step, self.push.smallest_rate_error(step)) for step in self._steps()]


def above_the_reference(found: SlidingGuarantee) -> UpperBound:
    """What is proved of the slip rate, less V [m/s]."""
    return UpperBound(found.peak_slip_rate - found.task.rate)
