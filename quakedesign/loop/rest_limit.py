"""A limit of the pressure while the fault rests, so that a law does not wind up while friction holds it."""

from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from quakedesign.errors import ParameterError
from quakedesign.rationals import shortly


@dataclass(frozen=True, slots=True, kw_only=True)
class RestLimit:
    """While a fault rests, its pressure is no further below any earlier one than a width.

    And, beyond `width`, than `per_slip` for what the reference moved since. A loop whose pressure stays within P of p*,
    where dp*/dr is at most `per_slip`, never reaches a limit with a width of 2P: it takes nothing from what is proved.
    Where friction holds the fault, what is measured does not answer, and an integral goes on; ahead of its reference it
    clamps a fault that rests anyway, without end. Then the pressure is cut off here, and the law is told. As soon as
    the fault moves the law is free, whatever moves it.

    Attributes
    ----------
    width : Fraction
        [Pa].
    per_slip : Fraction
        [Pa/m].
    resolution : Fraction
        Slip between two samples, as it is measured, up to which a fault rests [m].
    STATES : tuple of str
        Largest p + per_slip·r of all samples so far [Pa], r being the reference, which never falls, and the slip that
        was measured last [m].

    Raises
    ------
    ParameterError
        For a width that is not positive, or another number that is negative.
    """

    STATES: ClassVar[tuple[str, ...]] = ("highest_pressure", "last_slip")
    UNITS: ClassVar[tuple[str, ...]] = ("Pa", "m")

    width: Fraction
    per_slip: Fraction
    resolution: Fraction = Fraction(0)

    def __post_init__(self) -> None:
        if self.width <= 0 or min(self.per_slip, self.resolution) < 0:
            raise ParameterError(
                "a limit at rest needs a positive width, and no other number below 0. Received "
                f"{shortly(self.width)} Pa, {shortly(self.per_slip)} Pa/m and {shortly(self.resolution)} m. "
                "Check their signs."
            )
