"""What the pump at the valve can do; a loop that is proved never asks for more."""

from dataclasses import dataclass, fields
from fractions import Fraction

from quakedesign.bounds import LowerBound, UpperBound
from quakedesign.errors import ParameterError
from quakedesign.rationals import shortly


@dataclass(frozen=True, slots=True, kw_only=True)
class Pump:
    """Limits of the pressure at the valve; None where there are none.

    Attributes
    ----------
    least, largest : Fraction, optional
        [Pa]; 0, the pressure at the start, lies between them. Both or none.
    rate : Fraction, optional
        How fast it goes to a pressure that is asked for, at least, and the fastest that it has to [Pa/s].

    Raises
    ------
    ParameterError
    """

    least: Fraction | None = None
    largest: Fraction | None = None
    rate: Fraction | None = None

    def __post_init__(self) -> None:
        low, high = self.least or Fraction(0), self.largest or Fraction(0)
        alone = (self.least is None) != (self.largest is None)
        if alone or not low <= 0 <= high or (self.least is not None and low == high):
            raise ParameterError(
                "a pump's least and largest pressure must have 0 between them. Received "
                f"{shortly(low)} Pa and {shortly(high)} Pa. Check their signs."
            )
        if self.rate is not None and self.rate <= 0:
            raise ParameterError(
                f"the rate of a pump must be positive. Received {shortly(self.rate)} Pa/s. Leave it out for any."
            )

    @property
    def limits(self) -> tuple[Fraction, Fraction] | None:
        """Least and largest pressure [Pa]."""
        return None if self.least is None or self.largest is None else (self.least, self.largest)

    def exceeded(self, low: LowerBound, high: UpperBound) -> str:
        """Why pressures between two claims are more than it can hold; empty where they are not."""
        if self.limits is None or (self.limits[0] <= low and high <= self.limits[1]):
            return ""
        return (
            f"pressures from {low.quantity('Pa')} to {high.quantity('Pa')} may be asked for, which a pump of "
            f"{self._range()} cannot all hold"
        )

    def too_slow(self, step: UpperBound | None, time: Fraction) -> str:
        """Why it may take longer than a time [s] to change by what is claimed; empty where it does not."""
        if self.rate is None or (step is not None and step <= self.rate * time):
            return ""
        most = "of any size" if step is None else f"of {step.quantity('Pa')}"
        return (
            f"changes {most} from one sample to the next may be asked for, which a pump of "
            f"{LowerBound(self.rate).quantity('Pa/s')} does not make in {LowerBound(time).quantity('s')}"
        )

    def to_dict(self) -> dict[str, str]:
        """Exact numbers as texts."""
        given = {part.name: getattr(self, part.name) for part in fields(self)}
        return {name: str(value) for name, value in given.items() if value is not None}

    def words(self) -> str:
        """For people."""
        of = [] if self.limits is None else [self._range()]
        of += [] if self.rate is None else [LowerBound(self.rate).quantity("Pa/s")]
        return f"with a pump of {', '.join(of)}, whose limits are never reached"

    def _range(self) -> str:
        """On the inner side."""
        assert self.limits is not None
        low, high = self.limits
        return f"{UpperBound(low).quantity('Pa')} to {LowerBound(high).quantity('Pa')}"
