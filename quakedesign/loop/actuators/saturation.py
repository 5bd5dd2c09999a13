"""Largest and smallest pressure that the pump can hold."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import casadi as ca

from quakedesign.errors import ParameterError
from quakedesign.loop.actuators.base import Option, SampledStage


@dataclass(frozen=True, kw_only=True)
class Saturation(SampledStage):
    """Cuts the pressure off at two bounds (ERRATA 23).

    Attributes
    ----------
    lowest, highest : float
        [Pa]; zero, the pressure before injection, must lie between them.

    Raises
    ------
    ParameterError
    """

    name: ClassVar[str] = "saturation"
    limits: ClassVar[bool] = True
    place: ClassVar[int] = 3
    options: ClassVar[tuple[Option, ...]] = (
        Option(
            name="saturation",
            unit="Pa",
            help="Largest pressure, such as '20 MPa', and largest withdrawal unless that is given.",
        ),
        Option(name="withdrawal", unit="Pa", help="Largest decrease of the pressure; 0 for a pump that only injects."),
    )

    lowest: float
    highest: float

    def __post_init__(self) -> None:
        finite = math.isfinite(self.lowest) and math.isfinite(self.highest)
        if not (finite and self.lowest <= 0 <= self.highest and self.lowest < self.highest):
            raise ParameterError(
                "lowest and highest pressure must be finite, with 0 between them. "
                f"Received {self.lowest!r} Pa and {self.highest!r} Pa."
            )

    @classmethod
    def asked(cls, step: float, *, saturation: float, withdrawal: float | None) -> Self:  # type: ignore[override]
        """See `Stage.asked`."""
        return cls(lowest=0.0 - (saturation if withdrawal is None else withdrawal), highest=saturation)

    @property
    def numbers(self) -> tuple[float, ...]:
        """The bounds [Pa]."""
        return float(self.lowest), float(self.highest)

    def apply(self, numbers: Any, memory: list[Any], pressure: Any, step: float) -> tuple[Any, list[Any]]:
        """Pressure within the bounds; see `SampledStage.apply`."""
        lowest, highest = numbers
        return ca.fmin(ca.fmax(pressure, lowest), highest), memory
