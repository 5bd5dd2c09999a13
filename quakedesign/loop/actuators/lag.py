"""Inertia of pump and pipe."""

from dataclasses import dataclass
from typing import Any, ClassVar, Self

from quakedesign.fault.checks import require_positive
from quakedesign.loop.actuators.base import FlowStage, Option


@dataclass(frozen=True, kw_only=True)
class Lag(FlowStage):
    """A first-order lag: τq' = p − q.

    Attributes
    ----------
    time_constant : float
        τ [s], positive.

    Raises
    ------
    ParameterError
    """

    name: ClassVar[str] = "lag"
    place: ClassVar[int] = 5
    options: ClassVar[tuple[Option, ...]] = (
        Option(name="lag", unit="s", help="Time constant of pump and pipe, such as '1 s'."),
    )

    time_constant: float

    def __post_init__(self) -> None:
        require_positive(time_constant=self.time_constant)

    @classmethod
    def asked(cls, step: float, *, lag: float) -> Self:  # type: ignore[override]
        """See `Stage.asked`."""
        return cls(time_constant=lag)

    @property
    def numbers(self) -> tuple[float, ...]:
        """1/τ [1/s]."""
        return (1 / self.time_constant,)

    @property
    def start(self) -> tuple[float, ...]:
        """Pressure at the outlet [Pa]."""
        return (0.0,)

    @property
    def fastest(self) -> float:
        """1/τ [1/s]."""
        return 1 / self.time_constant

    def rates(self, numbers: Any, memory: list[Any], pressure: Any) -> list[Any]:
        """See `FlowStage.rates`."""
        return [numbers[0] * (pressure - memory[0])]

    def output(self, numbers: Any, memory: list[Any], pressure: Any) -> Any:
        """See `FlowStage.output`."""
        return memory[0]
