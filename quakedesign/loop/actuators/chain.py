"""Actuator as a chain of stages."""

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.loop.actuators.base import FlowStage, SampledStage, Stage
from quakedesign.loop.actuators.delay import Delay
from quakedesign.loop.actuators.lag_and_diffusion import Diffusion, Lag
from quakedesign.loop.sensing.measurement import Entries

if TYPE_CHECKING:
    from quakedesign.laws import Sampling

LONGEST = 2.5  # limit of substep times fastest rate, below the limits 2.78 and 3.3 of the Runge–Kutta methods


@checked_dataclass(frozen=True, kw_only=True)
class Actuator:
    """Chain of stages from the commanded pressure to the pressure in the fault.

    Attributes
    ----------
    stages : tuple of Stage
        In the order of the signal; sampled stages come first, because a zero-order hold follows them. Without stages
        the commanded pressure acts in the fault at once.

    Raises
    ------
    ParameterError
        For an entry that is not a stage, a dynamic stage before a sampled one, or more than one stage that stores fluid
        or that acts between samples.
    """

    stages: tuple[Stage, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "stages", tuple(self.stages))
        for stage in self.stages:
            if not isinstance(stage, SampledStage | FlowStage):
                raise ParameterError(
                    f"an actuator consists of stages. Received {stage!r}. Use Delay, Lag and the like."
                )
        for before, after in pairwise(self.stages):
            if isinstance(before, FlowStage) and isinstance(after, SampledStage):
                raise ParameterError(
                    f"stages that act once per sample must come first. Received {before.name} before {after.name}. "
                    f"Put {after.name} before {before.name}."
                )
        if len(between := [stage.name for stage in self.sampled if stage.part]) > 1:
            raise ParameterError(
                f"at most one stage of an actuator may act between samples. Received {', '.join(between)}. Keep one."
            )
        if len(self._stores) > 1:
            names = ", ".join(stage.name for stage in self._stores)
            raise ParameterError(
                f"at most one stage of an actuator may store fluid. Received {names}. Keep one of these."
            )

    @classmethod
    def meant_for(cls, sampling: "Sampling") -> "Actuator":
        """Actuator with the delay, lag and diffusion path of a sampled law; no stages if it has none."""
        step, kinds = float(sampling.step), {kind.name: kind for kind in (Delay, Lag, Diffusion)}
        times: dict[str, Any] = {name: float(time) for name, time in sampling.path.items() if time}
        return cls(stages=tuple(kinds[name].from_options(step, **{name: time}) for name, time in times.items()))

    def completed(self, other: "Actuator") -> "Actuator":
        """Actuator extended by those stages of another one whose kinds it does not have."""
        names = {stage.name for stage in self.stages}
        more = (stage for stage in other.stages if stage.name not in names)
        along = sorted((*self.stages, *more), key=lambda stage: (isinstance(stage, FlowStage), stage.rank))
        return Actuator(stages=tuple(along))

    @property
    def sampled(self) -> tuple[SampledStage, ...]:
        """Stages that act once per sample."""
        return tuple(stage for stage in self.stages if isinstance(stage, SampledStage))

    @property
    def flowing(self) -> tuple[FlowStage, ...]:
        """Stages with dynamics between samples."""
        return tuple(stage for stage in self.stages if isinstance(stage, FlowStage))

    @property
    def part(self) -> float:
        """Fraction of a sampling period after which the output of the sampled stages acts."""
        return sum(stage.part for stage in self.sampled)

    @property
    def flow_start(self) -> tuple[float, ...]:
        """Initial memory of the dynamic stages."""
        return tuple(value for stage in self.flowing for value in stage.start)

    @property
    def stores(self) -> bool:
        """Whether volume and flow rate are computed."""
        return bool(self._stores)

    @property
    def _stores(self) -> list[FlowStage]:
        return [stage for stage in self.flowing if stage.stores]

    def substeps(self, step: float) -> int:
        """Smallest number of substeps of a step [s] that resolves every stage."""
        return max((math.ceil(step * stage.fastest / LONGEST) for stage in self.flowing), default=1)

    def require_resolved(self, substep: float) -> None:
        """Reject a substep [s] that does not resolve a stage."""
        for stage in self.flowing:
            times = substep * stage.fastest / LONGEST
            if times > 1:
                raise ParameterError(
                    f"a substep must be at most {LONGEST / stage.fastest:.3g} s for the {stage.name}. "
                    f"Received {substep:.3g} s. Take {math.ceil(times)} times as many substeps, or omit this stage."
                )

    def hold(self, numbers: Entries, memory: Entries, pressure: Any, step: float) -> tuple[Any, Any, Entries]:
        """Pressure [Pa] until the next sample, excess of the commanded one [Pa], and the memory."""
        memories: Entries = []
        excess: Any = 0.0
        for stage, own, past in zip(self.sampled, *_split(self.sampled, numbers, memory), strict=True):
            before = pressure
            pressure, past = stage.apply(own, past, pressure, step)
            excess = excess + (before - pressure) if stage.limits else excess
            memories += past
        return pressure, excess, memories

    def flow(self, numbers: Entries, memory: Entries, applied: Any) -> tuple[Entries, Any, dict[str, Any]]:
        """Rates of dynamic stages, pressure [Pa] in the fault, and signals of `FLOWS`, under an input pressure."""
        rates: Entries = []
        signals: dict[str, Any] = {}
        for stage, own, past in zip(self.flowing, *_split(self.flowing, numbers, memory), strict=True):
            rates += stage.rates(own, past, applied)
            signals |= stage.flows(own, past, applied)
            applied = stage.output(own, past, applied)
        return rates, applied, signals


DIRECT = Actuator()


def _split(stages: tuple[Stage, ...], numbers: Entries, memory: Entries) -> tuple[list[Entries], list[Entries]]:
    """Numbers and memory of every stage."""
    own, past = iter(numbers), iter(memory)
    return [[next(own) for _ in s.numbers] for s in stages], [[next(past) for _ in s.start] for s in stages]
