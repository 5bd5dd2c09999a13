"""What every sensor, and every element of one, offers."""

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import casadi as ca

from quakedesign.errors import ParameterError

_SAME = 1e-12  # relative difference of two sampling periods that are meant to be one


class Sensor(ABC):
    """From the true slip and slip rate to those that a law is told, once per sample.

    Its numbers and its memory are entries of the vector that the compiled loop carries along; `measure` works on CasADi
    SX. Unless it says otherwise it is one that estimates both from the slip.

    Attributes
    ----------
    of_slip_alone : bool
        Whether it does without the slip rate.
    """

    of_slip_alone: ClassVar[bool] = True

    @property
    def noisy(self) -> bool:
        """Whether the law is told anything but slip and slip rate as they are."""
        return True

    @property
    @abstractmethod
    def step(self) -> float | None:
        """Sampling period [s] that it was made for; None for any."""

    @property
    @abstractmethod
    def numbers(self) -> tuple[float, ...]:
        """Parameters in SI units, as `measure` expects them."""

    @property
    @abstractmethod
    def start(self) -> tuple[float, ...]:
        """Memory before the first sample, for a fault at rest at slip 0."""

    @abstractmethod
    def measure(self, numbers: list[Any], memory: list[Any], x: Any) -> tuple[Any, list[Any]]:
        """Slip [m] and slip rate [m/s] that the law is told, and the memory afterwards, at the true state x."""

    @property
    @abstractmethod
    def software(self) -> "Sensor":
        """The part that runs on the controller, without what the hardware does to the signal."""

    @property
    def size(self) -> int:
        """Number of entries of the memory; the state of the noise generator, seeded, is among them."""
        return len(self.start)

    def require_step(self, step: float) -> None:
        """Refuse a sampling period [s] other than the sensor's.

        Raises
        ------
        ParameterError
        """
        if self.step is not None and abs(step - self.step) > _SAME * self.step:
            raise ParameterError(
                f"the sampling period must be that of the sensor, {self.step:.6g} s. Received {step:.6g} s. "
                "Make the sensor for the period of the loop."
            )

    def function(self) -> Any:
        """CasADi Function (memory, slip [m]) → memory, slip estimate [m], slip-rate estimate [m/s]."""
        memory, slip = ca.SX.sym("memory", self.size), ca.SX.sym("slip")
        seen, after = self.measure([*map(ca.SX, self.numbers)], ca.vertsplit(memory), ca.vertcat(slip, 0))
        outputs = [ca.vertcat(*after), seen[0], seen[1]]
        names = ["memory_after", "slip_estimate", "rate_estimate"]
        return ca.Function("sensor", [memory, slip], outputs, ["memory", "slip"], names)


class SlipStage(ABC):
    """One element of a chain that a measured slip [m] passes, once per sample.

    Attributes
    ----------
    hardware : bool
        Whether it belongs to the instrument, not to the program of the controller.
    """

    hardware: ClassVar[bool]

    @property
    @abstractmethod
    def start(self) -> tuple[float, ...]:
        """Memory before the first sample."""

    @abstractmethod
    def numbers(self, step: float) -> tuple[float, ...]:
        """Parameters for a sampling period [s], as `pass_on` expects them."""

    @abstractmethod
    def pass_on(self, numbers: list[Any], memory: list[Any], slip: Any) -> tuple[Any, list[Any]]:
        """Slip [m] (SX) that leaves the element, and the memory afterwards."""
