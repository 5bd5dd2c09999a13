"""What a run comes to: tracked, slow slip, earthquake, diverged or opened."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from quakedesign.fault import Fault

KINDS = ("tracked", "slow slip", "earthquake", "diverged", "opened")
HARMLESS = ("tracked", "slow slip")
EARTHQUAKE_SHARE = 0.1
"""Of the natural peak: a run that goes faster than its reference by this share or more is an earthquake."""
TRACKED_SHARE = 0.01
"""Of the natural peak: a tracked run never goes faster than its reference by more."""
SLIP_BAND = 0.02
"""Of the target slip: a tracked run stays this close to its reference, the usual band for settling."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What one run comes to, as `OutcomeCriterion` decides.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    peak_slip_rate : float or None
        Largest |x2| of the whole run [m/s], or until the numbers of its law overflow; None where those of the plant do.
    share_of_natural : float or None
        The same over the peak of the natural earthquake [-]; None also for a fault that has none.
    """

    kind: str
    peak_slip_rate: float | None
    share_of_natural: float | None

    @property
    def harmless(self) -> bool:
        """Whether the run neither is an earthquake nor diverges nor opens the fault."""
        return self.kind in HARMLESS

    def to_dict(self) -> dict[str, Any]:
        """Keys of DESIGN.md."""
        return asdict(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class OutcomeCriterion:
    """What the outcome of a run is decided by.

    In this order, a run is

    - ``diverged``, if the motion of the plant overflows; ``opened``, if that event happened;
    - ``tracked``, if it has a controller, its slip error never exceeds 2 % of the target slip (over the time in which
      errors count), and its slip rate never exceeds the largest of the reference by more than 1 % of the natural peak
      (over the whole run);
    - an ``earthquake``, if its slip rate exceeds that of the reference by 10 % of the natural peak or more at any time;
    - ``slow slip`` otherwise, or ``diverged`` if the numbers of its law overflow, after which nothing is known.

    A stable fault has no natural earthquake. What it is compared with instead is the speed at which its own spring and
    mass would swing through the whole target slip, ω_n·d_max; friction with a state always with its `dynamic_rate`.

    Attributes
    ----------
    natural_peak : float or None
        Largest slip rate of the fault without control [m/s]; None for a stable fault.
    inertial_rate : float
        ω_n·d_max [m/s].
    reference_rate : float
        Largest r' [m/s].
    target_slip : float
        d_max [m].
    dynamic_rate : float, optional
        aσ'A/(η + √(km)) [m/s] of friction with a state, whose natural peak takes a cycle to know.
    """

    natural_peak: float | None
    inertial_rate: float
    reference_rate: float
    target_slip: float
    dynamic_rate: float | None = None

    @classmethod
    def of(cls, fault: Fault, natural_peak: float | None) -> "OutcomeCriterion":
        """Criterion of a fault and its task."""
        target = fault.reference.target_slip
        return cls(
            natural_peak=natural_peak or None,
            inertial_rate=fault.natural_frequency * target,
            reference_rate=fault.reference.largest_rate,
            target_slip=target,
        )

    def outcome(
        self, peak_slip_rate: float | None, max_slip_error: float | None, events: Mapping[str, float], *, followed: bool
    ) -> Outcome:
        """Outcome of one run.

        Parameters
        ----------
        peak_slip_rate : float or None
            [m/s]; None where the motion of the plant overflows.
        max_slip_error : float or None
            [m]; where none counts, because the run is too short, the slip rate alone decides.
        events : mapping of str to float
            Time of first occurrence [s].
        followed : bool
            Whether there was a controller, and so a reference to follow.
        """
        if peak_slip_rate is None:
            return Outcome(kind="diverged", peak_slip_rate=None, share_of_natural=None)
        share = peak_slip_rate / self.natural_peak if self.natural_peak else None
        kind = "opened" if "opening" in events else self._kind(peak_slip_rate, max_slip_error or 0.0, followed)
        kind = "diverged" if "diverged" in events and kind in HARMLESS else kind
        return Outcome(kind=kind, peak_slip_rate=peak_slip_rate, share_of_natural=share)

    def _kind(self, peak_slip_rate: float, slip_error: float, followed: bool) -> str:
        excess = peak_slip_rate - (self.reference_rate if followed else 0.0)
        scale = self.dynamic_rate or self.natural_peak or self.inertial_rate
        if followed and slip_error <= SLIP_BAND * self.target_slip and excess <= TRACKED_SHARE * scale:
            return "tracked"
        return "earthquake" if excess >= EARTHQUAKE_SHARE * scale else "slow slip"
