"""What every scheme offers."""

from abc import ABC, abstractmethod
from typing import Any, ClassVar

from quakedesign.simulation.closed_loop import ClosedLoop
from quakedesign.simulation.integrators import Integrator


class Scheme(ABC):
    """One step of length T_s of a closed loop, written in CasADi SX.

    The state of a run is [x1, x2, ξ, memory], where the memory belongs to the scheme: what a controller keeps from one
    sample to the next, and numbers that are carried along so that one machine code serves all of their values.

    Attributes
    ----------
    name : str
    """

    name: ClassVar[str]

    def memory(self, loop: ClosedLoop, step: float) -> dict[str, float]:
        """Entries of the memory with their values at the start; none unless told."""
        return {}

    @abstractmethod
    def pressure(self, loop: ClosedLoop, counter: Any, state: Any, step: float) -> Any:
        """Pressure [Pa] in the fault at the start of step number `counter`."""

    @abstractmethod
    def advance(self, loop: ClosedLoop, method: type[Integrator], counter: Any, state: Any, step: float) -> Any:
        """State at the end of step number `counter`, which starts at counter·step [s]."""

    def rates(self, loop: ClosedLoop, counter: Any, state: Any, step: float) -> Any:
        """Time derivative of the state at the start of a step; None where the scheme has none."""
        return None

    def outputs(self, loop: ClosedLoop, counter: Any, state: Any, step: float) -> dict[str, Any]:
        """Further signals (SX) at the start of a step, by the names of `described`; none unless told."""
        return {}

    @property
    def described(self) -> dict[str, tuple[str, str]]:
        """Long name and SI unit of every further signal."""
        return {}

    @property
    def settings(self) -> dict[str, Any]:
        """Numbers and texts that say how the scheme was set, for the provenance of a run."""
        return {}
