"""What every scheme offers."""

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import sympy as sp

from quakedesign.controllers import Controller
from quakedesign.fault import Fault


class Stepped(ABC):
    """What a scheme asks of the closed loop that it carries over a step; the functions work on CasADi SX.

    Attributes
    ----------
    sticks : bool
        Whether friction is set-valued.
    fault : Fault
    controller : Controller or None
    constant_pressure : float
        p [Pa] where there is no controller.
    """

    sticks: ClassVar[bool] = False

    fault: Fault
    controller: Controller | None
    constant_pressure: float

    @property
    @abstractmethod
    def integrals(self) -> tuple[sp.Symbol, ...]:
        """Symbols of the law's own states."""

    @property
    @abstractmethod
    def plant(self) -> Any:
        """Function (t [s], x [m, m/s], p [Pa]) → dx [m/s, m/s²]."""

    @property
    @abstractmethod
    def reference(self) -> Any:
        """Function t [s] → reference [m, m/s, m/s²]."""

    @property
    @abstractmethod
    def law(self) -> Any:
        """Function (x, xi, reference) → p [Pa], dxi."""

    @abstractmethod
    def advance(self, method: Any, motion: Any, state: Any, step: float) -> Any:
        """State after one step of an integrator on a motion, given the plant, how much has passed [-] and the state."""

    @abstractmethod
    def advance_often(self, method: Any, motion: Any, given: Any, state: Any, step: float, times: int) -> Any:
        """State after a number of steps; the motion is given numbers too, and `passed` counts steps."""


class Scheme(ABC):
    """One step of length T_s of a closed loop, written in CasADi SX.

    The state of a run is [x1, x2, ξ, memory], where the memory belongs to the scheme: what a controller keeps from one
    sample to the next, and numbers that are carried along so that one machine code serves all of their values.

    Attributes
    ----------
    name : str
    """

    name: ClassVar[str]

    def memory(self, loop: Stepped, step: float) -> dict[str, float]:
        """Entries of the memory with their values at the start; none unless told."""
        return {}

    @abstractmethod
    def pressure(self, loop: Stepped, counter: Any, state: Any, step: float) -> Any:
        """Pressure [Pa] in the fault at the start of step number `counter`."""

    @abstractmethod
    def advance(self, loop: Stepped, method: Any, counter: Any, state: Any, step: float) -> Any:
        """State at the end of step number `counter`, which starts at counter·step [s]."""

    def rates(self, loop: Stepped, counter: Any, state: Any, step: float) -> Any:
        """Time derivative of the state at the start of a step; None where the scheme has none."""
        return None

    def outputs(self, loop: Stepped, counter: Any, state: Any, step: float) -> dict[str, Any]:
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
