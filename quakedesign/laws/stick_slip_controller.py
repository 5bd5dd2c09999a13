"""Controller for simulations of the sampled law for the stick–slip plant."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from types import MappingProxyType
from typing import Any, ClassVar, Self

import sympy as sp

from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.exact import to_sympy
from quakedesign.laws.base import Controller, Sampling, Signals
from quakedesign.laws.loop_field import LoopField
from quakedesign.laws.stick_slip_law import GAIN_UNITS, StickSlipLaw


def level_after(
    states: Sequence[Any], seen: tuple[Any, Any], period: Any, gains: tuple[Any, Any, Any], *, sticks: bool = True
) -> sp.Expr:
    """Level D [Pa], the estimate of the disturbance, after a sample.

    Parameters
    ----------
    states : sequence of four
        Level D [Pa], predicted slip rate [m/s], last measured slip rate [m/s] and slip [m].
    seen : (slip, slip rate)
        Measured slip [m] and slip rate [m/s].
    period : expression
        T_s [s].
    gains : (level_gain, slip_gain, rest_slip)
        Gains of `StickSlipLaw` [Pa·s/m, Pa/m, m].
    sticks : bool
        Whether the innovation of the slip is limited at rest.
    """
    (level, predicted, last_rate, last_slip), (slip, rate) = states, seen
    level_gain, slip_gain, rest_slip = gains
    innovation = slip - last_slip - period * (last_rate + predicted) / 2
    if sticks:
        least = sp.Max(innovation, -period * predicted / 2 - rest_slip)
        innovation = sp.Piecewise((least, rate <= 0), (innovation, True))
    return level + level_gain * (rate - predicted) + slip_gain * innovation


@dataclass(frozen=True, kw_only=True)
class StickSlipController(Controller):
    """The law as a controller of a simulation: one step every T_s by the scheme ``explicit``.

    Its states are the level D [Pa], the predicted slip rate [m/s], the last measured slip rate [m/s] and slip [m].

    Attributes
    ----------
    law : StickSlipLaw
    step : Fraction
        T_s [s].
    sticks : bool
        Whether the predicted slip rate and the innovation at rest are limited; otherwise the law is linear.
    longest : Fraction
        Longest interval of aperiodic sampling in runs, as in `Sampling` [s].

    Raises
    ------
    ParameterError
        For the law of a sliding mode, which the scheme ``stick-slip`` runs.
    """

    name: ClassVar[str] = "stick-slip"
    title: ClassVar[str] = "e-LQR"
    source: ClassVar[str] = "quakedesign.laws.stick_slip_law"
    gain_units: ClassVar[Mapping[str, str]] = GAIN_UNITS
    integral_units: ClassVar[tuple[str, ...]] = ("Pa", "m/s", "m/s", "m")

    gains: Mapping[str, Fraction] = field(default_factory=dict, init=False)
    law: StickSlipLaw
    step: Fraction
    sticks: bool = True
    longest: Fraction = Fraction(0)

    def __post_init__(self) -> None:
        if self.law.pull:
            raise ParameterError(
                "law of a StickSlipController must have a linear target rate. Received one with an implicit step. Run "
                "its sliding mode with the scheme stick-slip."
            )
        object.__setattr__(self, "gains", MappingProxyType({name: getattr(self.law, name) for name in GAIN_UNITS}))

    def __reduce__(self) -> tuple[Any, tuple[()]]:
        return partial(type(self), law=self.law, step=self.step, sticks=self.sticks, longest=self.longest), ()

    @property
    def while_moving(self) -> "StickSlipController":
        """Linear law while the fault slides and the target rate is positive."""
        return replace(self, sticks=False)

    @property
    def sampling(self) -> Sampling:
        """Scheme ``explicit``, one step every T_s."""
        return Sampling(step=self.step, longest=self.longest)

    def pressure(self, signals: Signals) -> sp.Expr:
        """Return p [Pa]."""
        return self._step(signals)[0]

    def integral_rates(self, signals: Signals) -> tuple[sp.Expr, ...]:
        """(new state − old state)/T_s."""
        period = to_sympy(self.step)
        return tuple((new - old) / period for new, old in zip(self._step(signals)[1], signals.integrals, strict=True))

    def _step(self, signals: Signals) -> tuple[sp.Expr, tuple[sp.Expr, ...]]:
        """Pressure [Pa], and the states after the sample."""
        law, slip, rate = self.law, signals.slip, signals.slip_rate
        gains = to_sympy(law.level_gain), to_sympy(law.slip_gain), to_sympy(law.rest_slip)
        level = level_after(signals.integrals, (slip, rate), to_sympy(self.step), gains, sticks=self.sticks)
        target = rate - signals.slip_rate_error - to_sympy(law.return_rate) * signals.slip_error
        pressure = -to_sympy(law.rate_gain) * rate + to_sympy(law.target_gain) * target - level
        return pressure, (level, sp.Max(target, 0) if self.sticks else target, rate, slip)

    @classmethod
    def from_values(cls, values: "tuple[str | float | Fraction, ...]", **more: Any) -> Self:
        """Raise `UnsupportedError`: a sequence of gains does not define the law."""
        raise UnsupportedError(
            "a stick-slip controller is given by a StickSlipLaw and T_s, not by gains in order. "
            "Use StickSlipController."
        )

    @classmethod
    def loop_field(cls) -> LoopField:
        """Raise `UnsupportedError`: a sampled law has no closed loop in continuous time."""
        raise UnsupportedError("a sampled law has no loop in continuous time: use a guarantee of the sampled loop")
