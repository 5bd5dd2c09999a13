"""Limits of a pressure that follow it, so that a law does not wind up while friction holds the fault."""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.rationals import to_sympy


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowingLimits:
    """No pressure is further from any earlier one than `width` and, for what the reference moved since, `per_slip`.

    A loop whose pressure stays within P of p*, where dp*/dr is at most `per_slip`, never reaches limits of a width of
    2P: they take nothing from what is proved of it. Where friction holds the fault the pressure changes nothing, what
    is measured does not answer, and an integral goes on; then the pressure is cut off here, and the law is told.

    Attributes
    ----------
    width : Fraction
        [Pa].
    per_slip : Fraction
        [Pa/m].
    STATES : tuple of str
        Largest p + per_slip·r and smallest p − per_slip·r of all samples so far [Pa]; r, the reference, never falls.

    Raises
    ------
    ParameterError
        For a width that is not positive, or a negative change per slip.
    """

    STATES: ClassVar[tuple[str, ...]] = ("highest_pressure", "lowest_pressure")

    width: Fraction
    per_slip: Fraction

    def __post_init__(self) -> None:
        if self.width <= 0 or self.per_slip < 0:
            raise ParameterError(
                "limits that follow a pressure need a positive width, and no negative change per slip. Received "
                f"{float(self.width):.4g} Pa and {float(self.per_slip):.4g} Pa/m. Check their signs."
            )

    def cut(self, asked: sp.Expr, states: tuple[Any, ...], reference: sp.Expr) -> tuple[sp.Expr, tuple[sp.Expr, ...]]:
        """`cut_off` by these limits."""
        return cut_off(asked, states, reference, to_sympy(self.width), to_sympy(self.per_slip))


def cut_off(
    asked: sp.Expr, states: tuple[Any, ...], reference: sp.Expr, width: sp.Expr, per_slip: sp.Expr
) -> tuple[sp.Expr, tuple[sp.Expr, ...]]:
    """The pressure [Pa] that is applied at a sample in place of what is asked for, and `STATES` after it.

    Parameters
    ----------
    asked : Expr
        [Pa].
    states : tuple of Expr
        `STATES` before it.
    reference : Expr
        [m].
    width, per_slip : Expr
        [Pa], [Pa/m].
    """
    highest, lowest = states
    moved = per_slip * reference
    applied = asked + _beyond(highest - moved - width, asked) - _beyond(asked, lowest + moved + width)
    return applied, (highest + _beyond(applied + moved, highest), lowest - _beyond(lowest, applied - moved))


def _beyond(value: sp.Expr, limit: sp.Expr) -> sp.Expr:
    """What a value is more than a limit, exactly 0 if it is not: a run does that without a branch."""
    return sp.Max(value - limit, 0)
