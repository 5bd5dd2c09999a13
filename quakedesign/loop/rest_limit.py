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
    the fault moves this is over, whatever moves it. Pressures that are proved never to be passed are cut off as well,
    at rest and after it, unless the fault moves faster than is proved: then the law is free.

    Attributes
    ----------
    width : Fraction
        [Pa].
    per_slip : Fraction
        [Pa/m].
    resolution : Fraction
        Slip between two samples, as it is measured, up to which a fault rests [m].
    least, largest : Fraction, optional
        Pressures that are never passed where the loop is as it is proved [Pa]; both or none.
    fastest : Fraction
        Slip between two samples, as it is measured, up to which they are not passed [m].
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
    least: Fraction | None = None
    largest: Fraction | None = None
    fastest: Fraction = Fraction(0)

    @property
    def range(self) -> tuple[Fraction, Fraction, Fraction] | None:
        """Least and largest pressure, and up to which slip between two samples; None without them."""
        return None if self.least is None or self.largest is None else (self.least, self.largest, self.fastest)

    def __post_init__(self) -> None:
        if (self.least is None) != (self.largest is None) or not (self.least or 0) <= 0 <= (self.largest or 0):
            ends = [None if end is None else f"{float(end):.4g} Pa" for end in (self.least, self.largest)]
            raise ParameterError(
                "least and largest pressure of a limit at rest must have 0 between them, both or none of them given. "
                f"Received {ends[0]} and {ends[1]}. Change them."
            )
        if self.width <= 0 or min(self.per_slip, self.resolution, self.fastest) < 0:
            raise ParameterError(
                "a limit at rest needs a positive width, and no other number below 0. Received "
                f"{shortly(self.width)} Pa, {shortly(self.per_slip)} Pa/m and {shortly(self.resolution)} m. "
                "Check their signs."
            )
