"""How far the instants of a loop of samples are off its schedule."""

from dataclasses import dataclass
from fractions import Fraction

from quakedesign.errors import ParameterError


@dataclass(frozen=True, slots=True, kw_only=True)
class Instants:
    """What is due at an instant happens within some time of it, each time anew, whatever the course.

    Attributes
    ----------
    measured : Fraction
        By how much a measurement is early or late, at most [s]; the first one is at its instant.
    arrived : Fraction
        By how much the valve's pressure begins to change early or late, at most [s].
    ramp : Fraction
        Time in which it is what was asked for, at most [s]; until then it changes no slower than |change|/ramp.
    """

    measured: Fraction = Fraction(0)
    arrived: Fraction = Fraction(0)
    ramp: Fraction = Fraction(0)

    def require_within(self, step: Fraction, part: Fraction) -> None:
        """Refuse what may reach another event, for pressures that are due some part of a step after a sample [s].

        Raises
        ------
        ParameterError
        """
        if min(self.measured, self.arrived, self.ramp) < 0 or 2 * self.measured > step:
            raise ParameterError(
                f"jitter must be 0 or more and at most half a step of {float(step):.4g} s. Received "
                f"{float(self.measured):.4g} s of measurements, {float(self.arrived):.4g} s of pressures. Shorten it."
            )
        after = self.arrived + self.ramp
        if self.arrived > (part or step) or after > step - part or self.arrived + after > step:
            raise ParameterError(
                "a pressure must begin and end to change between two samples as they are due. Received one due "
                f"{float(part):.4g} s after a sample, every {float(step):.4g} s, off by {float(self.arrived):.4g} s, "
                f"that changes for {float(self.ramp):.4g} s. Shorten that, or change the delay."
            )
