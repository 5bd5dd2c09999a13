"""The implicit step with a disturbance estimate in place of the integral states."""

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import casadi as ca
import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.files import Json
from quakedesign.laws.sampled_controller import compensating_pressure, cut_off, followed
from quakedesign.laws.sampled_law import RestLimit
from quakedesign.loop import discrete_law
from quakedesign.loop.discrete_law import DiscreteLaw, Values
from quakedesign.loop.schemes.base import Decision, Sampled, Stepped, slope_of
from quakedesign.loop.schemes.implicit import backward_euler, end_rate, inclusion

_LIMIT = sp.symbols("asked slip reference width per_slip resolution least largest fastest highest last", real=True)
_CUT = cut_off(_LIMIT[0], _LIMIT[9:], *_LIMIT[1:6], within=_LIMIT[6:9])
_NUMBERS = ("rest_width", "rest_per_slip", "rest_resolution", "rest_least", "rest_largest", "rest_fastest")
_WIDEST = 1e30  # Pa; stands for no limit


@dataclass(frozen=True, kw_only=True)
class Compensated(Sampled):
    """Implicit step for e2' = B0(p + d) with d estimated from the last sample, in place of the integral states.

    The estimate is d ← (1 − a)d + a[(e2 − e2⁻)/(T_sB0) − p⁻], where p⁻ is the applied pressure minus the feed-forward.
    The step is that of `Implicit` with ξ = 0, and the pressure is that of this step minus d. In
    `quakedesign.laws.sampled_controller`, `followed` gives the estimate and `compensating_pressure` the pressure, here
    and in guarantees. Certificates in continuous time do not cover this scheme. Near the origin, where the step ends at
    e1⁺ = 0, the loop is linear and stable for 4a/((a + 1)(a + 2)) < β/β0 < 4/(a + 2), where β/β0 is the input gain of
    the fault divided by B0. Since β varies with friction by a factor of 1.425 on faults of the paper, a loop with a = 1
    chatters if B0 is the smallest input gain. Noise of the slip rate reaches the estimate with the gain a/(T_sB0).

    Attributes
    ----------
    weight : float
        a [-], in (0, 1].
    rest_width : float, optional
        Width of `RestLimit` [Pa]; no limit by default.
    rest_per_slip, rest_resolution : float
        Fields of `RestLimit` [Pa/m], [m].
    rest_least, rest_largest : float, optional
        Fields of `RestLimit` [Pa].
    rest_fastest : float
        Field of `RestLimit` [m].
    substeps, actuator, measurement, authority
        As in `Sampled`; B0 is by default the geometric mean of the smallest and the largest input gain of the box, from
        which both differ by the same factor.
    """

    name: ClassVar[str] = "compensated"
    own_size: ClassVar[int] = 5 + len(_NUMBERS) + len(RestLimit.STATES)

    weight: float = 0.5
    rest_width: float | None = None
    rest_per_slip: float = 0.0
    rest_resolution: float = 0.0
    rest_least: float | None = None
    rest_largest: float | None = None
    rest_fastest: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.weight <= 1:
            raise ParameterError(f"weight must be above 0 and at most 1. Received {self.weight!r}.")
        if self.rest_width is not None:
            given = {name.removeprefix("rest_"): getattr(self, name) for name in _NUMBERS}
            RestLimit(**{name: Fraction(value) for name, value in given.items() if value is not None})

    @staticmethod
    def derive(law: DiscreteLaw) -> tuple[sp.Expr, ...]:
        """Pull [m/s] and feed-forward [Pa] of the law with ξ = 0 at every sample, and ∂p/∂ξ of a single ξ."""
        none = dict.fromkeys(law.integrals, sp.Integer(0))
        pull, feed_forward, *_ = backward_euler(law)
        slope = slope_of(law.pressure, law.integrals[0]) if len(law.integrals) == 1 else sp.Integer(0)
        return pull.xreplace(none), feed_forward.xreplace(none), slope

    @property
    def initial_memory(self) -> tuple[float, ...]:
        """See `Sampled.initial_memory`: whether a sample has been taken, e2⁻, last feed-forward, d, weight, limit."""
        width = _WIDEST if self.rest_width is None else float(self.rest_width)
        least = -_WIDEST if self.rest_least is None else float(self.rest_least)
        largest = _WIDEST if self.rest_largest is None else float(self.rest_largest)
        limit = width, *map(float, (self.rest_per_slip, self.rest_resolution)), least, largest, float(self.rest_fastest)
        return 0.0, 0.0, 0.0, 0.0, float(self.weight), *limit, 0.0, 0.0

    def nominal(self, loop: Stepped) -> float:
        """See `Sampled.nominal`: √(smallest · largest) here."""
        return math.sqrt(math.prod(loop.fault.authority_range))

    @property
    def settings(self) -> Json:
        """See `Scheme.settings`."""
        names = [name for name in _NUMBERS if getattr(self, name) is not None] if self.rest_width else []
        return super().settings | {"weight": self.weight} | {name: getattr(self, name) for name in names}

    @classmethod
    def decide(cls, expressions: tuple[sp.Expr, ...], law: DiscreteLaw, values: Values, own: list[ca.SX]) -> Decision:
        """See `Decided.decide`; a single ξ gets the value equivalent to the estimate, several stay at zero."""
        begun, before, ahead_before, estimate, weight, *limit = own
        pull, feed_forward, slope = expressions
        gain, rate_error = values[discrete_law.step] * values[discrete_law.authority], values[discrete_law.rate_error]
        pushed = values[discrete_law.applied_pressure] - ahead_before
        follows = begun > 0 if pull != 0 else False
        estimate = ca.if_else(follows, followed(rate_error, before, pushed, estimate, weight, gain), 0)
        solved = inclusion(pull).solve(values)
        ahead, share = discrete_law.values((feed_forward, slope), solved)
        commanded = compensating_pressure(rate_error, solved[end_rate], estimate, gain) + ahead
        reference = values[discrete_law.slip] - values[discrete_law.slip_error]
        passing = dict(zip(_LIMIT, (commanded, values[discrete_law.slip], reference, *limit), strict=True))
        pressure, *passed = discrete_law.values(_CUT, passing)
        after = [ca.SX(0) if slope == 0 else -estimate / share for _ in law.integrals]
        numbers = limit[: len(_NUMBERS)]
        return Decision(pressure, after, [ca.SX(1), rate_error, ahead, estimate, weight, *numbers, *passed])
