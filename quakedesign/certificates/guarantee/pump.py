"""What the pump at the valve can do; a loop that is proved never asks for more."""

from dataclasses import dataclass
from fractions import Fraction

from quakedesign.bounds import LowerBound, UpperBound
from quakedesign.errors import ParameterError


@dataclass(frozen=True, slots=True, kw_only=True)
class Pump:
    """Limits of the pressure at the valve.

    Attributes
    ----------
    least, largest : Fraction
        [Pa]; 0, the pressure at the start, lies between them.

    Raises
    ------
    ParameterError
    """

    least: Fraction
    largest: Fraction

    def __post_init__(self) -> None:
        if not self.least <= 0 <= self.largest or self.least == self.largest:
            raise ParameterError(
                "a pump's least and largest pressure must have 0 between them. Received "
                f"{float(self.least):.4g} Pa and {float(self.largest):.4g} Pa. Check their signs."
            )

    def exceeded(self, low: LowerBound, high: UpperBound) -> str:
        """Why pressures between two claims are more than it can do; empty where they are not."""
        if self.least <= low and high <= self.largest:
            return ""
        pump = f"{UpperBound(self.least).quantity('Pa')} to {LowerBound(self.largest).quantity('Pa')}"
        return (
            f"pressures from {low.quantity('Pa')} to {high.quantity('Pa')} may be asked for, which a pump of {pump} "
            "cannot all hold"
        )

    def to_dict(self) -> dict[str, str]:
        """Exact numbers as texts."""
        return {"least": str(self.least), "largest": str(self.largest)}

    def words(self) -> str:
        """For people."""
        return (
            f"with a pump of {UpperBound(self.least).quantity('Pa')} to {LowerBound(self.largest).quantity('Pa')}, "
            "whose limits are never reached"
        )
