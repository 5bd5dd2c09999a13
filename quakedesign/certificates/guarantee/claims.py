"""What is claimed of a loop, and whether it follows from bounds."""

from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor, log10
from typing import Any

from quakedesign.bounds import LowerBound, UpperBound
from quakedesign.certificates.claim import Verdict
from quakedesign.certificates.guarantee.small_gain import Bounds
from quakedesign.certificates.guarantee.task import Task

_DIGITS = 4
_ENDS = ("least_pressure", "largest_pressure", "least_asked", "largest_asked")
MARGIN = Fraction(1001, 1000)  # so that another way to bound the same integrals proves the same claim


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
            slip_error=UpperBound(above(self.slip_error * MARGIN)),
            slip_rate_error=UpperBound(above(self.slip_rate_error * MARGIN)),
            peak_slip_rate=UpperBound(above(self.peak_slip_rate * MARGIN)),
            largest_step=None if step is None else UpperBound(above(step * MARGIN)),
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


def _covers(step: UpperBound | None, other: UpperBound | None) -> bool:
    """Whether a largest step follows from another."""
    return step is None or (other is not None and step >= other)


def _wider(low: LowerBound, high: UpperBound) -> tuple[LowerBound, UpperBound]:
    room = (high - low) * (MARGIN - 1)
    return LowerBound(-above(room - low)), UpperBound(above(high + room))


def above(value: Fraction) -> Fraction:
    """At least a rational, with four digits."""
    if not value:
        return value
    scale = Fraction(10) ** (floor(log10(abs(value))) - _DIGITS + 1)
    return ceil(value / scale) * scale
