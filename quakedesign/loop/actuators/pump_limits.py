"""Limits of a pump as actuator stages: quantisation, rate limit and saturation of the pressure."""

import math
from typing import Any, ClassVar, Self

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.fault.model import require_positive
from quakedesign.loop.actuators.base import Option, SampledStage
from quakedesign.loop.sensing.measurement import Entries


@checked_dataclass(frozen=True, kw_only=True)
class Quantisation(SampledStage):
    """Rounds to the nearest multiple of a quantum, halves upward.

    Attributes
    ----------
    quantum : float
        [Pa], positive.
    """

    name: ClassVar[str] = "quantisation"
    rank: ClassVar[int] = 2
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

    def apply(self, numbers: Entries, memory: Entries, pressure: Any, step: float) -> tuple[Any, Entries]:
        """Nearest multiple; see `SampledStage.apply`."""
        import casadi as ca

        (quantum,) = numbers
        return quantum * ca.floor(pressure / quantum + 0.5), memory


@checked_dataclass(frozen=True, kw_only=True)
class RateLimit(SampledStage):
    """Limits the change of the pressure from one sample to the next; the initial pressure is zero.

    Attributes
    ----------
    rate : float
        [Pa/s], positive.
    """

    name: ClassVar[str] = "rate-limit"
    limits: ClassVar[bool] = True
    rank: ClassVar[int] = 4
    options: ClassVar[tuple[Option, ...]] = (
        Option(name="rate_limit", unit="Pa/s", help="Fastest change of the pressure, such as '1 MPa/s'."),
    )

    rate: float

    def __post_init__(self) -> None:
        require_positive(rate=self.rate)

    @classmethod
    def from_options(cls, step: float, *, rate_limit: float) -> Self:  # type: ignore[override]
        """See `Stage.from_options`."""
        return cls(rate=rate_limit)

    @property
    def numbers(self) -> tuple[float, ...]:
        """The limit [Pa/s]."""
        return (float(self.rate),)

    @property
    def start(self) -> tuple[float, ...]:
        """Initial pressure [Pa]."""
        return (0.0,)

    def apply(self, numbers: Entries, memory: Entries, pressure: Any, step: float) -> tuple[Any, Entries]:
        """Rate-limited pressure; see `SampledStage.apply`."""
        import casadi as ca

        (rate,), (before,) = numbers, memory
        reached = before + ca.fmin(ca.fmax(pressure - before, -rate * step), rate * step)
        return reached, [reached]


@checked_dataclass(frozen=True, kw_only=True)
class Saturation(SampledStage):
    """Saturates the pressure at two bounds (ERRATA 23).

    Attributes
    ----------
    lowest, highest : float
        [Pa], different; 0, the pressure before injection, lies between them or is one of them.
    """

    name: ClassVar[str] = "saturation"
    limits: ClassVar[bool] = True
    rank: ClassVar[int] = 3
    options: ClassVar[tuple[Option, ...]] = (
        Option(
            name="saturation",
            unit="Pa",
            help="Largest injection pressure above the initial pressure, such as '20 MPa'; also the largest withdrawal "
            "unless --withdrawal is given.",
        ),
        Option(
            name="withdrawal",
            unit="Pa",
            help="Largest withdrawal below the initial pressure; 0 for a pump that only injects.",
        ),
    )

    lowest: float
    highest: float

    def __post_init__(self) -> None:
        finite = math.isfinite(self.lowest) and math.isfinite(self.highest)
        if not (finite and self.lowest <= 0 <= self.highest and self.lowest < self.highest):
            raise ParameterError(
                "lowest and highest pressure must be finite and different, with 0 between them. "
                f"Received {self.lowest!r} Pa and {self.highest!r} Pa."
            )

    @classmethod
    def from_options(cls, step: float, *, saturation: float, withdrawal: float | None) -> Self:  # type: ignore[override]
        """See `Stage.from_options`."""
        return cls(lowest=0.0 - (saturation if withdrawal is None else withdrawal), highest=saturation)

    @property
    def numbers(self) -> tuple[float, ...]:
        """The bounds [Pa]."""
        return float(self.lowest), float(self.highest)

    def apply(self, numbers: Entries, memory: Entries, pressure: Any, step: float) -> tuple[Any, Entries]:
        """Pressure within the bounds; see `SampledStage.apply`."""
        import casadi as ca

        lowest, highest = numbers
        return ca.fmin(ca.fmax(pressure, lowest), highest), memory
