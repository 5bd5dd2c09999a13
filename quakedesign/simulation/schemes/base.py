"""What every scheme offers."""

from abc import ABC, abstractmethod
from typing import Any, ClassVar

from quakedesign.simulation.closed_loop import ClosedLoop
from quakedesign.simulation.integrators import Integrator


class Scheme(ABC):
    """One step of length T_s of a closed loop, written in CasADi SX.

    Attributes
    ----------
    name : str
    """

    name: ClassVar[str]

    @classmethod
    @abstractmethod
    def pressure(cls, loop: ClosedLoop, counter: Any, state: Any, step: float) -> Any:
        """Pressure [Pa] at the start of step number `counter`, in the state [x1, x2, ξ]."""

    @classmethod
    @abstractmethod
    def advance(cls, loop: ClosedLoop, method: type[Integrator], counter: Any, state: Any, step: float) -> Any:
        """State [x1, x2, ξ] at the end of step number `counter`, which starts at counter·step [s]."""
