"""The law as a differential equation."""

from typing import Any, ClassVar

import casadi as ca

from quakedesign.loop.schemes.base import Scheme, Stepped


class Continuous(Scheme):
    """Evaluates the law in every Runge–Kutta stage and integrates ξ with the plant, as the paper's runs do.

    It hides what a sampled controller would do (ERRATA 22).
    """

    name: ClassVar[str] = "continuous"

    def pressure(self, loop: Stepped, counter: Any, state: Any, step: float) -> Any:
        """Pressure [Pa] that the law asks for now."""
        return loop.law(state[:2], state[2:], loop.reference(counter * step))[0]

    def advance(self, loop: Stepped, method: Any, counter: Any, state: Any, step: float) -> Any:
        """State after one step of the integrator on plant and law together."""

        def motion(plant: Any, passed: Any, now: Any) -> Any:
            return self._motion(loop, plant, (counter + passed) * step, now)

        return loop.advance(method, motion, state, step)

    def rates(self, loop: Stepped, counter: Any, state: Any, step: float) -> Any:
        """Time derivative of the state; None where friction is set-valued."""
        return None if loop.sticks else self._motion(loop, loop.plant, counter * step, state)

    @staticmethod
    def _motion(loop: Stepped, plant: Any, time: Any, now: Any) -> Any:
        pressure, integral_rates = loop.law(now[:2], now[2:], loop.reference(time))
        return ca.vertcat(plant(time, now[:2], pressure), integral_rates)
