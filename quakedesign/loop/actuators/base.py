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
        As an identifier of Python.
    unit : str
        SI; empty for a whole number.
    help : str
        A sentence.
    default : float or None
        What it is unless given; None where it is left out.
    """

    name: str
    unit: str
    help: str
    default: float | None = None


class Stage(ABC):
    """One element of a chain that carries a pressure [Pa] from the controller to the fault.

    Its numbers and its memory are entries of the vector that the compiled loop carries along, so that one machine
    code serves all of them; the methods work on CasADi SX and on floats.

    Attributes
    ----------
    name : str
    limits : bool
        Whether an output that differs from the input means that the law asked for more than there is, so that its
        integral states must not wind up.
    options : tuple of Option
        Of the command line; a stage is there where the first is not its default. None: only Python has the stage.
    place : int
        Where the command line puts it, along the signal: behind what acts as it does and has a smaller one.
    """

    name: ClassVar[str]
    limits: ClassVar[bool] = False
    options: ClassVar[tuple[Option, ...]] = ()
    place: ClassVar[int] = 100

    @classmethod
    def asked(cls, step: float, **values: Any) -> Self:
        """Stage from the values of its `options`, for a sampling period [s]; those are its fields unless overridden."""
        return cls(**values)

    @property
    def numbers(self) -> tuple[float, ...]:
        """Parameters in SI units, as the other methods expect them."""
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
        Share of a sampling period, below 1, after which what leaves it at a sample acts; until then the last one does.
    """

    part: float = 0.0

    @abstractmethod
    def apply(self, numbers: Entries, memory: Entries, pressure: Any, step: float) -> tuple[Any, Entries]:
        """Pressure [Pa] that leaves the stage over one sample of length `step` [s], and the memory afterwards."""


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
