"""Backward Euler of the law."""

from dataclasses import dataclass
from typing import Any, ClassVar

import sympy as sp

from quakedesign.loop.steps import discrete_law
from quakedesign.loop.steps.backward import backward_euler, inclusion
from quakedesign.loop.steps.control_step import Decision
from quakedesign.loop.steps.discrete_law import Law, Values
from quakedesign.loop.steps.inclusion import end_rate
from quakedesign.loop.steps.sampled import Sampled


@dataclass(frozen=True, kw_only=True)
class Implicit(Sampled):
    """Evaluates the law at the end of the step, as the double integrator e1' = e2, e2' = B0·p predicts it.

    The equation and its solution are those of `inclusion`. There is no chatter: once the solution lies at the jump
    e1⁺ = 0 the pressure is −(e2 + e1/T_s)/(T_s·B0), and a disturbance d [m/s²], which the double integrator does not
    know, leaves e1 ≈ T_s²d and e2 ≈ T_s²d'. Acary and Brogliato (2010), Syst. Control Lett. 59, 284; Brogliato,
    Polyakov and Efimov (2020), IEEE Trans. Autom. Control 65, 3707.
    """

    name: ClassVar[str] = "implicit"

    @staticmethod
    def derive(law: Law) -> tuple[sp.Expr, ...]:
        """See `backward_euler`."""
        return backward_euler(law)

    @classmethod
    def decide(cls, found: tuple[sp.Expr, ...], law: Law, known: Values, own: list[Any]) -> Decision:
        """See `Decided.decide`."""
        pull, feed_forward, *ends = found
        problem = inclusion(pull)
        solved = problem.solve(known)
        gain = solved[discrete_law.step] * solved[discrete_law.authority]
        pressure = (solved[end_rate] - solved[discrete_law.rate_error]) / gain
        ahead, *after = discrete_law.values((feed_forward, *map(problem.selected, ends)), solved)
        return Decision(pressure + ahead, after, [])
