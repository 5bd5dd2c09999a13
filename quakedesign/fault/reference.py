"""The slip that the controller shall follow."""

from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from quakedesign.errors import ParameterError
from quakedesign.fault.checks import require_ordinary, require_positive
from quakedesign.rationals import rational
from quakedesign.text import shown

if TYPE_CHECKING:
    import sympy as sp


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """Smooth slip r(t) from rest to rest, eq. ref, held at its end for t > operation_time (ERRATA 26).

    Attributes
    ----------
    target_slip : float
        d_max [m], positive.
    operation_time : float
        t_op [s], positive.
    ramp : float, optional
        Of friction with a state, which slides all the time: share of the slip that follows the smooth ramp, above 0 and
        below 1; the rest comes at a constant rate. None: all of it at a constant rate.
    """

    target_slip: float = field(metadata={"unit": "m", "symbol": "d_{max}"})
    operation_time: float = field(metadata={"unit": "s", "symbol": "t_{op}"})
    ramp: float | None = field(
        default=None, metadata={"unit": "", "directed_unit": "slip_m/slip_m", "symbol": r"\lambda_r"}
    )

    def __post_init__(self) -> None:
        require_positive(target_slip=self.target_slip, operation_time=self.operation_time)
        if self.ramp is not None and not 0 < self.ramp < 1:
            raise ParameterError(
                f"ramp must be above 0 and below 1. Received {self.ramp!r}. Leave it out for a constant rate."
            )
        require_ordinary(0, target_slip=self.target_slip)
        require_ordinary(operation_time=self.operation_time)

    def shape(self, stage: Any) -> Any:
        """Share of the target slip [-] at the stage s = t/t_op in [0, 1] (eq. ref): number, array or expression.

        Raises
        ------
        ParameterError
            For anything that has no powers, or too large ones.
        """
        if isinstance(stage, type) or not hasattr(stage, "__pow__"):
            raise ParameterError(
                f"stage must be a number, an array or an expression. Received {shown(stage)}. Give t/t_op."
            )
        try:
            return stage**3 * (10 - 15 * stage + 6 * stage**2)
        except (OverflowError, TypeError):
            raise ParameterError(f"stage must be from 0 to 1. Received {shown(stage)}. Give t/t_op.") from None

    def slip(self, time: "sp.Expr") -> "sp.Expr":
        """Reference slip [m] at a time [s] of [0, operation_time], with exact numbers."""
        import sympy as sp

        d_max, t_op = (sp.Rational(str(rational(v))) for v in (self.target_slip, self.operation_time))
        return d_max * self.shape(time / t_op)

    @property
    def largest_rate(self) -> float:
        """Largest r' [m/s]: 15/8 of the mean, at half of the operation time."""
        return 15 / 8 * self.target_slip / self.operation_time


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingReference:
    """Slip r(t) = d_max((1 − λ)t/t_op + λ·shape(t/t_op)) of a fault that slides at r′(0) at first and at the end.

    Attributes
    ----------
    task : Reference
        With d_max, t_op and λ, its ramp; 0 without one.
    """

    task: Reference

    @property
    def _shares(self) -> tuple[Fraction, Fraction]:
        """1 − λ and λ."""
        share = rational(self.task.ramp or 0)
        return 1 - share, share

    @property
    def first_rate(self) -> Fraction:
        """V = r′(0) [m/s], the smallest r′."""
        return rational(self.task.target_slip) / rational(self.task.operation_time) * self._shares[0]

    @property
    def swing(self) -> Fraction:
        """w [-]: r′ lies between V and V(1 + w)."""
        steady, share = self._shares
        return Fraction(15, 8) * share / steady

    def slip(self, time: Any) -> Any:
        """r [m] at times [s] from 0 on, number or array; V goes on behind t_op."""
        steady, share = map(float, self._shares)
        stage = time / self.task.operation_time
        ended = (stage < 1) * stage + (stage >= 1)
        return self.task.target_slip * (steady * stage + share * self.task.shape(ended))

    def rate(self, time: Any) -> Any:
        """r′ [m/s] at times [s], as `slip`."""
        steady, share = map(float, self._shares)
        stage = time / self.task.operation_time
        ramping = 30 * stage**2 * (1 - stage) ** 2 * (stage < 1)
        return self.task.target_slip / self.task.operation_time * (steady + share * ramping)
