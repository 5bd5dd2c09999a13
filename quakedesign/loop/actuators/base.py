"""Base classes of actuator stages."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from quakedesign.loop.sensing.measurement import Entries


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """Command-line option of a stage.

    Attributes
    ----------
    name : str
        A Python identifier.
    unit : str
        SI unit; empty for a whole number.
    help : str
        Help text, one sentence.
    default : float or None
        Default value; None if the option may be omitted.
    """

    name: str
    unit: str
    help: str
    default: float | None = None


class Stage(ABC):
    """One element of a chain that carries a pressure [Pa] from the controller to the fault.

    Its numbers and its memory are entries of the state vector of the compiled loop, so that one compilation serves all
    their values; the methods work on CasADi SX and on floats.

    Attributes
    ----------
    name : str
    limits : bool
        Whether an output that differs from the input means that the commanded pressure exceeds a limit, so that the
        integral states of the law must not wind up.
    options : tuple of Option
        Command-line options; the first, if not at its default, adds the stage. Empty: a stage for Python only.
    rank : int
        Position in the signal order, lower first, of a stage that options or `Actuator.completed` add; sampled stages
        precede dynamic ones for any rank.
    """

    name: ClassVar[str]
    limits: ClassVar[bool] = False
    options: ClassVar[tuple[Option, ...]] = ()
    rank: ClassVar[int] = 100

    @classmethod
    def from_options(cls, step: float, **values: Any) -> Self:
        """Stage from the values of its `options`, for a sampling period [s]; by default these values are its fields."""
        return cls(**values)

    @property
    def numbers(self) -> tuple[float, ...]:
        """Parameters in SI units, as arguments of the other methods."""
        return ()

    @property
    def start(self) -> tuple[float, ...]:
        """Initial memory of the stage, with zero pressure."""
        return ()


class SampledStage(Stage):
    """A stage that acts once per sample.

    Attributes
    ----------
    part : float
        Share of a sampling period, below 1, after which the output of a sample acts; until then the previous one acts.
    """

    part: float = 0.0

    @abstractmethod
    def apply(self, numbers: Entries, memory: Entries, pressure: Any, step: float) -> tuple[Any, Entries]:
        """Output pressure [Pa] of the stage over one sample of length `step` [s], and the memory afterwards."""


class FlowStage(Stage):
    """A dynamic stage, integrated together with the plant."""

    @property
    @abstractmethod
    def fastest(self) -> float:
        """Largest rate of decay [1/s]; it limits the length of a substep."""

    @abstractmethod
    def rates(self, numbers: Entries, memory: Entries, pressure: Any) -> Entries:
        """Time derivative of the memory under a pressure [Pa] at the inlet."""

    @abstractmethod
    def output(self, numbers: Entries, memory: Entries, pressure: Any) -> Any:
        """Pressure [Pa] at the outlet."""

    @property
    def stores(self) -> bool:
        """Whether `flows` contains volume and flow rate."""
        return type(self).flows is not FlowStage.flows

    def flows(self, numbers: Entries, memory: Entries, pressure: Any) -> dict[str, Any]:
        """Further signals by the names of `FLOWS`; none unless the stage stores fluid."""
        return {}


FLOWS = {"injected_volume": ("injected volume", "m^3"), "flow_rate": ("injected flow rate", "m^3/s")}
