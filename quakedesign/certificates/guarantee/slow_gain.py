"""The input gain of friction that depends on the slip alone: slow, so that a loop meets one value of it at a time."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain

from quakedesign.certificates.guarantee.inputs import Gains, GainSpread
from quakedesign.certificates.guarantee.norms import norms
from quakedesign.certificates.guarantee.task import Task
from quakedesign.errors import ParameterError
from quakedesign.loop import Model, PeriodicLoop
from quakedesign.rationals import shortly

MOST_PARTS = 16
_ONE_OVER_E = Fraction(3679, 10000)  # from above


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowGain:
    """How a proof uses that the input gain is slow: see `theorem`.

    Attributes
    ----------
    parts : int
        Into how many equal parts the range of the gain is cut, each with a nominal loop of its own, at most 16.
    growth : Fraction
        α [1/s]: what is past counts e^{ασ} times, σ ago.

    Raises
    ------
    ParameterError
    """

    parts: int
    growth: Fraction

    def __post_init__(self) -> None:
        if not 1 <= self.parts <= MOST_PARTS or self.growth <= 0:
            raise ParameterError(
                f"a slow gain needs 1 to {MOST_PARTS} parts and a positive growth. Received {self.parts} and "
                f"{shortly(self.growth)} 1/s. Change them."
            )

    def models(self, task: Task) -> tuple[Model, ...]:
        """Nominal model of every part.

        Raises
        ------
        ParameterError
            For friction that depends on the slip rate, whose coefficient may jump.
        """
        if task.friction.rate_slope:
            raise ParameterError(
                "a slow gain needs friction of the slip alone. Received one of the slip rate. Leave it out."
            )
        half = self._half(task)
        middles = (task.beta[0] + (2 * number + 1) * half for number in range(self.parts))
        return tuple(replace(task.model, gain=middle * task.authority) for middle in middles)

    def spread(self, task: Task, slip_error: Fraction) -> GainSpread:
        """How far the gain is off while the slip error stays below a bound [m]."""
        law = task.friction
        slope = max(law.weakening, law.strengthening) * task.area_per_mass[1] / task.authority
        return GainSpread(
            half=self._half(task) + 2 * slope * slip_error,
            aged=slope * task.reference_rates[0] * _ONE_OVER_E / self.growth,
        )

    def _half(self, task: Task) -> Fraction:
        return (task.beta[1] - task.beta[0]) / (2 * self.parts)


def slow_gains(loops: Iterable[PeriodicLoop], growth: Fraction) -> Gains:
    """Gains of the nominal loops of all parts, those of one after those of the other, with those of ``aged``.

    Raises
    ------
    ParameterError
        When one of the loops, or of those that grow, is not found to be stable.
    """
    of_parts = [norms(loop) | norms(grown(loop, growth)) for loop in loops]
    return {key: tuple(chain.from_iterable(gains[key] for gains in of_parts)) for key in of_parts[0]}


def grown(loop: PeriodicLoop, growth: Fraction) -> PeriodicLoop:
    """The loop whose responses to the acceleration are e^{ασ} as large."""
    flow = tuple(tuple(v + growth * (i == j) for j, v in enumerate(row)) for i, row in enumerate(loop.flow))
    entry = {"aged": loop.inputs["acceleration"]}
    return replace(loop, flow=flow, inputs=entry, sampled={}, fading={}, pulses={}, at_once={}, start=())
