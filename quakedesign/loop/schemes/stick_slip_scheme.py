"""The implicit step with the disturbance estimate of `StickSlipLaw`, which does not wind up at rest."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.files import Json
from quakedesign.laws.sampled_controller import compensating_pressure
from quakedesign.laws.stick_slip_controller import level_after
from quakedesign.loop import discrete_law
from quakedesign.loop.discrete_law import DiscreteLaw, Values
from quakedesign.loop.schemes.base import Decision, Sampled, Stepped
from quakedesign.loop.schemes.compensated import Compensated
from quakedesign.loop.schemes.implicit import end_rate, inclusion

_STATES = sp.symbols("level predicted last_rate last_slip", real=True)
_GAINS = sp.symbols("level_gain slip_gain rest_slip", real=True)
_SEEN = discrete_law.slip, discrete_law.rate
_LEVEL = level_after(_STATES, _SEEN, discrete_law.step, _GAINS)


@dataclass(frozen=True, kw_only=True)
class StickSlip(Sampled):
    """Implicit step for e2' = B0(p + d) with the estimate of `StickSlipLaw` in place of the integral states.

    The target rate is r' + w, where w is e2 at the end of the step of `Implicit` with ξ = 0, and p = (w − e2)/(T_s·B0)
    − D plus the feed-forward. The disturbance estimate D [Pa] is corrected by the innovation of the slip rate with the
    gain a/(T_s·B0), and by that of the slip with b/(T_s²·B0); the predicted slip rate is never negative. Where the step
    ends at e1⁺ = 0, the law is `StickSlipLaw` with return_rate = 1/T_s, for which there are guarantees on the
    stick–slip plant.

    Attributes
    ----------
    weight : float
        a [-], in (0, 1].
    slip_weight : float
        b [-], in [0, 1].
    rest_slip : float
        Largest difference between measured slips of a fault at rest [m], not negative; 0 without noise.
    substeps, actuator, measurement, authority
        As in `Sampled`; B0 is the largest input gain of the box by default.
    """

    name: ClassVar[str] = "stick-slip"
    own_size: ClassVar[int] = 3 + len(_STATES)

    weight: float = 0.3
    slip_weight: float = 0.5
    rest_slip: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.weight <= 1:
            raise ParameterError(f"weight must be above 0 and at most 1. Received {self.weight!r}.")
        if not 0 <= self.slip_weight <= 1:
            raise ParameterError(f"slip_weight must be from 0 to 1. Received {self.slip_weight!r}.")
        if not 0 <= self.rest_slip < float("inf"):
            raise ParameterError(f"rest_slip must be finite and 0 or more. Received {self.rest_slip!r} m.")

    @staticmethod
    def derive(law: DiscreteLaw) -> tuple[sp.Expr, ...]:
        """See `Compensated.derive`."""
        return Compensated.derive(law)

    @property
    def initial_memory(self) -> tuple[float, ...]:
        """See `Sampled.initial_memory`: both weights and `rest_slip`, then the states of the estimate, all 0."""
        return float(self.weight), float(self.slip_weight), float(self.rest_slip), *(0.0,) * len(_STATES)

    def nominal(self, loop: Stepped) -> float:
        """See `Sampled.nominal`: the largest input gain here."""
        return loop.fault.authority_range[1]

    @property
    def settings(self) -> Json:
        """See `Scheme.settings`."""
        own = {"weight": self.weight, "slip_weight": self.slip_weight, "rest_slip": self.rest_slip}
        return super().settings | own

    @classmethod
    def decide(cls, expressions: tuple[sp.Expr, ...], law: DiscreteLaw, values: Values, own: list[ca.SX]) -> Decision:
        """See `Decided.decide`; a single ξ gets the value equivalent to the estimate, several stay at zero."""
        weight, slip_weight, rest_slip, *states = own
        pull, feed_forward, slope = expressions
        gain, step = values[discrete_law.step] * values[discrete_law.authority], values[discrete_law.step]
        gains = weight / gain, slip_weight / (gain * step), rest_slip
        entries = dict(zip((*_STATES, *_GAINS), (*states, *gains), strict=True))
        level = discrete_law.values((_LEVEL,), values | entries)[0] if pull != 0 else ca.SX(0)
        solved = inclusion(pull).solve(values)
        ahead, share = discrete_law.values((feed_forward, slope), solved)
        rate, rate_error = values[discrete_law.rate], values[discrete_law.rate_error]
        pressure = compensating_pressure(rate_error, solved[end_rate], level, gain) + ahead
        predicted = ca.fmax(rate - rate_error + solved[end_rate], 0)
        after = [ca.SX(0) if slope == 0 else -level / share for _ in law.integrals]
        numbers = [weight, slip_weight, rest_slip]
        return Decision(pressure, after, [*numbers, level, predicted, rate, values[discrete_law.slip]])
