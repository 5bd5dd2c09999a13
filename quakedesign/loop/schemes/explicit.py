"""The law at the measured state."""

from dataclasses import dataclass
from typing import Any, ClassVar

import sympy as sp

from quakedesign.loop.steps import discrete_law
from quakedesign.loop.steps.control_step import Decision
from quakedesign.loop.steps.discrete_law import Law, Values
from quakedesign.loop.steps.sampled import Sampled


@dataclass(frozen=True, kw_only=True)
class Explicit(Sampled):
    """Evaluates the law at the measured state and moves ξ by one forward Euler step.

    A sliding mode chatters then with |e1| ~ T_s³, |e2| ~ T_s², |e3| ~ T_s (Levant 1993, Int. J. Control 58, 1247).
    """

    name: ClassVar[str] = "explicit"

    @staticmethod
    def derive(law: Law) -> tuple[sp.Expr, ...]:
        """Pressure [Pa] and ξ'."""
        return law.pressure, *law.rates

    @classmethod
    def decide(cls, found: tuple[sp.Expr, ...], law: Law, known: Values, own: list[Any]) -> Decision:
        """See `Decided.decide`."""
        pressure, *rates = discrete_law.values(found, known)
        after = [known[s] + known[discrete_law.step] * rate for s, rate in zip(law.integrals, rates, strict=True)]
        return Decision(pressure, after, [])
