"""The implicit step with an estimate of the disturbance in place of the integral states."""

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import casadi as ca
import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.loop.compensation import answered, followed
from quakedesign.loop.following_limits import FollowingLimits, cut_off
from quakedesign.loop.schemes.base import Stepped
from quakedesign.loop.steps import discrete_law
from quakedesign.loop.steps.backward import backward_euler, inclusion
from quakedesign.loop.steps.control_step import Decision, slope_of
from quakedesign.loop.steps.discrete_law import Law, Values
from quakedesign.loop.steps.inclusion import end_rate
from quakedesign.loop.steps.sampled import Sampled

_LIMITS = sp.symbols("asked reference width per_slip highest lowest", real=True)
_applied, _after = cut_off(_LIMITS[0], _LIMITS[4:], *_LIMITS[1:4])
_WIDEST = 1e30  # Pa, of no limits


@dataclass(frozen=True, kw_only=True)
class Compensated(Sampled):
    """Implicit step for e2' = B0(p + d) with d estimated from the last sample, in place of the integral states.

    The estimate is d ← (1 − a)d + a[(e2 − e2⁻)/(T_sB0) − p⁻], where p⁻ is the pressure that was held, less the
    feed-forward, and the step is that of `Implicit` with ξ = 0; the pressure is its solution minus d: `answered` and
    `followed` of `quakedesign.loop`, which guarantees use as well. What certificates of continuous time say about the
    law does not carry over to this scheme. Near the origin, where it ends at e1⁺ = 0, the loop is linear and stable for
    4a/((a + 1)(a + 2)) < β/β0 < 4/(a + 2): since friction lets β vary by a factor of 1.425 on faults of the paper, the
    weight 1 chatters where β0 is the smallest β. Noise of the slip rate reaches the estimate with the gain a/(T_sβ0).

    Attributes
    ----------
    weight : float
        a [-], in (0, 1].
    limit_width : float, optional
        Of `FollowingLimits` [Pa]; no limits unless told.
    limit_per_slip : float
        Of the same [Pa/m].
    substeps, actuator, measurement, authority
        As in `Sampled`; B0 is the geometric middle of the box unless told, so that β/β0 is as far from both limits.

    Raises
    ------
    ParameterError
    """

    name: ClassVar[str] = "compensated"
    own_size: ClassVar[int] = 7 + len(FollowingLimits.STATES)

    weight: float = 0.5
    limit_width: float | None = None
    limit_per_slip: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.weight <= 1:
            raise ParameterError(f"weight must be above 0 and at most 1. Received {self.weight!r}.")
        if self.limit_width is not None:
            FollowingLimits(width=Fraction(self.limit_width), per_slip=Fraction(self.limit_per_slip))

    @staticmethod
    def derive(law: Law) -> tuple[sp.Expr, ...]:
        """Pull [m/s] and feed-forward [Pa] of the law with ξ = 0 at every sample, and ∂p/∂ξ where there is one ξ."""
        none = dict.fromkeys(law.integrals, sp.Integer(0))
        pull, feed_forward, *_ = backward_euler(law)
        slope = slope_of(law.pressure, law.integrals[0]) if len(law.integrals) == 1 else sp.Integer(0)
        return pull.subs(none), feed_forward.subs(none), slope

    @property
    def starts(self) -> tuple[float, ...]:
        """See `Sampled.starts`: whether a sample has been taken, e2⁻, the feed-forward then, d, weight and limits."""
        width = _WIDEST if self.limit_width is None else float(self.limit_width)
        return 0.0, 0.0, 0.0, 0.0, float(self.weight), width, float(self.limit_per_slip), 0.0, 0.0

    def nominal(self, loop: Stepped) -> float:
        """See `Sampled.nominal`: here √(smallest · largest)."""
        return math.sqrt(math.prod(loop.fault.authority_range))

    @property
    def settings(self) -> dict[str, Any]:
        """See `Scheme.settings`."""
        limits = {"limit_width": self.limit_width, "limit_per_slip": self.limit_per_slip}
        return super().settings | {"weight": self.weight} | (limits if self.limit_width else {})

    @classmethod
    def decide(cls, found: tuple[sp.Expr, ...], law: Law, known: Values, own: list[Any]) -> Decision:
        """See `Decided.decide`; one ξ is set to what would stand for the estimate, several are left at zero."""
        begun, before, ahead_before, estimate, weight, *limits = own
        pull, feed_forward, slope = found
        gain, rate_error = known[discrete_law.step] * known[discrete_law.authority], known[discrete_law.rate_error]
        pushed = known[discrete_law.held] - ahead_before
        follows = begun > 0 if pull != 0 else False
        estimate = ca.if_else(follows, followed(rate_error, before, pushed, estimate, weight, gain), 0)
        solved = inclusion(pull).solve(known)
        ahead, share = discrete_law.values((feed_forward, slope), solved)
        asked = answered(rate_error, solved[end_rate], estimate, gain) + ahead
        reference = known[discrete_law.slip] - known[discrete_law.slip_error]
        passing = dict(zip(_LIMITS, (asked, reference, *limits), strict=True))
        pressure, *passed = discrete_law.values((_applied, *_after), passing)
        after = [ca.SX(0) if slope == 0 else -estimate / share for _ in law.integrals]
        return Decision(pressure, after, [ca.SX(1), rate_error, ahead, estimate, weight, *limits[:2], *passed])
