"""A law that is told estimates: p(x̂1, x̂2)."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca

from quakedesign.errors import ParameterError
from quakedesign.loop.sensing.base import Sensor, SlipStage
from quakedesign.loop.sensing.differentiator import Differentiator


@dataclass(frozen=True, kw_only=True)
class OutputFeedback(Sensor):
    """Slip through a row of stages into a differentiator, which estimates slip and slip rate.

    Nothing guarantees that a loop which is stable with exact states is stable with estimates (no separation
    principle); `joint_condition` says when the differentiator can follow.

    Attributes
    ----------
    differentiator : Differentiator
    stages : tuple of SlipStage
        In the order of the signal, hardware first.

    Raises
    ------
    ParameterError
        For anything but stages, or hardware behind software.
    """

    differentiator: Differentiator
    stages: tuple[SlipStage, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "stages", tuple(self.stages))
        hardware = True
        for stage in self.stages:
            if not isinstance(stage, SlipStage):
                raise ParameterError(f"stages must be Transducer, Averaging and the like. Received {stage!r}.")
            if stage.hardware and not hardware:
                raise ParameterError(f"hardware comes first. Received {stage!r} after software. Change their order.")
            hardware = stage.hardware

    @property
    def step(self) -> float:
        """See `Sensor.step`."""
        return self.differentiator.step

    @property
    def numbers(self) -> tuple[float, ...]:
        """See `Sensor.numbers`."""
        return (*(v for stage in self.stages for v in stage.numbers(self.step)), *self.differentiator.numbers)

    @property
    def start(self) -> tuple[float, ...]:
        """See `Sensor.start`."""
        return (*(v for stage in self.stages for v in stage.start), *self.differentiator.start)

    @property
    def software(self) -> "OutputFeedback":
        """See `Sensor.software`."""
        return replace(self, stages=tuple(stage for stage in self.stages if not stage.hardware))

    def measure(self, numbers: list[Any], memory: list[Any], x: Any) -> tuple[Any, list[Any]]:
        """See `Sensor.measure`."""
        own, past = iter(numbers), iter(memory)
        slip, kept = x[0], []
        for stage in self.stages:
            slip, after = stage.pass_on(_next(own, len(stage.numbers(self.step))), _next(past, len(stage.start)), slip)
            kept += after
        estimates, after = self.differentiator.estimate(list(own), list(past), slip)
        return ca.vertcat(estimates[0], estimates[1]), [*kept, *after]


def _next(entries: Iterator[Any], count: int) -> list[Any]:
    return [next(entries) for _ in range(count)]
