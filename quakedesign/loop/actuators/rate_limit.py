"""Fastest change of pressure that the pump can make."""

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import casadi as ca

from quakedesign.fault.checks import require_positive
from quakedesign.loop.actuators.base import Option, SampledStage


@dataclass(frozen=True, kw_only=True)
class RateLimit(SampledStage):
    """Limits the change from one sample to the next, from zero at the start.

    Attributes
    ----------
    rate : float
        [Pa/s], positive.

    Raises
    ------
    ParameterError
    """

    name: ClassVar[str] = "rate-limit"
    limits: ClassVar[bool] = True
    place: ClassVar[int] = 4
    options: ClassVar[tuple[Option, ...]] = (
        Option(name="rate_limit", unit="Pa/s", help="Fastest change of the pressure, such as '1 MPa/s'."),
    )

    rate: float

    def __post_init__(self) -> None:
        require_positive(rate=self.rate)

    @classmethod
    def asked(cls, step: float, *, rate_limit: float) -> Self:  # type: ignore[override]
        """See `Stage.asked`."""
        return cls(rate=rate_limit)

    @property
    def numbers(self) -> tuple[float, ...]:
        """The limit [Pa/s]."""
        return (float(self.rate),)

    @property
    def start(self) -> tuple[float, ...]:
        """Pressure held before the start [Pa]."""
        return (0.0,)

    def apply(self, numbers: Any, memory: list[Any], pressure: Any, step: float) -> tuple[Any, list[Any]]:
        """Pressure that can be reached; see `SampledStage.apply`."""
        (rate,), (held,) = numbers, memory
        reached = held + ca.fmin(ca.fmax(pressure - held, -rate * step), rate * step)
        return reached, [reached]
