"""The law at the measured state."""

from dataclasses import dataclass
from typing import Any, ClassVar

import sympy as sp

from quakedesign.simulation.schemes import lawful
from quakedesign.simulation.schemes.lawful import Law, Values
from quakedesign.simulation.schemes.sampled import Decision, Sampled


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
        """See `Sampled.decide`."""
        pressure, *rates = lawful.values(found, known)
        after = [known[s] + known[lawful.step] * rate for s, rate in zip(law.integrals, rates, strict=True)]
        return Decision(pressure, after, [])
