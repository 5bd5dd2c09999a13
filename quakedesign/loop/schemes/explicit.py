"""Explicit sampled scheme (law at the measured state) and the law in continuous time."""

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import sympy as sp

from quakedesign.loop import discrete_law
from quakedesign.loop.discrete_law import DiscreteLaw, Values
from quakedesign.loop.schemes.base import Decision, Motion, Sampled, Scheme, Stepped


@dataclass(frozen=True, kw_only=True)
class Explicit(Sampled):
    """Evaluates the law at the measured state and moves ξ by one forward Euler step.

    A sliding mode then chatters with |e1| ~ T_s³, |e2| ~ T_s², |e3| ~ T_s (Levant 1993, Int. J. Control 58, 1247).
    """

    name: ClassVar[str] = "explicit"

    @staticmethod
    def derive(law: DiscreteLaw) -> tuple[sp.Expr, ...]:
        """Pressure [Pa] and ξ'."""
        return law.pressure, *law.rates

    @classmethod
    def decide(cls, expressions: tuple[sp.Expr, ...], law: DiscreteLaw, values: Values, own: list[ca.SX]) -> Decision:
        """See `Decided.decide`."""
        pressure, *rates = discrete_law.values(expressions, values)
        after = [values[s] + values[discrete_law.step] * rate for s, rate in zip(law.integrals, rates, strict=True)]
        return Decision(pressure, after, [])


class Continuous(Scheme):
    """Evaluates the law in every Runge–Kutta stage and integrates ξ with the plant, as the paper's runs do.

    It hides the effects of sampling (ERRATA 22).
    """

    name: ClassVar[str] = "continuous"

    def pressure(self, loop: Stepped, counter: ca.SX, state: ca.SX, step: float) -> ca.SX:
        """Pressure [Pa] that the law commands at this instant."""
        return loop.law(state[:2], state[2:], loop.reference(counter * step))[0]

    def advance(self, loop: Stepped, method: Any, counter: ca.SX, state: ca.SX, step: float) -> ca.SX:
        """State after one integrator step of plant and law together."""

        def motion(plant: Motion, passed: ca.SX, now: ca.SX) -> ca.SX:
            return self._motion(loop, plant, (counter + passed) * step, now)

        return loop.advance(method, motion, state, step)

    def rates(self, loop: Stepped, counter: ca.SX, state: ca.SX, step: float) -> ca.SX | None:
        """Time derivative of the state; None where friction is set-valued."""
        return None if loop.sticks else self._motion(loop, loop.plant, counter * step, state)

    @staticmethod
    def _motion(loop: Stepped, plant: Motion, time: ca.SX, now: ca.SX) -> ca.SX:
        pressure, integral_rates = loop.law(now[:2], now[2:], loop.reference(time))
        return ca.vertcat(plant(time, now[:2], pressure), integral_rates)
