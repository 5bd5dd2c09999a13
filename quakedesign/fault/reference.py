"""The slip that the controller shall follow."""

from dataclasses import dataclass
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
    """

    target_slip: float
    operation_time: float

    def __post_init__(self) -> None:
        require_positive(target_slip=self.target_slip, operation_time=self.operation_time)
        require_ordinary(0, target_slip=self.target_slip)
        require_ordinary(operation_time=self.operation_time)

    def shape(self, stage: Any) -> Any:
        """Share of the target slip [-] at the stage s = t/t_op in [0, 1] (eq. ref): number, array or expression.

        Raises
        ------
        ParameterError
            For anything that has no powers.
        """
        if isinstance(stage, type) or not hasattr(stage, "__pow__"):
            raise ParameterError(
                f"stage must be a number, an array or an expression. Received {shown(stage)}. Give t/t_op."
            )
        return stage**3 * (10 - 15 * stage + 6 * stage**2)

    def slip(self, time: "sp.Expr") -> "sp.Expr":
        """Reference slip [m] at a time [s] of [0, operation_time], with exact numbers."""
        import sympy as sp

        d_max, t_op = (sp.Rational(str(rational(v))) for v in (self.target_slip, self.operation_time))
        return d_max * self.shape(time / t_op)

    @property
    def largest_rate(self) -> float:
        """Largest r' [m/s]: 15/8 of the mean, at half of the operation time."""
        return 15 / 8 * self.target_slip / self.operation_time
