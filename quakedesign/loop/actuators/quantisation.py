"""Finite resolution of a converter."""

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca

from quakedesign.fault.checks import require_positive
from quakedesign.loop.actuators.base import Option, SampledStage


@dataclass(frozen=True, kw_only=True)
class Quantisation(SampledStage):
    """Rounds to the nearest multiple of a quantum, halves upward.

    Attributes
    ----------
    quantum : float
        [Pa], positive.

    Raises
    ------
    ParameterError
    """

    name: ClassVar[str] = "quantisation"
    place: ClassVar[int] = 2
    options: ClassVar[tuple[Option, ...]] = (
        Option(name="quantum", unit="Pa", help="Resolution of the pressure, such as '1 kPa'."),
    )

    quantum: float

    def __post_init__(self) -> None:
        require_positive(quantum=self.quantum)

    @property
    def numbers(self) -> tuple[float, ...]:
        """The quantum [Pa]."""
        return (float(self.quantum),)

    def apply(self, numbers: Any, memory: list[Any], pressure: Any, step: float) -> tuple[Any, list[Any]]:
        """Nearest multiple; see `SampledStage.apply`."""
        (quantum,) = numbers
        return quantum * ca.floor(pressure / quantum + 0.5), memory
